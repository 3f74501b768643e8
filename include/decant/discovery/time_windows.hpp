// SPDX-License-Identifier: MIT
#pragma once

/// Windows of time over which what was seen is averaged.

#include <cmath>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// Number of the window that an instant is in. @param passed since the first one began [s], >= 0. @param window its
/// length [s], > 0. What is due at a window's very end belongs to the next one, whatever rounding says.
inline int window_number(double passed, double window) noexcept {
  return static_cast<int>(std::floor(passed / window + 1e-6));
}

}  // namespace decant::inline DECANT_TARGET
