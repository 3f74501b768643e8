// SPDX-License-Identifier: MIT
#pragma once

/// The simulators that a scene file can name.

#include <decant/io/scene.hpp>
#include <decant/simulation/parts.hpp>

#include "scene_run.hpp"

namespace example {

/// run_scene with the composition that the scene asks for. The default one takes implicit viscosity for liquids so
/// thick that explicit viscosity would need tiny steps.
inline RunResult run_composition(const decant::Scene& scene, const RunOptions& options) {
  using decant::scene::Composition;
  switch (scene.composition) {
    case Composition::Default:
      break;
    case Composition::StateEquation:
      return run_scene<decant::StateEquationParts<>>(scene, options);
    case Composition::PositionBased:
      return run_scene<decant::PositionBasedParts<>>(scene, options);
    case Composition::Paper:
      return run_scene<decant::Schenck2017Parts<>>(scene, options);
  }
  const bool thick = scene.liquid.viscosity / scene.liquid.density > 1e-2;  // [m^2/s]
  return thick ? run_scene<decant::ThickLiquidParts<>>(scene, options)
               : run_scene<decant::DefaultParts<>>(scene, options);
}

}  // namespace example
