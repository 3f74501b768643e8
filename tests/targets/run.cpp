// SPDX-License-Identifier: MIT
// Compiled several times, with different flags, as the function DECANT_TEST_RUN.

#include "targets/run.hpp"

#include <algorithm>
#include <cmath>
#include <typeinfo>

#include <decant/boundary/shapes.hpp>
#include <decant/core/compact.hpp>
#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator.hpp>

#include "physics/scene.hpp"

TargetRun DECANT_TEST_RUN() {
  const double spacing = 0.01;
  const int width = 6, layers = 12;
  decant::SimulatorSettings settings;
  settings.spacing = spacing;
  settings.threads = {1};
  decant::LiquidSimulator simulator(settings);
  const double side = width * spacing;
  simulator.add_body("column", decant::BoxInside{{0, 0, 0}, {side, side, 0.2}, 2 * spacing, {}});
  const auto places = decant_test::block<float>({0, 0, 0}, width, width, layers, spacing, 0.05);
  simulator.add_particles(places, decant::PointArray<float>::Zero(3, places.cols()), 0);
  for (int frame = 0; frame < 50; ++frame) {
    static_cast<void>(simulator.step(0.01));  // a state that is not finite shows in the means
  }

  TargetRun run;
  run.simulator = typeid(simulator).name();
  run.lanes = decant::Batch<float>::width;
  run.half = decant::has_half_precision;
  const auto& fluid = simulator.fluid();
  for (decant::Index i = 0; i < fluid.size(); ++i) {
    const double share = 1 / static_cast<double>(fluid.size());
    run.height += share * static_cast<double>(fluid.position(2, i));
    run.speed += share * static_cast<double>(fluid.velocity.col(i).squaredNorm());
    run.pressure += share * static_cast<double>(fluid.pressure[i]);
    run.compression += share * std::max(0.0, static_cast<double>(fluid.density[i]) / settings.liquid.density - 1);
  }
  run.speed = std::sqrt(run.speed);
  return run;
}
