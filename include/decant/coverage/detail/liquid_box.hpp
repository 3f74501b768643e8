// SPDX-License-Identifier: MIT
#pragma once

/// Where a mask's liquid is and how much there is, many pixels at a time.

#include <cstdint>

#include <decant/core/image.hpp>
#include <decant/core/pixel_box.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET::detail {

/// Pixels of a mask that are liquid, within a box that lies on the mask.
inline Index count_liquid(const ConstMaskView& mask, const PixelBox& box) noexcept {
  static_assert(!is_liquid(0x7f) && is_liquid(0x80));  // the topmost bit
  Index total = 0;
  for (int v = box.v_begin; v < box.v_end; ++v) {
    const std::uint8_t* const row = mask.data() + v * mask.outerStride();
    std::uint32_t in_row = 0;
    for (int u = box.u_begin; u < box.u_end; ++u) {
      in_row += static_cast<std::uint8_t>(row[u] >> 7U);
    }
    total += in_row;
  }
  return total;
}

inline Index count_liquid(const ConstMaskView& mask) noexcept { return count_liquid(mask, PixelBox::of(mask)); }

/// The smallest rectangle that holds all liquid of a mask; empty if it has none.
inline PixelBox liquid_box(const ConstMaskView& mask) noexcept {
  PixelBox box;
  const int columns = static_cast<int>(mask.cols());
  for (int v = 0; v < static_cast<int>(mask.rows()); ++v) {
    const std::uint8_t* const row = mask.data() + v * mask.outerStride();
    std::uint8_t any = 0;
    for (int u = 0; u < columns; ++u) {
      any = static_cast<std::uint8_t>(any | row[u]);
    }
    if (!is_liquid(any)) {
      continue;
    }
    int first = 0, end = columns;
    while (!is_liquid(row[first])) {
      ++first;
    }
    while (!is_liquid(row[end - 1])) {
      --end;
    }
    box = box.hull({first, v, end, v + 1});
  }
  return box;
}

}  // namespace decant::inline DECANT_TARGET::detail
