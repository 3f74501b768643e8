// SPDX-License-Identifier: MIT
#include <decant/tracking/image_likelihood.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "catch.hpp"

namespace {

using decant::agreement_schenck2017;
using decant::calibrate_image_likelihood;
using decant::ImageLikelihood;
using decant::Mask;
using decant::Overlap;

Overlap differing(std::int64_t compared, std::int64_t wrong) {
  return {.compared_px = compared, .predicted_px = wrong, .observed_px = 0, .both_px = 0};
}

}  // namespace

TEST_CASE("Image likelihood: the product over pixels, as printed") {
  Mask predicted(2, 3), observed(2, 3), seen(2, 3);
  predicted << 255, 255, 0, 0, 255, 0;
  observed << 255, 0, 0, 255, 255, 0;
  seen << 255, 255, 255, 0, 255, 255;
  for (const double delta : {0.500001, agreement_schenck2017, 0.6, 0.9, 0.999}) {
    const ImageLikelihood model({.agreement = delta});
    double product = 1, product_of_seen = 1;
    for (Eigen::Index i = 0; i < 6; ++i) {
      const double factor = predicted.data()[i] == observed.data()[i] ? delta : 1 - delta;
      product *= factor;
      product_of_seen *= seen.data()[i] == 255 ? factor : 1;
    }
    CHECK(model.log_likelihood(predicted, observed) == Approx(std::log(product)).epsilon(1e-12));
    CHECK(model.log_likelihood(predicted, observed, seen) == Approx(std::log(product_of_seen)).epsilon(1e-12));
    CHECK(model.log_likelihood(decant::overlap(predicted, observed)) == model.log_likelihood(predicted, observed));
    CHECK(model.log_likelihood(observed, predicted) == model.log_likelihood(predicted, observed));
    CHECK(model.nats_per_pixel() == Approx(std::log(delta / (1 - delta))).epsilon(1e-9));
  }
}

TEST_CASE("Image likelihood: nothing underflows at any agreement") {
  const Mask liquid = Mask::Constant(480, 640, 255);
  const Mask none = Mask::Zero(480, 640);
  for (const double delta : {std::nextafter(0.5, 1.0), 0.75, 0.999999, std::nextafter(1.0, 0.0)}) {
    const ImageLikelihood model({.agreement = delta});
    // the smallest and the largest agreement are one rounding from 1/2 and 1
    CHECK(model.log_likelihood(liquid, liquid) == Approx(307200 * std::log(delta)).epsilon(1e-12));
    CHECK(model.log_likelihood(liquid, none) == Approx(307200 * std::log(1 - delta)).epsilon(1e-12));
    CHECK(std::isfinite(model.log_likelihood(liquid, none)));
    CHECK(model.log_likelihood(liquid, liquid) > model.log_likelihood(liquid, none));
    CHECK(model.log_likelihood(liquid, liquid) <= 0);
  }
}

TEST_CASE("Image likelihood: the paper's agreement makes a nat of 25,000 pixels") {
  const ImageLikelihood paper;
  CHECK(paper.settings().agreement == 0.50001);
  CHECK(paper.settings().pixels_per_error == 1);
  CHECK(1 / paper.nats_per_pixel() == Approx(25000).epsilon(1e-6));
  const double better = paper.log_likelihood(differing(307200, 1000));
  const double worse = paper.log_likelihood(differing(307200, 26000));
  // sums of 2e5, of which 1e-16 is rounding
  CHECK(better - worse == Approx(1).epsilon(1e-6));
  CHECK(std::exp(307200 * paper.nats_per_pixel()) < std::exp(13.0));
}

TEST_CASE("Image likelihood: ranks by the number of differing pixels, whatever the settings") {
  for (const double delta : {agreement_schenck2017, 0.7, 0.98}) {
    for (const double clump : {1.0, 30.0, 1e5}) {
      const ImageLikelihood model({.agreement = delta, .pixels_per_error = clump});
      double last = std::numeric_limits<double>::infinity();
      for (std::int64_t wrong = 0; wrong <= 10000; wrong += 500) {
        const double now = model.log_likelihood(differing(10000, wrong));
        CHECK(now < last);
        last = now;
      }
    }
  }
}

TEST_CASE("Image likelihood: pixels that err together count as one") {
  const ImageLikelihood independent({.agreement = 0.97});
  const ImageLikelihood clumped({.agreement = 0.97, .pixels_per_error = 64});
  // the same masks, seen with 64 times as many pixels, carry the same evidence
  CHECK(clumped.log_likelihood(differing(64 * 4800, 64 * 100)) ==
        Approx(independent.log_likelihood(differing(4800, 100))).epsilon(1e-12));
  CHECK(clumped.nats_per_pixel() == Approx(independent.nats_per_pixel() / 64).epsilon(1e-12));
}

TEST_CASE("Image likelihood: nothing seen is no evidence, and what cannot be compared is none either") {
  const ImageLikelihood model({.agreement = 0.9});
  const Mask some = Mask::Constant(3, 3, 255);
  CHECK(model.log_likelihood(some, some, Mask::Zero(3, 3)) == 0);
  CHECK(model.log_likelihood(Mask(), Mask()) == 0);
  CHECK(std::isnan(model.log_likelihood(some, Mask::Constant(1, 9, 255))));
  CHECK(std::isnan(model.log_likelihood(some, some, Mask::Constant(1, 9, 255))));
}

TEST_CASE("Image likelihood: settings are checked") {
  using Catch::Matchers::StartsWith;
  const double nan_ = std::numeric_limits<double>::quiet_NaN();
  const double infinite = std::numeric_limits<double>::infinity();
  for (const double bad : {nan_, 0.5, 1.0, 0.0, -0.6, 1.5, infinite}) {
    CHECK_THROWS_WITH(ImageLikelihood({.agreement = bad}),
                      StartsWith("ImageLikelihood: agreement must be in (0.5, 1), got "));
  }
  for (const double bad : {nan_, 0.0, 0.999, -3.0, infinite}) {
    CHECK_THROWS_WITH(ImageLikelihood({.pixels_per_error = bad}),
                      StartsWith("ImageLikelihood: pixels_per_error must be >= 1 and finite, got "));
  }
  CHECK_THROWS_AS(ImageLikelihood({.agreement = 0.5}), std::invalid_argument);
}

TEST_CASE("Image likelihood: calibration finds how often and how together pixels err") {
  std::mt19937 random(5);
  for (const std::int64_t clump : {1, 25, 400}) {
    // 400 frames of 2,000 clumps of which 3 % are wrong as a whole
    std::binomial_distribution<std::int64_t> wrong_clumps(2000, 0.03);
    std::vector<Overlap> frames;
    for (int k = 0; k < 400; ++k) {
      frames.push_back(differing(2000 * clump, wrong_clumps(random) * clump));
    }
    frames.push_back({.comparable = false});
    frames.push_back({});
    const auto found = calibrate_image_likelihood(frames);
    REQUIRE(found);
    INFO("clumps of " << clump << " pixels");
    CHECK(found->agreement == Approx(0.97).margin(4 * std::sqrt(0.03 * 0.97 / (400 * 2000))));  // four deviations
    // chi-squared with 399 degrees of freedom varies by sqrt(2 / 399) = 7 %; again four deviations
    CHECK(found->pixels_per_error == Approx(static_cast<double>(clump)).epsilon(0.28));
    CHECK_NOTHROW(ImageLikelihood(*found));
  }
}

TEST_CASE("Image likelihood: calibrated odds come true") {
  // Clumps of 50 pixels err with 10 %. Two predictions differ in six clumps: of these, one errs where the other does
  // not. Bayes' rule over clumps says how sure one may be of the right one; pixels taken one by one claim far more.
  std::mt19937 random(8);
  const std::int64_t clump = 50, clumps = 1200, apart = 6;
  std::bernoulli_distribution errs(0.1);
  std::vector<Overlap> right;
  for (int k = 0; k < 500; ++k) {
    std::int64_t wrong = 0;
    for (std::int64_t c = 0; c < clumps; ++c) {
      wrong += errs(random) ? clump : 0;
    }
    right.push_back(differing(clumps * clump, wrong));
  }
  const auto settings = calibrate_image_likelihood(right);
  REQUIRE(settings);
  const ImageLikelihood calibrated(*settings), naive({.agreement = settings->agreement});
  double claimed = 0, score = 0, score_naive = 0;
  const int scenes = 4000;
  for (int k = 0; k < scenes; ++k) {
    // where the two differ, `apart` clumps; the right one errs in some of them, and there the wrong one is right
    std::int64_t wrong = 0;
    for (std::int64_t c = 0; c < apart; ++c) {
      wrong += errs(random) ? 1 : 0;
    }
    const auto posterior = [&](const ImageLikelihood& model) {
      const double a = model.log_likelihood(differing(apart * clump, wrong * clump));
      const double b = model.log_likelihood(differing(apart * clump, (apart - wrong) * clump));
      return 1 / (1 + std::exp(b - a));
    };
    claimed += posterior(calibrated) / scenes;
    score += std::log(posterior(calibrated)) / scenes;
    score_naive += std::log(std::max(1e-300, posterior(naive))) / scenes;
  }
  // the exact posterior, from the clumps themselves, averaged over what the right prediction may see
  double exact = 0, exact_score = 0;
  for (int wrong = 0; wrong <= apart; ++wrong) {
    const double ways = std::tgamma(apart + 1.0) / (std::tgamma(wrong + 1.0) * std::tgamma(apart - wrong + 1.0));
    const double chance = ways * std::pow(0.1, wrong) * std::pow(0.9, apart - wrong);
    const double p = 1 / (1 + std::pow(9.0, 2 * wrong - apart));
    exact += chance * p;
    exact_score += chance * std::log(p);
  }
  // posteriors spread by 0.05, their logarithms by 0.3: over 4000 scenes 0.001 and 0.005; the calibration's own error
  // of 6 % (500 frames) moves them by as much again and more
  CHECK(claimed == Approx(exact).margin(0.01));
  CHECK(score == Approx(exact_score).margin(0.02));
  CHECK(score_naive < 3 * score);  // punished for being sure where it is wrong
}

TEST_CASE("Image likelihood: calibration needs frames, errors, and mostly right predictions") {
  CHECK_FALSE(calibrate_image_likelihood({}));
  const std::vector<Overlap> one = {differing(1000, 10)};
  const std::vector<Overlap> perfect = {differing(1000, 0), differing(1000, 0)};
  const std::vector<Overlap> wrong = {differing(1000, 500), differing(1000, 500)};
  const std::vector<Overlap> alike = {differing(1000, 100), differing(1000, 100)};
  CHECK_FALSE(calibrate_image_likelihood(one));
  CHECK_FALSE(calibrate_image_likelihood(perfect));
  CHECK_FALSE(calibrate_image_likelihood(wrong));
  REQUIRE(calibrate_image_likelihood(alike));
  CHECK(calibrate_image_likelihood(alike)->pixels_per_error == 1);
  // by hand: 90 and 110 of 1000, variance 1000 * 0.1 * 0.9 = 90: (100 + 100) / 90
  const std::vector<Overlap> two = {differing(1000, 90), differing(1000, 110)};
  CHECK(calibrate_image_likelihood(two)->pixels_per_error == Approx(200.0 / 90));
  CHECK(calibrate_image_likelihood(two)->agreement == Approx(0.9));
}
