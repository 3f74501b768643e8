// SPDX-License-Identifier: MIT
#pragma once

/// The warp field's sum: where observed liquid that particles do not explain pulls in the image.

#include <array>

#include <Eigen/Core>

#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/coverage/detail/kernel_grid.hpp>
#include <decant/coverage/detail/liquid_weights.hpp>
#include <decant/coverage/image_kernel.hpp>

namespace decant::inline DECANT_TARGET {

/// sum over the mask's liquid pixels q of u W(|u|) / (Phi(q) + 1) with u = q - p [px], summed as it stands: the
/// reference. The warp field of Schenck & Fox 2017 is lambda times this. u is the vector as the formula prints it, not
/// a unit vector: the pull of a pixel grows with its distance up to 23 px (length / sqrt 2) and fades beyond. @return
/// [px], right and down. @param pixel anywhere in the image or beyond. @param mask,coverage of one size. Zero if no
/// liquid pixel is within the cut, or for NaN.
inline Eigen::Vector2d warp_sum(const ConstMaskView& mask, const ConstImageView<float>& coverage,
                                const Eigen::Vector2d& pixel, const ImageKernel& kernel = {}) noexcept {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  detail::for_each_liquid(mask, coverage, pixel, kernel,
                          [&](const Eigen::Vector2d& u, double weight) { sum += weight * u; });
  return sum;
}

/// The same for every place at once: rebuild once a frame, then look up. Works as ActivationField does, with the two
/// components of u W in the place of W. Not taken from the gradient of Psi, to which it is proportional but for the
/// cut: at the cut u W still is 0.01, 7e-4 of its maximum, and a derivative of what was looked up would be less exact.
/// Error, relative to the reference's longest vector over the image, for the default kernel: at most 5e-4 on masks of
/// liquid, single pixels and noise. Thin rings around p with the cut as radius are the worst that we could think
/// of: 1.8e-3, where the reference jumps by twice that; leaving out the cut would err by as much as it jumps.
class WarpSumField {
 public:
  /// For masks of this size [px]. kernel.length_px is at least 4 px, kernel.cut_px at least 2.6 lengths.
  /// Throws std::invalid_argument.
  WarpSumField(int width, int height, const ImageKernel& kernel = {}) : grid_("WarpSumField", width, height, kernel) {}

  int width() const noexcept { return grid_.width(); }
  int height() const noexcept { return grid_.height(); }
  const ImageKernel& kernel() const noexcept { return grid_.kernel(); }

  /// @param mask,coverage of the size given at construction. Does not allocate; the same bits for any number of
  /// threads.
  void rebuild(const ConstMaskView& mask, const ConstImageView<float>& coverage, Threads threads = {}) noexcept {
    grid_.rebuild(threads, detail::LiquidWeights{mask, coverage, grid_.width(), grid_.height()});
  }

  /// The sum at a place in the image or beyond [px]; zero before the first rebuild and for NaN. Callable from many
  /// threads.
  Eigen::Vector2d value(const Eigen::Vector2d& pixel) const noexcept {
    const std::array<double, 2> sum = grid_.at(pixel);
    return {sum[0], sum[1]};
  }

 private:
  detail::KernelGrid<true> grid_;
};

}  // namespace decant::inline DECANT_TARGET
