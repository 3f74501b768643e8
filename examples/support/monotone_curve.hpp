// SPDX-License-Identifier: MIT
#pragma once

/// A smooth curve that rises, through readings with noise: what a container holds by height, a sensor's calibration.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include <decant/core/expects.hpp>

namespace example {

/// f(x) with a slope that is linear between even knots, so that f is a quadratic spline: the one with the smallest
///   sum_i (y_i - f(x_i))^2 + lambda sum_k (slope_(k-1) - 2 slope_k + slope_(k+1))^2.
/// lambda is the one by which each reading, but for the outermost, is best predicted from the others (leave-one-out
/// cross-validation; Craven and Wahba 1979), among those with which f rises everywhere. The smoothest curve that lambda
/// can ask for has an even change of slope.
class MonotoneCurve {
 public:
  struct Reading {
    double x, y;
  };

  /// @param readings at least 4, in any order, at three x or more; y has an even deviation. @param through_first makes
  /// f pass through the first one exactly, and counts it for nothing else. Throws std::invalid_argument, also if no
  /// curve that rises comes close to the readings.
  explicit MonotoneCurve(const std::vector<Reading>& readings, bool through_first = false, int pieces = 24) {
    decant::expects(readings.size() >= 4, "MonotoneCurve: number of readings", ">= 4", readings.size());
    decant::expects(pieces >= 2, "MonotoneCurve: number of pieces", ">= 2", pieces);
    double low_y = readings.front().y, high_y = low_y;
    begin_ = end_ = readings.front().x;
    for (const Reading& reading : readings) {
      decant::expects(std::isfinite(reading.x) && std::isfinite(reading.y), "MonotoneCurve: reading", "finite",
                      reading.x + reading.y);
      begin_ = std::min(begin_, reading.x);
      end_ = std::max(end_, reading.x);
      low_y = std::min(low_y, reading.y);
      high_y = std::max(high_y, reading.y);
    }
    decant::expects(end_ > begin_ && high_y > low_y, "MonotoneCurve: range of readings", "more than one number",
                    high_y - low_y);
    decant::expects(std::any_of(readings.begin(), readings.end(),
                                [&](const Reading& reading) { return reading.x > begin_ && reading.x < end_; }),
                    "MonotoneCurve: number of readings between the outermost", ">= 1", 0);
    piece_ = (end_ - begin_) / pieces;
    choose(readings, through_first, pieces, high_y - low_y);
  }

  double begin() const { return begin_; }
  double end() const { return end_; }

  /// Beyond the readings the slope stays.
  double value(double x) const {
    const auto [k, u] = place(x);
    const double within = u * slope_[k] + 0.5 * u * u * (slope_[k + 1] - slope_[k]);
    const double beyond = x < begin_ ? (x - begin_) * slope_.front() : x > end_ ? (x - end_) * slope_.back() : 0.0;
    return at_knot_[k] + piece_ * within + beyond;
  }
  double slope(double x) const {
    const auto [k, u] = place(x);
    return std::lerp(slope_[k], slope_[k + 1], u);
  }
  /// The x between begin() and end() at which the curve is closest to y.
  double inverse(double y) const {
    double low = begin_, high = end_;
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + high);
      (value(middle) < y ? low : high) = middle;
    }
    return 0.5 * (low + high);
  }

  /// Of what a reading between the outermost is off by when it is predicted from the others: root mean square.
  double left_out_error() const { return left_out_error_; }

 private:
  std::pair<std::size_t, double> place(double x) const {
    const double at = std::clamp((x - begin_) / piece_, 0.0, static_cast<double>(slope_.size() - 1));
    const std::size_t k = std::min(static_cast<std::size_t>(at), slope_.size() - 2);
    return {k, at - static_cast<double>(k)};
  }

  // Unknowns are the slopes at the knots, in units of `range` per piece, and f at the beginning.
  void choose(const std::vector<Reading>& readings, bool through_first, int pieces, double range) {
    const Eigen::Index knots = pieces + 1, unknowns = knots + 1;
    const auto row_of = [&](double x) {
      Eigen::VectorXd row = Eigen::VectorXd::Zero(unknowns);
      row[knots] = 1;
      for (Eigen::Index k = 0; k < pieces; ++k) {
        const double u = std::clamp((x - begin_) / piece_ - static_cast<double>(k), 0.0, 1.0);
        row[k] += u - 0.5 * u * u;
        row[k + 1] += 0.5 * u * u;
      }
      return row;
    };
    const auto count = static_cast<Eigen::Index>(readings.size());
    Eigen::MatrixXd rows(count, unknowns);
    Eigen::VectorXd right(count), weight = Eigen::VectorXd::Ones(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const Reading& reading = readings[static_cast<std::size_t>(i)];
      rows.row(i) = row_of(reading.x).transpose();
      right[i] = reading.y / range;
    }
    weight[0] = through_first ? 1e9 : 1;
    Eigen::MatrixXd roughness = Eigen::MatrixXd::Zero(unknowns, unknowns);
    for (Eigen::Index k = 1; k + 1 < knots; ++k) {
      Eigen::VectorXd bend = Eigen::VectorXd::Zero(unknowns);
      bend[k - 1] = bend[k + 1] = 1;
      bend[k] = -2;
      roughness += bend * bend.transpose();
    }
    left_out_error_ = std::numeric_limits<double>::infinity();
    for (double exponent = -6; exponent <= 6; exponent += 0.25) {
      const Eigen::MatrixXd normal =
          rows.transpose() * weight.asDiagonal() * rows + std::pow(10.0, exponent) * roughness;
      const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
      const Eigen::VectorXd solution = solver.solve(rows.transpose() * weight.asDiagonal() * right);
      if (solver.info() != Eigen::Success || !solution.allFinite() || !(solution.head(knots).minCoeff() > 0)) {
        continue;
      }
      double squares = 0;
      int counted = 0;
      for (Eigen::Index i = through_first ? 1 : 0; i < count; ++i) {
        const double x = readings[static_cast<std::size_t>(i)].x;
        if (x > begin_ && x < end_) {
          const double own_share = rows.row(i).dot(solver.solve(Eigen::VectorXd(rows.row(i).transpose())));
          const double off = (right[i] - rows.row(i).dot(solution)) / std::max(1e-9, 1 - own_share);
          squares += off * off;
          ++counted;
        }
      }
      const double error = range * std::sqrt(squares / counted);
      if (error < left_out_error_) {
        left_out_error_ = error;
        take(range * solution);
      }
    }
    decant::expects(std::isfinite(left_out_error_), "MonotoneCurve: readings", "such that they rise", left_out_error_);
  }

  void take(const Eigen::VectorXd& solution) {
    const auto knots = static_cast<std::size_t>(solution.size() - 1);
    slope_.resize(knots);
    at_knot_.assign(knots, solution[solution.size() - 1]);
    for (std::size_t k = 0; k < knots; ++k) {
      slope_[k] = solution[static_cast<Eigen::Index>(k)] / piece_;
      if (k > 0) {
        at_knot_[k] = at_knot_[k - 1] + 0.5 * piece_ * (slope_[k - 1] + slope_[k]);
      }
    }
  }

  double begin_ = 0, end_ = 0, piece_ = 1, left_out_error_ = 0;
  std::vector<double> slope_{}, at_knot_{};  // at the knots
};

}  // namespace example
