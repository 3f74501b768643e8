// SPDX-License-Identifier: MIT
#pragma once

/// A tank that drains through a small hole, without particles: its level over time, and how well a hole lets liquid
/// pass, from a recording of the level.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <numbers>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/hypothesis/series_fit.hpp>
#include <decant/hypothesis/thread_executor.hpp>
#include <decant/hypothesis/value_estimate.hpp>

#include "monotone_curve.hpp"
#include "number_table.hpp"

namespace example {

/// Rectangle with rounded corners, from its outer lengths and its perimeter [m].
struct RoundedRectangle {
  double length, width, perimeter;

  double corner_radius() const { return (length + width - 0.5 * perimeter) / (4 - std::numbers::pi); }
};

/// A SeriesModel of one channel, the level [m] above the floor, by Torricelli's law:
///   A(h) dh/dt = -c a sqrt(2 g (h - z)).
/// Parameters: the discharge coefficient c [-], and the level [m] at the first of the times.
struct DrainingTank {
  RoundedRectangle bottom, top;  ///< of the inner space; sizes and corner radius are linear in between
  double height;                 ///< [m]
  double hole_height;            ///< z, of its centre above the floor [m]
  double hole_radius;            ///< [m]
  double gravity = 9.81;         ///< [m/s^2]

  double area(double level) const {
    const double u = level / height;
    const double radius = std::lerp(bottom.corner_radius(), top.corner_radius(), u);
    return std::lerp(bottom.length, top.length, u) * std::lerp(bottom.width, top.width, u) -
           (4 - std::numbers::pi) * radius * radius;
  }

  std::vector<std::vector<double>> predict(std::span<const double> parameters, std::span<const double> times) const {
    decant::expects(parameters.size() == 2, "DrainingTank: number of parameters", "2", parameters.size());
    const double hole = std::numbers::pi * hole_radius * hole_radius;
    const auto rate = [&](double level) {
      return -parameters[0] * hole * std::sqrt(2 * gravity * std::max(0.0, level - hole_height)) / area(level);
    };
    std::vector<double> levels;
    double level = parameters[1];
    for (std::size_t k = 0; k < times.size(); ++k) {
      const double duration = k > 0 ? times[k] - times[k - 1] : 0;
      const int steps = std::max(1, static_cast<int>(std::ceil(duration / longest_step)));
      const double step = duration / steps;
      for (int n = 0; n < steps; ++n) {  // classical Runge-Kutta
        const double k1 = rate(level), k2 = rate(level + 0.5 * step * k1), k3 = rate(level + 0.5 * step * k2),
                     k4 = rate(level + step * k3);
        level += step / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
      }
      levels.push_back(level);
    }
    return {levels};
  }

  static constexpr double longest_step = 2;  ///< [s], in which a level moves by a thousandth
};
static_assert(decant::SeriesModel<DrainingTank>);

/// The tank of G. Fabusola and C. M. Simon, Chem. Eng. Sci. 309 (2025) 121488.
inline DrainingTank tank_fabusola2025() {
  return {{0.134, 0.078, 0.401}, {0.146, 0.09, 0.443}, 0.286, 0.009, 0.5 * 5.0 / 64 * 0.0254};
}

/// Levels while a tank drains.
struct DrainRecord {
  std::vector<double> time;      ///< [s], from when the drain was opened
  std::vector<double> level;     ///< [m]
  double calibration_error = 0;  ///< of the sensor's calibration, as left-out points of it show [m]
};

/// Reads that paper's recording: a sensor's counts over time, and levels by counts. The sensor is calibrated by a
/// MonotoneCurve, since single points of its calibration are off by half a centimetre. The drain is opened at the
/// highest reading; what comes after the jet has died is left out. Throws std::runtime_error.
inline DrainRecord read_drain_record(const std::filesystem::path& folder) {
  constexpr double dead = 508;  // counts, at which the level does not matter any more
  std::vector<MonotoneCurve::Reading> calibration;
  for (const auto& row : read_numbers(folder / "level_sensor_calibration.csv", 2)) {
    if (row[1] >= dead) {
      calibration.push_back({row[1], 0.01 * row[0]});
    }
  }
  const MonotoneCurve level(calibration);
  const auto rows = read_numbers(folder / "liq_level_data_empty_train.csv", 2);
  auto row = std::max_element(rows.begin(), rows.end(), [](const auto& a, const auto& b) { return a[1] < b[1]; });
  if (row == rows.end() || !((*row)[1] > dead)) {
    throw std::runtime_error((folder / "liq_level_data_empty_train.csv").string() + ": no reading above 508 counts");
  }
  DrainRecord record;
  record.calibration_error = level.left_out_error();
  const double start = (*row)[0];
  std::vector<int> shared;  // readings of one time stamp
  for (; row != rows.end() && (*row)[1] > dead; ++row) {
    const double time = (*row)[0] - start, value = level.value((*row)[1]);
    if (!record.time.empty() && !(time > record.time.back())) {
      ++shared.back();
      record.level.back() += (value - record.level.back()) / shared.back();
      continue;
    }
    record.time.push_back(time);
    record.level.push_back(value);
    shared.push_back(1);
  }
  return record;
}

/// What a recording says of the discharge coefficient.
struct DrainFit {
  decant::ValueEstimate coefficient;
  decant::SeriesFit series;
  double mean_off = 0;  ///< mean size of what the best prediction is off by [m]
  double independent_errors = 0;
};

/// @param start_deviation of the level at the beginning from its reading [m]; 0: that reading is right.
inline DrainFit fit_discharge(const DrainingTank& tank, const DrainRecord& record, double start_deviation,
                              decant::Threads threads = {}) {
  constexpr double sensor = 0.001;  // [m], about a count
  std::vector<std::vector<double>> hypotheses;
  decant::SeriesFitSettings settings;
  const int starts = start_deviation > 0 ? 10 : 0;
  for (int s = -starts; s <= starts; ++s) {
    const double deviations = 0.3 * s;
    for (int c = 0; c <= 100; ++c) {
      hypotheses.push_back({0.5 + 0.005 * c, record.level.front() + deviations * start_deviation});
      settings.log_prior.push_back(-0.5 * deviations * deviations);
    }
  }
  const std::vector<decant::MeasuredChannel> measured{
      {record.level, {.deviation = sensor, .readings_per_error = 0, .idle = record.level.front()}}};
  decant::ThreadExecutor executor{threads};
  DrainFit fit{{}, decant::fit_series(tank, std::move(hypotheses), record.time, measured, executor, settings)};
  const decant::Marginal coefficient = fit.series.marginal_of(0);
  fit.coefficient = decant::estimate_value(coefficient.values, coefficient.log_density);
  const std::vector<double>& best = fit.series.best()[0];
  for (std::size_t k = 0; k < best.size(); ++k) {
    fit.mean_off += std::abs(best[k] - record.level[k]) / static_cast<double>(best.size());
  }
  fit.independent_errors = static_cast<double>(best.size()) / fit.series.noise[0].readings_per_error;
  return fit;
}

/// How a fit's coefficient would have been known while the tank drained, reading by reading.
struct DrainCourse {
  std::vector<double> time;  ///< [s]
  std::vector<decant::ValueEstimate> coefficient;
};

/// @param every how many readings there are from one estimate to the next.
inline DrainCourse follow_discharge(const DrainFit& fit, const DrainRecord& record, std::size_t every) {
  const decant::SeriesMisfit level(fit.series.noise[0]);
  decant::Posterior posterior;
  std::vector<double> values, log_posterior(fit.series.hypotheses.size());
  for (std::size_t k = 0; k < fit.series.hypotheses.size(); ++k) {
    posterior.add(fit.series.log_prior[k]);
    values.push_back(fit.series.hypotheses[k][0]);
  }
  DrainCourse course;
  for (std::size_t reading = 0; reading < record.time.size(); ++reading) {
    posterior.set_source(0, level.evidence(static_cast<double>(reading + 1)));
    for (std::size_t k = 0; k < values.size(); ++k) {
      posterior.observe(k, level.misfit(fit.series.predicted[k][0][reading], record.level[reading]));
      log_posterior[k] = posterior.log_posterior(k);
    }
    if ((reading + 1) % every == 0) {
      const decant::Marginal coefficient = decant::marginal(values, log_posterior);
      course.time.push_back(record.time[reading]);
      course.coefficient.push_back(decant::estimate_value(coefficient.values, coefficient.log_density));
    }
  }
  return course;
}

}  // namespace example
