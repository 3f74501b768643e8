// SPDX-License-Identifier: MIT

#include "scene_run.hpp"

#include <stdexcept>

#include <sys/resource.h>

namespace example {

RunResult run_composition(const decant::Scene& scene, const RunOptions& options) {
  using decant::scene::Composition;
  switch (scene.composition) {
    case Composition::Default: return run_default(scene, options);
    case Composition::StateEquation:
    case Composition::PositionBased:
    case Composition::Paper: break;
  }
  throw std::runtime_error("composition must be one that this build has: \"default\"");
}

double peak_memory_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
#if defined(__APPLE__)
  return static_cast<double>(usage.ru_maxrss) / 1e6;  // bytes there, kilobytes elsewhere
#else
  return static_cast<double>(usage.ru_maxrss) / 1e3;
#endif
}

}  // namespace example
