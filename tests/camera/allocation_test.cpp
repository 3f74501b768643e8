// SPDX-License-Identifier: MIT
// Nothing that is called every frame allocates.

#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include <decant/camera/depth_buffer.hpp>
#include <decant/camera/ray_occlusion.hpp>

#include "allocation_count.hpp"
#include "camera/occluded_scene.hpp"
#include "catch.hpp"

using decant_test::allocations;
using decant_test::watching;

TEST_CASE("Occlusion takes no memory in a frame") {
  using decant::BoundingVolumeHierarchy;
  using decant::PosedCamera;
  std::vector<std::shared_ptr<const BoundingVolumeHierarchy>> surfaces;
  for (const auto& body : decant_test::bodies_before_camera()) {
    surfaces.push_back(std::make_shared<const BoundingVolumeHierarchy>(body.mesh));
  }
  const PosedCamera<decant::PinholeCamera> posed(decant_test::pinhole, decant_test::camera_from_world());
  const PosedCamera<decant::DistortedPinholeCamera> lens(decant_test::lens, decant_test::camera_from_world());
  decant::RayOcclusion<decant::PinholeCamera> rays(posed);
  decant::RayOcclusion<decant::DistortedPinholeCamera> bent_rays(lens);
  for (const auto& surface : surfaces) {
    rays.add(surface);
    bent_rays.add(surface);
  }
  decant::DepthBuffer<decant::PinholeCamera> buffer(posed);
  decant::DepthBuffer<decant::DistortedPinholeCamera> cast(lens);
  std::mt19937 random(1);
  decant::PointArray<float> points(3, 2000);
  for (decant::Index i = 0; i < points.cols(); ++i) {
    points.col(i) = decant_test::random_point(random, decant_test::Point::Zero(), 0.4).cast<float>();
  }
  std::vector<std::uint8_t> hidden(2000);
  const decant::Image<float> depth = decant::Image<float>::Constant(120, 160, 1.0F);
  const auto frame = [&](const decant::Pose& pose) {
    bool taken = true;
    for (const int threads : {1, 2}) {
      rays.set_camera_pose(pose);
      rays.set_pose(0, pose);
      decant::find_hidden(rays, points, decant::Threads{threads}, hidden);
      decant::find_hidden(bent_rays, points, decant::Threads{threads}, hidden);
      buffer.set_camera_pose(pose);
      buffer.clear();
      for (const auto& surface : surfaces) {
        buffer.draw(*surface, pose, decant::Threads{threads});
        cast.draw(*surface, pose, decant::Threads{threads});
      }
      taken = taken && buffer.accept(depth);
      decant::find_hidden(buffer, points, decant::Threads{threads}, hidden);
    }
    return taken;
  };
  REQUIRE(frame(decant_test::camera_from_world()));  // threads start
  allocations = 0;
  watching = true;
  const bool taken = frame(decant_test::pose_of(0.1, {0, 1, 0}, {0, 0, 1}));
  watching = false;
  CHECK(taken);
  CHECK(allocations == 0);
  watching = true;
  ::operator delete(::operator new(8));
  watching = false;
  CHECK(allocations >= DECANT_TEST_COUNTS_ALLOCATIONS);  // the counter counts, where it can
}
