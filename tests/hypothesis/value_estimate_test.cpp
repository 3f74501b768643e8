// SPDX-License-Identifier: MIT

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <decant/hypothesis/value_estimate.hpp>

#include "catch.hpp"

using namespace decant;

TEST_CASE("value estimate: a normal density, known at values a deviation apart") {
  for (const double center : {10.0, 10.2, 10.5, 10.77}) {
    std::vector<double> values, log_density;
    for (int k = 0; k <= 20; ++k) {
      values.push_back(k);
      log_density.push_back(500 - 0.5 * (k - center) * (k - center));  // any constant will do
    }
    INFO(center);
    const ValueEstimate estimate = estimate_value(values, log_density, 0.9);
    CHECK(estimate.mean == Approx(center).margin(0.01));
    CHECK(estimate.median == Approx(center).margin(0.01));
    CHECK(estimate.low == Approx(center - 1.6449).margin(0.01));  // of the normal distribution
    CHECK(estimate.high == Approx(center + 1.6449).margin(0.01));
    CHECK_FALSE(estimate.at_end);
  }
}

TEST_CASE("value estimate: even density between uneven values, and what lies at an end") {
  const std::vector<double> values{1, 2, 5}, even{3, 3, 3}, rising{-100, -50, 0};
  const ValueEstimate flat = estimate_value(values, even, 0.5);
  CHECK(flat.mean == Approx(3).margin(0.02));
  CHECK(flat.low == Approx(2).margin(0.02));
  CHECK(flat.high == Approx(4).margin(0.02));
  CHECK(estimate_value(values, even, 0.9).at_end);
  const ValueEstimate beyond = estimate_value(values, rising);
  CHECK(beyond.at_end);
  CHECK(beyond.low > 4.5);
  const std::vector<double> one{7}, any{-3};
  CHECK(estimate_value(one, any).mean == 7);
  CHECK(estimate_value(one, any).at_end);
}

TEST_CASE("value estimate: a value beside others that are impossible stays within half a gap, evenly") {
  const double never = -std::numeric_limits<double>::infinity();
  const std::vector<double> values{1, 2, 3, 4, 5}, log_density{never, never, 0, never, never};
  const ValueEstimate estimate = estimate_value(values, log_density);
  CHECK(estimate.mean == Approx(3).margin(1e-9));
  CHECK(estimate.low > 2.5);
  CHECK(estimate.high < 3.5);
  CHECK_FALSE(estimate.at_end);
  // two that are as probable, and one impossible next to them: nothing beyond the two
  const std::vector<double> two{never, -1, 0, -2, never};
  CHECK(estimate_value(values, two).low > 1.5);
  CHECK(estimate_value(values, two).high < 4.5);
}

TEST_CASE("value estimate: shares of a normal density, and back") {
  std::vector<double> values, log_density;
  for (int k = 0; k <= 20; ++k) {
    values.push_back(k);
    log_density.push_back(-0.5 * (k - 9.3) * (k - 9.3) / 4);
  }
  const ValueDensity density(values, log_density);
  for (const double z : {-2.0, -1.0, 0.0, 0.5, 1.5}) {
    const double share = 0.5 * std::erfc(-z / std::sqrt(2.0));
    CHECK(density.share_below(9.3 + 2 * z) == Approx(share).margin(0.002));
    CHECK(density.quantile(share) == Approx(9.3 + 2 * z).margin(0.02));
  }
  CHECK(density.share_below(-1) == 0);
  CHECK(density.share_below(20) == 1);
}

TEST_CASE("value estimate: a density as a curve") {
  // a deviation of 2 in steps of 1, but for an end where there is next to nothing
  std::vector<double> values, log_density;
  for (const double value : {0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 18, 20}) {
    values.push_back(value);
    log_density.push_back(3 - 0.5 * (value - 9.3) * (value - 9.3) / 4);
  }
  const ValueDensity density(values, log_density);
  const double highest = 1 / std::sqrt(8 * std::acos(-1.0));
  double total = 0;
  for (double value = 0.005; value < 20; value += 0.01) {
    const double z = (value - 9.3) / 2;
    CHECK(density.density(value) == Approx(highest * std::exp(-0.5 * z * z)).margin(0.01 * highest));
    total += 0.01 * density.density(value);
  }
  CHECK(total == Approx(1).margin(1e-3));
  CHECK(density.density(-0.1) == 0);
  CHECK(density.density(20.1) == 0);
  CHECK(density.density(20) >= 0);
  const std::vector<double> one{7}, any{-3};
  CHECK(ValueDensity(one, any).density(7) == 0);
  CHECK(estimate_value(density, 0.5).high == estimate_value(values, log_density, 0.5).high);
}

TEST_CASE("value estimate: what is most probable at an end is in its interval") {
  std::vector<double> values, falling, rising;
  for (int k = 0; k <= 10; ++k) {
    values.push_back(k);
    falling.push_back(-k);
    rising.push_back(k);
  }
  const double expected = std::log(10.0);  // an exponential density has a tenth beyond
  const ValueEstimate empty = estimate_value(values, falling), full = estimate_value(values, rising);
  CHECK(empty.low == 0);
  CHECK(empty.median == Approx(std::log(2.0)).margin(0.02));
  CHECK(empty.mean == Approx(1).margin(0.02));
  CHECK(empty.high == Approx(expected).margin(0.02));
  CHECK(full.high == 10);
  CHECK(full.low == Approx(10 - expected).margin(0.02));
  CHECK(empty.at_end);
  CHECK(full.at_end);
}

TEST_CASE("value estimate: an interval reaches the end also where the density is flat there") {
  std::vector<double> values, log_density;
  for (int k = 0; k <= 20; ++k) {
    values.push_back(k);
    log_density.push_back(-0.5 * k * k / 9.0);  // half of a normal density of deviation 3
  }
  for (const auto& [confidence, deviations] : {std::pair(0.5, 0.6745), {0.9, 1.6449}, {0.95, 1.96}, {0.99, 2.5758}}) {
    const ValueEstimate estimate = estimate_value(values, log_density, confidence);
    CHECK(estimate.low == 0);
    CHECK(estimate.high == Approx(3 * deviations).margin(0.05));
  }
}

TEST_CASE("value estimate: an error beside what is known widens a density") {
  std::vector<double> values, log_density;
  for (int k = 0; k <= 40; ++k) {
    values.push_back(0.025 * k);
    log_density.push_back(-0.5 * std::pow((values.back() - 0.4) / 0.05, 2));
  }
  const decant::ValueDensity known(values, log_density);
  // variances add up
  const decant::ValueDensity wide = decant::smeared(known, [](double) { return 0.12; });
  CHECK(wide.quantile(0.5) == Approx(0.4).epsilon(0.01));
  CHECK(wide.quantile(0.84134) - wide.quantile(0.15866) == Approx(2 * 0.13).epsilon(0.02));
  // by what may be an error there: none above a half, where nothing changes but by the grid's width
  const decant::ValueDensity partly = decant::smeared(known, [](double value) { return value < 0.4 ? 0.1 : 0.0; });
  CHECK(partly.quantile(0.02) < known.quantile(0.02) - 0.05);
  CHECK(decant::smeared(known, [](double) { return 0.0; }).quantile(0.9) == Approx(known.quantile(0.9)).epsilon(0.01));
  // what is most probable at an end is so afterwards, and even densities stay even
  const std::vector<double> three{0, 0.5, 1}, rising{-4, -2, 0}, even{0, 0, 0};
  const decant::ValueDensity open(three, rising);
  CHECK(decant::smeared(open, [](double value) { return std::max(0.05, 0.2 * (1 - value)); }).interval(0.9).second ==
        1);
  const decant::ValueDensity flat = decant::smeared(decant::ValueDensity(three, even), [](double) { return 0.1; });
  CHECK(flat.quantile(0.05) == Approx(0.05).epsilon(0.02));
  CHECK(flat.density(0) == Approx(1).epsilon(0.02));
  // what is certain stays so
  const std::vector<double> one{3}, certain{0};
  CHECK(decant::smeared(decant::ValueDensity(one, certain), [](double) { return 1.0; }).quantile(0.3) == 3);
  CHECK(decant::smeared(known, [](double) { return 100.0; }).range() == std::pair(0.0, 1.0));
}

TEST_CASE("value estimate: refuses what is no density") {
  const std::vector<double> values{1, 2}, falling{2, 1}, numbers{0, 0}, one{0}, none{};
  const std::vector<double> nowhere(2, -std::numeric_limits<double>::infinity()), broken{0, std::nan("")};
  CHECK_THROWS_WITH(estimate_value(none, none), decant_test::contains("at least 1"));
  CHECK_THROWS_WITH(estimate_value(values, one), decant_test::contains("that of values"));
  CHECK_THROWS_WITH(estimate_value(falling, numbers), decant_test::contains("increasing"));
  CHECK_THROWS_WITH(estimate_value(values, nowhere), decant_test::contains("must be finite"));
  CHECK_THROWS_WITH(estimate_value(values, broken), decant_test::contains("a number"));
  CHECK_THROWS_WITH(estimate_value(values, numbers, 1), decant_test::contains("in (0, 1)"));
}
