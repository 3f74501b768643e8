// SPDX-License-Identifier: MIT
#include <decant/boundary/mesh_repair.hpp>

#include <cmath>
#include <limits>

#include <decant/boundary/cavity.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/io/mesh_file.hpp>

#include "boundary/mesh_samples.hpp"
#include "catch.hpp"
#include "data.hpp"

namespace {

using decant::RepairReport;
using decant::TriangleMesh;
using decant_test::closed_and_oriented;
using decant_test::some_turned;
using Point = decant::Vector3<double>;

}  // namespace

TEST_CASE("a sound mesh passes repair unchanged") {
  const TriangleMesh mesh = decant::Cup{}.mesh();
  RepairReport report;
  const TriangleMesh same = decant::repaired(mesh, 0.004, report);
  REQUIRE(same.triangles == decant::welded(mesh).triangles);
  REQUIRE(report.lines.empty());
  REQUIRE(report.turned_triangles == 0);
}

TEST_CASE("triangles are turned to look out of the material") {
  const TriangleMesh cup = decant::Cup{}.mesh();
  RepairReport report;
  TriangleMesh mesh = decant::repaired(some_turned(cup, 1), 0.004, report);
  REQUIRE(closed_and_oriented(mesh));
  REQUIRE(decant::signed_volume(mesh) == Approx(decant::signed_volume(cup)));
  REQUIRE(report.turned_triangles > cup.triangles.size() / 5);
  REQUIRE(report.turned_triangles < cup.triangles.size() / 2);

  TriangleMesh inverted = cup;
  for (auto& triangle : inverted.triangles) {
    std::swap(triangle[0], triangle[1]);
  }
  mesh = decant::repaired(inverted, 0.004, report);
  REQUIRE(decant::signed_volume(mesh) == Approx(decant::signed_volume(cup)));
  REQUIRE(report.turned_triangles == cup.triangles.size());

  // the hollow of a closed vessel looks inward, in a solid beside it as well
  TriangleMesh vessel = decant::CylinderInside{0.05, 0.1, 0.002, {}}.mesh();
  vessel = decant::joined(vessel, decant::Box{Point(1, 0, 0), Point(1.1, 0.1, 0.1)}.mesh());
  mesh = decant::repaired(some_turned(vessel, 2), 0.004);
  REQUIRE(closed_and_oriented(mesh));
  REQUIRE(decant::signed_volume(mesh) == Approx(decant::signed_volume(vessel)));
}

TEST_CASE("holes narrower than a particle are closed and wider ones kept") {
  const TriangleMesh ball = decant::scaled(decant_test::bumpy_ball(24, 0.01, 3), 0.05);
  TriangleMesh mesh = ball;
  mesh.triangles.erase(mesh.triangles.begin() + 900, mesh.triangles.begin() + 906);
  mesh.triangles.erase(mesh.triangles.begin() + 300);
  RepairReport report;
  const TriangleMesh closed = decant::repaired(mesh, 0.02, report);
  REQUIRE(closed_and_oriented(closed));
  REQUIRE(report.closed_holes == 2);
  REQUIRE(report.added_triangles == 7);
  REQUIRE(decant::signed_volume(closed) == Approx(decant::signed_volume(ball)).epsilon(1e-3));
  const TriangleMesh kept = decant::repaired(mesh, 0.0005, report);
  REQUIRE(report.closed_holes == 0);
  REQUIRE(kept.triangles.size() == mesh.triangles.size());
}

TEST_CASE("two holes that touch at a corner are closed one by one") {
  const TriangleMesh ball = decant_test::bumpy_ball(12, 0, 3);
  TriangleMesh mesh = ball;
  // two triangles around the pole that share nothing but the pole
  mesh.triangles.erase(mesh.triangles.begin() + 10);
  mesh.triangles.erase(mesh.triangles.begin() + 2);
  RepairReport report;
  const TriangleMesh closed = decant::repaired(mesh, 1, report);
  REQUIRE(report.closed_holes == 2);
  REQUIRE(closed_and_oriented(closed));
  REQUIRE(decant::signed_volume(closed) == Approx(decant::signed_volume(ball)));
}

TEST_CASE("needless triangles go without leaving a hole") {
  const TriangleMesh ball = decant_test::bumpy_ball(8, 0.01, 3);
  TriangleMesh mesh = ball;
  mesh.triangles.push_back(mesh.triangles[10]);  // twice
  auto opposite = mesh.triangles[20];
  std::swap(opposite[0], opposite[1]);
  mesh.triangles.push_back(opposite);     // twice, once the other way
  mesh.triangles.push_back({3, 3, 4});    // a line
  mesh.triangles.push_back({3, 30, 60});  // a fin's two sides
  mesh.triangles.push_back({3, 60, 30});
  RepairReport report;
  const TriangleMesh clean = decant::repaired(mesh, 0.01, report);
  REQUIRE(report.dropped_triangles == 5);
  REQUIRE(closed_and_oriented(clean));
  REQUIRE(clean.triangles.size() == ball.triangles.size());
  REQUIRE(decant::signed_volume(clean) == Approx(decant::signed_volume(ball)));
}

TEST_CASE("loops of any length are spanned") {
  // a flat disc's border: least area is the disc's, by either way of spanning
  for (const std::size_t count : {3U, 40U, 2000U}) {
    std::vector<Point> vertices;
    std::vector<std::uint32_t> loop;
    for (std::size_t k = 0; k < count; ++k) {
      const double turn = 2 * std::acos(-1.0) * static_cast<double>(k) / static_cast<double>(count);
      vertices.emplace_back(std::cos(turn), std::sin(turn), 0);
      loop.push_back(static_cast<std::uint32_t>(k));
    }
    TriangleMesh span{vertices, decant::detail::span_loop(vertices, loop)};
    REQUIRE(span.triangles.size() == count - 2);
    const double polygon =
        0.5 * static_cast<double>(count) * std::sin(2 * std::acos(-1.0) / static_cast<double>(count));
    REQUIRE(decant::surface_area(span) == Approx(polygon));
    for (std::size_t t = 0; t < span.triangles.size(); ++t) {
      REQUIRE(span.area_normal(t)[2] > 0);
    }
    const double inscribed = 2 * std::cos(std::acos(-1.0) / static_cast<double>(count));
    REQUIRE(decant::detail::span_width(vertices, loop, span.triangles) == Approx(inscribed).epsilon(0.15));
  }
}

TEST_CASE("repair settings out of range are refused in words") {
  for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    REQUIRE_THROWS_WITH(decant::repaired(decant::Cup{}.mesh(), bad),
                        decant_test::contains("repaired: particle spacing [m]"));
  }
  REQUIRE_THROWS_WITH(decant::repaired(TriangleMesh{}, 1), decant_test::contains("number of triangles"));
  TriangleMesh line;
  line.vertices = {Point(0, 0, 0), Point(1, 0, 0)};
  line.triangles = {{0, 1, 1}};
  REQUIRE_THROWS_WITH(decant::repaired(line, 1), decant_test::contains("three different corners"));
}

TEST_CASE("scans are closed and outward after repair") {
  for (const char* file :
       {"meshes_contactdb/cup.stl", "meshes_contactdb/bowl.stl", "meshes_ycb/024_bowl.obj", "meshes_ycb/025_mug.obj"}) {
    const auto path = decant_test::measurements(file);
    if (!path) {
      continue;
    }
    INFO(file);
    const TriangleMesh scan = decant::read_mesh(*path);
    const TriangleMesh whole = decant::repaired(scan, 0.003);
    REQUIRE(closed_and_oriented(whole));
    REQUIRE(decant::signed_volume(whole) == Approx(std::abs(decant::signed_volume(scan))).epsilon(1e-3));
    const TriangleMesh mended = decant::repaired(some_turned(scan, 9), 0.003);
    REQUIRE(closed_and_oriented(mended));
    REQUIRE(decant::signed_volume(mended) == Approx(decant::signed_volume(whole)).epsilon(1e-6));
    // no straight way from a point in the cavity out through the wall or the seam
    const decant::BoundingVolumeHierarchy surface(whole);
    const decant::Cavity cavity(whole);
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    const Point start(surface.bounds().center()[0], surface.bounds().center()[1],
                      0.5 * (cavity.bottom_height() + cavity.rim_height()));
    if (!cavity.contains(start)) {
      continue;  // the middle of a mug's bounds is off its axis
    }
    int leaks = 0;
    for (int n = 0; n < 20000; ++n) {
      Point direction(normal(random), normal(random), normal(random));
      direction[2] = -std::abs(direction[2]);
      leaks += surface.any_hit(start, start + direction.normalized()) ? 0 : 1;
    }
    REQUIRE(leaks == 0);
  }
}
