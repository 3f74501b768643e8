// SPDX-License-Identifier: MIT
#pragma once

/// Simulations of a cup with liquid in it, as many as are wanted, which share all that simulations may share.

#include <stdexcept>

#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator.hpp>

namespace decant_benchmark {

/// As for liquid that a camera corrects. @param spacing of particles [m].
inline decant::SimulatorSettings tracking_settings(double spacing, int threads) {
  decant::SimulatorSettings settings;
  settings.spacing = spacing;
  settings.threads = {threads};
  return decant::for_tracking(settings);
}

/// One more simulation in the state that a snapshot of the first one has, with scratch memory of its own. Throws
/// std::runtime_error unless it shares the first one's body.
inline decant::LiquidSimulator another(const decant::LiquidSimulator& first,
                                       const decant::LiquidSimulator::Snapshot& state, int threads) {
  decant::LiquidSimulator model(tracking_settings(first.spacing(), threads));
  model.restore(state);
  const auto &mine = model.bodies()[0], &its = first.bodies()[0];
  if (mine.shape != its.shape || mine.surface != its.surface || mine.wall != its.wall) {
    throw std::runtime_error("simulations do not share their bodies");
  }
  return model;
}

}  // namespace decant_benchmark
