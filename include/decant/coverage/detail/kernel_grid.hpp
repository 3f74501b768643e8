// SPDX-License-Identifier: MIT
#pragma once

/// Sums over all pixels of an image with the image kernel as weight, for every place at once.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <decant/core/batch.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/coverage/image_kernel.hpp>

namespace decant::inline DECANT_TARGET::detail {

/// The four cubic B-splines that reach a place a fraction t of the way from one node to the next. They add up to 1, and
/// none is negative.
inline Eigen::Array4f cubic_b_splines(float t) noexcept {
  constexpr float a = 1.0f / 6, b = 0.5f;
  const Eigen::Array4f constant(a, 4 * a, a, 0), linear(-b, 0, b, 0), square(b, -1, b, 0), cube(-a, b, -b, a);
  // all four in one register; rounding may leave the first a hair below zero
  return (constant + t * (linear + t * (square + t * cube))).max(0.0f);
}

/// How it works and how exact it is: see ActivationField. One grid sums W (Vector = false), or both components of u W.
template <bool Vector>
class KernelGrid {
 public:
  static constexpr std::size_t channels = Vector ? 2 : 1;

  /// Throws std::invalid_argument; `name` is whose message it is.
  KernelGrid(const char* name, int width, int height, const ImageKernel& kernel)
      : width_(width), height_(height), kernel_(kernel) {
    const std::string owner = name;
    expects(width >= 1 && width <= 32768, owner + ": width [px]", "1 to 32768", width);
    expects(height >= 1 && height <= 32768, owner + ": height [px]", "1 to 32768", height);
    // below, the spline's shape shows through; above, nobody has asked
    expects(kernel.length_px >= 4 && kernel.length_px <= 1e4, owner + ": kernel.length_px [px]", "4 to 10000",
            kernel.length_px);
    expects(kernel.cut_px >= 2.6 * kernel.length_px && kernel.cut_px <= 1e5, owner + ": kernel.cut_px [px]",
            "at least 2.6 times kernel.length_px, where the kernel is 1e-3, and at most 1e5", kernel.cut_px);
    step_ = std::max<Index>(1, static_cast<Index>(kernel.length_px / 8));
    const auto step = static_cast<double>(step_);
    per_step_ = 1 / step;
    // splines smear the cut over a node to either side, and W is larger inside of it: half a node less balances the two
    const double cut = kernel.cut_px - step / 2;
    reach_ = static_cast<Index>(cut / step);
    source_columns_ = (width - 1) / step_ + 4;
    source_rows_ = (height - 1) / step_ + 4;
    columns_ = source_columns_ + 2 * (reach_ + margin);
    rows_ = source_rows_ + 2 * (reach_ + margin);
    stride_ = (columns_ + tile - 1) / tile * tile;
    source_stride_ = stride_ + 2 * reach_;
    phase_stride_ = source_columns_ + 4 + B::width;

    for (Index phase = 0; phase < step_; ++phase) {
      const Eigen::Array4f spline = cubic_b_splines(static_cast<float>(static_cast<double>(phase) / step));
      splines_.insert(splines_.end(), spline.begin(), spline.end());
    }
    // exp(-u^2 / length^2) has the variance length^2 / 2 along each axis, and each of two cubic B-splines adds
    // step^2 / 3: the kernel between the splines is narrower by that much, and higher.
    const double whole = kernel.length_px * kernel.length_px / 2;
    const double inner = whole - 2 * step * step / 3;
    // the vector's kernel is -whole times the gradient of the scalar's
    const double height_of_inner = whole / inner * (Vector ? whole / inner : 1);
    by_half_width_.resize(static_cast<std::size_t>(reach_) + 1);
    for (Index d = 0; d <= reach_; ++d) {
      const double u = static_cast<double>(d) * step;
      const double weight = std::exp(-u * u / (2 * inner));
      columns_weight_.push_back(static_cast<float>(weight));
      columns_moment_.push_back(static_cast<float>(u * weight));
      rows_weight_.push_back(static_cast<float>(height_of_inner * weight));
      rows_moment_.push_back(static_cast<float>(height_of_inner * u * weight));
      const double half = std::sqrt(cut * cut - u * u) / step;
      by_half_width_[static_cast<std::size_t>(std::min(half, static_cast<double>(reach_)))].push_back(d);
    }

    const auto area = [](Index rows, Index columns) { return static_cast<std::size_t>(rows * columns); };
    source_.assign(area(source_rows_, source_stride_), 0);
    span_.assign(static_cast<std::size_t>(source_rows_), {});
    bands_ = (source_rows_ + rows_per_band - 1) / rows_per_band;
    weights_.assign(area(bands_, width_), 0);
    gathered_.assign(area(source_rows_, width_), 0);
    phases_.assign(area(bands_ * step_, phase_stride_), 0);
    for (auto& channel : sums_) {
      channel.assign(area(rows_, stride_), 0);
    }
  }

  int width() const noexcept { return width_; }
  int height() const noexcept { return height_; }
  const ImageKernel& kernel() const noexcept { return kernel_; }

  /// weigh(v, row) writes the weights of pixel row v, or returns false if all are zero. Called once or twice per row,
  /// from many threads.
  template <class Weigh>
  void rebuild(Threads threads, Weigh&& weigh) noexcept {
    parallel_ranges(bands_, threads, 1, [&](Index band, Index) { spread(band, weigh); });
    parallel_ranges(stride_ / tile, threads, 1, [&](Index begin, Index) { convolve(begin * tile); });
  }

  /// The sums at a place in the image or beyond [px]; zero for NaN.
  std::array<double, channels> at(const Eigen::Vector2d& pixel) const noexcept {
    const double x = pixel.x() * per_step_ + static_cast<double>(reach_ + margin + 1);
    const double y = pixel.y() * per_step_ + static_cast<double>(reach_ + margin + 1);
    // the outermost nodes are zero, so the sums fade out continuously
    if (!(x >= 1 && y >= 1 && x < static_cast<double>(columns_ - 3) && y < static_cast<double>(rows_ - 3))) {
      return {};
    }
    const auto left = static_cast<Index>(x), top = static_cast<Index>(y);
    const Eigen::Array4f across = cubic_b_splines(static_cast<float>(x - static_cast<double>(left)));
    const Eigen::Array4f down = cubic_b_splines(static_cast<float>(y - static_cast<double>(top)));
    std::array<double, channels> result;
    for (std::size_t channel = 0; channel < channels; ++channel) {
      const float* const node = sums_[channel].data() + (top - 1) * stride_ + left - 1;
      const auto row = [&](Index k) { return Eigen::Map<const Eigen::Array4f>(node + k * stride_); };
      const Eigen::Array4f column = down[0] * row(0) + down[1] * row(1) + down[2] * row(2) + down[3] * row(3);
      result[channel] = static_cast<double>((column * across).sum());
    }
    return result;
  }

 private:
  using B = Batch<float>;
  static constexpr Index tile = 32;  // columns of sums that one thread works on: they stay in registers
  static constexpr Index batches = tile / B::width;
  static constexpr Index rows_per_band = 16;  // of nodes
  static constexpr Index margin = 3;          // nodes beyond the kernel's reach, so that interpolation ends in zeros

  // Nodes that hold anything, as columns of the sums.
  struct Span {
    Index begin = 0, end = 0;
  };

  // Puts weights on nodes: each pixel's is shared among 4 x 4 of them by B-splines. Source row k and column k stand at
  // pixel (k - 1) * step.
  template <class Weigh>
  void spread(Index band, Weigh& weigh) noexcept {
    const Index first = band * rows_per_band, last = std::min(source_rows_, first + rows_per_band);
    float* const weights = weights_.data() + band * width_;
    std::array<bool, rows_per_band> used{};
    const Index v_begin = std::max<Index>(0, (first - 3) * step_ + 1);
    const Index v_end = std::min<Index>(height_, (last)*step_);
    for (Index v = v_begin; v < v_end; ++v) {
      if (!weigh(v, weights)) {
        continue;
      }
      const Index cell = v / step_;
      const float* const spline = splines_.data() + 4 * (v % step_);
      for (Index k = 0; k < 4; ++k) {
        const Index row = cell + k;
        if (row < first || row >= last || spline[k] == 0) {
          continue;
        }
        float* const to = gathered_.data() + row * width_;
        bool& filled = used[static_cast<std::size_t>(row - first)];
        if (!filled) {
          std::fill(to, to + width_, 0.0f);
          filled = true;
        }
        add_scaled(to, weights, spline[k], width_);
      }
    }
    for (Index row = first; row < last; ++row) {
      gather_columns(row, used[static_cast<std::size_t>(row - first)], phases_.data() + band * step_ * phase_stride_);
    }
  }

  static void add_scaled(float* to, const float* from, float factor, Index count) noexcept {
    Index k = 0;
    for (; k + B::width <= count; k += B::width) {
      (B::load(to + k) + B(factor) * B::load(from + k)).store(to + k);
    }
    for (; k < count; ++k) {
      to[k] += factor * from[k];
    }
  }

  // The same along a row. Pixels are sorted by their place between two nodes first, so that neighbours in memory have
  // the same weights.
  void gather_columns(Index row, bool used, float* phases) noexcept {
    float* const to = source_.data() + row * source_stride_ + reach_ + reach_ + margin;
    Span& span = span_[static_cast<std::size_t>(row)];
    if (!used) {
      if (span.begin < span.end) {
        std::fill(to, to + source_columns_, 0.0f);
        span = {};
      }
      return;
    }
    const float* const from = gathered_.data() + row * width_;
    for (Index phase = 0; phase < step_; ++phase) {
      float* const sorted = phases + phase * phase_stride_ + 3;
      for (Index cell = 0, u = phase; u < width_; ++cell, u += step_) {
        sorted[cell] = from[u];
      }
    }
    Index k = 0;
    for (; k < source_columns_; k += B::width) {
      B sum(0.0f);
      for (Index phase = 0; phase < step_; ++phase) {
        // node k takes from the cells k - 3 to k
        const float* const sorted = phases + phase * phase_stride_ + k;
        const float* const spline = splines_.data() + 4 * phase;
        for (Index i = 0; i < 4; ++i) {
          sum += B(spline[3 - i]) * B::load(sorted + i);
        }
      }
      if (k + B::width <= source_columns_) {
        sum.store(to + k);
      } else {
        for (Index lane = 0; k + lane < source_columns_; ++lane) {
          to[k + lane] = sum[static_cast<int>(lane)];
        }
      }
    }
    span = {0, source_columns_};
    while (span.begin < span.end && to[span.begin] == 0) {
      ++span.begin;
    }
    while (span.begin < span.end && to[span.end - 1] == 0) {
      --span.end;
    }
    span.begin += reach_ + margin;
    span.end += reach_ + margin;
  }

  // Row by row: `here` is the sum of a row's nodes within w columns, and grows by two nodes with each w. The rows at a
  // distance d from it take it over when w is half the width that the circle has there: an exact circle for the price
  // of a separable square.
  void convolve(Index left) noexcept {
    for (auto& channel : sums_) {
      for (Index row = 0; row < rows_; ++row) {
        std::fill_n(channel.data() + row * stride_ + left, tile, 0.0f);
      }
    }
    for (Index row = 0; row < source_rows_; ++row) {
      const Span& span = span_[static_cast<std::size_t>(row)];
      if (span.begin >= span.end || span.end + reach_ <= left || span.begin - reach_ >= left + tile) {
        continue;
      }
      const float* const source = source_.data() + row * source_stride_ + reach_ + left;
      const Index center = (row + reach_ + margin) * stride_ + left;
      std::array<B, batches> here, moment;
      for (Index b = 0; b < batches; ++b) {
        here[static_cast<std::size_t>(b)] = B::load(source + b * B::width);
        moment[static_cast<std::size_t>(b)] = B(0.0f);
      }
      for (Index w = 0; w <= reach_; ++w) {
        if (w > 0) {
          const B weight(columns_weight_[static_cast<std::size_t>(w)]);
          const B lever(columns_moment_[static_cast<std::size_t>(w)]);
          for (Index b = 0; b < batches; ++b) {
            const B before = B::load(source + b * B::width - w), after = B::load(source + b * B::width + w);
            here[static_cast<std::size_t>(b)] += weight * (before + after);
            if constexpr (Vector) {
              moment[static_cast<std::size_t>(b)] += lever * (after - before);
            }
          }
        }
        for (const Index d : by_half_width_[static_cast<std::size_t>(w)]) {
          const B weight(rows_weight_[static_cast<std::size_t>(d)]);
          const B lever(rows_moment_[static_cast<std::size_t>(d)]);
          add(sums_[0].data() + center + d * stride_, weight, Vector ? moment : here);
          if (d > 0) {
            add(sums_[0].data() + center - d * stride_, weight, Vector ? moment : here);
          }
          if constexpr (Vector) {
            if (d > 0) {
              add(sums_[1].data() + center - d * stride_, lever, here);  // the liquid is below
              add(sums_[1].data() + center + d * stride_, -lever, here);
            }
          }
        }
      }
    }
  }

  [[gnu::always_inline]] static void add(float* to, B factor, const std::array<B, batches>& values) noexcept {
    for (Index b = 0; b < batches; ++b) {
      (B::load(to + b * B::width) + factor * values[static_cast<std::size_t>(b)]).store(to + b * B::width);
    }
  }

  int width_, height_;
  ImageKernel kernel_;
  Index step_ = 1;       // between nodes [px]
  double per_step_ = 1;  // [1/px]
  Index reach_ = 0;      // of the kernel [nodes]
  Index source_columns_ = 0, source_rows_ = 0, source_stride_ = 0;
  Index columns_ = 0, rows_ = 0, stride_ = 0;
  Index phase_stride_ = 0, bands_ = 0;
  std::vector<float> splines_;                                                      // four for each place of a pixel
  std::vector<float> columns_weight_, columns_moment_, rows_weight_, rows_moment_;  // by distance in nodes
  std::vector<std::vector<Index>> by_half_width_;  // distances of rows whose part of the circle is so many nodes wide
  std::vector<float> source_, weights_, gathered_, phases_;
  std::vector<Span> span_;
  std::array<std::vector<float>, channels> sums_;
};

}  // namespace decant::inline DECANT_TARGET::detail
