// SPDX-License-Identifier: MIT
#pragma once

/// Internal friction of a thin liquid, and friction at walls that hold it.

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <decant/boundary/wall_state.hpp>
#include <decant/core/batch.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/types.hpp>
#include <decant/force/detail/pair_stiffness.hpp>

namespace decant {

/// Newtonian viscosity between pairs, after Cleary and Monaghan 1999 and in the form of Monaghan 2005 ("Smoothed particle
/// hydrodynamics", Rep. Prog. Phys. 68, section 5), with D = 3 dimensions:
///   a_i = 2 (D + 2) nu sum_j (m_j / rho_0) (v_ij . x_ij) / (r^2 + 0.01 h^2) grad W_ij
/// The force acts along the line between two particles, so that linear and angular momentum are kept to rounding; rigid
/// rotation is not damped. We take the rest density where the source has rho_j: equal for both of a pair, and right at a
/// free surface, where a summed density is short of half its neighbours.
/// Walls that hold the liquid (WallContact::friction) pull with the rate nu * friction at its velocity along the wall,
/// taken implicitly: nothing overshoots however near the wall.
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
    const Scalar h = step.smoothing_length;
    const Scalar softening = Scalar(0.01) * h * h;
    const Scalar factor = 10 * kinematic_viscosity / step.rest_density;
    const Scalar* mass = step.fluid.mass.data();
    parallel_for(count, step.threads, [&](Index i) {
      const Scalar* own = &velocity_[static_cast<std::size_t>(4 * i)];
      const B own_x(own[0]), own_y(own[1]), own_z(own[2]);
      B x(Scalar(0)), y(Scalar(0)), z(Scalar(0));
      step.neighbors.for_each_batch(i, [&](const auto& pair) {
        const auto other = gather3(velocity_.data(), pair.neighbor);
        const B approach = (own_x - other.x) * pair.x + (own_y - other.y) * pair.y + (own_z - other.z) * pair.z;
        const B slope = Kernel::derivative_over_radius(square_root(pair.distance_squared), h);
        const B push = gather(mass, pair.neighbor) * approach * slope / (pair.distance_squared + softening);
        x = multiply_add(push, pair.x, x);
        y = multiply_add(push, pair.y, y);
        z = multiply_add(push, pair.z, z);
      });
      acceleration.col(i) += factor * Vector3<Scalar>(sum(x), sum(y), sum(z));
      add_wall_friction(step, i, acceleration);
    });
  }

  template <class Step>
  Scalar largest_step(const Step& step) const noexcept {
    if (!(kinematic_viscosity > 0)) {
      return std::numeric_limits<Scalar>::infinity();
    }
    // Largest eigenvalue of the pair operator <= 2 * 10 nu / 3 * sum_j V_j |W'| / r; an explicit step is stable below 2
    // over it. Three quarters of that leave room for uneven particles: 0.1 d^2 / nu for the cubic spline of support 2 d.
    const Scalar stiffness = detail::pair_stiffness<typename Step::Kernel>(step.smoothing_length, step.spacing);
    return Scalar(0.75) * Scalar(0.3) / (kinematic_viscosity * stiffness);
  }

 private:
  template <class Step>
  void add_wall_friction(const Step& step, Index i, PointArray<Scalar>& acceleration) const noexcept {
    const WallContact<Scalar>* contacts = step.walls.contacts_of(i);
    for (int k = 0; k < step.walls.contact_count[i]; ++k) {
      const WallContact<Scalar>& contact = contacts[k];
      const Scalar steepness = contact.gradient.norm();
      if (!(contact.friction > 0) || !(steepness > 0)) {
        continue;
      }
      const Vector3<Scalar> normal = contact.gradient / steepness;
      const Vector3<Scalar> slip = step.fluid.velocity.col(i) - contact.velocity;
      const Scalar rate = kinematic_viscosity * contact.friction;
      acceleration.col(i) -= rate / (1 + rate * step.time_step) * (slip - slip.dot(normal) * normal);
    }
  }

  std::vector<Scalar> velocity_{};  ///< records of four, the last one unused
};

}  // namespace decant
