// SPDX-License-Identifier: MIT
#pragma once

/// What decant asks of a camera.

#include <concepts>

#include <Eigen/Core>

#include <decant/core/types.hpp>

namespace decant {

/// Where a point falls in an image.
struct Projection {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< (u, v) [px], u right, v down, (0, 0) is the top left pixel
  double depth = 0;                                 ///< along the optical axis [m]
  bool visible = false;  ///< before the camera and inside the image; walls are not asked, see camera/ray_occlusion.hpp
};

/// A camera without its pose: it looks along +z, x is right in its image and y down. Points are in the camera's frame;
/// camera_from_world = world_from_camera.inverse() takes them there. project(x_in_camera [m]) never throws and never
/// returns NaN: what is behind the camera, or not finite, is flagged as not visible, with any finite pixel.
/// unproject(pixel, depth) gives the point of that depth [m] that falls on that pixel, which may lie outside the image.
/// jacobian(x_in_camera) holds the pixel's derivative by the point [px/m]; zero where the point cannot be projected.
/// width() and height() are the image's [px]. A camera is a value; all of this may be called from any thread.
/// Laws: decant/testing/camera.hpp.
template <class C>
concept CameraModel =
    std::copyable<C> && requires(const C& camera, const Vector3<double>& x_in_camera, const Eigen::Vector2d& pixel,
                                 double depth) {
      { camera.project(x_in_camera) } noexcept -> std::same_as<Projection>;
      { camera.unproject(pixel, depth) } noexcept -> std::same_as<Vector3<double>>;
      { camera.jacobian(x_in_camera) } noexcept -> std::same_as<Eigen::Matrix<double, 2, 3>>;
      { camera.width() } noexcept -> std::same_as<int>;
      { camera.height() } noexcept -> std::same_as<int>;
    };

/// Whether a pixel lies on a width x height image: pixel centres are whole numbers, so the image reaches half a pixel
/// beyond the first and the last of them. False for NaN.
inline bool inside_image(const Eigen::Vector2d& pixel, int width, int height) noexcept {
  return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() < width - 0.5 && pixel.y() < height - 0.5;
}

}  // namespace decant
