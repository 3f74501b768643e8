// SPDX-License-Identifier: MIT
#pragma once

/// A rectangle of pixels, so that work on an image can stay where something was drawn.

#include <algorithm>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// Columns [u_begin, u_end) and rows [v_begin, v_end) [px]; empty by default.
struct PixelBox {
  int u_begin = 0;
  int v_begin = 0;
  int u_end = 0;
  int v_end = 0;

  /// All pixels of an image, which may be any Eigen array or view.
  template <class AnyImage>
  static PixelBox of(const AnyImage& image) noexcept {
    return {0, 0, static_cast<int>(image.cols()), static_cast<int>(image.rows())};
  }

  bool empty() const noexcept { return u_begin >= u_end || v_begin >= v_end; }
  int width() const noexcept { return empty() ? 0 : u_end - u_begin; }
  int height() const noexcept { return empty() ? 0 : v_end - v_begin; }
  bool contains(int u, int v) const noexcept { return u >= u_begin && u < u_end && v >= v_begin && v < v_end; }

  /// What both have.
  PixelBox intersection(const PixelBox& other) const noexcept {
    return {std::max(u_begin, other.u_begin), std::max(v_begin, other.v_begin), std::min(u_end, other.u_end),
            std::min(v_end, other.v_end)};
  }

  /// The smallest rectangle that holds both.
  PixelBox hull(const PixelBox& other) const noexcept {
    if (empty() || other.empty()) {
      return empty() ? other : *this;
    }
    return {std::min(u_begin, other.u_begin), std::min(v_begin, other.v_begin), std::max(u_end, other.u_end),
            std::max(v_end, other.v_end)};
  }

  bool operator==(const PixelBox&) const = default;
};

}  // namespace decant::inline DECANT_TARGET
