// SPDX-License-Identifier: MIT
#pragma once

/// Psi: how much observed liquid near a place in the image is not yet explained by particles.

#include <Eigen/Core>

#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/coverage/detail/kernel_grid.hpp>
#include <decant/coverage/detail/liquid_weights.hpp>
#include <decant/coverage/image_kernel.hpp>

namespace decant::inline DECANT_TARGET {

/// Psi(p) = sum over the mask's liquid pixels q of W(|p - q|) / (Phi(q) + 1), with the coverage Phi (Schenck & Fox
/// 2017), summed as it stands: the reference, 31,000 terms. @param pixel anywhere in the image or beyond, between
/// pixels too.
/// @param mask,coverage of one size. 0 if no liquid pixel is within the cut, or for NaN.
inline double activation(const ConstMaskView& mask, const ConstImageView<float>& coverage, const Eigen::Vector2d& pixel,
                         const ImageKernel& kernel = {}) noexcept {
  double sum = 0;
  detail::for_each_liquid(mask, coverage, pixel, kernel, [&](const Eigen::Vector2d&, double weight) { sum += weight; });
  return sum;
}

/// Psi for every place at once: rebuild once a frame, then look up.
///
/// Psi is the convolution of one image, w = mask / (Phi + 1), with a fixed, smooth kernel, so it is known well from a
/// coarse grid. Weights are put on nodes s pixels apart (s = length_px / 8: 4 px for the defaults) by cubic B-splines,
/// summed there, and looked up between nodes by the same splines. Both splines widen the kernel; as they are nearly
/// Gaussian and the kernel is Gaussian, a narrower one in between (variance less by 2 s^2 / 3) makes up for it to 3e-5.
/// Splines have no negative weights: Psi is never negative, and has two continuous derivatives. The cut is an exact
/// circle on the grid, which takes no more work than the square of a separable sum: row by row the sum over 2 w + 1
/// nodes grows with w, and each row takes it over at its own w.
/// Error, relative to the reference's maximum over the image, for the default kernel: at most 1e-4 on masks of liquid,
/// single pixels and noise, and 6e-4 on thin rings around p with the cut as radius, the worst that we could think of,
/// since the reference jumps there. A separable Gaussian without the cut errs by 1.1e-3 on these; a convolution by FFT
/// is exact at pixels, not between them, and takes about 8 times as long. Defined everywhere: in and beyond the image
/// as the sum is, fading to exactly zero where no liquid is near.
class ActivationField {
 public:
  /// For masks of this size [px]. kernel.length_px is at least 4 px, kernel.cut_px at least 2.6 lengths.
  /// Throws std::invalid_argument.
  ActivationField(int width, int height, const ImageKernel& kernel = {})
      : grid_("ActivationField", width, height, kernel) {}

  int width() const noexcept { return grid_.width(); }
  int height() const noexcept { return grid_.height(); }
  const ImageKernel& kernel() const noexcept { return grid_.kernel(); }

  /// @param mask,coverage of the size given at construction. Does not allocate; the same bits for any number of
  /// threads.
  void rebuild(const ConstMaskView& mask, const ConstImageView<float>& coverage, Threads threads = {}) noexcept {
    grid_.rebuild(threads, detail::LiquidWeights{mask, coverage, grid_.width(), grid_.height()});
  }

  /// Psi at a place in the image or beyond [px]; zero before the first rebuild and for NaN. Callable from many threads.
  double value(const Eigen::Vector2d& pixel) const noexcept { return grid_.at(pixel)[0]; }

 private:
  detail::KernelGrid<false> grid_;
};

}  // namespace decant::inline DECANT_TARGET
