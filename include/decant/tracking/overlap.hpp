// SPDX-License-Identifier: MIT
#pragma once

/// How two masks agree, in pixels: what intersection over union, likelihoods and error counts are made of.

#include <cstdint>
#include <limits>

#include <decant/core/image.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Pixel counts of a predicted and an observed mask of one size.
struct Overlap {
  std::int64_t compared_px = 0;   ///< pixels that were looked at: all, or those that are seen
  std::int64_t predicted_px = 0;  ///< of these, liquid in the prediction
  std::int64_t observed_px = 0;   ///< of these, liquid in the observation
  std::int64_t both_px = 0;       ///< liquid in both: the intersection
  bool comparable = true;         ///< false: the masks differ in size, and nothing was counted

  std::int64_t union_px() const noexcept { return predicted_px + observed_px - both_px; }
  /// Pixels on which the masks disagree.
  std::int64_t differing_px() const noexcept { return predicted_px + observed_px - 2 * both_px; }
  /// Pixels on which they agree, liquid or not.
  std::int64_t agreeing_px() const noexcept { return compared_px - differing_px(); }

  /// Intersection over union (Jaccard index), 0 to 1. 1 where neither mask has liquid: they are equal, and 1 is what
  /// equal masks have. NaN where nothing was compared, or the masks are not comparable: there is no answer.
  ///
  /// A frame without liquid must still not enter a mean as a success: it would say how long a recording ran before the
  /// pour. OverlapScore leaves such frames out.
  double iou() const noexcept {
    if (!comparable || compared_px == 0) {
      return std::numeric_limits<double>::quiet_NaN();
    }
    return union_px() == 0 ? 1 : static_cast<double>(both_px) / static_cast<double>(union_px());
  }

  /// Adds pixels up over frames; the sum is comparable only if all frames are.
  Overlap& operator+=(const Overlap& other) noexcept {
    compared_px += other.compared_px;
    predicted_px += other.predicted_px;
    observed_px += other.observed_px;
    both_px += other.both_px;
    comparable = comparable && other.comparable;
    return *this;
  }
};

namespace detail {

// One bit arithmetic per pixel and no branch, so that compilers count many pixels at once. The counters of a row are
// 32 bits wide, which no row exceeds and which keeps more of them in a register. is_liquid is the topmost bit.
template <class SeenInRow>
Overlap count_overlap(const ConstMaskView& predicted, const ConstMaskView& observed, SeenInRow&& seen_in_row) noexcept {
  static_assert(!is_liquid(0x7f) && is_liquid(0x80));
  Overlap sum;
  for (Index v = 0; v < predicted.rows(); ++v) {
    const std::uint8_t* p = predicted.data() + v * predicted.outerStride();
    const std::uint8_t* o = observed.data() + v * observed.outerStride();
    const auto seen = seen_in_row(v);
    std::uint32_t compared = 0, in_prediction = 0, in_observation = 0, in_both = 0;
    for (Index u = 0; u < predicted.cols(); ++u) {
      const auto s = static_cast<std::uint8_t>(seen(u) >> 7U);
      const auto a = static_cast<std::uint8_t>((p[u] >> 7U) & s);
      const auto b = static_cast<std::uint8_t>((o[u] >> 7U) & s);
      compared += s;
      in_prediction += a;
      in_observation += b;
      in_both += static_cast<std::uint8_t>(a & b);
    }
    sum.compared_px += compared;
    sum.predicted_px += in_prediction;
    sum.observed_px += in_observation;
    sum.both_px += in_both;
  }
  return sum;
}

}  // namespace detail

/// Compares all pixels of two masks. Masks of different sizes are flagged as not comparable.
inline Overlap overlap(const ConstMaskView& predicted, const ConstMaskView& observed) noexcept {
  if (predicted.rows() != observed.rows() || predicted.cols() != observed.cols()) {
    return {.comparable = false};
  }
  return detail::count_overlap(predicted, observed, [](Index) { return [](Index) { return std::uint8_t(255); }; });
}

/// Compares the pixels that `seen` marks (from 128 on, like liquid): what a second imager does not cover, or a hand
/// hides, is neither right nor wrong. All three masks have the same size.
inline Overlap overlap(const ConstMaskView& predicted, const ConstMaskView& observed,
                       const ConstMaskView& seen) noexcept {
  if (predicted.rows() != observed.rows() || predicted.cols() != observed.cols() || seen.rows() != observed.rows() ||
      seen.cols() != observed.cols()) {
    return {.comparable = false};
  }
  return detail::count_overlap(predicted, observed, [&seen](Index v) {
    return [row = seen.data() + v * seen.outerStride()](Index u) { return row[u]; };
  });
}

}  // namespace decant::inline DECANT_TARGET
