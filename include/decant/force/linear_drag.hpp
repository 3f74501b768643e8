// SPDX-License-Identifier: MIT
#pragma once

/// Friction that slows all motion.

#include <cmath>
#include <limits>

#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// a = -rate (v - medium): a stand-in for what takes speed out of liquid and is not resolved, such as the air around
/// a jet that breaks up. Taken over a sub-step as a whole, so that speed falls as exp(-rate t) however long sub-steps
/// are. With a rate of zero it costs nothing and changes no bit.
template <class ScalarType>
struct LinearDrag {
  using Scalar = ScalarType;

  Scalar rate = 0;                  ///< [1/s], >= 0
  Vector3<Scalar> medium{0, 0, 0};  ///< velocity of what slows the liquid [m/s]

  template <class Step>
  void accumulate(const Step& step, PointArray<Scalar>& acceleration) noexcept {
    if (rate > 0 && step.time_step > 0) {
      const Scalar mean_rate = -std::expm1(-rate * step.time_step) / step.time_step;
      parallel_for(step.fluid.size(), step.threads,
                   [&](Index i) { acceleration.col(i) -= mean_rate * (step.fluid.velocity.col(i) - medium); });
    }
  }

  template <class Step>
  Scalar largest_step(const Step&) const noexcept {
    return std::numeric_limits<Scalar>::infinity();
  }
};

}  // namespace decant::inline DECANT_TARGET
