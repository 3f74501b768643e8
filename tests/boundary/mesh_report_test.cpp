// SPDX-License-Identifier: MIT
#include <decant/boundary/mesh_report.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <decant/boundary/shapes.hpp>
#include <decant/io/mesh_file.hpp>

#include "boundary/mesh_samples.hpp"
#include "catch.hpp"
#include "data.hpp"

namespace {

using decant::Face;
using decant::MeshReport;
using decant::TriangleMesh;
using Point = decant::Vector3<double>;

bool says(const std::vector<std::string>& lines, const std::string& part) {
  for (const std::string& line : lines) {
    if (line.find(part) != std::string::npos) {
      return true;
    }
  }
  return false;
}

}  // namespace

TEST_CASE("a sound mesh has nothing to report") {
  const MeshReport report = decant::inspect(decant::CylinderInside{0.05, 0.1, 0.003, Face::PositiveZ}.mesh(), 0.005);
  REQUIRE(report.sound());
  REQUIRE(report.warnings.empty());
  REQUIRE(report.refusals.empty());
  REQUIRE(report.open_edges == 0);
  REQUIRE(report.thinnest_wall == Approx(0.003).margin(1e-6));
  REQUIRE(report.size[2] == Approx(0.103));
}

TEST_CASE("holes are found with their width") {
  TriangleMesh mesh = decant::BoxInside{Point(0, 0, 0), Point(0.1, 0.1, 0.1), 0.003, Face::PositiveZ}.mesh();
  mesh.triangles.erase(mesh.triangles.begin());  // half of a side's outer face
  const MeshReport wide = decant::inspect(mesh, 0.005);
  REQUIRE(wide.open_edges == 3);
  REQUIRE(wide.loops.size() == 1);
  REQUIRE(wide.loops[0].edges == 3);
  REQUIRE_FALSE(wide.closed());
  REQUIRE(says(wide.warnings, "3 open edges in 1 loop"));
  REQUIRE(says(wide.warnings, "wider than a particle"));
  REQUIRE(says(decant::inspect(mesh, 0.09).warnings, "narrower than a particle"));

  // a square tube, open at both ends: the largest ball through has the tube's width
  TriangleMesh tube;
  for (const double z : {0.0, 0.3}) {
    tube.vertices.insert(tube.vertices.end(),
                         {Point(0, 0, z), Point(0.04, 0, z), Point(0.04, 0.04, z), Point(0, 0.04, z)});
  }
  for (std::uint32_t k = 0; k < 4; ++k) {
    const std::uint32_t next = (k + 1) % 4;
    tube.triangles.push_back({k, next, next + 4});
    tube.triangles.push_back({k, next + 4, k + 4});
  }
  const MeshReport sheet = decant::inspect(tube, 0.005);
  REQUIRE(sheet.open_edges == 8);
  REQUIRE(sheet.loops.size() == 2);
  REQUIRE(sheet.loops[0].width == Approx(0.04).epsilon(0.02));
  REQUIRE(sheet.loops[0].length == Approx(0.16));
  REQUIRE(sheet.thinnest_wall == 0);
}

TEST_CASE("orientation defects and needless triangles are counted") {
  const TriangleMesh ball = decant_test::bumpy_ball(8, 0.01, 3);
  TriangleMesh mesh = ball;
  std::swap(mesh.triangles[40][0], mesh.triangles[40][1]);
  MeshReport report = decant::inspect(mesh, 0.1);
  REQUIRE(report.flipped_edges == 3);
  REQUIRE_FALSE(report.sound());
  REQUIRE(says(report.warnings, "orientation changes at 3 edges"));

  mesh = ball;
  for (auto& triangle : mesh.triangles) {
    std::swap(triangle[0], triangle[1]);
  }
  report = decant::inspect(mesh, 0.1);
  REQUIRE(report.inside_out);
  REQUIRE(says(report.warnings, "inside out"));

  mesh = ball;
  mesh.triangles.push_back(mesh.triangles[10]);
  mesh.triangles.push_back({5, 5, 6});
  report = decant::inspect(mesh, 0.1);
  REQUIRE(report.duplicate_triangles == 1);
  REQUIRE(report.degenerate_triangles == 1);
  REQUIRE(report.non_manifold_edges == 3);
  REQUIRE(says(report.warnings, "1 triangle without area"));
  REQUIRE(says(report.warnings, "1 triangle twice"));
  REQUIRE(says(report.warnings, "3 edges with more than two triangles"));
}

TEST_CASE("walls and sizes are held against the spacing") {
  const auto cup = [](double wall) { return decant::CylinderInside{0.05, 0.1, wall, Face::PositiveZ}.mesh(); };
  REQUIRE(says(decant::inspect(cup(0.0001), 0.005).warnings, "thinnest wall is 0.1 mm"));
  REQUIRE_FALSE(says(decant::inspect(cup(0.0001), 0.001).warnings, "thinnest"));
  REQUIRE(says(decant::inspect(decant::scaled(cup(0.002), 1000), 0.005).refusals, "millimetres (scale 0.001)?"));
  REQUIRE(says(decant::inspect(decant::scaled(cup(0.002), 0.001), 0.005).refusals, "less than one particle"));
  for (const double bad :
       {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    REQUIRE_THROWS_WITH(decant::inspect(cup(0.002), bad), decant_test::contains("MeshReport: particle spacing [m]"));
  }
  REQUIRE_THROWS_WITH(decant::inspect(TriangleMesh{}, 1), decant_test::contains("number of triangles"));
}

TEST_CASE("what a mesh holds is reported for the way up that is asked for") {
  const TriangleMesh glass = decant::CylinderInside{0.05, 0.1, 0.003, Face::PositiveZ}.mesh();
  REQUIRE(std::isnan(decant::inspect(glass, 0.005).cavity_volume));
  MeshReport report = decant::inspect(glass, 0.005, Point::UnitZ());
  // columns give volumes within 0.3 %, the mesh's polygon lacks a little of the circle
  REQUIRE(report.cavity_volume == Approx(std::acos(-1.0) * 0.05 * 0.05 * 0.1).epsilon(5e-3));
  REQUIRE(report.warnings.empty());
  report = decant::inspect(glass, 0.005, -Point::UnitZ());
  REQUIRE(report.cavity_volume == 0);
  REQUIRE(report.warnings.empty());  // as any solid
  // three particles to its width
  report = decant::inspect(decant::scaled(glass, 0.15), 0.005, Point::UnitZ());
  REQUIRE(says(report.warnings, "holds 2.65 ml below its rim this way up, no more than 22 particles of 5 mm"));

  TriangleMesh torn = glass;
  std::erase_if(torn.triangles, [&](const TriangleMesh::Triangle& triangle) {
    return std::all_of(triangle.begin(), triangle.end(),
                       [&](auto vertex) { return glass.vertices[vertex][2] < 0.001; });
  });
  REQUIRE(torn.triangles.size() < glass.triangles.size());
  report = decant::inspect(torn, 0.005, Point::UnitZ());
  REQUIRE(report.cavity_volume == 0);
  REQUIRE(says(report.warnings, "holds no liquid this way up"));
}

TEST_CASE("scans have the defects that are known of them") {
  struct Case {
    const char* file;
    std::size_t open_edges, loops, non_manifold;
    double material_ml;
  };
  const Case cases[] = {{"meshes_contactdb/cup.stl", 0, 0, 0, 98.9},
                        {"meshes_contactdb/bowl.stl", 130, 3, 0, 278.5},
                        {"meshes_ycb/024_bowl.obj", 0, 0, 3, 33.4},
                        {"meshes_ycb/025_mug.obj", 0, 0, 3, 138.1}};
  for (const Case& scan : cases) {
    if (const auto path = decant_test::measurements(scan.file)) {
      const MeshReport report = decant::inspect(decant::read_mesh(*path), 0.004);
      INFO(scan.file);
      REQUIRE(report.open_edges == scan.open_edges);
      REQUIRE(report.loops.size() == scan.loops);
      REQUIRE(report.non_manifold_edges == scan.non_manifold);
      REQUIRE(1e6 * report.material_volume == Approx(scan.material_ml).epsilon(2e-3));
      REQUIRE(report.refusals.empty());
    }
  }
}
