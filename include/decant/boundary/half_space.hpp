// SPDX-License-Identifier: MIT
#pragma once

/// What a plane wall contributes to sums over a particle's support, tabulated once per kernel and smoothing length.

#include <algorithm>
#include <cmath>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// Integrals of a smoothing kernel over the half-space behind a plane, as functions of the particle's distance a [m] to
/// that plane (negative behind it). With the wall taken as filled to rest density, fraction(a) is its share of a
/// particle's density, and slope(a) its share of the density gradient along the plane's normal.
///   fraction(a) = int_{z > a} W dV = int_a^R 2 pi W(r) r (r - a) dr              [-], fraction(-a) = 1 - fraction(a)
///   slope(a)    = -d fraction / da = int_a^R 2 pi W(r) r dr                       [1/m], even in a
/// The viscous pull of a wall that holds the liquid needs no further table: with velocities continued linearly behind
/// the wall, the kernel Laplacian gives a rate of 2 slope(a) / a times the kinematic viscosity.
class HalfSpace {
 public:
  HalfSpace() = default;

  /// Tabulates Kernel for smoothing_length [m] > 0.
  template <class Kernel>
  static HalfSpace of(double smoothing_length) {
    expects(std::isfinite(smoothing_length) && smoothing_length > 0, "HalfSpace: smoothing length [m]", "> 0",
            smoothing_length);
    HalfSpace table;
    table.support_ = static_cast<double>(Kernel::support_factor) * smoothing_length;
    table.fraction_.assign(entries + 1, 0.0);
    table.slope_.assign(entries + 1, 0.0);
    table.per_length_ = entries / table.support_;
    // From the support inward: slope by Simpson's rule over each interval, and fraction as the integral of slope, since
    // d fraction/da = -slope; the four sub-intervals make the error of the cubic pieces vanish against float rounding.
    using KernelScalar = typename Kernel::Scalar;
    const auto weight = [smoothing_length](double r) {
      return 2 * pi * r *
             static_cast<double>(
                 Kernel::value(static_cast<KernelScalar>(r), static_cast<KernelScalar>(smoothing_length)));
    };
    const double width = table.support_ / entries;
    for (std::size_t k = entries; k-- > 0;) {
      const double a = static_cast<double>(k) * width;
      const double middle = table.slope_[k + 1] + simpson(weight, a + 0.5 * width, a + width);
      table.slope_[k] = middle + simpson(weight, a, a + 0.5 * width);
      table.fraction_[k] = table.fraction_[k + 1] + width / 6 * (table.slope_[k] + 4 * middle + table.slope_[k + 1]);
    }
    // Single precision kernels integrate to one within their rounding; make the table exactly odd about the plane.
    const double scale = 0.5 / table.fraction_[0];
    for (std::size_t k = 0; k <= entries; ++k) {
      table.fraction_[k] *= scale;
      table.slope_[k] *= scale;
    }
    return table;
  }

  /// Support radius [m]: both functions vanish beyond it.
  double support() const noexcept { return support_; }

  double fraction(double a) const noexcept {
    const double inside = interpolate(fraction_, std::abs(a));
    return a < 0 ? 1 - inside : inside;
  }

  double slope(double a) const noexcept { return interpolate(slope_, std::abs(a)); }

 private:
  static constexpr std::size_t entries = 512;
  static constexpr double pi = 3.14159265358979323846;

  template <class Function>
  static double simpson(const Function& f, double from, double to) {
    const double middle = 0.5 * (from + to);
    return (to - from) / 12 *
           (f(from) + 4 * f(0.5 * (from + middle)) + 2 * f(middle) + 4 * f(0.5 * (middle + to)) + f(to));
  }

  double interpolate(const std::vector<double>& table, double a) const noexcept {
    const double place = a * per_length_;
    if (!(place < static_cast<double>(entries))) {
      return 0;
    }
    const auto k = static_cast<std::size_t>(place);
    const double t = place - static_cast<double>(k);
    return table[k] + t * (table[k + 1] - table[k]);
  }

  double support_ = 0;
  double per_length_ = 0;
  std::vector<double> fraction_{};
  std::vector<double> slope_{};
};

}  // namespace decant::inline DECANT_TARGET
