// SPDX-License-Identifier: MIT
#pragma once

/// Where two masks differ, roughly: so that what is far from any difference need not be looked at pixel by pixel.

#include <algorithm>
#include <cassert>
#include <cstdint>
#include <cstring>

#include <decant/core/image.hpp>
#include <decant/core/pixel_box.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET::detail {

/// Marks squares of eight pixels in which a pixel is liquid in one mask and not in the other.
class MaskDisagreement {
 public:
  /// Of two masks of one size. Allocates only if that is not the size of the masks before.
  void rebuild(const ConstMaskView& a, const ConstMaskView& b) noexcept {
    assert(a.rows() == b.rows() && a.cols() == b.cols());
    differs_.setZero((a.rows() + side - 1) / side, (a.cols() + side - 1) / side);
    for (Index v = 0; v < a.rows(); ++v) {
      const std::uint8_t* const row_a = a.data() + v * a.outerStride();
      const std::uint8_t* const row_b = b.data() + v * b.outerStride();
      std::uint8_t* const marks = &differs_(v / side, 0);
      for (Index u = 0; u < a.cols(); u += side) {
        std::uint64_t eight_a = 0, eight_b = 0;
        const auto count = static_cast<std::size_t>(std::min<Index>(side, a.cols() - u));
        if (count == side) {
          std::memcpy(&eight_a, row_a + u, side);
          std::memcpy(&eight_b, row_b + u, side);
        } else {
          std::memcpy(&eight_a, row_a + u, count);
          std::memcpy(&eight_b, row_b + u, count);
        }
        if (((eight_a ^ eight_b) & topmost_bits) != 0) {
          marks[u / side] = 1;
        }
      }
    }
  }

  /// False only if the masks agree on all pixels of a box that lies on them.
  bool any_in(const PixelBox& box) const noexcept {
    if (box.empty()) {
      return false;
    }
    for (Index row = box.v_begin / side; row <= (box.v_end - 1) / side; ++row) {
      for (Index column = box.u_begin / side; column <= (box.u_end - 1) / side; ++column) {
        if (differs_(row, column) != 0) {
          return true;
        }
      }
    }
    return false;
  }

 private:
  static_assert(!is_liquid(0x7f) && is_liquid(0x80));
  static constexpr Index side = 8;
  static constexpr std::uint64_t topmost_bits = 0x8080808080808080U;

  Image<std::uint8_t> differs_{};
};

}  // namespace decant::inline DECANT_TARGET::detail
