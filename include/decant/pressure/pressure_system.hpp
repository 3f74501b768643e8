// SPDX-License-Identifier: MIT
#pragma once

/// The linear system behind incompressible SPH: what pressures do to velocities, and what velocities do to densities.

#include <array>
#include <cstdint>
#include <vector>

#include <decant/core/batch.hpp>
#include <decant/core/compact.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Pairs' kernel gradients are computed once per sub-step and reused by every sweep. They are kept as Compact numbers,
/// since sweeps wait for them: each may be off by one part in 4,000, which is as if particles were off by a thousandth
/// of the spacing, and the same for both of a pair, so momentum is kept to rounding.
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
    corrected_ = false;
    resize(step);
    const auto& list = step.neighbors;
    const B unit(unit_);
    parallel_for(count_, step.threads, [&](Index i) {
      Sums sums;
      const B own_weight(weight_[static_cast<std::size_t>(i)]);
      list.for_each_batch(i, [&](const auto& pair) {
        const B slope = unit * step.pairs.slope(pair.slot);
        CompactScalar* const place = &rate_[3 * pair.slot];
        store({slope * pair.x, slope * pair.y, slope * pair.z}, place);
        sums.add(load(place), weights(pair.neighbor), own_weight);
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
    parallel_for(count_, step.threads, [&](Index i) {
      Sums sums;
      const B own_weight(weight_[static_cast<std::size_t>(i)]);
      for (std::size_t at = list.first(i); at < list.padded_end(i); at += width) {
        const Batch3<Scalar> gradient = load(&plain.rate_[3 * at]);
        store(step.correction.apply(i, gradient), &rate_[3 * at]);
        store(step.correction.apply(list.index() + at, gradient), &push_[3 * at]);
        sums.add(load(&rate_[3 * at]), weights(list.index() + at), own_weight);
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

  /// What pairs' sums are weighted by: m_i / h^4 [kg/m^4].
  const Scalar* weights() const noexcept { return weight_.data(); }

  /// Accelerations of all particles, in records of four numbers: x, y, z and weights().
  const Scalar* accelerations() const noexcept { return records_.data(); }
  /// For a solver that has summed them up itself.
  std::vector<Scalar>& accelerations_to_replace() noexcept { return records_; }

  /// Computes accelerations() from P, which has one entry per particle.
  template <class Neighbors>
  void accelerate(const Neighbors& list, const Scalar* pressure_term, Threads threads) noexcept {
    const CompactScalar* const push = corrected_ ? push_.data() : rate_.data();
    const Scalar* weighted = pressure_term;
    if (common_weight_ == 0) {
      weighted = weighted_.data();
      parallel_for(count_, threads, [&](Index i) {
        const auto own = static_cast<std::size_t>(i);
        weighted_[own] = weight_[own] * pressure_term[own];
      });
    }
    const Scalar factor = common_weight_ == 0 ? Scalar(1) : common_weight_;
    parallel_for(count_, threads, [&](Index i) {
      const auto own = static_cast<std::size_t>(i);
      B x(Scalar(0)), y(Scalar(0)), z(Scalar(0));
      for (std::size_t at = list.first(i); at < list.padded_end(i); at += width) {
        const B term = gather(weighted, list.index() + at);
        const Batch3<Scalar> gradient = load(push + 3 * at);
        x = multiply_add(term, gradient.x, x);
        y = multiply_add(term, gradient.y, y);
        z = multiply_add(term, gradient.z, z);
      }
      const Scalar* total = &total_[4 * own];
      Scalar* record = &records_[4 * own];
      const std::array<Scalar, 3> pushed = sum_each(std::array{x, y, z});
      record[0] = -(factor * pushed[0] + pressure_term[own] * total[0]);
      record[1] = -(factor * pushed[1] + pressure_term[own] * total[1]);
      record[2] = -(factor * pushed[2] + pressure_term[own] * total[2]);
      record[3] = weight_[own];
    });
  }

  /// Minus the accelerations of particle i by a unit of P_j: calls f(pair, x, y, z) for each batch of neighbours j, see
  /// NeighborList::Pairs. Zero in lanes that are not valid.
  template <class Neighbors, class Function>
  [[gnu::always_inline]] void for_each_response(const Neighbors& list, Index i, Function&& f) const noexcept {
    const CompactScalar* const push = corrected_ ? push_.data() : rate_.data();
    list.for_each_batch(i, [&](const auto& pair) {
      const B weight = weights(pair.neighbor);
      const Batch3<Scalar> gradient = load(push + 3 * pair.slot);
      f(pair, weight * gradient.x, weight * gradient.y, weight * gradient.z);
    });
  }
  /// The same by a unit of its own P.
  const Scalar* own_response(Index i) const noexcept { return &total_[4 * static_cast<std::size_t>(i)]; }

  /// D_i of one particle for vectors in records of four, the last one weights(): velocities, or accelerations (then
  /// walls do not move).
  template <class Neighbors>
  [[gnu::always_inline]] Scalar density_rate(const Neighbors& list, const Scalar* records, Index i,
                                             bool walls_move) const noexcept {
    const auto own = static_cast<std::size_t>(i);
    B away(Scalar(0));
    for (std::size_t at = list.first(i); at < list.padded_end(i); at += width) {
      const auto other = gather4(records, list.index() + at);
      const Batch3<Scalar> gradient = load(&rate_[3 * at]);
      const B along = multiply_add(other.z, gradient.z, multiply_add(other.y, gradient.y, other.x * gradient.x));
      away = multiply_add(other.w, along, away);
    }
    const Scalar* record = records + 4 * own;
    const Scalar* total = &total_[4 * own];
    const Scalar rate = record[0] * total[0] + record[1] * total[1] + record[2] * total[2] - sum(away);
    return walls_move ? rate - total[3] : rate;
  }

 private:
  using B = Batch<Scalar>;
  static constexpr auto width = static_cast<std::size_t>(B::width);

  using CompactScalar = Compact<Scalar>;

  /// Over a particle's pairs: of masses times gradients, and of their squares.
  struct Sums {
    B x{Scalar(0)}, y{Scalar(0)}, z{Scalar(0)}, squares{Scalar(0)};

    [[gnu::always_inline]] void add(const Batch3<Scalar>& gradient, B weight, B own_weight) noexcept {
      x = multiply_add(weight, gradient.x, x);
      y = multiply_add(weight, gradient.y, y);
      z = multiply_add(weight, gradient.z, z);
      squares = multiply_add(own_weight * weight, squared_length(gradient.x, gradient.y, gradient.z), squares);
    }
  };

  [[gnu::always_inline]] B weights(const std::uint32_t* neighbor) const noexcept {
    return common_weight_ > 0 ? B(common_weight_) : gather(weight_.data(), neighbor);
  }

  [[gnu::always_inline]] static Batch3<Scalar> load(const CompactScalar* from) noexcept {
    return {load_compact<Scalar>(from), load_compact<Scalar>(from + width), load_compact<Scalar>(from + 2 * width)};
  }
  [[gnu::always_inline]] static void store(const Batch3<Scalar>& gradient, CompactScalar* to) noexcept {
    store_compact(gradient.x, to);
    store_compact(gradient.y, to + width);
    store_compact(gradient.z, to + 2 * width);
  }

  template <class Step>
  void resize(const Step& step) {
    count_ = step.fluid.size();
    rest_density_ = step.rest_density;
    const Scalar squared = step.smoothing_length * step.smoothing_length;
    unit_ = squared * squared;
    common_weight_ = step.pairs.common_mass() / unit_;
    weight_.resize(static_cast<std::size_t>(count_));
    weighted_.resize(static_cast<std::size_t>(count_));
    parallel_for(count_, step.threads,
                 [&](Index i) { weight_[static_cast<std::size_t>(i)] = step.fluid.mass[i] / unit_; });
    rate_.resize(3 * step.neighbors.index_size());
    total_.resize(4 * static_cast<std::size_t>(count_));
    diagonal_.resize(static_cast<std::size_t>(count_));
    records_.resize(4 * static_cast<std::size_t>(count_));
  }

  void finish(Index i, const Sums& sums, const Vector3<Scalar>& wall, Scalar flux) noexcept {
    const std::array<Scalar, 4> pairs = sum_each(std::array{sums.x, sums.y, sums.z, sums.squares});
    const Vector3<Scalar> total = Vector3<Scalar>(pairs[0], pairs[1], pairs[2]) + rest_density_ * wall;
    Scalar* record = &total_[4 * static_cast<std::size_t>(i)];
    record[0] = total[0];
    record[1] = total[1];
    record[2] = total[2];
    record[3] = rest_density_ * flux;
    diagonal_[static_cast<std::size_t>(i)] = pairs[3] + total.squaredNorm();
  }

  Index count_ = 0;
  Scalar rest_density_ = 0;
  Scalar common_weight_ = 0;  ///< of all particles; 0 where they differ
  Scalar unit_ = 0;           ///< h^4, which brings gradients to the order of one [m^4]
  bool corrected_ = false;
  std::vector<CompactScalar> rate_{};  ///< h^4 L_i grad W_ij in the order of the list's index: a batch of x, of y, of z
  std::vector<CompactScalar> push_{};  ///< h^4 L_j grad W_ij likewise, where L is not 1
  std::vector<Scalar> weight_{};       ///< m_i / h^4
  std::vector<Scalar> weighted_{};     ///< the same times P_i
  std::vector<Scalar>
      total_{};  ///< sum_j m_j L_i grad W_ij + rho_0 L_i grad s, and the walls' part of -D; records of four
  std::vector<Scalar> diagonal_{};
  std::vector<Scalar> records_{};
};

}  // namespace decant::inline DECANT_TARGET
