// SPDX-License-Identifier: MIT
#include <decant/boundary/shapes.hpp>

#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <string>

#include <decant/boundary/bounding_volume_hierarchy.hpp>

#include "boundary/mesh_samples.hpp"
#include "catch.hpp"

namespace {

using decant::BoundingVolumeHierarchy;
using decant::Face;
using decant::TriangleMesh;
using Point = decant::Vector3<double>;

using std::numbers::pi;

// Closed, looking outward, of the given volume; distances and insides by formula and by mesh agree to `deviation`.
template <class Shape>
void check(const Shape& shape, double volume, double volume_tolerance, double deviation) {
  const TriangleMesh mesh = shape.mesh();
  REQUIRE(decant_test::closed_and_oriented(mesh));
  REQUIRE(decant::signed_volume(mesh) == Approx(volume).epsilon(volume_tolerance));
  if constexpr (requires { shape.distance(Point()); }) {
    const BoundingVolumeHierarchy surface(mesh);
    std::mt19937 random(7);
    double worst = 0;
    int wrong_side = 0;
    for (int n = 0; n < 4000; ++n) {
      const Point x =
          decant_test::random_point(random, surface.bounds().center(), 0.7 * surface.bounds().sizes().maxCoeff());
      const double distance = shape.distance(x);
      worst = std::max(worst, std::abs(std::abs(distance) - surface.closest_point(x, 1e9)->distance));
      if (std::abs(distance) > deviation) {
        wrong_side += surface.inside_material(x) == (distance < 0) ? 0 : 1;
      }
    }
    REQUIRE(worst <= deviation);
    REQUIRE(wrong_side == 0);
  }
}

}  // namespace

TEST_CASE("solids have their volume and distance") {
  check(decant::Box{Point(-1, 0, 2), Point(1, 3, 2.5)}, 3, 1e-12, 1e-12);
  check(decant::Sphere{Point(0.1, 0.2, 0), 0.05}, 4.0 / 3 * pi * 0.05 * 0.05 * 0.05, 3e-3, 1e-4);
  check(decant::Cylinder{0.05, 0.2}, pi * 0.05 * 0.05 * 0.2, 1e-3, 1e-4);
  check(decant::Cylinder{1.0, 0.1}, pi * 0.1, 1e-3, 1e-4);
}

TEST_CASE("containers have walls around their inner space") {
  const Point size(0.1, 0.2, 0.3);
  for (int face = -1; face < 6; ++face) {
    decant::BoxInside box{Point(1, 2, 3), Point(1, 2, 3) + size, 0.004, {}};
    Point outer = size.array() + 0.008;
    if (face >= 0) {
      box.open = static_cast<Face>(face);
      outer[face / 2] -= 0.004;
      const Point center = 0.5 * (box.min + box.max);
      Point through = center;
      through[face / 2] += face % 2 == 0 ? -1 : 1;
      REQUIRE_FALSE(BoundingVolumeHierarchy(box.mesh()).any_hit(center, through));
    }
    check(box, outer.prod() - size.prod(), 1e-12, 1e-12);
  }
  const double r = 0.05, h = 0.1, wall = 0.002;
  const double inner = pi * r * r * h;
  const double base = pi * (r + wall) * (r + wall);
  check(decant::CylinderInside{r, h, wall, Face::PositiveZ}, base * (h + wall) - inner, 1e-3, 1e-4);
  check(decant::CylinderInside{r, h, wall, Face::NegativeZ}, base * (h + wall) - inner, 1e-3, 1e-4);
  check(decant::CylinderInside{r, h, wall, {}}, base * (h + 2 * wall) - inner, 1e-3, 1e-4);
}

TEST_CASE("round meshes stay on the material's side") {
  const auto each_point = [](const TriangleMesh& mesh, auto&& f) {
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      for (int i = 0; i <= 4; ++i) {
        for (int j = 0; i + j <= 4; ++j) {
          f(Point(mesh.corner(t, 0) + i / 4.0 * (mesh.corner(t, 1) - mesh.corner(t, 0)) +
                  j / 4.0 * (mesh.corner(t, 2) - mesh.corner(t, 0))));
        }
      }
    }
  };
  // No point of the mesh is in the open inner space, and all are within 0.1 mm of the formula's surface.
  for (const double radius : {0.02, 0.05, 0.5, 1.5}) {
    each_point(decant::CylinderInside{radius, 0.1, 0.002, Face::PositiveZ}.mesh(), [&](const Point& x) {
      const bool in_cavity = std::hypot(x[0], x[1]) < radius - 1e-12 && x[2] > 1e-12 && x[2] < 0.1 - 1e-12;
      REQUIRE_FALSE(in_cavity);
      REQUIRE(std::abs(decant::CylinderInside{radius, 0.1, 0.002, Face::PositiveZ}.distance(x)) < 1e-4);
    });
    each_point(decant::Cylinder{radius, 0.1}.mesh(), [&](const Point& x) {
      REQUIRE(decant::Cylinder{radius, 0.1}.distance(x) <= 1e-12);
    });
  }
  each_point(decant::Sphere{Point(1, 0, 0), 0.05}.mesh(), [&](const Point& x) {
    REQUIRE(decant::Sphere{Point(1, 0, 0), 0.05}.distance(x) <= 1e-12);
  });
  const decant::Bowl bowl;
  const double sphere = (bowl.rim_radius * bowl.rim_radius + bowl.depth * bowl.depth) / (2 * bowl.depth);
  each_point(bowl.mesh(), [&](const Point& x) {
    const bool in_cavity = (x - Point(0, 0, sphere)).norm() < sphere - 1e-12 && x[2] < bowl.depth - 1e-12;
    REQUIRE_FALSE(in_cavity);
  });
}

TEST_CASE("cups, bowls and turned outlines are closed") {
  const decant::Cup cup;
  const double outer = pi * (cup.height / 3 *
                                 (std::pow(cup.floor_radius + cup.wall, 2) + std::pow(cup.rim_radius + cup.wall, 2) +
                                  (cup.floor_radius + cup.wall) * (cup.rim_radius + cup.wall)) +
                             cup.wall * std::pow(cup.floor_radius + cup.wall, 2));
  check(cup, outer - cup.volume(), 1e-3, 0);
  REQUIRE(decant_test::closed_and_oriented(decant::Bowl{}.mesh()));
  REQUIRE(decant::signed_volume(decant::Bowl{}.mesh()) > 0);
  // a ring with a square section, whichever way its outline runs
  decant::Revolved ring{{{0.04, 0}, {0.06, 0}, {0.06, 0.02}, {0.04, 0.02}}};
  check(ring, 2 * pi * 0.05 * 0.02 * 0.02, 1e-3, 0);
  std::reverse(ring.profile.begin(), ring.profile.end());
  check(ring, 2 * pi * 0.05 * 0.02 * 0.02, 1e-3, 0);
  check(decant::Revolved{{{0, 0}, {0.03, 0}, {0, 0.1}}}, pi / 3 * 0.03 * 0.03 * 0.1, 1e-3, 0);  // a cone
}

TEST_CASE("shapes without extent are refused in words") {
  using decant_test::contains;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  REQUIRE_THROWS_WITH((decant::Box{Point(0, 0, 0), Point(1, 0, 1)}.mesh()), contains("Box: size [m] must be > 0"));
  REQUIRE_THROWS_WITH((decant::Box{Point(0, 0, 0), Point(1, nan, 1)}.mesh()), contains("Box: size [m] must be > 0"));
  REQUIRE_THROWS_WITH((decant::Sphere{Point(0, 0, 0), 0}.mesh()), contains("Sphere: radius [m] must be > 0"));
  REQUIRE_THROWS_WITH((decant::Sphere{Point(nan, 0, 0), 1}.mesh()), contains("Sphere: coordinate [m] of the center"));
  REQUIRE_THROWS_WITH((decant::Cylinder{-1, 1}.mesh()), contains("Cylinder: radius [m] must be > 0"));
  REQUIRE_THROWS_WITH((decant::Cylinder{1, nan}.mesh()), contains("Cylinder: height [m] must be > 0"));
  REQUIRE_THROWS_WITH((decant::BoxInside{Point(1, 0, 0), Point(0, 1, 1), 0.1, {}}.mesh()),
                      contains("BoxInside: inner size"));
  REQUIRE_THROWS_WITH((decant::BoxInside{Point(0, 0, 0), Point(1, 1, 1), 0, {}}.mesh()),
                      contains("BoxInside: wall thickness"));
  REQUIRE_THROWS_WITH((decant::CylinderInside{0, 1, 1, {}}.mesh()), contains("CylinderInside: inner radius"));
  REQUIRE_THROWS_WITH((decant::CylinderInside{1, 0, 1, {}}.mesh()), contains("CylinderInside: inner height"));
  REQUIRE_THROWS_WITH((decant::CylinderInside{1, 1, -1, {}}.mesh()), contains("CylinderInside: wall thickness"));
  REQUIRE_THROWS_WITH((decant::CylinderInside{1, 1, 1, Face::PositiveX}.mesh()),
                      contains("CylinderInside: open face must be NegativeZ"));
  REQUIRE_THROWS_WITH((decant::Revolved{{{0, 0}, {1, 0}}}.mesh()),
                      contains("number of points of the profile must be >= 3"));
  REQUIRE_THROWS_WITH((decant::Revolved{{{0, 0}, {-1, 0}, {0, 1}}}.mesh()),
                      contains("distance [m] of a point from the axis"));
  REQUIRE_THROWS_WITH((decant::Revolved{{{0, 0}, {1, nan}, {0, 1}}}.mesh()), contains("height [m] of a point"));
  REQUIRE_THROWS_WITH((decant::Revolved{{{0, 0}, {1, 1}, {2, 2}}}.mesh()),
                      contains("area [m^2] inside of the profile"));
  REQUIRE_THROWS_WITH((decant::Cup{0, 1, 1, 1}.mesh()), contains("Cup: inner radius [m] of the floor"));
  REQUIRE_THROWS_WITH((decant::Bowl{0.05, 0.06, 0.002}.mesh()), contains("Bowl: inner depth [m] must be at most"));
}
