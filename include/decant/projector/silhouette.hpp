// SPDX-License-Identifier: MIT
#pragma once

/// The mask that a camera would see of the particles.

#include <concepts>
#include <cstdint>
#include <span>
#include <utility>

#include <decant/camera/concept.hpp>
#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/pixel_box.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/projector/concept.hpp>
#include <decant/projector/disc_splat.hpp>
#include <decant/projector/gap_closing.hpp>

namespace decant::inline DECANT_TARGET {

/// Writes mask_liquid where coverage is above zero, and 0 elsewhere. `drawn` is what Projector::render returned, or
/// PixelBox::of(coverage). Both images are of one size.
inline void silhouette(const ConstImageView<float>& coverage, const PixelBox& drawn, MaskView mask,
                       Threads threads = {}) noexcept {
  const PixelBox within = drawn.intersection(PixelBox::of(mask)).intersection(PixelBox::of(coverage));
  parallel_ranges(mask.rows(), threads, 32, [&](Index begin, Index end) {
    for (Index v = begin; v < end; ++v) {
      mask.row(v).setZero();
      if (v >= within.v_begin && v < within.v_end) {
        const float* const from = coverage.data() + v * coverage.outerStride();
        std::uint8_t* const to = &mask(v, 0);
        for (int u = within.u_begin; u < within.u_end; ++u) {
          to[u] = from[u] > 0 ? mask_liquid : std::uint8_t{0};
        }
      }
    }
  });
}

/// Renders particles as a mask: where the projector counts any, then small gaps closed. What covers no pixel is not
/// seen, so lone particles need a projector that keeps them (DiscSplat). Results do not depend on the number of
/// threads.
template <class ProjectorType = DiscSplat<float>>
class Silhouette {
 public:
  using Scalar = typename ProjectorType::Scalar;

  explicit Silhouette(ProjectorType projector = ProjectorType(), GapClosing closing = GapClosing())
      : projector_(std::move(projector)), closing_(std::move(closing)) {}

  /// Draws like Projector::render, into a mask of camera.height() rows and camera.width() columns. Returns a rectangle
  /// outside of which the mask is empty. Allocates only when N or the image is larger than ever before.
  template <CameraModel Camera>
  PixelBox render(const ConstPointsView<Scalar>& position, std::span<const std::uint8_t> hidden, const Camera& camera,
                  const Pose& camera_from_world, MaskView mask, Threads threads = {}) noexcept {
    static_assert(Projector<ProjectorType, Camera>,
                  "Silhouette's projector must model decant::Projector, see <decant/projector/concept.hpp>");
    if (coverage_.rows() != mask.rows() || coverage_.cols() != mask.cols()) {
      coverage_.resize(mask.rows(), mask.cols());
      drawn_ = PixelBox::of(coverage_);  // anything may be there
    }
    const PixelBox drawn = draw(position, hidden, camera, camera_from_world, threads);
    drawn_ = drawn;
    silhouette(coverage_, drawn, mask, threads);
    closing_.apply(mask, drawn, threads);
    return drawn;
  }

  /// How many particles cover each pixel, as of the last render.
  const Image<float>& coverage() const noexcept { return coverage_; }
  const ProjectorType& projector() const noexcept { return projector_; }
  GapClosing& closing() noexcept { return closing_; }
  const GapClosing& closing() const noexcept { return closing_; }

 private:
  /// Projectors that can do with less clear only what they drew the last time.
  template <class Camera>
  PixelBox draw(const ConstPointsView<Scalar>& position, std::span<const std::uint8_t> hidden, const Camera& camera,
                const Pose& camera_from_world, Threads threads) noexcept {
    if constexpr (requires {
                    projector_.render(position, hidden, camera, camera_from_world, coverage_, drawn_, threads);
                  }) {
      return projector_.render(position, hidden, camera, camera_from_world, coverage_, drawn_, threads);
    } else {
      return projector_.render(position, hidden, camera, camera_from_world, coverage_, threads);
    }
  }

  ProjectorType projector_;
  GapClosing closing_;
  Image<float> coverage_;
  PixelBox drawn_{};  ///< outside of it coverage_ is zero
};

}  // namespace decant::inline DECANT_TARGET
