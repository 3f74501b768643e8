// SPDX-License-Identifier: MIT

#include <cmath>
#include <limits>
#include <vector>

#include <decant/correction/open_loop.hpp>
#include <decant/correction/transport_corrector.hpp>
#include <decant/hypothesis/hypothesis_filter.hpp>
#include <decant/hypothesis/series_misfit.hpp>

#include "catch.hpp"
#include "tracking/falling_dust.hpp"

using namespace decant;
using decant_test::FallingDust;

namespace {

template <class CorrectorType>
using DustTracker = Tracker<FallingDust, CorrectorType>;

template <class CorrectorType>
DustTracker<CorrectorType> falling_with(double gravity) {
  FallingDust model;
  model.dust.position.row(2).array() += 0.05;  // high in the picture, which it does not leave in a third of a second
  model.gravity = gravity;
  DustTracker<CorrectorType> tracker(model);
  tracker.add_camera(decant_test::seeing_camera(), decant_test::before_the_block());
  return tracker;
}

/// Hypotheses that the dust falls with 0, 1, 2, 3 and 4 m/s^2. @param frames of what really falls with 2 m/s^2.
template <class CorrectorType>
HypothesisFilter<DustTracker<CorrectorType>> after(int frames, HypothesisFilterSettings settings = {}) {
  settings.posterior.least_squared = 0.5;  // dust is thin, and its model right to the last bit
  HypothesisFilter<DustTracker<CorrectorType>> filter(settings);
  for (int gravity = 0; gravity <= 4; ++gravity) {
    filter.add(falling_with<CorrectorType>(-gravity));
  }
  FallingDust reality = falling_with<CorrectorType>(-2).model();
  for (int frame = 1; frame <= frames; ++frame) {
    reality.step(1 / 30.0);
    const Mask mask = decant_test::seen(reality.dust);
    const std::vector<CameraMask> masks{{0, mask}};
    REQUIRE(filter.track({frame / 30.0, {}, masks}).advanced());
  }
  return filter;
}

}  // namespace

TEST_CASE("hypothesis filter: finds what is so, and gives up what is not", "[hypotheses]") {
  const auto open = after<OpenLoop<double>>(9);
  CHECK(open.best() == 2);
  CHECK(open.probability(2) > 0.9);
  CHECK(open.given_up(4));
  CHECK(open.probability(4) == 0);
  // no more is known of it than when it was given up, by how much the best one then led
  const auto lead = [](const auto& filter) { return filter.log_posterior(2) - filter.log_posterior(4); };
  CHECK(lead(open) > -std::log(HypothesisFilterSettings{}.least_probability));
  CHECK(lead(open) < 1000);
  CHECK(lead(after<OpenLoop<double>>(10)) == Approx(lead(open)));
  double total = open.probability_of_none();
  for (std::size_t k = 0; k < open.size(); ++k) {
    total += open.probability(k);
  }
  CHECK(total == Approx(1));

  HypothesisFilterSettings all_go_on;
  all_go_on.least_probability = 0;
  const auto pruned_none = after<OpenLoop<double>>(9, all_go_on);
  CHECK(pruned_none.running() == 5);
  CHECK(pruned_none.probability(2) == Approx(open.probability(2)).epsilon(1e-4));
}

TEST_CASE("hypothesis filter: a corrector that makes every hypothesis fit does not hide which one predicts") {
  HypothesisFilterSettings all_go_on;
  all_go_on.least_probability = 0;
  auto corrected = after<TransportCorrector<double>>(9, all_go_on);
  for (std::size_t k = 0; k < corrected.size(); ++k) {
    INFO(k);
    CHECK(corrected.report(k).posterior.iou() > 0.75);
  }
  CHECK(corrected.best() == 2);

  // the evidence is what was seen against what was predicted before the correction, cell by cell
  auto alone = falling_with<TransportCorrector<double>>(-4);
  FallingDust reality = falling_with<TransportCorrector<double>>(-2).model();
  double before = 0, after_it = 0;
  for (int frame = 1; frame <= 9; ++frame) {
    reality.step(1 / 30.0);
    const Mask mask = decant_test::seen(reality.dust);
    const std::vector<CameraMask> masks{{0, mask}};
    REQUIRE(alone.track({frame / 30.0, {}, masks}).status == FrameStatus::Ok);
    before += SilhouetteCells(20).squared_difference(alone.predicted_before(0), alone.observed(0));
    after_it += SilhouetteCells(20).squared_difference(alone.predicted(0), alone.observed(0));
  }
  CHECK(corrected.posterior().misfit(4).squared == Approx(before));
  CHECK(after_it < 0.5 * before);
}

TEST_CASE("hypothesis filter: what a scale or a probe reads counts beside the masks, or without any") {
  // a probe reads how high the dust is on average
  const auto height = [](const FallingDust& model) { return model.dust.position.row(2).mean(); };
  HypothesisFilterSettings settings;
  settings.posterior.none_prior = 0;
  HypothesisFilter<DustTracker<OpenLoop<double>>> filter(settings);
  const SeriesMisfit probe({.deviation = 0.002, .idle = height(falling_with<OpenLoop<double>>(0).model())});
  const std::size_t source = filter.add_source(probe.evidence(9));
  for (int gravity = 0; gravity <= 4; ++gravity) {
    filter.add(falling_with<OpenLoop<double>>(-gravity));
  }
  FallingDust reality = falling_with<OpenLoop<double>>(-2).model();
  std::vector<double> squared(5, 0.0);
  for (int frame = 1; frame <= 9; ++frame) {
    reality.step(1 / 30.0);
    REQUIRE(filter.track({frame / 30.0, {}, {}}).status == FrameStatus::Uncorrected);  // no mask at all
    for (std::size_t k = 0; k < filter.size(); ++k) {
      if (!filter.given_up(k)) {
        const double off = height(filter.tracker(k).model()) - height(reality);
        squared[k] += off * off / (0.002 * 0.002);
        filter.observe(k, probe.misfit(height(filter.tracker(k).model()), height(reality)), source);
      }
    }
  }
  CHECK(filter.best() == 2);
  CHECK(filter.probability(2) > 0.9);
  CHECK(filter.given_up(4));
  for (const std::size_t k : {1, 3}) {
    CHECK(filter.posterior().misfit(k, source).squared == Approx(squared[k]));
  }
  const double until_then = filter.posterior().misfit(4, source).squared;
  filter.observe(4, {1e9, 0}, source);  // nothing is left to learn about one that was given up
  CHECK(filter.posterior().misfit(4, source).squared == until_then);
}

TEST_CASE("hypothesis filter: before anything is seen there is the prior, and frames that are refused say nothing") {
  HypothesisFilterSettings one_is_right;
  one_is_right.posterior.none_prior = 0;
  HypothesisFilter<DustTracker<OpenLoop<double>>> filter(one_is_right);
  filter.add(falling_with<OpenLoop<double>>(-1), std::log(3.0));
  filter.add(falling_with<OpenLoop<double>>(-2));
  CHECK(filter.probability(0) == Approx(0.75));
  const Mask mask = decant_test::seen(FallingDust{}.dust), other = Mask::Zero(3, 3);
  const std::vector<CameraMask> masks{{0, mask}}, wrong{{0, other}};
  CHECK(filter.track({0.1, {}, {}}).status == FrameStatus::Uncorrected);  // no mask
  CHECK(filter.probability(0) == Approx(0.75));
  CHECK(filter.track({0.05, {}, masks}).status == FrameStatus::Late);
  CHECK(filter.track({0.2, {}, wrong}).status == FrameStatus::BadInput);
  CHECK(filter.probability(0) == Approx(0.75));
  CHECK(filter.running() == 2);
}

TEST_CASE("hypothesis filter: one whose model fails is given up, but not the last") {
  HypothesisFilter<DustTracker<OpenLoop<double>>> filter;
  filter.add(falling_with<OpenLoop<double>>(-1), 5);
  filter.add(falling_with<OpenLoop<double>>(-2));
  filter.tracker(0).model().broken = true;
  CHECK(filter.track({0.1, {}, {}}).status == FrameStatus::Uncorrected);  // of the one that is left
  CHECK(filter.report(0).status == FrameStatus::ModelFailed);
  CHECK(filter.given_up(0));
  CHECK(filter.log_posterior(0) == -std::numeric_limits<double>::infinity());
  CHECK(filter.probability(1) + filter.probability_of_none() == Approx(1));
  CHECK(filter.best() == 1);
  CHECK(filter.track({0.2, {}, {}}).advanced());
  filter.tracker(1).model().broken = true;
  CHECK(filter.track({0.3, {}, {}}).status == FrameStatus::ModelFailed);
  CHECK(filter.running() == 1);
  CHECK_THROWS_WITH(filter.tracker(0), decant_test::contains("one that was not given up"));
  HypothesisFilter<DustTracker<OpenLoop<double>>> empty;
  CHECK(empty.track({0.1, {}, {}}).status == FrameStatus::BadInput);
}

TEST_CASE("hypothesis filter: the same bits for 1, 2 and 4 threads", "[threads]") {
  HypothesisFilterSettings settings;
  settings.least_probability = 0;
  settings.threads = {1};
  const auto alone = after<TransportCorrector<double>>(3, settings);
  for (const int threads : {2, 4}) {
    settings.threads = {threads};
    const auto shared = after<TransportCorrector<double>>(3, settings);
    for (std::size_t k = 0; k < alone.size(); ++k) {
      CHECK(shared.log_posterior(k) == alone.log_posterior(k));
    }
  }
}

TEST_CASE("hypothesis filter: settings are checked") {
  using Filter = HypothesisFilter<DustTracker<OpenLoop<double>>>;
  HypothesisFilterSettings settings;
  settings.posterior.least_squared = 0;
  CHECK_THROWS_WITH(Filter(settings), decant_test::contains("least_squared must be > 0"));
  settings = {};
  settings.least_probability = 1;
  CHECK_THROWS_WITH(Filter(settings), decant_test::contains("in [0, 1)"));
  Filter filter;
  CHECK_THROWS_WITH(filter.add(falling_with<OpenLoop<double>>(0), -std::numeric_limits<double>::infinity()),
                    decant_test::contains("log_prior must be finite"));
}
