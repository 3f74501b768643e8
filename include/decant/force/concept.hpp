// SPDX-License-Identifier: MIT
#pragma once

/// What a force term has to provide.

#include <concepts>

#include <decant/core/target.hpp>
#include <decant/force/step_view.hpp>
#include <decant/neighbor/neighbor_list.hpp>

namespace decant::inline DECANT_TARGET {

/// An acceleration of the liquid other than pressure. A plain value: settings inside, defaults for everything.
/// accumulate(step, acceleration): adds the term's acceleration [m/s^2] to each column of `acceleration`, 3xN, and
/// overwrites nothing. step is a StepView; velocities in it are those before the sub-step (but see below). Called once
/// per sub-step, from one thread; it may run loops with step.threads, must give the same bits for any number of them,
/// must not throw, and allocates only when the number of particles grows (scratch memory belongs to the term).
/// A term with `static constexpr bool acts_after_pressure = true` is called when the pressure has acted, sees the
/// velocities and pressures that this has left, and has the last word.
/// largest_step(step) [s]: the longest sub-step that the term integrates stably, infinity where it has no limit.
/// Laws (decant/testing/force.hpp): adds; the same for 1, 2 and 4 threads; liquid at rest without gravity gains no
/// momentum.
template <class F, class Step>
concept ForceTerm = requires(F& force, const Step& step, PointArray<typename Step::Scalar>& acceleration) {
  { force.accumulate(step, acceleration) } noexcept -> std::same_as<void>;
  { force.largest_step(step) } noexcept -> std::same_as<typename Step::Scalar>;
};

}  // namespace decant::inline DECANT_TARGET
