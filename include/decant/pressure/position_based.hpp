// SPDX-License-Identifier: MIT
#pragma once

/// Position-based fluids: particles are moved until the density is right, velocities follow.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <decant/core/batch.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/pressure/concept.hpp>
#include <decant/pressure/stable_step.hpp>

namespace decant::inline DECANT_TARGET {

/// After Macklin and Mueller 2013, "Position based fluids" (ACM TOG 32). With the constraint C_i = rho_i / rho_0 - 1 <=
/// 0 of every particle at its predicted position x* = x + dt v, each sweep computes (eqs. 8, 9, 11, 12)
///   lambda_i = -omega C_i / (sum_k |grad_k C_i|^2 + epsilon),
///   dx_i     = (1 / rho_0) sum_j m_j (lambda_i + lambda_j) grad W_ij + 2 lambda_i grad phi_i
/// and velocities become (x_new - x) / dt. Constraints only push: a sweep may take back what earlier ones pushed too
/// far, and no more (the paper applies C_i of either sign or of positive sign only). Pair moves are mutual, so momentum
/// is kept to rounding. Neighbours are those of the start, found a little beyond the support; walls enter linearised,
/// phi(x*) = phi(x) + grad phi . (x* - x) - dt flux, and mirror lambda as they mirror pressure in PressureSystem.
/// Differs from the paper in what becomes speed: all of what the sub-step would compress, but only a share of what was
/// too dense before it, C_i <= (1 - recovery) max(0, C_i(x)), as Baumgarte 1972 stabilizes constraints. Sweeps leave
/// some compression over, and undone within one short sub-step a per cent of it is as fast as a jet: with the paper's
/// recovery of 1, water at rest in a cup of 22 layers (a mesh) has 1.2 m/s after a second, with 0.3 half a centimetre.
/// An error and a stiffness that depend on the number of sweeps: take Dfsph for accuracy.
template <class ScalarType>
class PositionBased {
 public:
  using Scalar = ScalarType;
  static constexpr double search_margin = 0.1;

  int most_iterations = 12;                 ///< sweeps per sub-step, >= 1
  Scalar density_tolerance = Scalar(1e-3);  ///< mean compression beyond the constraints that ends the sweeps [-]
  /// omega [-], 0 < omega <= 1. All particles move at once, each as if the others stood still; at more than about a
  /// half they overshoot together.
  Scalar relaxation = Scalar(0.5);
  /// Share of the compression before the sub-step that is undone in it, and becomes speed [-], 0 < recovery <= 1.
  Scalar recovery = Scalar(0.3);
  /// epsilon over the denominator of a full neighbourhood [-], >= 0: softens particles with few neighbours.
  Scalar softness = Scalar(0.01);
  /// Whether reports say what is left when most_iterations are done: it takes one more look at all pairs.
  bool measures_what_is_left = true;

  /// Carried from step to step.
  struct Memory {
    double calm_pressure = 0;  ///< mean over what is under pressure, over rest density [m^2/s^2]; see largest_step

    void reorder(std::span<const std::uint32_t>) noexcept {}
    void clear() noexcept { calm_pressure = 0; }
  };

  Memory& memory() noexcept { return memory_; }

  /// As for other solvers, by a pressure that follows quickly when it falls and slowly when it rises. What is too dense
  /// is moved apart within one sub-step, however short: the shorter it is, the higher the pressure looks, and steps
  /// that followed it would get ever shorter and turn a per cent of compression into metres per second.
  template <class Step>
  Scalar largest_step(const Step& step) const noexcept {
    return largest_stable_step(step, memory_.calm_pressure, std::numeric_limits<double>::infinity(), 0.3);
  }

  template <class Step>
  void begin_step(const Step&, PressureReport&) noexcept {}

  template <class Step>
  void solve(const Step& step, PressureReport& report) noexcept {
    const Index count = step.fluid.size();
    const Scalar dt = step.time_step;
    if (count == 0 || !(dt > 0)) {
      return;
    }
    records_.resize(4 * static_cast<std::size_t>(count));
    factor_.resize(static_cast<std::size_t>(count));
    total_.resize(static_cast<std::size_t>(count));
    allowed_.resize(static_cast<std::size_t>(count));
    parallel_for(count, step.threads, [&](Index i) {
      Scalar* record = &records_[static_cast<std::size_t>(4 * i)];
      for (Index axis = 0; axis < 3; ++axis) {
        record[axis] = dt * step.fluid.velocity(axis, i);
      }
      record[3] = step.fluid.mass[i];
      total_[static_cast<std::size_t>(i)] = 0;
      allowed_[static_cast<std::size_t>(i)] =
          (1 - recovery) * std::max(step.fluid.density[i] / step.rest_density - 1, Scalar(0));
    });
    // Denominator of a lattice without walls, about: m / rho_0 is d^3, and |grad C|^2 adds up to some 1 / d^2.
    const Scalar floor = std::max(softness, Scalar(1e-6)) / (step.spacing * step.spacing);
    const bool alike = (step.fluid.mass.array() == step.fluid.mass[0]).all();
    const bool at_rest = step.fluid.velocity.isZero(0);
    Compression left;
    int iterations = 0;
    for (;;) {
      if (iterations == most_iterations && !measures_what_is_left) {
        break;
      }
      const bool moved = !at_rest || iterations > 0;
      for_pairs(alike, moved, [&](auto pairs) { left = find_factors<decltype(pairs)>(step, floor); });
      if (left.beyond <= static_cast<double>(density_tolerance) || iterations == most_iterations) {
        break;  // what is left belongs to the positions as they are: the factors are not used
      }
      for_pairs(alike, moved, [&](auto pairs) { move<decltype(pairs)>(step); });
      ++iterations;
    }
    report.density_iterations += iterations;
    if (iterations < most_iterations || measures_what_is_left) {
      report.density_error = std::max(report.density_error, left.all);
      report.converged = report.converged && left.beyond <= static_cast<double>(density_tolerance);
    }
    parallel_for(count, step.threads, [&](Index i) {
      const Scalar* record = &records_[static_cast<std::size_t>(4 * i)];
      step.fluid.velocity.col(i) = Vector3<Scalar>(record[0], record[1], record[2]) / dt;
      // The moves of a pressure p are dx_i = -dt^2 sum_j m_j (p_i + p_j) / rho^2 grad W_ij.
      step.fluid.pressure[i] = -total_[static_cast<std::size_t>(i)] * step.rest_density / (dt * dt);
    });
    remember_pressure(step);
  }

 private:
  using B = Batch<Scalar>;

  template <class Step>
  void remember_pressure(const Step& step) noexcept {
    double total = 0, under_pressure = 0;
    for (Index i = 0; i < step.fluid.size(); ++i) {
      total += static_cast<double>(step.fluid.pressure[i]);
      under_pressure += step.fluid.pressure[i] > 0 ? 1 : 0;
    }
    const double mean = total > 0 ? total / (under_pressure * static_cast<double>(step.rest_density)) : 0;
    double& calm = memory_.calm_pressure;
    // by a fifth per sub-step, and from nothing by that of about the weight of one layer
    const double one_layer = 10 * static_cast<double>(step.spacing);
    calm = std::min(mean, calm + 0.2 * std::max(calm, one_layer));
  }

  /// What is known of all pairs of a sweep, and need not be fetched from all over for each: that all particles have one
  /// mass, and whether any was moved since the list of neighbours was made.
  template <bool Alike, bool AnyMoved>
  struct Pairs {
    static constexpr bool alike = Alike, any_moved = AnyMoved;
  };
  template <class Sweep>
  static void for_pairs(bool alike, bool any_moved, Sweep&& sweep) {
    if (!alike) {
      sweep(Pairs<false, true>{});
    } else if (any_moved) {
      sweep(Pairs<true, true>{});
    } else {
      sweep(Pairs<true, false>{});
    }
  }

  /// Separations at the predicted positions, pair by pair: those of the list and the difference of what was moved.
  /// Works in periodic domains as well.
  struct Moved {
    B x, y, z, distance, mass;
  };
  template <class Kind, class Pair>
  [[gnu::always_inline]] Moved moved(const Pair& pair, const Scalar* own) const noexcept {
    Moved result;
    if constexpr (Kind::any_moved) {
      const auto other = gather4(records_.data(), pair.neighbor);
      result.x = pair.x + (B(own[0]) - other.x);
      result.y = pair.y + (B(own[1]) - other.y);
      result.z = pair.z + (B(own[2]) - other.z);
      result.mass = Kind::alike ? B(own[3]) : other.w;
    } else {
      static_assert(Kind::alike);
      result.x = pair.x;
      result.y = pair.y;
      result.z = pair.z;
      result.mass = B(own[3]);
    }
    result.distance = square_root(squared_length(result.x, result.y, result.z));
    return result;
  }

  /// Means over the liquid [-].
  struct Compression {
    double all = 0, beyond = 0;  ///< beyond what is allowed
  };

  /// lambda of every particle; returns how compressed the liquid is before it acts.
  template <class Kind, class Step>
  Compression find_factors(const Step& step, Scalar floor) noexcept {
    using Kernel = typename Step::Kernel;
    const Index count = step.fluid.size();
    const Scalar h = step.smoothing_length;
    const Scalar rho = step.rest_density;
    const Compression total = reduction_.over(
        count, step.threads, Compression{},
        [&](Index begin, Index end) {
          Compression partial;
          for (Index i = begin; i < end; ++i) {
            const auto own = static_cast<std::size_t>(i);
            const Scalar* record = &records_[4 * own];
            B density(Scalar(0)), x(Scalar(0)), y(Scalar(0)), z(Scalar(0)), squares(Scalar(0));
            step.neighbors.for_each_batch(i, [&](const auto& pair) {
              const Moved at = moved<Kind>(pair, record);
              density += select(pair.valid, at.mass * Kernel::value(at.distance, h), B(Scalar(0)));
              const B slope = at.mass * Kernel::derivative_over_radius(at.distance, h);
              const B gx = slope * at.x, gy = slope * at.y, gz = slope * at.z;
              x += gx;
              y += gy;
              z += gz;
              if constexpr (Kind::alike) {
                squares += squared_length(gx, gy, gz);
              } else {
                squares += squared_length(gx, gy, gz) * (B(record[3]) / at.mass);
              }
            });
            const Vector3<Scalar> wall = step.walls.gradient.col(i);
            const Scalar fraction = step.walls.share[i] + wall[0] * record[0] + wall[1] * record[1] +
                                    wall[2] * record[2] - step.time_step * step.walls.flux[i];
            const Scalar share = std::max(fraction, Scalar(0));
            const Scalar excess = (sum(density) + record[3] * step.pairs.own_value()) / rho + share - 1;
            const Scalar beyond = excess - allowed_[own];
            partial.all += static_cast<double>(std::max(excess, Scalar(0)));
            partial.beyond += static_cast<double>(std::max(beyond, Scalar(0)));
            const Vector3<Scalar> pairs = Vector3<Scalar>(sum(x), sum(y), sum(z)) / rho;
            const Scalar response = std::max(sum(squares) / (rho * rho) + (pairs + wall).squaredNorm(), Scalar(0));
            // constraints only push; total_ holds what was pushed so far and may be taken back, but not beyond
            const Scalar wanted = -relaxation * beyond / (response + floor);
            factor_[own] = std::min(wanted, -total_[own]);
          }
          return partial;
        },
        [](const Compression& a, const Compression& b) {
          return Compression{a.all + b.all, a.beyond + b.beyond};
        });
    return {total.all / static_cast<double>(count), total.beyond / static_cast<double>(count)};
  }

  template <class Kind, class Step>
  void move(const Step& step) noexcept {
    using Kernel = typename Step::Kernel;
    const Index count = step.fluid.size();
    const Scalar h = step.smoothing_length;
    next_.resize(records_.size());
    parallel_for(count, step.threads, [&](Index i) {
      const auto own = static_cast<std::size_t>(i);
      const Scalar* record = &records_[4 * own];
      const B own_factor(factor_[own]);
      B x(Scalar(0)), y(Scalar(0)), z(Scalar(0));
      step.neighbors.for_each_batch(i, [&](const auto& pair) {
        const B both = own_factor + gather(factor_.data(), pair.neighbor);
        if (all(both == B(Scalar(0)))) {
          return;  // nobody here is too dense
        }
        const Moved at = moved<Kind>(pair, record);
        const B push = at.mass * both * Kernel::derivative_over_radius(at.distance, h);
        x = multiply_add(push, at.x, x);
        y = multiply_add(push, at.y, y);
        z = multiply_add(push, at.z, z);
      });
      const Vector3<Scalar> wall = step.walls.gradient.col(i);
      total_[own] += factor_[own];
      Scalar* next = &next_[4 * own];
      const Scalar scale = 1 / step.rest_density;
      next[0] = record[0] + scale * sum(x) + factor_[own] * wall[0];
      next[1] = record[1] + scale * sum(y) + factor_[own] * wall[1];
      next[2] = record[2] + scale * sum(z) + factor_[own] * wall[2];
      next[3] = record[3];
    });
    records_.swap(next_);
  }

  Memory memory_{};
  std::vector<Scalar> records_{}, next_{};  ///< move since the start of the sub-step [m], mass
  std::vector<Scalar> factor_{};            ///< lambda of this sweep [m^2]
  std::vector<Scalar> total_{};             ///< of all sweeps
  std::vector<Scalar> allowed_{};           ///< compression that is left as it is [-]
  Reduction<Compression> reduction_{};
};

}  // namespace decant::inline DECANT_TARGET
