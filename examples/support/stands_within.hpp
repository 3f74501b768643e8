// SPDX-License-Identifier: MIT
#pragma once

/// What level probes ask of a simulation: whether liquid stands on something.

#include <cstddef>

#include <decant/core/pose.hpp>
#include <decant/core/types.hpp>
#include <decant/simulation/simulator.hpp>

namespace example {

/// Whether there is something solid within a length below a point.
template <class Model>
bool stands_within(const Model& model, const decant::Vector3<double>& x, double length) {
  const decant::Vector3<double> below = x - decant::Vector3<double>(0, 0, length);
  for (std::size_t k = 0; k < model.bodies().size(); ++k) {
    const auto& body = model.bodies()[static_cast<decant::BodyId>(k)];
    const decant::Pose body_from_world = body.motion.at(model.time()).inverse();
    if (body.surface->any_hit(body_from_world * x, body_from_world * below)) {
      return true;
    }
  }
  return false;
}

}  // namespace example
