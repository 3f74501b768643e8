// SPDX-License-Identifier: MIT
#pragma once

/// Particles as spheres: the exact projector.

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>
#include <type_traits>
#include <vector>

#include <decant/camera/pinhole_camera.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/projector/concept.hpp>
#include <decant/projector/detail/splatter.hpp>

namespace decant::inline DECANT_TARGET {

/// Draws each particle as the exact outline of its sphere: a pixel counts if the ray through its centre meets the
/// sphere before the camera. With the ray o + t d and c the sphere's centre as seen from o, that is |d x c|^2 <= |d|^2
/// r^2 and d . c > 0, or |c| <= r. For a pinhole the outline is an ellipse, the cut of the image plane with the cone
/// from the eye that touches the sphere, and rows of it are found in closed form. For other cameras every pixel near a
/// sphere is tried against its ray from camera.unproject, once per frame and pixel; a camera whose unproject iterates
/// dominates the cost. A sphere smaller than a pixel may fall between all rays; DiscSplat loses none. A particle whose
/// centre cannot be projected is not drawn, even if its sphere reaches before the camera.
template <std::floating_point ScalarType = float>
class ProjectedSphere {
 public:
  using Scalar = ScalarType;

  /// @param radius of the particles' spheres [m], > 0; for the default see DiscSplat. Throws std::invalid_argument.
  explicit ProjectedSphere(double radius = 0.0033) : radius_(radius) {
    expects(radius > 0 && std::isfinite(radius), "ProjectedSphere: radius [m]", "> 0", radius);
  }

  double radius() const noexcept { return radius_; }  ///< [m]

  template <CameraModel Camera>
  PixelBox render(const ConstPointsView<Scalar>& position, std::span<const std::uint8_t> hidden, const Camera& camera,
                  const Pose& camera_from_world, ImageView<float> coverage, Threads threads = {}) noexcept {
    constexpr bool closed_form = std::is_same_v<Camera, PinholeCamera>;
    const PixelBox image = PixelBox::of(coverage);
    const PixelBox drawn = splatter_.template place<Scalar>(
        position, hidden, camera_from_world, threads, [&](const Vector3<double>& x_in_camera) {
          Sphere sphere{x_in_camera, {}};
          if (!camera.jacobian(x_in_camera).isZero(0)) {
            if constexpr (closed_form) {
              sphere.box = box_of_ellipse(x_in_camera, camera, image);
            } else {
              sphere.box = box_around(x_in_camera, camera, image);
            }
          }
          return sphere;
        });
    if constexpr (!closed_form) {
      trace(camera, drawn, threads);
    }
    splatter_.draw(coverage, threads, [&](const Sphere& sphere, int v, float* row) {
      if constexpr (closed_form) {
        if (sphere.center.z() > radius_) {
          draw_ellipse_row(sphere, camera, v, row);
          return;
        }
        // reaches through the plane of the eye: its outline is no ellipse
        for (int u = sphere.box.u_begin; u < sphere.box.u_end; ++u) {
          row[u] += meets(ray_of(camera, u, v), sphere.center) ? 1.0f : 0.0f;
        }
      } else {
        const Ray* const rays = rays_.data() + static_cast<std::ptrdiff_t>(v - drawn.v_begin) * drawn.width();
        for (int u = sphere.box.u_begin; u < sphere.box.u_end; ++u) {
          row[u] += meets(rays[u - drawn.u_begin], sphere.center) ? 1.0f : 0.0f;
        }
      }
    });
    return drawn;
  }

 private:
  struct Sphere {
    Vector3<double> center = Vector3<double>::Zero();  // in the camera's frame [m]
    PixelBox box;
  };

  struct Ray {
    Vector3<double> origin, direction;
  };

  template <class Camera>
  static Ray ray_of(const Camera& camera, int u, int v) noexcept {
    const Eigen::Vector2d pixel(u, v);
    const Vector3<double> origin = camera.unproject(pixel, 0);
    return {origin, camera.unproject(pixel, 1) - origin};
  }

  // The cross product keeps all digits; |d . c|^2 - |d|^2 (|c|^2 - r^2) would lose those that r is in.
  bool meets(const Ray& ray, const Vector3<double>& center) const noexcept {
    const Vector3<double> c = center - ray.origin;
    const double r2 = radius_ * radius_;
    return (ray.direction.cross(c).squaredNorm() <= ray.direction.squaredNorm() * r2 && ray.direction.dot(c) > 0) ||
           c.squaredNorm() <= r2;
  }

  // Seen along an axis of the image, the cone is the pair of tangents to a circle at (a, z): slopes
  // (a z +- r sqrt(a^2 + z^2 - r^2)) / (z^2 - r^2).
  PixelBox box_of_ellipse(const Vector3<double>& c, const PinholeCamera& camera, const PixelBox& image) const noexcept {
    const double r2 = radius_ * radius_;
    const double along = c.z() * c.z() - r2;
    if (!(c.z() > radius_ && along > 0)) {
      return image;
    }
    const double u_half = radius_ * std::sqrt(c.x() * c.x() + along);
    const double v_half = radius_ * std::sqrt(c.y() * c.y() + along);
    const double fx = camera.fx() / along, fy = camera.fy() / along;
    return detail::pixels_between(
        camera.cx() + fx * (c.x() * c.z() - u_half), camera.cx() + fx * (c.x() * c.z() + u_half),
        camera.cy() + fy * (c.y() * c.z() - v_half), camera.cy() + fy * (c.y() * c.z() + v_half), image);
  }

  // With d = (x, y, 1) the condition is a quadratic in x. Its roots are (X w +- sqrt(k D)) / n with c = (X, Y, Z),
  // w = y Y + Z, k = |c|^2 - r^2, D = r^2 (y^2 + 1) - (y Z - Y)^2 and n = Y^2 + Z^2 - r^2; D in this form does not
  // cancel.
  void draw_ellipse_row(const Sphere& sphere, const PinholeCamera& camera, int v, float* row) const noexcept {
    const Vector3<double>& c = sphere.center;
    const double r2 = radius_ * radius_;
    const double y = (v - camera.cy()) / camera.fy();
    const double off = y * c.z() - c.y();
    const double discriminant = r2 * (y * y + 1) - off * off;
    if (!(discriminant >= 0)) {
      return;
    }
    const double n = c.y() * c.y() + c.z() * c.z() - r2;
    const double half = std::sqrt((c.squaredNorm() - r2) * discriminant);
    const double middle = c.x() * (y * c.y() + c.z());
    const double scale = camera.fx() / n;
    detail::count_pixels(
        row,
        detail::pixel_between(std::ceil(camera.cx() + scale * (middle - half)), sphere.box.u_begin, sphere.box.u_end),
        detail::pixel_between(std::floor(camera.cx() + scale * (middle + half)) + 1, sphere.box.u_begin,
                              sphere.box.u_end));
  }

  // The box of eight points of the cone's rim, widened by what lies between them.
  template <class Camera>
  PixelBox box_around(const Vector3<double>& c, const Camera& camera, const PixelBox& image) const noexcept {
    const Vector3<double> axis = c - camera.unproject(camera.project(c).pixel, 0);
    const double sine = radius_ / axis.norm();
    if (!(sine < 0.5)) {
      return image;  // within a diameter of the eye
    }
    const Vector3<double> side = axis.unitOrthogonal();
    const Vector3<double> up = axis.normalized().cross(side);
    const double rim = radius_ / std::sqrt(1 - sine * sine);
    Eigen::Array2d low = Eigen::Array2d::Constant(std::numeric_limits<double>::infinity());
    Eigen::Array2d high = -low;
    for (int k = 0; k < 8; ++k) {
      const double turn = k * std::numbers::pi / 4;
      const Vector3<double> x = c + rim * (std::cos(turn) * side + std::sin(turn) * up);
      if (camera.jacobian(x).isZero(0)) {
        return image;
      }
      const Eigen::Array2d pixel = camera.project(x).pixel.array();
      low = low.min(pixel);
      high = high.max(pixel);
    }
    // eight points of an ellipse miss at most 1 - cos(22.5 degrees) = 7.6 % of half its width: 4.1 % of the box
    const Eigen::Array2d margin = 0.06 * (high - low) + 1;
    return detail::pixels_between(low.x() - margin.x(), high.x() + margin.x(), low.y() - margin.y(),
                                  high.y() + margin.y(), image);
  }

  template <class Camera>
  void trace(const Camera& camera, const PixelBox& box, Threads threads) noexcept {
    const auto needed = static_cast<std::size_t>(box.width()) * static_cast<std::size_t>(box.height());
    if (rays_.size() < needed) {
      // at once for the whole image, so that liquid that spreads does not allocate again
      rays_.resize(
          std::max(needed, static_cast<std::size_t>(camera.width()) * static_cast<std::size_t>(camera.height())));
    }
    parallel_ranges(box.height(), threads, 1, [&](Index row, Index) {
      const int v = box.v_begin + static_cast<int>(row);
      Ray* const rays = rays_.data() + row * box.width();
      for (int u = box.u_begin; u < box.u_end; ++u) {
        rays[u - box.u_begin] = ray_of(camera, u, v);
      }
    });
  }

  double radius_;
  detail::Splatter<Sphere> splatter_;
  std::vector<Ray> rays_;
};
static_assert(Projector<ProjectedSphere<float>, PinholeCamera> && Projector<ProjectedSphere<double>, PinholeCamera>);

}  // namespace decant::inline DECANT_TARGET
