// SPDX-License-Identifier: MIT
#pragma once

/// A quantity between hypotheses: from probabilities at some of its values to a mean and an interval.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// What is known of a quantity, in its unit.
struct ValueEstimate {
  double mean = 0;
  double low = 0, high = 0;  ///< central interval of the confidence asked for
  /// The interval comes within half a gap of the smallest or largest value: the quantity may lie beyond them.
  bool at_end = false;
};

/// Between values the logarithm of the density is a cubic with, at each value, the slope of the parabola through it and
/// its neighbours, limited to three times the smaller of the slopes to both sides, so that what is next to improbable
/// values does not overshoot (Fritsch and Carlson 1980). A normal density whose deviation is that between values comes
/// out within a hundredth of it. Outside the values there is no density.
/// @param values increasing strictly, at least one. @param log_density for each, [nat] up to a constant; -infinity for
/// none, but not for all. @param confidence in (0, 1). Throws std::invalid_argument otherwise.
inline ValueEstimate estimate_value(std::span<const double> values, std::span<const double> log_density,
                                    double confidence = 0.9) {
  expects(!values.empty() && values.size() == log_density.size(), "estimate_value: number of densities",
          "that of values, at least 1", log_density.size());
  expects(confidence > 0 && confidence < 1, "estimate_value: confidence", "in (0, 1)", confidence);
  const double largest = *std::max_element(log_density.begin(), log_density.end());
  expects(std::isfinite(largest), "estimate_value: largest log density", "finite", largest);
  for (std::size_t k = 0; k < values.size(); ++k) {
    expects(std::isfinite(values[k]) && (k == 0 || values[k] > values[k - 1]), "estimate_value: values",
            "finite and increasing", values[k]);
    expects(!std::isnan(log_density[k]), "estimate_value: log density", "a number", log_density[k]);
  }
  if (values.size() == 1) {
    return {values[0], values[0], values[0], true};
  }
  // what is e^-700 of the largest is none
  const auto level = [&](std::size_t k) { return std::max(log_density[k] - largest, -700.0); };
  const auto between = [&](std::size_t k) { return (level(k + 1) - level(k)) / (values[k + 1] - values[k]); };
  const std::size_t last = values.size() - 1;
  const auto slope = [&](std::size_t k) {
    if (k == 0 || k == last) {
      return between(k == 0 ? 0 : last - 1);
    }
    const double before = values[k] - values[k - 1], after = values[k + 1] - values[k];
    const double parabola = (after * between(k - 1) + before * between(k)) / (before + after);
    const double limit = 3 * std::min(std::abs(between(k - 1)), std::abs(between(k)));
    return std::clamp(parabola, -limit, limit);
  };
  constexpr int pieces = 200;  // per gap: their error is below a thousandth of the gap
  std::vector<double> place, mass;
  double total = 0;
  for (std::size_t k = 0; k < last; ++k) {
    const double gap = values[k + 1] - values[k], left = slope(k), right = slope(k + 1);
    for (int piece = 0; piece < pieces; ++piece) {
      const double u = (piece + 0.5) / pieces;
      const double cubic = (1 + 2 * u) * (1 - u) * (1 - u) * level(k) + u * u * (3 - 2 * u) * level(k + 1) +
                           gap * u * (1 - u) * ((1 - u) * left - u * right);
      place.push_back(values[k] + u * gap);
      mass.push_back(std::exp(cubic) * gap / pieces);
      total += mass.back();
    }
  }
  ValueEstimate estimate;
  const double tail = 0.5 * (1 - confidence) * total;
  double below = 0;
  bool low_found = false, high_found = false;
  for (std::size_t i = 0; i < place.size(); ++i) {
    estimate.mean += mass[i] * place[i] / total;
    below += mass[i];
    if (!low_found && below >= tail) {
      estimate.low = place[i];
      low_found = true;
    }
    if (!high_found && below >= total - tail) {
      estimate.high = place[i];
      high_found = true;
    }
  }
  const double first_gap = values[1] - values[0], last_gap = values[last] - values[last - 1];
  estimate.at_end = estimate.low < values[0] + first_gap / 2 || estimate.high > values[last] - last_gap / 2;
  return estimate;
}

}  // namespace decant::inline DECANT_TARGET
