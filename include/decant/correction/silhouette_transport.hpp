// SPDX-License-Identifier: MIT
#pragma once

/// Which way, and how far, a predicted silhouette has to be moved to become the observed one.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/batch.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/pixel_box.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/coverage/detail/liquid_box.hpp>

namespace decant::inline DECANT_TARGET {

/// Settings of SilhouetteTransport. Lengths are in pixels of the image.
struct SilhouetteTransportSettings {
  double cell_px = 4;          ///< distance of the grid's nodes, which stand for the pixels around them, >= 1
  double blur_px = 4;          ///< square root of the entropy's weight, > 0: what is finer is not told apart
  double reach_px = 40;        ///< moving mass farther costs more than to leave it unmatched, > blur_px
  int most_nodes = 20000;      ///< of the grid around both silhouettes; cells grow where there would be more, >= 100
  int iterations = 25;         ///< of the matching, >= 1; as many again change no score
  int debias_iterations = 12;  ///< of the matching of the prediction with itself, >= 1
};

/// Unbalanced, debiased optimal transport between two masks: the sum of squared distances that pixels travel is the
/// least, softened by an entropy (Cuturi 2013, "Sinkhorn distances"), mass may stay unmatched (Chizat et al. 2018,
/// "Scaling algorithms for unbalanced optimal transport problems"), and what the entropy alone would move is taken off
/// (Feydy et al. 2019, "Interpolating between optimal transport and MMD using Sinkhorn divergences"), so that equal
/// masks give a displacement of exactly zero, whatever their shape.
/// Masks are spread to the nodes of one grid, which keeps their centroids, and on a grid the kernel
/// exp(-|x - y|^2 / blur^2) is a convolution along rows and one along columns (Solomon et al. 2015, "Convolutional
/// Wasserstein distances"): the cost per iteration grows with the nodes and not with their square. Beyond seven blurs
/// the kernel is cut off.
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
    expects(settings.most_nodes >= 100 && settings.most_nodes <= 10000000, "SilhouetteTransport: most_nodes",
            "100 .. 10000000", settings.most_nodes);
    expects(settings.iterations >= 1, "SilhouetteTransport: iterations", ">= 1", settings.iterations);
    expects(settings.debias_iterations >= 1, "SilhouetteTransport: debias_iterations", ">= 1",
            settings.debias_iterations);
  }

  /// Matches two masks of one size. @return false if either is empty: displacement() is then zero everywhere.
  bool match(ConstMaskView predicted, ConstMaskView observed) {
    nodes_x_ = nodes_y_ = 0;
    if (predicted.rows() != observed.rows() || predicted.cols() != observed.cols()) {
      return false;
    }
    const PixelBox of_predicted = detail::liquid_box(predicted), of_observed = detail::liquid_box(observed);
    if (of_predicted.empty() || of_observed.empty()) {
      return false;
    }
    const PixelBox box = of_predicted.hull(of_observed);
    lay_grid(box);
    spread(predicted, of_predicted, from_);
    spread(observed, of_observed, to_);
    find_scales();
    find_debiasing_scales();
    find_displacements();
    return true;
  }

  /// How far [px] what is predicted at `pixel` has to move. Zero where nothing was predicted nearby, and for NaN.
  Eigen::Vector2d displacement(const Eigen::Vector2d& pixel) const noexcept {
    const double x = (pixel.x() - origin_.x()) / spacing_, y = (pixel.y() - origin_.y()) / spacing_;
    if (!(x >= 0 && y >= 0 && x <= static_cast<double>(nodes_x_ - 1) && y <= static_cast<double>(nodes_y_ - 1))) {
      return Eigen::Vector2d::Zero();
    }
    const Index left = std::min(static_cast<Index>(x), nodes_x_ - 2),
                top = std::min(static_cast<Index>(y), nodes_y_ - 2);
    const double right_share = x - static_cast<double>(left), lower_share = y - static_cast<double>(top);
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double weight = 0;
    for (Index dy = 0; dy < 2; ++dy) {
      for (Index dx = 0; dx < 2; ++dx) {
        const double share = (dx == 1 ? right_share : 1 - right_share) * (dy == 1 ? lower_share : 1 - lower_share);
        if (near_prediction_(top + dy, left + dx)) {
          sum += share * Eigen::Vector2d(shift_x_(top + dy, left + dx), shift_y_(top + dy, left + dx));
          weight += share;
        }
      }
    }
    return weight > 0 ? Eigen::Vector2d(sum / weight) : Eigen::Vector2d::Zero();
  }

 private:
  using Grid = Eigen::Array<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  /// A silhouette on the grid.
  struct Silhouette {
    std::vector<Index> nodes{};      ///< that have mass
    Eigen::ArrayXd mass{}, scale{};  ///< of these [px^2]; scale: v of the matching, or u0 of the prediction with itself
  };

  void lay_grid(const PixelBox& box) {
    const auto width = static_cast<double>(box.width() - 1), height = static_cast<double>(box.height() - 1);
    for (spacing_ = settings_.cell_px;; spacing_ *= 1.25) {
      nodes_x_ = static_cast<Index>(width / spacing_) + 2 + 2 * margin_nodes;
      nodes_y_ = static_cast<Index>(height / spacing_) + 2 + 2 * margin_nodes;
      if (nodes_x_ * nodes_y_ <= settings_.most_nodes) {
        break;
      }
    }
    origin_ = {static_cast<double>(box.u_begin) - margin_nodes * spacing_,
               static_cast<double>(box.v_begin) - margin_nodes * spacing_};
    // the blur grows with the nodes' distance: a kernel narrower than that would not see its neighbors
    blur_ = settings_.blur_px * spacing_ / settings_.cell_px;
    const auto radius = static_cast<Index>(std::sqrt(-std::log(kernel_floor)) * blur_ / spacing_);
    weights_.resize(radius + 1);
    for (Index k = 0; k <= radius; ++k) {
      weights_[k] = std::exp(-std::pow(static_cast<double>(k) * spacing_ / blur_, 2));
    }
    for (Grid* grid : {&values_, &product_, &shift_x_, &shift_y_}) {
      grid->resize(nodes_y_, nodes_x_);
    }
  }

  /// Each pixel's mass goes to the four nodes around it, by its distance to them: the centroid stays where it is.
  void spread(const ConstMaskView& mask, const PixelBox& box, Silhouette& silhouette) {
    values_.setZero();
    for (Index row = box.v_begin; row < box.v_end; ++row) {
      const double y = (static_cast<double>(row) - origin_.y()) / spacing_;
      const auto top = static_cast<Index>(y);
      const double lower_share = y - static_cast<double>(top);
      for (Index column = box.u_begin; column < box.u_end; ++column) {
        if (is_liquid(mask(row, column))) {
          const double x = (static_cast<double>(column) - origin_.x()) / spacing_;
          const auto left = static_cast<Index>(x);
          const double right_share = x - static_cast<double>(left);
          values_(top, left) += (1 - lower_share) * (1 - right_share);
          values_(top, left + 1) += (1 - lower_share) * right_share;
          values_(top + 1, left) += lower_share * (1 - right_share);
          values_(top + 1, left + 1) += lower_share * right_share;
        }
      }
    }
    silhouette.nodes.clear();
    for (Index node = 0; node < values_.size(); ++node) {
      if (values_.data()[node] > 0) {
        silhouette.nodes.push_back(node);
      }
    }
    gather(values_, silhouette.nodes, silhouette.mass);
    silhouette.scale.setOnes(silhouette.mass.size());
  }

  static void gather(const Grid& grid, const std::vector<Index>& nodes, Eigen::ArrayXd& values) {
    values.resize(static_cast<Index>(nodes.size()));
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      values[static_cast<Index>(k)] = grid.data()[nodes[k]];
    }
  }

  /// product = kernel * values, on all nodes. Some columns at a time stay in registers for all weights, and each node's
  /// terms are added from the nearest to the farthest.
  void convolve(const Grid& values, Grid& product) {
    const Index radius = weights_.size() - 1;
    const Index stride = (nodes_x_ + block_columns - 1) / block_columns * block_columns;
    padded_.setZero(stride + 2 * radius);
    rows_done_.resize(nodes_y_ * stride);
    for (Index row = 0; row < nodes_y_; ++row) {
      double* const out = rows_done_.data() + row * stride;
      if ((values.row(row) == 0).all()) {
        std::fill_n(out, stride, 0.0);
        continue;
      }
      std::copy_n(&values(row, 0), nodes_x_, padded_.data() + radius);
      for (Index column = 0; column < stride; column += block_columns) {
        const double* const from = padded_.data() + radius + column;
        Block sum = load(from);
        for (Index k = 1; k <= radius; ++k) {
          add(weights_[k], from + k, sum);
          add(weights_[k], from - k, sum);
        }
        store(sum, out + column);
      }
    }
    product.resize(nodes_y_, nodes_x_);
    std::array<double, block_columns> last;
    for (Index row = 0; row < nodes_y_; ++row) {
      for (Index column = 0; column < nodes_x_; column += block_columns) {
        const double* const from = rows_done_.data() + row * stride + column;
        Block sum = load(from);
        for (Index k = 1; k <= std::min(radius, nodes_y_ - 1); ++k) {
          if (row + k < nodes_y_) {
            add(weights_[k], from + k * stride, sum);
          }
          if (row >= k) {
            add(weights_[k], from - k * stride, sum);
          }
        }
        double* const out = &product(row, column);
        if (column + block_columns <= nodes_x_) {
          store(sum, out);
        } else {
          store(sum, last.data());
          std::copy_n(last.data(), nodes_x_ - column, out);
        }
      }
    }
  }

  using B = Batch<double>;
  static constexpr std::size_t block_batches = 4;
  static constexpr Index block_columns = static_cast<Index>(block_batches) * B::width;
  using Block = std::array<B, block_batches>;

  [[gnu::always_inline]] static Block load(const double* from) noexcept {
    return [from]<std::size_t... batch>(std::index_sequence<batch...>) {
      return Block{B::load(from + static_cast<Index>(batch) * B::width)...};
    }
    (std::make_index_sequence<block_batches>{});
  }
  [[gnu::always_inline]] static void store(const Block& block, double* to) noexcept {
    for (std::size_t batch = 0; batch < block_batches; ++batch) {
      block[batch].store(to + static_cast<Index>(batch) * B::width);
    }
  }
  [[gnu::always_inline]] static void add(double weight, const double* from, Block& sum) noexcept {
    const B factor(weight);
    for (std::size_t batch = 0; batch < block_batches; ++batch) {
      sum[batch] = multiply_add(factor, B::load(from + static_cast<Index>(batch) * B::width), sum[batch]);
    }
  }

  void scatter(const Silhouette& silhouette, const Eigen::ArrayXd& values) {
    values_.setZero();
    for (std::size_t k = 0; k < silhouette.nodes.size(); ++k) {
      values_.data()[silhouette.nodes[k]] = values[static_cast<Index>(k)];
    }
  }

  /// Kernel times what `at` has on its nodes, for the nodes of `asked`. The floor keeps what is far apart from
  /// becoming 0 / 0.
  const Eigen::ArrayXd& spread_scale(const Silhouette& at, const Eigen::ArrayXd& scale, const Silhouette& asked) {
    scatter(at, scale);
    convolve(values_, product_);
    gather(product_, asked.nodes, gathered_);
    gathered_ += kernel_floor * scale.sum();
    return gathered_;
  }

  /// Exponent of the scaling steps: mass that stays unmatched costs reach^2 per unit.
  double stiffness() const noexcept {
    const double reach_squared = settings_.reach_px * settings_.reach_px;
    return reach_squared / (reach_squared + blur_ * blur_);
  }

  /// Values >= 0 to a power > 0, to some 1e-13: the last bits, which pow() has right, take most of its time.
  template <class Values>
  static auto raised(const Values& values, double power) {
    return (power * values.log()).exp();
  }

  // A scale per node of each side such that the plan u K v has the nodes' masses, as far as reach allows.
  void find_scales() {
    const double power = stiffness();
    for (int iteration = 0; iteration < settings_.iterations; ++iteration) {
      from_.scale = raised(from_.mass / spread_scale(to_, to_.scale, from_), power);
      to_.scale = raised(to_.mass / spread_scale(from_, from_.scale, to_), power);
    }
  }

  void find_debiasing_scales() {
    from_.scale.setOnes();
    const double power = stiffness();
    for (int iteration = 0; iteration < settings_.debias_iterations; ++iteration) {
      // the symmetric problem has one scale; half steps in the logarithm converge where full ones swing
      from_.scale = (from_.scale * raised(from_.mass / spread_scale(from_, from_.scale, from_), power)).sqrt();
    }
  }

  /// Adds to the shifts, with a sign, the mean place that each node is matched with by the weights K scale. @param
  /// total gets the sum of the weights.
  void add_matches(const Silhouette& silhouette, double sign, Grid& total) {
    const auto moment = [&](Index axis, Grid& shift) {
      moments_.resize(silhouette.scale.size());
      for (std::size_t k = 0; k < silhouette.nodes.size(); ++k) {
        const Index node = silhouette.nodes[k];
        const Index place = axis == 0 ? node % nodes_x_ : node / nodes_x_;
        moments_[static_cast<Index>(k)] = silhouette.scale[static_cast<Index>(k)] * static_cast<double>(place);
      }
      scatter(silhouette, moments_);
      convolve(values_, product_);
      shift = (total > smallest_total).select(shift + sign * spacing_ * product_ / total, shift);
    };
    scatter(silhouette, silhouette.scale);
    convolve(values_, product_);
    total = product_;
    moment(0, shift_x_);
    moment(1, shift_y_);
  }

  /// How far what is at a node has to go. Of what has its match at distance D, exp(-(D / reach)^2) is matched at all:
  /// what is so far that less than 1 / e would be, is left where it is by and by.
  void find_displacements() {
    shift_x_.setZero();
    shift_y_.setZero();
    add_matches(from_, -1, total_self_);
    add_matches(to_, 1, total_);
    const double full_cell = spacing_ * spacing_;
    const Grid matched = (std::exp(1.0) * raised(total_ / full_cell, 1 - stiffness())).min(1.0);
    const auto known = total_ > smallest_total && total_self_ > smallest_total;
    shift_x_ = known.select(matched * shift_x_, 0);
    shift_y_ = known.select(matched * shift_y_, 0);
    near_prediction_.setConstant(nodes_y_, nodes_x_, false);
    for (const Index node : from_.nodes) {
      const Index row = node / nodes_x_, column = node % nodes_x_;
      near_prediction_
          .block(std::max<Index>(row - 1, 0), std::max<Index>(column - 1, 0), row == 0 || row == nodes_y_ - 1 ? 2 : 3,
                 column == 0 || column == nodes_x_ - 1 ? 2 : 3)
          .setConstant(true);
    }
  }

  static constexpr double kernel_floor = 1e-20;
  static constexpr double smallest_total = 1e-280;  ///< less is nothing: no silhouette within the kernel's radius
  static constexpr Index margin_nodes = 2;

  Settings settings_;
  Silhouette from_{}, to_{};
  Eigen::ArrayXd weights_{}, gathered_{}, moments_{}, padded_{}, rows_done_{};
  Grid values_{}, product_{}, total_{}, total_self_{}, shift_x_{}, shift_y_{};
  Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> near_prediction_{};
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();
  double spacing_ = 1, blur_ = 1;
  Index nodes_x_ = 0, nodes_y_ = 0;
};

}  // namespace decant::inline DECANT_TARGET
