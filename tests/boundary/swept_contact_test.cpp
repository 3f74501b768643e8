// SPDX-License-Identifier: MIT

#include <random>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/swept_contact.hpp>

#include "catch.hpp"

using decant::Vector3;

namespace {

decant::TriangleMesh closed_box(const Vector3<double>& min, const Vector3<double>& max) {
  decant::TriangleMesh mesh;
  for (int corner = 0; corner < 8; ++corner) {
    mesh.vertices.push_back(
        {(corner & 1) ? max[0] : min[0], (corner & 2) ? max[1] : min[1], (corner & 4) ? max[2] : min[2]});
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

}  // namespace

TEST_CASE("swept contact slides along a wall and keeps its clearance") {
  const auto mesh = closed_box({0, 0, 0}, {0.1, 0.1, 0.1});
  const decant::BoundingVolumeHierarchy surface(mesh);
  Vector3<double> end(0.06, 0.05, -0.02);
  CHECK(decant::keep_on_side(surface, {0.05, 0.05, 0.003}, end, 0.0005) == decant::SweptResult::Slid);
  CHECK(end[0] == Approx(0.06));  // what lies along the wall is kept
  CHECK(end[2] == Approx(0.0005));
  Vector3<double> free(0.055, 0.05, 0.01);
  CHECK(decant::keep_on_side(surface, {0.05, 0.05, 0.003}, free, 0.0005) == decant::SweptResult::Free);
  CHECK(free == Vector3<double>(0.055, 0.05, 0.01));
}

TEST_CASE("no walk leaves a closed box or enters it, whatever the step") {
  const Vector3<double> low(0, 0, 0), high(0.03, 0.02, 0.01);
  const auto mesh = closed_box(low, high);
  const decant::BoundingVolumeHierarchy surface(mesh);
  const Eigen::AlignedBox3d box(low, high);
  std::mt19937 random(7);
  std::normal_distribution<double> step(0, 0.02);  // twice the box's height
  for (const bool inside : {true, false}) {
    Vector3<double> x = inside ? Vector3<double>(0.01, 0.01, 0.005) : Vector3<double>(-0.01, 0.01, 0.005);
    int bent = 0;
    for (int k = 0; k < 20000; ++k) {
      Vector3<double> end = x + Vector3<double>(step(random), step(random), step(random));
      bent += decant::keep_on_side(surface, x, end, 0.0005) != decant::SweptResult::Free;
      x = end;
      REQUIRE(box.contains(x) == inside);
      if (!inside && x.norm() > 0.06) {
        x = Vector3<double>(-0.005, 0.01, 0.005);  // keep the walk near the box
      }
    }
    CHECK(bent > 1000);
  }
}
