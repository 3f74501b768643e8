// SPDX-License-Identifier: MIT
#pragma once

/// What a plane wall adds to the density of the liquid near it, and the radial weight that makes the same of any wall.

#include <algorithm>
#include <cmath>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// A wall takes part in the density sum as a region behind its surface, with a weight of its own instead of the kernel.
/// At distance a from a plane it adds, in units of rest density,
///   share(a) = A (1 - a/R)^n for 0 <= a < R,     R = support radius - particle spacing d
/// A and n are chosen so that a lattice with its first layer d/2 off the wall is in equilibrium:
///   share(d/2)   = what the lattice layers add that the wall stands in for, so the first layer has rest density;
///   -share'(d/2) = twice their gradient, so that a constant pressure pushes the first layer neither in nor out, since
///                  the pressure force is sum_j m_j (P_i + P_j) grad W_ij + rho_0 P_i grad share.
/// The force is thus the exact derivative of the density, which keeps energy. The two obvious alternatives do not work:
/// the half-space integral of the kernel has half the slope and lets pressure press the first layer against the wall;
/// doubling its force alone (mirrored pressure) pumps energy into still water until it boils over.
/// For walls of any shape the weight over the region behind them is w(r) = share''(r) / (2 pi r), whose integral over a
/// half-space is share.
class WallFunction {
 public:
  WallFunction() = default;

  /// @param smoothing_length, spacing [m], > 0.
  template <class Kernel>
  static WallFunction of(double smoothing_length, double spacing) {
    expects(std::isfinite(smoothing_length) && smoothing_length > 0, "WallFunction: smoothing length [m]", "> 0",
            smoothing_length);
    const double support = static_cast<double>(Kernel::support_factor) * smoothing_length;
    expects(spacing > 0 && support >= 1.5 * spacing, "WallFunction: particle spacing [m]",
            "> 0 and at most two thirds of the support radius", spacing);
    using Scalar = typename Kernel::Scalar;
    // the half-lattice that the wall stands in for, as seen from the first layer
    double added = 0, gradient = 0;
    const int reach = static_cast<int>(std::ceil(support / spacing));
    for (int k = 1; k <= reach; ++k) {
      for (int j = -reach; j <= reach; ++j) {
        for (int i = -reach; i <= reach; ++i) {
          const double r = spacing * std::sqrt(static_cast<double>(i * i + j * j + k * k));
          const auto h = static_cast<Scalar>(smoothing_length);
          added += static_cast<double>(Kernel::value(static_cast<Scalar>(r), h));
          gradient -= static_cast<double>(Kernel::derivative(static_cast<Scalar>(r), h)) * k * spacing / r;
        }
      }
    }
    const double volume = spacing * spacing * spacing;
    WallFunction wall;
    wall.reach_ = support - spacing;
    const double left = 1 - 0.5 * spacing / wall.reach_;
    wall.power_ = std::max(2 * gradient / added * left * wall.reach_, 2.1);  // share'' has to exist up to the reach
    wall.amplitude_ = added * volume / std::pow(left, wall.power_);
    return wall;
  }

  /// Distance from which a wall is not felt, R [m].
  double reach() const noexcept { return reach_; }

  /// What a plane at distance a adds, over rest density [-]; continued point-symmetrically behind the plane.
  double share(double a) const noexcept {
    const double front = amplitude_ * std::pow(left(std::abs(a)), power_);
    return a < 0 ? 2 * amplitude_ - front : front;
  }

  /// -d share / da [1/m]; even in a.
  double slope(double a) const noexcept {
    return amplitude_ * power_ / reach_ * std::pow(left(std::abs(a)), power_ - 1);
  }

  struct ShareAndSlope {
    double share;  ///< [-]
    double slope;  ///< [1/m]
  };

  /// Both at the price of one.
  ShareAndSlope share_and_slope(double a) const noexcept {
    const double l = left(std::abs(a));
    const double steep = amplitude_ * std::pow(l, power_ - 1);
    return {a < 0 ? 2 * amplitude_ - steep * l : steep * l, power_ / reach_ * steep};
  }

  /// What the sum over directions needs at one distance.
  struct Terms {
    double share;                ///< [-]
    double slope;                ///< [1/m]
    double radius_times_weight;  ///< [1/m^2]
  };

  /// share, slope and radius_times_weight at a >= 0 at the price of one of them: they are powers of one number.
  Terms terms(double a) const noexcept {
    const double l = left(a);
    const double power = amplitude_ * std::pow(l, power_ - 2);
    return {power * l * l, power_ / reach_ * power * l, power_ * (power_ - 1) / (reach_ * reach_) * power / (2 * pi)};
  }

  /// The distance at which a plane adds `share`, the inverse of share(a); -R .. R [m].
  double distance_for(double share) const noexcept {
    const double front = share > amplitude_ ? std::max(2 * amplitude_ - share, 0.0) : std::max(share, 0.0);
    const double a = reach_ * (1 - std::pow(front / amplitude_, 1 / power_));
    return share > amplitude_ ? -a : a;
  }

  /// r w(r) = share''(r) / (2 pi) [1/m^2]; w itself is singular at r = 0, its integrals are not.
  double radius_times_weight(double r) const noexcept {
    return amplitude_ * power_ * (power_ - 1) / (reach_ * reach_) * std::pow(left(r), power_ - 2) / (2 * pi);
  }

 private:
  static constexpr double pi = 3.14159265358979323846;

  double left(double a) const noexcept { return std::max(1 - a / reach_, 0.0); }

  double reach_ = 0;
  double amplitude_ = 0;
  double power_ = 0;
};

}  // namespace decant::inline DECANT_TARGET
