// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <decant/boundary/mesh_report.hpp>
#include <decant/boundary/pipe_blockage.hpp>
#include <decant/boundary/pipe_network.hpp>
#include <decant/boundary/pipe_openings.hpp>
#include <decant/boundary/shapes.hpp>

#include "catch.hpp"

namespace {

using decant::PipeNetwork;
using decant::PipeOpening;
using Place = decant::Vector3<double>;

/// An inverted T: the stem's end, the ends of the legs, and where they meet, last.
PipeNetwork inverted_tee(PipeNetwork::Bore bore) {
  PipeNetwork tee;
  tee.bore = bore;
  tee.radius = 0.02;
  tee.places = {{0, 0.15}, {-0.11, -0.005}, {0.12, -0.005}, {0, 0}};
  tee.pipes = {{0, 3}, {3, 1}, {3, 2}};
  return tee;
}

decant::TriangleMesh turned(decant::TriangleMesh mesh, const Eigen::Quaterniond& turn) {
  for (Place& vertex : mesh.vertices) {
    vertex = turn * vertex;
  }
  return mesh;
}

}  // namespace

TEST_CASE("pipe network: walls are as thick as they should be, and bores as wide") {
  PipeNetwork straight;
  straight.places = {{0, 0}, {0, 0.1}};
  straight.pipes = {{0, 1}};
  const decant::MeshReport report = decant::inspect(straight.mesh(), 0.004);
  CHECK(report.sound());
  const double inner = straight.bore_area();
  const double outer = inner * std::pow((straight.radius + straight.wall) / straight.radius, 2);
  CHECK(report.material_volume == Approx((outer - inner) * 0.1));
  for (const auto bore : {PipeNetwork::Bore::Round, PipeNetwork::Bore::Square}) {
    PipeNetwork tee = inverted_tee(bore);
    CHECK(decant::inspect(tee.mesh(), 0.004).sound());
    tee.pipes[1].bore = {{0, 1}, {0.4, 1}, {0.5, 0.5}, {0.6, 1}, {1, 1}};
    tee.holes = {{2, 0.4, 0.6, 0, 1.0}};
    CHECK(decant::inspect(tee.mesh(), 0.004).sound());
  }
  straight.sides = 6;
  CHECK_THROWS_WITH(straight.mesh(), decant_test::contains("sides"));
  straight.sides = 48;
  straight.pipes = {{0, 2}};
  CHECK_THROWS_WITH(straight.mesh(), decant_test::contains("two of the places"));
}

TEST_CASE("pipe openings: a junction has three, however it is turned") {
  const std::vector<Eigen::Quaterniond> turns{
      Eigen::Quaterniond::Identity(),
      Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Place(1, 2, -1).normalized())),
  };
  for (const auto bore : {PipeNetwork::Bore::Round, PipeNetwork::Bore::Square}) {
    const PipeNetwork tee = inverted_tee(bore);
    for (const Eigen::Quaterniond& turn : turns) {
      const std::vector<PipeOpening> openings = decant::find_pipe_openings(turned(tee.mesh(), turn));
      REQUIRE(openings.size() == 3);
      for (std::size_t end = 0; end < 3; ++end) {
        const Place expected = turn * Place(tee.places[end].x(), 0, tee.places[end].y());
        const Place outward = (expected - turn * Place(tee.places[3].x(), 0, tee.places[3].y())).normalized();
        std::size_t found = 0;
        for (const PipeOpening& opening : openings) {
          if ((opening.rim.center - expected).norm() < 0.001) {
            ++found;
            CHECK(opening.rim.direction.dot(outward) > 0.999);
            CHECK(opening.rim.area == Approx(tee.bore_area()).epsilon(0.01));
            CHECK(opening.passage == 0);
          }
        }
        CHECK(found == 1);
      }
    }
  }
}

TEST_CASE("pipe openings: cups have one; what has no inside has none") {
  const auto cup = decant::find_pipe_openings(decant::Cup{}.mesh());
  REQUIRE(cup.size() == 1);
  CHECK(cup[0].rim.direction.dot(Place::UnitZ()) > 0.999);
  CHECK(cup[0].rim.radius() == Approx(decant::Cup{}.rim_radius).epsilon(0.02));
  CHECK(decant::find_pipe_openings(decant::Sphere{}.mesh()).empty());
  CHECK(decant::find_pipe_openings(decant::Box{}.mesh()).empty());
  CHECK_THROWS_WITH(decant::find_pipe_openings(decant::TriangleMesh{}), decant_test::contains("number of triangles"));
}

TEST_CASE("pipe network: what is narrow is so on all sides, also between sharp corners") {
  PipeNetwork pipes;
  pipes.radius = 0.018;
  pipes.places = {{0, 0.2}, {0, 0}, {0.13, 0}, {0.13, -0.1}};
  pipes.pipes = {
      {0, 1}, {1, 2, {{0, 1}, {0.3, 0.6}, {0.55, 0.6}, {0.56, 0.3}, {0.64, 0.3}, {0.65, 0.6}, {1, 1}}}, {2, 3}};
  const decant::TriangleMesh mesh = pipes.mesh();
  const decant::BoundingVolumeHierarchy surface(mesh);
  // across the middle of the narrow part, and just before and behind it
  for (const auto& [x, factor] : {std::pair(0.6, 0.3), {0.57, 0.3}, {0.63, 0.3}, {0.53, 0.6}, {0.36, 0.6}}) {
    const auto section = decant::pipe_section(surface, {0.13 * x, 0, 0}, {1, 0, 0}, 0.05);
    REQUIRE(section);
    INFO("share of the way " << x);
    CHECK(section->area == Approx(factor * factor * pipes.bore_area()).epsilon(0.02));
  }
}

TEST_CASE("pipe section: goes around a sharp corner, but not into a branch or through an end") {
  PipeNetwork pipes;
  pipes.radius = 0.01;
  pipes.places = {{0, 0}, {0, 0.1}, {0.15, 0.11}, {0.15, 0.0}, {0.15, 0.2}};
  pipes.pipes = {{0, 1}, {1, 2}, {2, 3}, {2, 4}};
  const decant::BoundingVolumeHierarchy surface(pipes.mesh());
  std::vector<PipeOpening> openings = decant::find_pipe_openings(surface);
  REQUIRE(openings.size() == 3);
  const decant::PipeSection& rim = openings.front().rim;  // sorted by x: the one at the origin
  REQUIRE(rim.center.norm() < 1e-3);
  const auto line = decant::center_line(surface, rim, 1, 0.004);
  const double to_corner = 0.1, to_branch = to_corner + std::hypot(0.15, 0.01);
  CHECK(line.back().distance < to_branch);
  CHECK(line.back().distance > to_branch - 0.03);
  std::size_t before = 0, behind = 0;
  for (const decant::PipeSection& section : line) {
    CHECK(section.area == Approx(pipes.bore_area()).epsilon(0.05));
    const bool in_first = section.center.z() < 0.085;
    (in_first ? before : behind) += 1;
    // the middle of the first or of the second pipe, and so far along it as the distance says
    const Place way = Place(0.15, 0, 0.01).normalized(), corner(0, 0, to_corner);
    const Place expected = section.distance < to_corner ? Place(0, 0, section.distance)
                                                        : Place(corner + (section.distance - to_corner) * way);
    CHECK((section.center - expected).norm() < 0.35 * pipes.radius);
  }
  CHECK(before >= 15);
  CHECK(behind >= 20);
  // into the branch from the side
  CHECK_FALSE(decant::behind_corner(surface, line.back()));
  // a pipe that ends
  PipeNetwork dead_end;
  dead_end.radius = 0.01;
  dead_end.places = {{0, 0}, {0, 0.1}};
  dead_end.pipes = {{0, 1, {{0, 1}, {0.9, 1}, {0.91, 0.02}, {1, 0.02}}}};
  const decant::BoundingVolumeHierarchy closed(dead_end.mesh());
  const auto inside = decant::pipe_section(closed, {0, 0, 0.08}, {0, 0, -1}, 0.05);
  REQUIRE(inside);
  CHECK_FALSE(decant::behind_corner(closed, *inside));
}

TEST_CASE("pipe section: follows a leg to where it branches, and no farther") {
  PipeNetwork tee = inverted_tee(PipeNetwork::Bore::Round);
  tee.pipes[1].bore = {{0, 1}, {0.2, 1}, {0.4, 0.8}, {0.6, 0.8}, {0.8, 1}, {1, 1}};
  const decant::BoundingVolumeHierarchy surface(tee.mesh());
  const std::vector<PipeOpening> openings = decant::find_pipe_openings(surface);
  REQUIRE(openings.size() == 3);
  const decant::PipeSection& rim = openings.front().rim;  // sorted by x: the left one
  REQUIRE(rim.center.x() == Approx(-0.11).margin(1e-3));
  const auto line = decant::center_line(surface, rim, 0.3, 0.005);
  const double leg = std::hypot(0.11, 0.005);
  CHECK(line.back().distance < leg + 0.005);
  CHECK(line.back().distance > leg - 0.03);
  // half-way it is as narrow as it was made
  double narrowest = std::numeric_limits<double>::infinity(), at = 0;
  for (const decant::PipeSection& section : line) {
    if (section.area < narrowest) {
      narrowest = section.area;
      at = section.distance;
    }
  }
  CHECK(at == Approx(leg / 2).margin(0.1 * leg + 0.001));
  CHECK(narrowest == Approx(0.64 * tee.bore_area()).epsilon(0.02));
  CHECK_THROWS_WITH(decant::center_line(surface, rim, 0.1, 0), decant_test::contains("center_line: step"));
}

TEST_CASE("pipe blockage: fills the section but for its hole") {
  PipeNetwork straight;
  straight.places = {{0, 0}, {0, 0.1}};
  straight.pipes = {{0, 1}};
  straight.radius = 0.02;
  const decant::BoundingVolumeHierarchy surface(straight.mesh());
  const auto section = decant::pipe_section(surface, Place(0.003, -0.002, 0.05), Place(0.1, 0.1, 1), 0.1);
  REQUIRE(section);
  CHECK(section->area == Approx(straight.bore_area()).epsilon(2e-3));
  CHECK((section->center - Place(0, 0, 0.05)).norm() < 5e-4);
  for (const double opening : {0.0, 0.1, 0.6}) {
    const decant::TriangleMesh mesh = decant::pipe_blockage(*section, opening, 0.006);
    const decant::MeshReport report = decant::inspect(mesh, 0.004);
    CHECK(report.sound());
    CHECK(report.material_volume == Approx((1.05 * 1.05 - opening) * section->area * 0.006).epsilon(1e-3));
    const decant::BoundingVolumeHierarchy blockage(mesh);
    const double hole = std::sqrt(opening) * straight.radius;
    for (const double radius : {0.5 * hole, 0.5 * (hole + straight.radius)}) {
      const bool blocked = blockage.first_hit_along(Place(radius, 0, 0.01), Place(0, 0, 1), 0.08).has_value();
      CHECK(blocked == (radius > hole || opening == 0));
    }
  }
  for (const double flare : {0.3, 1.0}) {
    const double opening = 0.25, mouth = 0.5 + flare * 0.5;
    const decant::TriangleMesh mesh = decant::pipe_blockage(*section, opening, 0.02, flare);
    const decant::MeshReport report = decant::inspect(mesh, 0.004);
    CHECK(report.sound());
    // half of the length is a cylinder, a quarter at each end a frustum of a cone
    const double hole = 0.5 * opening + 0.5 * (opening + 0.5 * mouth + mouth * mouth) / 3;
    CHECK(report.material_volume == Approx((1.05 * 1.05 - hole) * section->area * 0.02).epsilon(1e-3));
    const decant::BoundingVolumeHierarchy blockage(mesh);
    // between hole and mouth the way is free at the ends alone
    const double between = 0.5 * (0.5 + mouth) * straight.radius;
    const auto hit = blockage.first_hit_along(Place(between, 0, 0.01), Place(0, 0, 1), 0.08);
    REQUIRE(hit);
    CHECK((hit->point - Place(between, 0, 0.01)).norm() == Approx(0.0325).epsilon(0.02));
  }
  CHECK_THROWS_WITH(decant::pipe_blockage(*section, 0.5, 0.006, 1.1), decant_test::contains("flare"));
  CHECK_THROWS_WITH(decant::pipe_blockage(*section, 1, 0.006), decant_test::contains("opening"));
  CHECK_THROWS_WITH(decant::pipe_blockage(*section, 0.5, 0), decant_test::contains("length"));
  CHECK_THROWS_WITH(decant::pipe_blockage({}, 0.5, 0.01), decant_test::contains("outline"));
}
