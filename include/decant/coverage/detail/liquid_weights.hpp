// SPDX-License-Identifier: MIT
#pragma once

/// What the pixels of a mask count, and the plain sum over them.

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>

#include <Eigen/Core>

#include <decant/core/image.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/coverage/image_kernel.hpp>

namespace decant::inline DECANT_TARGET::detail {

/// 1 / (coverage + 1) where the mask is liquid, 0 elsewhere. Coverage that is negative or NaN counts as none.
inline float liquid_weight(std::uint8_t mask, float coverage) noexcept {
  // without a branch, so that rows are worked on many pixels at a time
  return static_cast<float>(mask >> 7) / (1 + (coverage > 0 ? coverage : 0.0f));
}
static_assert(is_liquid(128) && !is_liquid(127));

/// A row of weights at a time, for KernelGrid::rebuild.
struct LiquidWeights {
  const ConstMaskView& mask;
  const ConstImageView<float>& coverage;
  Index width, height;

  bool operator()(Index v, float* weights) const noexcept {
    assert(mask.rows() == height && mask.cols() == width && coverage.rows() == height && coverage.cols() == width);
    if (mask.rows() != height || mask.cols() != width || coverage.rows() != height || coverage.cols() != width) {
      return false;
    }
    const std::uint8_t* const liquid = mask.data() + v * mask.outerStride();
    const float* const covered = coverage.data() + v * coverage.outerStride();
    std::uint8_t any = 0;
    for (Index u = 0; u < width; ++u) {
      any = static_cast<std::uint8_t>(any | liquid[u]);
    }
    if (!is_liquid(any)) {
      return false;
    }
    for (Index u = 0; u < width; ++u) {
      weights[u] = liquid_weight(liquid[u], covered[u]);
    }
    return true;
  }
};

/// Calls f(q - pixel, W / (coverage + 1)) for each liquid pixel q within the kernel's cut.
template <class Function>
void for_each_liquid(const ConstMaskView& mask, const ConstImageView<float>& coverage, const Eigen::Vector2d& pixel,
                     const ImageKernel& kernel, Function&& f) noexcept {
  assert(mask.rows() == coverage.rows() && mask.cols() == coverage.cols());
  const auto first = [&](double from, Index size) {
    return from > 0 ? (from < static_cast<double>(size) ? static_cast<Index>(from) : size) : Index{0};
  };
  if (!pixel.allFinite()) {
    return;
  }
  const Index u_begin = first(std::ceil(pixel.x() - kernel.cut_px), mask.cols());
  const Index u_end = first(std::floor(pixel.x() + kernel.cut_px) + 1, mask.cols());
  const Index v_begin = first(std::ceil(pixel.y() - kernel.cut_px), mask.rows());
  const Index v_end = first(std::floor(pixel.y() + kernel.cut_px) + 1, mask.rows());
  for (Index v = v_begin; v < v_end; ++v) {
    for (Index u = u_begin; u < u_end; ++u) {
      if (is_liquid(mask.data()[v * mask.outerStride() + u])) {
        const Eigen::Vector2d away(static_cast<double>(u) - pixel.x(), static_cast<double>(v) - pixel.y());
        f(away, kernel.value(away.squaredNorm()) *
                    static_cast<double>(liquid_weight(mask_liquid, coverage.data()[v * coverage.outerStride() + u])));
      }
    }
  }
}

}  // namespace decant::inline DECANT_TARGET::detail
