// SPDX-License-Identifier: MIT
#pragma once

/// A quantity that a model does not know: what it may be, and at which values it is asked for.

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// How values of a quantity are told apart: by differences, or by ratios.
enum class AxisScale { Linear, Logarithmic };

/// One axis of a space of parameters. Within its range, before anything is seen, each value is as likely as another:
/// each decade, where the scale is logarithmic. Places along it are shares of the range, 0 at low and 1 at high.
struct ParameterAxis {
  std::string name{};
  std::string unit{};
  double low = 0, high = 1;  ///< in its unit; low < high, and low > 0 where the scale is logarithmic
  AxisScale scale = AxisScale::Linear;
  int grid_values = 11;  ///< of searches on a grid, evenly from low to high on the scale; >= 2

  /// @param share 0 .. 1. The ends are exact.
  double at(double share) const noexcept {
    if (share <= 0 || share >= 1) {
      return share <= 0 ? low : high;
    }
    return scale == AxisScale::Linear ? std::lerp(low, high, share)
                                      : std::exp(std::lerp(std::log(low), std::log(high), share));
  }

  /// The place of a value; of one beyond the range, that of the nearer end.
  double share_of(double value) const noexcept {
    if (!(value > low) || !(value < high)) {
      return value >= high ? 1 : 0;
    }
    return scale == AxisScale::Linear ? (value - low) / (high - low) : std::log(value / low) / std::log(high / low);
  }

  /// A grid value, of number 0 .. grid_values - 1.
  double grid_value(int number) const noexcept { return at(static_cast<double>(number) / (grid_values - 1)); }

  /// The number of the grid value next to a value.
  int nearest(double value) const noexcept {
    return static_cast<int>(std::lround(share_of(value) * (grid_values - 1)));
  }
};

/// Throws std::invalid_argument if an axis makes no sense.
inline void validate(const ParameterAxis& axis) {
  const std::string what = "ParameterAxis '" + axis.name + "': ";
  expects(std::isfinite(axis.low) && (axis.scale == AxisScale::Linear || axis.low > 0), what + "low",
          axis.scale == AxisScale::Linear ? "finite" : "finite and > 0 on a logarithmic scale", axis.low);
  expects(axis.high > axis.low && std::isfinite(axis.high), what + "high", "finite and above low", axis.high);
  expects(axis.grid_values >= 2, what + "grid_values", ">= 2", axis.grid_values);
}

}  // namespace decant::inline DECANT_TARGET
