// SPDX-License-Identifier: MIT
// Scenes of which something was measured, as models that can be given effects.

#include "../../examples/support/scene_interaction.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include <decant/discovery/effect.hpp>
#include <decant/discovery/forward_model.hpp>

#include "../io/temporary_folder.hpp"
#include "catch.hpp"

using namespace decant;

namespace {

/// A box of 160 x 48 mm with liquid 96 mm deep in its first 64 mm, or all over, and what was read of it.
std::string scene_text(double column_m, const std::string& more = "") {
  return R"({"format": "decant-scene", "version": 1, "name": "tank", "spacing_m": 0.016, "end_s": 0.3,
    "gauges": ["level_mm@0.032,0.024"],
    "bodies": [{"name": "tank", "shape": {"box_inside": {"min_m": [0, 0, 0], "max_m": [0.16, 0.048, 0.3]}, "open": "+z"}}],
    "fluid": [{"box": {"min_m": [0, 0, 0], "max_m": [)" +
         std::to_string(column_m) + R"(, 0.048, 0.096]}}])" + more + "}";
}

constexpr const char* read_of_it =
    "t_s,front_mm,level_mm@0.032,0.024\n-0.1,64,96\n0.05,70,95\n0.1,100,90\n0.15,140,\n0.5,1,1\n";

example::RecordedInteraction interaction(const std::string& name, const std::string& scene,
                                         example::InteractionOptions options = {}) {
  const decant_test::TemporaryFolder folder("scene_interaction_" + name);
  folder.write("scene.json", scene);
  folder.write("measurements.csv", read_of_it);
  options.model.spacing = 0.016;
  options.frames_per_second = 20;
  return example::interaction_of(example::read_interaction_source(folder.path()), options);
}

/// A run with one effect.
std::vector<double> readings(const example::RecordedInteraction& of, std::size_t sensor, const std::string& effect,
                             double strength) {
  const auto& effects = of.model.effects();
  ModelRun run{{}, 1, false};
  for (std::size_t k = 0; k < effects.size() && !effect.empty(); ++k) {
    if (effects[k].name == effect) {
      AppliedEffect applied{k, effects[k].base()};
      applied.strength[0] = strength;
      run.effects.push_back(std::move(applied));
    }
  }
  REQUIRE(run.effects.size() == (effect.empty() ? 0U : 1U));
  const Observation seen = of.model.predict(run);
  std::vector<double> values;
  for (std::size_t k = 0; k < seen.readings.at(sensor).size(); ++k) {
    values.push_back(seen.readings[sensor].value(k));
  }
  return values;
}

}  // namespace

TEST_CASE("measured scene: what was measured while it lasts is compared, from its beginning on") {
  const example::RecordedInteraction of = interaction("times", scene_text(0.064));
  CHECK(of.recording.timestamps == std::vector<double>{0, 0.05, 0.1, 0.15});
  REQUIRE(of.seen.readings.size() == 2);
  CHECK(std::isnan(of.seen.readings[0].value(0)));  // nobody read anything then
  CHECK(of.seen.readings[0].value(1) == Approx(0.070));
  CHECK(of.seen.readings[1].value(2) == Approx(0.090));
  CHECK(std::isnan(of.seen.readings[1].value(3)));
  CHECK(of.cameras.empty());
  for (const Effect& effect : of.model.effects()) {
    CHECK(effect.name != "camera_shift");  // there is none that could have moved
  }
}

TEST_CASE("measured scene: liquid at rest stands as high as it was put, and higher where there is more") {
  const example::RecordedInteraction of = interaction("rest", scene_text(0.16));
  CHECK(readings(of, 1, "", 0).back() == Approx(0.096).margin(0.004));
  CHECK(readings(of, 1, "fill", 1.25).back() == Approx(0.120).margin(0.004));
}

TEST_CASE("measured scene: all that begins later is what there was before") {
  const example::RecordedInteraction of = interaction("late", scene_text(0.064));
  const std::vector<double> usual = readings(of, 0, "", 0), late = readings(of, 0, "latency", 0.05);
  REQUIRE(usual.size() == 4);
  CHECK(usual[0] < 0.07);
  CHECK(usual[3] > 0.1);
  CHECK(late[0] == usual[0]);
  for (std::size_t k = 1; k < usual.size(); ++k) {
    CHECK(late[k] == usual[k - 1]);
  }
}

TEST_CASE("measured scene: a container that is filled is poured from where there is another one") {
  const std::string cup =
      R"({"name": "cup", "shape": {"cylinder_inside": {"radius_m": 0.03, "height_m": 0.08}, "open": "+z"},
                              "pose": {"position_m": [0.0, 0.0, 0.2], "quaternion_wxyz": [1, 0, 0, 0]}})";
  const std::string pan =
      R"({"name": "pan", "shape": {"cylinder_inside": {"radius_m": 0.1, "height_m": 0.05}, "open": "+z"}})";
  const auto scene = [](const std::string& bodies) {
    return R"({"format": "decant-scene", "version": 1, "name": "pour", "spacing_m": 0.008, "end_s": 0.3, "bodies": [)" +
           bodies + R"(], "fluid": [{"fill": {"body": "cup", "level_m": 0.05}}]})";
  };
  const example::RecordedInteraction both = interaction("both", scene(cup + "," + pan));
  REQUIRE(both.recording.bodies.size() == 2);
  CHECK(both.recording.bodies[0].role == recording::Role::Source);
  CHECK(both.recording.bodies[1].role == recording::Role::Target);
  CHECK_FALSE(interaction("alone", scene(cup)).recording.bodies[0].role.has_value());
  // the level's volume, as much more, and no more than there is room for
  const auto volume = [&](double amount) {
    SimulatorSettings solver;
    solver.spacing = 0.008;
    auto model = both.model.scene().start(solver, amount);
    return model.fluid().mass.cast<double>().sum() / 998;
  };
  const double level = std::acos(-1) * 0.03 * 0.03 * 0.05;  // [m^3]
  CHECK(volume(1) == Approx(level).epsilon(0.03));
  CHECK(volume(1.25) == Approx(1.25 * level).epsilon(0.03));
}

TEST_CASE("measured scene: effects of another container are known by the words of the first recording") {
  const auto scene = [](const std::string& container, const std::string& below) {
    return R"({"format": "decant-scene", "version": 1, "name": "pour", "spacing_m": 0.008, "end_s": 0.3, "bodies": [
        {"name": ")" +
           below + R"(", "shape": {"cylinder_inside": {"radius_m": 0.1, "height_m": 0.05}, "open": "+z"}},
        {"name": ")" +
           container + R"(", "shape": {"cylinder_inside": {"radius_m": 0.03, "height_m": 0.08}, "open": "+z"},
         "pose": {"position_m": [0.0, 0.0, 0.2], "quaternion_wxyz": [1, 0, 0, 0]}}],
        "fluid": [{"fill": {"body": ")" +
           container + R"(", "level_m": 0.05}}]})";
  };
  const auto words = [](const example::RecordedInteraction& of) {
    std::vector<std::string> result;
    for (const Effect& effect : of.model.effects()) {
      result.push_back(effect.words());
    }
    return result;
  };
  const example::RecordedInteraction first = interaction("first", scene("cup", "pan"));
  const std::vector<std::string> known = words(first);
  CHECK(std::count(known.begin(), known.end(), "obstacle, mouth of the cup") == 1);
  example::InteractionOptions as_first;
  as_first.names = example::names_by_role(first.recording);
  CHECK(words(interaction("other", scene("beaker", "bowl"), as_first)) == known);
  CHECK(words(interaction("alone", scene("beaker", "bowl"))) != known);
}

TEST_CASE("measured scene: a tolerance for what another recording can have is no mistake, a misspelt one is") {
  example::InteractionOptions options;
  const auto names = [&] {
    const example::RecordedInteraction alone = interaction("alone", scene_text(0.064), options);
    std::vector<std::string> result;
    for (const Effect& effect : alone.model.effects()) {
      result.push_back(effect.name);
    }
    return result;
  };
  const std::vector<std::string> known = names();
  REQUIRE(std::count(known.begin(), known.end(), "obstacle") == 0);  // nothing is poured
  options.tolerances = {{"obstacle", 0.002}};
  CHECK_THROWS_WITH(names(), decant_test::contains("tolerance of 'obstacle': expected an effect"));
  options.elsewhere = {"obstacle"};
  CHECK(names() == known);
  options.without = {"obstacle", "gravty"};
  CHECK_THROWS_WITH(names(), decant_test::contains("without 'gravty': expected an effect"));
}

TEST_CASE("measured scene: what cannot be one is refused") {
  const decant_test::TemporaryFolder folder("scene_interaction_refuses");
  folder.write("scene.json", scene_text(0.064, R"(, "composition": "paper")"));
  folder.write("measurements.csv", read_of_it);
  CHECK_THROWS_WITH(example::read_measured_scene(folder.path()),
                    decant_test::contains("composition: expected default"));
  folder.write("scene.json", scene_text(0.064));
  folder.write("measurements.csv", "t_s,front_mm\n0.4,1\n");
  CHECK_THROWS_WITH(example::read_measured_scene(folder.path()),
                    decant_test::contains("measurements.csv: expected times"));
}
