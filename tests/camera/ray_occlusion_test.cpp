// SPDX-License-Identifier: MIT
#include <decant/camera/ray_occlusion.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include <decant/boundary/rigid_bodies.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/camera/no_occlusion.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/testing/camera.hpp>

#include "camera/occluded_scene.hpp"
#include "catch.hpp"

namespace {

using decant::BoundingVolumeHierarchy;
using decant::PinholeCamera;
using decant::Pose;
using decant::PosedCamera;
using decant::RayOcclusion;
using decant_test::Point;
using decant_test::pose_of;
using decant_test::random_point;

template <class Camera>
RayOcclusion<Camera> scene_before(const Camera& camera, double margin) {
  RayOcclusion<Camera> occlusion(PosedCamera<Camera>(camera, decant_test::camera_from_world()), margin);
  for (const auto& body : decant_test::bodies_before_camera()) {
    occlusion.add(std::make_shared<const BoundingVolumeHierarchy>(body.mesh), body.world_from_body);
  }
  return occlusion;
}

template <class Camera>
void compare_with_every_triangle(const Camera& camera) {
  const auto bodies = decant_test::bodies_before_camera();
  for (const double margin : {0.0, 0.02}) {
    const auto occlusion = scene_before(camera, margin);
    const PosedCamera<Camera>& posed = occlusion.camera();
    std::mt19937 random(7);
    int hidden = 0, free = 0, wrong = 0;
    for (int n = 0; n < 4000; ++n) {
      const Point x = random_point(random, Point::Zero(), 0.4);
      const auto seen = posed.project(x);
      REQUIRE(seen.projected());
      const Point begin = posed.unproject(seen.pixel, 0);
      const Point end = x + margin * (begin - x).normalized();
      const bool expected = decant_test::first_meeting(bodies, begin, end).has_value();
      (expected ? hidden : free) += 1;
      wrong += occlusion.hidden(x) == expected ? 0 : 1;
    }
    CHECK(wrong == 0);
    CHECK(hidden > 500);
    CHECK(free > 500);

    int walls = 0;
    for (int n = 0; n < 500; ++n) {
      const Eigen::Vector2d pixel(static_cast<double>(random() % 120), static_cast<double>(random() % 90));
      const Point begin = posed.unproject(pixel, 0);
      const auto expected = decant_test::first_meeting(bodies, begin, posed.unproject(pixel, 3));
      const auto found = occlusion.first_wall(pixel);
      REQUIRE(found.has_value() == expected.has_value());
      if (found) {
        ++walls;
        // a few roundings of metres over sines of triangles at a slant
        REQUIRE(*found == Approx(3 * *expected).epsilon(1e-9));
      }
    }
    CHECK(walls > 50);
  }
}

// At the origin, looking along +z.
RayOcclusion<PinholeCamera> before_shape(const decant::BodyShape& shape, double margin) {
  RayOcclusion<PinholeCamera> occlusion{PosedCamera<PinholeCamera>(decant_test::pinhole), margin};
  occlusion.add(shape);
  return occlusion;
}

}  // namespace

template class decant::RayOcclusion<PinholeCamera>;
template class decant::RayOcclusion<decant::DistortedPinholeCamera>;
template class decant::RayOcclusion<decant::OrthographicCamera>;

TEST_CASE("Rays against hierarchies answer as a look at every triangle does") {
  compare_with_every_triangle(decant_test::pinhole);
  compare_with_every_triangle(decant_test::lens);
  compare_with_every_triangle(decant_test::orthographic);
  compare_with_every_triangle(decant_test::registered(decant_test::lens));
}

TEST_CASE("Rays keep the laws of occlusion") {
  const auto check = [](const auto& occlusion, const auto& camera) {
    for (const auto& law : decant::testing::occlusion_laws(occlusion, camera, 0.3, 2)) {
      INFO(law.text());
      CHECK(law.holds());
    }
  };
  const auto rays = scene_before(decant_test::pinhole, 1e-3);
  check(rays, rays.camera());
  const auto bent = scene_before(decant_test::lens, 1e-3);
  check(bent, bent.camera());
  const auto parallel = scene_before(decant_test::orthographic, 1e-3);
  check(parallel, parallel.camera());
  check(decant::NoOcclusion{}, rays.camera());
}

TEST_CASE("The laws notice what is wrong with an occlusion") {
  const PosedCamera<PinholeCamera> camera(decant_test::pinhole, decant_test::camera_from_world());
  const auto broken = [&camera](const auto& occlusion) {
    int count = 0;
    for (const auto& law : decant::testing::occlusion_laws(occlusion, camera, 0.3, 2)) {
      count += law.holds() ? 0 : 1;
    }
    return count;
  };
  struct Slab {  // hides what is inside of a wall, but not what is behind it
    PosedCamera<PinholeCamera> camera;
    bool hidden(const Point& x) const noexcept {
      const double z = camera.project(x).depth;
      return z > 0.8 && z < 1.2;
    }
  };
  struct Behind {
    PosedCamera<PinholeCamera> camera;
    bool hidden(const Point& x) const noexcept { return !camera.project(x).projected(); }
  };
  CHECK(broken(Slab{camera}) > 0);
  CHECK(broken(Behind{camera}) > 0);
}

TEST_CASE("A ball hides what is in its shadow") {
  const Point center(0.1, 0.05, 0.8);
  const double radius = 0.12;
  const auto occlusion = before_shape(decant::Sphere{center, radius}, 0);
  std::mt19937 random(9);
  int hidden = 0, free = 0, wrong = 0;
  for (int n = 0; n < 20000; ++n) {
    const Point x = random_point(random, center, 0.3);
    const double tangent = std::sqrt(center.squaredNorm() - radius * radius);  // length of the tangent from the camera
    const double off = (center - center.dot(x.normalized()) * x.normalized()).norm();
    const double from_surface = (x - center).norm() - radius;
    // the mesh is a polyhedron, up to 0.1 mm within the ball (twice 0.03 mm along two circles, with room); points that
    // near to the shadow's border are not asked about
    if (std::abs(off - radius) < 2e-4 || std::abs(from_surface) < 2e-4) {
      continue;
    }
    const bool expected = from_surface < 0 || (off < radius && x.norm() > tangent);
    (expected ? hidden : free) += 1;
    wrong += occlusion.hidden(x) == expected ? 0 : 1;
  }
  CHECK(wrong == 0);
  CHECK(hidden > 2000);
  CHECK(free > 2000);
}

TEST_CASE("A box hides what is behind its face") {
  const auto occlusion = before_shape(decant::Box{Point(-0.1, -0.1, 0.5), Point(0.1, 0.2, 0.6)}, 0);
  std::mt19937 random(10);
  int hidden = 0, wrong = 0;
  for (int n = 0; n < 20000; ++n) {
    const Point x = random_point(random, Point(0, 0, 0.8), 0.6);
    if (x.z() < 1e-3) {
      continue;
    }
    // the camera is before the face at z = 0.5: lines of sight enter through it, or through a side and leave by the
    // back
    const auto within = [&x](double z) {
      const double a = x.x() / x.z() * z, b = x.y() / x.z() * z;
      return a > -0.1 && a < 0.1 && b > -0.1 && b < 0.2;
    };
    const bool expected = x.z() > 0.5 && within(0.5);  // seen from its middle axis no side shows
    hidden += expected ? 1 : 0;
    wrong += occlusion.hidden(x) == expected ? 0 : 1;
  }
  CHECK(wrong == 0);
  CHECK(hidden > 500);
}

TEST_CASE("Behind the camera nothing is hidden, whatever stands there") {
  const auto occlusion = before_shape(decant::Box{Point(-1, -1, -0.6), Point(1, 1, -0.5)}, 0);
  CHECK_FALSE(occlusion.hidden(Point(0, 0, -1)));
  CHECK_FALSE(occlusion.hidden(Point(0, 0, 1)));
  CHECK_FALSE(occlusion.first_wall({80, 60}));
}

TEST_CASE("A wall does not hide what touches it on the camera's side, but does what touches it from behind") {
  for (const double turn : {0.0, 0.9}) {  // square, and at a slant
    RayOcclusion<PinholeCamera> occlusion{PosedCamera<PinholeCamera>(decant_test::pinhole)};
    CHECK(occlusion.margin() == 1e-3);
    const Pose wall = pose_of(turn, Point::UnitX(), Point(0, 0, 0.7));
    occlusion.add(decant::Box{Point(-0.3, -0.3, 0), Point(0.3, 0.3, 0.002)}, wall);
    const double slant = std::cos(turn);
    const auto at = [&wall](double height) { return wall * Point(0, 0, height); };
    CHECK_FALSE(occlusion.hidden(at(-0.0025)));                 // a particle's radius before it
    CHECK_FALSE(occlusion.hidden(at(0)));                       // on it
    CHECK_FALSE(occlusion.hidden(at(0.9e-3 * slant * slant)));  // sunk in, as a pose that is off by a little has it
    CHECK(occlusion.hidden(at(1.1e-3 / slant)));                // too deep
    CHECK(occlusion.hidden(at(0.002)));                         // on the back
    CHECK(occlusion.hidden(at(0.0045)));                        // a particle's radius behind the back
  }
}

TEST_CASE("Bodies and the camera may move without anything built anew") {
  auto moved = scene_before(decant_test::pinhole, 1e-3);
  const Pose camera = pose_of(-0.3, Point(2, 1, 0), Point(0.1, 0.05, 1.2));
  const auto bodies = decant_test::bodies_before_camera();
  const auto elsewhere = [](const Pose& pose) { return pose_of(1.1, Point(0, 1, 1), Point(0.05, 0, 0.1)) * pose; };
  RayOcclusion<PinholeCamera> anew(PosedCamera<PinholeCamera>(decant_test::pinhole, camera), 1e-3);
  for (std::uint32_t b = 0; b < bodies.size(); ++b) {
    CHECK(anew.add(std::make_shared<const BoundingVolumeHierarchy>(bodies[b].mesh),
                   elsewhere(bodies[b].world_from_body)) == b);
  }
  moved.set_pose(0, elsewhere(bodies[0].world_from_body));
  moved.set_camera_pose(camera);
  moved.set_pose(1, elsewhere(bodies[1].world_from_body));
  moved.set_pose(2, elsewhere(bodies[2].world_from_body));
  std::mt19937 random(11);
  const auto before = scene_before(decant_test::pinhole, 1e-3);
  int differ_from_new = 0, differ_from_old = 0;
  for (int n = 0; n < 2000; ++n) {
    const Point x = random_point(random, Point::Zero(), 0.4);
    differ_from_new += moved.hidden(x) == anew.hidden(x) ? 0 : 1;
    differ_from_old += moved.hidden(x) == before.hidden(x) ? 0 : 1;
  }
  CHECK(differ_from_new == 0);
  CHECK(differ_from_old > 100);

  Pose broken;
  broken.translation.x() = std::numeric_limits<double>::quiet_NaN();
  moved.set_pose(0, broken);
  moved.set_pose(1, broken);
  moved.set_pose(2, broken);
  CHECK_FALSE(moved.hidden(Point(0, 0, 0)));
  CHECK_FALSE(moved.first_wall({80, 60}));
}

TEST_CASE("The bodies of a simulation hide where they are at the time") {
  decant::RigidBodies<float> bodies;
  const decant::PoseTrack still(pose_of(0, Point::UnitX(), Point(-0.3, 0, 0.5)));
  const decant::PoseTrack passing(
      {{0.0, pose_of(0, Point::UnitX(), Point(0, 0, 0.5))}, {1.0, pose_of(0, Point::UnitX(), Point(0.2, 0, 0.5))}});
  const decant::Box box{Point(-0.05, -0.05, -0.05), Point(0.05, 0.05, 0.05)};
  bodies.add<decant::CubicSpline<float>>("still", box, still, decant::Slip::Free, 0.005, 0.005, {1});
  bodies.add<decant::CubicSpline<float>>("passing", box, passing, decant::Slip::Free, 0.005, 0.005, {1});
  RayOcclusion<PinholeCamera> occlusion{PosedCamera<PinholeCamera>(decant_test::pinhole)};
  occlusion.add_bodies(bodies, 0);
  CHECK(occlusion.size() == 2);
  CHECK(occlusion.hidden(Point(0, 0, 1)));
  CHECK(occlusion.hidden(Point(-0.6, 0, 1)));
  occlusion.follow(bodies, 1);
  CHECK_FALSE(occlusion.hidden(Point(0, 0, 1)));
  CHECK(occlusion.hidden(Point(0.4, 0, 1)));
  CHECK(occlusion.hidden(Point(-0.6, 0, 1)));
}

TEST_CASE("Points in float are asked in batches too") {
  const auto occlusion = scene_before(decant_test::pinhole, 1e-3);
  std::mt19937 random(12);
  decant::PointArray<float> points(3, 3000);
  for (decant::Index i = 0; i < points.cols(); ++i) {
    points.col(i) = random_point(random, Point::Zero(), 0.4).cast<float>();
  }
  for (const int threads : {1, 2, 4}) {
    std::vector<std::uint8_t> hidden(3000, 9);
    decant::find_hidden(occlusion, points, decant::Threads{threads}, hidden);
    int wrong = 0;
    for (decant::Index i = 0; i < points.cols(); ++i) {
      const bool expected = occlusion.hidden(points.col(i).cast<double>());
      wrong += hidden[static_cast<std::size_t>(i)] == (expected ? 1 : 0) ? 0 : 1;
    }
    CHECK(wrong == 0);
  }
}

namespace {

// Points that shake, bodies and a camera that move: what is remembered of earlier frames may not change an answer.
template <class Camera>
void compare_memory(const Camera& camera, double margin, const std::vector<Pose>& cameras_from_world) {
  auto occlusion = scene_before(camera, margin);
  std::mt19937 random(21);
  decant::PointArray<double> points(3, 3000);
  for (decant::Index i = 0; i < points.cols(); ++i) {
    points.col(i) = random_point(random, Point::Zero(), 0.4);
  }
  std::vector<std::uint8_t> hidden(3000, 9);
  int hidden_points = 0, free_points = 0, wrong = 0;
  for (std::size_t frame = 0; frame < 3 * cameras_from_world.size(); ++frame) {
    if (frame % 3 == 0) {
      occlusion.set_camera_pose(cameras_from_world[frame / 3]);
    } else if (frame % 3 == 1) {
      occlusion.set_pose(1, pose_of(0.3 * static_cast<double>(frame), Point(0, 1, -1), Point(-0.1, 0.1, -0.15)));
    }
    for (int pass = 0; pass < 3; ++pass) {
      for (decant::Index i = 0; i < points.cols(); ++i) {
        points.col(i) += random_point(random, Point::Zero(), 0.003);
      }
      occlusion.find_hidden(points, decant::Threads{1 << pass}, hidden);
      for (decant::Index i = 0; i < points.cols(); ++i) {
        const bool expected = occlusion.hidden(points.col(i));
        (expected ? hidden_points : free_points) += 1;
        wrong += hidden[static_cast<std::size_t>(i)] == (expected ? 1 : 0) ? 0 : 1;
      }
    }
  }
  CHECK(wrong == 0);
  CHECK(hidden_points > 2000);
  CHECK(free_points > 2000);
}

}  // namespace

TEST_CASE("What rays remember of earlier frames changes no answer") {
  const Pose far = decant_test::camera_from_world();
  // among the bodies: some are behind the camera, some reach through its plane
  const Pose near = pose_of(0.1, Point(0, 1, 0), Point(0, 0, 0.12)),
             within = pose_of(2, Point(0, 1, 0), Point(0, 0, 0));
  const std::vector<Pose> poses{far, pose_of(0.5, Point(1, -1, 0.3), Point(0.1, 0, 0.7)), near, within, far};
  for (const double margin : {0.0, 1e-3, 0.02}) {
    compare_memory(decant_test::pinhole, margin, poses);
    compare_memory(decant_test::lens, margin, poses);
    compare_memory(decant_test::orthographic, margin, {far, near});
    compare_memory(decant_test::registered(decant_test::pinhole), margin, {far, near});
  }
  // a plate that is cut by the camera's plane right beside its eye, at a slant: its first piece is in most directions
  RayOcclusion<PinholeCamera> plate{PosedCamera<PinholeCamera>(decant_test::pinhole), 1e-3};
  plate.add(decant::Box{Point(-0.1, -0.1, 0), Point(0.1, 0.1, 1e-3)}, pose_of(0.8, Point(1, 0, 0), Point(0, 0.001, 0)));
  std::mt19937 random(5);
  decant::PointArray<double> before_eye(3, 2000);
  std::vector<std::uint8_t> by_plate(2000);
  for (decant::Index i = 0; i < before_eye.cols(); ++i) {
    before_eye.col(i) = random_point(random, Point(0, 0, 0.06), 0.05);
  }
  plate.find_hidden(before_eye, {}, by_plate);
  int behind_plate = 0;
  for (decant::Index i = 0; i < before_eye.cols(); ++i) {
    const bool expected = plate.hidden(before_eye.col(i));
    behind_plate += expected ? 1 : 0;
    REQUIRE((by_plate[static_cast<std::size_t>(i)] != 0) == expected);
  }
  CHECK(behind_plate > 500);
  const auto nowhere = pose_of(0.4, Point(1, 0, 0), Point(0, std::numeric_limits<double>::quiet_NaN(), 1));
  auto occlusion = scene_before(decant_test::pinhole, 1e-3);
  occlusion.set_pose(0, nowhere);
  decant::PointArray<float> points = decant::PointArray<float>::Random(3, 1000) * 0.4F;
  std::vector<std::uint8_t> hidden(1000);
  occlusion.find_hidden(points, {}, hidden);
  for (decant::Index i = 0; i < points.cols(); ++i) {
    REQUIRE((hidden[static_cast<std::size_t>(i)] != 0) == occlusion.hidden(points.col(i).cast<double>()));
  }
}

TEST_CASE("What is no occlusion is refused in one line") {
  const PosedCamera<PinholeCamera> camera(decant_test::pinhole);
  CHECK_THROWS_WITH(RayOcclusion<PinholeCamera>(camera, -1.0),
                    "RayOcclusion: margin [m] must be >= 0 and finite, got -1");
  CHECK_THROWS_WITH(RayOcclusion<PinholeCamera>(camera, std::numeric_limits<double>::quiet_NaN()),
                    "RayOcclusion: margin [m] must be >= 0 and finite, got nan");
  RayOcclusion<PinholeCamera> occlusion(camera);
  CHECK_THROWS_WITH(occlusion.add(std::shared_ptr<const BoundingVolumeHierarchy>()),
                    "RayOcclusion: surface of a body must be given, got none");
}
