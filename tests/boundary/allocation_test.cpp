// SPDX-License-Identifier: MIT
// Questions to a surface and to a wall are asked in the frame loop: none of them allocates.

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/mesh_wall.hpp>
#include <decant/boundary/ray_fan.hpp>
#include <decant/kernel/cubic_spline.hpp>

#include <array>
#include <random>

#include "allocation_count.hpp"
#include "boundary/mesh_samples.hpp"
#include "catch.hpp"

TEST_CASE("allocation: none in questions to surfaces, fans of rays and mesh walls") {
  const decant::BoundingVolumeHierarchy surface(decant_test::bumpy_ball(12, 0.1, 1));
  const auto wall = decant::MeshWall::of<decant::CubicSpline<double>>(surface, 0.2, 0.2, {});
  std::mt19937 random(2);
  std::array<decant::Vector3<double>, 8> directions;
  for (auto& direction : directions) {
    direction = decant_test::random_point(random, decant::Vector3<double>::Zero(), 1).normalized();
  }
  const decant::RayFan<8> fan(directions);
  int found = 0;
  decant_test::allocations = 0;
  decant_test::watching = true;
  for (int n = 0; n < 2000; ++n) {
    const auto x = decant_test::random_point(random, decant::Vector3<double>::Zero(), 1.2);
    decant::WallSample sample;
    found += surface.closest_point(x, 0.2) && surface.first_hit(x, 2 * x) ? 1 : 0;
    found += wall.sample(x, sample) && wall.sample_directly(x, sample) ? 1 : 0;
    for (const double length : {0.2, 20.0}) {
      fan.first_hits(surface, x, length, [&](auto, const auto&) { ++found; });
    }
  }
  decant_test::watching = false;
  CHECK(decant_test::allocations == 0);
  CHECK(found > 5000);
}
