// SPDX-License-Identifier: MIT
// The scenes that come with the library: each is read, and what they say is what was meant.

#include <decant/io/scene.hpp>

#include <decant/boundary/cavity.hpp>
#include <decant/boundary/mesh_report.hpp>
#include <decant/io/mesh_file.hpp>
#include <decant/io/motion_file.hpp>
#include <decant/io/series_file.hpp>

#include <filesystem>
#include <string>

#include "catch.hpp"
#include "data.hpp"

TEST_CASE("example scenes: all of them are read") {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(decant_test::repository("examples/scenes"))) {
    if (entry.path().extension() == ".json") {
      INFO(entry.path());
      const decant::Scene scene = decant::read_scene(entry.path());
      CHECK(scene.name == entry.path().stem().string());
      CHECK_FALSE(scene.bodies.empty());
      CHECK_FALSE(scene.fluid.empty());
      ++count;
    }
  }
  CHECK(count >= 9);
}

TEST_CASE("example scenes: the workloads have the particles and the room they are defined by") {
  for (const auto& [name, n] : {std::pair{"w1", 20}, std::pair{"w2", 40}, std::pair{"w3", 80}}) {
    INFO(name);
    const auto scene =
        decant::read_scene(decant_test::repository("examples/scenes") / (std::string("performance_") + name + ".json"));
    const double d = scene.spacing;
    CHECK(d == 0.005);
    const auto& liquid = std::get<decant::scene::Box>(scene.fluid.at(0));
    const auto& room = std::get<decant::scene::BoxInside>(scene.bodies.at(0).shape);
    // centres at d, 2 d ... n d; closed box of 3 n x 2 n x (n + 1) spacings
    CHECK((liquid.min - decant::Vector3<double>::Constant(0.5 * d)).norm() < 1e-12);
    CHECK((liquid.max - decant::Vector3<double>::Constant((n + 0.5) * d)).norm() < 1e-12);
    CHECK((room.inner.max - d * decant::Vector3<double>(3 * n, 2 * n, n + 1)).norm() < 1e-12);
    CHECK_FALSE(room.open.has_value());
    CHECK(scene.gravity == decant::Vector3<double>(0, -9.81, 0));
    CHECK(scene.liquid.viscosity / scene.liquid.density == Approx(1e-6));
  }
}

TEST_CASE("example scenes: the sloshing tank moves as in the experiment") {
  const auto scene = decant::read_scene(decant_test::repository("examples/scenes/sloshing_faltinsen.json"));
  const auto& motion = scene.bodies.at(0).motion;
  for (const double t : {0.0, 0.3, 1.0, 7.7}) {
    INFO(t);
    CHECK(motion.at(t).translation.x() == Approx(0.032 * std::cos(2 * 3.14159265358979 * t / 1.3)).margin(1e-5));
  }
}

TEST_CASE("example scenes: the mug is sound and holds four tenths of a litre") {
  const auto mesh = decant::read_mesh(decant_test::repository("examples/scenes/mug.ply"));
  const auto report = decant::inspect(mesh, 0.004);
  CHECK(report.sound());
  CHECK(report.refusals.empty());
  CHECK(report.thinnest_wall > 0.002);
  const decant::Cavity cavity(mesh);
  CHECK_FALSE(cavity.closed());
  // a cylinder of radius 40 mm and height 90 mm holds 452 ml; the rounded foot takes some of it
  CHECK(1e6 * cavity.volume() == Approx(445).margin(5));
}

TEST_CASE("example data: the motions that come with the library are read") {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(decant_test::repository("examples/data"))) {
    const std::string name = entry.path().filename().string();
    INFO(name);
    if (name.rfind("pose_", 0) == 0) {
      CHECK(decant::read_motion(entry.path()).end_time() > 3);
      const auto heights = decant::read_series(entry.path().parent_path() / ("height_" + name.substr(5)));
      CHECK(heights.find("height_mm") != nullptr);
      CHECK(heights.rows() > 1000);
      ++count;
    }
  }
  CHECK(count == 3);
}
