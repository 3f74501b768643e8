// SPDX-License-Identifier: MIT
#pragma once

/// Weight.

#include <limits>

#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// The same acceleration for every particle.
template <class ScalarType>
struct Gravity {
  using Scalar = ScalarType;

  Vector3<Scalar> acceleration{0, 0, Scalar(-9.81)};  ///< [m/s^2], world frame

  template <class Step>
  void accumulate(const Step&, PointArray<Scalar>& total) noexcept {
    total.colwise() += acceleration;
  }

  template <class Step>
  Scalar largest_step(const Step&) const noexcept {
    return std::numeric_limits<Scalar>::infinity();  // the simulator's own limit on distance per sub-step covers it
  }
};

}  // namespace decant::inline DECANT_TARGET
