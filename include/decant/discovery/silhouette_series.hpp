// SPDX-License-Identifier: MIT
#pragma once

/// What a camera saw of an interaction, or would have seen, small enough to keep of hundreds of simulations.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/target.hpp>
#include <decant/tracking/silhouette_cells.hpp>

namespace decant::inline DECANT_TARGET {

/// Shares of liquid in square cells of an image, frame by frame, one byte each.
class SilhouetteSeries {
 public:
  /// @param width, height of the image [px]. @param cell_px side of a cell; those at the border may be smaller.
  /// Throws std::invalid_argument if one of them is less than 1.
  SilhouetteSeries(int width, int height, int cell_px = 10) : cells_(cell_px), cell_px_(cell_px) {
    expects(width >= 1 && height >= 1, "SilhouetteSeries: width and height", ">= 1", std::min(width, height));
    columns_ = (width + cell_px - 1) / cell_px;
    rows_ = (height + cell_px - 1) / cell_px;
    width_ = width;
    height_ = height;
  }

  /// Adds a frame. @param time [s], later than those before. @param mask of the image's size, cleaned.
  void add(double time, const ConstMaskView& mask) {
    expects(mask.cols() == width_ && mask.rows() == height_, "SilhouetteSeries: size of a mask", "that of the image",
            mask.cols());
    begin(time, true);
    const SilhouetteCells::Shares shares = cells_.shares(mask);
    for (Eigen::Index row = 0; row < rows_; ++row) {
      for (Eigen::Index column = 0; column < columns_; ++column) {
        share_.push_back(static_cast<std::uint8_t>(std::lround(255 * shares(row, column))));
      }
    }
  }
  /// Adds a frame in which nothing can be believed: there is no mask, or the camera failed.
  void add_unseen(double time) {
    begin(time, false);
    share_.resize(share_.size() + cells(), 0);
  }

  std::size_t frames() const noexcept { return time_.size(); }
  Eigen::Index rows() const noexcept { return rows_; }
  Eigen::Index columns() const noexcept { return columns_; }
  int cell_px() const noexcept { return cell_px_; }
  double time(std::size_t frame) const { return time_.at(frame); }
  bool seen(std::size_t frame) const { return seen_.at(frame) != 0; }
  /// 0 .. 1; 0 in frames that were not seen.
  float share(std::size_t frame, Eigen::Index row, Eigen::Index column) const noexcept {
    return static_cast<float>(byte(frame, row, column)) / 255;
  }

  /// As numbers, for an Executor or a Journal, and back into a series of the same image and frames, which says the size
  /// and when frames are. Cells' bytes one after another, with -n for n that are dry: most are.
  std::vector<double> numbers() const {
    std::vector<double> result;
    for (std::size_t k = 0; k < share_.size();) {
      const auto wet = std::find_if(share_.begin() + static_cast<std::ptrdiff_t>(k), share_.end(),
                                    [](std::uint8_t share) { return share != 0; });
      const auto next = static_cast<std::size_t>(wet - share_.begin());
      if (next > k) {
        result.push_back(-static_cast<double>(next - k));
        k = next;
      } else {
        result.push_back(share_[k++]);
      }
    }
    return result;
  }
  /// Throws std::invalid_argument if they are none of such a series.
  SilhouetteSeries with_numbers(std::span<const double> numbers) const {
    SilhouetteSeries other = *this;
    other.share_.clear();
    for (const double number : numbers) {
      const double left = static_cast<double>(share_.size() - other.share_.size());
      expects(number == std::floor(number) && number <= 255 && number >= -left && left >= 1, "SilhouetteSeries: number",
              "a byte, or minus how many cells are dry", number);
      if (number < 0) {
        other.share_.resize(other.share_.size() + static_cast<std::size_t>(-number), 0);
      } else {
        other.share_.push_back(static_cast<std::uint8_t>(number));
      }
    }
    expects(other.share_.size() == share_.size(), "SilhouetteSeries: cells of the numbers", "as many as of the series",
            other.share_.size());
    return other;
  }

 private:
  std::size_t cells() const noexcept { return static_cast<std::size_t>(rows_ * columns_); }
  std::uint8_t byte(std::size_t frame, Eigen::Index row, Eigen::Index column) const noexcept {
    return share_[frame * cells() + static_cast<std::size_t>(row * columns_ + column)];
  }
  void begin(double time, bool seen) {
    expects(std::isfinite(time) && (time_.empty() || time > time_.back()), "SilhouetteSeries: time [s]",
            "finite and increasing", time);
    time_.push_back(time);
    seen_.push_back(seen ? 1 : 0);
  }

  SilhouetteCells cells_;
  int cell_px_;
  Eigen::Index width_ = 0, height_ = 0, columns_ = 0, rows_ = 0;
  std::vector<double> time_{};
  std::vector<std::uint8_t> seen_{};
  std::vector<std::uint8_t> share_{};  ///< rows x columns of each frame
};

}  // namespace decant::inline DECANT_TARGET
