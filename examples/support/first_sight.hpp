// SPDX-License-Identifier: MIT
#pragma once

/// When and where something can be seen first: what an answer to "where does it begin?" is scored by.

#include <optional>

#include <Eigen/Core>

#include <decant/core/image.hpp>

namespace example {

/// Compares clean masks with and without what is hidden: in squares of 20 pixels, over four frames. It is seen from the
/// first four frames on in which they differ by 0.3 of a square, if that square differs by as much in the next four,
/// too: single drops do not.
class FirstSight {
 public:
  struct Sight {
    double time;         ///< of the first of the four frames [s]
    Eigen::Vector2d px;  ///< middle of what differs, by how much it does
  };

  /// The next frame's masks, of one size throughout. Once it is found, others change nothing.
  void add(double time, const decant::Mask& with, const decant::Mask& without) {
    if (found_) {
      return;
    }
    if (count_ == 0) {
      begin_ = time;
      now_.setZero((with.rows() + square - 1) / square, (with.cols() + square - 1) / square);
    }
    for (Eigen::Index row = 0; row < with.rows(); ++row) {
      for (Eigen::Index column = 0; column < with.cols(); ++column) {
        now_(row / square, column / square) +=
            decant::is_liquid(with(row, column)) - decant::is_liquid(without(row, column));
      }
    }
    if (++count_ == frames) {
      now_ = now_.abs() / (frames * square * square);
      if (before_.size() > 0 && (now_.min(before_) >= least).any()) {
        found_ = Sight{before_begin_, middle_of(before_)};
      }
      before_ = now_;
      before_begin_ = begin_;
      count_ = 0;
    }
  }

  /// None where nothing can be seen.
  const std::optional<Sight>& found() const { return found_; }

 private:
  static constexpr int square = 20, frames = 4;
  static constexpr double least = 0.3;

  static Eigen::Vector2d middle_of(const Eigen::ArrayXXd& differs) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double total = 0;
    for (Eigen::Index row = 0; row < differs.rows(); ++row) {
      for (Eigen::Index column = 0; column < differs.cols(); ++column) {
        if (differs(row, column) >= least) {
          const Eigen::Vector2d corner(static_cast<double>(column), static_cast<double>(row));
          sum += differs(row, column) * (square * (corner.array() + 0.5) - 0.5).matrix();
          total += differs(row, column);
        }
      }
    }
    return sum / total;
  }

  int count_ = 0;
  double begin_ = 0, before_begin_ = 0;  ///< of these four frames and of those before them [s]
  Eigen::ArrayXXd now_{}, before_{};     ///< shares by square
  std::optional<Sight> found_{};
};

}  // namespace example
