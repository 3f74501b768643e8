// SPDX-License-Identifier: MIT
#pragma once

/// What decant asks of a camera.

#include <concepts>

#include <Eigen/Core>

#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Where a point falls in an image.
struct Projection {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< (u, v) [px], u right, v down, (0, 0) the top left one's centre
  double depth = 0;      ///< along the optical axis [m]; 0 for a point that the camera cannot project
  bool visible = false;  ///< projected, and inside the image; walls are not asked, see camera/occlusion_concept.hpp

  /// Whether `pixel` is the point's; it may lie outside the image.
  bool projected() const noexcept { return depth > 0; }
};

/// A camera without its pose: it looks along +z, x is right in its image and y down. Points are in the camera's frame;
/// camera_from_world = world_from_camera.inverse() takes them there. project(x_in_camera [m]) never throws and never
/// returns NaN: what the camera cannot project (behind it, not finite, beyond what its lens takes in) has depth 0 and
/// is not visible, with any finite pixel; all else has its z as depth, and is visible if inside_image.
/// unproject(pixel, depth) gives the point of that depth [m] that falls on that pixel, which may lie outside the image;
/// both arguments must be finite. What falls on one pixel is a straight line: unproject(pixel, depth) is affine in the
/// depth, and unproject(pixel, 0) is where sight begins, the centre of a pinhole or a point of an orthographic camera's
/// image plane. jacobian(x_in_camera) holds the pixel's derivative by the point [px/m]; zero where the point cannot be
/// projected.
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

/// Whether a camera says of itself, by `static constexpr bool has_affine_rays = true`, that unproject(pixel, depth) is
/// affine in the pixel too, and that all its rays share either their beginning or their direction. Straight lines in
/// space are then straight in the image, and triangles can be drawn row by row (camera/depth_buffer.hpp). A camera that
/// says nothing is taken for one that bends lines.
template <class C>
inline constexpr bool has_affine_rays = requires { requires C::has_affine_rays; };

namespace detail {

inline constexpr int largest_image_side = 32768;

// Whether a central camera may divide by z. Beyond these bounds pixels would overflow what an int holds: a micrometre
// before the camera, or within a thousandth of a degree of the plane through it.
inline bool before_camera(const Vector3<double>& x) noexcept {
  return x.allFinite() && x.z() > 1e-6 && x.head<2>().cwiseAbs().maxCoeff() <= 1e5 * x.z();
}

}  // namespace detail

}  // namespace decant::inline DECANT_TARGET
