// SPDX-License-Identifier: MIT
#pragma once

/// The kernel at every pair of neighbours, evaluated once per sub-step.

#include <cstddef>
#include <vector>

#include <decant/core/batch.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/kernel/lattice.hpp>

namespace decant::inline DECANT_TARGET {

/// Slopes that forces and pressure take gradients from, and the densities that the kernel adds up to: with them,
///   grad W_ij = slope x_ij,   slope = W'(r) / r [m^-5]
/// Sweeps that ask here save a root, a division and, where all particles have one mass, as nearly always, a gather.
template <class ScalarType>
class PairKernel {
 public:
  using Scalar = ScalarType;

  /// For the neighbours and walls of a sub-step; step is a StepView that refers to this. Writes the slopes, and
  /// step.fluid.density [kg/m^3].
  template <class Step>
  void compute(const Step& step) {
    using Kernel = typename Step::Kernel;
    using B = Batch<Scalar>;
    const Index count = step.fluid.size();
    const Scalar h = step.smoothing_length;
    if (h != smoothing_length_ || step.spacing != spacing_) {
      smoothing_length_ = h;
      spacing_ = step.spacing;
      own_value_ = decant::own_value<Kernel>(static_cast<double>(h), static_cast<double>(step.spacing));
    }
    const Scalar own = own_value_;
    slope_.resize(step.neighbors.index_size());
    const auto& mass = step.fluid.mass;
    common_mass_ = count > 0 && (mass.array() == mass[0]).all() ? mass[0] : Scalar(0);
    parallel_for(count, step.threads, [&](Index i) {
      B total(Scalar(0));
      step.neighbors.for_each_batch(i, [&](const auto& pair) {
        const B distance = square_root(pair.distance_squared);
        Kernel::derivative_over_radius(distance, h).store(&slope_[pair.slot]);
        total += select(pair.valid, step.mass(pair.neighbor) * Kernel::value(distance, h), B(Scalar(0)));
      });
      step.fluid.density[i] = sum(total) + mass[i] * own + step.rest_density * step.walls.share[i];
    });
  }

  /// Of a batch of pairs, by their place in the neighbour list [m^-5].
  [[gnu::always_inline]] Batch<Scalar> slope(std::size_t slot) const noexcept {
    return Batch<Scalar>::load(&slope_[slot]);
  }

  /// The mass of all particles; 0 where it is not the same for all [kg].
  Scalar common_mass() const noexcept { return common_mass_; }

  /// What a particle's mass counts for in its own density, of the last compute [1/m^3]: see kernel/lattice.hpp.
  Scalar own_value() const noexcept { return own_value_; }

 private:
  std::vector<Scalar> slope_{};
  Scalar common_mass_ = 0;
  Scalar smoothing_length_ = 0, spacing_ = 0;  ///< that own_value_ is for
  Scalar own_value_ = 0;
};

}  // namespace decant::inline DECANT_TARGET
