// SPDX-License-Identifier: MIT
#pragma once

/// The viscosity of Schenck and Fox 2017 as it is printed.

#include <cstddef>
#include <limits>
#include <vector>

#include <decant/core/batch.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/kernel/mueller_viscosity.hpp>

namespace decant::inline DECANT_TARGET {

/// Schenck and Fox 2017, "Reasoning About Liquids via Closed-Loop Simulation" (RSS): velocities enter as the sum
/// v_i / rho_i^2 + v_j / rho_j^2 where friction needs their difference. With the Laplacian of Mueller's viscosity
/// kernel (Mueller et al. 2003, positive everywhere) and the sign that takes energy away,
///   a_i = -mu sum_j m_j (v_i / rho_i^2 + v_j / rho_j^2) Laplacian W_ij.
/// What differs from friction: liquid that moves all together is braked as well, relative to the frame that velocities
/// are measured in, so neither linear nor angular momentum is kept; a falling drop slows down without air. In the bulk
/// that rate is about 2 nu * 15 / (2 H^2) per second, with the support radius H. Kept for comparison with the paper;
/// take Viscosity for anything else.
template <class ScalarType>
struct ViscositySchenck2017 {
  using Scalar = ScalarType;

  Scalar kinematic_viscosity = Scalar(1.0034e-6);  ///< nu = mu / rho_0 [m^2/s], >= 0

  template <class Step>
  void accumulate(const Step& step, PointArray<Scalar>& acceleration) noexcept {
    if (!(kinematic_viscosity > 0)) {
      return;
    }
    using B = Batch<Scalar>;
    const Index count = step.fluid.size();
    records_.resize(4 * static_cast<std::size_t>(count));
    parallel_for(count, step.threads, [&](Index i) {
      const Scalar density = step.fluid.density[i];
      for (Index axis = 0; axis < 3; ++axis) {
        records_[static_cast<std::size_t>(4 * i + axis)] = step.fluid.velocity(axis, i) / (density * density);
      }
      records_[static_cast<std::size_t>(4 * i + 3)] = step.fluid.mass[i];
    });
    const Scalar h = same_support<typename Step::Kernel>(step.smoothing_length);
    const Scalar factor = kinematic_viscosity * step.rest_density;
    parallel_for(count, step.threads, [&](Index i) {
      const Scalar* own = &records_[static_cast<std::size_t>(4 * i)];
      B x(Scalar(0)), y(Scalar(0)), z(Scalar(0));
      step.neighbors.for_each_batch(i, [&](const auto& pair) {
        const auto other = gather4(records_.data(), pair.neighbor);
        // the places that fill up a row hold the particle itself, which is no neighbour
        const B weight =
            select(pair.valid, other.w * MuellerViscosity<Scalar>::laplacian(square_root(pair.distance_squared), h),
                   B(Scalar(0)));
        x = multiply_add(weight, own[0] + other.x, x);
        y = multiply_add(weight, own[1] + other.y, y);
        z = multiply_add(weight, own[2] + other.z, z);
      });
      acceleration.col(i) -= factor * Vector3<Scalar>(sum(x), sum(y), sum(z));
    });
  }

  template <class Step>
  Scalar largest_step(const Step& step) const noexcept {
    if (!(kinematic_viscosity > 0)) {
      return std::numeric_limits<Scalar>::infinity();
    }
    // Uniform motion is what is braked fastest, at 2 nu sum_j V_j Laplacian W_ij, whose integral is 15 / H^2. The
    // quarter leaves room for density above that of rest.
    const Scalar support = static_cast<Scalar>(Step::Kernel::support_factor) * step.smoothing_length;
    return Scalar(0.5) * support * support / (30 * kinematic_viscosity);
  }

 private:
  /// Mueller's kernel with the support radius of the simulation's own.
  template <class Kernel>
  static Scalar same_support(Scalar smoothing_length) noexcept {
    return smoothing_length * static_cast<Scalar>(Kernel::support_factor) /
           static_cast<Scalar>(MuellerViscosity<Scalar>::support_factor);
  }

  std::vector<Scalar> records_{};  ///< v / rho^2, mass
};

}  // namespace decant::inline DECANT_TARGET
