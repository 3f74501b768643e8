// SPDX-License-Identifier: MIT
#include <decant/camera/depth_buffer.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include <decant/boundary/rigid_bodies.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/camera/ray_occlusion.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/testing/camera.hpp>

#include "camera/occluded_scene.hpp"
#include "catch.hpp"

namespace {

using decant::BoundingVolumeHierarchy;
using decant::DepthBuffer;
using decant::Image;
using decant::Index;
using decant::PinholeCamera;
using decant::Pose;
using decant::PosedCamera;
using decant::RayOcclusion;
using decant::Threads;
using decant_test::Point;
using decant_test::pose_of;

template <class Camera>
DepthBuffer<Camera> drawn(const Camera& camera, int threads = 1, bool backward = false) {
  DepthBuffer<Camera> buffer(PosedCamera<Camera>(camera, decant_test::camera_from_world()));
  auto bodies = decant_test::bodies_before_camera();
  if (backward) {
    std::reverse(bodies.begin(), bodies.end());
  }
  for (const auto& body : bodies) {
    buffer.draw(BoundingVolumeHierarchy(body.mesh), body.world_from_body, Threads{threads});
  }
  return buffer;
}

template <class Camera>
RayOcclusion<Camera> rays_of(const Camera& camera) {
  RayOcclusion<Camera> occlusion(PosedCamera<Camera>(camera, decant_test::camera_from_world()));
  for (const auto& body : decant_test::bodies_before_camera()) {
    occlusion.add(std::make_shared<const BoundingVolumeHierarchy>(body.mesh), body.world_from_body);
  }
  return occlusion;
}

// Pixels where the depth jumps, by more than surfaces at a slant do, to one of the eight pixels around.
Image<bool> edges_of(const Image<float>& depth) {
  Image<bool> edge = Image<bool>::Constant(depth.rows(), depth.cols(), false);
  for (Index v = 0; v < depth.rows(); ++v) {
    for (Index u = 0; u < depth.cols(); ++u) {
      for (Index j = std::max<Index>(v - 1, 0); j <= std::min(v + 1, depth.rows() - 1); ++j) {
        for (Index i = std::max<Index>(u - 1, 0); i <= std::min(u + 1, depth.cols() - 1); ++i) {
          const bool both = std::isfinite(depth(v, u)) && std::isfinite(depth(j, i));
          const bool neither = !std::isfinite(depth(v, u)) && !std::isfinite(depth(j, i));
          edge(v, u) = edge(v, u) || !(neither || (both && std::abs(depth(v, u) - depth(j, i)) < 0.02F));
        }
      }
    }
  }
  return edge;
}

template <class Camera>
void compare_with_rays(const Camera& camera) {
  const auto buffer = drawn(camera);
  const auto rays = rays_of(camera);
  REQUIRE(buffer.depth().rows() == camera.height());
  REQUIRE(buffer.depth().cols() == camera.width());
  const Image<bool> edge = edges_of(buffer.depth());
  int wall = 0, away = 0, wrong = 0, wrong_at_edge = 0;
  for (Index v = 0; v < buffer.depth().rows(); ++v) {
    for (Index u = 0; u < buffer.depth().cols(); ++u) {
      const auto expected = rays.first_wall({static_cast<double>(u), static_cast<double>(v)});
      const double found = buffer.depth()(v, u);
      wall += expected ? 1 : 0;
      away += edge(v, u) ? 0 : 1;
      // the image is in float
      const bool same = expected ? std::abs(found / *expected - 1) < 1e-6 : found > 1e30;
      (edge(v, u) ? wrong_at_edge : wrong) += same ? 0 : 1;
    }
  }
  CHECK(wrong == 0);
  // both go by the ray through the pixel's centre, so that only rounding may tell them apart along edges
  CHECK(wrong_at_edge <= 2);
  CHECK(wall > 1000);
  CHECK(away > buffer.depth().size() / 2);

  // Points: the buffer asks four pixels, so both agree but where a silhouette runs between these, or where the point is
  // as near to the first wall as that changes among them. Silhouettes are looked for in an image four times finer, as
  // tips of triangles may pass between the centres of pixels.
  Eigen::Matrix<double, 2, 3> coarse_from_fine;
  coarse_from_fine << 0.25, 0, -0.375, 0, 0.25, -0.375;
  const decant::AffineRegisteredCamera<Camera> fine(camera, coarse_from_fine, 4 * camera.width(), 4 * camera.height());
  const Image<bool> fine_edge = edges_of(drawn(fine).depth());
  std::mt19937 random(5);
  int hidden = 0, free = 0, differ = 0;
  for (int n = 0; n < 20000; ++n) {
    const Point x = decant_test::random_point(random, Point::Zero(), 0.4);
    const auto seen = buffer.camera().project(x);
    const auto u = static_cast<Index>(std::floor(seen.pixel.x()));
    const auto v = static_cast<Index>(std::floor(seen.pixel.y()));
    if (u < 0 || v < 0 || u + 1 >= edge.cols() || v + 1 >= edge.rows() ||
        fine_edge.block<6, 6>(4 * v + 1, 4 * u + 1).any()) {
      continue;
    }
    const auto around = buffer.depth().template block<2, 2>(v, u).template cast<double>();
    if (seen.depth > around.minCoeff() - 2e-3 && seen.depth < around.maxCoeff() + 2e-3) {
      continue;
    }
    const bool expected = rays.hidden(x);
    (expected ? hidden : free) += 1;
    differ += buffer.hidden(x) == expected ? 0 : 1;
  }
  CHECK(differ == 0);
  CHECK(hidden > 500);
  CHECK(free > 1000);
}

decant::TriangleMesh square(double half) {
  decant::TriangleMesh mesh;
  mesh.vertices = {{-half, -half, 0}, {half, -half, 0}, {half, half, 0}, {-half, half, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

}  // namespace

template class decant::DepthBuffer<PinholeCamera>;
template class decant::DepthBuffer<decant::DistortedPinholeCamera>;
template class decant::DepthBuffer<decant::OrthographicCamera>;

TEST_CASE("Depth buffer and rays agree but on silhouettes") {
  compare_with_rays(decant_test::pinhole);
  compare_with_rays(decant_test::orthographic);
  compare_with_rays(decant_test::lens);
  compare_with_rays(decant_test::registered(decant_test::pinhole));
  compare_with_rays(decant_test::registered(decant_test::orthographic));
  compare_with_rays(decant_test::registered(decant_test::lens));
}

TEST_CASE("The depth image does not depend on threads or on the order of bodies") {
  const auto check = [](const auto& camera) {
    const Image<float> depth = drawn(camera).depth();
    CHECK(depth.minCoeff() < 1);
    CHECK((drawn(camera, 2).depth() == depth).all());
    CHECK((drawn(camera, 4).depth() == depth).all());
    CHECK((drawn(camera, 1, true).depth() == depth).all());
  };
  check(decant_test::pinhole);
  check(decant_test::lens);
  check(decant_test::orthographic);
}

TEST_CASE("The depth buffer keeps the laws of occlusion") {
  const auto check = [](const auto& buffer) {
    for (const auto& law : decant::testing::occlusion_laws(buffer, buffer.camera(), 0.3, 2)) {
      INFO(law.text());
      CHECK(law.holds());
    }
  };
  check(drawn(decant_test::pinhole));
  check(drawn(decant_test::lens));
  check(drawn(decant_test::orthographic));
}

// A plane n . x = d has the depth d / (n . ray) on the ray with z = 1.
TEST_CASE("A floor that reaches from behind the camera to afar is drawn with its perspective") {
  const PinholeCamera camera(130, 128, 79.2, 60.7, 160, 120);
  DepthBuffer<PinholeCamera> buffer{PosedCamera<PinholeCamera>(camera)};
  // 0.3 m below the camera (y down), 50 m each way: its two triangles share an edge under the camera
  const Pose floor = pose_of(std::acos(-1.0) / 2, Point::UnitX(), Point(0, 0.3, 0));
  const BoundingVolumeHierarchy surface(square(50));
  buffer.draw(surface, floor, {1});
  int drawn_pixels = 0, wrong = 0;
  for (Index v = 0; v < 120; ++v) {
    for (Index u = 0; u < 160; ++u) {
      const double down = (static_cast<double>(v) - 60.7) / 128;
      const double z = 0.3 / down;
      const double found = buffer.depth()(v, u);
      const bool expected = down > 0 && z < 50;
      drawn_pixels += expected ? 1 : 0;
      // in float
      wrong += (expected ? std::abs(found / z - 1) < 1e-6 : std::isinf(found)) ? 0 : 1;
    }
  }
  CHECK(wrong == 0);
  CHECK(drawn_pixels > 9000);

  // liquid on the floor is seen, though pixels a row apart differ by metres of depth; liquid below is not
  std::mt19937 random(3);
  int hidden_on = 0, hidden_below = 0, count = 0;
  for (int n = 0; n < 2000; ++n) {
    const Eigen::Vector2d pixel(static_cast<double>(random() % 15800) / 100,
                                75 + static_cast<double>(random() % 4000) / 100);
    const double z = 0.3 / ((pixel.y() - 60.7) / 128);
    ++count;
    hidden_on += buffer.hidden(camera.unproject(pixel, z)) ? 1 : 0;
    // beyond the depth of the upper row of pixels
    hidden_below += buffer.hidden(camera.unproject(pixel, 0.3 / ((std::floor(pixel.y()) - 60.7) / 128) + 2e-3)) ? 1 : 0;
  }
  CHECK(hidden_on == 0);
  CHECK(hidden_below == count);

  buffer.clear();
  CHECK(std::isinf(buffer.depth().minCoeff()));
  buffer.draw(surface, pose_of(0, Point::UnitX(), Point(0, 0, -1)), {1});  // behind the camera
  CHECK(std::isinf(buffer.depth().minCoeff()));
}

TEST_CASE("An orthographic camera draws depth that changes evenly") {
  const decant::OrthographicCamera camera(100, 80, 60, 160, 120);
  DepthBuffer<decant::OrthographicCamera> buffer{PosedCamera<decant::OrthographicCamera>(camera)};
  buffer.draw(BoundingVolumeHierarchy(square(3)), pose_of(-0.7, Point::UnitY(), Point(0, 0, 1)), {1});
  int wrong = 0, before = 0;
  for (Index v = 0; v < 120; ++v) {
    for (Index u = 0; u < 160; ++u) {
      const double z =
          1 + std::tan(0.7) * (static_cast<double>(u) - 80) / 100;  // the plane also goes behind the camera
      before += z > 0 ? 1 : 0;
      const double found = buffer.depth()(v, u);
      wrong += (z > 0 ? std::abs(found - z) < 1e-6 : std::isinf(found)) ? 0 : 1;
    }
  }
  CHECK(wrong == 0);
  CHECK(before > 15000);
}

TEST_CASE("Triangles that share edges leave no gap, at any size") {
  for (const double radius : {0.3, 0.01}) {
    const PinholeCamera camera(400, 400, 100, 100, 201, 201);
    DepthBuffer<PinholeCamera> buffer{PosedCamera<PinholeCamera>(camera)};
    const decant::Sphere ball{Point(0, 0, 2 * radius), radius};
    buffer.draw(BoundingVolumeHierarchy(ball.mesh()), {}, {1});
    // the ball's outline is a circle of radius 400 tan(30 deg) = 231 px: it fills the image
    CHECK(buffer.depth().maxCoeff() < 2 * radius);
    CHECK(buffer.depth()(100, 100) == Approx(radius).epsilon(1e-3));
  }
}

TEST_CASE("A lens shows nothing at pixels on which nothing falls") {
  // reaches 0.703 focal lengths
  const decant::DistortedPinholeCamera camera(PinholeCamera(100, 100, 80, 60, 160, 120), {-0.3, 0, 0, 0, 0});
  DepthBuffer<decant::DistortedPinholeCamera> buffer{PosedCamera<decant::DistortedPinholeCamera>(camera)};
  buffer.draw(BoundingVolumeHierarchy(square(20)), pose_of(0, Point::UnitX(), Point(0, 0, 1)), {2});
  int wrong = 0;
  for (Index v = 0; v < 120; ++v) {
    for (Index u = 0; u < 160; ++u) {
      const double r = std::hypot(static_cast<double>(u) - 80, static_cast<double>(v) - 60);
      wrong += (r < 70 && buffer.depth()(v, u) != 1.0F) || (r > 71 && std::isfinite(buffer.depth()(v, u))) ? 1 : 0;
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("Another renderer's depth image is taken instead") {
  const PinholeCamera camera(100, 100, 2, 1, 5, 3);
  DepthBuffer<PinholeCamera> buffer(PosedCamera<PinholeCamera>(camera), 0.01);
  Image<float> depth = Image<float>::Constant(3, 5, 0.5F);
  depth(0, 0) = 0;
  depth(1, 0) = std::numeric_limits<float>::quiet_NaN();
  depth(2, 0) = -1;
  depth(0, 1) = std::numeric_limits<float>::infinity();
  depth(0, 4) = std::numeric_limits<float>::denorm_min();
  REQUIRE(buffer.accept(depth));
  CHECK(std::isinf(buffer.depth()(0, 0)));
  CHECK(std::isinf(buffer.depth()(1, 0)));
  CHECK(std::isinf(buffer.depth()(2, 0)));
  CHECK(std::isinf(buffer.depth()(0, 1)));
  CHECK(buffer.depth()(0, 4) > 0);
  CHECK(buffer.depth()(1, 3) == 0.5F);
  CHECK(buffer.hidden(camera.unproject({3, 1}, 0.511)));
  CHECK_FALSE(buffer.hidden(camera.unproject({3, 1}, 0.509)));
  CHECK_FALSE(buffer.hidden(camera.unproject({0, 1}, 9)));
  CHECK(buffer.hidden(camera.unproject({4.3, 2.3}, 0.6)));    // half a pixel of border
  CHECK_FALSE(buffer.hidden(camera.unproject({4.7, 1}, 9)));  // outside of the image
  CHECK_FALSE(buffer.hidden(camera.unproject({3, 1}, -1)));

  CHECK_FALSE(buffer.accept(Image<float>::Constant(5, 3, 0.1F)));
  CHECK(buffer.depth()(1, 3) == 0.5F);
  // part of a larger image, as a driver hands it out
  Image<float> large = Image<float>::Constant(10, 10, 0.25F);
  large(5, 5) = 0.75F;
  REQUIRE(buffer.accept(large.block(4, 2, 3, 5)));
  CHECK(buffer.depth()(1, 3) == 0.75F);
}

TEST_CASE("The bodies of a simulation are drawn where they are at the time") {
  decant::RigidBodies<float> bodies;
  const decant::PoseTrack passing(
      {{0.0, pose_of(0, Point::UnitX(), Point(0, 0, 0.5))}, {1.0, pose_of(0, Point::UnitX(), Point(0.2, 0, 0.5))}});
  const decant::Box box{Point(-0.05, -0.05, -0.05), Point(0.05, 0.05, 0.05)};
  bodies.add<decant::CubicSpline<float>>("passing", box, passing, decant::Slip::Free, 0.005, 0.005, {1});
  DepthBuffer<PinholeCamera> buffer{PosedCamera<PinholeCamera>(decant_test::pinhole)};
  buffer.draw_bodies(bodies, 0, {1});
  CHECK(buffer.depth()(61, 79) == Approx(0.45));
  CHECK(buffer.hidden(Point(0, 0, 1)));
  buffer.draw_bodies(bodies, 1, {1});
  CHECK_FALSE(buffer.hidden(Point(0, 0, 1)));
  CHECK(buffer.hidden(Point(0.4, 0, 1)));
  // the camera goes along with it
  buffer.set_camera_pose(pose_of(0, Point::UnitX(), Point(-0.2, 0, 0)));
  buffer.draw_bodies(bodies, 1, {1});
  CHECK(buffer.depth()(61, 79) == Approx(0.45));
}

TEST_CASE("A depth buffer without a margin is refused in one line") {
  CHECK_THROWS_WITH(DepthBuffer<PinholeCamera>(PosedCamera<PinholeCamera>(decant_test::pinhole),
                                               std::numeric_limits<double>::quiet_NaN()),
                    "DepthBuffer: margin [m] must be >= 0 and finite, got nan");
}
