// SPDX-License-Identifier: MIT
#pragma once

/// What a simulator is told before it starts.

#include <cmath>

#include <decant/core/expects.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/simulation/liquid.hpp>

namespace decant::inline DECANT_TARGET {

/// What every simulator needs to know, whatever its parts.
struct SimulatorSettings {
  double spacing = 0.005;                ///< particle spacing d [m], > 0
  Liquid liquid{};                       ///< rest density, viscosity, surface tension
  Vector3<double> gravity{0, 0, -9.81};  ///< [m/s^2], world frame
  double support_in_spacings = 2;        ///< support radius over d, 1.5 .. 4
  double largest_step = 0.005;           ///< longest sub-step [s], > 0
  double courant_number = 0.4;           ///< how many spacings liquid may move past a body per sub-step,
                                         ///< 0 < .. <= 2
  double stability_number = 0.3;         ///< the same, in a sub-step, of the speed that pressure stands for: see
                                         ///< largest_stable_step; 0 < .. <= 1, deep liquid collapses at 0.5
  double tolerance_factor = 1;           ///< of the pressure solver's tolerances for single particles, 0.01 .. 100
  double fixed_step = 0;                 ///< if > 0, the length of every sub-step [s] (frames need not fit)
  int most_sub_steps = 2000;             ///< per frame; beyond it a frame is refused
  double numerical_viscosity = 0.6;      ///< of ResidualViscosity, in units of d sqrt(g d), and a third of it in
                                         ///< units of d sqrt(p / rho_0) where that is more: calms motion from
                                         ///< particle to particle and leaves the liquid's alone; >= 0
  Threads threads{};                     ///< 0: all
};

/// For liquid that a camera keeps correcting, or that is one hypothesis among many: longer sub-steps, and single
/// particles kept within 0.2 % of the density in the mean in place of 0.1 %, whole regions as before. Pours are
/// predicted as well as with the settings that are handed in. For liquid up to 60 layers deep; of 80,
/// it would collapse into itself, unless tolerance_factor is 1.
inline SimulatorSettings for_tracking(SimulatorSettings settings) {
  settings.courant_number = 1.6;
  settings.stability_number = 0.4;
  settings.tolerance_factor = 2;
  return settings;
}

/// Throws std::invalid_argument if a setting is out of range.
inline void validate(const SimulatorSettings& settings) {
  validate(settings.liquid);
  expects(settings.spacing >= 1e-5 && settings.spacing <= 10, "SimulatorSettings: spacing [m]", "1e-5 .. 10",
          settings.spacing);
  expects(settings.gravity.allFinite() && settings.gravity.norm() < 1e4, "SimulatorSettings: gravity [m/s^2]",
          "finite and below 1e4", settings.gravity.transpose());
  expects(settings.support_in_spacings >= 1.5 && settings.support_in_spacings <= 4,
          "SimulatorSettings: support_in_spacings", "1.5 .. 4", settings.support_in_spacings);
  expects(settings.largest_step > 0 && std::isfinite(settings.largest_step), "SimulatorSettings: largest_step [s]",
          "> 0 and finite", settings.largest_step);
  expects(settings.courant_number > 0 && settings.courant_number <= 2, "SimulatorSettings: courant_number",
          "> 0 and <= 2", settings.courant_number);
  expects(settings.stability_number > 0 && settings.stability_number <= 1, "SimulatorSettings: stability_number",
          "> 0 and <= 1", settings.stability_number);
  expects(settings.tolerance_factor >= 0.01 && settings.tolerance_factor <= 100, "SimulatorSettings: tolerance_factor",
          "0.01 .. 100", settings.tolerance_factor);
  expects(settings.fixed_step >= 0 && std::isfinite(settings.fixed_step), "SimulatorSettings: fixed_step [s]",
          ">= 0 and finite", settings.fixed_step);
  expects(settings.numerical_viscosity >= 0 && settings.numerical_viscosity < 100,
          "SimulatorSettings: numerical_viscosity", ">= 0 and < 100", settings.numerical_viscosity);
  expects(settings.most_sub_steps > 0, "SimulatorSettings: most_sub_steps", "> 0", settings.most_sub_steps);
  expects(settings.threads.count >= 0 && settings.threads.count <= 1024, "SimulatorSettings: threads", "0 .. 1024",
          settings.threads.count);
}

}  // namespace decant::inline DECANT_TARGET
