// SPDX-License-Identifier: MIT
#include <decant/boundary/cavity.hpp>

#include <cmath>
#include <limits>
#include <memory>
#include <numbers>

#include <decant/boundary/mesh_repair.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/io/mesh_file.hpp>

#include "boundary/mesh_samples.hpp"
#include "catch.hpp"
#include "data.hpp"

namespace {

using decant::Cavity;
using decant::Face;
using decant::TriangleMesh;
using Point = decant::Vector3<double>;

using std::numbers::pi;

}  // namespace

TEST_CASE("upright containers hold what their formula says") {
  const double r = 0.049, h = 0.15;
  const Cavity cylinder(decant::CylinderInside{r, h, 0.001, Face::PositiveZ}.mesh());
  REQUIRE_FALSE(cylinder.empty());
  REQUIRE_FALSE(cylinder.closed());
  REQUIRE(cylinder.volume() == Approx(pi * r * r * h).epsilon(3e-3));
  REQUIRE(cylinder.rim_height() == Approx(h).margin(1e-6));
  REQUIRE(cylinder.bottom_height() == Approx(0).margin(1e-9));
  REQUIRE(cylinder.volume_below(0.05) == Approx(pi * r * r * 0.05).epsilon(3e-3));
  REQUIRE(cylinder.volume_below(-1) == 0);
  REQUIRE(cylinder.volume_below(1) == cylinder.volume());
  for (const double share : {0.0, 0.1, 0.5, 0.99, 1.0}) {
    const double level = cylinder.height_of(share * cylinder.volume());
    REQUIRE(level == Approx(share * h).margin(1e-5));
    REQUIRE(cylinder.volume_below(level) == Approx(share * cylinder.volume()).margin(1e-12));
  }
  // walls along the axes, so thin that a column rarely meets one
  const Cavity box(decant::BoxInside{Point(0, 0, 0), Point(3.2, 1, 1), 0.002, Face::PositiveZ}.mesh());
  REQUIRE(box.volume() == Approx(3.2).epsilon(2e-3));
  REQUIRE(box.rim_height() == Approx(1).margin(1e-6));
  const Cavity cup(decant::Cup{}.mesh());
  REQUIRE(cup.volume() == Approx(decant::Cup{}.volume()).epsilon(4e-3));
  const Cavity bowl(decant::Bowl{}.mesh());
  REQUIRE(bowl.volume() == Approx(decant::Bowl{}.volume()).epsilon(4e-3));
  REQUIRE(bowl.rim_height() == Approx(decant::Bowl{}.depth).margin(1e-6));
}

TEST_CASE("a tilted cylinder holds what is below its lowest rim") {
  const double r = 0.049, h = 0.15;
  const TriangleMesh mesh = decant::CylinderInside{r, h, 0.002, Face::PositiveZ}.mesh();
  const auto surface = std::make_shared<const decant::BoundingVolumeHierarchy>(mesh);
  for (const double tilt : {0.1, 0.5, 0.9}) {
    for (const double turn : {0.0, 2.0}) {
      const Point up = 3 * Point(std::sin(tilt) * std::cos(turn), std::sin(tilt) * std::sin(turn), std::cos(tilt));
      const Cavity cavity(surface, up);
      REQUIRE(cavity.up().norm() == Approx(1));
      REQUIRE(cavity.volume() == Approx(pi * r * r * (h - r * std::tan(tilt))).epsilon(5e-3));
      // the rim's inner edge is what liquid runs over; the outer edge is higher on that side
      REQUIRE(cavity.rim_height() == Approx(h * std::cos(tilt) - r * std::sin(tilt)).margin(2e-4));
    }
  }
  REQUIRE(Cavity(surface, -Point::UnitZ()).volume() < 1e-9);
}

TEST_CASE(
    "what a tilted container holds upright is known by its frame's axes, or as it stands if its frame is another") {
  const double r = 0.032, h = 0.10, all = pi * r * r * h;
  const TriangleMesh along_z = decant::CylinderInside{r, h, 0.003, Face::PositiveZ}.mesh();
  const auto held = [](const TriangleMesh& mesh, const Point& up_now) {
    return decant::upright_cavity(std::make_shared<const decant::BoundingVolumeHierarchy>(mesh), up_now);
  };
  const Point tilted(std::sin(0.6), 0, std::cos(0.6));  // holds four fifths so
  CHECK(held(along_z, tilted).volume() == Approx(all).epsilon(3e-3));
  CHECK(held(along_z, tilted).up().isApprox(Point::UnitZ()));
  TriangleMesh along_y = along_z, askew = along_z;
  for (std::size_t k = 0; k < along_z.vertices.size(); ++k) {
    const Point& x = along_z.vertices[k];
    along_y.vertices[k] = Point(x.y(), x.z(), x.x());
    askew.vertices[k] = Eigen::AngleAxisd(0.6, Point::UnitY()) * x;
  }
  CHECK(held(along_y, Point(0, std::cos(0.6), std::sin(0.6))).volume() == Approx(all).epsilon(3e-3));
  CHECK(held(askew, tilted).volume() == Approx(all).epsilon(3e-3));
  CHECK(held(decant::Sphere{}.mesh(), tilted).empty());
}

TEST_CASE("closed vessels are cavities as a whole and solids are none") {
  const double r = 0.05, h = 0.1;
  for (const Point& up : {Point(0, 0, 1), Point(0.3, 0.2, -0.5)}) {
    const Cavity closed(decant::CylinderInside{r, h, 0.002, {}}.mesh(), up);
    REQUIRE(closed.closed());
    REQUIRE(closed.volume() == Approx(pi * r * r * h).epsilon(5e-3));
    REQUIRE(closed.contains(Point(0, 0, 0.05)));
    REQUIRE(closed.contains(Point(0, 0, 0.0995)));
    REQUIRE_FALSE(closed.contains(Point(0, 0, -0.001)));
    REQUIRE_FALSE(closed.contains(Point(0, 0, 0.101)));
  }
  const Cavity solid(decant::Sphere{}.mesh());
  REQUIRE(solid.empty());
  REQUIRE(solid.volume() == 0);
  REQUIRE_FALSE(solid.contains(Point(0, 0, 0)));
  REQUIRE(solid.height_of(0) == 0);
}

TEST_CASE("a gap in a wall is where liquid runs out") {
  // five slabs that overlap; one wall ends at 60 mm
  TriangleMesh mesh = decant::Box{Point(-0.01, -0.01, -0.01), Point(0.21, 0.11, 0)}.mesh();
  mesh = decant::joined(mesh, decant::Box{Point(-0.01, -0.01, -0.005), Point(0, 0.11, 0.1)}.mesh());
  mesh = decant::joined(mesh, decant::Box{Point(0.2, -0.01, -0.005), Point(0.21, 0.11, 0.06)}.mesh());
  mesh = decant::joined(mesh, decant::Box{Point(-0.01, -0.01, -0.005), Point(0.21, 0, 0.1)}.mesh());
  mesh = decant::joined(mesh, decant::Box{Point(-0.01, 0.1, -0.005), Point(0.21, 0.11, 0.1)}.mesh());
  const Cavity cavity(mesh);
  REQUIRE(cavity.rim_height() == Approx(0.06).margin(1e-5));
  REQUIRE(cavity.volume() == Approx(0.2 * 0.1 * 0.06).epsilon(5e-3));
  REQUIRE_FALSE(cavity.contains(Point(0.1, 0.05, 0.065)));
  // a divider with 40 mm leaves one body of liquid above it
  const Cavity divided(decant::joined(mesh, decant::Box{Point(0.1, -0.01, -0.005), Point(0.11, 0.11, 0.04)}.mesh()));
  REQUIRE(divided.volume() == Approx(0.2 * 0.1 * 0.06 - 0.01 * 0.1 * 0.04).epsilon(5e-3));
  REQUIRE(divided.contains(Point(0.05, 0.05, 0.01)));
  REQUIRE(divided.contains(Point(0.15, 0.05, 0.01)));
  REQUIRE_FALSE(divided.contains(Point(0.105, 0.05, 0.01)));
  // one of 100 mm parts it: the smaller side is left out, the larger one reaches up to 100 mm
  const Cavity parted(decant::joined(mesh, decant::Box{Point(0.15, -0.01, -0.005), Point(0.16, 0.11, 0.1)}.mesh()));
  REQUIRE(parted.volume() == Approx(0.15 * 0.1 * 0.1).epsilon(5e-3));
  REQUIRE_FALSE(parted.contains(Point(0.18, 0.05, 0.01)));
}

TEST_CASE("inside is told from outside across a thin wall") {
  const double r = 0.04, h = 0.08, wall = 0.0005;
  const decant::CylinderInside shape{r, h, wall, Face::PositiveZ};
  const TriangleMesh mesh = shape.mesh();
  std::mt19937 random(5);
  for (const double width : {std::numeric_limits<double>::infinity(), 0.0002}) {
    const Cavity cavity(mesh, Point::UnitZ(), width);
    int wrong = 0;
    int inside = 0;
    for (int n = 0; n < 20000; ++n) {
      Point x = decant_test::random_point(random, Point(0, 0, h / 2), 0.05);
      if (n % 2 == 0) {
        x.head<2>() *= (r + (n % 4 == 0 ? 1 : -1) * 0.0004) / x.head<2>().norm();  // close to the wall, on either side
      }
      // the polygon of the wall is 0.03 mm off the circle
      const double from_axis = x.head<2>().norm();
      if (std::abs(from_axis - r) < 5e-5 || std::abs(x[2] - h) < 1e-5 || std::abs(x[2]) < 1e-5) {
        continue;
      }
      const bool expected = from_axis < r && x[2] > 0 && x[2] < h;
      wrong += cavity.contains(x) == expected ? 0 : 1;
      inside += expected ? 1 : 0;
    }
    REQUIRE(inside > 4000);
    REQUIRE(wrong == 0);
    for (const double bad :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e300}) {
      REQUIRE_FALSE(cavity.contains(Point(bad, 0, 0.04)));
      REQUIRE_FALSE(cavity.contains(Point(0, 0, bad)));
    }
  }
}

TEST_CASE("cavity settings out of range are refused in words") {
  using decant_test::contains;
  const TriangleMesh mesh = decant::Cup{}.mesh();
  REQUIRE_THROWS_WITH(Cavity(std::shared_ptr<const decant::BoundingVolumeHierarchy>()), contains("Cavity: surface"));
  REQUIRE_THROWS_WITH(Cavity(mesh, Point::Zero()), contains("Cavity: length of up must be > 0"));
  REQUIRE_THROWS_WITH(Cavity(mesh, Point::UnitZ(), 0), contains("Cavity: width [m] of a column must be > 0"));
  const Cavity cavity(mesh);
  REQUIRE_THROWS_WITH(cavity.height_of(1), contains("Cavity: volume [m^3] to fill in"));
  REQUIRE_THROWS_WITH(cavity.height_of(-1e-6), contains("Cavity: volume [m^3] to fill in"));
}

TEST_CASE("scanned containers hold what was counted in voxels") {
  struct Case {
    const char* file;
    double below_top_mm[3];
    double volume_ml[3];
  };
  // of the data's README files, which say about 1 percent
  const Case cases[] = {{"meshes_contactdb/cup.stl", {0.5, 5, 20}, {338.7, 317.5, 250.1}},
                        {"meshes_contactdb/bowl.stl", {0.5, 5, 20}, {605.1, 532.8, 310.8}},
                        {"meshes_ycb/024_bowl.obj", {2, 5, 20}, {656, 605, 368}},
                        {"meshes_ycb/025_mug.obj", {0.5, 5, 20}, {286, 263, 188}}};
  for (const Case& scan : cases) {
    const auto path = decant_test::measurements(scan.file);
    if (!path) {
      continue;
    }
    const TriangleMesh mesh = decant::repaired(decant::read_mesh(*path), 0.004);
    const Cavity cavity(mesh);
    const double top = decant::bounds(mesh).max()[2];
    for (int k = 0; k < 3; ++k) {
      INFO(scan.file << " at " << scan.below_top_mm[k] << " mm");
      REQUIRE(1e6 * cavity.volume_below(top - 1e-3 * scan.below_top_mm[k]) == Approx(scan.volume_ml[k]).epsilon(0.015));
    }
  }
}
