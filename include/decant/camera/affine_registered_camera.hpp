// SPDX-License-Identifier: MIT
#pragma once

/// A second imager, such as a thermographic one, that is known only by where its pixels fall in a first camera's image.

#include <algorithm>
#include <cmath>
#include <utility>

#include <decant/camera/concept.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// A camera whose image is an affine map of another camera's: pixel_in_first = A * (pixel_in_second, 1), A being
/// `first_from_second`, the 2x3 matrix that recordings call `affine_to_image` (thermal pixel to image pixel). The
/// class is the second camera: it projects to, and unprojects from, the second imager's pixels, and its points are in
/// the first camera's frame. Its image is its own: what the first camera does not have in its image may be visible
/// here. Both imagers are taken to share one viewpoint, as they do to a good approximation if they are mounted closely
/// side by side and look at things of about the same distance.
template <class First>
class AffineRegisteredCamera {
  static_assert(CameraModel<First>,
                "AffineRegisteredCamera: First must model decant::CameraModel, see <decant/camera/concept.hpp>");

 public:
  using Affine = Eigen::Matrix<double, 2, 3>;
  static constexpr bool has_affine_rays = decant::has_affine_rays<First>;

  /// @param first_from_second takes a pixel (u, v, 1) of the second image to the first one [px].
  /// @param width,height of the second image [px], 1 to 32768.
  /// Throws std::invalid_argument if a number is not finite, or if the map has no inverse.
  AffineRegisteredCamera(First first, const Affine& first_from_second, int width, int height)
      : first_(std::move(first)), first_from_second_(first_from_second), width_(width), height_(height) {
    const double largest = first_from_second.cwiseAbs().maxCoeff();
    expects(first_from_second.allFinite() && largest <= 1e9, "AffineRegisteredCamera: entry of the 2x3 matrix",
            "finite and within 1e9", first_from_second.allFinite() ? largest : first_from_second.sum());
    const Eigen::Matrix2d linear = first_from_second.leftCols<2>();
    // 1e-6: pixels that are a thousand times longer than wide, or a thousand times larger than the first camera's
    expects(std::abs(linear.determinant()) > 1e-6 * std::max(1.0, linear.squaredNorm()),
            "AffineRegisteredCamera: determinant of the 2x3 matrix's linear part",
            "far enough from 0 for the map to have an inverse", linear.determinant());
    expects(width >= 1 && width <= detail::largest_image_side, "AffineRegisteredCamera: width [px]", "1 to 32768",
            width);
    expects(height >= 1 && height <= detail::largest_image_side, "AffineRegisteredCamera: height [px]", "1 to 32768",
            height);
    linear_from_first_ = linear.inverse();
  }

  Projection project(const Vector3<double>& x_in_camera) const noexcept {
    Projection seen = first_.project(x_in_camera);
    if (seen.projected()) {
      seen.pixel = linear_from_first_ * (seen.pixel - first_from_second_.col(2));
      seen.visible = inside_image(seen.pixel, width_, height_);
    }
    return seen;
  }

  Vector3<double> unproject(const Eigen::Vector2d& pixel, double depth) const noexcept {
    return first_.unproject(in_first(pixel), depth);
  }

  Eigen::Matrix<double, 2, 3> jacobian(const Vector3<double>& x_in_camera) const noexcept {
    return linear_from_first_ * first_.jacobian(x_in_camera);
  }

  /// Where a pixel of this image lies in the first camera's [px].
  Eigen::Vector2d in_first(const Eigen::Vector2d& pixel) const noexcept {
    return first_from_second_.template leftCols<2>() * pixel + first_from_second_.col(2);
  }

  const First& first() const noexcept { return first_; }
  const Affine& first_from_second() const noexcept { return first_from_second_; }
  int width() const noexcept { return width_; }
  int height() const noexcept { return height_; }

 private:
  First first_;
  Affine first_from_second_;
  Eigen::Matrix2d linear_from_first_;
  int width_, height_;
};
static_assert(CameraModel<AffineRegisteredCamera<PinholeCamera>>);

}  // namespace decant::inline DECANT_TARGET
