// SPDX-License-Identifier: MIT
#pragma once

/// Air that cannot get in past the liquid that runs out of a narrow neck.

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <decant/core/parallel.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// What the under-pressure behind a plug of liquid in a neck does to it: liquid in the neck that moves out of it,
/// relative to the container, is held back by
///   a = -strength (1 - cos(2 pi (t - from) / (until - from))) axis,   but by no more than brings it to rest,
/// with the axis out of the mouth: in the mean, for a plug as long as `reach`, an under-pressure of rho strength reach.
/// It falls off when a bubble comes in, and builds up again as liquid leaves (Clanet and Searby 2004, J. Fluid Mech.
/// 510, "On the glug-glug of ideal bottles"). Without a beat it is the mean over many bubbles, -strength axis. Pressure
/// never pushes liquid back in: then air comes in instead. Bubbles themselves are not resolved. A strength of zero
/// costs nothing and changes no bit; nor does one of a neck without length or radius.
template <class ScalarType>
struct BackPressure {
  using Scalar = ScalarType;

  /// From one bubble to the next, in the simulation's time [s].
  struct Beat {
    double from = 0, until = 0;  ///< one of them, and so before and after it; none unless from < until, both finite

    /// Of the mean under-pressure, at a time: 0 to 2.
    double share(double time) const noexcept {
      const double period = until - from;
      return period > 0 && std::isfinite(period) ? 1 - std::cos(2 * std::numbers::pi * (time - from) / period) : 1;
    }
  };

  Scalar strength = 0;                              ///< in the mean [m/s^2], >= 0
  Beat beat{};                                      ///<
  Vector3<double> mouth = Vector3<double>::Zero();  ///< its middle, in the container's frame [m]
  Vector3<double> axis = Vector3<double>::UnitZ();  ///< out of it, in the container's frame, unit length
  double reach = 0.04;                              ///< length of the neck behind the mouth [m]
  double radius = 0.02;                             ///< within which liquid is in the neck [m]
  PoseTrack container{};                            ///< world from container, in the simulation's time

  template <class Step>
  void accumulate(const Step& step, PointArray<Scalar>& acceleration) noexcept {
    if (!(strength > 0) || !(step.time_step > 0)) {
      return;
    }
    const double duration = static_cast<double>(step.time_step);
    const Pose now = container.at(step.time), next = container.at(step.time + duration), into = now.inverse();
    const Vector3<double> out = now.rotation * axis;
    const double most = static_cast<double>(strength) * beat.share(step.time + 0.5 * duration);
    parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      const Vector3<double> x = step.fluid.position.col(i).template cast<double>();
      const Vector3<double> own = into * x, past = own - mouth;
      const double depth = -past.dot(axis);
      if (!(depth > 0 && depth < reach && (past + depth * axis).norm() < radius)) {
        return;
      }
      const Vector3<double> wall = (next * own - x) / duration;
      const double outflow = out.dot(step.fluid.velocity.col(i).template cast<double>() - wall);
      if (outflow > 0) {
        acceleration.col(i) -= static_cast<Scalar>(std::min(most, outflow / duration)) * out.cast<Scalar>();
      }
    });
  }

  template <class Step>
  Scalar largest_step(const Step&) const noexcept {
    return std::numeric_limits<Scalar>::infinity();  // it stops what moves, and never turns it round
  }
};

}  // namespace decant::inline DECANT_TARGET
