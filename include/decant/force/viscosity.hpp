// SPDX-License-Identifier: MIT
#pragma once

/// Internal friction of a thin liquid, and friction at walls that hold it.

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include <decant/boundary/wall_state.hpp>
#include <decant/core/batch.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
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
    using B = Batch<Scalar>;
    const Index count = step.fluid.size();
    velocity_.resize(4 * static_cast<std::size_t>(count));
    parallel_for(count, step.threads, [&](Index i) {
      for (Index axis = 0; axis < 3; ++axis) {
        velocity_[static_cast<std::size_t>(4 * i + axis)] = step.fluid.velocity(axis, i);
      }
    });
    const detail::ViscousPair<Scalar> weight(static_cast<Scalar>(Kernel::support_factor) * step.smoothing_length);
    const Scalar factor = -kinematic_viscosity / step.rest_density;
    parallel_for(count, step.threads, [&](Index i) {
      const Scalar* own = &velocity_[static_cast<std::size_t>(4 * i)];
      const B own_x(own[0]), own_y(own[1]), own_z(own[2]);
      B x(Scalar(0)), y(Scalar(0)), z(Scalar(0));
      step.neighbors.for_each_batch(i, [&](const auto& pair) {
        const auto other = gather3(velocity_.data(), pair.neighbor);
        const B approach = (own_x - other.x) * pair.x + (own_y - other.y) * pair.y + (own_z - other.z) * pair.z;
        const B push = step.mass(pair.neighbor) * approach * weight(pair.distance_squared);
        x = multiply_add(push, pair.x, x);
        y = multiply_add(push, pair.y, y);
        z = multiply_add(push, pair.z, z);
      });
      acceleration.col(i) += factor * Vector3<Scalar>(sum_each(std::array{x, y, z}).data());
      add_wall_friction(step, i, acceleration);
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
  template <class Step>
  void add_wall_friction(const Step& step, Index i, PointArray<Scalar>& acceleration) const noexcept {
    const WallContact<Scalar>* contacts = step.walls.contacts_of(i);
    Vector3<Scalar> velocity = step.fluid.velocity.col(i);  // after the walls so far
    for (int k = 0; k < step.walls.contact_count[i]; ++k) {
      const WallContact<Scalar>& contact = contacts[k];
      const Scalar steepness = contact.gradient.norm();
      if (!(contact.friction > 0) || !(steepness > 0)) {
        continue;
      }
      const Vector3<Scalar> normal = contact.gradient / steepness;
      const Vector3<Scalar> slip = velocity - contact.velocity;
      const Scalar rate = std::min(kinematic_viscosity * contact.friction, 1 / step.time_step);
      const Vector3<Scalar> pull = -rate * (slip - slip.dot(normal) * normal);
      velocity += step.time_step * pull;
      acceleration.col(i) += pull;
    }
  }

  std::vector<Scalar> velocity_{};  ///< records of four, the last one unused
};

}  // namespace decant::inline DECANT_TARGET
