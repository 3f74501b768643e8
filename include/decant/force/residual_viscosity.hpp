// SPDX-License-Identifier: MIT
#pragma once

/// Friction for what particles do and the liquid does not: motion too fine for the spacing to mean anything.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <decant/boundary/wall_state.hpp>
#include <decant/core/batch.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/force/detail/pair_stiffness.hpp>

namespace decant::inline DECANT_TARGET {

/// Numerical viscosity that acts on velocity differences only so far as they are not linear in space:
///   a_i = 10 nu sum_j (m_j / rho_0) (e_ij . x_ij) / (r^2 + 0.01 h^2) grad W_ij,   e_ij = v_ij - (G_i + G_j) x_ij / 2
/// with the velocity gradients G_i = sum_j V_j (v_j - v_i) (L_i grad W_ij)^T and the corrected kernel gradients of
/// GradientCorrection. Jitter from particle to particle is damped as by a viscosity nu, a wave of wave number k by
/// (k d)^2 less: the idea of limiting artificial viscosity by a linear reconstruction is from Frontiere, Raskin and
/// Owen 2017, "CRKSPH" (J. Comput. Phys. 332). The force acts along the line between two particles, so linear and
/// angular momentum are kept to rounding. Pressure p holds particles in place with the stiffness p / (rho_0 d^2), and
/// the deeper the liquid the more jitter that makes: of a pair, nu is the mean of
///   nu_i = max(numerical_viscosity, pressure_share d sqrt(p_i / rho_0)).
/// Where that is more than an explicit sub-step stands it acts in several passes, each on the velocities that the one
/// before has left, with the gradients of the first, and with what most_passes stand at most. Under pressure, each pass
/// lets sub-steps be longer: with the share g of jitter that is left over, x'' = -w^2 x is stable to w dt = 2 in one
/// that does not damp, and to sqrt(2 (1 + g) / g) in one that damps afterwards.
/// It acts after the pressure. Before it, the velocities by which particles are moved would still contain what pressure
/// has just done to them: x'' = -w^2 x is then overshot beyond w dt = sqrt(2) where friction is strong, and never after
/// it.
template <class ScalarType>
struct ResidualViscosity {
  using Scalar = ScalarType;
  static constexpr bool uses_gradient_correction = true;
  static constexpr bool acts_after_pressure = true;

  Scalar numerical_viscosity = Scalar(6e-4);  ///< the least nu [m^2/s], >= 0
  Scalar pressure_share = Scalar(0.2);        ///< [-], >= 0
  int most_passes = 2;                        ///< per sub-step, >= 1

  template <class Step>
  void accumulate(const Step& step, PointArray<Scalar>& acceleration) noexcept {
    if (!(numerical_viscosity > 0) && !(pressure_share > 0)) {
      return;
    }
    const int passes = note_velocities(step);
    compute_gradients(step);
    next_.resize(velocity_.size());
    for (int pass = 0; pass < passes; ++pass) {
      brake(step, acceleration);
      velocity_.swap(next_);
    }
  }

  /// None: the viscosity gives way to the sub-step.
  template <class Step>
  Scalar largest_step(const Step&) const noexcept {
    return std::numeric_limits<Scalar>::infinity();
  }

 private:
  /// And how viscous each particle is in a pass. @return how many passes it takes.
  template <class Step>
  int note_velocities(const Step& step) noexcept {
    // three quarters of what an explicit step of the pair operator stands on a lattice, see Viscosity
    const Scalar stiffness = detail::pair_stiffness<typename Step::Kernel>(step.smoothing_length, step.spacing);
    const Scalar most = Scalar(0.75) * Scalar(0.3) / (step.time_step * stiffness);
    velocity_.resize(4 * static_cast<std::size_t>(step.fluid.size()));
    const Scalar wanted = largest_.over(
        step.fluid.size(), step.threads, Scalar(0),
        [&](Index begin, Index end) {
          Scalar largest = 0;
          for (Index i = begin; i < end; ++i) {
            Scalar* const record = &velocity_[4 * static_cast<std::size_t>(i)];
            record[0] = step.fluid.velocity(0, i);
            record[1] = step.fluid.velocity(1, i);
            record[2] = step.fluid.velocity(2, i);
            const Scalar head = std::max(step.fluid.pressure[i], Scalar(0)) / step.rest_density;
            record[3] = std::max(numerical_viscosity, pressure_share * step.spacing * std::sqrt(head));
            largest = std::max(largest, record[3]);
          }
          return largest;
        },
        [](Scalar a, Scalar b) { return std::max(a, b); });
    int passes = 1;
    while (passes < most_passes && wanted > static_cast<Scalar>(passes) * most) {
      ++passes;
    }
    parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      Scalar& nu = velocity_[4 * static_cast<std::size_t>(i) + 3];
      nu = std::min(most, nu / static_cast<Scalar>(passes));
    });
    return passes;
  }

  /// One pass: adds what it does to the velocities, and puts these as they are afterwards into next_.
  template <class Step>
  void brake(const Step& step, PointArray<Scalar>& acceleration) noexcept {
    using B = Batch<Scalar>;
    const Scalar h = step.smoothing_length;
    const Scalar softening = Scalar(0.01) * h * h;
    const Scalar factor = 5 / step.rest_density;  // half of each one's nu
    parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      const auto own = 4 * static_cast<std::size_t>(i);
      const Scalar *const velocity = &velocity_[own], *const stretch = &stretch_[own], *const shear = &shear_[own];
      B x(Scalar(0)), y(Scalar(0)), z(Scalar(0));
      step.neighbors.for_each_batch(i, [&](const auto& pair) {
        const auto other = gather4(velocity_.data(), pair.neighbor);
        const auto other_stretch = gather4(stretch_.data(), pair.neighbor);
        const auto other_shear = gather3(shear_.data(), pair.neighbor);
        // only the symmetric part of G has a say in x . G x
        const B along_x = (other_stretch.x + stretch[0]) * pair.x + (other_shear.x + shear[0]) * pair.y,
                along_y = (other_stretch.y + stretch[1]) * pair.y + (other_shear.z + shear[2]) * pair.z,
                along_z = (other_stretch.z + stretch[2]) * pair.z + (other_shear.y + shear[1]) * pair.x;
        const B half(Scalar(0.5));
        const B residual = (velocity[0] - other.x - half * along_x) * pair.x +
                           (velocity[1] - other.y - half * along_y) * pair.y +
                           (velocity[2] - other.z - half * along_z) * pair.z;
        const B slope = step.pairs.slope(pair.slot);
        const B nu = velocity[3] + other.w;
        const B push = nu * other_stretch.w * residual * slope / (pair.distance_squared + softening);
        x = multiply_add(push, pair.x, x);
        y = multiply_add(push, pair.y, y);
        z = multiply_add(push, pair.z, z);
      });
      const Vector3<Scalar> pull = factor * Vector3<Scalar>(sum_each(std::array{x, y, z}).data());
      acceleration.col(i) += pull;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        next_[own + axis] = velocity[axis] + step.time_step * pull[static_cast<Index>(axis)];
      }
      next_[own + 3] = velocity[3];
    });
  }

  /// Walls take part as liquid that moves with them along their normal.
  template <class Step>
  void compute_gradients(const Step& step) noexcept {
    using B = Batch<Scalar>;
    const Index count = step.fluid.size();
    stretch_.resize(4 * static_cast<std::size_t>(count));
    shear_.resize(4 * static_cast<std::size_t>(count));
    const Scalar* mass = step.fluid.mass.data();
    parallel_for(count, step.threads, [&](Index i) {
      const auto own = 4 * static_cast<std::size_t>(i);
      const B zero(Scalar(0));
      std::array<Batch3<Scalar>, 3> rows{{{zero, zero, zero}, {zero, zero, zero}, {zero, zero, zero}}};
      step.neighbors.for_each_batch(i, [&](const auto& pair) {
        const B slope = step.mass(pair.neighbor) * step.pairs.slope(pair.slot);
        const auto other = gather3(velocity_.data(), pair.neighbor);
        const std::array<B, 3> apart{other.x - velocity_[own], other.y - velocity_[own + 1],
                                     other.z - velocity_[own + 2]};
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const B weight = slope * apart[axis];
          rows[axis].x = multiply_add(weight, pair.x, rows[axis].x);
          rows[axis].y = multiply_add(weight, pair.y, rows[axis].y);
          rows[axis].z = multiply_add(weight, pair.z, rows[axis].z);
        }
      });
      const std::array<Scalar, 9> pairs = sum_each(std::array{rows[0].x, rows[0].y, rows[0].z, rows[1].x, rows[1].y,
                                                              rows[1].z, rows[2].x, rows[2].y, rows[2].z});
      std::array<Vector3<Scalar>, 3> sums;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        sums[axis] = Vector3<Scalar>(&pairs[3 * axis]) / step.rest_density;
      }
      const WallContact<Scalar>* contacts = step.walls.contacts_of(i);
      for (int k = 0; k < step.walls.contact_count[i]; ++k) {
        const Vector3<Scalar>& wall = contacts[k].gradient;
        const Scalar squared = wall.squaredNorm();
        if (squared > 0) {
          const Scalar approach = (contacts[k].velocity - step.fluid.velocity.col(i)).dot(wall) / squared;
          for (std::size_t axis = 0; axis < 3; ++axis) {
            sums[axis] += approach * wall[static_cast<Index>(axis)] * wall;
          }
        }
      }
      const Vector3<Scalar> x = step.correction.apply(i, sums[0]), y = step.correction.apply(i, sums[1]),
                            z = step.correction.apply(i, sums[2]);
      Scalar *const stretch = &stretch_[own], *const shear = &shear_[own];
      stretch[0] = x[0];
      stretch[1] = y[1];
      stretch[2] = z[2];
      stretch[3] = mass[i];
      shear[0] = x[1] + y[0];
      shear[1] = x[2] + z[0];
      shear[2] = y[2] + z[1];
      shear[3] = 0;
    });
  }

  // records of four
  std::vector<Scalar> velocity_{};  ///< and nu
  std::vector<Scalar> next_{};      ///< likewise, after a pass
  std::vector<Scalar> stretch_{};   ///< G_xx, G_yy, G_zz and the mass
  std::vector<Scalar> shear_{};     ///< G_xy + G_yx, G_xz + G_zx, G_yz + G_zy and nothing
  Reduction<Scalar> largest_{};
};

}  // namespace decant::inline DECANT_TARGET
