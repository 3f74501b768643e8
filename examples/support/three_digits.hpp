// SPDX-License-Identifier: MIT
#pragma once

/// Numbers for people.

#include <cstdio>
#include <string>

namespace example {

/// Three digits that count, with a power of ten where there would be many more.
inline std::string three_digits(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.3g", value);
  return buffer;
}

}  // namespace example
