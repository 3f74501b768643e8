// SPDX-License-Identifier: MIT
#pragma once

/// Internal friction of a thin liquid, and friction at walls that hold it.

#include <limits>
#include <vector>

#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/force/detail/viscous_friction.hpp>
#include <decant/force/detail/viscous_pair.hpp>

namespace decant::inline DECANT_TARGET {

/// Newtonian viscosity between pairs, in the form of Cleary and Monaghan 1999 (see Monaghan 2005, "Smoothed particle
/// hydrodynamics", Rep. Prog. Phys. 68, section 5) with D = 3 dimensions,
///   a_i = 2 (D + 2) nu sum_j (m_j / rho_0) (v_ij . x_ij) / r^2 grad W_ij
/// and a kernel of its own, whose slope is that of a hat: -W' / r = 45 / (2 pi R^5) (1 - r / R) with the support
/// radius R.
/// The force acts along the line between two particles, so that linear and angular momentum are kept to rounding;
/// rigid rotation is not damped. We take the rest density where the source has rho_j: equal for both of a pair, and
/// right at a free surface, where a summed density is short of half its neighbours.
/// Why not the simulation's kernel: such a force sees nu through sums of x^2 z^2 and x^4 over the neighbours, and
/// density kernels leave nearly all of it to the nearest of these. With the cubic spline of support 2 d, liquid in
/// layers (any channel flow) had 0.75 to 0.82 nu for shear across them; a lattice 0.72 nu for shear along its axes and
/// 1.23 nu for strain. The hat has 0.98 to 1.01 nu in layers, 1.06 and 0.94 nu on a lattice, and half to a quarter of
/// the noise with which a disordered liquid answers shear.
/// Walls that hold the liquid (WallContact::friction) pull with the rate nu * friction at its velocity along the wall,
/// and take at most all of that velocity in a sub-step: nothing overshoots however near the wall. An implicit pull,
/// rate / (1 + rate dt), would let steady flow slip by rate dt; one that counts in the sub-step's other forces would
/// hold up liquid at rest at upright walls, where pressure, which comes later, balances gravity.
/// Explicit in time, hence only for thin liquids: beyond about 1e-2 m^2/s take ViscosityWeiler2018. A viscosity of zero
/// costs nothing.
template <class ScalarType>
struct Viscosity {
  using Scalar = ScalarType;

  Scalar kinematic_viscosity = Scalar(1.0034e-6);  ///< nu [m^2/s], >= 0; water at 20 degrees Celsius

  template <class Step>
  void accumulate(const Step& step, PointArray<Scalar>& acceleration) noexcept {
    if (!(kinematic_viscosity > 0)) {
      return;
    }
    using Kernel = typename Step::Kernel;
    detail::note_velocities(step, velocity_);
    const detail::ViscousPair<Scalar> weight(static_cast<Scalar>(Kernel::support_factor) * step.smoothing_length);
    const Scalar factor = -kinematic_viscosity / step.rest_density;
    parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      acceleration.col(i) += factor * detail::sum_of_pushes(step, i, velocity_, weight,
                                                            [](const auto& push, const auto&) { return push; });
      detail::add_wall_friction(step, i, acceleration,
                                [this](const auto&, const auto&) { return kinematic_viscosity; });
    });
  }

  template <class Step>
  Scalar largest_step(const Step& step) const noexcept {
    if (!(kinematic_viscosity > 0)) {
      return std::numeric_limits<Scalar>::infinity();
    }
    // An explicit step is stable below 2 over the largest eigenvalue, 2 nu / 3 times this. Three quarters of that leave
    // room for uneven particles: 0.13 d^2 / nu for support 2 d.
    const detail::ViscousPair<Scalar> weight(static_cast<Scalar>(Step::Kernel::support_factor) * step.smoothing_length);
    return Scalar(0.75) * 3 / (kinematic_viscosity * weight.stiffness(step.spacing));
  }

 private:
  std::vector<Scalar> velocity_{};  ///< records of four, the last one unused
};

}  // namespace decant::inline DECANT_TARGET
