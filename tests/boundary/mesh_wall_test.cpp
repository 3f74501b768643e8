// SPDX-License-Identifier: MIT

#include <array>
#include <cmath>
#include <cstdint>
#include <random>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/mesh_wall.hpp>
#include <decant/boundary/solid_parts.hpp>
#include <decant/boundary/wall_function.hpp>
#include <decant/kernel/cubic_spline.hpp>

#include "boundary/mesh_samples.hpp"
#include "catch.hpp"

using decant::Vector3;

namespace {

using Kernel = decant::CubicSpline<double>;
using decant_test::spacing;

// Box from min to max as 12 triangles.
decant::TriangleMesh box_mesh(const Vector3<double>& min, const Vector3<double>& max) {
  decant::TriangleMesh mesh;
  for (int corner = 0; corner < 8; ++corner) {
    mesh.vertices.push_back(
        {(corner & 1) ? max[0] : min[0], (corner & 2) ? max[1] : min[1], (corner & 4) ? max[2] : min[2]});
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

// A room's corner: floor and one wall, as two slabs.
decant::TriangleMesh room_corner() {
  decant::TriangleMesh corner = box_mesh({-0.05, -0.05, -0.01}, {0.05, 0.05, 0});
  const auto upright = box_mesh({-0.06, -0.05, -0.01}, {-0.05, 0.05, 0.05});
  const auto shift = static_cast<std::uint32_t>(corner.vertices.size());
  corner.vertices.insert(corner.vertices.end(), upright.vertices.begin(), upright.vertices.end());
  for (const auto& t : upright.triangles) {
    corner.triangles.push_back({t[0] + shift, t[1] + shift, t[2] + shift});
  }
  return corner;
}

}  // namespace

TEST_CASE("mesh wall agrees with the closed form of a plane on both sides of a thin plate") {
  const auto plate = box_mesh({-0.05, -0.05, -0.001}, {0.05, 0.05, 0});
  const decant::BoundingVolumeHierarchy surface(plate);
  const auto wall = decant::MeshWall::of<Kernel>(surface, spacing, spacing, {});
  const auto plane = decant::WallFunction::of<Kernel>(spacing, spacing);
  const double largest_slope = plane.slope(0);
  for (const double side : {1.0, -1.0}) {
    for (const double a : {0.1, 0.35, 0.5, 0.7, 0.85}) {
      const double z = side > 0 ? a * spacing : -0.001 - a * spacing;
      decant::WallSample sample;
      REQUIRE(wall.sample({0.0013, -0.0021, z}, sample));
      INFO("distance in spacings " << side * a);
      // what 128 directions leave; interpolation is exact near a plane
      CHECK(sample.share == Approx(plane.share(a * spacing)).margin(0.006));
      CHECK(sample.gradient[2] == Approx(-side * plane.slope(a * spacing)).margin(0.025 * largest_slope));
      CHECK(std::hypot(sample.gradient[0], sample.gradient[1]) < 0.025 * largest_slope);
      if (a < 0.8) {  // beyond, the interpolated distance falls short, as it is cut at the support
        CHECK(sample.distance == Approx(a * spacing).margin(0.02 * spacing));
      }
    }
  }
  decant::WallSample far;
  CHECK_FALSE(wall.sample({0, 0, 2.6 * spacing}, far));
  CHECK_FALSE(wall.sample({std::nan(""), 0, 0}, far));
  CHECK_FALSE(wall.sample({1e30, 0, 0}, far));
}

TEST_CASE("direct mesh wall sums reach the accuracy that is documented") {
  const auto plate = box_mesh({-0.05, -0.05, -0.02}, {0.05, 0.05, 0});
  const decant::BoundingVolumeHierarchy surface(plate);
  const auto wall = decant::MeshWall::of<Kernel>(surface, spacing, spacing, {});
  const auto plane = decant::WallFunction::of<Kernel>(spacing, spacing);
  // planes at many orientations against the fixed directions: turn the point around the plate's edges instead of the
  // plate, by probing all six faces
  for (const double a : {0.2, 0.5, 0.8}) {
    decant::WallSample sample;
    REQUIRE(wall.sample_directly({0, 0, a * spacing}, sample));
    CHECK(sample.share == Approx(plane.share(a * spacing)).margin(0.004 * 0.5));
    REQUIRE(wall.sample_directly({0.05 + a * spacing, 0, -0.01}, sample));
    CHECK(sample.share == Approx(plane.share(a * spacing)).margin(0.004 * 0.5));
  }
}

TEST_CASE("direct mesh wall sums are those over rays that are asked for one by one") {
  const double pi = std::acos(-1.0);
  decant::TriangleMesh ball = decant_test::bumpy_ball(12, 0.1, 1);
  for (Vector3<double>& vertex : ball.vertices) {
    vertex *= 0.03;
  }
  const decant::BoundingVolumeHierarchy surface(ball);
  const auto wall = decant::MeshWall::of<Kernel>(surface, spacing, spacing, {});
  const auto plane = decant::WallFunction::of<Kernel>(spacing, spacing);
  std::mt19937 random(2);
  int found = 0;
  for (int n = 0; n < 300; ++n) {
    const Vector3<double> x = decant_test::random_point(random, Vector3<double>::Zero(), 0.036);
    decant::WallSample sample, sum;
    const bool near = wall.sample_directly(x, sample);
    sum.share = 0;
    sum.gradient.setZero();
    sum.moment.setZero();
    for (int k = 0; k < 128; ++k) {  // a Fibonacci lattice
      const double z = 1 - 2 * (k + 0.5) / 128;
      const double angle = pi * (3 - std::sqrt(5.0)) * k;
      const double radius = std::sqrt(1 - z * z);
      const Vector3<double> direction(radius * std::cos(angle), radius * std::sin(angle), z);
      if (const auto hit = surface.first_hit_along(x, direction, wall.reach())) {
        const double t = hit->fraction * wall.reach();
        const double facing = direction.dot(hit->normal);
        const double pull = t * plane.radius_times_weight(t) + plane.slope(t) / pi;
        sum.share += 4 * pi / 128 * (plane.share(t) + t * plane.slope(t)) / (2 * pi);
        sum.gradient += 4 * pi / 128 * pull * direction;
        sum.moment += 4 * pi / 128 * pull * t * facing * facing * hit->normal * hit->normal.transpose();
      }
    }
    REQUIRE(near == (sum.share > 0));
    if (near) {
      ++found;
      REQUIRE(sample.distance == surface.closest_point(x, 1)->distance);
      // the same rays: what is left is rounding
      REQUIRE(std::abs(sample.share - sum.share) < 1e-12);
      REQUIRE((sample.gradient - sum.gradient).norm() < 1e-12 * plane.slope(0));
      REQUIRE((sample.moment - sum.moment).norm() < 1e-12 * plane.slope(0) * spacing);
    }
  }
  REQUIRE(found > 50);
}

TEST_CASE("a mesh wall is the same whatever the number of threads, and has direct sums at all its nodes") {
  decant::TriangleMesh ball = decant_test::bumpy_ball(12, 0.1, 3);
  for (Vector3<double>& vertex : ball.vertices) {
    vertex *= 0.03;
  }
  const decant::BoundingVolumeHierarchy surface(ball);
  const auto plane = decant::WallFunction::of<Kernel>(spacing, spacing);
  const std::array<decant::MeshWall, 3> walls{decant::MeshWall::of<Kernel>(surface, spacing, spacing, {1}),
                                              decant::MeshWall::of<Kernel>(surface, spacing, spacing, {2}),
                                              decant::MeshWall::of<Kernel>(surface, spacing, spacing, {4})};
  const double cell = spacing / decant::MeshWall::cells_per_spacing;
  const Vector3<double> origin = surface.bounds().min().array() - (walls[0].reach() + cell);
  std::mt19937 random(4);
  int at_nodes = 0, at_borders = 0;
  for (int n = 0; n < 20000; ++n) {
    const Vector3<double> place = (decant_test::random_point(random, Vector3<double>::Zero(), 0.036) - origin) / cell;
    // beside a node, in one of the eight cells around it; every other one on a border between blocks of eight cells
    Vector3<double> node = place.array().round();
    if (n % 2 == 0) {
      node[n / 2 % 3] = 8 * std::round(node[n / 2 % 3] / 8);
    }
    const Vector3<double> side = (place - node).array().sign();
    const Vector3<double> x = origin + cell * (node + 1e-6 * side);
    decant::WallSample sample, other, direct;
    const bool near = walls[0].sample(x, sample);
    for (const decant::MeshWall& wall : walls) {
      REQUIRE(near == wall.sample(x, other));
      REQUIRE((!near || (sample.share == other.share && sample.distance == other.distance &&
                         sample.gradient == other.gradient && sample.moment == other.moment)));
    }
    // where the surface passes through the cell or the wall is hardly felt, the grid is not asked or holds a plane
    if (surface.closest_point(origin + cell * (node + 0.5 * side), 0.87 * cell) ||
        !walls[0].sample_directly(x, direct) || plane.distance_for(direct.share) > 0.89 * plane.reach()) {
      continue;
    }
    ++(n % 2 == 0 ? at_borders : at_nodes);
    INFO("node " << node.transpose() << ", side " << side.transpose());
    REQUIRE(near);
    // 1e-6 of a cell off the node, and stored in float
    REQUIRE(sample.share == Approx(direct.share).margin(1e-5));
    REQUIRE(sample.distance == Approx(direct.distance).margin(1e-5 * spacing));
    REQUIRE((sample.gradient - direct.gradient).norm() < 1e-4 * plane.slope(0));
    REQUIRE((sample.moment - direct.moment).norm() < 1e-4 * plane.slope(0) * spacing);
  }
  REQUIRE(at_nodes > 1000);
  REQUIRE(at_borders > 1000);
}

TEST_CASE("mesh wall and solid parts agree in a corner") {
  const decant::BoundingVolumeHierarchy surface(room_corner());
  const auto mesh = decant::MeshWall::of<Kernel>(surface, spacing, spacing, {});
  const auto parts = decant::SolidParts::of<Kernel>({decant::SolidBox{{-0.05, -0.05, -0.01}, {0.05, 0.05, 0}},
                                                     decant::SolidBox{{-0.06, -0.05, -0.01}, {-0.05, 0.05, 0.05}}},
                                                    spacing, spacing);
  for (const double a : {0.3, 0.5, 0.75}) {
    for (const double b : {0.3, 0.5, 0.75}) {
      decant::WallSample from_mesh, from_parts;
      const Vector3<double> x(-0.05 + a * spacing, 0.001, b * spacing);
      REQUIRE(mesh.sample(x, from_mesh));
      REQUIRE(parts.sample(x, from_parts));
      INFO("distances in spacings " << a << " and " << b);
      // parts add up, so that what lies behind both walls counts twice: 0.08 of rest density at the worst place here
      CHECK(from_parts.share == Approx(from_mesh.share).margin(0.09));
      CHECK((from_parts.gradient - from_mesh.gradient).norm() < 0.25 * from_mesh.gradient.norm());
    }
  }
}

TEST_CASE("close to the surface, where the grid has no answer, a mesh wall still is what it should be") {
  const decant::BoundingVolumeHierarchy surface(room_corner());
  const auto wall = decant::MeshWall::of<Kernel>(surface, spacing, spacing, {});
  const auto plane = decant::WallFunction::of<Kernel>(spacing, spacing);
  // where one wall is all there is: the closed form, with what 128 directions leave of it (above)
  const auto is_plane = [&](const Vector3<double>& x, double a, const Vector3<double>& toward) {
    decant::WallSample sample;
    REQUIRE(wall.sample(x, sample));
    INFO("at [mm] " << 1e3 * x.transpose());
    CHECK(sample.share == Approx(plane.share(a)).margin(0.006));
    CHECK((sample.gradient - plane.slope(a) * toward).norm() < 0.025 * plane.slope(0));
    CHECK(sample.distance == Approx(a).epsilon(1e-6));
  };
  // where two are, the sum over directions: the grid's value is not that of one wall more or less
  const auto is_sum = [&](const Vector3<double>& x) {
    decant::WallSample sample, sum;
    REQUIRE(wall.sample(x, sample));
    REQUIRE(wall.sample_directly(x, sum));
    INFO("at [mm] " << 1e3 * x.transpose());
    CHECK(sample.share == Approx(sum.share).margin(0.006));
    CHECK((sample.gradient - sum.gradient).norm() < 0.025 * plane.slope(0));
  };
  for (const double a : {0.01, 0.05, 0.1, 0.2, 0.3}) {
    is_plane({0.0113, -0.0021, a * spacing}, a * spacing, -Vector3<double>::UnitZ());         // on the floor
    is_plane({0.0113, -0.0021, -0.01 - a * spacing}, a * spacing, Vector3<double>::UnitZ());  // below it
    is_plane({-0.05 + a * spacing, 0.001, 0.0271}, a * spacing, -Vector3<double>::UnitX());   // at the upright
    is_sum({-0.05 + a * spacing, 0.001, 0.4 * spacing});                                      // near the corner
    is_sum({-0.05 + a * spacing, 0.001, 1.1 * a * spacing});                                  // in it
  }
}

TEST_CASE("solid parts' gradient is the derivative of their share") {
  const auto parts = decant::SolidParts::of<Kernel>(
      {decant::SolidBox{{-0.05, -0.05, -0.01}, {0.05, 0.05, 0}}, decant::SolidRing{0.03, 0.032, 0, 0.05},
       decant::SolidSphere{{0, 0, 0.02}, 0.008}},
      spacing, spacing);
  for (const Vector3<double>& x :
       {Vector3<double>(0.027, 0.003, 0.004), Vector3<double>(0.0, 0.002, 0.009), Vector3<double>(0.02, 0.016, 0.03)}) {
    decant::WallSample here;
    REQUIRE(parts.sample(x, here));
    for (int axis = 0; axis < 3; ++axis) {
      const double step = 2e-5;
      decant::WallSample up, down;
      parts.sample(x + step * Vector3<double>::Unit(axis), up);
      parts.sample(x - step * Vector3<double>::Unit(axis), down);
      INFO("at " << x.transpose() << " axis " << axis);
      CHECK(here.gradient[axis] == Approx((up.share - down.share) / (2 * step)).margin(2));  // of some 100 to 400 1/m
    }
  }
}
