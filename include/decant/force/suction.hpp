// SPDX-License-Identifier: MIT
#pragma once

/// A pull toward a point: a hose that draws liquid in, a plunger.

#include <cmath>
#include <limits>

#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Acceleration toward a point by the law of a sink. Liquid that flows into a point from all sides passes each sphere
/// around it at the same rate, so its speed, and the acceleration with which it starts from rest, fall as 1 / r^2
/// (Batchelor 1967, "An Introduction to Fluid Dynamics", section 2.5). Within about core_radius c that is softened as
/// by Plummer 1911 (Mon. Not. R. Astron. Soc. 71), since a hose has a width and the sink must not pull without bounds:
///   a = -K x / (r^2 + c^2)^(3/2),   K chosen so that |a| = strength at r = reference_distance,
/// with x from the point, r = |x|. It is zero at the point itself and largest, 0.385 K / c^2, at r = c / sqrt(2).
/// It has the potential -K / sqrt(r^2 + c^2), as weight has: liquid that fills a closed vessel only gets another
/// pressure from it, and what moves is liquid with a surface that is free to. Walls do not shield it. It takes no
/// liquid away: what has arrived stays around the point, unless particles there are removed. A negative strength blows
/// instead of drawing; a strength of zero costs nothing and changes no bit, nor does one with a distance or radius that
/// is out of range.
template <class ScalarType>
struct Suction {
  using Scalar = ScalarType;

  Scalar strength = 0;                       ///< acceleration at reference_distance [m/s^2], finite
  Vector3<Scalar> point{0, 0, 0};            ///< where to, world frame [m]
  Scalar reference_distance = Scalar(0.05);  ///< [m], > 0
  Scalar core_radius = Scalar(0.01);         ///< c [m], > 0: about the radius of the opening, a spacing or more

  template <class Step>
  void accumulate(const Step& step, PointArray<Scalar>& acceleration) noexcept {
    const Scalar core = core_strength();
    if (core == 0) {
      return;
    }
    // lengths in units of c: cubes of millimetres are safe from the end of float's range
    const Scalar per_core = 1 / core_radius;
    parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      const Vector3<Scalar> q = per_core * (point - step.fluid.position.col(i));
      const Scalar softened = 1 + q.squaredNorm();
      acceleration.col(i) += core / (softened * std::sqrt(softened)) * q;
    });
  }

  /// What is drawn in swings through the core, about the point with the angular frequency sqrt(K / c^3): a quarter of
  /// its inverse, an eighth of the stability limit.
  template <class Step>
  Scalar largest_step(const Step&) const noexcept {
    const Scalar core = std::abs(core_strength());
    return core > 0 ? Scalar(0.25) * std::sqrt(core_radius / core) : std::numeric_limits<Scalar>::infinity();
  }

 private:
  /// K / c^2 [m/s^2]; 0 where nothing is to be done.
  Scalar core_strength() const noexcept {
    if (!(reference_distance > 0) || !(core_radius > 0) || !std::isfinite(strength)) {
      return 0;
    }
    const Scalar q = reference_distance / core_radius;
    const Scalar softened = 1 + q * q;
    return strength * softened * std::sqrt(softened) / q;
  }
};

}  // namespace decant::inline DECANT_TARGET
