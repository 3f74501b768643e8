// SPDX-License-Identifier: MIT
// A smoothing kernel of one's own: the first that was used for SPH, by Lucy 1977, under a block of water that
// collapses.

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <decant/decant.hpp>
#include <decant/testing/kernel.hpp>

/// With q = r / (2 h): W = 105 / (128 pi h^3) (1 + 3 q) (1 - q)^3 (Lucy 1977, Astronomical Journal 82, eq. 10).
struct Lucy1977 {
  using Scalar = float;
  static constexpr Scalar support_factor = 2;
  static constexpr Scalar scale = 105 / (128 * 3.14159265f);

  template <class Number>
  static Number value(Number r, Scalar h) noexcept {
    const Number q = r * (1 / (2 * h)), left = decant::maximum(1 - q, Number(0));
    return scale / (h * h * h) * (1 + 3 * q) * left * left * left;
  }
  template <class Number>
  static Number derivative(Number r, Scalar h) noexcept {
    return derivative_over_radius(r, h) * r;
  }
  template <class Number>
  static Number derivative_over_radius(Number r, Scalar h) noexcept {
    const Number left = decant::maximum(1 - r * (1 / (2 * h)), Number(0));
    return -3 * scale / (h * h * h * h * h) * left * left;
  }
};
static_assert(decant::SmoothingKernel<Lucy1977>);

struct MyParts : decant::DefaultParts<float> {
  using Kernel = Lucy1977;
};

int main() {
  using namespace decant;
  for (const testing::Law& law : testing::kernel_laws<Lucy1977>(0.01f)) {
    if (!law.holds()) {
      std::printf("%s\n", law.text().c_str());
      return 1;
    }
  }
  SimulatorSettings settings;
  settings.spacing = 0.01;  // [m]
  Simulator<MyParts> simulator(settings);
  simulator.add_body("tank", BoxInside{{0, 0, 0}, {0.2, 0.1, 0.3}, 0.005, {}});
  PointArray<float> block(3, 1000);  // 0.1 m to an edge: fills half of the tank's floor
  for (int i = 0; i < 1000; ++i) {
    block.col(i) = 0.01f * Vector3<float>(Vector3<int>(i % 10, i / 10 % 10, i / 100).cast<float>().array() + 0.5f);
  }
  simulator.add_particles(block, PointArray<float>::Zero(3, 1000), 0);
  double error = 0;
  for (int frame = 0; frame < 90; ++frame) {
    const StepReport report = simulator.step(1.0 / 30);
    if (!report.advanced())
      return 1;
    error = std::max(error, report.density_error);
  }
  const double height = 2 * simulator.fluid().position.row(2).mean();  // of level water
  std::printf("%.1f mm deep, compressed by at most %.2f %%\n", 1e3 * height, 100 * error);
  return std::abs(height - 0.05) < 0.25 * settings.spacing && error < 0.01 ? 0 : 1;
}
