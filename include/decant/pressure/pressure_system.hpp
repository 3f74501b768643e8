// SPDX-License-Identifier: MIT
#pragma once

/// The linear system behind incompressible SPH: what pressures do to velocities, and what velocities do to densities.

#include <algorithm>
#include <cstdint>
#include <vector>

#include <decant/core/batch.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/types.hpp>

namespace decant {

/// Pairs' kernel gradients are computed once per sub-step and reused by every sweep.
///
/// With P_i = p_i / rho_i^2 [m^5/(kg s^2)] and the walls' shares s_i of rest density (boundary/wall_function.hpp),
///   a_i    = -sum_j m_j (P_i + P_j) grad W_ij - rho_0 P_i grad s_i                        acceleration  [m/s^2]
///   D_i(v) = sum_j m_j (v_i - v_j) . grad W_ij + rho_0 (grad s_i . v_i - flux_i)          density rate  [kg/(m^3 s)]
/// D is the exact derivative of the summed density, and for equal masses -D is the adjoint of a: pressure takes as much
/// energy out of the liquid as the compression it removes.
template <class Scalar>
class PressureSystem {
 public:
  /// Takes the sub-step's geometry: pairs, walls, masses.
  template <class Step>
  void assemble(const Step& step) noexcept {
    using Kernel = typename Step::Kernel;
    using B = Batch<Scalar>;
    const auto& list = step.neighbors;
    const Index count = step.fluid.size();
    count_ = count;
    rest_density_ = step.rest_density;
    const std::size_t pairs = list.index_size();
    for (auto* array : {&gradient_x_, &gradient_y_, &gradient_z_}) {
      array->resize(pairs);
    }
    wall_.resize(4 * static_cast<std::size_t>(count));
    total_.resize(4 * static_cast<std::size_t>(count));
    diagonal_.resize(static_cast<std::size_t>(count));
    records_.resize(4 * static_cast<std::size_t>(count));
    flux_ = step.walls.flux.data();
    const Scalar* mass = step.fluid.mass.data();
    parallel_for(count, step.threads, [&](Index i) {
      const auto own = static_cast<std::size_t>(i);
      B sum_x(Scalar(0)), sum_y(Scalar(0)), sum_z(Scalar(0)), squares(Scalar(0));
      const B mass_i(mass[i]);
      list.for_each_batch(i, [&](const auto& pair) {
        const auto at = static_cast<std::size_t>(pair.neighbor - list.index());
        const B mass_j = gather(mass, pair.neighbor);
        const B slope =
            mass_j * Kernel::derivative_over_radius(square_root(pair.distance_squared), step.smoothing_length);
        const B x = slope * pair.x, y = slope * pair.y, z = slope * pair.z;
        x.store(&gradient_x_[at]);
        y.store(&gradient_y_[at]);
        z.store(&gradient_z_[at]);
        sum_x += x;
        sum_y += y;
        sum_z += z;
        squares += squared_length(x, y, z) * (mass_i / mass_j);
      });
      const Vector3<Scalar> pairs_sum(sum(sum_x), sum(sum_y), sum(sum_z));
      const Vector3<Scalar> wall = rest_density_ * step.walls.gradient.col(i);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto row = static_cast<Index>(axis);
        wall_[4 * own + axis] = wall[row];
        total_[4 * own + axis] = pairs_sum[row] + wall[row];
      }
      diagonal_[own] = sum(squares) + (pairs_sum + wall).squaredNorm();
    });
  }

  Index size() const noexcept { return count_; }

  /// -dD_i / dP_i, the response of a particle's density rate to its own pressure; >= 0.
  const Scalar* diagonal() const noexcept { return diagonal_.data(); }

  /// Accelerations of all particles, in records of four numbers: x, y, z and one unused.
  const Scalar* accelerations() const noexcept { return records_.data(); }

  /// Computes accelerations() from P, which has one entry per particle.
  template <class Neighbors>
  void accelerate(const Neighbors& list, const Scalar* pressure_term, Threads threads) noexcept {
    using B = Batch<Scalar>;
    parallel_for(count_, threads, [&](Index i) {
      const auto own = static_cast<std::size_t>(i);
      const B term_i(pressure_term[own]);
      B x(Scalar(0)), y(Scalar(0)), z(Scalar(0));
      for (std::size_t at = list.first(i); at < list.padded_end(i); at += static_cast<std::size_t>(B::width)) {
        const B both = term_i + gather(pressure_term, list.index() + at);
        x = multiply_add(both, B::load(&gradient_x_[at]), x);
        y = multiply_add(both, B::load(&gradient_y_[at]), y);
        z = multiply_add(both, B::load(&gradient_z_[at]), z);
      }
      const Scalar* wall = &wall_[4 * own];
      Scalar* record = &records_[4 * own];
      record[0] = -(sum(x) + pressure_term[own] * wall[0]);
      record[1] = -(sum(y) + pressure_term[own] * wall[1]);
      record[2] = -(sum(z) + pressure_term[own] * wall[2]);
      record[3] = 0;
    });
  }

  /// D_i of one particle for vectors in records of four: velocities, or accelerations (then walls do not move).
  template <class Neighbors>
  Scalar density_rate(const Neighbors& list, const Scalar* records, Index i, bool walls_move) const noexcept {
    using B = Batch<Scalar>;
    const auto own = static_cast<std::size_t>(i);
    B away(Scalar(0));
    for (std::size_t at = list.first(i); at < list.padded_end(i); at += static_cast<std::size_t>(B::width)) {
      const auto other = gather3(records, list.index() + at);
      away = multiply_add(other.x, B::load(&gradient_x_[at]), away);
      away = multiply_add(other.y, B::load(&gradient_y_[at]), away);
      away = multiply_add(other.z, B::load(&gradient_z_[at]), away);
    }
    const Scalar* record = records + 4 * own;
    const Scalar* total = &total_[4 * own];
    const Scalar rate = record[0] * total[0] + record[1] * total[1] + record[2] * total[2] - sum(away);
    return walls_move ? rate - rest_density_ * flux_[i] : rate;
  }

 private:
  Index count_ = 0;
  Scalar rest_density_ = 0;
  const Scalar* flux_ = nullptr;
  std::vector<Scalar> gradient_x_{}, gradient_y_{}, gradient_z_{};  ///< m_j grad W_ij, aligned with the list's index
  std::vector<Scalar> wall_{};                                    ///< rho_0 grad s, records of four
  std::vector<Scalar> total_{};                                     ///< sum_j m_j grad W_ij + rho_0 grad s, likewise
  std::vector<Scalar> diagonal_{};
  std::vector<Scalar> records_{};
};

}  // namespace decant
