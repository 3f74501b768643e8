// SPDX-License-Identifier: MIT
#pragma once

/// Resistance of a medium that liquid is too fast for to pass smoothly.

#include <limits>

#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// a = -drag |u| u with u = v - medium: the form drag of what flies through a medium at a high Reynolds number
/// (Batchelor 1967, "An Introduction to Fluid Dynamics", chapter 5), where LinearDrag is that of what creeps. A drop of
/// diameter D and density rho in a gas of density rho_g has drag = (3/4) c_d rho_g / (rho D), c_d about 0.5 for a ball:
/// 0.11 1/m for water drops of 4 mm in air. What falls gets as fast as sqrt(g / drag). Taken over a sub-step as a
/// whole: of the drag alone, 1 / |u| grows by drag * t exactly, however long sub-steps are, and nothing overshoots.
/// With a drag of zero it costs nothing and changes no bit.
template <class ScalarType>
struct QuadraticDrag {
  using Scalar = ScalarType;

  Scalar drag = 0;                  ///< [1/m], >= 0, finite
  Vector3<Scalar> medium{0, 0, 0};  ///< velocity of what slows the liquid [m/s]

  template <class Step>
  void accumulate(const Step& step, PointArray<Scalar>& acceleration) noexcept {
    if (drag > 0 && step.time_step > 0) {
      parallel_for(step.fluid.size(), step.threads, [&](Index i) {
        const Vector3<Scalar> past = step.fluid.velocity.col(i) - medium;
        const Scalar rate = drag * past.norm();
        acceleration.col(i) -= rate / (1 + rate * step.time_step) * past;
      });
    }
  }

  template <class Step>
  Scalar largest_step(const Step&) const noexcept {
    return std::numeric_limits<Scalar>::infinity();
  }
};

}  // namespace decant::inline DECANT_TARGET
