// SPDX-License-Identifier: MIT
// What becomes of hypotheses over a recording, as numbers and charts.

#include "../../examples/support/hypothesis_report.hpp"

#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "catch.hpp"

using namespace example;

namespace {

/// Three hypotheses over two frames, of which the last was given up after the first.
PosteriorCourse small_course() {
  PosteriorCourse course;
  course.names = {"a", "b", "c"};
  course.time = {10, 10.5};
  course.log_posterior = {{0, -1}, {0, -3}, {-2, -9}};
  course.log_none = {-4, -4};
  course.evidence.resize(3);
  course.evidence[0] = {.frames = 2, .before = {}, .differing_before_px = 60000};
  course.evidence[1] = {.frames = 2, .before = {}, .differing_before_px = 85000};
  course.evidence[2] = {.frames = 1, .before = {}, .differing_before_px = 100};
  course.followed = {3, 2};
  return course;
}

}  // namespace

TEST_CASE("hypothesis report: by the likelihood as printed a nat takes 25,000 pixels") {
  const std::vector<double> probability = probability_schenck2017(small_course());
  REQUIRE(probability.size() == 3);
  // delta^(n - 60000) (1 - delta)^60000 over delta^(n - 85000) (1 - delta)^85000
  const double odds = std::pow(0.50001 / 0.49999, 25000.0);
  CHECK(probability[0] / probability[1] == Approx(odds).epsilon(1e-6));
  CHECK(odds == Approx(std::exp(1.0)).epsilon(1e-6));
  CHECK(probability[2] == 0);  // it was not asked about the second frame
  CHECK(probability[0] + probability[1] == Approx(1));
}

TEST_CASE("hypothesis report: charts are over the time from the first frame on") {
  const PosteriorCourse course = small_course();
  const decant::LineChart chart = course_chart("t", course, " %");
  REQUIRE(chart.lines.size() == 4);
  CHECK(chart.lines[1].name == "b %");
  CHECK(chart.lines[3].name == "none of these");
  CHECK(chart.lines[0].x == std::vector<double>{0, 0.5});
  CHECK(chart.lines[0].y[1] / chart.lines[1].y[1] == Approx(std::exp(2.0)));
  CHECK(chart.lines[0].y[0] + chart.lines[1].y[0] + chart.lines[2].y[0] + chart.lines[3].y[0] == Approx(1));
  CHECK(followed_chart({{"x", &course}}).lines[0].y == course.followed);
  CHECK(chart.over_time);
}

TEST_CASE("hypothesis report: a density keeps its area in another unit") {
  const std::vector<double> values{0, 0.25, 0.5, 0.75, 1}, log_density{-20, -4, 0, -4, -20};
  const decant::LineChart chart =
      density_chart("t", "open [%]", "density [1/%]", {{"left", decant::ValueDensity(values, log_density)}}, 0, 1, 100);
  const std::vector<double>& x = chart.lines.at(0).x;
  const std::vector<double>& y = chart.lines.at(0).y;
  double area = 0;
  for (std::size_t k = 0; k + 1 < x.size(); ++k) {
    area += (x[k + 1] - x[k]) * 0.5 * (y[k] + y[k + 1]);
  }
  CHECK(x.back() == 100);
  CHECK(area == Approx(1).margin(0.01));
  CHECK_FALSE(chart.over_time);
}

TEST_CASE("hypothesis report: an estimate over time has a median and an interval, where there is one") {
  const std::vector<double> values{0, 1, 2}, even{0, 0, 0};
  decant::LineChart chart;
  add_estimate_lines(
      chart, "amount", small_course(),
      [&](std::size_t frame) { return frame == 0 ? std::nullopt : std::optional(decant::ValueDensity(values, even)); },
      0.5, 10);
  REQUIRE(chart.lines.size() == 2);
  CHECK(std::isnan(chart.lines[0].y[0]));
  CHECK(chart.lines[0].y[1] == Approx(10).margin(0.2));
  const auto& bounds = chart.lines[1];
  CHECK(bounds.name == "amount, 50 % interval");
  REQUIRE(bounds.y.size() == 5);
  CHECK(bounds.y[1] == Approx(5).margin(0.2));
  CHECK(std::isnan(bounds.x[2]));
  CHECK(bounds.y[4] == Approx(15).margin(0.2));
}
