// SPDX-License-Identifier: MIT
#pragma once

/// What a segmentation makes of a silhouette when it decides too easily for liquid, or too hard.

#include <cmath>
#include <cstdint>

#include <decant/core/image.hpp>
#include <decant/core/types.hpp>

namespace example {

/// A silhouette that is fatter by so many pixels, or thinner by less than none.
inline decant::Mask fattened(const decant::Mask& mask, double pixels) {
  if (pixels == 0) {
    return mask;
  }
  const bool grows = pixels > 0;
  const int reach = static_cast<int>(std::floor(std::abs(pixels)));
  decant::Mask result = mask;
  for (decant::Index row = 0; row < mask.rows(); ++row) {
    for (decant::Index column = 0; column < mask.cols(); ++column) {
      if (decant::is_liquid(mask(row, column)) != grows) {
        continue;
      }
      for (int down = -reach; down <= reach; ++down) {
        for (int right = -reach; right <= reach; ++right) {
          const decant::Index other = row + down, beside = column + right;
          if (down * down + right * right <= pixels * pixels && other >= 0 && other < mask.rows() && beside >= 0 &&
              beside < mask.cols()) {
            result(other, beside) = grows ? decant::mask_liquid : std::uint8_t(0);
          }
        }
      }
    }
  }
  return result;
}

}  // namespace example
