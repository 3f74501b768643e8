// SPDX-License-Identifier: MIT
#include <decant/boundary/ray_fan.hpp>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <random>

#include <decant/io/mesh_file.hpp>

#include "boundary/mesh_samples.hpp"
#include "catch.hpp"
#include "data.hpp"

namespace {

using decant::BoundingVolumeHierarchy;
using decant::RayFan;
using decant::TriangleMesh;
using decant_test::bumpy_ball;
using decant_test::cube;
using decant_test::random_point;
using Point = decant::Vector3<double>;

template <std::size_t Count>
RayFan<Count> random_fan(unsigned seed) {
  std::mt19937 random(seed);
  std::array<Point, Count> directions;
  for (Point& direction : directions) {
    do {
      direction = random_point(random, Point::Zero(), 1);
    } while (direction.norm() > 1 || direction.norm() < 0.1);
    direction.normalize();
  }
  return RayFan<Count>(directions);
}

// Along axes, diagonals of faces and diagonals of cubes: rays that run along edges and within planes.
RayFan<32> crystal_fan() {
  std::array<Point, 32> directions;
  std::size_t count = 0;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        if (x != 0 || y != 0 || z != 0) {
          directions[count++] = Point(x, y, z).normalized();
        }
      }
    }
  }
  for (int turn = 0; count < 32; ++turn) {  // the rest at odd angles within the horizontal plane
    directions[count++] = Point(std::cos(0.3 + turn), std::sin(0.3 + turn), 0);
  }
  return RayFan<32>(directions);
}

// Ray by ray; returns how many hit. `scale` is that of the coordinates, which hits are known relative to.
template <std::size_t Count>
int compare(const TriangleMesh& mesh, const BoundingVolumeHierarchy& tree, const RayFan<Count>& fan,
            const Point& origin, double length, double scale) {
  std::array<std::optional<BoundingVolumeHierarchy::Hit>, Count> found;
  std::size_t next = 0;
  bool in_order = true;
  fan.first_hits(tree, origin, length, [&](std::size_t k, const BoundingVolumeHierarchy::Hit& hit) {
    in_order = in_order && k >= next;
    next = k + 1;
    found[k] = hit;
  });
  REQUIRE(in_order);
  int hits = 0;
  int wrong = 0;
  for (std::size_t k = 0; k < Count; ++k) {
    const auto hit = tree.first_hit_along(origin, fan.direction(k), length);
    if (hit.has_value() != found[k].has_value()) {
      ++wrong;
      continue;
    }
    if (!hit) {
      continue;
    }
    ++hits;
    // the same place, by rounding of coordinates, and a triangle that it lies on: not always the one that first_hit
    // names, as a ray through an edge meets two
    const Point& corner = mesh.corner(found[k]->triangle, 0);
    const Point area = mesh.area_normal(found[k]->triangle);
    const Point normal = area.normalized();
    const double shift = std::abs(hit->fraction - found[k]->fraction) * length;
    const double off_plane = std::abs(normal.dot(found[k]->point - corner));
    // a sliver's plane is known as well as products of its edges round, and its corners' weights likewise
    const double plane_rounding = 1e-11 * scale + 1e-14 * scale * scale * scale / area.norm();
    const double turned = (normal - found[k]->normal).norm() * area.norm();
    const Point at = origin + found[k]->fraction * length * fan.direction(k);
    wrong += shift < plane_rounding && off_plane < plane_rounding && turned < 1e-14 * scale * scale &&
                     (at - found[k]->point).norm() < plane_rounding
                 ? 0
                 : 1;
  }
  INFO("from " << origin.transpose() << ", length " << length);
  REQUIRE(wrong == 0);
  return hits;
}

// From places all over and close to the surface; so that rays pass exactly, to rounding, through corners and edges;
// and from places on the surface.
template <std::size_t Count>
void compare_all_over(const TriangleMesh& mesh, const RayFan<Count>& fan, double reach, unsigned seed, int places) {
  const BoundingVolumeHierarchy tree(mesh);
  const Point center = tree.bounds().center();
  const double radius = tree.bounds().sizes().maxCoeff() / 2;
  const double scale = center.norm() + radius;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> share(0, 1);
  int hits = 0;
  for (int n = 0; n < places; ++n) {
    const std::size_t t = random() % mesh.triangles.size();
    const std::size_t side = random() % 3;
    const Point corner = mesh.corner(t, side);
    const Point on_edge = corner + share(random) * (mesh.corner(t, (side + 1) % 3) - corner);
    const Point within = on_edge + share(random) * (mesh.corner(t, (side + 2) % 3) - on_edge);
    const double length = reach * (0.2 + share(random));
    const Point back = share(random) * length * fan.direction(random() % Count);
    hits += compare(mesh, tree, fan, random_point(random, center, 1.2 * radius), length, scale);
    hits += compare(mesh, tree, fan, random_point(random, within, reach), length, scale);
    for (const Point& at : {corner, on_edge, within}) {
      compare(mesh, tree, fan, at - back, length, scale);
      compare(mesh, tree, fan, at, length, scale);
      compare(mesh, tree, fan, at - length * fan.direction(random() % Count), length, scale);  // ends there
    }
  }
  REQUIRE(hits > places);
}

}  // namespace

TEST_CASE("a fan of rays meets what each ray alone does") {
  const auto fan = random_fan<128>(1);
  compare_all_over(bumpy_ball(9, 0.2, 2), fan, 0.4, 3, 200);
  compare_all_over(bumpy_ball(30, 0.02, 4), fan, 0.3, 5, 100);
  compare_all_over(decant_test::random_triangles(500, 0.15, 6), fan, 0.6, 7, 100);
  compare_all_over(bumpy_ball(9, 0.2, 2), random_fan<8>(8), 1.5, 9, 200);
  compare_all_over(bumpy_ball(9, 0.2, 2), random_fan<40>(10), 1.5, 11, 200);
  TriangleMesh small_and_far = bumpy_ball(12, 0.1, 12);
  for (Point& vertex : small_and_far.vertices) {
    vertex = 0.04 * vertex + Point(3, -2, 1);
  }
  compare_all_over(small_and_far, fan, 0.02, 13, 100);
  if (const auto file = decant_test::measurements("meshes_ycb/025_mug.obj")) {
    compare_all_over(decant::read_mesh(*file), fan, 0.01, 14, 100);
  }
}

TEST_CASE("a fan meets slivers and triangles of all sizes as each ray alone does") {
  const auto fan = random_fan<128>(21);
  TriangleMesh slivers;
  slivers.vertices = {Point(0, 0, 0), Point(1e-3, 0, 0), Point(0.5e-3, 1e-9, 0), Point(0, 0, 1e-3)};
  slivers.triangles = {{0, 1, 2}, {0, 3, 1}};
  compare_all_over(slivers, fan, 1e-3, 22, 200);
  TriangleMesh mixed = bumpy_ball(9, 0.2, 23);
  std::mt19937 random(24);
  for (int k = 0; k < 300; ++k) {  // narrow and tiny, down to where rounding ends
    const Point at = random_point(random, Point::Zero(), 1);
    const auto first = static_cast<std::uint32_t>(mixed.vertices.size());
    mixed.vertices.push_back(at);
    mixed.vertices.push_back(at + std::pow(0.93, k) * random_point(random, Point::Zero(), 0.5));
    mixed.vertices.push_back(0.3 * at + 0.7 * mixed.vertices.back() +
                             std::pow(0.9, k) * random_point(random, Point::Zero(), 0.5));
    mixed.triangles.push_back({first, first + 1, first + 2});
  }
  mixed.triangles.push_back({0, 0, 1});  // no area
  mixed.triangles.push_back({5, 5, 5});
  compare_all_over(mixed, fan, 0.5, 25, 300);
}

TEST_CASE("rays of a fan along edges and within planes touch as each ray alone does") {
  const TriangleMesh mesh = cube();
  const BoundingVolumeHierarchy tree(mesh);
  const auto fan = crystal_fan();
  int hits = 0;
  // all coordinates and volumes are exact here: corners, edges, faces, their planes, the inside and beside it
  for (const double x : {-0.25, 0.0, 0.5, 1.0, 1.25}) {
    for (const double y : {-0.25, 0.0, 0.25, 1.0}) {
      for (const double z : {-0.5, 0.0, 0.5, 1.0, 1.0 + 1e-9}) {
        for (const double length : {0.125, 0.25, 0.5}) {
          hits += compare(mesh, tree, fan, {x, y, z}, length, 1);
        }
      }
    }
  }
  REQUIRE(hits > 1000);
  // and without a reference: on a corner all rays touch at once, in the plane of a face those toward it do
  const auto count = [&](const Point& origin, double length) {
    int found = 0;
    fan.first_hits(tree, origin, length, [&](std::size_t, const auto&) { ++found; });
    return found;
  };
  REQUIRE(count({1, 1, 1}, 0.25) == 32);
  REQUIRE(count({0.5, 0.5, 1}, 0.25) == 32);
  REQUIRE(count({0.5, 0.5, 1 + 1e-9}, 1e-8) > 8);
  REQUIRE(count({0.5, 0.5, 0.5}, 0.49) == 0);
  REQUIRE(count({0.5, 0.5, 0.5}, 0.5) == 6);  // along the axes, which end on the faces
}

TEST_CASE("no ray of a fan slips out of a closed surface through an edge or a corner") {
  for (const double scale : {1.0, 1e-3, 50.0}) {
    for (const double far : {0.0, 7.0, 1234.5}) {
      const Point center = far * Point(1, -0.7, 0.3);
      TriangleMesh mesh = bumpy_ball(16, 0.05, 31);
      for (Point& vertex : mesh.vertices) {
        vertex = scale * vertex + center;
      }
      const BoundingVolumeHierarchy tree(mesh);
      const auto fan = random_fan<64>(32);
      std::mt19937 random(33);
      std::uniform_real_distribution<double> share(0, 1);
      int leaks = 0;
      for (int n = 0; n < 2000; ++n) {
        const std::size_t t = random() % mesh.triangles.size();
        const Point corner = mesh.corner(t, 0);
        const Point target = n % 2 == 0 ? corner : Point(corner + share(random) * (mesh.corner(t, 1) - corner));
        const Point origin = target - 0.8 * scale * fan.direction(random() % 64);
        if ((origin - center).norm() > 0.6 * scale) {
          continue;
        }
        // from inside to outside, for certain
        int hits = 0;
        fan.first_hits(tree, origin, 1.75 * scale, [&](std::size_t, const auto&) { ++hits; });
        leaks += 64 - hits;
      }
      REQUIRE(leaks == 0);
    }
  }
}

TEST_CASE("fans far away, longer than the mesh, and unusable ones are answered") {
  const TriangleMesh mesh = cube();
  const BoundingVolumeHierarchy tree(mesh);
  const auto fan = crystal_fan();
  const double infinity = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  int hits = 0;
  for (const double length : {1.0, 10.0, 1e6}) {
    hits += compare(mesh, tree, fan, {0.5, 0.5, 0.25}, length, length);
    hits += compare(mesh, tree, fan, {-0.5, 0.5, 0.25}, length, length);
  }
  REQUIRE(hits > 90);
  REQUIRE(compare(mesh, tree, fan, {0.5, 0.5, 0.25}, 0.1, 1) == 0);
  REQUIRE(compare(mesh, tree, fan, {100, 0.5, 0.5}, 0.1, 1) == 0);
  REQUIRE(compare(mesh, tree, fan, {0.5, 0.5, 1}, 0, 1) == 32);
  REQUIRE(compare(mesh, tree, fan, {0.5, 0.5, 0.9}, 0, 1) == 0);
  for (const double bad : {infinity, -infinity, nan}) {
    REQUIRE(compare(mesh, tree, fan, {0.5, bad, 0.5}, 0.1, 1) == 0);
    REQUIRE(compare(mesh, tree, fan, {0.5, 0.5, 0.5}, bad, 1) == 0);
  }
}
