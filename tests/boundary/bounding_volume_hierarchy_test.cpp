// SPDX-License-Identifier: MIT
#include <decant/boundary/bounding_volume_hierarchy.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "boundary/mesh_samples.hpp"
#include "catch.hpp"

namespace {

using decant::BoundingVolumeHierarchy;
using decant::TriangleMesh;
using decant_test::bumpy_ball;
using decant_test::cube;
using decant_test::random_point;
using Point = decant::Vector3<double>;

double segment_distance(const Point& x, const Point& a, const Point& b) {
  const double t = std::clamp((x - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
  return (x - a - t * (b - a)).norm();
}

// By another way than the hierarchy's: the plane where the foot is inside, else the three edges.
double triangle_distance(const Point& x, const Point& a, const Point& b, const Point& c) {
  const Point n = (b - a).cross(c - a).normalized();
  const Point foot = x - n.dot(x - a) * n;
  const bool inside =
      n.dot((b - a).cross(foot - a)) >= 0 && n.dot((c - b).cross(foot - b)) >= 0 && n.dot((a - c).cross(foot - c)) >= 0;
  return inside ? std::abs(n.dot(x - a))
                : std::min({segment_distance(x, a, b), segment_distance(x, b, c), segment_distance(x, c, a)});
}

// T. Moeller and B. Trumbore, "Fast, minimum storage ray/triangle intersection", 1997.
std::optional<double> triangle_hit(const Point& origin, const Point& d, const Point& a, const Point& b,
                                   const Point& c) {
  const Point p = d.cross(c - a);
  const double det = (b - a).dot(p);
  const double u = (origin - a).dot(p) / det;
  const Point q = (origin - a).cross(b - a);
  const double v = d.dot(q) / det;
  const double t = (c - a).dot(q) / det;
  return u >= 0 && v >= 0 && u + v <= 1 && t >= 0 && t <= 1 ? std::optional(t) : std::nullopt;
}

TriangleMesh moved(TriangleMesh mesh, double scale, const Point& by) {
  for (Point& vertex : mesh.vertices) {
    vertex = scale * vertex + by;
  }
  return mesh;
}

void compare_with_brute_force(const TriangleMesh& mesh, const Point& center, double reach, unsigned seed) {
  const BoundingVolumeHierarchy tree(mesh);
  std::mt19937 random(seed);
  int hits = 0;
  int misses = 0;
  for (int n = 0; n < 1500; ++n) {
    const Point x = random_point(random, center, 1.2 * reach);
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      nearest = std::min(nearest, triangle_distance(x, mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)));
    }
    const auto found = tree.closest_point(x, std::numeric_limits<double>::infinity());
    REQUIRE(found);
    REQUIRE(std::abs(found->distance - nearest) < 1e-12 * (reach + center.norm()));
    REQUIRE((found->point - x).norm() == Approx(found->distance).margin(1e-14 * (reach + center.norm())));
    const Point normal = mesh.area_normal(found->triangle).normalized();
    REQUIRE((found->normal - normal).norm() < 1e-12);
    REQUIRE(tree.closest_point(x, nearest * 1.001));
    REQUIRE_FALSE(tree.closest_point(x, nearest * 0.999));

    const Point target = n % 2 == 0 ? random_point(random, center, 1.2 * reach) : random_point(random, x, 0.1 * reach);
    std::optional<double> first;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const auto hit = triangle_hit(x, target - x, mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2));
      if (hit && (!first || *hit < *first)) {
        first = hit;
      }
    }
    const auto hit = tree.first_hit(x, target);
    REQUIRE(hit.has_value() == first.has_value());
    REQUIRE(tree.any_hit(x, target) == first.has_value());
    REQUIRE(tree.any_hit(target, x) == first.has_value());
    if (hit) {
      ++hits;
      // The fraction is a distance over the segment's length: coordinates round at 1e-16 of their size.
      const double rounding = 1e-12 * (reach + center.norm()) / (target - x).norm();
      REQUIRE(std::abs(hit->fraction - *first) < 10 * rounding + 1e-11);
      REQUIRE((hit->point - (x + hit->fraction * (target - x))).norm() < 1e-11 * (reach + center.norm()));
      REQUIRE((hit->normal - mesh.area_normal(hit->triangle).normalized()).norm() < 1e-12);
      const auto along = tree.first_hit_along(x, (target - x).normalized(), (target - x).norm());
      REQUIRE(along);
      REQUIRE(along->fraction == Approx(hit->fraction).margin(10 * rounding));
    } else {
      ++misses;
    }
  }
  REQUIRE(hits > 50);
  REQUIRE(misses > 100);
}

}  // namespace

TEST_CASE("hierarchy answers as a look at every triangle does") {
  compare_with_brute_force(bumpy_ball(9, 0.2, 1), Point::Zero(), 1, 2);
  compare_with_brute_force(decant_test::random_triangles(500, 0.15, 3), Point::Zero(), 1, 4);
  compare_with_brute_force(moved(bumpy_ball(9, 0.2, 5), 0.04, Point(3, -2, 1)), Point(3, -2, 1), 0.04, 6);
  compare_with_brute_force(moved(decant_test::random_triangles(3, 0.9, 7), 100, Point::Zero()), Point::Zero(), 100, 8);
}

TEST_CASE("no segment slips out of a closed surface through an edge or a corner") {
  for (const double scale : {1.0, 1e-3, 50.0}) {
    for (const double far : {0.0, 7.0, 1234.5}) {
      const Point center = far * Point(1, -0.7, 0.3);
      const TriangleMesh mesh = moved(bumpy_ball(16, 0.05, 11), scale, center);
      const BoundingVolumeHierarchy tree(mesh);
      std::mt19937 random(12);
      std::uniform_real_distribution<double> share(0, 1);
      int missed = 0;
      for (int n = 0; n < 20000; ++n) {
        const std::size_t t = random() % mesh.triangles.size();
        const Point corner = mesh.corner(t, 0);
        const Point target = n % 2 == 0 ? corner : Point(corner + share(random) * (mesh.corner(t, 1) - corner));
        const Point inside = random_point(random, center, 0.3 * scale);
        const double beyond = n % 3 == 0 ? 1.2 : (n % 3 == 1 ? 2 : 40);
        const Point outside = inside + beyond * (target - inside);
        if ((outside - center).norm() < 1.06 * scale) {
          continue;
        }
        missed += tree.any_hit(inside, outside) ? 0 : 1;
        missed += tree.first_hit(inside, outside) ? 0 : 1;
        missed += tree.first_hit(outside, inside) ? 0 : 1;
      }
      REQUIRE(missed == 0);
    }
  }
}

TEST_CASE("touching counts as a hit and passing beside does not") {
  const BoundingVolumeHierarchy tree(cube());
  const auto fraction = [&](const Point& a, const Point& b) {
    const auto hit = tree.first_hit(a, b);
    REQUIRE(hit.has_value() == tree.any_hit(a, b));
    return hit ? hit->fraction : -1;
  };
  REQUIRE(fraction({0.5, 0.5, 0.5}, {0.5, 0.5, 1}) == Approx(1));   // ends on a face
  REQUIRE(fraction({0.5, 0.5, 1}, {0.5, 0.5, 2}) == 0);             // begins on it
  REQUIRE(fraction({-1, 0.5, 1}, {2, 0.5, 1}) == Approx(1.0 / 3));  // runs within its plane
  REQUIRE(fraction({0.2, 0.5, 1}, {0.3, 0.6, 1}) == 0);
  REQUIRE(fraction({-1, 1, 1}, {2, 1, 1}) == Approx(1.0 / 3));  // runs along an edge
  REQUIRE(fraction({-1, 1, 1}, {-0.1, 1, 1}) == -1);            // ends before it
  REQUIRE(fraction({-1, 1 + 1e-9, 1}, {2, 1 + 1e-9, 1}) == -1);
  REQUIRE(fraction({0.5, 0.5, 1 + 1e-9}, {0.5, 0.7, 1 + 1e-9}) == -1);
  REQUIRE(fraction({0, 0, 2}, {0, 0, 0.5}) == Approx(2.0 / 3));  // onto a corner, then along an edge
  REQUIRE(fraction({0.5, 0.5, 1}, {0.5, 0.5, 1}) == 0);          // a point on the surface
  REQUIRE(fraction({0.5, 0.5, 0.9}, {0.5, 0.5, 0.9}) == -1);
}

TEST_CASE("far away and unusable questions are answered") {
  const BoundingVolumeHierarchy tree(cube());
  const double infinity = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto hit = tree.first_hit({-1e12, 0.5, 0.5}, {1e12, 0.5, 0.5});
  REQUIRE(hit);
  REQUIRE(hit->point[0] == 0);
  REQUIRE(hit->fraction == Approx(0.5));
  REQUIRE_FALSE(tree.any_hit({-1e12, 2.5, 0.5}, {1e12, 2.5, 0.5}));
  REQUIRE_FALSE(tree.any_hit({5, 5, 5}, {6, 6, 1e30}));
  const auto closest = tree.closest_point({1e9, 0.5, 0.5}, infinity);
  REQUIRE(closest);
  REQUIRE(closest->distance == Approx(1e9 - 1));
  for (const double bad : {infinity, -infinity, nan}) {
    for (int axis = 0; axis < 3; ++axis) {
      Point x(0.5, 0.5, 0.5);
      x[axis] = bad;
      REQUIRE_FALSE(tree.first_hit(x, {0.5, 0.5, 2}));
      REQUIRE_FALSE(tree.any_hit({0.5, 0.5, 2}, x));
      REQUIRE_FALSE(tree.closest_point(x, 1));
      REQUIRE_FALSE(tree.inside_material(x));
    }
  }
  REQUIRE_FALSE(tree.closest_point({0.5, 0.5, 0.5}, nan));
  REQUIRE_FALSE(tree.closest_point({0.5, 0.5, 0.5}, -1));
}

TEST_CASE("material is told from what it encloses") {
  const TriangleMesh ball = bumpy_ball(16, 0, 1);
  TriangleMesh hollow = moved(ball, 0.5, Point::Zero());
  for (auto& triangle : hollow.triangles) {
    std::swap(triangle[0], triangle[1]);
  }
  const BoundingVolumeHierarchy shell(decant::joined(ball, hollow));
  const BoundingVolumeHierarchy overlapping(decant::joined(ball, moved(ball, 1, Point(1, 0, 0))));
  TriangleMesh damaged = ball;
  damaged.triangles.resize(damaged.triangles.size() - 3);
  const BoundingVolumeHierarchy holed(damaged);
  std::mt19937 random(31);
  int wrong = 0;
  int wrong_holed = 0;
  for (int n = 0; n < 4000; ++n) {
    const Point x = random_point(random, Point::Zero(), 1.3);
    const double r = x.norm();
    // the polyhedron's faces are up to 2 % below the sphere
    if ((r > 0.97 && r < 1.001) || (r > 0.48 && r < 0.501)) {
      continue;
    }
    wrong += shell.inside_material(x) == (r > 0.5 && r < 1) ? 0 : 1;
    wrong_holed += holed.inside_material(x) == (r < 1) ? 0 : 1;
    const double other = (x - Point(1, 0, 0)).norm();
    if (other < 0.97 || other > 1.001) {
      wrong += overlapping.inside_material(x) == (r < 1 || other < 1) ? 0 : 1;
    }
  }
  REQUIRE(wrong == 0);
  REQUIRE(wrong_holed < 20);
  // Wedges whose edges lie across two of the directions that are asked first: a ray in through the edge of two
  // triangles and out through one must not count as inside.
  TriangleMesh wedges = moved(cube(), 1, Point(-5, -5, -5));
  wedges = decant::joined(wedges, moved(cube(), 1, Point(4, 4, 4)));
  for (const Point& along : {Point(0.5257, 0.3819, 0.7601), Point(-0.6653, 0.7112, -0.2272)}) {
    const Point across = along.unitOrthogonal();
    const Point other = along.cross(across);
    TriangleMesh wedge;
    wedge.vertices = {along + 0.1 * across, along - 0.1 * across, 1.3 * along + 0.1 * other + 0.02 * across,
                      1.3 * along - 0.1 * other + 0.03 * across};
    wedge.triangles = {{0, 1, 2}, {1, 0, 3}, {0, 2, 3}, {1, 3, 2}};
    wedges = decant::joined(wedges, wedge);
  }
  const BoundingVolumeHierarchy edges_first(wedges);
  REQUIRE_FALSE(edges_first.inside_material(Point::Zero()));
  REQUIRE_FALSE(edges_first.crossing_count(Point::Zero(), 2 * Point(0.5257, 0.3819, 0.7601)));
  REQUIRE(edges_first.crossing_count(Point(-4.6, -4.7, -6), Point(-4.6, -4.7, 0)) == 2);
  REQUIRE(edges_first.crossing_count(Point::Zero(), Point(0, 0, 1)) == 0);
  // rays from the middle of a cube, and from places level with its edges
  const BoundingVolumeHierarchy box(cube());
  for (const double x : {1e-9, 0.25, 0.5, 1 - 1e-9}) {
    REQUIRE(box.inside_material({x, x, x}));
    REQUIRE_FALSE(box.inside_material({x, x, -1e-9}));
    REQUIRE_FALSE(box.inside_material({x, 1 + 1e-9, x}));
  }
}

TEST_CASE("triangles without area change nothing") {
  TriangleMesh mesh = cube();
  const auto real = mesh.triangles.size();
  mesh.vertices.emplace_back(0.5, 0.5, 0);
  mesh.triangles.push_back({0, 0, 1});
  mesh.triangles.push_back({0, 3, 8});  // on a diagonal
  mesh.triangles.push_back({5, 5, 5});
  const BoundingVolumeHierarchy tree(mesh);
  REQUIRE(tree.size() == real);
  compare_with_brute_force(cube(), Point(0.5, 0.5, 0.5), 0.5, 41);
  std::mt19937 random(42);
  const BoundingVolumeHierarchy clean(cube());
  for (int n = 0; n < 1000; ++n) {
    const Point a = random_point(random, Point(0.5, 0.5, 0.5), 1);
    const Point b = random_point(random, Point(0.5, 0.5, 0.5), 1);
    REQUIRE(tree.any_hit(a, b) == clean.any_hit(a, b));
    REQUIRE(tree.closest_point(a, 9)->distance == clean.closest_point(a, 9)->distance);
  }
  TriangleMesh flat;
  flat.vertices = {Point(0, 0, 0), Point(1, 1, 1), Point(2, 2, 2)};
  flat.triangles = {{0, 1, 2}};
  REQUIRE_THROWS_WITH(BoundingVolumeHierarchy(flat), decant_test::contains("triangles with an area must be >= 1"));
  REQUIRE_THROWS_WITH(BoundingVolumeHierarchy(TriangleMesh{}), decant_test::contains("number of triangles"));
}

TEST_CASE("slivers are hit where they are and nowhere else") {
  TriangleMesh mesh;
  mesh.vertices = {Point(0, 0, 0), Point(1e-3, 0, 0), Point(0.5e-3, 1e-9, 0), Point(0, 0, 1e-3)};
  mesh.triangles = {{0, 1, 2}, {0, 3, 1}};
  const BoundingVolumeHierarchy tree(mesh);
  std::mt19937 random(3);
  int wrong = 0;
  for (int n = 0; n < 2000; ++n) {
    // across the narrow triangle at some height, in all directions and lengths
    const Point over =
        Point(5e-4, 5e-10, 0) + random_point(random, Point(0, 0, -0.02), 0.0199).cwiseProduct(Point(0, 0, 1));
    const Point along = random_point(random, Point::Zero(), n % 2 == 0 ? 2 : 0.01);
    if (std::abs(along[2]) < 0.5 * along.head<2>().norm()) {
      wrong +=
          tree.any_hit(over - along, over + along) && std::abs((over - over[2] / along[2] * along)[0] - 5e-4) > 6e-4
              ? 1
              : 0;
    }
    const Point through(2e-4 + 6e-4 * (n / 2000.0), 0, 0);  // on the edge that both share
    const Point down = random_point(random, Point(0, 0, -1), 0.5);
    wrong += tree.any_hit(through - down, through + down) ? 0 : 1;
  }
  REQUIRE(wrong == 0);
  REQUIRE_FALSE(tree.any_hit({5e-4, -0.5, -0.1}, {5e-4, 0.5, -0.2}));
}

TEST_CASE("trees stay shallow for triangles of all sizes and at one place") {
  TriangleMesh mesh;
  for (int k = 0; k < 160; ++k) {
    const double size = std::pow(0.85, k);  // each far smaller than all before: the area heuristic peels one by one
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.emplace_back(size, 0, 0);
    mesh.vertices.emplace_back(0, size, 0);
    mesh.vertices.emplace_back(0, 0, size);
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  for (int k = 0; k < 400; ++k) {
    mesh.triangles.push_back({0, 1, 2});
  }
  const BoundingVolumeHierarchy tree(mesh);
  REQUIRE(tree.size() == 560);
  const auto hit = tree.first_hit({0, 0, 0}, {1, 1, 1});
  REQUIRE(hit);
  REQUIRE(hit->fraction == Approx(std::pow(0.85, 159) / 3).epsilon(1e-3));
  REQUIRE(tree.first_hit({1, 1, 1}, {0, 0, 0})->fraction == Approx(2.0 / 3));
  REQUIRE(tree.closest_point({1, 1, 1}, 10)->distance == Approx(2 / std::sqrt(3.0)));
}
