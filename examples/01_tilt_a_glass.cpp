// SPDX-License-Identifier: MIT
// The ready-made simulator: fills a glass to the brim, tilts it slowly, and asks what is still in it.

#include <cmath>
#include <cstdio>

#include <decant/decant.hpp>

int main() {
  using namespace decant;
  SimulatorSettings settings;
  settings.spacing = 0.006;  // [m]
  LiquidSimulator simulator(settings);
  const BodyId glass = simulator.add_body("glass", CylinderInside{0.03, 0.1, 0.002, Face::PositiveZ});
  const FillReport filled = fill(simulator, glass, FillAmount::fraction(0.95));

  const Eigen::Quaterniond tilted(Eigen::AngleAxisd(0.8, Vector3<double>::UnitX()));  // 46 degrees
  simulator.set_motion(glass, PoseTrack({{0.0, {}}, {2.0, {tilted, {0, 0, 0.1}}}}));
  while (simulator.time() < 3) {
    if (!simulator.step(1.0 / 30).advanced()) return 1;
  }
  const double left = Contents(simulator, glass).volume(simulator);
  std::printf("%.0f ml of %.0f ml are left in the glass\n", 1e6 * left, 1e6 * filled.volume);

  // A level surface through the lowest point of the rim leaves pi R^2 (H - R tan theta); particles ten to the glass's
  // width hold back a layer of a spacing or so above the lip.
  const double area = 3.14159265 * 0.03 * 0.03;
  const double theory = area * (0.1 - 0.03 * std::tan(0.8));
  return std::abs(left - theory) < 1.5 * area * settings.spacing ? 0 : 1;
}
