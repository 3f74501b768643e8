// SPDX-License-Identifier: MIT
#pragma once

/// Figures of step_limit, a hand-written AVX-512 step (PERFORMANCE.md): what the machine allows, measured in the same
/// minutes. The program is the one that CMake builds from DECANT_STEP_LIMIT_SOURCE, or the one that the environment
/// names in DECANT_STEP_LIMIT; without either there are no figures.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

namespace decant_benchmark {

/// The program's path; empty without one.
inline std::string step_limit_program() {
  const char* program = std::getenv("DECANT_STEP_LIMIT");
#ifdef DECANT_STEP_LIMIT
  program = program != nullptr ? program : DECANT_STEP_LIMIT;
#endif
  return program != nullptr ? program : "";
}

/// Runs the program, for up to some seconds, and returns one of its figures [s]: what stands before it in its output,
/// such as "SEARCH sort+list v2". Liquid of per_edge^3 particles in general position, support 2 spacings. Throws
/// std::runtime_error if there is no such figure.
inline double step_limit_figure(const std::string& name, int per_edge, int threads) {
  const int repetitions = std::clamp(40000 / (per_edge * per_edge * per_edge), 1, 20);
  const std::string command = "OMP_NUM_THREADS=" + std::to_string(threads) + " OMP_PROC_BIND=true '" +
                              step_limit_program() + "' " + std::to_string(per_edge) + " 2 " +
                              std::to_string(repetitions) + " 1 2>&1";
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> output(popen(command.c_str(), "r"), &pclose);
  std::optional<double> seconds;
  char line[512];
  while (output && std::fgets(line, sizeof line, output.get()) != nullptr) {
    // "  name   0.3047 ms  [0.2940..0.3762]  26.25 M part/s"
    const std::string_view text(line);
    if (text.starts_with("  " + name + " ")) {
      seconds = 1e-3 * std::strtod(line + 2 + name.size(), nullptr);
    }
  }
  if (!seconds || !(*seconds > 0)) {
    throw std::runtime_error("no figure '" + name + "' from " + step_limit_program());
  }
  return *seconds;
}

}  // namespace decant_benchmark
