// SPDX-License-Identifier: MIT

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
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
HypothesisFilter<DustTracker<CorrectorType>> after(int frames, HypothesisFilterSettings settings = {},
                                                   ThreadExecutor executor = {}) {
  settings.posterior.least_squared = 0.5;  // dust is thin, and its model right to the last bit
  settings.error_correlation_time = 0;     // and few frames are enough
  HypothesisFilter<DustTracker<CorrectorType>> filter(settings, executor);
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

TEST_CASE("hypothesis filter: what is seen for longer says more, up to what a model errs in all") {
  HypothesisFilterSettings settings;
  settings.least_probability = 0;
  settings.posterior.none_prior = 0;
  settings.error_correlation_time = 0.04;
  const auto errors_after = [&](int dark_frames, int frames) {
    HypothesisFilter<DustTracker<OpenLoop<double>>> filter(settings);
    filter.add(falling_with<OpenLoop<double>>(-1));
    filter.add(falling_with<OpenLoop<double>>(-2));
    FallingDust reality = falling_with<OpenLoop<double>>(-2).model();
    for (int frame = 1; frame <= dark_frames + frames; ++frame) {
      reality.step(1 / 60.0);
      const Mask mask = decant_test::seen(reality.dust);
      const std::vector<CameraMask> masks{{0, mask}}, none;
      REQUIRE(filter.track({frame / 60.0, {}, frame > dark_frames ? masks : none}).advanced());
    }
    CHECK(filter.seen_seconds() == Approx((frames - (dark_frames == 0 ? 1 : 0)) / 60.0));
    // the odds are what that many errors make of misfits so far
    const double n = filter.posterior().source(0).independent_errors, least = settings.posterior.least_squared;
    CHECK(filter.log_posterior(1) - filter.log_posterior(0) ==
          Approx(0.5 * n *
                 std::log((least + filter.posterior().misfit(0).squared) /
                          (least + filter.posterior().misfit(1).squared))));
    return n;
  };
  CHECK(errors_after(0, 1) == Approx(1));  // for how long the first frame's liquid was there is not known
  CHECK(errors_after(0, 13) == Approx(1 + 12 / 60.0 / 0.04));
  CHECK(errors_after(7, 6) == Approx(1 + 6 / 60.0 / 0.04));  // before that nobody looked
  HypothesisFilter<DustTracker<OpenLoop<double>>> told(settings);
  told.add(falling_with<OpenLoop<double>>(-2));
  told.set_source(0, {1.5, 7, 0.5});
  FallingDust reality = falling_with<OpenLoop<double>>(-2).model();
  for (int frame = 1; frame <= 3; ++frame) {
    CHECK(told.posterior().source(0).independent_errors == (frame < 3 ? 1 : 1.5));
    reality.step(1 / 30.0);
    const Mask mask = decant_test::seen(reality.dust);
    const std::vector<CameraMask> masks{{0, mask}};
    REQUIRE(told.track({frame / 30.0, {}, masks}).advanced());
    CHECK(told.posterior().source(0).least_squared == 7);
    CHECK(told.posterior().source(0).hopeless_share == 0.5);
  }
  settings.posterior.independent_errors = 4;
  CHECK(errors_after(0, 13) == 4);
  settings.error_correlation_time = 0;
  CHECK(errors_after(0, 1) == 4);
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

TEST_CASE("hypothesis filter: a hypothesis about a part of the picture neither sees nor counts the rest") {
  const PixelBox part{60, 0, 140, 120};  // all of the dust, and whole cells
  HypothesisFilterSettings settings;
  settings.least_probability = 0;
  HypothesisFilter<DustTracker<OpenLoop<double>>> filter(settings);
  filter.add(falling_with<OpenLoop<double>>(-1), 0, {part});
  filter.add(falling_with<OpenLoop<double>>(-1), 0, {PixelBox{500, 500, 600, 600}});  // nowhere
  auto alone = falling_with<OpenLoop<double>>(-1);
  FallingDust reality = falling_with<OpenLoop<double>>(-2).model();
  double squared = 0, measured = 0;
  for (int frame = 1; frame <= 5; ++frame) {
    reality.step(1 / 30.0);
    Mask mask = decant_test::seen(reality.dust);
    const std::vector<CameraMask> only{{0, mask}};
    REQUIRE(alone.track({frame / 30.0, {}, only}).status == FrameStatus::Ok);
    const auto of = [&](const Mask& whole) -> Mask { return whole.block(0, 60, 120, 80); };
    squared += SilhouetteCells(20).squared_difference(of(alone.predicted_before(0)), of(alone.observed(0)));
    measured += SilhouetteCells(20).shares(of(alone.observed(0))).square().sum();
    // somebody else's liquid beside it
    mask.block(0, 0, 100, 60).setConstant(255);
    mask.block(130, 80, 30, 60).setConstant(255);
    const std::vector<CameraMask> masks{{0, mask}};
    REQUIRE(filter.track({frame / 30.0, {}, masks}).status == FrameStatus::Ok);
    CHECK((filter.tracker(0).observed(0).leftCols(60) == 0).all());
    CHECK((filter.tracker(0).observed(0).bottomRows(40) == 0).all());
  }
  REQUIRE(measured > 5);
  REQUIRE(squared > 1);
  CHECK(filter.posterior().misfit(0).squared == Approx(squared).epsilon(1e-12));
  CHECK(filter.posterior().misfit(0).measured == Approx(measured).epsilon(1e-12));
  CHECK(filter.posterior().misfit(1).measured == 0);
  CHECK(filter.posterior().misfit(1).squared == 0);  // its dust is predicted elsewhere
  CHECK_THROWS_WITH(filter.add(falling_with<OpenLoop<double>>(0), 0, {part, part}),
                    decant_test::contains("as many as the tracker has"));
}

TEST_CASE("hypothesis filter: a hypothesis may be given up by its user") {
  auto filter = after<OpenLoop<double>>(2);
  const double behind = filter.log_posterior(2) - filter.log_posterior(3);
  REQUIRE(filter.running() == 5);
  filter.give_up(3);
  CHECK(filter.running() == 4);
  CHECK(filter.given_up(3));
  CHECK(filter.probability(3) == 0);
  CHECK(filter.log_posterior(filter.best()) - filter.log_posterior(3) ==
        Approx(behind + filter.log_posterior(filter.best()) - filter.log_posterior(2)));
  CHECK_NOTHROW(filter.give_up(3));
}

TEST_CASE("hypothesis filter: ten thousand frames do not underflow, whatever the paper's delta is") {
  // A few grains that stay where they are, where a second hypothesis has them three pixels to the right
  const auto resting = [](double to_the_right, double agreement) {
    FallingDust model;
    model.dust = decant_test::liquid_block<double>({to_the_right, 0, 0}, 1);
    model.gravity = 0;
    TrackerSettings settings;
    settings.least_pixels = 1;
    settings.likelihood.agreement = agreement;
    settings.threads = {1};
    DustTracker<OpenLoop<double>> tracker(model, {}, settings);
    tracker.add_camera({PinholeCamera(150, 150, 19.5, 14.5, 40, 30), {}}, decant_test::before_the_block());
    return tracker;
  };
  for (const double agreement : {agreement_schenck2017, 0.999}) {
    HypothesisFilterSettings settings;
    settings.least_probability = 0;
    HypothesisFilter<DustTracker<OpenLoop<double>>> filter(settings);
    filter.add(resting(0, agreement));
    filter.add(resting(0.01, agreement));
    auto seen_by = resting(0, agreement);
    Mask mask;
    seen_by.predict(seen_by.model(), 0, mask);
    mask(0, 0) = mask(29, 39) = 255;
    const std::vector<CameraMask> masks{{0, mask}};
    std::array<double, 2> log_likelihood{};
    for (int frame = 1; frame <= 10000; ++frame) {
      REQUIRE(filter.track({frame / 30.0, {}, masks}).status == FrameStatus::Ok);
      log_likelihood[0] += filter.report(0).log_likelihood;
      log_likelihood[1] += filter.report(1).log_likelihood;
    }
    // as printed, each pixel of each frame a factor of its own: the product of them all would be 0
    for (std::size_t k = 0; k < 2; ++k) {
      const Mask &predicted = filter.tracker(k).predicted_before(0), &observed = filter.tracker(k).observed(0);
      double of_one_frame = 0;
      for (Index i = 0; i < predicted.size(); ++i) {
        of_one_frame += std::log(predicted.data()[i] == observed.data()[i] ? agreement : 1 - agreement);
      }
      CHECK(log_likelihood[k] == Approx(10000 * of_one_frame).epsilon(1e-9));
      CHECK(std::exp(log_likelihood[1]) == 0);
      CHECK(std::isfinite(filter.log_posterior(k)));
    }
    CHECK(log_likelihood[0] > log_likelihood[1]);
    CHECK(filter.probability(0) + filter.probability(1) + filter.probability_of_none() == Approx(1));
    CHECK(filter.probability(0) > 0.99);
    CHECK(filter.log_posterior(1) > -1000);
  }
}

TEST_CASE("hypothesis filter: its reports are the trackers' own") {
  auto alone = falling_with<TransportCorrector<double>>(-1);
  HypothesisFilter<DustTracker<TransportCorrector<double>>> filter;
  filter.add(falling_with<TransportCorrector<double>>(-1));
  FallingDust reality = falling_with<OpenLoop<double>>(-2).model();
  for (int frame = 1; frame <= 6; ++frame) {
    reality.step(1 / 30.0);
    const Mask mask = decant_test::seen(reality.dust);
    const std::vector<CameraMask> masks{{0, mask}};
    const FrameReport own = alone.track({frame / 30.0, {}, masks});
    REQUIRE(filter.track({frame / 30.0, {}, masks}).status == FrameStatus::Ok);
    const FrameReport& told = filter.report(0);
    CHECK(told.status == own.status);
    CHECK(told.time == own.time);
    for (const auto& [one, other] : {std::pair(told.prior, own.prior), std::pair(told.posterior, own.posterior)}) {
      CHECK(one.compared_px == other.compared_px);
      CHECK(one.predicted_px == other.predicted_px);
      CHECK(one.observed_px == other.observed_px);
      CHECK(one.both_px == other.both_px);
      CHECK(one.comparable == other.comparable);
    }
    CHECK(told.log_likelihood == own.log_likelihood);
    CHECK(own.correction.moved > 0);
    CHECK(told.correction.moved == own.correction.moved);
    CHECK(told.correction.mean_shift == own.correction.mean_shift);
    CHECK(told.correction.relocated == own.correction.relocated);
    CHECK(told.relocated_volume == own.relocated_volume);
    for (const double wall_time : {told.physics_ms, told.drawing_ms, told.correction_ms, told.relaxation_ms}) {
      CHECK(wall_time > 0);
    }
  }
}

TEST_CASE("hypothesis filter: the same bits for 1, 2 and 4 threads", "[threads]") {
  HypothesisFilterSettings settings;
  settings.least_probability = 0;
  const auto alone = after<TransportCorrector<double>>(3, settings, {{1}});
  for (const int threads : {2, 4}) {
    const auto shared = after<TransportCorrector<double>>(3, settings, {{threads}});
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
  settings = {};
  settings.error_correlation_time = -0.1;
  CHECK_THROWS_WITH(Filter(settings), decant_test::contains("error_correlation_time must be >= 0"));
  Filter filter;
  CHECK(filter.add([] { return falling_with<OpenLoop<double>>(0); }) == 0);
  CHECK(filter.has_tracker(0));
  CHECK_THROWS_WITH(filter.add(falling_with<OpenLoop<double>>(0), -std::numeric_limits<double>::infinity()),
                    decant_test::contains("log_prior must be finite"));
  CHECK(filter.size() == 1);
  const Mask mask = decant_test::seen(FallingDust{}.dust);
  const std::vector<CameraMask> masks{{0, mask}};
  CHECK(filter.track({0.1, {}, masks}).advanced());  // what was refused left nothing behind
}
