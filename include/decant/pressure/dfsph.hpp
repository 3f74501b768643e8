// SPDX-License-Identifier: MIT
#pragma once

/// Divergence-free SPH: pressures that keep the density and the divergence of the velocity within a tolerance.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/pressure/complementarity_solver.hpp>
#include <decant/pressure/concept.hpp>
#include <decant/pressure/pressure_system.hpp>
#include <decant/pressure/stable_step.hpp>

namespace decant::inline DECANT_TARGET {

/// After Bender and Koschier 2017, "Divergence-free SPH for incompressible and viscous fluids" (IEEE TVCG 23), with its
/// two constraints, on the velocity's divergence and on the density. Each is a linear complementarity problem: pressure
/// >= 0 where there is contact, compression <= 0 where there is none.
///   velocities:  dt D(v) <= max(rho_0 - rho, 0)      pressure acts on velocities
///   collisions:  dt D'(v) <= max(1.02 rho_0 - rho, 0), likewise, where particles meet at high speed or are too dense
///   places:      rho + dt D'(v) + D'(shift) <= rho_0   what is too dense moves apart, without gaining speed
/// Where we differ: the paper adds the density correction to the velocities, which throws liquid that starts a little
/// too dense into the air and keeps still water simmering; it forbids liquid below rest density to contract; and it
/// takes one and the same divergence for both constraints. Here D' is the derivative of the summed density, as in the
/// paper, and D is exact for linear velocities (GradientCorrection): how the density sum changes when particles slide
/// past each other is a matter of their places, and must not slow them down. With D' for both, a standing wave 20
/// particles long lost half of its amplitude in a period and a half and ran 6 % too fast; with D it keeps it for as
/// long as we looked. Velocities and places start from what the sub-step before ended with, collisions from nothing.
template <class ScalarType>
class Dfsph {
 public:
  using Scalar = ScalarType;
  static constexpr double search_margin = 0;
  static constexpr bool uses_gradient_correction = true;

  Scalar density_tolerance = Scalar(1e-3);     ///< mean compression of the next positions over rest density [-], > 0
  Scalar divergence_tolerance = Scalar(5e-5);  ///< mean compression per sub-step of the velocities [-], > 0
  Scalar largest_tolerance = Scalar(1e-2);     ///< of either, for any single particle [-], > 0
  int most_iterations = 200;                   ///< of each solve, per sub-step
  Scalar tolerance_factor = Scalar(1);         ///< of what single particles may be amiss by [-], > 0
  Scalar stability_number = Scalar(0.3);       ///< see largest_stable_step [-], > 0

  /// What is carried from step to step, to start the next solve from.
  struct Memory {
    std::vector<Scalar> pressure_term{};  ///< pressures over squared density
    std::vector<Scalar> shift_term{};     ///< the same for what corrects places, times the sub-step

    void reorder(std::span<const std::uint32_t> order) {
      for (auto* values : {&pressure_term, &shift_term}) {
        scratch.resize(order.size());
        for (std::size_t k = 0; k < order.size(); ++k) {
          scratch[k] = order[k] < values->size() ? (*values)[order[k]] : Scalar(0);
        }
        values->swap(scratch);
      }
    }
    void clear() {
      pressure_term.clear();
      shift_term.clear();
    }

   private:
    std::vector<Scalar> scratch{};
  };

  Memory& memory() noexcept { return memory_; }

  template <class Step>
  Scalar largest_step(const Step& step) const noexcept {
    double total = 0, under_pressure = 0;
    for (const Scalar term : memory_.pressure_term) {
      total += static_cast<double>(term);
      under_pressure += term > 0 ? 1 : 0;
    }
    const double mean = total > 0 ? total / under_pressure * static_cast<double>(step.rest_density) : 0;
    return largest_stable_step(step, mean, static_cast<double>(tolerance_factor * density_tolerance),
                               static_cast<double>(stability_number));
  }

  void begin_frame() noexcept { complementarity_.begin_frame(); }

  template <class Step>
  void begin_step(const Step& step, PressureReport&) noexcept {
    resize(step.fluid.size());
    complementarity_.begin_step();
    place_system_.assemble(step);
    velocity_system_.correct(place_system_, step);
  }

  template <class Step>
  void solve(const Step& step, PressureReport& report) noexcept {
    const Index count = step.fluid.size();
    const Scalar dt = step.time_step;

    velocities_to_records(step);
    parallel_for(count, step.threads, [&](Index i) {
      offset_[static_cast<std::size_t>(i)] =
          dt * velocity_system_.density_rate(step.neighbors, velocity_.data(), i, true) -
          slack(step.fluid.density[i], step.rest_density, dt);
    });
    const ComplementarityReport velocities =
        relax(step, velocity_system_, memory_.pressure_term, divergence_tolerance, net_divergence_tolerance);
    report.divergence_iterations += velocities.iterations;
    report.divergence_error = std::max(report.divergence_error, velocities.error);
    accelerate(step, velocity_system_);
    parallel_for(count, step.threads, [&](Index i) {
      const Scalar density = std::max(step.fluid.density[i], step.rest_density);
      step.fluid.pressure[i] = density * density * memory_.pressure_term[static_cast<std::size_t>(i)];
    });
    report.converged = report.converged && velocities.converged;
  }

  /// Collisions and places, when velocities are final.
  template <class Step>
  void correct_places(const Step& step, PressureReport& report) noexcept {
    const Index count = step.fluid.size();
    const Scalar dt = step.time_step;
    if (compute_density_changes(step)) {
      std::fill(impulse_.begin(), impulse_.end(), Scalar(0));
      report.divergence_iterations +=
          relax(step, place_system_, impulse_, density_tolerance, net_density_tolerance).iterations;
      accelerate(step, place_system_);
      compute_density_changes(step);
    }

    const Scalar most_compression = largest_correction * step.rest_density;
    parallel_for(count, step.threads, [&](Index i) {
      const auto own = static_cast<std::size_t>(i);
      // The formula is linear; what is far too dense is set right over several sub-steps.
      offset_[own] = std::min(step.fluid.density[i] - step.rest_density + change_[own], most_compression);
      memory_.shift_term[own] /= dt;
    });
    const ComplementarityReport places =
        relax(step, place_system_, memory_.shift_term, density_tolerance, net_density_tolerance);
    report.density_iterations += places.iterations;
    report.density_error = std::max(report.density_error, places.error);
    const Scalar farthest = largest_shift * step.spacing;
    parallel_for(count, step.threads, [&](Index i) {
      const Scalar* record = place_system_.accelerations() + 4 * i;
      const Vector3<Scalar> shift = dt * dt * Vector3<Scalar>(record[0], record[1], record[2]);
      const Scalar length = shift.norm();
      memory_.shift_term[static_cast<std::size_t>(i)] *= dt;
      step.shift.col(i) = length > farthest ? Vector3<Scalar>(shift * (farthest / length)) : shift;
    });
    report.converged = report.converged && places.converged;
  }

 private:
  enum class Flag : std::uint8_t { No, Yes };  // vector<bool> shares bytes between threads

  static constexpr Scalar contact_room = Scalar(0.1), loose_room = Scalar(0.2);  ///< of rest density
  static constexpr Scalar largest_correction = Scalar(0.2);                      ///< of rest density, per sub-step
  static constexpr Scalar largest_shift = Scalar(0.2);                           ///< spacings, per sub-step
  /// Where particles meet in disorder at high speed, D sees little of it, and places alone would have to be moved so
  /// far that pairs end up at one point. Compression per sub-step, over rest density; calm motion stays below it.
  static constexpr Scalar collision_threshold = Scalar(0.02);
  static constexpr Scalar closing_time = Scalar(0.05);  ///< [s]
  /// Mean compression of cells of particles as a whole: still water must not fall through itself by what single ones
  /// are allowed.
  static constexpr Scalar net_divergence_tolerance = Scalar(3e-5), net_density_tolerance = Scalar(3e-4);

  void resize(Index count) {
    const auto n = static_cast<std::size_t>(count);
    memory_.pressure_term.resize(n, Scalar(0));
    memory_.shift_term.resize(n, Scalar(0));
    offset_.resize(n);
    change_.resize(n);
    impulse_.resize(n);
    velocity_.resize(4 * n);
  }

  /// How much a particle may be compressed within a sub-step [kg/m^3]. Spray and the outermost layer may close up at
  /// once. What is nearly at rest density is in contact: were it free to use up its last per mille of room in one
  /// sub-step, all of a column would fall by that, be stopped, and never come to rest; so it closes slowly.
  static Scalar slack(Scalar density, Scalar rest_density, Scalar time_step) noexcept {
    const Scalar room = std::max(rest_density - density, Scalar(0));
    const Scalar loose =
        std::clamp((room / rest_density - contact_room) / (loose_room - contact_room), Scalar(0), Scalar(1));
    return room * std::max(loose, std::min(time_step / closing_time, Scalar(1)));
  }

  /// Adds what pressure does during the sub-step to the velocities.
  template <class Step>
  static void accelerate(const Step& step, const PressureSystem<Scalar>& system) noexcept {
    parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      const Scalar* record = system.accelerations() + 4 * i;
      step.fluid.velocity.col(i) += step.time_step * Vector3<Scalar>(record[0], record[1], record[2]);
    });
  }

  /// How much the summed densities will change by the velocities, and (in offset_) how much of that is a collision.
  /// @return whether there is any collision.
  template <class Step>
  bool compute_density_changes(const Step& step) noexcept {
    velocities_to_records(step);
    const Scalar tolerated = collision_threshold * step.rest_density;
    return flags_.over(
               step.fluid.size(), step.threads, Flag::No,
               [&](Index begin, Index end) {
                 bool any = false;
                 for (Index i = begin; i < end; ++i) {
                   const auto own = static_cast<std::size_t>(i);
                   change_[own] =
                       step.time_step * place_system_.density_rate(step.neighbors, velocity_.data(), i, true);
                   const Scalar room = step.rest_density - step.fluid.density[i];
                   offset_[own] = change_[own] - (room > 0 ? tolerated + room : std::max(tolerated + room, Scalar(0)));
                   any = any || offset_[own] > 0;
                 }
                 return any ? Flag::Yes : Flag::No;
               },
               [](Flag a, Flag b) { return std::max(a, b); }) == Flag::Yes;
  }

  template <class Step>
  void velocities_to_records(const Step& step) noexcept {
    parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      Scalar* record = &velocity_[4 * static_cast<std::size_t>(i)];
      record[0] = step.fluid.velocity(0, i);
      record[1] = step.fluid.velocity(1, i);
      record[2] = step.fluid.velocity(2, i);
      record[3] = place_system_.weights()[i];
    });
  }

  template <class Step>
  ComplementarityReport relax(const Step& step, PressureSystem<Scalar>& system, std::vector<Scalar>& term,
                              Scalar tolerance, Scalar net_tolerance) noexcept {
    complementarity_.mean_tolerance = static_cast<double>(tolerance_factor * tolerance);
    complementarity_.largest_tolerance = static_cast<double>(tolerance_factor * largest_tolerance);
    // whole regions must not give way the more for it: that adds up over the depth
    complementarity_.net_tolerance = static_cast<double>(std::min(tolerance_factor, Scalar(1)) * net_tolerance);
    complementarity_.most_iterations = most_iterations;
    return complementarity_.solve(step, system, offset_, term);
  }

  Memory memory_{};
  PressureSystem<Scalar> velocity_system_{}, place_system_{};
  ComplementaritySolver<Scalar> complementarity_{};
  std::vector<Scalar> offset_{}, change_{}, impulse_{}, velocity_{};
  Reduction<Flag> flags_{};
};

}  // namespace decant::inline DECANT_TARGET
