// SPDX-License-Identifier: MIT

#include <decant/simulation/parts.hpp>

#include "scene_run_impl.hpp"

namespace example {

RunResult run_default(const decant::Scene& scene, const RunOptions& options) {
  return run_scene<decant::DefaultParts<>>(scene, options);
}

}  // namespace example
