// SPDX-License-Identifier: MIT
#pragma once

/// What a frame of simulation took, and how it went.

#include <cstdint>
#include <string_view>
#include <vector>

#include <decant/core/types.hpp>

namespace decant {

enum class StepStatus {
  ok,
  not_converged,   ///< the step was taken, but the pressure solver stopped short of its tolerance in some sub-step
  bad_time_step,   ///< the frame time is not a finite number >= 0; state unchanged
  too_many_steps,  ///< something moves too fast for the limit on sub-steps; state unchanged
  non_finite,      ///< a position or velocity became infinite or NaN; state unchanged
};

constexpr std::string_view to_string(StepStatus status) {
  switch (status) {
    case StepStatus::ok: return "ok";
    case StepStatus::not_converged: return "not converged";
    case StepStatus::bad_time_step: return "bad time step";
    case StepStatus::too_many_steps: return "too many sub-steps";
    case StepStatus::non_finite: return "non-finite";
  }
  return "unknown";
}

/// One frame. Sums and maxima are over the frame's sub-steps.
struct StepReport {
  StepStatus status = StepStatus::ok;
  int sub_steps = 0;
  int density_iterations = 0;
  int divergence_iterations = 0;
  double density_error = 0;        ///< largest of the sub-steps, mean predicted compression over rest density [-]
  double divergence_error = 0;     ///< likewise, compression per sub-step that velocities still carry [-]
  double kinetic_energy = 0;       ///< at the end of the frame [J]
  double volume = 0;               ///< mass over rest density [m^3]
  Index particles = 0;
  Index guarded = 0;               ///< steps that swept contact had to bend
  Index lost = 0;                  ///< particles that passed a wall because bodies left them no room, since the start
  Index non_finite = 0;            ///< particles with a non-finite position or velocity (status non_finite)

  /// True if the frame was simulated; false if the state is unchanged.
  bool advanced() const { return status == StepStatus::ok || status == StepStatus::not_converged; }
};

}  // namespace decant
