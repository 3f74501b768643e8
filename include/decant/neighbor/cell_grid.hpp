// SPDX-License-Identifier: MIT
#pragma once

/// Neighbours by sorting the particles into cells of one support radius: the default search.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

#include <decant/core/batch.hpp>
#include <decant/core/domain.hpp>
#include <decant/core/target.hpp>
#include <decant/neighbor/concept.hpp>
#include <decant/neighbor/detail/scratch.hpp>

namespace decant::inline DECANT_TARGET {

/// A grid over the particles' bounding box, cells a little larger than the support radius, particles sorted by cell
/// with x running fastest: three cells side by side are one contiguous run, and a particle's neighbours lie in nine
/// runs. Memory grows with the number of particles only: a box of too many cells is folded, like a map that is rolled
/// up, so that distant places share cells; particles far apart in space then cost a distance check and nothing else.
/// The sort is stable, so the order depends on the positions and not on the number of threads.
template <std::floating_point ScalarType, class DomainType = OpenDomain>
class CellGrid {
 public:
  using Scalar = ScalarType;
  using Domain = DomainType;

  explicit CellGrid(Domain domain = {}) : domain_(domain) {}

  void rebuild(const ConstPointsView<Scalar>& position, Scalar support_radius, Threads threads = {}) {
    detail::check_search(domain_, position.cols(), support_radius);
    count_ = static_cast<std::size_t>(position.cols());
    support_radius_ = support_radius;
    lay_out(bounds(position, threads));
    sort(position, threads);
  }

  Index size() const noexcept { return static_cast<Index>(count_); }
  const Domain& domain() const noexcept { return domain_; }
  Scalar support_radius() const noexcept { return support_radius_; }

  /// Calls f(Index j, Scalar r_squared) for the neighbours of particle i.
  template <class Function>
  void for_each(Index i, Function&& f) const noexcept {
    const std::size_t self = rank_[static_cast<std::size_t>(i)];
    visit({x_[self], y_[self], z_[self]}, [&](std::size_t k, Scalar r_squared) {
      if (k != self) {
        f(static_cast<Index>(order_[k]), r_squared);
      }
    });
  }

  /// Calls f(Index j, Scalar r_squared) for all particles within the support radius of any point [m].
  template <class Function>
  void for_each_near(const Vector3<Scalar>& point, Function&& f) const noexcept {
    visit(point, [&](std::size_t k, Scalar r_squared) { f(static_cast<Index>(order_[k]), r_squared); });
  }

  /// The particles sorted by place: order()[new index] = old index. Particles that are near in space are mostly near in
  /// this order, so a simulator that keeps its arrays in it computes faster.
  std::span<const std::uint32_t> order() const noexcept { return {order_.data(), count_}; }

  /// Tells the grid that the caller has put its arrays into order(): from now on particle order()[k] is called k. Saves
  /// a second rebuild.
  void adopt_order(Threads threads = {}) noexcept {
    if (!in_order_) {
      parallel_for(size(), threads, [this](Index k) {
        order_[static_cast<std::size_t>(k)] = rank_[static_cast<std::size_t>(k)] = static_cast<std::uint32_t>(k);
      });
      in_order_ = true;
    }
  }

  /// What NeighborList works on: the sorted coordinates, and for a run of sorted particles the cells they lie in.
  struct Runs {
    std::array<std::uint32_t, 18> begin, end;  ///< sorted particles; ascending, disjoint, not empty
    int count = 0;
  };

  /// Calls f(begin, end, runs) for each cell that has some of the sorted particles [begin, end): which of them lie in
  /// it, and where all particles that may be near them are.
  template <class Function>
  void for_each_cell(std::size_t begin, std::size_t end, Function&& f) const noexcept {
    end = std::min<std::size_t>(end, placed());
    if (begin >= end) {
      return;
    }
    const std::uint32_t* const start = start_.data();
    std::size_t cell =
        static_cast<std::size_t>(std::upper_bound(start, start + cells_, static_cast<std::uint32_t>(begin)) - start) -
        1;
    for (; begin < end; ++cell) {
      const std::size_t cell_end = std::min<std::size_t>(end, start[cell + 1]);
      if (begin < cell_end) {
        f(begin, cell_end, runs_around(cell));
        begin = cell_end;
      }
    }
  }

  /// Sorted coordinates [m], readable one batch beyond the end.
  const Scalar* x() const noexcept { return x_.data(); }
  const Scalar* y() const noexcept { return y_.data(); }
  const Scalar* z() const noexcept { return z_.data(); }
  /// True if order() is 0, 1, 2, ...
  bool in_order() const noexcept { return in_order_; }
  /// How many particles have a place: the rest, last in order(), are not finite.
  std::size_t placed() const noexcept { return count_ == 0 ? 0 : start_[cells_]; }

 private:
  struct Box {
    std::array<Scalar, 3> low, high;
  };
  struct Axis {
    Scalar origin = 0;
    Scalar inverse = 0;  // cells per metre
    std::int64_t cells = 1;
    bool wraps = false;    // the first and the last cell are neighbours
    bool repeats = false;  // because space does; else because the grid is folded
  };
  // Far from the origin of a folded grid, cell numbers need more digits than positions have.
  using Wide = std::conditional_t<std::is_same_v<Scalar, float>, double, long double>;
  static constexpr std::size_t padding = 64 / sizeof(Scalar);

  template <class Function>
  void visit(const Vector3<Scalar>& point, Function&& f) const noexcept {
    if (count_ == 0) {
      return;
    }
    const Scalar radius_squared = support_radius_ * support_radius_;
    const std::size_t cell = nearest_cell(point);
    if (cell >= cells_) {
      return;
    }
    const Runs runs = runs_around(cell);
    for (int run = 0; run < runs.count; ++run) {
      for (std::size_t k = runs.begin[static_cast<std::size_t>(run)]; k < runs.end[static_cast<std::size_t>(run)];
           ++k) {
        const Scalar r_squared =
            squared_length(domain_.separation(0, point[0], x_[k]), domain_.separation(1, point[1], y_[k]),
                           domain_.separation(2, point[2], z_[k]));
        if (r_squared < radius_squared) {
          f(k, r_squared);
        }
      }
    }
  }

  // Smallest box around all finite positions; low > high where there is none.
  Box bounds(const ConstPointsView<Scalar>& position, Threads threads) {
    constexpr Index grain = 8192;
    partial_.resize(static_cast<std::size_t>((position.cols() + grain - 1) / grain));
    const auto reduce = [&](auto&& of_range) {
      parallel_ranges(position.cols(), threads, grain, [&](Index begin, Index end) {
        partial_[static_cast<std::size_t>(begin / grain)] = of_range(begin, end);
      });
      Box all = empty_box();
      for (const Box& box : partial_) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          all.low[axis] = std::min(all.low[axis], box.low[axis]);
          all.high[axis] = std::max(all.high[axis], box.high[axis]);
        }
      }
      return all;
    };
    Box box = reduce([&](Index begin, Index end) { return quick_bounds(position, begin, end); });
    bool finite = true;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      finite = finite && std::isfinite(box.low[axis]) && std::isfinite(box.high[axis]);
    }
    if (!finite) {
      box = reduce([&](Index begin, Index end) { return careful_bounds(position, begin, end); });
    }
    return box;
  }

  static Box empty_box() noexcept {
    constexpr Scalar most = std::numeric_limits<Scalar>::max();
    return {{most, most, most}, {-most, -most, -most}};
  }

  // Ignores NaN but not infinity. The array is read as it lies, three batches at a time, whose lanes are x, y or z.
  static Box quick_bounds(const ConstPointsView<Scalar>& position, Index begin, Index end) noexcept {
    using B = Batch<Scalar>;
    Box box = empty_box();
    if (position.outerStride() == 3 && end - begin >= B::width) {
      B low[3], high[3];
      std::fill_n(low, 3, B(std::numeric_limits<Scalar>::max()));
      std::fill_n(high, 3, B(std::numeric_limits<Scalar>::lowest()));
      const Scalar* values = position.data() + 3 * begin;
      for (; begin + B::width <= end; begin += B::width, values += 3 * B::width) {
        for (int third = 0; third < 3; ++third) {
          const B batch = B::load(values + third * B::width);
          low[third] = minimum(batch, low[third]);
          high[third] = maximum(batch, high[third]);
        }
      }
      for (int k = 0; k < 3 * B::width; ++k) {
        Scalar& lowest = box.low[static_cast<std::size_t>(k % 3)];
        Scalar& highest = box.high[static_cast<std::size_t>(k % 3)];
        lowest = minimum(low[k / B::width][k % B::width], lowest);
        highest = maximum(high[k / B::width][k % B::width], highest);
      }
    }
    for (; begin < end; ++begin) {
      for (Index axis = 0; axis < 3; ++axis) {
        Scalar& lowest = box.low[static_cast<std::size_t>(axis)];
        Scalar& highest = box.high[static_cast<std::size_t>(axis)];
        lowest = minimum(position(axis, begin), lowest);
        highest = maximum(position(axis, begin), highest);
      }
    }
    return box;
  }

  static Box careful_bounds(const ConstPointsView<Scalar>& position, Index begin, Index end) noexcept {
    Box box = empty_box();
    for (; begin < end; ++begin) {
      for (Index axis = 0; axis < 3; ++axis) {
        const Scalar value = position(axis, begin);
        if (std::isfinite(value)) {
          box.low[static_cast<std::size_t>(axis)] = std::min(box.low[static_cast<std::size_t>(axis)], value);
          box.high[static_cast<std::size_t>(axis)] = std::max(box.high[static_cast<std::size_t>(axis)], value);
        }
      }
    }
    return box;
  }

  // Chooses the cells. Two particles within one support radius must come into the same or adjacent cells in spite of
  // rounding: the cell number (x - origin) * inverse is off by less than 2 epsilon times its size.
  void lay_out(const Box& box) {
    constexpr Scalar epsilon = std::numeric_limits<Scalar>::epsilon();
    // Four cells per particle leave room for 32 times the volume of a resting liquid (8 particles to a cell).
    const double most_cells = std::clamp(4.0 * static_cast<double>(count_), 32768.0, 1073741824.0);
    std::array<double, 3> cells;  // in double: may be huge, and NaN or infinite for an extent that overflows
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const Scalar length = period(axis) > 0 ? period(axis) : std::max(Scalar(0), box.high[axis] - box.low[axis]);
      // Wrapping a position is as inexact as the position is large.
      const Scalar farthest = period(axis) > 0 ? std::max(-box.low[axis], box.high[axis]) : Scalar(0);
      const Scalar size = support_radius_ * (1 + 16 * epsilon) + 8 * epsilon * std::max(length, farthest);
      axes_[axis] = {};
      if (period(axis) > 0) {
        cells[axis] = std::max(1.0, std::floor(static_cast<double>(length / size)));
        axes_[axis].wraps = axes_[axis].repeats = true;
      } else {
        axes_[axis].origin = box.low[axis] <= box.high[axis] ? box.low[axis] : Scalar(0);
        axes_[axis].inverse = 1 / size;
        cells[axis] = std::floor(static_cast<double>(length * axes_[axis].inverse)) + 1;
      }
    }
    const bool folded = !(cells[0] * cells[1] * cells[2] <= most_cells);
    if (folded) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (!axes_[axis].repeats) {
          const Wide size = static_cast<Wide>(support_radius_) * (1 + Wide(1) / 64);
          const Wide length = static_cast<Wide>(box.high[axis]) - static_cast<Wide>(box.low[axis]);
          cells[axis] = std::min(1e18, static_cast<double>(std::max(Wide(0), length) / size) + 2);
          axes_[axis].wraps = true;
        }
        cells[axis] = std::floor(cells[axis]);
      }
      while (cells[0] * cells[1] * cells[2] > most_cells) {
        double& most = *std::max_element(cells.begin(), cells.end());
        most = std::ceil(most / 2);
      }
    }
    cells_ = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      axes_[axis].cells = static_cast<std::int64_t>(cells[axis]);
      cells_ *= static_cast<std::size_t>(axes_[axis].cells);
      if (axes_[axis].repeats) {
        axes_[axis].inverse = static_cast<Scalar>(axes_[axis].cells) / period(axis);
      }
    }
    plain_ = !axes_[0].wraps && !axes_[1].wraps && !axes_[2].wraps;
  }

  Scalar period([[maybe_unused]] std::size_t axis) const noexcept {
    if constexpr (Domain::periodic) {
      return domain_.period()[static_cast<Index>(axis)];
    } else {
      return 0;
    }
  }

  // Number of the cell that holds the point, or cells_ ("nowhere") if it is outside of the grid or not finite.
  [[gnu::always_inline]] std::uint32_t plain_cell(Scalar x, Scalar y, Scalar z) const noexcept {
    const Scalar u = (x - axes_[0].origin) * axes_[0].inverse;
    const Scalar v = (y - axes_[1].origin) * axes_[1].inverse;
    const Scalar w = (z - axes_[2].origin) * axes_[2].inverse;
    // NaN fails one of the upper bounds, whatever the minimum makes of it.
    const bool inside = minimum(minimum(u, v), w) >= 0 && u < static_cast<Scalar>(axes_[0].cells) &&
                        v < static_cast<Scalar>(axes_[1].cells) && w < static_cast<Scalar>(axes_[2].cells);
    // The choice comes before the conversion, which is undefined for values out of range.
    const auto whole = [inside](Scalar value) { return static_cast<std::int32_t>(inside ? value : Scalar(0)); };
    const std::int32_t cell =
        (whole(w) * static_cast<std::int32_t>(axes_[1].cells) + whole(v)) * static_cast<std::int32_t>(axes_[0].cells) +
        whole(u);
    return inside ? static_cast<std::uint32_t>(cell) : static_cast<std::uint32_t>(cells_);
  }

  std::uint32_t wrapped_cell(const Vector3<Scalar>& point) const noexcept {
    if (!(std::isfinite(point[0]) && std::isfinite(point[1]) && std::isfinite(point[2]))) {
      return static_cast<std::uint32_t>(cells_);
    }
    const Vector3<Scalar> wrapped = domain_.wrap(point);
    std::int64_t cell = 0;
    for (std::size_t axis = 3; axis-- > 0;) {
      const Axis& along = axes_[axis];
      const Scalar value = wrapped[static_cast<Index>(axis)];
      std::int64_t number = 0;
      if (along.repeats || !along.wraps) {
        number = static_cast<std::int64_t>(
            std::clamp((value - along.origin) * along.inverse, Scalar(0), static_cast<Scalar>(along.cells - 1)));
      } else {
        const Wide size = static_cast<Wide>(support_radius_) * (1 + Wide(1) / 64);
        const Wide cells = static_cast<Wide>(along.cells);
        const Wide unrolled = std::floor((static_cast<Wide>(value) - static_cast<Wide>(along.origin)) / size);
        const Wide rest = unrolled - cells * std::floor(unrolled / cells);
        number = static_cast<std::int64_t>(rest >= 0 && rest < cells ? rest : Wide(0));  // far out, digits are lost
      }
      cell = cell * along.cells + number;
    }
    return static_cast<std::uint32_t>(cell);
  }

  std::uint32_t cell_of(const Vector3<Scalar>& point) const noexcept {
    return plain_ ? plain_cell(point[0], point[1], point[2]) : wrapped_cell(point);
  }

  // For points that need not be particles: outside of a plain grid, the border cell is the only one to hold anything.
  std::size_t nearest_cell(const Vector3<Scalar>& point) const noexcept {
    if (!plain_) {
      return wrapped_cell(point);
    }
    Vector3<Scalar> within = point;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const Axis& along = axes_[axis];
      const Scalar u = (point[static_cast<Index>(axis)] - along.origin) * along.inverse;
      if (!(u > -2 && u < static_cast<Scalar>(along.cells) + 1)) {
        return cells_;
      }
      if (u < 0 || !(u < static_cast<Scalar>(along.cells))) {
        within[static_cast<Index>(axis)] =
            along.origin + (u < 0 ? Scalar(0) : static_cast<Scalar>(along.cells) - Scalar(0.5)) / along.inverse;
      }
    }
    return plain_cell(within[0], within[1], within[2]);
  }

  Runs runs_around(std::size_t cell) const noexcept {
    struct Span {
      std::array<std::int64_t, 3> at;
      int count = 0;
    };
    const auto around = [](const Axis& along, std::int64_t number) {
      Span span;
      if (!along.wraps || along.cells <= 3) {
        const std::int64_t first = along.wraps ? 0 : std::max<std::int64_t>(number - 1, 0);
        const std::int64_t last = along.wraps ? along.cells - 1 : std::min(number + 1, along.cells - 1);
        for (std::int64_t k = first; k <= last; ++k) {
          span.at[static_cast<std::size_t>(span.count++)] = k;
        }
      } else {
        span.at = {(number + along.cells - 1) % along.cells, number, (number + 1) % along.cells};
        span.count = 3;
        std::sort(span.at.begin(), span.at.end());  // runs ascend
      }
      return span;
    };
    const std::uint32_t width = static_cast<std::uint32_t>(axes_[0].cells);
    const std::uint32_t depth = static_cast<std::uint32_t>(axes_[1].cells);
    const std::uint32_t row = static_cast<std::uint32_t>(cell) / width;
    const Span xs = around(axes_[0], static_cast<std::int64_t>(cell) - static_cast<std::int64_t>(row) * width);
    const Span ys = around(axes_[1], row % depth);
    const Span zs = around(axes_[2], row / depth);
    Runs runs;
    const auto add = [&](std::int64_t first, std::int64_t last) {
      const std::uint32_t begin = start_[static_cast<std::size_t>(first)];
      const std::uint32_t end = start_[static_cast<std::size_t>(last + 1)];
      runs.begin[static_cast<std::size_t>(runs.count)] = begin;
      runs.end[static_cast<std::size_t>(runs.count)] = end;
      runs.count += begin < end ? 1 : 0;
    };
    for (int k = 0; k < zs.count; ++k) {
      for (int j = 0; j < ys.count; ++j) {
        const std::int64_t line =
            (zs.at[static_cast<std::size_t>(k)] * depth + ys.at[static_cast<std::size_t>(j)]) * width;
        const std::int64_t first = xs.at[0];
        const std::int64_t last = xs.at[static_cast<std::size_t>(xs.count - 1)];
        if (last - first < xs.count) {
          add(line + first, line + last);
        } else if (xs.at[1] == first + 1) {  // around the fold: 0, 1, last
          add(line + first, line + first + 1);
          add(line + last, line + last);
        } else {  // 0, last - 1, last
          add(line + first, line + first);
          add(line + last - 1, line + last);
        }
      }
    }
    return runs;
  }

  // Stable counting sort: each block of particles counts its cells, then writes behind the blocks before it.
  void sort(const ConstPointsView<Scalar>& position, Threads threads) {
    cell_.require(count_ + padding);
    order_.require(count_ + padding);
    rank_.require(count_ + padding);
    x_.require(count_ + padding);
    y_.require(count_ + padding);
    z_.require(count_ + padding);
    // Blocks of less than some thousand particles cost more in counters than their thread saves.
    const std::size_t blocks = std::clamp<std::size_t>(count_ / 2048, 1, static_cast<std::size_t>(threads.resolved()));
    const std::size_t bins = cells_ + 1;
    histogram_.require(blocks * bins);
    start_.require(bins + 1);
    const Index grain = std::max<Index>(1, static_cast<Index>((count_ + blocks - 1) / blocks));
    const Scalar* const values = position.data();
    const Index stride = position.outerStride();

    if (count_ < static_cast<std::size_t>(grain) * (blocks - 1) + 1) {
      std::fill_n(histogram_.data(), blocks * bins, 0u);  // rounding up the grain can leave the last block without work
    }
    parallel_ranges(size(), threads, grain, [&](Index begin, Index end) {
      std::uint32_t* const counter = histogram_.data() + static_cast<std::size_t>(begin / grain) * bins;
      std::fill_n(counter, bins, 0u);
      for (Index i = begin; i < end; ++i) {
        const Scalar* const p = values + i * stride;
        const std::uint32_t cell = plain_ ? plain_cell(p[0], p[1], p[2]) : wrapped_cell({p[0], p[1], p[2]});
        cell_[static_cast<std::size_t>(i)] = cell;
        ++counter[cell];
      }
    });

    std::uint32_t total = 0;
    for (std::size_t bin = 0; bin < bins; ++bin) {
      start_[bin] = total;
      for (std::size_t block = 0; block < blocks; ++block) {
        const std::uint32_t in_block = histogram_[block * bins + bin];
        histogram_[block * bins + bin] = total;
        total += in_block;
      }
    }
    start_[bins] = total;

    moved_.assign(blocks, 0);
    parallel_ranges(size(), threads, grain, [&](Index begin, Index end) {
      std::uint32_t* const next = histogram_.data() + static_cast<std::size_t>(begin / grain) * bins;
      std::uint32_t moved = 0;
      for (Index i = begin; i < end; ++i) {
        const Scalar* const p = values + i * stride;
        const std::uint32_t k = next[cell_[static_cast<std::size_t>(i)]]++;
        x_[k] = p[0];
        y_[k] = p[1];
        z_[k] = p[2];
        order_[k] = static_cast<std::uint32_t>(i);
        rank_[static_cast<std::size_t>(i)] = k;
        moved |= k ^ static_cast<std::uint32_t>(i);
      }
      moved_[static_cast<std::size_t>(begin / grain)] = moved;
    });
    in_order_ = std::all_of(moved_.begin(), moved_.end(), [](std::uint32_t moved) { return moved == 0; });
    for (std::size_t k = 0; k < padding; ++k) {
      x_[count_ + k] = y_[count_ + k] = z_[count_ + k] = std::numeric_limits<Scalar>::quiet_NaN();
    }
  }

  Domain domain_;
  Scalar support_radius_ = 0;
  std::size_t count_ = 0;
  std::size_t cells_ = 0;
  std::array<Axis, 3> axes_;
  bool plain_ = true;
  bool in_order_ = true;
  std::vector<Box> partial_;
  std::vector<std::uint32_t> moved_;
  detail::Scratch<std::uint32_t> cell_;       // of each particle, in the caller's order
  detail::Scratch<std::uint32_t> histogram_;  // blocks x (cells + nowhere)
  detail::Scratch<std::uint32_t> start_;      // first sorted particle of each cell, of nowhere, and the end
  detail::Scratch<std::uint32_t> order_, rank_;
  detail::Scratch<Scalar> x_, y_, z_;
};

static_assert(NeighborSearch<CellGrid<float>> && NeighborSearch<CellGrid<double, PeriodicDomain<double>>>);

}  // namespace decant::inline DECANT_TARGET
