// SPDX-License-Identifier: MIT

#include "../../examples/support/monotone_curve.hpp"

#include <cmath>
#include <random>
#include <vector>

#include "catch.hpp"

using example::MonotoneCurve;

TEST_CASE("monotone curve: a parabola comes out as it is, from few readings in any order") {
  const auto parabola = [](double x) { return 3 + 2 * x + 0.5 * x * x; };
  std::vector<MonotoneCurve::Reading> readings;
  for (const double x : {4.0, 0.0, 7.0, 2.5, 10.0}) {
    readings.push_back({x, parabola(x)});
  }
  const MonotoneCurve curve(readings);
  for (double x = 0; x <= 10; x += 0.37) {
    INFO(x);
    CHECK(curve.value(x) == Approx(parabola(x)).epsilon(1e-4));
    CHECK(curve.slope(x) == Approx(2 + x).epsilon(1e-3));
    CHECK(curve.inverse(parabola(x)) == Approx(x).margin(1e-3));
  }
  CHECK(curve.value(12) == Approx(parabola(10) + 2 * 12).epsilon(1e-3));  // straight on
  CHECK(curve.begin() == 0);
  CHECK(curve.end() == 10);
  CHECK(curve.left_out_error() < 0.01);
}

TEST_CASE("monotone curve: noise is smoothed, its size is found, and the curve rises where readings do not") {
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 0.08);
  const auto truth = [](double x) { return x + 0.35 * std::sin(2 * x); };
  std::vector<MonotoneCurve::Reading> readings;
  for (int k = 0; k <= 60; ++k) {
    readings.push_back({0.1 * k, truth(0.1 * k) + noise(random)});
  }
  const MonotoneCurve curve(readings);
  double squares = 0;
  for (int k = 0; k <= 60; ++k) {
    squares += std::pow(curve.value(0.1 * k) - truth(0.1 * k), 2) / 61;
    CHECK(curve.slope(0.1 * k) > 0);
  }
  CHECK(std::sqrt(squares) < 0.05);
  CHECK(curve.left_out_error() == Approx(0.08).epsilon(0.25));  // 61 readings know it to a tenth
}

TEST_CASE("monotone curve: passes through the first reading if it has to") {
  const std::vector<MonotoneCurve::Reading> readings{{0, 0}, {1, 1.3}, {2, 2.2}, {3, 3.3}, {4, 4.2}, {5, 5.3}};
  CHECK(MonotoneCurve(readings, true).value(0) == Approx(0).margin(1e-6));
  CHECK(std::abs(MonotoneCurve(readings).value(0)) > 0.02);
}

TEST_CASE("monotone curve: refuses what does not rise, and too little") {
  CHECK_THROWS_WITH(MonotoneCurve({{0, 0}, {1, -1}, {2, -2}, {3, -3}, {4, -4}}),
                    Catch::Contains("such that they rise"));
  CHECK_THROWS_WITH(MonotoneCurve({{0, 0}, {1, 1}, {2, 2}}), Catch::Contains("number of readings"));
  CHECK_THROWS_WITH(MonotoneCurve({{0, 0}, {0, 1}, {0, 2}, {0, 3}}), Catch::Contains("range"));
  CHECK_THROWS_WITH(MonotoneCurve({{0, 0}, {0, 1}, {1, 2}, {1, 3}}), Catch::Contains("between the outermost"));
  CHECK_THROWS_WITH(MonotoneCurve({{0, 0}, {1, std::nan("")}, {2, 2}, {3, 3}}), Catch::Contains("finite"));
}
