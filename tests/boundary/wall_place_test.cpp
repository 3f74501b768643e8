// SPDX-License-Identifier: MIT
// Places of walls: what is on their other side, and which are seen.

#include <decant/boundary/wall_place.hpp>

#include <cmath>
#include <limits>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/shapes.hpp>

#include "catch.hpp"

using namespace decant;

TEST_CASE("wall place: a wall is where it is, however it leans, and as thick as it is") {
  const Cup cup{0.02, 0.045, 0.09, 0.004};
  const BoundingVolumeHierarchy body(cup.mesh());
  const double height = 0.03, radius = std::lerp(0.02, 0.045, height / 0.09);
  const Vector3<double> from(0, 0, height);
  // below the rim, which is far outside of the wall here
  const WallPlace place = wall_place(body, from, {0.049, 0, height});
  CHECK((place.point - Vector3<double>(radius, 0, height)).norm() < 2e-4);
  const Vector3<double> square = Vector3<double>(0.09, 0, -0.025).normalized();
  CHECK(place.out.dot(square) > 0.999);
  CHECK(place.thickness == Approx(0.004 * square.x()).epsilon(0.05));
  // seen from inside on the other side
  CHECK(wall_place(body, from, {-0.049, 0, height}).out.dot(Vector3<double>(-square.x(), 0, square.z())) > 0.999);

  // where there is none
  const Vector3<double> from_above(0, 0, 0.1), above(0.02, 0, 0.1);
  const WallPlace none = wall_place(body, from_above, above);
  CHECK(none.point == above);
  CHECK(none.out == Vector3<double>(1, 0, 0));
  CHECK(none.thickness == 0);
}

TEST_CASE("wall place: a wall that is a surface has no thickness") {
  TriangleMesh sheet;
  sheet.vertices = {{0.05, -1, -1}, {0.05, 1, -1}, {0.05, 0, 1}};
  sheet.triangles = {{0, 1, 2}};
  const WallPlace place = wall_place(BoundingVolumeHierarchy(sheet), {0, 0, 0}, {0.04, 0, 0});
  CHECK(place.point.x() == Approx(0.05));
  CHECK(place.out.x() == Approx(1));
  CHECK(place.thickness == 0);
}

TEST_CASE("wall place: a ray shows what it meets first, or what it passes by") {
  const Vector3<double> middle(0.3, -0.2, 0.1);
  const BoundingVolumeHierarchy ball(Sphere{middle, 0.05}.mesh());
  const Vector3<double> origin = middle - Vector3<double>(0.5, 0, 0);
  const auto met = place_by_ray(ball, origin, {2, 0, 0});
  REQUIRE(met);
  CHECK((met->point - (middle - Vector3<double>(0.05, 0, 0))).norm() < 1e-3);
  CHECK(met->distance == 0);
  // 8 cm beside its middle, and at a slant: the sphere's point on the perpendicular from there to the ray
  const Vector3<double> along = Vector3<double>(1, 0.3, 0).normalized(), beside(0, 0, 0.08);
  const auto passed = place_by_ray(ball, middle + beside - 0.7 * along, 3 * along);
  REQUIRE(passed);
  CHECK((passed->point - (middle + Vector3<double>(0, 0, 0.05))).norm() < 3e-3);
  CHECK(passed->distance == Approx(0.03).margin(5e-4));

  CHECK(!place_by_ray(ball, origin, {-1, 0, 0}));  // it is behind
  CHECK(!place_by_ray(ball, {std::numeric_limits<double>::quiet_NaN(), 0, 0}, {1, 0, 0}));
  CHECK(!place_by_ray(ball, origin, {0, 0, std::numeric_limits<double>::infinity()}));
}
