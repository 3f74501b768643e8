// SPDX-License-Identifier: MIT
#pragma once

/// How far apart two points are: in open space, or in a box that repeats itself along some axes.

#include <array>
#include <cmath>
#include <concepts>
#include <limits>

#include <decant/core/batch.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Ordinary space.
struct OpenDomain {
  static constexpr bool periodic = false;

  /// a - b along one axis (0, 1, 2); numbers or batches of them.
  template <class Number>
  [[gnu::always_inline]] Number separation(int /*axis*/, Number a, Number b) const noexcept {
    return a - b;
  }

  /// The vector from b to a.
  template <class Scalar>
  [[gnu::always_inline]] Vector3<Scalar> separation(const Vector3<Scalar>& a, const Vector3<Scalar>& b) const noexcept {
    return a - b;
  }

  template <class Scalar>
  Vector3<Scalar> wrap(const Vector3<Scalar>& x) const noexcept {
    return x;
  }
};

/// Space that repeats itself along the axes whose period is not 0. Positions need not be wrapped: separations are those
/// of the nearest images, up to 2^22 (float) or 2^51 (double) periods apart.
template <std::floating_point Scalar>
class PeriodicDomain {
 public:
  static constexpr bool periodic = true;

  /// Open along all axes.
  PeriodicDomain() = default;

  /// @param period length of one repetition along x, y, z [m], finite and >= 0; 0 stands for an open axis.
  explicit PeriodicDomain(const Vector3<Scalar>& period) {
    for (int axis = 0; axis < 3; ++axis) {
      expects(period[axis] >= 0 && std::isfinite(period[axis]), "PeriodicDomain: period [m]", ">= 0 and finite",
              period[axis]);
      period_[axis] = period[axis];
      inverse_[axis] = period[axis] > 0 ? 1 / period[axis] : 0;
    }
  }

  const Vector3<Scalar>& period() const noexcept { return period_; }

  /// The shortest of all a - b + k period along one axis; the negative of separation(axis, b, a).
  template <class Number>
  [[gnu::always_inline]] Number separation(int axis, Number a, Number b) const noexcept {
    // Adding and taking off 1.5 * 2^(digits-1) rounds to the nearest integer without a rounding instruction.
    constexpr Scalar shift = Scalar(1.5) / std::numeric_limits<Scalar>::epsilon();
    const Number difference = a - b;
    const Number images = (difference * Number(inverse_[axis]) + Number(shift)) - Number(shift);
    return multiply_add(Number(-period_[axis]), images, difference);
  }

  /// The shortest vector from an image of b to a.
  [[gnu::always_inline]] Vector3<Scalar> separation(const Vector3<Scalar>& a, const Vector3<Scalar>& b) const noexcept {
    return {separation(0, a[0], b[0]), separation(1, a[1], b[1]), separation(2, a[2], b[2])};
  }

  /// The image of x with 0 <= x < period along periodic axes.
  Vector3<Scalar> wrap(const Vector3<Scalar>& x) const noexcept {
    Vector3<Scalar> wrapped = x;
    for (int axis = 0; axis < 3; ++axis) {
      if (period_[axis] > 0) {
        const Scalar rest = x[axis] - period_[axis] * std::floor(x[axis] * inverse_[axis]);
        // Rounding can leave the half-open interval at either end; both ends are the same place.
        wrapped[axis] = rest >= 0 && rest < period_[axis] ? rest : rest - rest;
      }
    }
    return wrapped;
  }

 private:
  Vector3<Scalar> period_ = Vector3<Scalar>::Zero();
  Vector3<Scalar> inverse_ = Vector3<Scalar>::Zero();
};

}  // namespace decant::inline DECANT_TARGET
