// SPDX-License-Identifier: MIT
#pragma once

/// Figures of step_limit, a hand-written AVX-512 step (PERFORMANCE.md): what the machine allows, measured in the same
/// minutes. The program is the one that CMake builds from DECANT_STEP_LIMIT_SOURCE, or the one that the environment
/// names in DECANT_STEP_LIMIT; without either there are no figures.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>

#include "report.hpp"

namespace decant_benchmark {

/// By name, such as "SEARCH sort+list v2" [s]. Liquid of per_edge^3 particles in general position, support 2 spacings.
/// Runs for some seconds. Its spread is that of the fastest and slowest of five batches.
inline std::map<std::string, Spread> step_limit_figures(int per_edge, int threads) {
  std::map<std::string, Spread> figures;
  const char* program = std::getenv("DECANT_STEP_LIMIT");
#ifdef DECANT_STEP_LIMIT
  program = program != nullptr ? program : DECANT_STEP_LIMIT;
#endif
  if (program == nullptr || *program == '\0') {
    return figures;
  }
  const int repetitions = std::clamp(160000 / (per_edge * per_edge * per_edge), 1, 20);
  const std::string command = "OMP_NUM_THREADS=" + std::to_string(threads) + " OMP_PROC_BIND=true '" + program + "' " +
                              std::to_string(per_edge) + " 2 " + std::to_string(repetitions) + " 1 2>&1";
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> output(popen(command.c_str(), "r"), &pclose);
  char line[512];
  while (output && std::fgets(line, sizeof line, output.get()) != nullptr) {
    // "  name, up to 28 characters      0.3047 ms  [0.2940..0.3762]  26.25 M part/s"
    Spread ms;
    char name[64] = "";
    if (std::sscanf(line, " %28[^\n] %lf ms [%lf..%lf]", name, &ms.median, &ms.low, &ms.high) == 4) {
      const std::string padded(name);
      figures[padded.substr(0, padded.find_last_not_of(' ') + 1)] = 1e-3 * ms;
    }
  }
  if (figures.empty()) {
    throw std::runtime_error(std::string("no figures from ") + program);
  }
  return figures;
}

}  // namespace decant_benchmark
