// SPDX-License-Identifier: MIT
#pragma once

/// Surface tension that keeps momentum.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <vector>

#include <decant/core/batch.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/force/detail/pair_stiffness.hpp>

namespace decant::inline DECANT_TARGET {

/// The gradient of the liquid's volume fraction, n_i = sum_j V_j grad W_ij + wall share (V = m / rho_0), points into
/// the liquid, is large at the surface only, and its length integrates to one across it. Tension is a stress along the
/// surface, sigma |n| (1 - nn) with the unit normal nn (Lafaurie et al. 1994, J. Comput. Phys. 113). We let each pair
/// carry its share of that stress along the line between the two,
///   a_i = (2 sigma / rho_0^2) sum_j m_j (q_ij + q_ji) (-W'(r)) (x_j - x_i) / r,
///   q_ij = |n_i| (cohesion - (nn_i . x_ij / r)^2),
/// so that pairs along the surface attract, pairs across it do not, and linear and angular momentum are kept to
/// rounding. An isotropic part of the stress is only felt as pressure; `cohesion` chooses it. Forces of this
/// kind are not the derivative of an energy and feed the noise of the surface particles, so pairs at the surface are
/// damped as well, by a friction that scales with sqrt(sigma h / rho_0) and acts in a layer of about h: it vanishes as
/// the spacing does. With the default solver, a drop at rest stays together; the pressure in it is 0.80 to 0.83 and
/// 0.99 of the analytic 2 sigma / R at 8 and 12 spacings per radius, but drops do not swing: their lowest mode is
/// damped away within a period. With a friction of 1, sub-steps are up to four times as long, the pressure is 0.65 and
/// up to 5 % of the particles leave; with 0.2, a tenth. Walls complete the support: no surface between liquid and wall,
/// and liquid meets a wall at about a right angle. A tension of zero costs nothing.
template <class ScalarType>
struct SurfaceTension {
  using Scalar = ScalarType;

  Scalar surface_tension = Scalar(0.0728);  ///< sigma [N/m], >= 0; water against air at 20 degrees Celsius
  Scalar cohesion = Scalar(0.8);            ///< see above [-]
  Scalar surface_damping = Scalar(4);       ///< friction of the surface layer over sqrt(sigma h / rho_0) [-], >= 0

  template <class Step>
  void accumulate(const Step& step, PointArray<Scalar>& acceleration) noexcept {
    if (!(surface_tension > 0)) {
      return;
    }
    find_normals(step);
    pull(step, acceleration);
  }

  template <class Step>
  Scalar largest_step(const Step& step) const noexcept {
    if (!(surface_tension > 0)) {
      return std::numeric_limits<Scalar>::infinity();
    }
    // The shortest capillary wave that particles carry has the wave number pi / d and an angular frequency of
    // sqrt(pi^3 sigma / (rho d^3)); 0.3 sqrt(rho d^3 / (2 pi sigma)) is 0.67 over that, a third of the stability limit.
    const Scalar d = step.spacing;
    const Scalar wave =
        Scalar(0.3) * std::sqrt(step.rest_density * d * d * d / (2 * std::numbers::pi_v<Scalar> * surface_tension));
    if (!(surface_damping > 0)) {
      return wave;
    }
    const Scalar stiffness = detail::pair_stiffness<typename Step::Kernel>(step.smoothing_length, step.spacing);
    return std::min(wave, Scalar(0.225) / (layer_viscosity(step) * stiffness));
  }

 private:
  template <class Step>
  Scalar layer_viscosity(const Step& step) const noexcept {
    return surface_damping * std::sqrt(surface_tension * step.smoothing_length / step.rest_density);
  }

  /// Stores n / sqrt|n|, so that squares of it carry the weight |n|.
  template <class Step>
  void find_normals(const Step& step) noexcept {
    using B = Batch<Scalar>;
    const Index count = step.fluid.size();
    const Scalar h = step.smoothing_length;
    // 0.1 / h is a fifth of the length at a flat surface and above the noise inside a liquid at rest
    const Scalar noise = Scalar(0.01) / (h * h);
    root_.resize(4 * static_cast<std::size_t>(count));
    velocity_.resize(4 * static_cast<std::size_t>(count));
    parallel_for(count, step.threads, [&](Index i) {
      B x(Scalar(0)), y(Scalar(0)), z(Scalar(0));
      step.neighbors.for_each_batch(i, [&](const auto& pair) {
        const B slope = step.mass(pair.neighbor) * step.pairs.slope(pair.slot);
        x = multiply_add(slope, pair.x, x);
        y = multiply_add(slope, pair.y, y);
        z = multiply_add(slope, pair.z, z);
      });
      const Vector3<Scalar> n =
          Vector3<Scalar>(sum(x), sum(y), sum(z)) / step.rest_density + Scalar(0.5) * step.walls.gradient.col(i);
      const Vector3<Scalar> root = n / std::sqrt(std::sqrt(n.squaredNorm() + noise));
      Scalar* record = &root_[static_cast<std::size_t>(4 * i)];
      Scalar* velocity = &velocity_[static_cast<std::size_t>(4 * i)];
      for (Index axis = 0; axis < 3; ++axis) {
        record[axis] = root[axis];
        velocity[axis] = step.fluid.velocity(axis, i);
      }
      record[3] = root.squaredNorm();
      velocity[3] = step.fluid.mass[i];
    });
  }

  template <class Step>
  void pull(const Step& step, PointArray<Scalar>& acceleration) const noexcept {
    using B = Batch<Scalar>;
    const Scalar h = step.smoothing_length;
    const Scalar softening = Scalar(1e-4) * h * h;
    const Scalar factor = 2 * surface_tension / (step.rest_density * step.rest_density);
    const Scalar damping = 10 * layer_viscosity(step) * h / step.rest_density / factor;
    parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      const Scalar* own = &root_[static_cast<std::size_t>(4 * i)];
      const Scalar* v = &velocity_[static_cast<std::size_t>(4 * i)];
      B x(Scalar(0)), y(Scalar(0)), z(Scalar(0));
      step.neighbors.for_each_batch(i, [&](const auto& pair) {
        const auto n = gather4(root_.data(), pair.neighbor);
        const auto other = gather4(velocity_.data(), pair.neighbor);
        const B across_i = own[0] * pair.x + own[1] * pair.y + own[2] * pair.z;
        const B across_j = n.x * pair.x + n.y * pair.y + n.z * pair.z;
        const B approach = (v[0] - other.x) * pair.x + (v[1] - other.y) * pair.y + (v[2] - other.z) * pair.z;
        const B weight = own[3] + n.w;
        const B ratio = (across_i * across_i + across_j * across_j - damping * weight * approach) /
                        (pair.distance_squared + softening);
        const B push = other.w * step.pairs.slope(pair.slot) * (cohesion * weight - ratio);
        x = multiply_add(push, pair.x, x);
        y = multiply_add(push, pair.y, y);
        z = multiply_add(push, pair.z, z);
      });
      acceleration.col(i) += factor * Vector3<Scalar>(sum(x), sum(y), sum(z));
    });
  }

  std::vector<Scalar> root_{};      ///< n / sqrt|n|, |n|
  std::vector<Scalar> velocity_{};  ///< velocity, mass
};

}  // namespace decant::inline DECANT_TARGET
