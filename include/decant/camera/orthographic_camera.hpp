// SPDX-License-Identifier: MIT
#pragma once

/// The camera whose rays are parallel.

#include <cmath>

#include <decant/camera/concept.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// Parallel projection along z, for views from far away and for sections: u = s x + cx, v = s y + cy. Sees what lies
/// before its image plane z = 0.
class OrthographicCamera {
 public:
  static constexpr bool has_affine_rays = true;

  /// @param pixels_per_metre s [px/m], > 0 and at most 1e6. @param cx,cy where the optical axis meets the image [px].
  /// @param width,height of the image [px], 1 to 32768. Throws std::invalid_argument.
  OrthographicCamera(double pixels_per_metre, double cx, double cy, int width, int height)
      : scale_(pixels_per_metre), cx_(cx), cy_(cy), width_(width), height_(height) {
    expects(pixels_per_metre > 0 && pixels_per_metre <= 1e6, "OrthographicCamera: pixels per metre [px/m]",
            "> 0 and at most 1e6", pixels_per_metre);
    expects(std::isfinite(cx), "OrthographicCamera: cx [px]", "finite", cx);
    expects(std::isfinite(cy), "OrthographicCamera: cy [px]", "finite", cy);
    expects(width >= 1 && width <= detail::largest_image_side, "OrthographicCamera: width [px]", "1 to 32768", width);
    expects(height >= 1 && height <= detail::largest_image_side, "OrthographicCamera: height [px]", "1 to 32768",
            height);
  }

  Projection project(const Vector3<double>& x_in_camera) const noexcept {
    Projection seen;
    if (!before_plane(x_in_camera)) {
      return seen;
    }
    seen.depth = x_in_camera.z();
    seen.pixel = {scale_ * x_in_camera.x() + cx_, scale_ * x_in_camera.y() + cy_};
    seen.visible = inside_image(seen.pixel, width_, height_);
    return seen;
  }

  Vector3<double> unproject(const Eigen::Vector2d& pixel, double depth) const noexcept {
    return {(pixel.x() - cx_) / scale_, (pixel.y() - cy_) / scale_, depth};
  }

  Eigen::Matrix<double, 2, 3> jacobian(const Vector3<double>& x_in_camera) const noexcept {
    Eigen::Matrix<double, 2, 3> rate = Eigen::Matrix<double, 2, 3>::Zero();
    if (before_plane(x_in_camera)) {
      rate(0, 0) = scale_;
      rate(1, 1) = scale_;
    }
    return rate;
  }

  double pixels_per_metre() const noexcept { return scale_; }
  double cx() const noexcept { return cx_; }
  double cy() const noexcept { return cy_; }
  int width() const noexcept { return width_; }
  int height() const noexcept { return height_; }

 private:
  // farther aside, pixels could overflow
  static bool before_plane(const Vector3<double>& x) noexcept {
    return x.allFinite() && x.z() > 0 && x.head<2>().cwiseAbs().maxCoeff() <= 1e9;
  }

  double scale_, cx_, cy_;
  int width_, height_;
};
static_assert(CameraModel<OrthographicCamera>);

}  // namespace decant::inline DECANT_TARGET
