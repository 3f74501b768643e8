// SPDX-License-Identifier: MIT
#pragma once

/// What a smoothing kernel has to provide.

#include <concepts>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// A radial kernel in three dimensions, W(r, h) with the smoothing length h. A plain value without state.
/// support_factor [-] > 0: W vanishes from the support radius, support_factor * h, on.
/// value(r, h) [1/m^3]: positive inside the support, integrates to one over space.
/// derivative(r, h) [1/m^4]: dW/dr, never positive.
/// derivative_over_radius(r, h) [1/m^5]: (dW/dr)/r, finite at r = 0; pair sums use it, since grad W = it * (x_i - x_j).
/// All take r >= 0 [m], h > 0 [m]; a number type may be a batch of numbers (core/batch.hpp), so they choose by min, max
/// and select, never by `if` on a value. No function may throw or allocate.
/// Laws: decant/testing/kernel.hpp.
template <class K>
concept SmoothingKernel = requires(typename K::Scalar r, typename K::Scalar h) {
  requires std::floating_point<typename K::Scalar>;
  { K::support_factor } -> std::convertible_to<double>;
  { K::value(r, h) } noexcept -> std::same_as<typename K::Scalar>;
  { K::derivative(r, h) } noexcept -> std::same_as<typename K::Scalar>;
  { K::derivative_over_radius(r, h) } noexcept -> std::same_as<typename K::Scalar>;
};

}  // namespace decant::inline DECANT_TARGET
