// SPDX-License-Identifier: MIT
#pragma once

/// A pull on all liquid for a while.

#include <algorithm>
#include <limits>

#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// The same acceleration for every particle, beside Gravity and at times from <= t < until only: a gust or a steady
/// wind across, a table that is not level, a vehicle that brakes (in its own frame). Of a sub-step that lies partly in
/// the window, the share that does counts, so that what a window does to velocities, pull * (until - from), depends
/// neither on sub-steps nor on frames. At rest under it, a surface stands at the angle atan(pull / g) to the
/// horizontal. Simulator::settle lets time run on before it turns it back: windows that open shortly after act while it
/// settles. A pull of zero costs nothing and changes no bit; nor does a window that ends before it begins, or with a
/// NaN.
template <class ScalarType>
struct BodyAcceleration {
  using Scalar = ScalarType;

  // not `acceleration`: the simulator sets what is called so to gravity
  Vector3<Scalar> pull{0, 0, 0};                            ///< [m/s^2], world frame, finite
  double from = -std::numeric_limits<double>::infinity();   ///< simulation time [s]
  double until = +std::numeric_limits<double>::infinity();  ///< simulation time [s]

  template <class Step>
  void accumulate(const Step& step, PointArray<Scalar>& acceleration) noexcept {
    if ((pull.array() == 0).all() || !(step.time_step > 0)) {
      return;
    }
    const auto duration = static_cast<double>(step.time_step);
    // of two numbers of which the first is NaN, std::max and std::min return the first
    const double begin = std::max(from - step.time, 0.0), end = std::min(until - step.time, duration);
    const double share = (end - begin) / duration;  // exactly 1 inside of the window
    if (share > 0) {
      acceleration.colwise() += static_cast<Scalar>(share) * pull;
    }
  }

  template <class Step>
  Scalar largest_step(const Step&) const noexcept {
    return std::numeric_limits<Scalar>::infinity();  // the simulator's own limit on distance per sub-step covers it
  }
};

}  // namespace decant::inline DECANT_TARGET
