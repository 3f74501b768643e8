// SPDX-License-Identifier: MIT
// What sensors of a recording read, and what a simulation reads in their place.

#include "../../examples/support/recorded_sensors.hpp"

#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include <decant/boundary/shapes.hpp>
#include <decant/simulation/fill.hpp>
#include <decant/simulation/liquid.hpp>
#include <decant/simulation/simulator.hpp>

#include "catch.hpp"

using namespace decant;
using Model = LiquidSimulator;

namespace {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();

/// A box of 10 x 8 cm, 6 cm deep.
const BoxInside box{{0, 0, 0}, {0.1, 0.08, 0.06}, 0.004, Face::PositiveZ};

Recording recording_of_a_box() {
  Recording recording;
  recording.timestamps = {0};
  recording::Body pan;
  pan.name = "pan";
  pan.role = recording::Role::Target;
  pan.mesh = box.mesh();
  recording.bodies = {pan};
  return recording;
}

recording::Channel channel(const std::string& name, recording::Quantity quantity, const Vector3<double>& place,
                           const std::vector<double>& values) {
  recording::Channel result;
  result.name = name;
  result.quantity = quantity;
  result.place = place;
  result.values = values;
  return result;
}

}  // namespace

TEST_CASE("recorded sensors: a simulation reads what the sensors would") {
  using recording::Quantity;
  Recording recording = recording_of_a_box();
  recording.measurements.times = {0, 0.1};
  recording.measurements.channels = {
      channel("target_mass_g", Quantity::TargetMass, {}, {0.2, 0.25}),
      channel("level_mm@50,40", Quantity::Level, {0.05, 0.04, 0}, {0.03, 0.03}),
      channel("level_mm@500,40", Quantity::Level, {0.5, 0.04, 0}, {0.012, 0.01}),
      channel("front_mm", Quantity::Front, {}, {0.1, 0.1}),
      channel("pressure_pa@50,40,2", Quantity::Pressure, {0.05, 0.04, 0.002}, {300, 310}),
      channel("humidity", Quantity::Other, {}, {1, 2}),
      channel("target_mass_g", Quantity::TargetMass, {}, {missing, missing})};
  const auto [sensors, readings] =
      example::recorded_sensors<Model>(recording, {0, 0.1}, example::detail::pour_places(recording), {{"level_mm", 7}});
  REQUIRE(sensors.size() == 5);  // of what is not known, or never read, nothing is compared
  REQUIRE(readings.size() == 5);
  CHECK(readings[0].value(1) == 0.25);
  CHECK(std::isnan(readings[4].value(0)));  // there is no pressure before a step
  CHECK(readings[4].value(1) == 310);
  CHECK(sensors[0].error.deviation == Approx(0.002));
  CHECK(sensors[1].error.deviation == Approx(0.007));
  CHECK(readings[1].error().deviation == Approx(0.007));

  SimulatorSettings settings;
  settings.spacing = 0.006;
  settings.liquid.surface_tension = 0;
  Model model(settings);
  const BodyId pan = model.add_body("pan", box);
  decant::fill(model, pan, FillAmount::fraction(0.5));
  for (int step = 0; step < 30; ++step) {
    REQUIRE(model.step(0.01).advanced());
  }
  CHECK(sensors[0].read(model) == Approx(998 * 0.1 * 0.08 * 0.03).epsilon(0.04));
  CHECK(sensors[1].read(model) == Approx(0.03).margin(0.003));
  CHECK(sensors[2].read(model) == 0.01);  // nothing is there: what it reads at least
  CHECK(sensors[3].read(model) == Approx(0.1).margin(0.003));
  CHECK(sensors[4].read(model) == Approx(998 * 9.81 * 0.028).epsilon(0.15));
}

TEST_CASE("recorded sensors: the top of liquid is told from the body, and by how much it rises") {
  Recording recording = recording_of_a_box();
  recording.measurements.times = {0, 0.1};
  recording.measurements.channels = {channel("top_mm@pan", recording::Quantity::Other, {0, 0, 0}, {0, 4}),
                                     channel("humidity", recording::Quantity::Other, {0, 0, 0}, {1, 2})};
  const auto sensors_of = [&](const std::map<std::string, double>& errors) {
    return example::recorded_sensors<Model>(recording, {0, 0.1}, example::detail::pour_places(recording), errors);
  };
  const auto [sensors, readings] = sensors_of({{"top_mm", 2}});
  REQUIRE(sensors.size() == 1);
  CHECK(sensors[0].from_first);
  CHECK(sensors[0].error.deviation == Approx(0.002));
  CHECK(readings[0].value(1) == Approx(0.004));
  CHECK(example::uncertain_gains(recording) == std::set<std::string>{"top_mm"});

  // turned by a quarter about x and lifted: the body's z is the world's -y, along which gravity is
  SimulatorSettings settings;
  settings.spacing = 0.004;
  settings.gravity = {0, 9.81, 0};
  settings.liquid.surface_tension = 0;
  Model model(settings);
  const Pose turned{Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * std::numbers::pi, Vector3<double>::UnitX())),
                    {0.3, 0.2, 0.5}};
  const BodyId pan = model.add_body("pan", box, PoseTrack(turned));
  decant::fill(model, pan, FillAmount::fraction(0.5));
  for (int step = 0; step < 20; ++step) {
    REQUIRE(model.step(0.01).advanced());
  }
  CHECK(sensors[0].read(model) == Approx(0.03).margin(0.002));

  recording.measurements.channels[0].name = "height_mm@pan";
  const auto height = sensors_of({}).first;
  REQUIRE(height.size() == 1);
  CHECK(!height[0].from_first);
  CHECK(height[0].read(model) == sensors[0].read(model));
  recording.measurements.channels[0].name = "top_mm@cup";
  CHECK_THROWS_WITH(sensors_of({}), decant_test::contains("top_mm@cup: expected the name of a body"));
}

TEST_CASE("recorded sensors: readings are averaged around each frame") {
  const std::vector<double> at{0, 0.04, 0.05, 0.09, 0.1, 0.2, 0.24}, values{1, 2, 4, missing, 6, missing, 9};
  const std::vector<double> seen = example::detail::averaged(at, values, {0, 0.1, 0.2, 0.3});
  CHECK(seen[0] == Approx(1.5));
  CHECK(seen[1] == Approx(5));  // what is half-way belongs to the later one
  CHECK(seen[2] == Approx(9));
  CHECK(std::isnan(seen[3]));
  CHECK(example::detail::averaged({0}, {3}, {0}).size() == 1);
}

TEST_CASE("recorded sensors: errors of channels that there are not are refused") {
  const Recording recording = recording_of_a_box();
  const auto with = [&](const char* name, double error) {
    example::recorded_sensors<Model>(recording, {0}, example::detail::pour_places(recording), {{name, error}});
  };
  CHECK_NOTHROW(with("front_mm", 2));
  CHECK_THROWS_WITH(with("weight", 2), decant_test::contains("'weight': expected one of target_mass_g"));
  CHECK_THROWS_WITH(with("front_mm", 0), decant_test::contains("above 0"));
}
