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
/// With P_i = p_i / rho_i^2 [m^5/(kg s^2)], matrices L_i and the walls' shares s_i of rest density
/// (boundary/wall_function.hpp),
///   a_i    = -sum_j m_j (P_i L_i + P_j L_j) grad W_ij - rho_0 P_i L_i grad s_i                acceleration  [m/s^2]
///   D_i(v) = sum_j m_j (v_i - v_j) . L_i grad W_ij + rho_0 sum_walls (L_i grad s_i) . (v_i - v_wall)
/// with D a density rate [kg/(m^3 s)]; of L_i grad s_i the part along grad s_i counts. For equal masses -D is the
/// adjoint of a: pressure takes as much energy out of the liquid as the compression it removes. There are two such
/// systems:
///   assemble()   L = 1: D is the exact derivative of the summed density;
///   correct()    L from GradientCorrection: D is the exact divergence of linear velocities, so shear meets no pressure
///                and rigid motion no compression.
template <class Scalar>
class PressureSystem {
 public:
  /// Takes the sub-step's geometry: pairs, walls, masses.
  template <class Step>
  void assemble(const Step& step) noexcept {
    using Kernel = typename Step::Kernel;
    corrected_ = false;
    resize(step);
    const auto& list = step.neighbors;
    const Scalar* mass = step.fluid.mass.data();
    parallel_for(count_, step.threads, [&](Index i) {
      Sums sums;
      const B mass_i(mass[i]);
      list.for_each_batch(i, [&](const auto& pair) {
        const B mass_j = gather(mass, pair.neighbor);
        const B slope =
            mass_j * Kernel::derivative_over_radius(square_root(pair.distance_squared), step.smoothing_length);
        const Batch3<Scalar> gradient{slope * pair.x, slope * pair.y, slope * pair.z};
        store(gradient, &rate_[3 * pair.slot]);
        sums.add(gradient, mass_i / mass_j);
      });
      Scalar flux = 0;
      Vector3<Scalar> wall = Vector3<Scalar>::Zero();
      const auto* contacts = step.walls.contacts_of(i);
      for (int k = 0; k < step.walls.contact_count[i]; ++k) {
        wall += contacts[k].gradient;
        flux += contacts[k].gradient.dot(contacts[k].velocity);
      }
      finish(i, sums, wall, flux);
    });
  }

  /// Takes from `plain`, which was assembled for the same sub-step, what step.correction makes of it.
  template <class Step>
  void correct(const PressureSystem& plain, const Step& step) noexcept {
    corrected_ = true;
    resize(step);
    push_.resize(rate_.size());
    const auto& list = step.neighbors;
    const Scalar* mass = step.fluid.mass.data();
    parallel_for(count_, step.threads, [&](Index i) {
      Sums sums;
      const B mass_i(mass[i]);
      const Vector3<Scalar> x = step.correction.apply(i, Vector3<Scalar>::UnitX()),
                            y = step.correction.apply(i, Vector3<Scalar>::UnitY()),
                            z = step.correction.apply(i, Vector3<Scalar>::UnitZ());
      for (std::size_t at = list.first(i); at < list.padded_end(i); at += width) {
        const Batch3<Scalar> gradient = load(&plain.rate_[3 * at]);
        const Batch3<Scalar> own{gradient.x * x[0] + gradient.y * x[1] + gradient.z * x[2],
                                 gradient.x * y[0] + gradient.y * y[1] + gradient.z * y[2],
                                 gradient.x * z[0] + gradient.y * z[1] + gradient.z * z[2]};
        store(own, &rate_[3 * at]);
        store(step.correction.apply(list.index() + at, gradient), &push_[3 * at]);
        sums.add(own, mass_i / gather(mass, list.index() + at));
      }
      Scalar flux = 0;
      Vector3<Scalar> wall = Vector3<Scalar>::Zero();
      const auto* contacts = step.walls.contacts_of(i);
      for (int k = 0; k < step.walls.contact_count[i]; ++k) {
        const Vector3<Scalar> gradient = step.correction.at_wall(i, contacts[k].gradient);
        wall += gradient;
        flux += gradient.dot(contacts[k].velocity);
      }
      finish(i, sums, wall, flux);
    });
  }

  Index size() const noexcept { return count_; }

  /// -dD_i / dP_i, the response of a particle's density rate to its own pressure; >= 0.
  const Scalar* diagonal() const noexcept { return diagonal_.data(); }

  /// Accelerations of all particles, in records of four numbers: x, y, z and one unused.
  const Scalar* accelerations() const noexcept { return records_.data(); }
  /// For a solver that has summed them up itself.
  std::vector<Scalar>& accelerations_to_replace() noexcept { return records_; }

  /// Computes accelerations() from P, which has one entry per particle.
  template <class Neighbors>
  void accelerate(const Neighbors& list, const Scalar* pressure_term, Threads threads) noexcept {
    const Scalar* const push = corrected_ ? push_.data() : rate_.data();
    parallel_for(count_, threads, [&](Index i) {
      const auto own = static_cast<std::size_t>(i);
      B x(Scalar(0)), y(Scalar(0)), z(Scalar(0));
      for (std::size_t at = list.first(i); at < list.padded_end(i); at += width) {
        const B term = gather(pressure_term, list.index() + at);
        const Batch3<Scalar> gradient = load(push + 3 * at);
        x = multiply_add(term, gradient.x, x);
        y = multiply_add(term, gradient.y, y);
        z = multiply_add(term, gradient.z, z);
      }
      const Scalar* total = &total_[4 * own];
      Scalar* record = &records_[4 * own];
      record[0] = -(sum(x) + pressure_term[own] * total[0]);
      record[1] = -(sum(y) + pressure_term[own] * total[1]);
      record[2] = -(sum(z) + pressure_term[own] * total[2]);
      record[3] = 0;
    });
  }

  /// Calls f(j, x, y, z) with minus the acceleration of particle i by a unit of P_j, for its neighbours and itself.
  template <class Neighbors, class Function>
  void for_each_response(const Neighbors& list, Index i, Function&& f) const noexcept {
    const Scalar* const push = corrected_ ? push_.data() : rate_.data();
    const auto own = static_cast<std::size_t>(i);
    const std::size_t first = list.first(i), count = static_cast<std::size_t>(list.count(i));
    for (std::size_t k = 0; k < count; ++k) {
      const Scalar* gradient = push + 3 * (first + k - k % width) + k % width;
      f(static_cast<std::size_t>(list.index()[first + k]), gradient[0], gradient[width], gradient[2 * width]);
    }
    f(own, total_[4 * own], total_[4 * own + 1], total_[4 * own + 2]);
  }

  /// D_i of one particle for vectors in records of four: velocities, or accelerations (then walls do not move).
  template <class Neighbors>
  [[gnu::always_inline]] Scalar density_rate(const Neighbors& list, const Scalar* records, Index i,
                                             bool walls_move) const noexcept {
    const auto own = static_cast<std::size_t>(i);
    B away(Scalar(0));
    for (std::size_t at = list.first(i); at < list.padded_end(i); at += width) {
      const auto other = gather3(records, list.index() + at);
      const Batch3<Scalar> gradient = load(&rate_[3 * at]);
      away = multiply_add(other.x, gradient.x, away);
      away = multiply_add(other.y, gradient.y, away);
      away = multiply_add(other.z, gradient.z, away);
    }
    const Scalar* record = records + 4 * own;
    const Scalar* total = &total_[4 * own];
    const Scalar rate = record[0] * total[0] + record[1] * total[1] + record[2] * total[2] - sum(away);
    return walls_move ? rate - total[3] : rate;
  }

 private:
  using B = Batch<Scalar>;
  static constexpr auto width = static_cast<std::size_t>(B::width);

  /// Over a particle's pairs: of the gradients, and of their squares.
  struct Sums {
    B x{Scalar(0)}, y{Scalar(0)}, z{Scalar(0)}, squares{Scalar(0)};

    [[gnu::always_inline]] void add(const Batch3<Scalar>& gradient, B mass_ratio) noexcept {
      x += gradient.x;
      y += gradient.y;
      z += gradient.z;
      squares += squared_length(gradient.x, gradient.y, gradient.z) * mass_ratio;
    }
  };

  [[gnu::always_inline]] static Batch3<Scalar> load(const Scalar* from) noexcept {
    return {B::load(from), B::load(from + width), B::load(from + 2 * width)};
  }
  [[gnu::always_inline]] static void store(const Batch3<Scalar>& gradient, Scalar* to) noexcept {
    gradient.x.store(to);
    gradient.y.store(to + width);
    gradient.z.store(to + 2 * width);
  }

  template <class Step>
  void resize(const Step& step) {
    count_ = step.fluid.size();
    rest_density_ = step.rest_density;
    rate_.resize(3 * step.neighbors.index_size());
    total_.resize(4 * static_cast<std::size_t>(count_));
    diagonal_.resize(static_cast<std::size_t>(count_));
    records_.resize(4 * static_cast<std::size_t>(count_));
  }

  void finish(Index i, const Sums& sums, const Vector3<Scalar>& wall, Scalar flux) noexcept {
    const Vector3<Scalar> total = Vector3<Scalar>(sum(sums.x), sum(sums.y), sum(sums.z)) + rest_density_ * wall;
    Scalar* record = &total_[4 * static_cast<std::size_t>(i)];
    record[0] = total[0];
    record[1] = total[1];
    record[2] = total[2];
    record[3] = rest_density_ * flux;
    diagonal_[static_cast<std::size_t>(i)] = sum(sums.squares) + total.squaredNorm();
  }

  Index count_ = 0;
  Scalar rest_density_ = 0;
  bool corrected_ = false;
  std::vector<Scalar> rate_{};  ///< m_j L_i grad W_ij in the order of the list's index: a batch of x, of y, of z
  std::vector<Scalar> push_{};  ///< m_j L_j grad W_ij likewise, where L is not 1
  std::vector<Scalar>
      total_{};  ///< sum_j m_j L_i grad W_ij + rho_0 L_i grad s, and the walls' part of -D; records of four
  std::vector<Scalar> diagonal_{};
  std::vector<Scalar> records_{};
};

}  // namespace decant
