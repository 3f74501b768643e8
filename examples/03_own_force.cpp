// SPDX-License-Identifier: MIT
// A force of one's own: wind that carries a falling drop away.

#include <cmath>
#include <cstdio>
#include <tuple>

#include <decant/decant.hpp>

/// Drag toward the speed of the air: a = rate (wind - v).
struct Wind {
  using Scalar = float;
  decant::Vector3<Scalar> velocity{0, 0, 0};  ///< of the air [m/s]
  Scalar rate = 1;                            ///< [1/s], > 0

  template <class Step>
  void accumulate(const Step& step, decant::PointArray<Scalar>& acceleration) noexcept {
    decant::parallel_for(step.fluid.size(), step.threads, [&](decant::Index i) {
      acceleration.col(i) += rate * (velocity - step.fluid.velocity.col(i));
    });
  }
  template <class Step>
  Scalar largest_step(const Step&) const noexcept {
    return Scalar(0.1) / rate;  // stable up to 2 / rate, accurate well below
  }
};

struct MyParts : decant::DefaultParts<float> {
  using Forces = std::tuple<decant::Gravity<float>, decant::Viscosity<float>, Wind>;
};

int main() {
  using namespace decant;
  SimulatorSettings settings;
  settings.spacing = 0.005;      // [m]
  settings.largest_step = 1e-3;  // [s]
  Simulator<MyParts> simulator(settings);
  simulator.force<Wind>().velocity = {3, 0, 0};
  simulator.force<Wind>().rate = 2;
  PointArray<float> drop(3, 64);
  for (int i = 0; i < 64; ++i) {
    drop.col(i) = 0.005f * Vector3<float>(Vector3<int>(i % 4, i / 4 % 4, i / 16).cast<float>().array() - 1.5f);
  }
  simulator.add_particles(drop, PointArray<float>::Zero(3, 64), 0);
  for (int frame = 0; frame < 15; ++frame) {
    if (!simulator.step(1.0 / 30).advanced()) return 1;
  }
  const double t = simulator.time(), drift = simulator.fluid().position.row(0).mean();
  const double theory = 3 * (t - (1 - std::exp(-2 * t)) / 2);  // x'' = 2 (3 - x')
  std::printf("after %.1f s the drop has drifted by %.1f mm, in theory by %.1f mm\n", t, 1e3 * drift, 1e3 * theory);
  return std::abs(drift - theory) < 0.01 * theory ? 0 : 1;
}
