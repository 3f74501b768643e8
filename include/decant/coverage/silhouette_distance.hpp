// SPDX-License-Identifier: MIT
#pragma once

/// How far each pixel is from the liquid of a mask, and which liquid pixel is nearest.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/pixel_box.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Which pixels of a mask a distance leads to.
enum class MaskPart { Liquid, Background };

/// The exact Euclidean distance transform: for every pixel the distance to the nearest pixel of the mask's liquid (or
/// of its background), centre to centre, in time linear in the number of pixels. First the nearest such pixel within
/// each column, by two sweeps; then, for each row, the lower envelope of the parabolas that the columns contribute
/// (Felzenszwalb & Huttenlocher 2012, Theory of Computing 8). Squared distances are whole numbers below 2^53 and thus
/// exact. A signed distance, positive inside, is the one to the background less the one to the liquid.
class SilhouetteDistance {
 public:
  /// Allocates only if the mask is larger, or there are more threads, than ever before; results do not depend on the
  /// number of threads. @param mask up to 32768 x 32768 pixels; bytes as is_liquid reads them.
  void rebuild(const ConstMaskView& mask, MaskPart part = MaskPart::Liquid, Threads threads = {}) noexcept {
    rebuild(mask, PixelBox::of(mask), part, threads);
  }

  /// The same for the pixels of a box alone, in a time that goes by the box's size: what is outside of it has no
  /// meaning afterwards. @param box lies on the mask, and holds all pixels of the part that distances are to lead to.
  void rebuild(const ConstMaskView& mask, const PixelBox& box, MaskPart part = MaskPart::Liquid,
               Threads threads = {}) noexcept {
    if (distance_.rows() != mask.rows() || distance_.cols() != mask.cols()) {
      distance_.resize(mask.rows(), mask.cols());
      nearest_.resize(mask.rows(), mask.cols());
    }
    if (box.empty()) {
      return;
    }
    const Index columns = box.width();
    parallel_ranges(columns, threads, columns_per_range, [&](Index begin, Index end) {
      nearest_in_columns(mask, part, box, box.u_begin + begin, box.u_begin + end);
    });

    // each comb has room for one row's envelope
    const Index combs = std::max<Index>(1, std::min<Index>(threads.resolved(), box.height()));
    const std::size_t room = static_cast<std::size_t>(combs) * static_cast<std::size_t>(columns);
    if (envelopes_.size() < room) {
      envelopes_.resize(room);
    }
    parallel_ranges(combs, threads, 1, [&](Index comb, Index) {
      for (Index v = box.v_begin + comb; v < box.v_end; v += combs) {
        lower_envelope(v, box, envelopes_.data() + comb * columns);
      }
    });
  }

  /// Distances of the last rebuild [px], as large as its mask; infinite everywhere if the mask had no such pixel.
  const Image<float>& distance_px() const noexcept { return distance_; }

  /// The pixel that the distance leads to, as row * columns + column; -1 everywhere if there was none. Of several that
  /// are equally far it is always the same one.
  const Image<std::int32_t>& nearest() const noexcept { return nearest_; }

 private:
  static constexpr Index columns_per_range = 64;

  struct Parabola {
    double begin = 0;         // from this column on it is the lowest
    double height = 0;        // squared distance within its column, plus the column's square
    std::int32_t column = 0;  // of its lowest point
    std::int32_t row = 0;     // that it stands for
  };

  // nearest_ holds rows until lower_envelope turns them into pixels; -1 where a column is empty.
  void nearest_in_columns(const ConstMaskView& mask, MaskPart part, const PixelBox& box, Index begin,
                          Index end) noexcept {
    const bool wanted = part == MaskPart::Liquid;
    const Index columns = mask.cols();
    const Index stride = mask.outerStride();
    std::int32_t* const nearest = nearest_.data();
    for (Index v = box.v_begin; v < box.v_end; ++v) {
      const std::uint8_t* const pixel = mask.data() + v * stride;
      std::int32_t* const row = nearest + v * columns;
      for (Index u = begin; u < end; ++u) {
        const std::int32_t above = v > box.v_begin ? row[u - columns] : -1;
        row[u] = is_liquid(pixel[u]) == wanted ? static_cast<std::int32_t>(v) : above;
      }
    }
    for (Index v = box.v_end - 2; v >= box.v_begin; --v) {
      std::int32_t* const row = nearest + v * columns;
      for (Index u = begin; u < end; ++u) {
        const auto here = static_cast<std::int32_t>(v);
        const std::int32_t above = row[u], below = row[u + columns];
        const bool take_below = below >= 0 && (above < 0 || below - here < here - above);
        row[u] = take_below ? below : above;
      }
    }
  }

  void lower_envelope(Index v, const PixelBox& box, Parabola* envelope) noexcept {
    const Index columns = nearest_.cols();
    std::int32_t* const nearest = &nearest_(v, 0);
    float* const distance = &distance_(v, 0);
    Index last = -1;
    for (Index u = box.u_begin; u < box.u_end; ++u) {
      if (nearest[u] < 0) {
        continue;
      }
      const auto column = static_cast<double>(u), rise = static_cast<double>(v - nearest[u]);
      Parabola next{-std::numeric_limits<double>::infinity(), rise * rise + column * column,
                    static_cast<std::int32_t>(u), nearest[u]};
      while (last >= 0) {
        const Parabola& top = envelope[last];
        next.begin = (next.height - top.height) / (2 * (column - top.column));
        if (next.begin > top.begin) {
          break;
        }
        --last;
        next.begin = -std::numeric_limits<double>::infinity();
      }
      envelope[++last] = next;
    }
    if (last < 0) {
      std::fill(distance + box.u_begin, distance + box.u_end, std::numeric_limits<float>::infinity());
      return;
    }
    Index lowest = 0;
    for (Index u = box.u_begin; u < box.u_end; ++u) {
      while (lowest < last && envelope[lowest + 1].begin < static_cast<double>(u)) {
        ++lowest;
      }
      const Parabola& parabola = envelope[lowest];
      const auto du = static_cast<double>(u - parabola.column), dv = static_cast<double>(v - parabola.row);
      distance[u] = static_cast<float>(std::sqrt(du * du + dv * dv));
      nearest[u] = static_cast<std::int32_t>(parabola.row * columns + parabola.column);
    }
  }

  Image<float> distance_;
  Image<std::int32_t> nearest_;
  std::vector<Parabola> envelopes_;
};

}  // namespace decant::inline DECANT_TARGET
