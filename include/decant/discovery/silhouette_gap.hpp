// SPDX-License-Identifier: MIT
#pragma once

/// How far two films of silhouettes differ, by measures that need no knowledge of what differs anyway.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/discovery/silhouette_series.hpp>

namespace decant::inline DECANT_TARGET {

namespace detail {

/// Shares of one frame, rows x columns.
inline Eigen::ArrayXXf shares_of(const SilhouetteSeries& series, std::size_t frame) {
  Eigen::ArrayXXf result(series.rows(), series.columns());
  for (Eigen::Index row = 0; row < series.rows(); ++row) {
    for (Eigen::Index column = 0; column < series.columns(); ++column) {
      result(row, column) = series.share(frame, row, column);
    }
  }
  return result;
}

/// Each cell's mean with its neighbours, 1 2 1 in both directions; dry beyond the border.
inline Eigen::ArrayXXf blurred(const Eigen::ArrayXXf& shares) {
  const Eigen::Index rows = shares.rows(), columns = shares.cols();
  Eigen::ArrayXXf across = 2 * shares;
  across.rightCols(columns - 1) += shares.leftCols(columns - 1);
  across.leftCols(columns - 1) += shares.rightCols(columns - 1);
  Eigen::ArrayXXf both = 2 * across;
  both.bottomRows(rows - 1) += across.topRows(rows - 1);
  both.topRows(rows - 1) += across.bottomRows(rows - 1);
  return both / 16;
}

/// f(recorded, predicted) for each camera's frames that the recording has, as shares.
template <class Function>
void for_each_seen_frame(std::span<const SilhouetteSeries> recording, std::span<const SilhouetteSeries> prediction,
                         Function&& f) {
  expects(recording.size() == prediction.size(), "silhouette gap: cameras", "those of the recording",
          prediction.size());
  for (std::size_t camera = 0; camera < recording.size(); ++camera) {
    const SilhouetteSeries &own = recording[camera], &other = prediction[camera];
    expects(own.frames() == other.frames() && own.rows() == other.rows() && own.columns() == other.columns(),
            "silhouette gap: frames and cells", "those of the recording", other.frames());
    for (std::size_t frame = 0; frame < own.frames(); ++frame) {
      if (own.seen(frame)) {
        f(shares_of(own, frame), shares_of(other, frame));
      }
    }
  }
}

}  // namespace detail

/// One less the intersection over union of silhouettes in cells, sum of min over sum of max, in the mean over frames of
/// all cameras that have liquid in at least `least_cells` cells; 0 if none has. It says little about small differences,
/// as half of it is noise at edges, and is robust where a solver is no liquid.
/// @param recording by camera; frames that its cameras did not see are left out. @param prediction of the same cameras
/// and frames. Throws std::invalid_argument if they are others.
inline double overlap_gap(std::span<const SilhouetteSeries> recording, std::span<const SilhouetteSeries> prediction,
                          double least_cells = 2) {
  double sum = 0;
  int frames = 0;
  detail::for_each_seen_frame(recording, prediction, [&](const Eigen::ArrayXXf& own, const Eigen::ArrayXXf& other) {
    const double all = static_cast<double>(own.max(other).sum());
    if (all >= least_cells && all > 0) {
      sum += 1 - static_cast<double>(own.min(other).sum()) / all;
      ++frames;
    }
  });
  return frames > 0 ? sum / frames : 0;
}

/// Sum of absolute differences of blurred silhouettes, over that of both silhouettes: 0 if they are the same, 1 if they
/// are nowhere near each other. Over all frames and cameras together, as overlap_gap.
inline double blurred_gap(std::span<const SilhouetteSeries> recording, std::span<const SilhouetteSeries> prediction) {
  double off = 0, all = 0;
  detail::for_each_seen_frame(recording, prediction, [&](const Eigen::ArrayXXf& own, const Eigen::ArrayXXf& other) {
    const Eigen::ArrayXXf first = detail::blurred(own), second = detail::blurred(other);
    off += static_cast<double>((first - second).abs().sum());
    all += static_cast<double>((first + second).sum());
  });
  return all > 0 ? off / all : 0;
}

}  // namespace decant::inline DECANT_TARGET
