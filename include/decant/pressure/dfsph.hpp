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
#include <decant/core/types.hpp>
#include <decant/pressure/concept.hpp>
#include <decant/pressure/pressure_system.hpp>

namespace decant {

/// After Bender and Koschier 2017, "Divergence-free SPH for incompressible and viscous fluids" (IEEE TVCG 23), with its two
/// constraints, on the velocity's divergence and on the density. Each is a linear complementarity problem: pressure >= 0
/// where there is contact, compression <= 0 where there is none.
///   velocities:  dt D(v) <= max(rho_0 - rho, 0)    pressure acts on velocities
///   places:      rho + dt D(v) + D(shift) <= rho_0   what is too dense moves apart, without gaining speed
/// Where we differ: the paper adds the density correction to the velocities, which throws liquid that starts a little too
/// dense into the air and keeps still water simmering; and it forbids liquid below rest density to contract.
/// Solved by Jacobi steps with Nesterov's momentum, restarted when the steps turn back; velocities start from the
/// pressures of the sub-step before.
template <class ScalarType>
class Dfsph {
 public:
  using Scalar = ScalarType;
  static constexpr double search_margin = 0;

  Scalar density_tolerance = Scalar(1e-3);     ///< mean compression of the next positions over rest density [-], > 0
  Scalar divergence_tolerance = Scalar(1e-4);  ///< mean compression per sub-step of the velocities [-], > 0; ten times
                                               ///< looser, still water keeps falling through itself by what is allowed
  Scalar largest_tolerance = Scalar(3e-3);     ///< of either, for any single particle [-], > 0
  int most_iterations = 100;                   ///< of each solve, per sub-step

  /// What is carried from step to step: pressures over squared density.
  struct Memory {
    std::vector<Scalar> pressure_term{};

    void reorder(std::span<const std::uint32_t> order) {
      scratch.resize(order.size());
      for (std::size_t k = 0; k < order.size(); ++k) {
        scratch[k] = order[k] < pressure_term.size() ? pressure_term[order[k]] : Scalar(0);
      }
      pressure_term.swap(scratch);
    }
    void clear() { pressure_term.clear(); }

   private:
    std::vector<Scalar> scratch{};
  };

  Memory& memory() noexcept { return memory_; }

  /// Pressure holds particles in place against modes that the density does not see (every other one up, every other one
  /// down) with the stiffness p / (rho d^2), and the sub-step integrates that explicitly. At 0.25 d / sqrt(p / rho) still
  /// water stays still; at four times as much a column collapses into itself. Taken for twice the mean pressure, which is
  /// the largest of a liquid at rest.
  template <class Step>
  Scalar largest_step(const Step& step) const noexcept {
    double total = 0;
    for (const Scalar term : memory_.pressure_term) {
      total += static_cast<double>(term);
    }
    if (!(total > 0)) {
      return std::numeric_limits<Scalar>::infinity();
    }
    const double mean = total / static_cast<double>(memory_.pressure_term.size()) * static_cast<double>(step.rest_density);
    return static_cast<Scalar>(0.25 * static_cast<double>(step.spacing) / std::sqrt(2 * mean));
  }

  template <class Step>
  void begin_step(const Step& step, PressureReport&) noexcept {
    resize(step.fluid.size());
    system_.assemble(step);
  }

  template <class Step>
  void solve(const Step& step, PressureReport& report) noexcept {
    const Index count = step.fluid.size();
    const Scalar dt = step.time_step;

    velocities_to_records(step);
    parallel_for(count, step.threads, [&](Index i) {
      offset_[static_cast<std::size_t>(i)] = dt * system_.density_rate(step.neighbors, velocity_.data(), i, true) -
                                             slack(step.fluid.density[i], step.rest_density, dt);
    });
    const Outcome velocities = relax(step, memory_.pressure_term, divergence_tolerance);
    report.divergence_iterations += velocities.iterations;
    report.divergence_error = std::max(report.divergence_error, velocities.error);
    parallel_for(count, step.threads, [&](Index i) {
      const Scalar* record = system_.accelerations() + 4 * i;
      step.fluid.velocity.col(i) += dt * Vector3<Scalar>(record[0], record[1], record[2]);
      const Scalar density = std::max(step.fluid.density[i], step.rest_density);
      step.fluid.pressure[i] = density * density * memory_.pressure_term[static_cast<std::size_t>(i)];
    });

    velocities_to_records(step);
    const Scalar most_compression = largest_correction * step.rest_density;
    parallel_for(count, step.threads, [&](Index i) {
      const auto own = static_cast<std::size_t>(i);
      // The formula is linear; what is far too dense is set right over several sub-steps.
      offset_[own] = std::min(step.fluid.density[i] - step.rest_density +
                                  dt * system_.density_rate(step.neighbors, velocity_.data(), i, true),
                              most_compression);
      shift_term_[own] = 0;
    });
    const Outcome places = relax(step, shift_term_, density_tolerance);
    report.density_iterations += places.iterations;
    report.density_error = std::max(report.density_error, places.error);
    const Scalar farthest = largest_shift * step.spacing;
    parallel_for(count, step.threads, [&](Index i) {
      const Scalar* record = system_.accelerations() + 4 * i;
      const Vector3<Scalar> shift = dt * dt * Vector3<Scalar>(record[0], record[1], record[2]);
      const Scalar length = shift.norm();
      step.shift.col(i) = length > farthest ? Vector3<Scalar>(shift * (farthest / length)) : shift;
    });
    report.converged = report.converged && velocities.converged && places.converged;
  }

 private:
  static constexpr int fewest_iterations = 2;
  static constexpr Scalar contact_room = Scalar(0.1), loose_room = Scalar(0.2);  ///< of rest density
  static constexpr Scalar largest_correction = Scalar(0.05);  ///< of rest density, per sub-step
  static constexpr Scalar largest_shift = Scalar(0.2);        ///< spacings, per sub-step
  static constexpr Scalar closing_time = Scalar(0.05);                           ///< [s]
  /// Jacobi steps with momentum converge while relaxation times the largest eigenvalue of the scaled system stays below
  /// one. The eigenvalue itself was not measured; in a collapsing column 0.3 converged, 0.5 diverged after 20 iterations.
  static constexpr Scalar relaxation = Scalar(0.3);

  struct Outcome {
    int iterations = 0;
    double error = 0;
    bool converged = false;
  };

  struct Residual {
    double sum = 0;      ///< of what is amiss at each particle
    double largest = 0;  ///< of them
    double descent = 0;  ///< (step taken) . (last step): negative once the momentum points uphill
  };

  void resize(Index count) {
    const auto n = static_cast<std::size_t>(count);
    memory_.pressure_term.resize(n, Scalar(0));
    shift_term_.resize(n);
    offset_.resize(n);
    previous_.resize(n);
    next_.resize(n);
    velocity_.resize(4 * n);
  }

  /// How much a particle may be compressed within a sub-step [kg/m^3]. Spray and the outermost layer may close up at once.
  /// What is nearly at rest density is in contact: were it free to use up its last per mille of room in one sub-step, all
  /// of a column would fall by that, be stopped, and never come to rest; so it closes slowly.
  static Scalar slack(Scalar density, Scalar rest_density, Scalar time_step) noexcept {
    const Scalar room = std::max(rest_density - density, Scalar(0));
    const Scalar loose = std::clamp((room / rest_density - contact_room) / (loose_room - contact_room), Scalar(0), Scalar(1));
    return room * std::max(loose, std::min(time_step / closing_time, Scalar(1)));
  }

  template <class Step>
  void velocities_to_records(const Step& step) noexcept {
    parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      Scalar* record = &velocity_[4 * static_cast<std::size_t>(i)];
      record[0] = step.fluid.velocity(0, i);
      record[1] = step.fluid.velocity(1, i);
      record[2] = step.fluid.velocity(2, i);
      record[3] = 0;
    });
  }

  /// Finds term >= 0 such that offset + dt^2 D(a(term)) <= 0 up to the tolerance; leaves the matching
  /// accelerations in the system. The error is measured for the very pressures that are returned.
  template <class Step>
  Outcome relax(const Step& step, std::vector<Scalar>& term, Scalar tolerance) noexcept {
    const Index count = step.fluid.size();
    const Scalar squared_step = step.time_step * step.time_step;
    Outcome outcome;
    if (count == 0 || !(squared_step > 0)) {
      std::fill(term.begin(), term.end(), Scalar(0));
      system_.accelerate(step.neighbors, term.data(), step.threads);
      outcome.converged = true;
      return outcome;
    }
    previous_ = term;
    Scalar momentum_age = 1;
    const double allowed = static_cast<double>(tolerance) * static_cast<double>(step.rest_density) *
                           static_cast<double>(count);
    const double largest_allowed = static_cast<double>(largest_tolerance) * static_cast<double>(step.rest_density);
    for (;;) {
      system_.accelerate(step.neighbors, term.data(), step.threads);
      const Scalar next_age = (1 + std::sqrt(1 + 4 * momentum_age * momentum_age)) / 2;
      const Scalar momentum = (momentum_age - 1) / next_age;
      ++outcome.iterations;
      const bool measure_only = outcome.iterations > most_iterations;
      const Residual residual = reduction_.over(
          count, step.threads, Residual{},
          [&](Index begin, Index end) {
            Residual partial;
            for (Index i = begin; i < end; ++i) {
              const auto own = static_cast<std::size_t>(i);
              const Scalar excess =
                  offset_[own] + squared_step * system_.density_rate(step.neighbors, system_.accelerations(), i, false);
              const Scalar slope = squared_step * system_.diagonal()[own];
              // pressure that pushes liquid apart is as wrong as compression that is left
              const Scalar amiss = std::max(excess, std::min(-excess, term[own] * slope));
              partial.sum += static_cast<double>(amiss);
              partial.largest = std::max(partial.largest, static_cast<double>(amiss));
              const Scalar moved =
                  slope > smallest_slope(step) ? std::max(term[own] + relaxation * excess / slope, Scalar(0)) : Scalar(0);
              next_[own] = moved;
              partial.descent += static_cast<double>((moved - term[own]) * (moved - previous_[own]));
            }
            return partial;
          },
          [](Residual a, const Residual& b) {
            return Residual{a.sum + b.sum, std::max(a.largest, b.largest), a.descent + b.descent};
          });
      outcome.error = residual.sum / (static_cast<double>(step.rest_density) * static_cast<double>(count));
      outcome.converged = residual.sum <= allowed && residual.largest <= largest_allowed;
      if ((outcome.converged && outcome.iterations >= fewest_iterations) || measure_only) {
        break;
      }
      const bool restart = residual.descent < 0;
      momentum_age = restart ? Scalar(1) : next_age;
      const Scalar carry = restart ? Scalar(0) : momentum;
      parallel_for(count, step.threads, [&](Index i) {
        const auto own = static_cast<std::size_t>(i);
        term[own] = std::max(next_[own] + carry * (next_[own] - previous_[own]), Scalar(0));
        previous_[own] = next_[own];
      });
    }
    return outcome;
  }

  /// A particle that feels neither neighbours nor walls has no slope to divide by.
  template <class Step>
  Scalar smallest_slope(const Step& step) const noexcept {
    const Scalar unit = step.rest_density / step.spacing;
    return Scalar(1e-6) * step.time_step * step.time_step * unit * unit;
  }

  Memory memory_{};
  PressureSystem<Scalar> system_{};
  std::vector<Scalar> offset_{}, shift_term_{}, previous_{}, next_{}, velocity_{};
  Reduction<Residual> reduction_{};
};

}  // namespace decant
