// SPDX-License-Identifier: MIT
#pragma once

/// The camera without distortion.

#include <cmath>

#include <decant/camera/concept.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// Central projection: u = fx x/z + cx, v = fy y/z + cy.
class PinholeCamera {
 public:
  static constexpr bool has_affine_rays = true;

  /// @param fx,fy focal lengths [px], > 0. @param cx,cy where the optical axis meets the image [px].
  /// @param width,height of the image [px], 1 to 32768. Throws std::invalid_argument.
  PinholeCamera(double fx, double fy, double cx, double cy, int width, int height)
      : fx_(fx), fy_(fy), cx_(cx), cy_(cy), width_(width), height_(height) {
    expects(fx > 0 && std::isfinite(fx), "PinholeCamera: fx [px]", "> 0", fx);
    expects(fy > 0 && std::isfinite(fy), "PinholeCamera: fy [px]", "> 0", fy);
    expects(std::isfinite(cx), "PinholeCamera: cx [px]", "finite", cx);
    expects(std::isfinite(cy), "PinholeCamera: cy [px]", "finite", cy);
    expects(width >= 1 && width <= detail::largest_image_side, "PinholeCamera: width [px]", "1 to 32768", width);
    expects(height >= 1 && height <= detail::largest_image_side, "PinholeCamera: height [px]", "1 to 32768", height);
  }

  Projection project(const Vector3<double>& x_in_camera) const noexcept {
    Projection seen;
    if (!detail::before_camera(x_in_camera)) {
      return seen;
    }
    seen.depth = x_in_camera.z();
    seen.pixel = {fx_ * x_in_camera.x() / x_in_camera.z() + cx_, fy_ * x_in_camera.y() / x_in_camera.z() + cy_};
    seen.visible = inside_image(seen.pixel, width_, height_);
    return seen;
  }

  Vector3<double> unproject(const Eigen::Vector2d& pixel, double depth) const noexcept {
    return {(pixel.x() - cx_) / fx_ * depth, (pixel.y() - cy_) / fy_ * depth, depth};
  }

  Eigen::Matrix<double, 2, 3> jacobian(const Vector3<double>& x_in_camera) const noexcept {
    Eigen::Matrix<double, 2, 3> rate = Eigen::Matrix<double, 2, 3>::Zero();
    if (detail::before_camera(x_in_camera)) {
      const double over_z = 1 / x_in_camera.z();
      rate << fx_ * over_z, 0, -fx_ * x_in_camera.x() * over_z * over_z,  //
          0, fy_ * over_z, -fy_ * x_in_camera.y() * over_z * over_z;
    }
    return rate;
  }

  double fx() const noexcept { return fx_; }
  double fy() const noexcept { return fy_; }
  double cx() const noexcept { return cx_; }
  double cy() const noexcept { return cy_; }
  int width() const noexcept { return width_; }
  int height() const noexcept { return height_; }

 private:
  double fx_, fy_, cx_, cy_;
  int width_, height_;
};
static_assert(CameraModel<PinholeCamera>);

}  // namespace decant::inline DECANT_TARGET
