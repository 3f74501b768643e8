// SPDX-License-Identifier: MIT
// A pressure solver of one's own: the simplest there is, p = c^2 (rho - rho_0), under water in a box.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <span>

#include <decant/decant.hpp>

struct LinearPressure {
  using Scalar = float;
  static constexpr double search_margin = 0;
  Scalar sound_speed = 10;  ///< c [m/s], about ten times what the liquid does
  struct Memory {           // nothing is remembered from step to step
    void reorder(std::span<const std::uint32_t>) noexcept {}
    void clear() noexcept {}
  };
  Memory& memory() noexcept { return memory_; }
  template <class Step>
  Scalar largest_step(const Step& step) const noexcept {
    return Scalar(0.4) * step.spacing / sound_speed;
  }
  template <class Step>
  void begin_step(const Step&, decant::PressureReport&) noexcept {}
  template <class Step>
  void solve(const Step& step, decant::PressureReport& report) noexcept {
    auto& fluid = step.fluid;
    double excess = 0;
    for (decant::Index i = 0; i < fluid.size(); ++i) {
      const Scalar compression = std::max(fluid.density[i] - step.rest_density, Scalar(0));
      fluid.pressure[i] = sound_speed * sound_speed * compression;
      excess += static_cast<double>(compression / step.rest_density);
    }
    report.density_error = excess / static_cast<double>(std::max<decant::Index>(1, fluid.size()));
    decant::parallel_for(fluid.size(), step.threads, [&](decant::Index i) {
      const Scalar own = fluid.pressure[i] / (fluid.density[i] * fluid.density[i]);
      decant::Vector3<Scalar> pull = step.rest_density * own * step.walls.gradient.col(i);
      step.neighbors.for_each(i, [&](decant::Index j, const decant::Vector3<Scalar>& apart, Scalar r_squared) {
        const Scalar other = fluid.pressure[j] / (fluid.density[j] * fluid.density[j]);
        const Scalar slope = Step::Kernel::derivative_over_radius(std::sqrt(r_squared), step.smoothing_length);
        pull += fluid.mass[j] * (own + other) * slope * apart;
      });
      fluid.velocity.col(i) -= step.time_step * pull;
    });
  }

 private:
  Memory memory_;
};

struct MyParts : decant::DefaultParts<float> {
  using PressureSolver = LinearPressure;
};

int main() {
  using namespace decant;
  SimulatorSettings settings;
  settings.spacing = 0.01;  // [m]
  Simulator<MyParts> simulator(settings);
  const BodyId glass = simulator.add_body("glass", CylinderInside{0.06, 0.12, 0.003, Face::PositiveZ});
  const FillReport filled = fill(simulator, glass, FillAmount::level(0.08));
  Vector3<double> force = Vector3<double>::Zero();
  for (int frame = 0; frame < 60; ++frame) {
    if (!simulator.step(1.0 / 60).advanced()) return 1;
    force += simulator.pressure_force_on(glass) / 60;  // [N]
  }
  const double weight = filled.volume * settings.liquid.density * settings.gravity.norm();
  std::printf("the glass carries %.2f N, its liquid weighs %.2f N\n", -force.z(), weight);
  return std::abs(-force.z() - weight) < 0.03 * weight ? 0 : 1;
}
