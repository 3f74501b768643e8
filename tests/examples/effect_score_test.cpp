// SPDX-License-Identifier: MIT
// How answers about hidden effects are scored and counted, against counts and shares worked out by hand.

#include "../../examples/support/effect_score.hpp"

#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "../../examples/support/effect_tables.hpp"
#include "catch.hpp"

using namespace example;
using Json = nlohmann::json;

namespace {

/// What is hidden, its family and its role.
Json truth_of(const std::string& effect, const std::string& family, const std::string& role = "effect") {
  return {{"effect", effect}, {"family", family}, {"role", role}};
}

/// An answer as missing_effect_json has it, with the truth beside it.
Json answer(Json truth, const std::string& verdict, const std::vector<std::string>& effects) {
  return {{"truth", std::move(truth)}, {"verdict", verdict},    {"effect", effects},
          {"confirmed", nullptr},      {"gap", Json::object()}, {"settings", {{"model_spacing_mm", 5.0}}}};
}

EffectScore score_of(const Json& result, const std::string& kind = "moderate") {
  return {"report_" + kind + "_000", kind, 4, &result};
}

AnswerScore scored(const Json& truth, const std::string& verdict, const std::vector<std::string>& effects = {}) {
  const Json result = answer(truth, verdict, effects);
  return score_of(result).score();
}

/// What is hidden is named, with a strength and an interval of 90 %.
Json named(Json truth, double strength, double low, double high) {
  Json result = answer(truth, "named", {truth.at("effect")});
  result["strength"] = strength;
  result["interval_90"] = {low, high};
  return result;
}

std::vector<EffectScore> scores_of(const std::vector<Json>& results) {
  std::vector<EffectScore> scores;
  for (const Json& each : results) {
    scores.push_back(score_of(each));
  }
  return scores;
}

}  // namespace

TEST_CASE("An answer is right, wrong, half of it, one of several, missed or none, by what is hidden",
          "[examples][effect_score]") {
  const Json leak = truth_of("leak", "leak"), drag = truth_of("drag_quadratic", "drag");
  CHECK(scored(leak, "named", {"leak"}) == AnswerScore::Right);
  CHECK(scored(drag, "named", {"drag_linear"}) == AnswerScore::Right);  // one family
  CHECK(scored(leak, "named", {"suction"}) == AnswerScore::Wrong);
  CHECK(scored(leak, "named", {"leak", "suction"}) == AnswerScore::Wrong);
  CHECK(scored(leak, "one_of", {"suction", "leak"}) == AnswerScore::OneOf);
  CHECK(scored(leak, "one_of", {"suction", "fill"}) == AnswerScore::Wrong);
  CHECK(scored(leak, "nothing") == AnswerScore::Missed);
  CHECK(scored(leak, "unexplained") == AnswerScore::Abstains);

  const Json stirrer = truth_of("stirrer", "stirrer", "outside");
  CHECK(scored(stirrer, "unexplained") == AnswerScore::Right);
  CHECK(scored(stirrer, "nothing") == AnswerScore::Missed);
  CHECK(scored(stirrer, "named", {"obstacle"}) == AnswerScore::Wrong);

  const Json nothing = truth_of("nothing", "nothing", "nothing");
  CHECK(scored(nothing, "nothing") == AnswerScore::Right);
  CHECK(scored(nothing, "unexplained") == AnswerScore::Abstains);
  CHECK(scored(nothing, "named", {"leak"}) == AnswerScore::Wrong);

  const Json late = truth_of("latency", "latency", "measurement");
  CHECK(scored(late, "named", {"latency"}) == AnswerScore::Right);
  CHECK(scored(late, "nothing") == AnswerScore::Right);  // taken account of
  CHECK(scored(late, "named", {"body_pose"}) == AnswerScore::Wrong);

  Json two = truth_of("leak", "leak", "two");
  two["second"] = truth_of("viscosity", "viscosity");
  CHECK(scored(two, "named", {"shear_thinning", "leak"}) == AnswerScore::Right);
  CHECK(scored(two, "named", {"viscosity"}) == AnswerScore::Half);
  CHECK(scored(two, "named", {"viscosity", "fill"}) == AnswerScore::Wrong);
}

TEST_CASE("Physics is blamed by naming what is no error of measurement", "[examples][effect_score]") {
  const auto blames = [](const std::string& verdict, const std::vector<std::string>& effects) {
    const Json result = answer(truth_of("latency", "latency", "measurement"), verdict, effects);
    return score_of(result).blames_physics();
  };
  CHECK(blames("named", {"gravity"}));
  CHECK(blames("one_of", {"latency", "gravity"}));
  CHECK_FALSE(blames("named", {"body_pose"}));
  CHECK_FALSE(blames("named", {"camera_roll"}));
  CHECK_FALSE(blames("unexplained", {}));
}

TEST_CASE("Strengths are compared in the catalogue's units, and walls' at the model's spacing",
          "[examples][effect_score]") {
  const auto ratio = [](const char* effect, double hidden, double found, double spacing_mm = 5) {
    Json truth = truth_of(effect, effect);
    truth["strength"] = hidden;
    truth["unit"] = "";
    Json result = named(truth, found, found - 1e-6, found + 1e-6);
    result["settings"]["model_spacing_mm"] = spacing_mm;
    return score_of(result).strength_ratio();
  };
  CHECK(ratio("leak", 20, 22) == Approx(1.1));
  CHECK(ratio("gravity", -0.1, 9.81 * 0.9) == Approx(1));
  CHECK(ratio("fill", 0.1, 1.1) == Approx(1));
  CHECK(ratio("inlet_flow", 0.25, 0.75) == Approx(1));
  CHECK(ratio("back_pressure", 8, 4) == Approx(1));         // beats of 8 at most are 4 in the mean
  CHECK(ratio("wall_friction", 30, 60, 2.5) == Approx(1));  // a layer half as thick
  CHECK(ratio("wall_adhesion", 10, 40, 2.5) == Approx(1));
  CHECK(std::isnan(ratio("shear_thinning", 1, 1)));  // has no one number

  Json truth = truth_of("leak", "leak");
  truth["strength"] = 20;
  Json result = named(truth, 18, 15, 19);
  CHECK_FALSE(score_of(result).interval_holds());
  result["interval_90"] = {15, 20};
  CHECK(score_of(result).interval_holds());
  result["effect"] = {"suction"};
  CHECK(std::isnan(score_of(result).strength_ratio()));  // of another effect
}

TEST_CASE("A share's interval is Wilson's", "[examples][effect_score]") {
  // by the formula, with z = 1.96: 8 of 10 are 0.490 .. 0.943, none of 10 up to 0.278
  CHECK(example::detail::share_interval(8, 10) == "49 .. 94");
  CHECK(example::detail::share_interval(0, 10) == "0 .. 28");
  CHECK(example::detail::share_interval(10, 10) == "72 .. 100");
}

TEST_CASE("Answers are counted by kind", "[examples][effect_score]") {
  const Json leak = truth_of("leak", "leak"), late = truth_of("latency", "latency", "measurement");
  const std::vector<Json> results{answer(leak, "named", {"leak"}), answer(leak, "named", {"suction"}),
                                  answer(leak, "nothing", {}),     answer(leak, "one_of", {"leak", "suction"}),
                                  answer(late, "nothing", {}),     answer(late, "one_of", {"latency", "gravity"})};
  std::vector<EffectScore> scores = scores_of(results);
  scores[4].kind = scores[5].kind = "measurement";
  const Json counts = example::detail::answers_by_kind(scores).json;
  CHECK(counts.at("moderate") == Json{{"cases", 4},
                                      {"right", 1},
                                      {"wrong", 1},
                                      {"one_of_two", 0},
                                      {"one_of", 1},
                                      {"missed", 1},
                                      {"unexplained", 0},
                                      {"physics_blamed", 3}});
  CHECK(counts.at("measurement").at("right") == 1);
  CHECK(counts.at("measurement").at("one_of") == 1);
  CHECK(counts.at("measurement").at("physics_blamed") == 1);
}

TEST_CASE("Stated probabilities are held against how often they are true", "[examples][effect_score]") {
  const auto stating = [](const char* hidden, double leak, double suction) {
    Json result = answer(truth_of(hidden, hidden), "named", {"leak"});
    result["refined"] = {{{"effect", "leak"}, {"probability", leak}},
                         {{"effect", "leak"}, {"probability", leak}},  // at another place: the same statement
                         {{"effect", "suction"}, {"probability", suction}}};
    return result;
  };
  // in the bin of 0.75 .. 0.9: 0.8, 0.8, of which one is true; in that of 0.1 .. 0.5: 0.2, 0.2, of which one is true
  const std::vector<Json> results{stating("leak", 0.8, 0.2), stating("suction", 0.8, 0.2),
                                  answer(truth_of("leak", "leak"), "nothing", {})};
  const Json told = example::detail::calibration(scores_of(results)).json;
  CHECK(told.at("expected_calibration_error").get<double>() == Approx(0.3));  // |0.8 - 0.5|, |0.2 - 0.5|
  CHECK(told.at("bins").at(1).at("statements") == 2);
  CHECK(told.at("bins").at(1).at("stated").get<double>() == Approx(0.2));
  CHECK(told.at("bins").at(3).at("true").get<double>() == Approx(0.5));
  CHECK(told.at("bins").at(4).at("statements") == 0);
}

TEST_CASE("Where something begins counts where it is somewhere, within 0.3 s and 60 pixels",
          "[examples][effect_score]") {
  const auto begins = [](double second, double u, const char* place = "pan") {
    Json truth = truth_of("bump", "bump", "outside");
    truth["place"] = place;
    truth["seen_first_s"] = 1.0;
    truth["seen_first_px"] = {100, 80};
    Json result = answer(truth, "unexplained", {});
    result["onset_s"] = second;
    result["onset_px"] = {u, 80};
    return result;
  };
  const std::vector<Json> results{begins(1.2, 120), begins(1.4, 120), begins(0.8, 170), begins(1.0, 100, "world")};
  const Json told = example::detail::beginnings(scores_of(results)).json;
  CHECK(told.at("cases") == 3);
  CHECK(told.at("within_0.3_s_and_60_px") == 1);
}

TEST_CASE("Strengths and the pour that was not used are told of rightly named effects, wrong ones if they are caught",
          "[examples][effect_score]") {
  const auto leak = [](double strength, double low, double high, Json confirmed, double before, double after,
                       double rival) {
    Json truth = truth_of("leak", "leak");
    truth["strength"] = 20.0;
    truth["unit"] = "ml/s";
    Json result = named(truth, strength, low, high);
    result["confirmed"] = std::move(confirmed);
    result["gap"] = {{"held_out_before", before},
                     {"held_out_after", after},
                     {"held_out_noise", 1.0},
                     {"best_rival_held_out", rival}};
    return result;
  };
  const auto wrong = [](Json confirmed) {
    Json result = answer(truth_of("leak", "leak"), "named", {"suction"});
    result["confirmed"] = std::move(confirmed);
    return result;
  };
  const std::vector<Json> results{leak(22, 18, 26, true, 11, 2, 9),                 // 0.9 of 10 reducible
                                  leak(19, 18, 19.5, true, 6, 3, 2.5),              // 0.6 of 5
                                  leak(16, 14, 17, "not_testable", 1.1, 1.0, 1.0),  // of no use there
                                  leak(21, 17, 25, false, 3, 3, 4),
                                  wrong(true),
                                  wrong(false),
                                  wrong("not_testable")};
  const Json told = example::detail::strengths_and_held_out(scores_of(results)).json;
  CHECK(told.at("strengths") == 4);
  CHECK(told.at("strength_off_by_median").get<double>() == Approx(0.075));  // of 0.05, 0.05, 0.1, 0.2
  CHECK(told.at("interval_holds") == 2);
  CHECK(told.at("rightly_named") == 4);
  CHECK(told.at("confirmed") == 2);
  CHECK(told.at("not_testable") == 1);
  CHECK(told.at("refuted") == 1);
  CHECK(told.at("held_out_share_median").get<double>() == Approx(0.6));  // of 0.9, 0.6, 0
  CHECK(told.at("rivals") == 3);
  CHECK(told.at("better_than_rival") == 2);
  CHECK(told.at("wrongly_named") == 3);
  CHECK(told.at("caught") == 2);
}

TEST_CASE("Of two effects at once it is told what becomes of the second one", "[examples][effect_score]") {
  Json truth = truth_of("leak", "leak", "two");
  truth["second"] = truth_of("viscosity", "viscosity");
  const auto found = [&](const std::string& verdict, const std::vector<std::string>& effects, double after) {
    Json result = answer(truth, verdict, effects);
    result["gap"] = {{"after", after}, {"largest_by_chance", 3.0}};
    return result;
  };
  const std::vector<Json> results{found("named", {"leak", "viscosity"}, 2), found("named", {"leak"}, 4),
                                  found("named", {"leak"}, 2.5), found("unexplained", {}, 8),
                                  answer(truth_of("leak", "leak"), "named", {"leak"})};
  const Json told = example::detail::two_at_once(scores_of(results)).json;
  CHECK(told == Json{{"cases", 4}, {"both", 1}, {"one_and_rest_told", 1}, {"one", 1}, {"unexplained", 1}});
}

TEST_CASE("Advice is counted beside chance by how often one effect is left, the right one or a wrong one",
          "[examples][effect_score]") {
  const Json leak = truth_of("leak", "leak");
  const auto after = [&](const std::string& verdict, const std::vector<std::string>& effects) {
    Json result = answer(leak, verdict, effects);
    result["interaction"] = "slower";
    result["gain_bit"] = 0.5;
    return result;
  };
  const auto followed = [&](const Json& advised, const Json& drawn) {
    return Json{{"left", {"leak", "suction"}}, {"after_advised", advised}, {"after_drawn", drawn}};
  };
  const std::vector<Json> results(3, answer(leak, "one_of", {"leak", "suction"}));
  const std::vector<Json> then{followed(after("named", {"leak"}), after("one_of", {"leak", "suction"})),
                               followed(after("named", {"suction"}), after("named", {"leak"})),
                               {{"left", {"leak", "suction"}}}};  // not followed yet
  std::vector<EffectScore> scores = scores_of(results);
  for (std::size_t k = 0; k < then.size(); ++k) {
    scores[k].followed = &then[k];
  }
  const Json told = example::detail::advised(scores).json;
  CHECK(told == Json{{"cases", 2},
                     {"settled_by_advice", 1},
                     {"settled_by_chance", 1},
                     {"misled_by_advice", 1},
                     {"misled_by_chance", 0}});
}
