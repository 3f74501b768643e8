// SPDX-License-Identifier: MIT

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <decant/hypothesis/posterior.hpp>
#include <decant/hypothesis/series_misfit.hpp>
#include <decant/hypothesis/value_estimate.hpp>

#include "catch.hpp"

using namespace decant;

namespace {

const double missing = std::numeric_limits<double>::quiet_NaN();

/// Normal noise of deviation 1 in which each value keeps a share of the one before.
std::vector<double> remembering_noise(std::size_t count, double share, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> noise{normal(random)};
  while (noise.size() < count) {
    noise.push_back(share * noise.back() + std::sqrt(1 - share * share) * normal(random));
  }
  return noise;
}

}  // namespace

TEST_CASE("series misfit: squared deviations of independent errors") {
  const SeriesMisfit grams({.deviation = 2, .readings_per_error = 5, .idle = 100});
  const Misfit one = grams.misfit(114, 110);
  CHECK(one.squared == Approx(4.0 / 5));  // two deviations off, a fifth of an error
  CHECK(one.measured == Approx(25.0 / 5));
  CHECK(grams.misfit(114, missing).squared == 0);
  CHECK(grams.misfit(114, missing).measured == 0);
  CHECK_FALSE(std::isfinite(grams.misfit(missing, 110).squared));

  const std::vector<double> predicted{101, 104, 110}, measured{100, missing, 106};
  const Misfit sum = grams.misfit(predicted, measured);
  CHECK(sum.squared == Approx((0.25 + 4) / 5));
  CHECK(sum.measured == Approx(9.0 / 5));
  const EvidenceSettings evidence = grams.evidence(100);
  CHECK(evidence.independent_errors == Approx(20));
  CHECK(evidence.least_squared == Approx(20));
  CHECK(grams.evidence(3).independent_errors == 1);
}

TEST_CASE("series misfit: where predictions are as good as the sensor it is the sensor's normal likelihood") {
  // n ln(1 + D / n) = D to within D / 2n: 200 readings, of which the hypotheses are off by 0.1 and 0.3 deviations
  const SeriesMisfit level({.deviation = 0.001});
  const EvidenceSettings worth = level.evidence(200);
  Posterior posterior({worth.independent_errors, worth.least_squared, worth.hopeless_share});
  for (const double off : {0.0001, 0.0003}) {
    const std::size_t hypothesis = posterior.add();
    for (int reading = 0; reading < 200; ++reading) {
      posterior.observe(hypothesis, level.misfit(0.05 + off, 0.05));
    }
  }
  const double normal = 0.5 * 200 * (0.3 * 0.3 - 0.1 * 0.1);
  CHECK(posterior.log_posterior(0) - posterior.log_posterior(1) == Approx(normal).epsilon(0.05));
  CHECK(posterior.probability(0) > 0.99);
}

TEST_CASE("series misfit: one reading, with a deviation that was measured on a few others, has Student's density") {
  const SeriesMisfit level({.deviation = 2, .measured_on = 8});
  const EvidenceSettings worth = level.evidence(1);
  std::vector<double> values, log_density;
  const Posterior posterior({worth.independent_errors, worth.least_squared, worth.hopeless_share});
  for (double value = -40; value <= 60; value += 0.5) {
    values.push_back(value);
    log_density.push_back(posterior.log_likelihood(level.misfit(value, 10).squared));
  }
  const ValueEstimate estimate = estimate_value(values, log_density);
  CHECK(estimate.low == Approx(10 - 2 * 1.860).margin(0.05));  // t of 0.95 with 8 degrees of freedom
  CHECK(estimate.high == Approx(10 + 2 * 1.860).margin(0.05));
}

TEST_CASE("series misfit: a sensor that is asked twice as often says no more if its readings err together") {
  const auto lead = [](int times_as_often) {
    const SeriesMisfit mass({.deviation = 0.002, .readings_per_error = 4.0 * times_as_often});
    const EvidenceSettings worth = mass.evidence(80 * times_as_often);
    Posterior posterior({worth.independent_errors, worth.least_squared, worth.hopeless_share});
    posterior.add();
    posterior.add();
    for (int k = 0; k < 80 * times_as_often; ++k) {
      const double now = 0.1 * (k / times_as_often) / 80;
      posterior.observe(0, mass.misfit(1.02 * now + 0.001, now));
      posterior.observe(1, mass.misfit(1.10 * now + 0.001, now));
    }
    return posterior.log_posterior(0) - posterior.log_posterior(1);
  };
  CHECK(lead(2) == Approx(lead(1)));
  CHECK(lead(1) > 1);
}

TEST_CASE("series misfit: how many readings err together") {
  CHECK(readings_per_error(remembering_noise(20000, 0, 1)) == Approx(1).margin(0.1));
  for (const double share : {0.5, 0.9}) {
    INFO(share);
    const double expected = (1 + share) / (1 - share);  // 1 + 2 sum_k share^k
    // relative deviation of an estimate with a window of a few tau over 2e5 readings: below sqrt(2 x 5 tau / 2e5) = 3 %
    CHECK(readings_per_error(remembering_noise(200000, share, 2)) == Approx(expected).epsilon(0.1));
    std::vector<double> gaps = remembering_noise(200000, share, 3);
    std::mt19937 random(4);
    for (double& value : gaps) {
      value = random() % 4 == 0 ? missing : value;
    }
    CHECK(readings_per_error(gaps) == Approx(expected).epsilon(0.1));
  }
  // held for 8 readings each: 1 + 2 sum_k (1 - k / 8) = 8
  std::vector<double> held;
  for (const double value : remembering_noise(20000, 0, 5)) {
    held.insert(held.end(), 8, value);
  }
  CHECK(readings_per_error(held) == Approx(8).epsilon(0.05));
  // what is off by the same throughout is one error
  CHECK(readings_per_error(std::vector<double>(50, 0.3)) == Approx(50));
  CHECK(readings_per_error(std::vector<double>(50, 0.0)) == 1);
  CHECK(readings_per_error(std::vector<double>(50, missing)) == 1);
  CHECK(readings_per_error({}) == 1);
}

TEST_CASE("series misfit: numbers out of range are refused") {
  CHECK_THROWS_WITH(SeriesMisfit({.deviation = 0}), Catch::Contains("deviation"));
  CHECK_THROWS_WITH(SeriesMisfit({.readings_per_error = 0.5}), Catch::Contains("readings_per_error"));
  CHECK_THROWS_WITH(SeriesMisfit({.measured_on = -1}), Catch::Contains("measured_on"));
  CHECK_THROWS_WITH(SeriesMisfit({.idle = missing}), Catch::Contains("idle"));
  CHECK_THROWS_WITH(SeriesMisfit(ChannelNoise{}).evidence(0), Catch::Contains("readings"));
  const std::vector<double> two{1, 2}, three{1, 2, 3};
  CHECK_THROWS_WITH(SeriesMisfit(ChannelNoise{}).misfit(two, three), Catch::Contains("number of predictions"));
}
