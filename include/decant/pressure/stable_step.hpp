// SPDX-License-Identifier: MIT
#pragma once

/// How long a sub-step may be under pressure.

#include <algorithm>
#include <cmath>
#include <limits>

#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Pressure holds particles in place against modes that the density does not see (every other one up, every other one
/// down) with the stiffness p / (rho d^2), and a sub-step integrates that explicitly, whatever solver finds the
/// pressure. With Dfsph at its own tolerances and ResidualViscosity acting after the pressure in up to two passes,
/// columns of 60 layers stand still at 0.6 d / sqrt(p / rho), and ones of 80 at 0.4; at 0.5, 80 layers collapse into
/// themselves, and at 0.8, 40. With one pass they seethe from 0.6 on, without that viscosity they collapse at 0.35.
/// Taken for twice the mean pressure, which is the largest of a liquid at rest. Liquid that is too dense all the same,
/// after an impact on a deep pool for one, needs steps in which particles move little against each other: at a third of
/// the usual and below, even what has collapsed stands up again.
/// @param mean_pressure over rest density, of what is under pressure [m^2/s^2]. @param density_tolerance that the
/// solver keeps to in the mean [-], infinity for solvers that had better not slow down. @param stability_number as
/// above [-]. @return [s], infinity without pressure.
template <class Step>
typename Step::Scalar largest_stable_step(const Step& step, double mean_pressure, double density_tolerance,
                                          double stability_number) noexcept {
  using Scalar = typename Step::Scalar;
  if (!(mean_pressure > 0)) {
    return std::numeric_limits<Scalar>::infinity();
  }
  double excess = 0;
  for (Index i = 0; i < step.fluid.size(); ++i) {
    excess += static_cast<double>(std::max(step.fluid.density[i] / step.rest_density - 1, Scalar(0)));
  }
  excess /= static_cast<double>(step.fluid.size());
  const double caution = std::clamp(3 * density_tolerance / excess, 0.15, 1.0);
  return static_cast<Scalar>(caution * stability_number * static_cast<double>(step.spacing) /
                             std::sqrt(2 * mean_pressure));
}

}  // namespace decant::inline DECANT_TARGET
