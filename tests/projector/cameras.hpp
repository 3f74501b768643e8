// SPDX-License-Identifier: MIT
#pragma once

/// Cameras that projectors know nothing of.

#include <decant/camera/pinhole_camera.hpp>

namespace decant_test {

/// A pinhole that is not decant's: projectors have to treat it like any camera.
struct ForeignPinhole {
  decant::PinholeCamera camera;

  decant::Projection project(const decant::Vector3<double>& x) const noexcept { return camera.project(x); }
  decant::Vector3<double> unproject(const Eigen::Vector2d& pixel, double depth) const noexcept {
    return camera.unproject(pixel, depth);
  }
  Eigen::Matrix<double, 2, 3> jacobian(const decant::Vector3<double>& x) const noexcept { return camera.jacobian(x); }
  int width() const noexcept { return camera.width(); }
  int height() const noexcept { return camera.height(); }
};
static_assert(decant::CameraModel<ForeignPinhole>);

/// Parallel rays: u = scale x + cx, v = scale y + cy, before the plane z = 0.
struct Parallel {
  double scale = 1000;  // [px/m]
  double cx = 80, cy = 60;

  decant::Projection project(const decant::Vector3<double>& x) const noexcept {
    decant::Projection seen;
    if (x.allFinite() && x.z() > 0) {
      seen.pixel = {scale * x.x() + cx, scale * x.y() + cy};
      seen.depth = x.z();
      seen.visible = decant::inside_image(seen.pixel, width(), height());
    }
    return seen;
  }
  decant::Vector3<double> unproject(const Eigen::Vector2d& pixel, double depth) const noexcept {
    return {(pixel.x() - cx) / scale, (pixel.y() - cy) / scale, depth};
  }
  Eigen::Matrix<double, 2, 3> jacobian(const decant::Vector3<double>& x) const noexcept {
    Eigen::Matrix<double, 2, 3> rate = Eigen::Matrix<double, 2, 3>::Zero();
    if (x.allFinite() && x.z() > 0) {
      rate(0, 0) = rate(1, 1) = scale;
    }
    return rate;
  }
  int width() const noexcept { return 160; }
  int height() const noexcept { return 120; }
};
static_assert(decant::CameraModel<Parallel>);

}  // namespace decant_test
