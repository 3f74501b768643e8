// SPDX-License-Identifier: MIT
#pragma once

/// Which way, and how far, a predicted silhouette has to be moved to become the observed one.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/types.hpp>

namespace decant {

/// Settings of SilhouetteTransport. Lengths are in pixels of the image.
struct SilhouetteTransportSettings {
  double cell_px = 4;          ///< pixels are taken together in squares of this side, >= 1
  double blur_px = 4;          ///< square root of the entropy's weight, > 0: what is finer is not told apart
  double reach_px = 40;        ///< moving mass farther costs more than to leave it unmatched, > blur_px
  int most_cells = 1500;       ///< of either silhouette; cells grow where there would be more, >= 16
  int iterations = 50;         ///< of the matching, >= 1
  int debias_iterations = 25;  ///< of the matching of the prediction with itself, >= 1
};

/// Unbalanced, debiased optimal transport between two masks: the sum of squared distances that pixels travel is the
/// least, softened by an entropy (Cuturi 2013, "Sinkhorn distances"), mass may stay unmatched (Chizat et al. 2018,
/// "Scaling algorithms for unbalanced optimal transport problems"), and what the entropy alone would move is taken off
/// (Feydy et al. 2019, "Interpolating between optimal transport and MMD using Sinkhorn divergences"), so that equal
/// masks give a displacement of exactly zero, whatever their shape.
class SilhouetteTransport {
 public:
  using Settings = SilhouetteTransportSettings;

  SilhouetteTransport() : SilhouetteTransport(Settings{}) {}

  /// Throws std::invalid_argument if a setting is out of range.
  explicit SilhouetteTransport(const Settings& settings) : settings_(settings) {
    expects(settings.cell_px >= 1 && settings.cell_px < 1e4, "SilhouetteTransport: cell_px", ">= 1 and < 10000",
            settings.cell_px);
    expects(settings.blur_px > 0 && settings.blur_px < 1e4, "SilhouetteTransport: blur_px", "> 0 and < 10000",
            settings.blur_px);
    expects(settings.reach_px > settings.blur_px && settings.reach_px < 1e5, "SilhouetteTransport: reach_px",
            "> blur_px and < 100000", settings.reach_px);
    expects(settings.most_cells >= 16 && settings.most_cells <= 100000, "SilhouetteTransport: most_cells",
            "16 .. 100000", settings.most_cells);
    expects(settings.iterations >= 1, "SilhouetteTransport: iterations", ">= 1", settings.iterations);
    expects(settings.debias_iterations >= 1, "SilhouetteTransport: debias_iterations", ">= 1",
            settings.debias_iterations);
  }

  /// Matches two masks of one size. @return false if either is empty: displacement() is then zero everywhere.
  bool match(ConstMaskView predicted, ConstMaskView observed, Threads threads = {}) {
    nodes_x_ = nodes_y_ = 0;
    collect(predicted, from_);
    collect(observed, to_);
    if (from_.size() == 0 || to_.size() == 0 || predicted.rows() != observed.rows() ||
        predicted.cols() != observed.cols()) {
      return false;
    }
    find_scales(threads);
    find_debiasing_scales(threads);
    tabulate(threads);
    return true;
  }

  /// How far [px] what is predicted at `pixel` has to move. Zero where nothing was predicted nearby, and for NaN.
  Eigen::Vector2d displacement(const Eigen::Vector2d& pixel) const noexcept {
    const double x = (pixel.x() - origin_.x()) / node_spacing_, y = (pixel.y() - origin_.y()) / node_spacing_;
    if (!(x >= 0 && y >= 0 && x <= nodes_x_ - 1 && y <= nodes_y_ - 1)) {
      return Eigen::Vector2d::Zero();
    }
    const int left = std::min(static_cast<int>(x), nodes_x_ - 2), top = std::min(static_cast<int>(y), nodes_y_ - 2);
    const double right_share = x - left, lower_share = y - top;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double weight = 0;
    for (int dy = 0; dy < 2; ++dy) {
      for (int dx = 0; dx < 2; ++dx) {
        const Node& node = nodes_[static_cast<std::size_t>((top + dy) * nodes_x_ + left + dx)];
        const double share = (dx == 1 ? right_share : 1 - right_share) * (dy == 1 ? lower_share : 1 - lower_share);
        if (node.valid) {
          sum += share * node.displacement;
          weight += share;
        }
      }
    }
    return weight > 0 ? Eigen::Vector2d(sum / weight) : Eigen::Vector2d::Zero();
  }

 private:
  /// Pixels of a silhouette taken together: where, and how many.
  struct Cells {
    Eigen::ArrayXd x, y, mass, log_scale;  ///< scale: v of the matching, or u0 of the prediction's with itself
    double side = 0;                       ///< of the squares [px]
    Index size() const noexcept { return x.size(); }
  };

  struct Node {
    Eigen::Vector2d displacement = Eigen::Vector2d::Zero();
    bool valid = false;
  };

  void collect(const ConstMaskView& mask, Cells& cells) {
    Index top = mask.rows(), bottom = -1, left = mask.cols(), right = -1;
    for (Index row = 0; row < mask.rows(); ++row) {
      for (Index column = 0; column < mask.cols(); ++column) {
        if (is_liquid(mask(row, column))) {
          top = std::min(top, row);
          bottom = std::max(bottom, row);
          left = std::min(left, column);
          right = std::max(right, column);
        }
      }
    }
    for (cells.side = settings_.cell_px;; cells.side *= 1.25) {
      const Index across =
          bottom < top ? 0 : static_cast<Index>(static_cast<double>(right - left + 1) / cells.side) + 1;
      const Index down = bottom < top ? 0 : static_cast<Index>(static_cast<double>(bottom - top + 1) / cells.side) + 1;
      sums_.assign(static_cast<std::size_t>(across * down), Eigen::Array3d::Zero());
      for (Index row = top; row <= bottom; ++row) {
        for (Index column = left; column <= right; ++column) {
          if (is_liquid(mask(row, column))) {
            const auto cell_row = static_cast<Index>(static_cast<double>(row - top) / cells.side);
            const auto cell_column = static_cast<Index>(static_cast<double>(column - left) / cells.side);
            sums_[static_cast<std::size_t>(cell_row * across + cell_column)] +=
                Eigen::Array3d(static_cast<double>(column), static_cast<double>(row), 1.0);
          }
        }
      }
      const auto count = static_cast<Index>(
          std::count_if(sums_.begin(), sums_.end(), [](const Eigen::Array3d& sum) { return sum[2] > 0; }));
      if (count > settings_.most_cells) {
        continue;
      }
      for (Eigen::ArrayXd* values : {&cells.x, &cells.y, &cells.mass, &cells.log_scale}) {
        values->resize(count);
      }
      Index next = 0;
      for (const Eigen::Array3d& sum : sums_) {
        if (sum[2] > 0) {
          cells.x[next] = sum[0] / sum[2];
          cells.y[next] = sum[1] / sum[2];
          cells.mass[next++] = sum[2];
        }
      }
      return;
    }
  }

  double entropy() const noexcept { return settings_.blur_px * settings_.blur_px; }

  /// Exponent of the scaling steps: mass that stays unmatched costs reach^2 per unit.
  double stiffness() const noexcept {
    const double reach_squared = settings_.reach_px * settings_.reach_px;
    return reach_squared / (reach_squared + entropy());
  }

  /// exp(-|x_i - y_j|^2 / entropy), with a floor that keeps what is far apart from becoming 0 / 0.
  void fill_kernel(const Cells& rows, const Cells& columns, Threads threads) {
    kernel_.resize(rows.size(), columns.size());
    const double rate = -1 / entropy();
    parallel_ranges(columns.size(), threads, 1, [&](Index begin, Index end) {
      for (Index j = begin; j < end; ++j) {
        kernel_.col(j) =
            (rate * ((rows.x - columns.x[j]).square() + (rows.y - columns.y[j]).square())).exp() + kernel_floor;
      }
    });
  }

  // A scale per cell of each side such that the plan u K v has the cells' masses, as far as reach allows.
  void find_scales(Threads threads) {
    fill_kernel(from_, to_, threads);
    u_.setOnes(from_.size());
    v_.setOnes(to_.size());
    const double power = stiffness();
    for (int iteration = 0; iteration < settings_.iterations; ++iteration) {
      product_.noalias() = kernel_.matrix() * v_.matrix();
      u_ = (from_.mass / product_.array()).pow(power);
      product_.noalias() = kernel_.matrix().transpose() * u_.matrix();
      v_ = (to_.mass / product_.array()).pow(power);
    }
    to_.log_scale = v_.log();
  }

  void find_debiasing_scales(Threads threads) {
    fill_kernel(from_, from_, threads);
    u_.setOnes(from_.size());
    const double power = stiffness();
    for (int iteration = 0; iteration < settings_.debias_iterations; ++iteration) {
      product_.noalias() = kernel_.matrix() * u_.matrix();
      // the symmetric problem has one scale; half steps in the logarithm converge where full ones swing
      u_ = (u_ * (from_.mass / product_.array()).pow(power)).sqrt();
    }
    from_.log_scale = u_.log();
  }

  /// What a point at p is matched with: the softmax of -|p - y|^2 / entropy + log scale.
  struct Match {
    Eigen::Vector2d place;  ///< mean [px]
    double log_total;       ///< logarithm of what the softmax is over
  };
  Match match_of(const Cells& cells, const Eigen::Vector2d& p, Eigen::ArrayXd& exponent) const noexcept {
    exponent = cells.log_scale - ((cells.x - p.x()).square() + (cells.y - p.y()).square()) / entropy();
    const double largest = exponent.maxCoeff();
    exponent = (exponent - largest).exp();
    const double total = exponent.sum();
    return {{(exponent * cells.x).sum() / total, (exponent * cells.y).sum() / total}, largest + std::log(total)};
  }

  /// How far what is at p has to go. Of a point whose match is at distance D, exp(-(D / reach)^2) is matched at all:
  /// what is so far that less than 1 / e would be, is left where it is by and by.
  Eigen::Vector2d displacement_at(const Eigen::Vector2d& p, Eigen::ArrayXd& exponent) const noexcept {
    const Match target = match_of(to_, p, exponent), self = match_of(from_, p, exponent);
    const double full_cell = from_.side * from_.side;
    const double log_matched = (1 - stiffness()) * (target.log_total - std::log(full_cell));
    return std::min(1.0, std::exp(1 + log_matched)) * (target.place - self.place);
  }

  /// The displacement on a grid around the prediction, to be interpolated.
  void tabulate(Threads threads) {
    node_spacing_ = std::max(from_.side, 1.0);
    origin_ = {from_.x.minCoeff() - margin_nodes * node_spacing_, from_.y.minCoeff() - margin_nodes * node_spacing_};
    nodes_x_ = static_cast<int>((from_.x.maxCoeff() - origin_.x()) / node_spacing_) + 1 + margin_nodes + 1;
    nodes_y_ = static_cast<int>((from_.y.maxCoeff() - origin_.y()) / node_spacing_) + 1 + margin_nodes + 1;
    nodes_.assign(static_cast<std::size_t>(nodes_x_) * static_cast<std::size_t>(nodes_y_), Node{});
    for (Index cell = 0; cell < from_.size(); ++cell) {
      const int column = static_cast<int>((from_.x[cell] - origin_.x()) / node_spacing_);
      const int row = static_cast<int>((from_.y[cell] - origin_.y()) / node_spacing_);
      for (int y = std::max(row - 1, 0); y <= std::min(row + 2, nodes_y_ - 1); ++y) {
        for (int x = std::max(column - 1, 0); x <= std::min(column + 2, nodes_x_ - 1); ++x) {
          nodes_[static_cast<std::size_t>(y * nodes_x_ + x)].valid = true;
        }
      }
    }
    parallel_ranges(nodes_y_, threads, 1, [&](Index begin, Index end) {
      Eigen::ArrayXd exponent;
      for (Index row = begin; row < end; ++row) {
        for (int column = 0; column < nodes_x_; ++column) {
          Node& node = nodes_[static_cast<std::size_t>(row * nodes_x_ + column)];
          if (node.valid) {
            const Eigen::Vector2d p = origin_ + node_spacing_ * Eigen::Vector2d(column, static_cast<double>(row));
            node.displacement = displacement_at(p, exponent);
          }
        }
      }
    });
  }

  static constexpr double kernel_floor = 1e-20;
  static constexpr int margin_nodes = 2;

  Settings settings_;
  Cells from_{}, to_{};
  std::vector<Eigen::Array3d> sums_{};
  Eigen::ArrayXXd kernel_{};
  Eigen::ArrayXd u_{}, v_{};
  Eigen::VectorXd product_{};
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();
  double node_spacing_ = 1;
  int nodes_x_ = 0, nodes_y_ = 0;
  std::vector<Node> nodes_{};
};

}  // namespace decant
