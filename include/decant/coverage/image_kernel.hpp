// SPDX-License-Identifier: MIT
#pragma once

/// How much a pixel counts at a distance in the image.

#include <cmath>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// W(d) = exp(-(d / length_px)^2) for d <= cut_px, 0 beyond; d is the distance in the image [px] (Schenck & Fox 2017).
/// At the cut of the defaults W falls from 1.03e-4 to zero.
struct ImageKernel {
  double length_px = 33;  ///< [px], > 0
  double cut_px = 100;    ///< [px], > 0

  /// @param distance_squared d^2 [px^2]. 0 for NaN.
  double value(double distance_squared) const noexcept {
    return distance_squared <= cut_px * cut_px ? std::exp(-distance_squared / (length_px * length_px)) : 0;
  }
};

}  // namespace decant::inline DECANT_TARGET
