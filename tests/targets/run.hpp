// SPDX-License-Identifier: MIT
#pragma once

#include <string>

/// What a column of water came to, told in types that do not depend on how a translation unit was compiled.
struct TargetRun {
  std::string simulator;   ///< mangled name of the simulator's type
  int lanes = 0;           ///< of a batch of floats
  bool half = false;       ///< whether gradients are kept in half precision
  double height = 0;       ///< of the centre of mass [m]
  double speed = 0;        ///< root mean square [m/s]
  double pressure = 0;     ///< mean over particles [Pa]
  double compression = 0;  ///< mean over particles, over rest density [-]
};

TargetRun run_without_flags();
TargetRun run_with_avx2();
TargetRun run_as_built();
