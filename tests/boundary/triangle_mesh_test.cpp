// SPDX-License-Identifier: MIT
#include <decant/boundary/triangle_mesh.hpp>

#include <limits>

#include "catch.hpp"

namespace {

using decant::TriangleMesh;
using Point = decant::Vector3<double>;

TriangleMesh tetrahedron(const Point& at) {
  TriangleMesh mesh;
  mesh.vertices = {at, at + Point::UnitX(), at + Point::UnitY(), at + Point::UnitZ()};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return mesh;
}

}  // namespace

TEST_CASE("a mesh's volume, area and bounds") {
  for (const double far : {0.0, 1e6}) {
    const TriangleMesh mesh = tetrahedron(Point(far, -far, far));
    REQUIRE(decant::signed_volume(mesh) == Approx(1.0 / 6).epsilon(1e-9));
    REQUIRE(decant::surface_area(mesh) == Approx(1.5 + std::sqrt(3.0) / 2).epsilon(1e-9));
    REQUIRE((decant::bounds(mesh).sizes() - Point::Ones()).norm() < 1e-9);
  }
  TriangleMesh inverted = tetrahedron(Point::Zero());
  for (auto& triangle : inverted.triangles) {
    std::swap(triangle[0], triangle[1]);
  }
  REQUIRE(decant::signed_volume(inverted) == Approx(-1.0 / 6));
  REQUIRE(decant::signed_volume(decant::scaled(inverted, 2)) == Approx(-8.0 / 6));
  REQUIRE(decant::signed_volume(TriangleMesh{}) == 0);
  REQUIRE(decant::bounds(TriangleMesh{}).isEmpty());
  const TriangleMesh two = decant::joined(tetrahedron(Point::Zero()), tetrahedron(Point(5, 0, 0)));
  REQUIRE(two.triangles.size() == 8);
  REQUIRE(decant::signed_volume(two) == Approx(2.0 / 6));
}

TEST_CASE("a mesh that does not validate is refused in words") {
  REQUIRE_NOTHROW(decant::validate(tetrahedron(Point::Zero())));
  REQUIRE_THROWS_WITH(decant::validate(TriangleMesh{}), "TriangleMesh: number of triangles must be >= 1, got 0");
  TriangleMesh mesh = tetrahedron(Point::Zero());
  mesh.triangles[2][1] = 4;
  REQUIRE_THROWS_WITH(decant::validate(mesh), "TriangleMesh: vertex index of a triangle must be below 4, got 4");
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), -2e9}) {
    mesh = tetrahedron(Point::Zero());
    mesh.vertices[3][2] = bad;
    REQUIRE_THROWS_WITH(decant::validate(mesh), decant_test::contains("TriangleMesh: coordinate [m] of a vertex"));
  }
  for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    REQUIRE_THROWS_WITH(decant::scaled(mesh, bad), decant_test::contains("scale factor [-] must be > 0"));
  }
}

TEST_CASE("welding merges equal vertices and keeps triangles") {
  TriangleMesh soup;
  const TriangleMesh solid = tetrahedron(Point(0, 1, -1));
  soup.vertices.emplace_back(9, 9, 9);  // used by no triangle
  for (std::size_t t = 0; t < 4; ++t) {
    TriangleMesh::Triangle triangle;
    for (std::size_t k = 0; k < 3; ++k) {
      triangle[k] = static_cast<std::uint32_t>(soup.vertices.size());
      Point corner = solid.corner(t, k);
      if (t % 2 == 1 && corner[0] == 0) {
        corner[0] = -0.0;
      }
      soup.vertices.push_back(corner);
    }
    soup.triangles.push_back(triangle);
  }
  const TriangleMesh merged = decant::welded(soup);
  REQUIRE(merged.vertices.size() == 4);
  REQUIRE(merged.triangles.size() == 4);
  REQUIRE(decant::signed_volume(merged) == Approx(1.0 / 6));
  // nearly equal is not equal
  soup.vertices.back()[0] += 1e-15;
  REQUIRE(decant::welded(soup).vertices.size() == 5);
}
