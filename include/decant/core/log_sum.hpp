// SPDX-License-Identifier: MIT
#pragma once

/// Sums of probabilities that are kept as logarithms.

#include <algorithm>
#include <cmath>
#include <limits>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// log(exp(a) + exp(b)), also where neither has an exponential that a double could hold; -infinity is log 0. Sums of
/// many begin with that.
inline double log_sum(double a, double b) noexcept {
  const double larger = std::max(a, b), smaller = std::min(a, b);
  return larger == -std::numeric_limits<double>::infinity() ? larger : larger + std::log1p(std::exp(smaller - larger));
}

}  // namespace decant::inline DECANT_TARGET
