// SPDX-License-Identifier: MIT
#pragma once

/// Numbers by which interactions are compared that sensors were read in: what each read, and when.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/discovery/reading_series.hpp>
#include <decant/discovery/time_windows.hpp>

namespace decant::inline DECANT_TARGET {

/// Settings of ReadingFeatures.
struct ReadingFeatureSettings {
  double window = 0.133;     ///< for how long readings are averaged [s], > 0
  int most_windows = 200;    ///< of a sensor, >= 1: windows are longer where there would be more
  double least_error = 0.3;  ///< what a feature is off by at least, over the sensor's deviation, > 0
};

/// The mean reading of each sensor over each window of time. Readings that the recording lacks are left out of
/// simulations too; a window without any reading is none.
class ReadingFeatures {
 public:
  using Series = std::vector<ReadingSeries>;  ///< by sensor

  /// When a feature is.
  struct Place {
    std::size_t sensor;
    int window;         ///< counted from the first reading
    double begin, end;  ///< times of the window's first and last reading [s]
  };

  /// Throws std::invalid_argument if a setting is out of range.
  explicit ReadingFeatures(const Series& recording, const ReadingFeatureSettings& settings = {}) {
    expects(settings.window > 0 && std::isfinite(settings.window), "ReadingFeatures: window [s]", "> 0",
            settings.window);
    expects(settings.most_windows >= 1, "ReadingFeatures: most_windows", ">= 1", settings.most_windows);
    expects(settings.least_error > 0 && std::isfinite(settings.least_error), "ReadingFeatures: least_error", "> 0",
            settings.least_error);
    for (std::size_t sensor = 0; sensor < recording.size(); ++sensor) {
      const ReadingSeries& own = recording[sensor];
      readings_.push_back(own.size());
      const double duration = own.size() > 0 ? own.time(own.size() - 1) - own.time(0) : 0;
      const double window = std::max(settings.window, duration / settings.most_windows);
      for (std::size_t k = 0; k < own.size(); ++k) {
        const int number = std::min(window_number(own.time(k) - own.time(0), window), settings.most_windows - 1);
        if (!own.seen(k)) {
          continue;
        }
        if (windows_.empty() || windows_.back().place.sensor != sensor || windows_.back().place.window != number) {
          windows_.push_back({{sensor, number, own.time(k), own.time(k)}, {}});
          least_errors_.push_back(settings.least_error * own.error().deviation);
        }
        windows_.back().readings.push_back(k);
        windows_.back().place.end = own.time(k);
      }
    }
  }

  std::size_t size() const noexcept { return windows_.size(); }
  const Place& place(std::size_t feature) const { return windows_.at(feature).place; }
  /// By feature, in the sensors' units.
  std::span<const double> least_errors() const noexcept { return least_errors_; }

  /// Whether a series has the recording's sensors and as many readings of each.
  bool fit(const Series& series) const noexcept {
    return std::equal(series.begin(), series.end(), readings_.begin(), readings_.end(),
                      [](const ReadingSeries& own, std::size_t readings) { return own.size() == readings; });
  }

  /// Of the recording or a simulation; not finite where that has no reading and the recording does.
  /// Throws std::invalid_argument if its sensors or times are others.
  Eigen::VectorXd of(const Series& series) const {
    expects(fit(series), "ReadingFeatures: sensors and readings", "those of the recording",
            series.empty() ? 0 : series.front().size());
    Eigen::VectorXd result(static_cast<Eigen::Index>(size()));
    for (std::size_t w = 0; w < windows_.size(); ++w) {
      double sum = 0;
      for (const std::size_t k : windows_[w].readings) {
        sum += series[windows_[w].place.sensor].value(k);
      }
      result[static_cast<Eigen::Index>(w)] = sum / static_cast<double>(windows_[w].readings.size());
    }
    return result;
  }

 private:
  struct Window {
    Place place;
    std::vector<std::size_t> readings;  ///< that the recording has
  };

  std::vector<std::size_t> readings_{};  ///< by sensor
  std::vector<Window> windows_{};
  std::vector<double> least_errors_{};
};

}  // namespace decant::inline DECANT_TARGET
