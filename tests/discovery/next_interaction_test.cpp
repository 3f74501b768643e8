// SPDX-License-Identifier: MIT
// Which interaction to record next.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/discovery/missing_effect.hpp>
#include <decant/discovery/next_interaction.hpp>
#include <decant/hypothesis/thread_executor.hpp>

#include "catch.hpp"
#include "jet_model.hpp"

using namespace decant;
using decant_test::film_of;
using decant_test::Jet;
using decant_test::JetModel;

namespace {

constexpr std::size_t drag = 0, pull = 1, speed = 2;

PossibleEffect possible(std::size_t effect, double strength, double probability = 0.5) {
  return {{effect, Eigen::VectorXd::Constant(1, strength), {}, {}}, probability};
}

/// As a search finds it in films of these jets.
GapChange learnt() { return {8, 1.3, 1.3, 0.15, 0}; }

double entropy(double probability) {  // of two [bit]
  return -probability * std::log2(probability) - (1 - probability) * std::log2(1 - probability);
}

}  // namespace

TEST_CASE("next interaction: what is expected to tell effects apart does so") {
  // thrown nearly upright, a jet is moved aside by what pulls it, and not by its speed
  const JetModel low(-0.3), middle(0.9), steep(1.5);
  ThreadExecutor executor{{1}};
  const double pulled = 0.3, fast = 1.03;
  const std::vector<Interaction<JetModel>> proposed{{"low", &low, {}, {}}, {"steep", &steep, {}, {}}};
  const std::vector<InteractionAdvice> advice = advise_next_interaction(
      {possible(pull, pulled), possible(speed, fast)}, proposed, learnt(), run_jobs_on(executor), {}, 12);
  REQUIRE(advice.size() == 2);
  CHECK(advice[0].which == 1);
  CHECK(advice[0].gain > 0.9);
  CHECK(advice[0].gain <= 1);  // there is no more to be known of two
  CHECK(advice[0].deviation < 0.1);
  CHECK(advice[0].settles > 0.9);
  CHECK(advice[1].gain >= 0);
  CHECK(advice[1].gain < 0.3);
  CHECK(advice[1].settles < 0.3);
  // and with other films, from which a search learns as well
  const auto named = [&](double angle, const JetModel& model) {
    int right = 0;
    for (std::uint32_t seed = 0; seed < 10; ++seed) {
      const bool is_pull = seed % 2 == 0;
      const Jet jet = is_pull ? Jet{0, pulled} : Jet{0, 0, fast};
      MissingEffectSearch<JetModel> search(
          {{"a", &middle, film_of(jet, 300 + seed, 0.9)}, {"b", &model, film_of(jet, 400 + seed, angle)}}, {},
          run_jobs_on(executor));
      const MissingEffect result = search.find();
      right += result.verdict == Verdict::Named && result.found[0].effect == (is_pull ? pull : speed) ? 1 : 0;
    }
    return right;
  };
  CHECK(named(1.5, steep) >= 6);
  CHECK(named(-0.3, low) <= 4);
}

TEST_CASE("next interaction: there is no more to be known than is unknown") {
  const JetModel steep(1.5);
  ThreadExecutor executor{{1}};
  const auto gain = [&](const std::vector<PossibleEffect>& of) {
    return advise_next_interaction<JetModel>(of, {{"steep", &steep, {}, {}}}, learnt(), run_jobs_on(executor))[0].gain;
  };
  // what is all but known already; probabilities need no common sum
  CHECK(gain({possible(pull, 0.6, 18), possible(speed, 1.06, 2)}) == Approx(entropy(0.1)).epsilon(0.05));
  // one and the same, and what does nothing that could be seen
  CHECK(gain({possible(pull, 0.6), possible(pull, 0.6)}) < 1e-6);
  CHECK(gain({possible(pull, 0.01), possible(speed, 1.0005)}) < 0.15);
}

TEST_CASE("next interaction: models that fail tell nothing, and what is asked is checked") {
  JetModel broken(0.9);
  broken.broken_above = -1;
  const JetModel steep(1.5);
  ThreadExecutor executor{{1}};
  const std::vector<PossibleEffect> either{possible(pull, 0.6), possible(speed, 1.06)};
  const auto advise = [&](const std::vector<PossibleEffect>& of, std::vector<Interaction<JetModel>> proposed,
                          int simulated = 2) {
    return advise_next_interaction<JetModel>(of, std::move(proposed), learnt(), run_jobs_on(executor), {}, simulated);
  };
  const auto advice = advise(either, {{"broken", &broken, {}, {}}, {"steep", &steep, {}, {}}});
  CHECK(advice[0].which == 1);
  CHECK(advice[1].gain == 0);
  CHECK(advice[1].settles == 0);
  CHECK(advise(either, {}).empty());
  CHECK_THROWS_WITH(advise({either[0]}, {}), decant_test::contains("possible effects"));
  CHECK_THROWS_WITH(advise({either[0], possible(drag, 1, 0)}, {}), decant_test::contains("probability"));
  CHECK_THROWS_WITH(advise(either, {}, 0), decant_test::contains("simulated"));
  CHECK_THROWS_WITH(advise(either, {{"steep", &steep, {}, {}}, {"steep", &broken, {}, {}}}),
                    decant_test::contains("all different"));
  CHECK_THROWS_WITH(advise(either, {{"none", nullptr, {}, {}}}), decant_test::contains("model of 'none'"));
}

TEST_CASE("next interaction: what is left of a search is the best of each answer") {
  const JetModel model;
  std::vector<Effect> effects = model.effects();
  effects.push_back(effects[drag]);
  effects.back().name = "drag_quadratic";
  effects[drag].family = effects.back().family = "drag";
  MissingEffect result;
  const auto add = [&](std::size_t effect, double strength, double probability) {
    RefinedEffect& one = result.refined.emplace_back();
    one.effect = effect;
    one.strength = Eigen::VectorXd::Constant(1, strength);
    one.probability = probability;
  };
  add(drag, 0.4, 0.7);
  add(effects.size() - 1, 0.2, 0.7);  // of the same family
  add(pull, -0.3, 0.29);
  add(speed, 0.9, 0.01);
  const std::vector<PossibleEffect> left = possible_effects(result, effects);
  REQUIRE(left.size() == 2);
  CHECK(left[0].effect.effect == drag);
  CHECK(left[0].probability == 0.7);
  CHECK(left[1].effect.effect == pull);
  CHECK(left[1].effect.strength[0] == -0.3);
  CHECK(possible_effects(result, effects, 0.005).size() == 3);
}
