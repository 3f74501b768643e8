// SPDX-License-Identifier: MIT
#pragma once

/// Weakly compressible SPH: pressure as a function of density, explicit steps.

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
#include <decant/force/detail/pair_stiffness.hpp>
#include <decant/pressure/concept.hpp>

namespace decant::inline DECANT_TARGET {

/// Tait's equation p = B ((rho / rho_0)^gamma - 1) (Monaghan 1994, "Simulating free surface flows with SPH", eq. 2.3;
/// its sound speed is c^2 = gamma B / rho_0), with the symmetric, momentum-conserving pressure force of Monaghan 1992
///   a_i = -sum_j m_j (P_i + P_j) grad W_ij - 2 rho_0 P_i grad phi_i,    P = p / rho^2,
/// where walls mirror the particle's pressure (see PressureSystem). Densities are the summed ones of the sub-step, so
/// they do not drift. One sweep over the pairs and nothing stored per pair; steps are as short as sound demands, about
/// 0.3 d/c, where c is that of the most compressed particle: an impact stiffens the liquid. With longer ones, drops
/// that meet at a wall are thrown away at many times their speed. With gamma = 1 it is the linear p = c^2 (rho -
/// rho_0): see set_sound_speed.
template <class ScalarType>
class StateEquation {
 public:
  using Scalar = ScalarType;
  static constexpr double search_margin = 0;

  Scalar stiffness = Scalar(50000);     ///< B [Pa], > 0
  Scalar exponent = Scalar(7);          ///< gamma [-], >= 1
  Scalar courant_number = Scalar(0.3);  ///< how many spacings the fastest sound may travel per sub-step, > 0
  /// Lets pressures be negative where the liquid is thinner than at rest. Off by default: a summed density is low at
  /// every free surface, and particles that attract each other clump (the tensile instability, Monaghan 2000).
  bool negative_pressure = false;
  /// Monaghan's artificial viscosity, alpha [-], >= 0, off by default. It brakes pairs that approach each other, with
  ///   a_i += alpha h c sum_j m_j / rho_ij (v_ij . x_ij) / (r^2 + 0.01 h^2) grad W_ij   (Monaghan 1992, eq. 4.1, beta
  ///   0)
  /// and quietens the sound that an impact leaves. 0.01 .. 0.1 is usual; it acts like a kinematic viscosity of about
  /// alpha h c / 20, so results depend on the spacing.
  Scalar artificial_viscosity = Scalar(0);

  /// Nothing is carried from step to step.
  struct Memory {
    void reorder(std::span<const std::uint32_t>) noexcept {}
    void clear() noexcept {}
  };

  Memory& memory() noexcept { return memory_; }

  /// c = sqrt(gamma B / rho_0) [m/s], at rest density [kg/m^3].
  Scalar sound_speed(Scalar rest_density) const noexcept { return std::sqrt(exponent * stiffness / rest_density); }

  /// Chooses B for a sound speed [m/s] > 0. About ten times the largest speed keeps the density within 1 %.
  void set_sound_speed(Scalar speed, Scalar rest_density) noexcept {
    stiffness = speed * speed * rest_density / exponent;
  }

  /// p of a density, both for this equation's settings [Pa].
  Scalar pressure(Scalar density, Scalar rest_density) const noexcept {
    const Scalar p = stiffness * (power(density / rest_density) - 1);
    return negative_pressure ? p : std::max(p, Scalar(0));
  }

  template <class Step>
  Scalar largest_step(const Step& step) const noexcept {
    Scalar highest = 0;  // of the last sub-step
    for (Index i = 0; i < step.fluid.size(); ++i) {
      highest = std::max(highest, step.fluid.pressure[i]);
    }
    // c^2 = dp/drho = c_0^2 (rho / rho_0)^(gamma - 1)
    const Scalar faster = std::pow(1 + highest / stiffness, (exponent - 1) / (2 * exponent));
    const Scalar sound = courant_number * step.spacing / (sound_speed(step.rest_density) * faster);
    if (!(artificial_viscosity > 0)) {
      return sound;
    }
    // as for Viscosity, with alpha h c / 10 for its nu
    const Scalar rate = Scalar(0.1) * artificial_viscosity * step.smoothing_length * sound_speed(step.rest_density) *
                        detail::pair_stiffness<typename Step::Kernel>(step.smoothing_length, step.spacing);
    return std::min(sound, Scalar(0.225) / rate);
  }

  template <class Step>
  void begin_step(const Step&, PressureReport&) noexcept {}

  template <class Step>
  void solve(const Step& step, PressureReport& report) noexcept {
    const Index count = step.fluid.size();
    const bool brake = artificial_viscosity > 0;
    term_.resize(static_cast<std::size_t>(count));
    velocity_.resize(brake ? 4 * static_cast<std::size_t>(count) : 0);
    const double compression = reduction_.over(
        count, step.threads, 0.0,
        [&](Index begin, Index end) {
          double sum = 0;
          for (Index i = begin; i < end; ++i) {
            const Scalar density = step.fluid.density[i];
            const Scalar p = pressure(density, step.rest_density);
            step.fluid.pressure[i] = p;
            term_[static_cast<std::size_t>(i)] = p / (density * density);
            sum += static_cast<double>(std::max(density - step.rest_density, Scalar(0)));
            for (Index axis = 0; brake && axis < 3; ++axis) {
              velocity_[static_cast<std::size_t>(4 * i + axis)] = step.fluid.velocity(axis, i);
            }
          }
          return sum;
        },
        [](double a, double b) { return a + b; });
    if (count > 0) {
      const double error = compression / (static_cast<double>(step.rest_density) * static_cast<double>(count));
      report.density_error = std::max(report.density_error, error);
    }
    ++report.density_iterations;
    if (brake) {
      sweep<true>(step);
    } else {
      sweep<false>(step);
    }
  }

 private:
  /// x^gamma; whole exponents, the usual case, without a call of pow.
  Scalar power(Scalar x) const noexcept {
    const int whole = static_cast<int>(exponent);
    if (static_cast<Scalar>(whole) != exponent || whole > 16) {
      return std::pow(x, exponent);
    }
    Scalar result = 1;
    for (int bits = whole; bits > 0; bits >>= 1, x *= x) {
      result *= (bits & 1) != 0 ? x : Scalar(1);
    }
    return result;
  }

  template <bool brake, class Step>
  void sweep(const Step& step) noexcept {
    using B = Batch<Scalar>;
    const Scalar h = step.smoothing_length;
    const Scalar softening = Scalar(0.01) * h * h;
    // densities differ by a per cent: rho_0 for rho_ij keeps the pair force mutual and saves a gather
    const Scalar braking = artificial_viscosity * h * sound_speed(step.rest_density) / step.rest_density;
    parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      const auto own = static_cast<std::size_t>(i);
      const B term_i(term_[own]);
      B x(Scalar(0)), y(Scalar(0)), z(Scalar(0));
      step.neighbors.for_each_batch(i, [&](const auto& pair) {
        const B slope = step.pairs.slope(pair.slot);
        B push = term_i + gather(term_.data(), pair.neighbor);
        if constexpr (brake) {
          const auto other = gather3(velocity_.data(), pair.neighbor);
          const B approach = (velocity_[4 * own] - other.x) * pair.x + (velocity_[4 * own + 1] - other.y) * pair.y +
                             (velocity_[4 * own + 2] - other.z) * pair.z;
          push -= braking * minimum(approach, B(Scalar(0))) / (pair.distance_squared + softening);
        }
        push *= slope * step.mass(pair.neighbor);
        x = multiply_add(push, pair.x, x);
        y = multiply_add(push, pair.y, y);
        z = multiply_add(push, pair.z, z);
      });
      const Scalar wall = step.rest_density * term_[own];
      step.fluid.velocity.col(i) -=
          step.time_step * (Vector3<Scalar>(sum(x), sum(y), sum(z)) + wall * step.walls.gradient.col(i));
    });
  }

  Memory memory_{};
  std::vector<Scalar> term_{};      ///< P
  std::vector<Scalar> velocity_{};  ///< records of four; empty without artificial viscosity
  Reduction<double> reduction_{};
};

}  // namespace decant::inline DECANT_TARGET
