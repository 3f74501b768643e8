// SPDX-License-Identifier: MIT
// What the workflow for missing effects says to people and to scripts.

#include "../../examples/support/missing_effect_output.hpp"

#include <string>
#include <vector>

#include <Eigen/Core>

#include <decant/core/types.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/missing_effect_result.hpp>

#include "catch.hpp"

using namespace decant;

namespace {

/// Drag, a hole, a hole where recordings begin to disagree, and a table.
std::vector<Effect> drag_holes_table() {
  std::vector<Effect> effects{plain_effect("drag_linear", "drag", "1/s", "air slows it", {"", 0, 0, 4}, "drag = @;")};
  Effect hole = plain_effect("leak", "", "ml/s", "it leaks", {"", 0, 0, 40}, "hole({#}, @ ml/s, ^ m/s);");
  hole.where = "wall of the cup";
  hole.place = Vector3<double>(0.03, 0, 0.02);
  hole.fastest = 1.2;
  effects.push_back(hole);
  Effect table = plain_effect("table", "", "", "what misses lies on a table", {"", 0, 0, 1});
  table.kind = EffectKind::Surroundings;
  effects.push_back(table);
  hole.where = "where recordings begin to disagree";
  effects.push_back(hole);
  return effects;
}

MissingEffect leak_found() {
  MissingEffect result;
  result.verdict = Verdict::Named;
  RefinedEffect leak;
  leak.effect = 1;
  leak.judged = 3;
  leak.strength = Eigen::VectorXd::Constant(1, 25);
  leak.deviation = Eigen::VectorXd::Constant(1, 2);
  leak.place = Vector3<double>(0.02, -0.025, 0.015);
  leak.speed = 0.32;
  result.found = {leak};
  result.refined = {leak};
  result.surroundings = {{2, Eigen::VectorXd::Constant(1, 1)}};
  result.learn = {20, 4, 2, 0.2, 9};
  result.judgement.chance.largest_distance = 5;
  result.confirmation = Confirmation::Confirmed;
  return result;
}

}  // namespace

TEST_CASE("missing effect output: a jet's place and speed are told, and what was taken to be around") {
  const std::vector<Effect> effects = drag_holes_table();
  const MissingEffect result = leak_found();
  const std::string sentence = example::missing_effect_sentence(effects, result);
  CHECK_THAT(sentence, decant_test::contains("leak, where recordings begin to disagree 25 ml/s at 0.32 m/s"));
  CHECK_THAT(sentence, decant_test::contains("falls by 89 %"));  // (20 - 4) / (20 - 2)
  CHECK_THAT(example::surroundings_sentence(effects, result), decant_test::contains("what misses lies on a table"));
  CHECK(example::surroundings_sentence(effects, MissingEffect{}).empty());
  CHECK(example::detail::effect_code(effects, result.found.front()) ==
        "hole({0.02, -0.025, 0.015}, 25 ml/s, 0.32 m/s);");

  const nlohmann::json json = example::missing_effect_json(effects, result, {0, 0, -9.81});
  CHECK(json["verdict"] == "named");
  CHECK(json["effect"] == nlohmann::json({"leak"}));
  CHECK(json["strength"] == 25);
  CHECK(json["place"] == nlohmann::json({0.02, -0.025, 0.015}));
  CHECK(json["found"][0]["speed_m_s"] == 0.32);
  CHECK(json["interval_90"][0].get<double>() == Approx(25 - 3.29));
  CHECK(json["surroundings"] == nlohmann::json({"table"}));
  CHECK(json["confirmed"] == true);
  CHECK(json["gap"]["before"] == 20);
  CHECK(json["gap"]["largest_by_chance"] == 5);
  CHECK(json["gap"]["held_out_before"].is_null());
  CHECK(example::missing_effect_json(effects, {}, {0, 0, -9.81})["surroundings"] == nlohmann::json::array());
}

TEST_CASE("missing effect output: of what explains too little that is the nearest which explains most") {
  const std::vector<Effect> effects = drag_holes_table();
  MissingEffect result = leak_found();
  result.verdict = Verdict::Unexplained;
  result.found.clear();
  RefinedEffect drag;
  drag.strength = Eigen::VectorXd::Constant(1, 2);
  drag.deviation = Eigen::VectorXd::Constant(1, 0.1);
  drag.probability = 0.9;
  drag.distance = 18;
  drag.share = 0.1;
  result.refined.front().probability = 0.1;
  result.refined.front().distance = 14;
  result.refined.front().share = 0.33;
  result.refined.insert(result.refined.begin(), drag);
  CHECK_THAT(example::missing_effect_sentence(effects, result),
             decant_test::contains("nearest is leak, where recordings begin to disagree 25 ml/s at 0.32 m/s, which "
                                   "explains 33 %"));
  CHECK(example::missing_effect_json(effects, result, {0, 0, -9.81})["nearest"] == "leak");
  CHECK(example::missing_effect_json(effects, leak_found(), {0, 0, -9.81})["nearest"].is_null());
}

TEST_CASE("missing effect output: what references taught is told, or that there are none") {
  MissingEffect result;
  CHECK_THAT(example::references_sentence(0, result), decant_test::contains("There are no references"));
  CHECK_THAT(example::references_sentence(1, result), decant_test::contains("1 reference: how far"));
  CHECK_THAT(example::references_sentence(1, result), !decant_test::contains("taken off first"));
  result.lessons = 3;
  CHECK_THAT(example::references_sentence(3, result), decant_test::contains("for that was taken off first"));
  const nlohmann::json json = example::missing_effect_json({}, result, {0, 0, -9.81});
  CHECK(json["lessons"] == 3);
  CHECK(json["taught_by"] == 0);
  result.taught_by = 2;
  CHECK_THAT(example::references_sentence(3, result), decant_test::contains("2 of 3 references look like"));
}
