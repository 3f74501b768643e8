// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <catch2/catch.hpp>

#include <decant/discovery/effect.hpp>
#include <decant/discovery/effect_dictionary.hpp>
#include <decant/discovery/missing_effect.hpp>
#include <decant/discovery/nuisance_space.hpp>
#include <decant/discovery/reference_lesson.hpp>
#include <decant/hypothesis/thread_executor.hpp>

#include "jet_model.hpp"

using namespace decant;
using namespace decant_test;

namespace {

/// Of independent features that vary by about 1.
NuisanceSpace plain_space(Eigen::Index features) {
  std::mt19937 random(5);
  NuisanceSample sample;
  sample.baseline = Eigen::MatrixXd::Zero(features, 1);
  sample.draws.resize(features, 40);
  for (double& each : sample.draws.reshaped()) {
    each = (static_cast<double>(random()) / 4294967295.0 - 0.5) * std::sqrt(12.0);
  }
  return NuisanceSpace(sample);
}

PlannedRun effect_run(std::size_t effect, double strength, std::uint32_t seed) {
  return {RunRole::Effect, effect, {{{effect, Eigen::VectorXd::Constant(1, strength), {}}}, seed, false}};
}

/// Of a run that worked.
Observation something() {
  SilhouetteSeries film(20, 20, 10);
  film.add(0, Mask::Zero(20, 20));
  return Observation({film});
}

}  // namespace

TEST_CASE("reference lesson: how much of each effect there seems to be, whatever else is off") {
  const NuisanceSpace space = plain_space(60);
  std::vector<EffectChange> changes{{"a", 1, Eigen::VectorXd::Zero(60)}, {"b", 1, Eigen::VectorXd::Zero(60)}};
  changes[0].change.head(30).setConstant(20);
  changes[1].change.segment(20, 30).setConstant(-15);  // partly the same features
  Eigen::VectorXd residual = 0.4 * changes[0].change - 0.7 * changes[1].change;
  residual.tail(10).setConstant(9);  // that no effect does
  const ReferenceLesson lesson = lesson_of(residual, changes, space, 1e-6);
  CHECK(lesson.parts.at({"a", 1}) == Approx(0.4).margin(0.03));
  CHECK(lesson.parts.at({"b", 1}) == Approx(-0.7).margin(0.03));

  // elsewhere the same effects change something else, there are runs of other strengths, and one is not known there
  const auto change = [](double x) { return Eigen::VectorXd::Constant(5, x); };
  const std::vector<EffectChange> other{{"b", 0.1, change(70)}, {"b", 0.5, change(2)}, {"c", 1, change(100)}};
  const Eigen::VectorXd expected = expected_residual(lesson, other, 5);
  CHECK(expected.isApproxToConstant(4 * lesson.parts.at({"b", 1}), 1e-12));

  // what is held back is less, and never turned round
  const ReferenceLesson careful = lesson_of(residual, changes, space, 100);
  CHECK(careful.parts.at({"a", 1}) > 0);
  CHECK(careful.parts.at({"a", 1}) < 0.9 * lesson.parts.at({"a", 1}));
}

TEST_CASE("reference lesson: two effects that do the same share it") {
  const NuisanceSpace space = plain_space(40);
  const Eigen::VectorXd change = Eigen::VectorXd::Constant(40, 3);
  const ReferenceLesson lesson = lesson_of(change, {{"a", 1, change}, {"b", 1, change}}, space, 0.01);
  CHECK(lesson.parts.at({"a", 1}) == Approx(0.5).epsilon(0.05));
  CHECK(lesson.parts.at({"b", 1}) == Approx(lesson.parts.at({"a", 1})));
}

TEST_CASE("reference lesson: what runs of one strength change, in the mean, by side and share of the range") {
  EffectDictionary dictionary;
  dictionary.effects = {plain_effect("drag", "", "1/s", "", {"", 1, 0, 5, 0})};
  dictionary.runs = {effect_run(0, 2, 1), effect_run(0, 4, 2), effect_run(0, 4, 3), effect_run(0, 0.5, 4),
                     effect_run(0, 5, 5)};
  dictionary.seen.assign(5, something());
  dictionary.seen[4] = {};  // the strongest one failed
  const std::vector<double> of_run{7, 10, 14, 1, 1000};
  const std::vector<EffectChange> changes = effect_changes(
      dictionary, [&](std::size_t run) { return Eigen::VectorXd::Constant(1, of_run[run]); },
      Eigen::VectorXd::Constant(1, 3));
  const std::string less = effect_side(dictionary.effects[0], 0, false);
  const std::string more = effect_side(dictionary.effects[0], 0, true);
  REQUIRE(changes.size() == 3);
  std::map<std::pair<std::string, double>, double> by;
  for (const EffectChange& each : changes) {
    by[{each.side, each.share}] = each.change[0];
  }
  CHECK(by.at({less, 0.5}) == Approx(1 - 3));
  CHECK(by.at({more, 0.25}) == Approx(7 - 3));
  CHECK(by.at({more, 0.75}) == Approx(12 - 3));
}

TEST_CASE("missing effect: what reality always does differently is learnt from references of other interactions") {
  // air slows all balls and blows against them; nozzles stand at other angles
  const Jet foreign{0.35, -0.2};
  ThreadExecutor executor{{1}};
  const std::vector<double> angles{0.72, 0.8, 1.0};
  std::vector<JetModel> others;
  for (const double angle : angles) {
    others.emplace_back(angle);
  }
  std::vector<Interaction<JetModel>> references;
  for (std::size_t k = 0; k < angles.size(); ++k) {
    references.push_back({"reference " + std::to_string(k), &others[k],
                          film_of(foreign, static_cast<std::uint32_t>(62 + k), angles[k])});
  }
  const JetModel model(0.9), other(0.6);
  const auto found = [&](double late, const std::vector<Interaction<JetModel>>& known) {
    Jet jet = foreign;
    jet.late = late;
    return MissingEffectSearch<JetModel>({{"a", &model, film_of(jet, 61, 0.9)}}, {{"b", &other, film_of(jet, 71, 0.6)}},
                                         run_jobs_on(executor), {}, known)
        .find();
  };
  const MissingEffect alone = found(0, {}), taught = found(0, references);
  CHECK(alone.verdict != Verdict::Nothing);
  CHECK(taught.verdict == Verdict::Nothing);
  CHECK(taught.taught_by == 0);
  CHECK(taught.lessons == 3);
  CHECK(taught.learn.before < 0.2 * alone.learn.before);

  const MissingEffect late = found(0.05, references);
  CHECK(late.verdict == Verdict::Named);
  REQUIRE(late.found.size() == 1);
  CHECK(model.effects()[late.found.front().effect].name == "late");
  CHECK(late.found.front().strength[0] == Approx(0.05).epsilon(0.2));
  CHECK(late.confirmation == Confirmation::Confirmed);
  // one interaction is not enough to know what carries over to others, however often it is recorded
  std::vector<Interaction<JetModel>> same{references.front()};
  same.push_back({"again", &others[0], film_of(foreign, 66, angles[0])});
  CHECK(found(0, {references.front()}).lessons == 0);
  CHECK(found(0, same).lessons == 0);
}
