// SPDX-License-Identifier: MIT
// What sensors read that give one number at a time, as evidence of what a model lacks.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/discovery/disagreement.hpp>
#include <decant/discovery/missing_effect.hpp>
#include <decant/discovery/observation.hpp>
#include <decant/discovery/observation_features.hpp>
#include <decant/discovery/reading_features.hpp>
#include <decant/discovery/reading_series.hpp>
#include <decant/hypothesis/thread_executor.hpp>

#include "catch.hpp"
#include "draining_tank_model.hpp"
#include "jet_model.hpp"

using namespace decant;
using decant_test::film_of;
using decant_test::Jet;
using decant_test::JetModel;
using decant_test::read_from;
using decant_test::Tank;
using decant_test::TankModel;

namespace {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();

MissingEffect found_in_tank(const Tank& tank, std::uint32_t seed) {
  const TankModel model, other(0.14);
  Tank shallow = tank;
  shallow.level -= 0.06;
  ThreadExecutor executor{{1}};
  MissingEffectSettings settings;
  settings.most_left = 1.5;  // but for its errors, the model is as exact as its sensors
  MissingEffectSearch<TankModel> search({{"a", &model, read_from(tank, seed)}},
                                        {{"b", &other, read_from(shallow, seed + 1)}}, run_jobs_on(executor), settings);
  return search.find();
}

/// A front passes a level probe after a second. Knows of fronts that are earlier or later by up to more than how long
/// anything is read, and of a hollow that follows the front.
class Front {
 public:
  Front() {
    for (const auto& [name, component] : {std::pair{"late", EffectComponent{"", 0, -0.9, 1.2, 0.004}},
                                          std::pair{"hollow", EffectComponent{"", 0, 0, 1.5, 0.01}}}) {
      effects_.push_back(plain_effect(name, "", "", "", component));
    }
  }
  const std::vector<Effect>& effects() const noexcept { return effects_; }
  std::vector<ReadingSeries> predict(const ModelRun& run) const {
    std::mt19937 random(run.seed);
    const std::vector<AppliedEffect> as = effects_of_run(effects_, run, random);
    return passing(as[0].strength[0], as[1].strength[0]);
  }
  static std::vector<ReadingSeries> passing(double late, double hollow) {
    ReadingSeries read("level [m]", {0.02, 0});
    for (int k = 0; k <= 80; ++k) {
      const double time = 0.02 * k;
      const bool behind = time > 1.05 + late && time < 1.4 + late;
      read.add(time, std::clamp((time - 1 - late) / 0.1, 0.0, 1.0) - (behind ? hollow : 0));
    }
    return {read};
  }

 private:
  std::vector<Effect> effects_{};
};

}  // namespace

TEST_CASE("readings: what one run of a dictionary shows is looked at, though a curve through all of them does not") {
  // one of its runs is 0.42 late, but what fronts do that are as much earlier, and much later, is not in line with that
  const Front model;
  ThreadExecutor executor{{1}};
  MissingEffectSettings settings;
  settings.refined = 1;
  for (const std::uint32_t seed : {3U, 5U}) {
    const Observation seen = Observation(Front::passing(0.4, 0)).with_errors(seed);
    const MissingEffect result =
        MissingEffectSearch<Front>({{"a", &model, seen}}, {}, run_jobs_on(executor), settings).find();
    CHECK(result.judgement.standings.front().effect == 1);  // by curves the hollow explains more
    REQUIRE(result.verdict == Verdict::Named);
    CHECK(model.effects()[result.found.front().effect].name == "late");
    CHECK(result.found.front().strength[0] == Approx(0.4).margin(0.01));
  }
}

TEST_CASE("readings: errors have the deviation they are said to have, and last as long") {
  for (const double lasts : {0.0, 0.5}) {
    ReadingSeries still("level [m]", {0.01, lasts});
    const int count = 40000;
    for (int k = 0; k < count; ++k) {
      still.add(0.1 * k, 0.2);
    }
    const ReadingSeries seen = still.with_errors(3);
    const auto product = [&](int lag) {
      double sum = 0;
      for (int k = lag; k < count; ++k) {
        sum += (seen.value(static_cast<std::size_t>(k)) - 0.2) * (seen.value(static_cast<std::size_t>(k - lag)) - 0.2);
      }
      return sum / (count - lag) / (0.01 * 0.01);
    };
    const double scatter = 4 * std::sqrt((1 + 10 * 2 * lasts) * 2.0 / count);  // of the estimates, four deviations
    CHECK(product(0) == Approx(1).margin(scatter));
    CHECK(product(1) == Approx(lasts > 0 ? std::exp(-0.2) : 0).margin(scatter));
    CHECK(product(8) == Approx(lasts > 0 ? std::exp(-1.6) : 0).margin(scatter));
    CHECK(still.with_errors(4).value(7) != seen.value(7));
  }
}

TEST_CASE("readings: features are means over windows, of the readings that the recording has") {
  ReadingSeries level("level [m]", {0.01, 0}), mass("mass [kg]", {0.1, 0});
  const std::vector<double> height{1, 2, 6, missing, missing, 7, 8}, weight{3, missing, 5};
  for (std::size_t k = 0; k < height.size(); ++k) {
    level.add(0.1 * static_cast<double>(k), height[k]);  // the third one is due as the second window begins
  }
  for (std::size_t k = 0; k < weight.size(); ++k) {
    mass.add(1 + 0.2 * static_cast<double>(k), weight[k]);
  }
  const ReadingFeatures features({level, mass}, {.window = 0.2, .most_windows = 100, .least_error = 0.5});
  const auto close = [](const Eigen::VectorXd& a, const std::vector<double>& b) {
    return a.isApprox(Eigen::Map<const Eigen::VectorXd>(b.data(), static_cast<Eigen::Index>(b.size())));
  };
  REQUIRE(features.size() == 6);
  CHECK(close(features.of({level, mass}), {1.5, 6, 7, 8, 3, 5}));
  const std::vector<double> other{10, 20, 30, 40, 50, 60, 70}, heavier{7, 8, 9};
  CHECK(close(features.of({level.with_values(other), mass.with_values(heavier)}), {15, 30, 60, 70, 7, 9}));
  const std::vector<double> unseen{missing, 20, 30, 40, 50, 60, 70};
  CHECK(std::isnan(features.of({level.with_values(unseen), mass})[0]));
  CHECK(features.least_errors()[3] == Approx(0.005));
  CHECK(features.least_errors()[4] == Approx(0.05));
  CHECK(features.place(5).sensor == 1);
  CHECK(features.place(5).window == 2);
  CHECK(features.place(1).begin == Approx(0.2));
  CHECK(features.place(1).end == Approx(0.2));  // the next one is missing

  const ReadingFeatures few({level}, {.window = 0.2, .most_windows = 2});
  REQUIRE(few.size() == 2);  // of 0.3 s each, the last reading with the second one
  CHECK(close(few.of({level}), {3, 7.5}));

  CHECK(!features.fit({level}));
  CHECK_THROWS_WITH(features.of({level}), decant_test::contains("those of the recording"));
  CHECK_THROWS_WITH(level.with_values(weight), decant_test::contains("as many as of the series"));
  CHECK_THROWS_WITH(level.add(0.6, 1), decant_test::contains("finite and increasing"));
  CHECK_THROWS_WITH(ReadingSeries("x", {0, 0}), decant_test::contains("'x': deviation must be > 0"));
  CHECK_THROWS_WITH(ReadingSeries("x", {1, -1}), decant_test::contains("lasts [s] must be >= 0"));
  CHECK_THROWS_WITH(ReadingFeatures({}, {.window = 0}), decant_test::contains("window [s] must be > 0"));
  CHECK_THROWS_WITH(ReadingFeatures({}, {.most_windows = 0}), decant_test::contains("most_windows must be >= 1"));
  CHECK_THROWS_WITH(ReadingFeatures({}, {.least_error = 0}), decant_test::contains("least_error must be > 0"));
}

TEST_CASE("observation: numbers come back as they were, and of other sensors are refused") {
  const Observation both(film_of({}, 1), decant_test::readings_of({}));
  const std::vector<double> numbers = both.numbers();
  const Observation blank(film_of({0, 1}, 2), read_from({0.5}, 3).readings), back = blank.with_numbers(numbers);
  CHECK(back.numbers() == numbers);
  CHECK(back.readings[0].value(100) == both.readings[0].value(100));
  CHECK(back.readings[0].error().deviation == 0.002);
  CHECK(blank.with_numbers({}).empty());
  CHECK_THROWS_WITH(Observation(film_of({}, 1)).with_numbers(numbers), decant_test::contains("Observation: numbers"));
  CHECK_THROWS_WITH(both.with_numbers(Observation(film_of({}, 1)).numbers()),
                    decant_test::contains("Observation: numbers"));
}

TEST_CASE("disagreement: sensors that read too much or too little for a while") {
  ReadingSeries level("level [m]", {0.01, 0});
  for (int k = 0; k < 20; ++k) {
    level.add(k, 0);
  }
  const ReadingFeatures features({level, level}, {.window = 1});
  Eigen::VectorXd off = Eigen::VectorXd::Zero(40);
  off.segment(3, 3) << 3.5, 5, 3.2;            // one is beyond it
  off.segment(8, 3) << 3.5, 3.9, 3.2;          // none is, and three are not many
  off.segment(16, 4) << -3.5, -3.6, -3.5, -9;  // up to the first sensor's end
  off.segment(20, 4) << -3.1, -3.1, -3.1, -3.1;
  off.segment(24, 1) << 4.1;
  const std::vector<ReadingDisagreement> found = find_disagreements(features, off, 4);
  REQUIRE(found.size() == 4);
  CHECK(found[0].sensor == 0);
  CHECK(!found[0].more);
  CHECK(found[0].begin == 16);
  CHECK(found[0].end == 19);
  CHECK(found[0].largest == 9);
  CHECK(found[1].more);
  CHECK(found[1].begin == 3);
  CHECK(found[1].end == 5);
  CHECK(found[1].weight == Approx(3.5 * 3.5 + 25 + 3.2 * 3.2));
  CHECK(found[2].sensor == 1);
  CHECK(found[2].windows == 4);
  CHECK(found[3].windows == 1);
  CHECK(found[3].more);
  CHECK_THROWS_WITH(find_disagreements(features, off.head(3)), decant_test::contains("as many as features"));
}

TEST_CASE("readings: what a tank lacks is named by its level and a scale alone, and confirmed on another run") {
  struct Case {
    Tank tank;
    std::string name;
    double strength, within;
  };
  const std::vector<Case> cases{{{0.68}, "discharge", 0.68, 0.006},
                                {{0.62, 0.2, 1e-6}, "leak", 1e-6, 1e-7},
                                {{0.62, 0.21}, "level", 0.21, 1e-3},
                                {{0.62, 0.2, 0, 5}, "late", 5, 0.5}};
  const TankModel model;
  for (const Case& each : cases) {
    for (const std::uint32_t seed : {11U, 21U, 31U}) {
      const MissingEffect result = found_in_tank(each.tank, seed);
      INFO(each.name << ", seed " << seed);
      CHECK(result.verdict == Verdict::Named);
      REQUIRE(result.found.size() == 1);
      const RefinedEffect& found = result.found.front();
      CHECK(model.effects()[found.effect].name == each.name);
      CHECK(found.strength[0] == Approx(each.strength).margin(each.within));
      CHECK(found.share > 0.8);
      if (each.name != "level") {  // the other run begins at another one
        CHECK(result.confirmation == Confirmation::Confirmed);
      }
      CHECK(!result.where_read.front().empty());
      CHECK(result.where.front().empty());
    }
  }
}
TEST_CASE("readings: sensors' own errors are not taken for physics") {
  int alarms = 0;
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    const MissingEffect result = found_in_tank({}, 1000 * seed);
    alarms += result.verdict == Verdict::Nothing ? 0 : 1;
    CHECK(result.verdict != Verdict::Named);
  }
  CHECK(alarms <= 2);
}

TEST_CASE("readings: what no effect of the catalogue does is unexplained, and which sensor shows it, and when") {
  const MissingEffect result = found_in_tank({0.62, 0.2, 0, 0, 0, 0.1}, 5);
  CHECK(result.verdict == Verdict::Unexplained);
  REQUIRE(!result.where_read.front().empty());
  const ReadingDisagreement& most = result.where_read.front().front();
  CHECK(most.sensor == 1);
  CHECK(!most.more);
  CHECK(most.begin == Approx(60).margin(1));
  CHECK(most.end == 120);
}

TEST_CASE("readings: an effect that explains much of what another one does leaves more than chance") {
  // what evaporates out of the pan looks like a hole through which less flows, but for what the level says
  const MissingEffect result = found_in_tank({0.62, 0.2, 0, 0, 3e-3}, 5);
  CHECK(result.verdict == Verdict::Unexplained);
  CHECK(result.refined.front().share > 0.8);
}

namespace {

/// Cannot say what its level probe reads of tanks that drain fast.
class BlindTankModel : public TankModel {
 public:
  std::vector<ReadingSeries> predict(const ModelRun& run) const {
    std::vector<ReadingSeries> seen = TankModel::predict(run);
    if (seen[0].value(60) < blind_below) {
      seen[0] = seen[0].with_values(std::vector<double>(seen[0].size(), missing));
    }
    return seen;
  }

  double blind_below = 0.147;
};

}  // namespace

TEST_CASE("readings: a run that does not predict them counts as failed, unless the recording has none there") {
  const BlindTankModel model;
  ThreadExecutor executor{{1}};
  const auto found = [&](const Observation& seen) {
    return MissingEffectSearch<BlindTankModel>({{"a", &model, seen}}, {}, run_jobs_on(executor)).find();
  };
  Observation seen = read_from({0.68}, 11);
  seen.readings[0] = seen.readings[0].with_values(std::vector<double>(seen.readings[0].size(), missing));
  const MissingEffect by_scale = found(seen);
  REQUIRE(!by_scale.found.empty());
  CHECK(model.effects()[by_scale.found.front().effect].name == "discharge");
  BlindTankModel blind;
  blind.blind_below = 1;
  const Interaction<BlindTankModel> nothing_known{"a", &blind, read_from({}, 11)};
  CHECK_THROWS_WITH(MissingEffectSearch<BlindTankModel>({nothing_known}, {}, run_jobs_on(executor)).find(),
                    decant_test::contains("model of 'a' as it is that come to their end"));
}

namespace {

/// Balls that are thrown onto a scale. How dense they are no camera sees.
class WeighedJetModel {
 public:
  WeighedJetModel() : effects_(film_.effects()) {
    Effect density;
    density.name = "density";
    density.components = {{"", 1, 0.8, 1.2}};
    effects_.push_back(density);
  }

  const std::vector<Effect>& effects() const noexcept { return effects_; }

  Observation predict(ModelRun run) const {
    Jet jet;
    double density = 1;
    for (const AppliedEffect& each : run.effects) {
      jet.speed = effects_[each.effect].name == "speed" ? each.strength[0] : jet.speed;
      density = effects_[each.effect].name == "density" ? each.strength[0] : density;
    }
    std::erase_if(run.effects, [&](const AppliedEffect& each) { return effects_[each.effect].name == "density"; });
    return {film_.predict(run), {weighed(jet, density)}};
  }

  /// Grams on the scale, of a steady jet.
  static ReadingSeries weighed(const Jet& jet, double density) {
    ReadingSeries series("on the scale [g]", {1, 0});
    for (int k = 0; k <= 20; ++k) {
      series.add(0.05 * k, 100 * density * jet.speed * 0.05 * k);
    }
    return series;
  }

 private:
  JetModel film_{};
  std::vector<Effect> effects_;
};
static_assert(ForwardModel<WeighedJetModel>);

}  // namespace

TEST_CASE("readings: cameras and a scale together tell what either does not") {
  const WeighedJetModel model;
  ThreadExecutor executor{{1}};
  const auto found = [&](const Jet& jet, double density) {
    const Observation seen = Observation(film_of(jet, 41), {WeighedJetModel::weighed(jet, density)}).with_errors(42);
    const MissingEffect result =
        MissingEffectSearch<WeighedJetModel>({{"a", &model, seen}}, {}, run_jobs_on(executor)).find();
    return result.verdict != Verdict::Named ? "" : model.effects()[result.found.front().effect].name;
  };
  CHECK(found({}, 1) == "");
  CHECK(found({}, 1.15) == "density");
  CHECK(found({0.8}, 1) == "drag");  // half as much could be a pull
  CHECK(found({0, 0, 1.06}, 1) == "speed");
}

namespace {

/// A probe that a wave passes. When it does is the effect's place; before and after it is calm.
class WaveModel {
 public:
  WaveModel() : effects_{plain_effect("wave", "", "mm", "", {"", 0, 0, 10})} {
    effects_[0].place = Vector3<double>(20, 0, 0);
    effects_[0].place_tolerance = 20;
  }

  const std::vector<Effect>& effects() const noexcept { return effects_; }

  std::vector<ReadingSeries> predict(const ModelRun& run) const {
    std::mt19937 random(run.seed);
    const AppliedEffect wave = effects_of_run(effects_, run, random)[0];
    return {passing((*wave.place)[0], wave.strength[0])};
  }

  static ReadingSeries passing(double at, double height) {
    ReadingSeries series("height [mm]", {0.3, 0});
    for (int k = 0; k < 60; ++k) {
      series.add(k, height / (1 + std::pow((k - at) / 3, 2)));
    }
    return series;
  }

 private:
  std::vector<Effect> effects_;
};
static_assert(ForwardModel<WaveModel>);

}  // namespace

TEST_CASE("refinement: a point that was tried is taken where slopes promise less") {
  // the wave is nowhere near its usual place, and slopes there say little of what it does where it is
  const WaveModel model;
  ThreadExecutor executor{{1}};
  const Observation seen = Observation({WaveModel::passing(35, 8)}).with_errors(7);
  const MissingEffect result = MissingEffectSearch<WaveModel>({{"a", &model, seen}}, {}, run_jobs_on(executor)).find();
  REQUIRE(!result.refined.empty());
  REQUIRE(result.refined.front().place);
  CHECK(result.refined.front().place->x() == Approx(35).margin(0.5));
  CHECK(result.refined.front().strength[0] == Approx(8).epsilon(0.1));
}
