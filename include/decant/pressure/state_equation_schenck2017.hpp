// SPDX-License-Identifier: MIT
#pragma once

/// The pressure of Schenck and Fox 2017 as it is printed.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <decant/core/batch.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/pressure/concept.hpp>

namespace decant::inline DECANT_TARGET {

/// Schenck and Fox 2017, "Reasoning About Liquids via Closed-Loop Simulation" (RSS), section on the simulator: the
/// linear equation of state p = c^2 (rho - rho_0) and, with the acceleration f / rho, the force density
///   f_i = -sum_j (m_j / rho_j) (p_i / rho_i^2 + p_j / rho_j^2) grad W_ij.
/// This is short of a factor rho_i rho_j, without which the units do not make a force density; StateEquation has it.
/// For water the printed force is a million times too small, so the printed c is a gain rather than a speed: liquid at
/// rest density rho_0 answers as if sound travelled at c / rho_0 * (1 kg/m^3). The default acts like 20 m/s in water.
/// Pressures below zero are set to zero, as any free surface requires; walls mirror the pressure of the particle at
/// them. For comparison with the paper; take StateEquation for anything else.
template <class ScalarType>
class StateEquationSchenck2017 {
 public:
  using Scalar = ScalarType;
  static constexpr double search_margin = 0;

  Scalar sound_speed = Scalar(20000);   ///< the printed c, > 0; a gain, see above
  Scalar courant_number = Scalar(0.4);  ///< how many spacings sound may travel per sub-step, > 0

  /// Nothing is carried from step to step.
  struct Memory {
    void reorder(std::span<const std::uint32_t>) noexcept {}
    void clear() noexcept {}
  };

  Memory& memory() noexcept { return memory_; }

  template <class Step>
  Scalar largest_step(const Step& step) const noexcept {
    return courant_number * step.spacing * step.rest_density / sound_speed;
  }

  template <class Step>
  void begin_step(const Step&, PressureReport&) noexcept {}

  template <class Step>
  void solve(const Step& step, PressureReport& report) noexcept {
    using Kernel = typename Step::Kernel;
    using B = Batch<Scalar>;
    const Index count = step.fluid.size();
    records_.resize(4 * static_cast<std::size_t>(count));
    parallel_for(count, step.threads, [&](Index i) {
      const Scalar density = step.fluid.density[i];
      const Scalar excess = density > step.rest_density ? density - step.rest_density : Scalar(0);
      const Scalar p = sound_speed * sound_speed * excess;
      step.fluid.pressure[i] = p;
      Scalar* record = &records_[static_cast<std::size_t>(4 * i)];
      record[0] = p / (density * density);
      record[1] = step.fluid.mass[i] / density;
    });
    double compression = 0;
    for (Index i = 0; i < count; ++i) {
      const double excess = static_cast<double>(step.fluid.density[i]) / static_cast<double>(step.rest_density) - 1;
      compression += excess > 0 ? excess : 0;
    }
    const double error = count > 0 ? compression / static_cast<double>(count) : 0;
    report.density_error = report.density_error > error ? report.density_error : error;
    ++report.density_iterations;
    const Scalar h = step.smoothing_length;
    parallel_for(count, step.threads, [&](Index i) {
      const Scalar* own = &records_[static_cast<std::size_t>(4 * i)];
      const B own_term(own[0]);
      B x(Scalar(0)), y(Scalar(0)), z(Scalar(0));
      step.neighbors.for_each_batch(i, [&](const auto& pair) {
        const auto other = gather4(records_.data(), pair.neighbor);  // x: p / rho^2, y: volume
        const B push =
            other.y * (own_term + other.x) * Kernel::derivative_over_radius(square_root(pair.distance_squared), h);
        x = multiply_add(push, pair.x, x);
        y = multiply_add(push, pair.y, y);
        z = multiply_add(push, pair.z, z);
      });
      const Vector3<Scalar> force = -Vector3<Scalar>(sum(x), sum(y), sum(z)) - own[0] * step.walls.gradient.col(i);
      step.fluid.velocity.col(i) += step.time_step / step.fluid.density[i] * force;
    });
  }

 private:
  Memory memory_{};
  std::vector<Scalar> records_{};  ///< p / rho^2, volume, two unused
};

}  // namespace decant::inline DECANT_TARGET
