// SPDX-License-Identifier: MIT
#pragma once

/// What forces and pressure solvers see of one sub-step.

#include <cstdint>

#include <decant/boundary/wall_state.hpp>
#include <decant/core/batch.hpp>
#include <decant/core/fluid_state.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/force/gradient_correction.hpp>
#include <decant/force/pair_kernel.hpp>

namespace decant::inline DECANT_TARGET {

/// Everything is as of the start of the sub-step: densities, neighbours and walls belong to fluid.position.
/// Does not own what it refers to; valid during one sub-step.
template <class KernelType, class NeighborsType>
struct StepView {
  using Kernel = KernelType;
  using Neighbors = NeighborsType;
  using Scalar = typename Kernel::Scalar;

  FluidState<Scalar>& fluid;
  const Neighbors& neighbors;       ///< pairs within the support radius, without those that a wall separates
  const PairKernel<Scalar>& pairs;  ///< the kernel at each of them
  const WallState<Scalar>& walls;
  const GradientCorrection<Scalar>& correction;  ///< empty unless a part has `uses_gradient_correction = true`
  Growable<Scalar, 3>& shift;   ///< 3xN, moved at the end of the sub-step beside time_step * velocity [m]; zero at
                                ///< its start. For pressure solvers that correct places without adding speed.
  Scalar smoothing_length = 0;  ///< h [m]
  Scalar spacing = 0;           ///< particle spacing d [m]
  Scalar rest_density = 0;      ///< [kg/m^3]
  Scalar time_step = 0;         ///< [s]; 0 before it has been chosen
  double time = 0;              ///< [s]
  Threads threads{};

  /// Of a batch of particles, by their numbers [kg].
  [[gnu::always_inline]] Batch<Scalar> mass(const std::uint32_t* numbers) const noexcept {
    return pairs.common_mass() > 0 ? Batch<Scalar>(pairs.common_mass()) : gather(fluid.mass.data(), numbers);
  }
};

}  // namespace decant::inline DECANT_TARGET
