// SPDX-License-Identifier: MIT
// The analysis of slosh records: on signals whose answers are known, and on the measured recordings.

#include "../../examples/support/slosh_analysis.hpp"

#include <decant/io/motion_file.hpp>
#include <decant/io/series_file.hpp>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "catch.hpp"
#include "data.hpp"

using namespace example;

namespace {

using std::numbers::pi;

template <class Signal>
Record sampled(double begin, double end, double step, Signal&& signal) {
  Record record;
  for (int k = 0; begin + k * step <= end; ++k) {
    record.time.push_back(begin + k * step);
    record.value.push_back(signal(record.time.back()));
  }
  return record;
}

// A motion's kind of signal: something rises at 1 s and swings until 6 s.
double event(double t) {
  return t < 1 || t > 6 ? 0 : 20 * std::sin(2 * pi * 0.9 * (t - 1)) * std::sin(pi * (t - 1) / 5);
}

}  // namespace

TEST_CASE("slosh analysis: values between samples and where there are none") {
  const Record record{{0, 0.05, 0.1, 0.5}, {0, 1, std::nan(""), 3}};
  CHECK(value_at(record, 0) == 0);
  CHECK(value_at(record, 0.025) == Approx(0.5));
  CHECK(value_at(record, 0.5) == 3);
  for (const double t : {-0.1, 0.07, 0.3, 0.6}) {  // before, beside a missing value, in a gap, after
    INFO(t);
    CHECK(std::isnan(value_at(record, t)));
  }
  CHECK(mean_between(record, 0, 1) == Approx(4.0 / 3));
  CHECK(mean_between(record, 2, 3) == 0);
  CHECK(peak_between(record, 0, 0.2) == 1);
  CHECK(peak_between(record, 0.2, 0.5) == 3);
  CHECK(std::isnan(peak_between(record, 2, 3)));
}

TEST_CASE("slosh analysis: one time shift is found to the millisecond") {
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 0.3);
  const Record simulated = sampled(0, 7, 0.01, event);
  const Record measured =
      sampled(0, 20, 1 / 59.96, [&](double t) { return 1.3 * event(t - 8.137) + 0.8 + noise(random); });
  const Alignment found = align(simulated, measured, 0, 7);
  CHECK(found.shift == Approx(8.137).margin(0.002));
  CHECK(found.correlation > 0.995);
  CHECK(found.correlation < 1);
  // half of the event in the one, the other way up in the other: not alike
  const Record upside_down = sampled(0, 20, 0.02, [](double t) { return -event(t - 8.137); });
  CHECK(correlation_at(simulated, upside_down, 0, 7, 8.137) == Approx(-1).margin(1e-3));
  // a record that is too short, empty or constant has nothing to be aligned with
  CHECK(align(simulated, sampled(0, 3, 0.02, event), 0, 7).correlation == -1);
  CHECK(align(simulated, {}, 0, 7).correlation == -1);
  CHECK(align(simulated, sampled(0, 20, 0.02, [](double) { return 2.0; }), 0, 7).correlation == -1);
}

TEST_CASE("slosh analysis: frequency and damping of a decaying oscillation in noise") {
  std::mt19937 random(11);
  std::normal_distribution<double> noise(0, 0.4);
  const double frequency = 3.02, damping = 0.006, w = 2 * pi * frequency;
  const double rate = damping * w / std::sqrt(1 - damping * damping);
  const auto decaying = [&](double phase, double size) {
    return [=, &noise, &random](double t) {
      return 1.5 - 0.2 * t + size * std::exp(-rate * t) * std::cos(w * t + phase) + noise(random);
    };
  };
  const Record x = sampled(0, 5, 1 / 60.0, decaying(0.3, 5)), y = sampled(0, 5, 1 / 60.0, decaying(1.9, 2));
  const Decay decay = fit_decay({x, y}, 0, 5, 2.4, 3.6);
  // Cramer-Rao: sigma_f = sqrt(6 / N) / (pi T) * noise / size = 0.0007 Hz here; damping likewise 0.0004
  CHECK(decay.frequency == Approx(frequency).margin(0.003));
  CHECK(decay.damping_ratio == Approx(damping).margin(0.0015));
  CHECK(decay.amplitude == Approx(5).margin(0.3));
  CHECK(decay.explained > 0.9);
  CHECK(fit_decay({x}, 0, 0.5, 2.4, 3.6).frequency == 0);  // too short
  CHECK(fit_decay({x}, 9, 12, 2.4, 3.6).frequency == 0);
  CHECK_THROWS_AS(fit_decay({x}, 0, 5, 3, 2), std::invalid_argument);
}

TEST_CASE("slosh analysis: the highest point of a whole surface shows twice the frequency of one side") {
  const double w = 2 * pi * 3.0;
  const Record side = sampled(0, 5, 1 / 60.0, [&](double t) { return 5 * std::cos(w * t); });
  const Record highest = sampled(0, 5, 1 / 60.0, [&](double t) { return 5 * std::abs(std::cos(w * t)); });
  CHECK(fit_decay({side}, 0, 5, 2.4, 3.6).frequency == Approx(3).margin(0.002));
  CHECK(fit_decay({highest}, 0, 5, 4.8, 7.2).frequency == Approx(6).margin(0.002));
  CHECK(fit_decay({highest}, 0, 5, 2.4, 3.6).explained < 0.02);
}

TEST_CASE("slosh analysis: linear theory of the cylinder") {
  CHECK(cylinder_slosh_frequency(0.049, 0.078) == Approx(3.047).margin(0.001));
  CHECK(cylinder_slosh_frequency(0.049, 0.001) ==  // shallow: w = k sqrt(g h)
        Approx(1.8412 / 0.049 * std::sqrt(9.81 * 0.001) / (2 * pi)).epsilon(0.001));
}

TEST_CASE("slosh analysis: measured free decays oscillate at 3.02 Hz") {
  const auto folder = decant_test::measurements("slosh_cylinder_robot");
  if (!folder) {
    return;
  }
  // recording times at which the motions start, as the data set's description has them
  const std::vector<std::pair<std::string, double>> motions = {
      {"LE_2D_0m_5s_900deg", 10.96},    {"LE_3D_0m_5.3s_900deg", 8.09},    {"RD_2D_0.3m_6.5s_720deg", 7.96},
      {"RD_3D_0.3m_6.8s_720deg", 8.32}, {"TRD_2D_0.3m_2.4s_270deg", 8.14}, {"TRD_2D_0.3m_2.6s_270deg", 8.57},
      {"TRD_3D_0.3m_3s_270deg", 7.09}};
  const double expected = cylinder_slosh_frequency(0.049, 0.078);
  for (const auto& [motion, start] : motions) {
    const auto poses = decant::read_motion(*folder / ("pose_" + motion + ".csv"));
    const auto heights = decant::read_series(*folder / ("height_" + motion + ".csv"));
    const Record record{heights.columns[0], heights.columns[1]};
    const double end = start + poses.end_time();
    const Decay decay = fit_decay({record}, end + 0.3, end + 8, 0.8 * expected, 1.2 * expected);
    INFO(motion << ": " << decay.frequency << " Hz, damping " << decay.damping_ratio);
    CHECK(decay.frequency == Approx(3.02).margin(0.03));
    CHECK(decay.explained > 0.5);
    // water in this cylinder: 0.005 by the boundary layers alone; the cameras' view adds scatter of about as much
    CHECK(std::abs(decay.damping_ratio) < 0.012);
  }
}
