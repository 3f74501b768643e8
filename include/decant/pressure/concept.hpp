// SPDX-License-Identifier: MIT
#pragma once

/// What a pressure solver has to provide.

#include <concepts>
#include <cstdint>
#include <span>

#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// What a solve took and reached.
struct PressureReport {
  int density_iterations = 0;
  int divergence_iterations = 0;
  double density_error = 0;     ///< mean predicted compression over the liquid, relative to rest density [-]
  double divergence_error = 0;  ///< mean compression per sub-step that the velocities still carry [-]
  bool converged = true;
};

/// Keeps the liquid incompressible. A plain value with settings, and scratch memory of its own.
/// begin_frame(), which a solver need not have: a frame begins, and all but memory() has to be forgotten, so that frames
/// come out the same from the same state.
/// begin_step(step, report): called when neighbours, walls and densities of a sub-step are there; may change
/// velocities.
/// solve(step, report): called when all other forces have been added to the velocities; adds those of pressure and may
/// write step.shift, so that positions advanced by time_step * velocity + shift are where the liquid should be; writes
/// fluid.pressure [Pa].
/// correct_places(step, report), which a solver need not have: called when velocities are final, after forces that act
/// after the pressure (see ForceTerm); for what then is left to correct by velocities or step.shift.
/// largest_step(step) [s]: the solver's own limit on the sub-step (sound speed, for one), infinity if it has none.
/// memory(): what the solver remembers from one sub-step to the next, a value that snapshots copy, with
/// reorder(order): the particles were put into another order, place k now holds what was at order[k]; particles that
/// are new have a number beyond the old count. clear() forgets.
/// search_margin [-]: neighbours are searched to the support radius times 1 + this.
/// Nothing may throw; scratch memory grows with the number of particles only.
/// Laws: still water stays still; momentum of a free drop is kept.
template <class P, class Step>
concept PressureSolver =
    requires(P& solver, const Step& step, PressureReport& report, std::span<const std::uint32_t> order) {
      { solver.begin_step(step, report) } noexcept -> std::same_as<void>;
      { solver.solve(step, report) } noexcept -> std::same_as<void>;
      { solver.largest_step(step) } noexcept -> std::same_as<typename Step::Scalar>;
      { solver.memory() } noexcept -> std::same_as<typename P::Memory&>;
      requires std::copyable<typename P::Memory>;
      solver.memory().reorder(order);
      solver.memory().clear();
      { P::search_margin } -> std::convertible_to<double>;
    };

}  // namespace decant::inline DECANT_TARGET
