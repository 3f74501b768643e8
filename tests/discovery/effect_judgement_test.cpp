// SPDX-License-Identifier: MIT

#include <cmath>
#include <cstddef>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/discovery/effect_dictionary.hpp>
#include <decant/discovery/effect_judgement.hpp>

#include "catch.hpp"

using namespace decant;

namespace {

Effect named(const std::string& name, const std::string& family = "") {
  Effect effect;
  effect.name = name;
  effect.family = family;
  effect.components = {{"", 0, -1, 1}};
  return effect;
}

/// An effect whose distance falls from `without` by `improvement` at a strength of 1/2, as a parabola.
StrengthProfile falling(double without, double improvement) {
  return {{{{0, 1, 1, true}, {-1, 1}}},
          without,
          Eigen::Vector2d(2 * improvement, 0),
          Eigen::Vector2d(4 * improvement, 0).asDiagonal()};
}

EffectEvidence evidence(double distance, const std::vector<double>& improvement,
                        const std::vector<double>& overlap = {}) {
  EffectEvidence result;
  result.distance = distance;
  for (const double each : improvement) {
    result.profile.emplace_back(falling(distance, each));
  }
  result.overlap = {0.4, overlap.empty() ? std::vector<double>(improvement.size(), 0) : overlap};
  result.blurred = {0.4, std::vector<double>(improvement.size(), 0)};
  return result;
}

ChanceLevel usual_chance() {
  ChanceLevel chance;
  chance.distance = 1.2;
  chance.largest_distance = 2;
  chance.fall = 0.2;
  chance.overlap = chance.blurred = 0.1;
  return chance;
}

}  // namespace

TEST_CASE("effect judgement: what chance takes away once in fifty times is as likely as that says") {
  ChanceLevel chance;
  chance.distance = 1.5;
  chance.fall = 0.1;
  const auto value = [&](double distance) { return evidence_of(distance, 0, chance).value; };
  for (const double left : {1.5, 3.0, 20.0}) {  // whatever the scale of what is left
    CHECK(value(left) - value(1.1 * left) == Approx(0.5 * 5.41));
    // a deviation is what evidence is off by if the distance is
    const double slope = (value(left) - value(1.0001 * left)) / (0.0001 * left);
    CHECK(evidence_of(left, 0.2, chance).deviation == Approx(0.2 * slope).epsilon(1e-3));
  }
  CHECK(value(0) == value(0.015));  // to be nearer to nothing is no proof without end
  chance.fall = 0;
  CHECK(std::isfinite(value(0)));
}

TEST_CASE("effect judgement: probabilities are of what evidence says, and the less sure the fewer runs say it") {
  const std::vector<double> sure = probabilities({{-3, 0}, {-3 + std::log(4), 0}, {-800, 0}});
  CHECK(sure[0] == Approx(0.2));
  CHECK(sure[1] == Approx(0.8));
  CHECK(sure[2] == Approx(0).margin(1e-12));
  // the mean of a logistic function over a normal distribution of deviation 2, by quadrature
  const double deviation = 2, apart = 2;
  double mean = 0;
  for (int k = -800; k <= 800; ++k) {
    const double z = 0.01 * k;
    mean += 0.01 / std::sqrt(2 * std::acos(-1)) * std::exp(-0.5 * z * z) / (1 + std::exp(-(apart + deviation * z)));
  }
  std::vector<Evidence> two(2);
  two[0].value = apart;
  for (Evidence& unsure : two) {  // whichever it is
    unsure.deviation = deviation;
    CHECK(probabilities(two)[0] == Approx(mean).margin(0.01));
    unsure.deviation = 0;
  }
}

TEST_CASE("effect dictionary: runs to both sides of each component, templates for what is not named") {
  std::vector<Effect> effects{named("one"), named("two"), named("seen"), named("sure")};
  effects[0].components = {{"", 2, 2, 4}};  // to one side alone
  effects[1].components = {{"x", 0, -1, 1, 0.1}, {"y", 0, -1, 1}};
  effects[2].kind = EffectKind::Nuisance;
  effects[2].components[0].tolerance = 0.2;
  effects[3].kind = EffectKind::Nuisance;
  DictionarySettings settings;
  settings.baselines = 2;
  settings.draws = 7;
  settings.shares = {0.5, 1};
  const std::vector<PlannedRun> runs = plan_dictionary(effects, settings);
  std::vector<int> count(4);
  std::set<std::string> keys;
  std::set<std::pair<double, double>> of_two;
  for (const PlannedRun& each : runs) {
    ++count[static_cast<std::size_t>(each.role)];
    keys.insert(run_key(effects, each.run));
    CHECK(each.run.tolerated == (each.role == RunRole::Draw));
    if (each.role == RunRole::Effect && each.effect == 1) {
      of_two.insert({each.run.effects.front().strength[0], each.run.effects.front().strength[1]});
    }
    if (each.role == RunRole::Template) {
      CHECK(each.effect == 2);
      CHECK(each.run.effects.front().strength[0] == 0.2);
      CHECK(each.run.seed == runs.front().run.seed);  // differs from the first baseline in nothing else
    }
  }
  CHECK(count == std::vector<int>{2, 7, 1, 2 + 8});
  CHECK(keys.size() == runs.size());
  CHECK(of_two == std::set<std::pair<double, double>>{
                      {-1, 0}, {-0.5, 0}, {0.5, 0}, {1, 0}, {0, -1}, {0, -0.5}, {0, 0.5}, {0, 1}});

  // what is known not to be missing is drawn, but has no runs of its own, and the others are the same ones
  effects[1].kind = EffectKind::Tolerated;
  std::set<std::string> fewer;
  for (const PlannedRun& each : plan_dictionary(effects, settings)) {
    CHECK((each.role != RunRole::Effect || each.effect == 0));
    fewer.insert(run_key(effects, each.run));
  }
  CHECK(fewer.size() == keys.size() - 8);
  CHECK(std::includes(keys.begin(), keys.end(), fewer.begin(), fewer.end()));
  effects[1].kind = EffectKind::Physics;

  // around a model that has been given something already, which runs about that replace
  const std::vector<AppliedEffect> added{{0, Eigen::VectorXd::Constant(1, 3), {}}};
  for (const PlannedRun& each : plan_dictionary(effects, settings, added)) {
    const bool about_it = each.role == RunRole::Effect && each.effect == 0;
    std::size_t times = 0;
    for (const AppliedEffect& applied : each.run.effects) {
      times += applied.effect == 0 ? 1 : 0;
    }
    CHECK(times == 1);
    if (!about_it) {
      CHECK(each.run.effects.front().strength[0] == 3);
    }
  }
  settings.shares = {1.5};
  CHECK_THROWS_WITH(plan_dictionary(effects, settings), decant_test::contains("share"));
  effects[0].name.clear();
  CHECK_THROWS_WITH(plan_dictionary(effects), decant_test::contains("name"));
}

TEST_CASE("effect judgement: a name, a set, nothing or unexplained") {
  const std::vector<Effect> effects{named("drag_linear", "drag"), named("drag_quadratic", "drag"), named("pull")};
  const auto judge = [&](const EffectEvidence& of) { return judge_effects(effects, {of}, usual_chance()); };

  const Judgement pull = judge(evidence(6, {1, 1.2, 4.5}));
  CHECK(pull.verdict == Verdict::Named);
  REQUIRE(pull.standings.front().effect == 2);
  CHECK(pull.standings.front().strength[0] == Approx(0.5).epsilon(1e-4));
  CHECK(pull.standings.front().share == Approx(4.5 / 4.8));
  CHECK(pull.standings.front().vote == Approx(1));
  // the distance grows by what chance does, a fifth of the 1.5 that are left, within a quarter of the root of 0.3 / 4.5
  CHECK(pull.standings.front().interval[0].first == Approx(0.5 - 0.5 * std::sqrt(0.3 / 4.5)).epsilon(1e-3));

  // of one family: one answer
  const Judgement drag = judge(evidence(6, {4.4, 4.5, 1}));
  CHECK(drag.verdict == Verdict::Named);
  CHECK(drag.named.size() == 1);
  const Judgement either = judge(evidence(6, {4.2, 1, 4.5}));
  CHECK(either.verdict == Verdict::OneOf);
  CHECK(either.named.size() == 2);

  CHECK(judge(evidence(1.9, {0.1, 0.2, 0.29})).verdict == Verdict::Nothing);
  CHECK(judge(evidence(1.9, {0.1, 0.2, 0.6})).verdict == Verdict::Named);  // small, and beyond chance all the same
  const Judgement by_luck = judge(evidence(1, {0.1, 0.2, 0.6}));  // less than what there is where nothing is missing
  REQUIRE(by_luck.standings.size() == 3);
  CHECK(by_luck.standings[0].share == Approx(1).epsilon(1e-4));
  CHECK(by_luck.standings[1].share == Approx(0.2 / 0.6).epsilon(1e-4));
  CHECK(share_of_reducible(2, 5, 1, 1.5) == -1);
  CHECK(judge(evidence(6, {0.1, 0.2, 1})).verdict == Verdict::Unexplained);
  CHECK(judge(evidence(6, {0.1, 0.2, 0.25})).verdict == Verdict::Unexplained);
  CHECK(judge_effects({}, {evidence(6, {})}, usual_chance()).verdict == Verdict::Unexplained);
  CHECK(judge_effects({}, {evidence(1, {})}, usual_chance()).verdict == Verdict::Nothing);

  // A gap that shrinks by more than chance has a say, one that does not has none: 0.4 is what there is of it.
  const Judgement heard = judge(evidence(6, {4.2, 1, 4.5}, {0.2, 0, 0.02}));
  CHECK(heard.standings.front().effect == 0);
  const Judgement not_heard = judge(evidence(6, {4.2, 1, 4.5}, {0.03, 0, 0}));
  CHECK(not_heard.standings.front().effect == 2);
}

TEST_CASE("effect judgement: several recordings have one strength") {
  const std::vector<Effect> effects{named("pull"), named("drag")};
  // alone each is explained by either; at one strength for both only the pull does
  EffectEvidence first = evidence(5, {3, 3}), second = evidence(5, {3, 0});
  second.profile[1] = StrengthProfile({{{0, 1, 1, true}, {-1, 1}}}, 5, Eigen::Vector2d(-6, 0),
                                      Eigen::Vector2d(12, 0).asDiagonal());  // best at -1/2
  CHECK(judge_effects(effects, {first}, usual_chance()).verdict == Verdict::OneOf);
  CHECK(judge_effects(effects, {second}, usual_chance()).verdict == Verdict::OneOf);
  const Judgement both = judge_effects(effects, {first, second}, usual_chance());
  CHECK(both.verdict == Verdict::Named);
  CHECK(both.standings.front().effect == 0);
  CHECK(both.standings.front().improvement == Approx(3));
  CHECK(both.distance == Approx(5));
  second.profile.pop_back();
  CHECK_THROWS_WITH(judge_effects(effects, {first, second}, usual_chance()), decant_test::contains("first one"));
}

TEST_CASE("effect judgement: chance is what nearly all draws do, and a little more") {
  std::vector<EffectEvidence> draws;
  for (int k = 0; k < 6; ++k) {
    draws.push_back(evidence(1 + 0.1 * k, {0.01 * k, 0.05}, {0.004 * k, 0}));
  }
  JudgementSettings settings;
  settings.distance_factor = 1.1;
  settings.fall_factor = settings.gap_factor = 2;
  settings.quantile = 0.95;  // three quarters of the way from the fifth to the sixth
  const ChanceLevel level = chance_level({draws}, settings);
  CHECK(level.distance == Approx(1.1 * 1.25));
  CHECK(level.largest_distance == Approx(1.1 * 1.475));
  CHECK(level.fall == Approx(2 * std::lerp(0.05 / 1.05, 0.05 / 0.95, 0.75)));  // largest where least is left
  CHECK(level.overlap == Approx(2 * 0.019 / 0.4));
  CHECK(level.blurred == 0);
  settings.quantile = 1;
  CHECK(chance_level({draws}, settings).largest_distance == Approx(1.1 * 1.5));
  settings.quantile = 0;
  CHECK(chance_level({draws}, settings).largest_distance == Approx(1.1));
  settings.quantile = 1.1;
  CHECK_THROWS_WITH(chance_level({draws}, settings), decant_test::contains("quantile"));
  draws.resize(4);
  CHECK_THROWS_WITH(chance_level({draws}), decant_test::contains("at least 5"));
}
