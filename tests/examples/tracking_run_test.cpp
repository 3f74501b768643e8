// SPDX-License-Identifier: MIT
// How a model starts as a recording says.

#include "../../examples/support/tracking_run.hpp"

#include <cmath>
#include <numbers>
#include <optional>

#include <decant/boundary/shapes.hpp>
#include <decant/io/mesh_file.hpp>

#include "catch.hpp"
#include "data.hpp"

using namespace example;

TEST_CASE("tracking run: more than a container holds is a full one, by volume as by fraction") {
  decant::Recording recording;
  recording.timestamps = {0};
  decant::recording::Body mug;
  mug.name = "mug";
  mug.role = decant::recording::Role::Source;
  mug.mesh = decant::read_mesh(decant_test::repository("examples/scenes/mug.ply"));  // holds 445 ml
  mug.motion = decant::PoseTrack();
  recording.bodies = {mug};
  TrackingOptions options;
  options.spacing = 0.013;  // 2.2 ml each, so amounts are within a few particles
  const auto millilitres = [&](std::optional<double> fraction, std::optional<double> volume, double factor) {
    recording.liquid.initial = decant::recording::Initial{0, fraction, volume};
    options.initial_amount_factor = factor;
    auto model = model_of<TrackingParts>(recording, options);
    return 1e6 * model.fluid().mass.template cast<double>().sum() / recording.liquid.density;
  };
  const double full = millilitres(1.0, {}, 1);
  CHECK(full == Approx(445).margin(15));
  CHECK(millilitres(0.9, {}, 2) == Approx(full));
  CHECK(millilitres({}, 400e-6, 2) == Approx(full));
  CHECK(millilitres({}, 300e-6, 1.1) == Approx(330).margin(10));
  CHECK(millilitres({}, 400e-6, 0.5) == Approx(200).margin(10));
  // a recording that is wrong says so
  CHECK_THROWS_WITH(millilitres({}, 600e-6, 1), decant_test::contains("what it holds"));
  CHECK_THROWS_WITH(millilitres({}, 600e-6, 1.2), decant_test::contains("what it holds"));
}

TEST_CASE(
    "tracking run: a fraction is of what a container holds upright, and a tilted one begins with no more than fits") {
  decant::Recording recording;
  recording.timestamps = {0};
  decant::recording::Body cup;
  cup.name = "cup";
  cup.role = decant::recording::Role::Source;
  const double r = 0.032, h = 0.10;  // [m]: 322 ml, and 250 ml where it leans by 35 degrees
  cup.mesh = decant::CylinderInside{r, h, 0.003, decant::Face::PositiveZ}.mesh();
  const double lean = 35 * std::numbers::pi / 180;
  cup.motion = decant::PoseTrack(
      decant::Pose{Eigen::Quaterniond(Eigen::AngleAxisd(lean, Eigen::Vector3d::UnitY())), {0, 0, 0.2}});
  recording.bodies = {cup};
  TrackingOptions options;
  options.spacing = 0.009;
  const auto millilitres = [&](double fraction) {
    recording.liquid.initial = decant::recording::Initial{0, fraction, {}};
    auto model = model_of<TrackingParts>(recording, options);
    return 1e6 * model.fluid().mass.template cast<double>().sum() / recording.liquid.density;
  };
  CHECK(millilitres(0.6) == Approx(0.6 * 321.7).margin(2));
  CHECK(millilitres(0.95) == Approx(1e6 * std::numbers::pi * r * r * (h - r * std::tan(lean))).margin(3));
}
