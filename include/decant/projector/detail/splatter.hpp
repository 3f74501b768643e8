// SPDX-License-Identifier: MIT
#pragma once

/// The loop that projectors share: find where each particle falls, then draw row by row.

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/pixel_box.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET::detail {

/// A pixel number as int, within [lowest, highest]; NaN gives the lowest.
inline int pixel_between(double pixel, int lowest, int highest) noexcept {
  return pixel > lowest ? (pixel < highest ? static_cast<int>(pixel) : highest) : lowest;
}

/// The pixels of `image` whose centres lie in [u_low, u_high] x [v_low, v_high]; empty for NaN.
inline PixelBox pixels_between(double u_low, double u_high, double v_low, double v_high,
                               const PixelBox& image) noexcept {
  if (!(u_low <= u_high && v_low <= v_high)) {
    return {};
  }
  return {pixel_between(std::ceil(u_low), image.u_begin, image.u_end),
          pixel_between(std::ceil(v_low), image.v_begin, image.v_end),
          pixel_between(std::floor(u_high) + 1, image.u_begin, image.u_end),
          pixel_between(std::floor(v_high) + 1, image.v_begin, image.v_end)};
}

/// Adds one to the pixels [begin, end) of a row.
inline void count_pixels(float* row, int begin, int end) noexcept {
  for (int u = begin; u < end; ++u) {
    row[u] += 1;
  }
}

/// Where particles fall. A Footprint has a PixelBox named box, empty if the particle is not drawn.
template <class Footprint>
class Splatter {
 public:
  /// Calls footprint_of(x_in_camera) for each particle that is not hidden. Returns the hull of all boxes.
  template <class Scalar, class FootprintOf>
  PixelBox place(const ConstPointsView<Scalar>& position, std::span<const std::uint8_t> hidden,
                 const Pose& camera_from_world, Threads threads, FootprintOf&& footprint_of) noexcept {
    const auto count = static_cast<std::size_t>(position.cols());
    assert(hidden.empty() || hidden.size() == count);
    footprints_.resize(count);
    const Matrix3<double> rotation = camera_from_world.rotation.toRotationMatrix();
    const Vector3<double> translation = camera_from_world.translation;
    parallel_for(position.cols(), threads, [&](Index i) {
      const auto k = static_cast<std::size_t>(i);
      if (k < hidden.size() && hidden[k] != 0) {
        footprints_[k].box = {};
        return;
      }
      const Vector3<double> x = position.col(i).template cast<double>();
      footprints_[k] = footprint_of(Vector3<double>(rotation * x + translation));
    });
    PixelBox drawn;
    for (const Footprint& footprint : footprints_) {
      drawn = drawn.hull(footprint.box);
    }
    return drawn;
  }

  /// Clears the image, then calls draw_row(footprint, v, row's first pixel) for each row of each footprint. Threads
  /// share the rows like the teeth of combs, which balances them wherever the liquid is; each row is one thread's own.
  template <class DrawRow>
  void draw(ImageView<float>& image, Threads threads, DrawRow&& draw_row) const noexcept {
    draw(image, PixelBox::of(image), threads, std::forward<DrawRow>(draw_row));
  }

  /// The same for an image that is zero outside of `stale`, a box that lies on it.
  template <class DrawRow>
  void draw(ImageView<float>& image, const PixelBox& stale, Threads threads, DrawRow&& draw_row) const noexcept {
    const Index combs =
        std::min<Index>(threads.resolved(), 1 + static_cast<Index>(footprints_.size()) / least_per_thread);
    parallel_ranges(combs, threads, 1, [&](Index comb, Index) {
      for (Index v = comb; v < stale.v_end; v += combs) {
        if (v >= stale.v_begin) {
          std::fill(&image(v, 0) + stale.u_begin, &image(v, 0) + stale.u_end, 0.0f);
        }
      }
      const int step = static_cast<int>(combs);
      const int offset = static_cast<int>(comb);
      for (const Footprint& footprint : footprints_) {
        if (footprint.box.empty()) {
          continue;
        }
        // first row at or below v_begin that is this comb's
        int v = footprint.box.v_begin + (offset - footprint.box.v_begin % step + step) % step;
        for (; v < footprint.box.v_end; v += step) {
          draw_row(footprint, v, &image(v, 0));
        }
      }
    });
  }

 private:
  std::vector<Footprint> footprints_;
};

}  // namespace decant::inline DECANT_TARGET::detail
