// SPDX-License-Identifier: MIT
#pragma once

/// Whether a mask without liquid means that there is none, or that the segmentation has failed.

#include <cstdint>

#include <decant/core/image.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/coverage/detail/liquid_box.hpp>

namespace decant::inline DECANT_TARGET {

/// Liquid comes into sight and leaves it by and by, a segmentation fails from one frame to the next. So a mask with
/// little liquid is believed where the last one that was believed showed little, too; at the start that is none.
class MaskTrust {
 public:
  /// @param least_pixels of liquid that are enough in any case, >= 1. "Little" is four times that.
  explicit MaskTrust(int least_pixels = 150) noexcept : least_pixels_(least_pixels) {}

  /// To be called once a frame.
  bool believes(const ConstMaskView& mask) noexcept {
    const Index pixels = detail::count_liquid(mask);
    const bool believed = pixels >= least_pixels_ || last_ <= 4 * static_cast<Index>(least_pixels_);
    if (believed) {
      last_ = pixels;
    }
    return believed;
  }

  void reset() noexcept { last_ = 0; }

 private:
  int least_pixels_;
  Index last_ = 0;
};

}  // namespace decant::inline DECANT_TARGET
