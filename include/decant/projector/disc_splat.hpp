// SPDX-License-Identifier: MIT
#pragma once

/// Particles as discs: the fast projector.

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <span>

#include <decant/camera/pinhole_camera.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/projector/concept.hpp>
#include <decant/projector/detail/splatter.hpp>

namespace decant::inline DECANT_TARGET {

/// Draws each particle as a disc around its projected centre. The disc is as large as the sphere of the given radius at
/// the particle's depth: radius * sqrt(fx fy) / z for a pinhole, radius * sqrt|det d(u, v)/d(x, y)| for any camera.
/// This is the sphere's outline where fx = fy and the sphere is small and near the optical axis; off the axis the true
/// outline is an ellipse, longer by 1 / cos(angle) (a tenth at 25 degrees): see ProjectedSphere. A pixel counts if its
/// centre lies in the disc, so discs have the right area on average but for rounding to whole pixels; a disc that holds
/// no pixel's centre counts for the pixel that its own centre is in, so that no particle gets lost, however far away. A
/// particle whose centre is behind the camera is not drawn.
template <std::floating_point ScalarType = float>
class DiscSplat {
 public:
  using Scalar = ScalarType;

  /// @param radius of the particles' spheres [m], > 0. The default is 0.66 spacings of 5 mm: among 0.56 to 0.68
  /// spacings the one whose silhouettes agreed best with recorded masks. Throws std::invalid_argument.
  explicit DiscSplat(double radius = 0.0033) : radius_(radius) {
    expects(radius > 0 && std::isfinite(radius), "DiscSplat: radius [m]", "> 0", radius);
  }

  double radius() const noexcept { return radius_; }  ///< [m]

  template <CameraModel Camera>
  PixelBox render(const ConstPointsView<Scalar>& position, std::span<const std::uint8_t> hidden, const Camera& camera,
                  const Pose& camera_from_world, ImageView<float> coverage, Threads threads = {}) noexcept {
    return render(position, hidden, camera, camera_from_world, coverage, PixelBox::of(coverage), threads);
  }

  /// The same into a coverage that is zero outside of `stale`, such as what the render before returned.
  template <CameraModel Camera>
  PixelBox render(const ConstPointsView<Scalar>& position, std::span<const std::uint8_t> hidden, const Camera& camera,
                  const Pose& camera_from_world, ImageView<float> coverage, const PixelBox& stale,
                  Threads threads) noexcept {
    const PixelBox image = PixelBox::of(coverage);
    const PixelBox drawn = splatter_.template place<Scalar>(
        position, hidden, camera_from_world, threads, [&](const Vector3<double>& x_in_camera) {
          const double area_scale = std::abs(camera.jacobian(x_in_camera).template leftCols<2>().determinant());
          return area_scale > 0 ? disc(camera.project(x_in_camera).pixel, radius_ * std::sqrt(area_scale), image)
                                : Disc{};
        });
    splatter_.draw(coverage, stale.intersection(image), threads, [](const Disc& disc, int v, float* row) {
      const double below = v - disc.v;
      const double half = std::sqrt(std::max(0.0, disc.radius_squared - below * below));
      detail::count_pixels(row, detail::pixel_between(std::ceil(disc.u - half), disc.box.u_begin, disc.box.u_end),
                           detail::pixel_between(std::floor(disc.u + half) + 1, disc.box.u_begin, disc.box.u_end));
    });
    return drawn;
  }

 private:
  struct Disc {
    double u = 0, v = 0, radius_squared = 0;  // [px], [px^2]
    PixelBox box;
  };

  static Disc disc(const Eigen::Vector2d& center, double radius_px, const PixelBox& image) noexcept {
    Disc disc{center.x(), center.y(), radius_px * radius_px, {}};
    // if the nearest pixel centre is not in the disc, none is
    const Eigen::Vector2d nearest(std::floor(center.x() + 0.5), std::floor(center.y() + 0.5));
    if (!((nearest - center).squaredNorm() <= disc.radius_squared)) {
      disc = {nearest.x(), nearest.y(), 0, {}};
      radius_px = 0;
    }
    disc.box =
        detail::pixels_between(disc.u - radius_px, disc.u + radius_px, disc.v - radius_px, disc.v + radius_px, image);
    return disc;
  }

  double radius_;
  detail::Splatter<Disc> splatter_;
};
static_assert(Projector<DiscSplat<float>, PinholeCamera> && Projector<DiscSplat<double>, PinholeCamera>);

}  // namespace decant::inline DECANT_TARGET
