// SPDX-License-Identifier: MIT
#include <decant/camera/posed_camera.hpp>

#include <limits>

#include <decant/camera/orthographic_camera.hpp>
#include <decant/camera/pinhole_camera.hpp>

#include "catch.hpp"

namespace {

using decant::PinholeCamera;
using decant::Pose;
using decant::PosedCamera;
using Point = decant::Vector3<double>;

const PinholeCamera unposed(600, 500, 320, 240, 640, 480);

// Stands at (0, -2, 1) and looks along +y, its image upright: right is +x, down is -z.
Pose looking_along_y() {
  Eigen::Matrix3d camera_from_world;
  camera_from_world << 1, 0, 0,  //
      0, 0, -1,                  //
      0, 1, 0;
  return {Eigen::Quaterniond(camera_from_world), -camera_from_world * Point(0, -2, 1)};
}

}  // namespace

template class decant::PosedCamera<PinholeCamera>;
template class decant::PosedCamera<decant::OrthographicCamera>;

TEST_CASE("A posed camera sees the world from where it stands") {
  const PosedCamera<PinholeCamera> camera(unposed, looking_along_y());
  CHECK((camera.position() - Point(0, -2, 1)).norm() < 1e-15);
  CHECK((camera.viewing_direction() - Point::UnitY()).norm() < 1e-15);
  const Point x(0.5, 0, 1.2);  // 2 m before the camera, 0.5 m to its right, 0.2 m above
  const decant::Projection seen = camera.project(x);
  CHECK(seen.depth == Approx(2));
  CHECK(seen.pixel.x() == Approx(320 + 600 * 0.25));
  CHECK(seen.pixel.y() == Approx(240 - 500 * 0.1));
  CHECK((camera.unproject(seen.pixel, 2) - x).norm() < 1e-14);
  CHECK((camera.unproject(seen.pixel, 0) - camera.position()).norm() < 1e-15);
  CHECK((camera.world_from_camera() * Point(0, 0, 2) - Point(0, 0, 1)).norm() < 1e-14);
  CHECK_FALSE(camera.project({0, -3, 1}).projected());

  // the Jacobian is by the world's coordinates: 600 px / 2 m to the right, 500 px / 2 m down for a step down
  const Eigen::Matrix<double, 2, 3> rate = camera.jacobian({0, 0, 1});
  CHECK(rate(0, 0) == Approx(300));
  CHECK(rate(1, 2) == Approx(-250));
  CHECK(rate.col(1).norm() < 1e-12);
}

TEST_CASE("A posed camera may be moved") {
  PosedCamera<PinholeCamera> camera(unposed);
  CHECK(camera.position().norm() == 0);
  Pose longer = looking_along_y();
  longer.rotation.coeffs() *= 1.5;  // is normalised
  camera.set_pose(longer);
  CHECK((camera.position() - Point(0, -2, 1)).norm() < 1e-14);
  Pose broken;
  broken.translation.x() = std::numeric_limits<double>::quiet_NaN();
  camera.set_pose(broken);
  CHECK_FALSE(camera.project({0, 0, 1}).visible);
  CHECK(camera.project({0, 0, 1}).pixel.allFinite());
}

TEST_CASE("A pose that is none is refused in one line") {
  Pose pose;
  pose.translation.y() = std::numeric_limits<double>::infinity();
  CHECK_THROWS_WITH(PosedCamera<PinholeCamera>(unposed, pose),
                    "PosedCamera: camera_from_world must be finite, got NaN or infinity");
  pose = {};
  pose.rotation.coeffs().setZero();
  CHECK_THROWS_WITH(PosedCamera<PinholeCamera>(unposed, pose),
                    "PosedCamera: norm of camera_from_world's quaternion must be near 1, got 0");
}
