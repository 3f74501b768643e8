// SPDX-License-Identifier: MIT
#pragma once

/// A quantity between hypotheses: from probabilities at some of its values to a mean and an interval.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <iterator>
#include <span>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// What is known of a quantity, in its unit.
struct ValueEstimate {
  double mean = 0;
  double median = 0;  ///< always within the interval; little that is far away moves it less than the mean
  /// Interval of the confidence asked for: central, or, where the density is highest at an end (an empty container),
  /// from there on.
  double low = 0, high = 0;
  /// The interval comes within half a gap of the smallest or largest value: the quantity may lie beyond them.
  bool at_end = false;
};

/// The density of a quantity, from its logarithm at some values. In between it is a cubic with, at each value, the
/// slope of the parabola through it and its neighbours, limited to three times the smaller of the slopes to both sides,
/// so that what is next to improbable values does not overshoot (Fritsch and Carlson 1980). A normal density whose
/// deviation is that between values comes out within a hundredth of it. Outside the values there is no density.
class ValueDensity {
 public:
  /// @param values increasing strictly, at least one. @param log_density for each, [nat] up to a constant; -infinity
  /// for none, but not for all. Throws std::invalid_argument otherwise.
  ValueDensity(std::span<const double> values, std::span<const double> log_density)
      : values_(values.begin(), values.end()) {
    expects(!values.empty() && values.size() == log_density.size(), "ValueDensity: number of densities",
            "that of values, at least 1", log_density.size());
    const double largest = *std::max_element(log_density.begin(), log_density.end());
    expects(std::isfinite(largest), "ValueDensity: largest log density", "finite", largest);
    for (std::size_t k = 0; k < values.size(); ++k) {
      expects(std::isfinite(values[k]) && (k == 0 || values[k] > values[k - 1]), "ValueDensity: values",
              "finite and increasing", values[k]);
      expects(!std::isnan(log_density[k]), "ValueDensity: log density", "a number", log_density[k]);
    }
    lay_out(log_density, largest);
  }

  double mean() const noexcept { return mean_; }
  /// The smallest and the largest value.
  std::pair<double, double> range() const noexcept { return {values_.front(), values_.back()}; }

  /// The value that a share in [0, 1] of the density is below.
  double quantile(double share) const noexcept {
    if (below_.empty()) {
      return values_.front();
    }
    const auto piece = std::lower_bound(below_.begin(), below_.end(), share);
    return middle(std::min(static_cast<std::size_t>(std::distance(below_.begin(), piece)), below_.size() - 1));
  }

  /// An interval that has a share in (0, 1) of the density, see ValueEstimate.
  std::pair<double, double> interval(double share) const noexcept {
    const double tail = 0.5 * (1 - share);
    const std::pair<double, double> central{quantile(tail), quantile(1 - tail)};
    const double at_front = density_near(values_.front()), at_back = density_near(values_.back());
    const double at_end = std::max(at_front, at_back);
    constexpr double clearly = 1.001;  // an even density has no highest place
    if (clearly * at_end < highest() || at_end < clearly * density_near(quantile(0.5))) {
      return central;
    }
    return at_front > at_back ? std::pair(values_.front(), quantile(share))
                              : std::pair(quantile(1 - share), values_.back());
  }

  /// The share of the density that is below a value.
  double share_below(double value) const noexcept {
    if (value >= values_.back()) {
      return 1;
    }
    double share = 0;
    for (std::size_t piece = 0; piece < below_.size() && middle(piece) < value; ++piece) {
      share = below_[piece];
    }
    return share;
  }

  /// The density at a value [1 / its unit], 0 outside of the values; 0 everywhere if there is only one of them, which
  /// then is certain.
  double density(double value) const noexcept {
    return value >= values_.front() && value <= values_.back() ? pieces * density_near(value) : 0.0;
  }

  /// Whether one of the values is so near to an end of the range that the quantity may lie beyond it: within half of
  /// the outermost gap.
  bool near_end(double low, double high) const noexcept {
    if (values_.size() == 1) {
      return true;
    }
    const std::size_t last = values_.size() - 1;
    return low < 0.5 * (values_[0] + values_[1]) || high > 0.5 * (values_[last - 1] + values_[last]);
  }

 private:
  static constexpr int pieces = 200;  // per gap: their error is below a thousandth of the gap

  double density_near(double value) const noexcept {
    if (below_.empty()) {
      return 0;
    }
    const auto after = std::upper_bound(values_.begin() + 1, values_.end() - 1, value);
    const auto gap = static_cast<std::size_t>(std::distance(values_.begin(), after)) - 1;
    const double width = values_[gap + 1] - values_[gap];
    const double u = std::clamp((value - values_[gap]) / width, 0.0, 1.0);
    const std::size_t piece = pieces * gap + std::min(static_cast<std::size_t>(u * pieces), std::size_t{pieces - 1});
    return (below_[piece] - (piece > 0 ? below_[piece - 1] : 0.0)) / width;
  }

  double highest() const noexcept {
    double highest = 0;
    for (std::size_t piece = 0; piece < below_.size(); ++piece) {
      const double width = values_[piece / pieces + 1] - values_[piece / pieces];
      highest = std::max(highest, (below_[piece] - (piece > 0 ? below_[piece - 1] : 0.0)) / width);
    }
    return highest;
  }

  double middle(std::size_t piece) const noexcept {
    const std::size_t gap = piece / pieces;
    const double u = (static_cast<double>(piece % pieces) + 0.5) / pieces;
    return std::lerp(values_[gap], values_[gap + 1], u);
  }

  void lay_out(std::span<const double> log_density, double largest) {
    if (values_.size() == 1) {
      mean_ = values_.front();
      return;
    }
    // what is e^-700 of the largest is none
    const auto level = [&](std::size_t k) { return std::max(log_density[k] - largest, -700.0); };
    const auto between = [&](std::size_t k) { return (level(k + 1) - level(k)) / (values_[k + 1] - values_[k]); };
    const std::size_t last = values_.size() - 1;
    const auto slope = [&](std::size_t k) {
      if (k == 0 || k == last) {
        return between(k == 0 ? 0 : last - 1);
      }
      const double before = values_[k] - values_[k - 1], after = values_[k + 1] - values_[k];
      const double parabola = (after * between(k - 1) + before * between(k)) / (before + after);
      const double limit = 3 * std::min(std::abs(between(k - 1)), std::abs(between(k)));
      return std::clamp(parabola, -limit, limit);
    };
    double total = 0, moment = 0;
    for (std::size_t k = 0; k < last; ++k) {
      const double gap = values_[k + 1] - values_[k], left = slope(k), right = slope(k + 1);
      for (int piece = 0; piece < pieces; ++piece) {
        const double u = (piece + 0.5) / pieces;
        const double cubic = (1 + 2 * u) * (1 - u) * (1 - u) * level(k) + u * u * (3 - 2 * u) * level(k + 1) +
                             gap * u * (1 - u) * ((1 - u) * left - u * right);
        const double mass = std::exp(cubic) * gap;
        total += mass;
        moment += mass * middle(below_.size());
        below_.push_back(total);
      }
    }
    mean_ = moment / total;
    for (double& share : below_) {
      share /= total;
    }
  }

  std::vector<double> values_;
  std::vector<double> below_{};  // share of the density up to the end of each piece
  double mean_ = 0;
};

/// The density of a quantity that differs from one whose density is known by a normal error, within the same range: for
/// what all hypotheses have in common and none of them asks about. @param deviation(value) of the error, >= 0, in units
/// of the value; where it is less than a two hundredth of the range, it counts as that much. A density of one value
/// stays as it is.
template <class Deviation>
ValueDensity smeared(const ValueDensity& density, Deviation&& deviation) {
  const auto [low, high] = density.range();
  if (low == high) {
    return density;
  }
  constexpr int steps = 200;
  std::vector<double> values, shares(steps + 1, 0.0), log_density;
  for (int k = 0; k <= steps; ++k) {
    values.push_back(k == steps ? high : low + k * (high - low) / steps);
  }
  double below = 0;
  for (int k = 0; k < steps; ++k) {  // the share between two values, as if it stood in their middle
    const auto at = static_cast<std::size_t>(k);
    const double middle = 0.5 * (values[at] + values[at + 1]), until = density.share_below(values[at + 1]);
    const double width = std::max(static_cast<double>(deviation(middle)), (high - low) / steps);
    for (std::size_t other = 0; other < values.size(); ++other) {
      // what would lie beyond an end is folded back: what is most probable there stays so
      for (const double from : {middle, 2 * low - middle, 2 * high - middle}) {
        const double off = (values[other] - from) / width;
        shares[other] += (until - below) / width * std::exp(-0.5 * off * off);
      }
    }
    below = until;
  }
  for (const double share : shares) {
    log_density.push_back(share > 0 ? std::log(share) : -std::numeric_limits<double>::infinity());
  }
  return ValueDensity(values, log_density);
}

/// Mean, median and interval of a density. @param confidence in (0, 1). Throws std::invalid_argument otherwise.
inline ValueEstimate estimate_value(const ValueDensity& density, double confidence = 0.9) {
  expects(confidence > 0 && confidence < 1, "estimate_value: confidence", "in (0, 1)", confidence);
  const auto [low, high] = density.interval(confidence);
  return {density.mean(), density.quantile(0.5), low, high, density.near_end(low, high)};
}

/// The same from logarithms of a density, see ValueDensity. Throws std::invalid_argument as that does, too.
inline ValueEstimate estimate_value(std::span<const double> values, std::span<const double> log_density,
                                    double confidence = 0.9) {
  return estimate_value(ValueDensity(values, log_density), confidence);
}

}  // namespace decant::inline DECANT_TARGET
