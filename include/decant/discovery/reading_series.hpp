// SPDX-License-Identifier: MIT
#pragma once

/// What a sensor read during an interaction that gives one number at a time: a scale, a level probe, a pressure gauge.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// What readings are off by although the model is right.
struct ReadingError {
  double deviation = 1;  ///< of one reading, in its unit, > 0: the sensor's, and what its calibration and place are off
  double lasts = 0;      ///< for how long readings are off together [s], >= 0: 0 for noise, seconds for a calibration
};

/// Readings of one sensor, in whatever unit it has.
class ReadingSeries {
 public:
  /// @param name for people, with the unit, such as "level [m]".
  /// Throws std::invalid_argument if the error is out of range.
  explicit ReadingSeries(std::string name, const ReadingError& error) : name_(std::move(name)), error_(error) {
    expects(error.deviation > 0 && std::isfinite(error.deviation), "ReadingSeries '" + name_ + "': deviation",
            "> 0 and finite", error.deviation);
    expects(error.lasts >= 0 && std::isfinite(error.lasts), "ReadingSeries '" + name_ + "': lasts [s]",
            ">= 0 and finite", error.lasts);
  }

  /// @param time [s], later than those before. @param value not finite: missing.
  void add(double time, double value) {
    expects(std::isfinite(time) && (time_.empty() || time > time_.back()), "ReadingSeries '" + name_ + "': time [s]",
            "finite and increasing", time);
    time_.push_back(time);
    value_.push_back(std::isfinite(value) ? value : std::numeric_limits<double>::quiet_NaN());
  }

  const std::string& name() const noexcept { return name_; }
  const ReadingError& error() const noexcept { return error_; }
  std::size_t size() const noexcept { return time_.size(); }
  double time(std::size_t k) const { return time_.at(k); }
  bool seen(std::size_t k) const { return std::isfinite(value_.at(k)); }
  double value(std::size_t k) const { return value_.at(k); }  ///< NaN where it is missing

  const std::vector<double>& values() const noexcept { return value_; }
  /// The same sensor and times with other readings. Throws std::invalid_argument if they are not as many.
  ReadingSeries with_values(std::span<const double> values) const {
    expects(values.size() == value_.size(), "ReadingSeries '" + name_ + "': readings", "as many as of the series",
            values.size());
    ReadingSeries other = *this;
    other.value_.assign(values.begin(), values.end());
    return other;
  }

  /// The same with errors as readings have them: normal, with a correlation that falls off as exp(-t / lasts) (the
  /// process of Ornstein and Uhlenbeck).
  ReadingSeries with_errors(std::uint32_t seed) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    ReadingSeries other = *this;
    double off = 0;
    for (std::size_t k = 0; k < value_.size(); ++k) {
      const double kept = k > 0 && error_.lasts > 0 ? std::exp(-(time_[k] - time_[k - 1]) / error_.lasts) : 0;
      off = kept * off + error_.deviation * std::sqrt(1 - kept * kept) * normal(random);
      other.value_[k] += off;
    }
    return other;
  }

 private:
  std::string name_;
  ReadingError error_;
  std::vector<double> time_{};
  std::vector<double> value_{};
};

}  // namespace decant::inline DECANT_TARGET
