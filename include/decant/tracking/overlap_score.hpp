// SPDX-License-Identifier: MIT
#pragma once

/// Intersection over union of whole recordings, and of many recordings.

#include <cstdint>
#include <limits>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/tracking/overlap.hpp>

namespace decant::inline DECANT_TARGET {

struct OverlapScoreSettings {
  /// Frames whose union is smaller are left out of the mean over frames, >= 1. A jet's first drops cover some ten
  /// pixels, of which an edge that is off by one pixel takes half, so such frames measure noise. The union and not the
  /// observation is asked, so that a model cannot pour unseen liquid for free.
  std::int64_t least_union_px = 150;
};

/// One recording's score, frame by frame.
class OverlapScore {
 public:
  /// Throws std::invalid_argument if least_union_px is below 1.
  explicit OverlapScore(const OverlapScoreSettings& settings = {}) : settings_(settings) {
    expects(settings.least_union_px >= 1, "OverlapScore: least_union_px", ">= 1", settings.least_union_px);
  }

  void add(const Overlap& frame) noexcept {
    if (!frame.comparable || frame.compared_px == 0) {
      ++frames_not_comparable_;
      return;
    }
    pixels_ += frame;
    if (frame.union_px() < settings_.least_union_px) {
      ++frames_left_out_;
      return;
    }
    ++frames_;
    sum_ += frame.iou();
  }

  void reset() noexcept { *this = OverlapScore(settings_); }

  /// Mean over the frames that count, each with the same weight. NaN if there was none.
  double mean_over_frames() const noexcept {
    return frames_ > 0 ? sum_ / static_cast<double>(frames_) : std::numeric_limits<double>::quiet_NaN();
  }

  /// All intersections over all unions: each pixel has the same weight. No frame is left out for being small, since a
  /// sum is not upset by small frames; frames without liquid add nothing. NaN if there never was any liquid.
  double pooled_over_pixels() const noexcept {
    return pixels_.union_px() > 0 ? pixels_.iou() : std::numeric_limits<double>::quiet_NaN();
  }

  std::int64_t frames() const noexcept { return frames_; }                    ///< that the mean is over
  std::int64_t frames_left_out() const noexcept { return frames_left_out_; }  ///< for their small union
  /// Frames of which nothing was seen, or whose masks had different sizes; they are in neither score.
  std::int64_t frames_not_comparable() const noexcept { return frames_not_comparable_; }
  const Overlap& pixels() const noexcept { return pixels_; }  ///< sum over frames

 private:
  OverlapScoreSettings settings_;
  Overlap pixels_;
  double sum_ = 0;
  std::int64_t frames_ = 0;
  std::int64_t frames_left_out_ = 0;
  std::int64_t frames_not_comparable_ = 0;
};

/// The score of a set of recordings. Recordings in which no frame counts are counted and otherwise left out.
class RecordingsScore {
 public:
  void add(const OverlapScore& recording) noexcept {
    pixels_ += recording.pixels();
    if (recording.pixels().union_px() > 0) {
      ++pooled_recordings_;
      pooled_sum_ += recording.pooled_over_pixels();
    }
    if (recording.frames() > 0) {
      ++recordings_;
      sum_ += recording.mean_over_frames();
    } else {
      ++recordings_left_out_;
    }
  }

  /// Mean over recordings of their mean over frames: each recording has the same weight, however long it is.
  double mean_over_recordings() const noexcept { return ratio(sum_, recordings_); }
  /// Mean over recordings of their intersections over unions.
  double mean_of_pooled() const noexcept { return ratio(pooled_sum_, pooled_recordings_); }
  /// All intersections of all recordings over all unions: each pixel has the same weight, so that recordings with much
  /// visible liquid count most.
  double pooled_over_pixels() const noexcept {
    return pixels_.union_px() > 0 ? pixels_.iou() : std::numeric_limits<double>::quiet_NaN();
  }

  std::int64_t recordings() const noexcept { return recordings_; }  ///< that mean_over_recordings is over
  std::int64_t recordings_left_out() const noexcept { return recordings_left_out_; }

 private:
  static double ratio(double sum, std::int64_t count) noexcept {
    return count > 0 ? sum / static_cast<double>(count) : std::numeric_limits<double>::quiet_NaN();
  }

  Overlap pixels_;
  double sum_ = 0;
  double pooled_sum_ = 0;
  std::int64_t recordings_ = 0;
  std::int64_t pooled_recordings_ = 0;
  std::int64_t recordings_left_out_ = 0;
};

}  // namespace decant::inline DECANT_TARGET
