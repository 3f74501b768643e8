// SPDX-License-Identifier: MIT
#pragma once

/// The neighbours of all particles, written down once per step and walked many times.

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <limits>
#include <numeric>
#include <type_traits>
#include <utility>
#include <vector>

#include <decant/core/batch.hpp>
#include <decant/core/domain.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/neighbor/cell_grid.hpp>
#include <decant/neighbor/concept.hpp>
#include <decant/neighbor/detail/scratch.hpp>

namespace decant::inline DECANT_TARGET {

/// One row per particle, neighbours in ascending order, filled up to whole batches with the particle's own index: there
/// x_i - x_j is zero, so antisymmetric pair terms vanish and others are masked. Separations are written down beside the
/// neighbours: there are about ten sweeps over the pairs in a sub-step beside those of the pressure, and to gather
/// positions from all over took most of the time of each. Rows are the same for any number of threads and any
/// instruction set. Building allocates only while the number of particles or of neighbours grows; sweeps never do, and
/// may run in many threads at once.
template <std::floating_point ScalarType, class DomainType = OpenDomain>
class NeighborList {
 public:
  using Scalar = ScalarType;
  using Domain = DomainType;
  using Number = Batch<Scalar>;

  /// Some neighbours of one particle i, one per lane.
  struct Pairs {
    const std::uint32_t* neighbor;  ///< j of each lane; i itself where not valid
    std::size_t slot;               ///< place of the first lane in index(), for values stored per pair
    Number x, y, z;                 ///< x_i - x_j [m]
    Number distance_squared;        ///< [m^2]
    typename Number::Mask valid;    ///< lanes that hold a neighbour
  };

  explicit NeighborList(Domain domain = {}) : domain_(domain) {}

  /// Rebuilds the search and writes down what it finds. position is 3xN [m]; rows are in the order of its columns. A
  /// CellGrid is read much faster than other searches, above all if the particles are in its order().
  template <NeighborSearch Search>
  void build(Search& search, const ConstPointsView<Scalar>& position, Scalar support_radius, Threads threads = {}) {
    search.rebuild(position, support_radius, threads);
    build_from(search, position, threads);
  }

  /// The same for a search that was already rebuilt, or put in order by adopt_order, for these positions.
  template <NeighborSearch Search>
  void build_from(const Search& search, const ConstPointsView<Scalar>& position, Threads threads = {}) {
    static_assert(std::is_same_v<typename Search::Scalar, Scalar>,
                  "NeighborList: search and list need the same Scalar");
    expects(search.size() == position.cols(), "NeighborList: number of positions", "that of the search's rebuild",
            position.cols());
    copy(position, threads);
    while (!write_rows(search, threads)) {  // too little room: there is enough at the second try
    }
  }

  Index size() const noexcept { return static_cast<Index>(count_); }
  const Domain& domain() const noexcept { return domain_; }

  /// All rows, with gaps: the neighbours of i are index()[first(i)] to index()[first(i) + count(i) - 1], and up to
  /// padded_end(i) there follows i. first(i) is a multiple of 16, whatever the batch's width.
  const std::uint32_t* index() const noexcept { return index_.data(); }
  std::size_t first(Index i) const noexcept { return rows_[static_cast<std::size_t>(i)].first; }
  std::size_t count(Index i) const noexcept { return rows_[static_cast<std::size_t>(i)].count; }
  std::size_t padded_end(Index i) const noexcept { return first(i) + round_up(count(i), Number::width); }
  /// Size of an array that has a place for each of index(). Most of the gaps never need be touched.
  std::size_t index_size() const noexcept { return chunks() * chunk_room_; }
  /// Sum of count(i).
  std::size_t pairs() const noexcept {
    std::size_t total = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      total += rows_[i].count;
    }
    return total;
  }

  /// The positions of the build, in records of four (x, y, z, 0), for gather3 and gather4.
  const Scalar* records() const noexcept { return records_.data(); }

  /// Calls f(Index j, Vector3<Scalar> x_i - x_j [m], Scalar r_squared [m^2]) for each neighbour j of i, ascending.
  template <class Function>
  void for_each(Index i, Function&& f) const noexcept {
    const Row row = rows_[static_cast<std::size_t>(i)];
    for (std::size_t k = row.first; k < row.first + row.count; ++k) {
      const Vector3<Scalar> between(x_[k], y_[k], z_[k]);
      f(static_cast<Index>(index_[k]), between, squared_length(between[0], between[1], between[2]));
    }
  }

  /// Calls f(Pairs) for each batch of neighbours of i: all of a row in ceil(count / width) calls.
  template <class Function>
  [[gnu::always_inline]] void for_each_batch(Index i, Function&& f) const noexcept {
    const Row row = rows_[static_cast<std::size_t>(i)];
    for (std::size_t k = 0; k < row.count; k += Number::width) {
      Pairs pairs;
      pairs.slot = row.first + k;
      pairs.neighbor = index_.data() + pairs.slot;
      pairs.x = Number::load(x_.data() + pairs.slot);
      pairs.y = Number::load(y_.data() + pairs.slot);
      pairs.z = Number::load(z_.data() + pairs.slot);
      pairs.distance_squared = squared_length(pairs.x, pairs.y, pairs.z);
      pairs.valid = Number::Mask::first(row.count - k);
      f(pairs);
    }
  }

  /// Where particle i was when the list was built [m].
  Vector3<Scalar> position(Index i) const noexcept {
    const Scalar* const record = records_.data() + 4 * i;
    return {record[0], record[1], record[2]};
  }

  /// Strikes out the pairs for which predicate(Index i, Index j, Vector3<Scalar> x_i - x_j [m]) holds, in rows i of
  /// which concerns(Index i) holds. Both must be symmetric together, or forces are no longer mutual, and callable from
  /// many threads.
  template <class Concerns, class Predicate>
  void remove_if(Concerns&& concerns, Predicate&& predicate, Threads threads = {}) noexcept {
    parallel_for(size(), threads, [&](Index i) {
      if (!concerns(i)) {
        return;
      }
      Row& row = rows_[static_cast<std::size_t>(i)];
      std::size_t kept = row.first;
      for (std::size_t k = row.first; k < row.first + row.count; ++k) {
        if (predicate(i, static_cast<Index>(index_[k]), Vector3<Scalar>(x_[k], y_[k], z_[k]))) {
          continue;
        }
        index_[kept] = index_[k];
        x_[kept] = x_[k];
        y_[kept] = y_[k];
        z_[kept] = z_[k];
        ++kept;
      }
      rows_at(0).pad(static_cast<std::uint32_t>(i), kept, row.first + row.count);
      row.count = static_cast<std::uint32_t>(kept - row.first);
    });
  }

 private:
  struct Row {
    std::uint32_t first, count;
  };
  // Rows are written in chunks of fixed size, each with room of its own, so that the layout knows nothing of threads
  // and no row has to be moved. Room that is not used is never touched.
  static constexpr std::size_t chunk_size = 512;
  static constexpr std::size_t row_step = 16;
  static constexpr std::size_t round_up(std::size_t count, std::size_t step) noexcept {
    return (count + step - 1) / step * step;
  }
  std::size_t chunks() const noexcept { return (count_ + chunk_size - 1) / chunk_size; }

  void copy(const ConstPointsView<Scalar>& position, Threads threads) {
    count_ = static_cast<std::size_t>(position.cols());
    records_.require(4 * count_);
    rows_.require(count_);
    const Scalar* const values = position.data();
    const Index stride = position.outerStride();
    parallel_for(size(), threads, [&](Index i) {
      Scalar* const record = records_.data() + 4 * i;
      const Scalar* const p = values + i * stride;
      record[0] = p[0];
      record[1] = p[1];
      record[2] = p[2];
      record[3] = 0;
    });
  }

  // Some particles, coordinate by coordinate.
  struct Candidates {
    detail::Scratch<Scalar> x, y, z;
    detail::Scratch<std::uint32_t> number;
    void require(std::size_t room) {
      x.require(room);
      y.require(room);
      z.require(room);
      number.require(room);
    }
  };

  // Where a row is written.
  struct Place {
    std::uint32_t* index;
    Scalar *x, *y, *z;

    Place at(std::size_t k) const noexcept { return {index + k, x + k, y + k, z + k}; }

    // Entries for which nothing is to be found: particle i itself.
    void pad(std::uint32_t i, std::size_t begin, std::size_t end) const noexcept {
      for (std::size_t k = begin; k < end; ++k) {
        index[k] = i;
        x[k] = y[k] = z[k] = 0;
      }
    }
  };

  // All rows, from a place on.
  Place rows_at(std::size_t slot) noexcept { return Place{index_.data(), x_.data(), y_.data(), z_.data()}.at(slot); }

  // Where a thread keeps the candidates of one cell, and a row that does not fit.
  struct Workspace {
    Candidates found, sorted, spilled;
    detail::Scratch<std::uint32_t> rank, from;

    Place beside() noexcept { return {spilled.number.data(), spilled.x.data(), spilled.y.data(), spilled.z.data()}; }

    void require(std::size_t count) {
      const std::size_t room = count + 4 * row_step;  // batches are written whole
      found.require(room);
      sorted.require(room);
      rank.require(room);
      from.require(room);
      spilled.require(room);
    }

    // Puts the candidates into ascending order, so that rows need not be sorted one by one. rank tells where each went.
    void sort(std::size_t count) noexcept {
      const std::uint32_t* const number = found.number.data();
      if (count <= 256) {
        // Counting who is smaller takes more comparisons than sorting, but a batch at a time and without branches.
        for (std::size_t k = 0; k < count; ++k) {
          const std::uint32_t own = number[k];
          std::uint32_t smaller = 0;
          for (std::size_t other = 0; other < count; ++other) {
            smaller += number[other] < own ? 1 : 0;
          }
          rank[k] = smaller;
          from[smaller] = static_cast<std::uint32_t>(k);
        }
      } else {
        std::iota(from.data(), from.data() + count, 0u);
        std::sort(from.data(), from.data() + count, [number](auto a, auto b) { return number[a] < number[b]; });
        for (std::size_t k = 0; k < count; ++k) {
          rank[from[k]] = static_cast<std::uint32_t>(k);
        }
      }
      for (std::size_t k = 0; k < count; ++k) {
        const std::size_t old = from[k];
        sorted.x[k] = found.x[old];
        sorted.y[k] = found.y[old];
        sorted.z[k] = found.z[old];
        sorted.number[k] = number[old];
      }
    }
  };

  // Appends rows to one chunk; keeps count of what they would need when they do not fit.
  struct Chunk {
    const Place all;
    Row* const rows;
    const std::size_t end;
    std::size_t next;
    bool fits = true;

    // Where the row may be written, if it needs no more than `room` entries, or else `elsewhere`.
    Place place(std::size_t room, const Place& elsewhere) const noexcept {
      return fits && next + room <= end ? all.at(next) : elsewhere;
    }
    void close(std::uint32_t i, const Place& row, std::size_t count) noexcept {
      const std::size_t padded = round_up(count, row_step);
      fits = fits && next + padded <= end;
      if (fits) {
        const Place own = all.at(next);
        if (row.index != own.index) {
          std::copy_n(row.index, count, own.index);
          std::copy_n(row.x, count, own.x);
          std::copy_n(row.y, count, own.y);
          std::copy_n(row.z, count, own.z);
        }
        own.pad(i, count, padded);
        rows[i] = {static_cast<std::uint32_t>(next), static_cast<std::uint32_t>(count)};
      }
      next += padded;
    }
  };

  // False if a chunk was too small; the room is then made larger.
  template <class Search>
  bool write_rows(const Search& search, Threads threads) {
    const std::size_t workers =
        std::max<std::size_t>(1, std::min(static_cast<std::size_t>(threads.resolved()), chunks()));
    if (workspaces_.size() < workers) {
      workspaces_.resize(workers);
    }
    for (std::size_t w = 0; w < workers; ++w) {
      workspaces_[w].require(count_);
    }
    needed_.assign(chunks(), 0);
    expects(index_size() < (std::size_t{1} << 32), "NeighborList: entries", "below 2^32", index_size());
    const std::size_t room = index_size() + row_step;
    index_.require(room);
    for (auto* values : {&x_, &y_, &z_}) {
      values->require(room);
    }
    const std::size_t share = (chunks() + workers - 1) / workers;
    parallel_ranges(static_cast<Index>(workers), threads, 1, [&](Index worker, Index) {
      Workspace& workspace = workspaces_[static_cast<std::size_t>(worker)];
      const std::size_t first = static_cast<std::size_t>(worker) * share;
      for (std::size_t c = first; c < std::min(chunks(), first + share); ++c) {
        Chunk chunk{rows_at(0), rows_.data(), (c + 1) * chunk_room_, c * chunk_room_};
        write_chunk(search, c * chunk_size, std::min(count_, (c + 1) * chunk_size), workspace, chunk);
        needed_[c] = chunk.next - c * chunk_room_;
      }
    });
    const std::size_t needed = needed_.empty() ? 0 : *std::max_element(needed_.begin(), needed_.end());
    if (needed <= chunk_room_) {
      return true;
    }
    chunk_room_ = round_up(needed + needed / 8, row_step);
    return false;
  }

  // The smallest box around some particles, and a lower bound of the distance of others from it.
  struct Box {
    Scalar low[3], high[3];

    Box(const Scalar* x, const Scalar* y, const Scalar* z, std::size_t begin, std::size_t end) noexcept
        : low{x[begin], y[begin], z[begin]}, high{x[begin], y[begin], z[begin]} {
      for (std::size_t k = begin + 1; k < end; ++k) {
        low[0] = minimum(low[0], x[k]);
        low[1] = minimum(low[1], y[k]);
        low[2] = minimum(low[2], z[k]);
        high[0] = maximum(high[0], x[k]);
        high[1] = maximum(high[1], y[k]);
        high[2] = maximum(high[2], z[k]);
      }
    }

    [[gnu::always_inline]] Number beyond(const Domain& domain, int axis, Number value) const noexcept {
      if constexpr (Domain::periodic) {
        // From the middle, since the nearest images of the two ends need not be the ends of one box. The margin covers
        // the rounding of the middle.
        const Scalar middle = low[axis] + (high[axis] - low[axis]) / 2;
        const Scalar margin = 8 * std::numeric_limits<Scalar>::epsilon() * (absolute(middle) + domain.period()[axis]);
        const Scalar half = (high[axis] - low[axis]) / 2 + margin;
        return maximum(absolute(domain.separation(axis, value, Number(middle))) - Number(half), Number(Scalar(0)));
      } else {
        return maximum(maximum(Number(low[axis]) - value, value - Number(high[axis])), Number(Scalar(0)));
      }
    }
    [[gnu::always_inline]] Number distance_squared(const Domain& domain, Number x, Number y, Number z) const noexcept {
      return squared_length(beyond(domain, 0, x), beyond(domain, 1, y), beyond(domain, 2, z));
    }
  };

  // The numbers k, k + 1, ... of one batch.
  [[gnu::always_inline]] static std::array<std::uint32_t, Number::width> number_from(std::size_t k) noexcept {
    return [k]<std::size_t... lane>(std::index_sequence<lane...>) {
      return std::array<std::uint32_t, Number::width>{static_cast<std::uint32_t>(k + lane)...};
    }
    (std::make_index_sequence<static_cast<std::size_t>(Number::width)>{});
  }

  // Any search: particles in the caller's order.
  template <class Search>
  void write_chunk(const Search& search, std::size_t begin, std::size_t end, Workspace& workspace,
                   Chunk& chunk) const noexcept {
    const Place row = workspace.beside();
    for (std::size_t i = begin; i < end; ++i) {
      std::size_t count = 0;
      search.for_each(static_cast<Index>(i),
                      [&](Index j, Scalar) { row.index[count++] = static_cast<std::uint32_t>(j); });
      std::sort(row.index, row.index + count);
      const Vector3<Scalar> own = position(static_cast<Index>(i));
      for (std::size_t k = 0; k < count; ++k) {
        const Vector3<Scalar> other = position(static_cast<Index>(row.index[k]));
        row.x[k] = domain_.separation(0, own[0], other[0]);
        row.y[k] = domain_.separation(1, own[1], other[1]);
        row.z[k] = domain_.separation(2, own[2], other[2]);
      }
      chunk.close(static_cast<std::uint32_t>(i), row, count);
    }
  }

  // A grid: particles in its order, cell by cell. First the particles near the cell are picked from the surrounding
  // ones: those within one support radius of the box around the cell's own particles, about half. They are few enough
  // to stay in registers and the nearest cache, and there are no short loops left to mispredict.
  template <class SearchDomain>
  void write_chunk(const CellGrid<Scalar, SearchDomain>& grid, std::size_t begin, std::size_t end, Workspace& workspace,
                   Chunk& chunk) const noexcept {
    static_assert(std::is_same_v<SearchDomain, Domain>, "NeighborList: search and list need the same Domain");
    const Scalar* const x = grid.x();
    const Scalar* const y = grid.y();
    const Scalar* const z = grid.z();
    const std::uint32_t* const order = grid.order().data();
    const bool in_order = grid.in_order();
    const Number limit(grid.support_radius() * grid.support_radius());
    Candidates& found = workspace.found;
    grid.for_each_cell(begin, end, [&](std::size_t from, std::size_t to, const auto& runs) {
      const Box box(x, y, z, from, to);
      std::size_t count = 0;
      std::size_t self = 0;  // place of particle `from` among those found
      for (int run = 0; run < runs.count; ++run) {
        const std::size_t run_begin = runs.begin[static_cast<std::size_t>(run)];
        const std::size_t run_end = runs.end[static_cast<std::size_t>(run)];
        for (std::size_t k = run_begin; k < run_end; k += Number::width) {
          const Number xs = Number::load(x + k), ys = Number::load(y + k), zs = Number::load(z + k);
          const std::uint32_t chosen =
              ((box.distance_squared(domain_, xs, ys, zs) < limit) & Number::Mask::first(run_end - k)).bits();
          if (from - k < Number::width) {
            self = count + static_cast<std::size_t>(std::popcount(chosen & ((1u << (from - k)) - 1)));
          }
          detail::compress_bits(found.x.data() + count, xs, chosen);
          detail::compress_bits(found.y.data() + count, ys, chosen);
          detail::compress_bits(found.z.data() + count, zs, chosen);
          std::uint32_t* const number = found.number.data() + count;
          count += in_order ? detail::compress_bits<Scalar>(number, number_from(k).data(), chosen)
                            : detail::compress_bits<Scalar>(number, order + k, chosen);
        }
      }
      if (!in_order) {
        workspace.sort(count);
      }
      Candidates& near = in_order ? found : workspace.sorted;
      Number(std::numeric_limits<Scalar>::quiet_NaN()).store(near.x.data() + count);  // no neighbour of anybody
      const Scalar* const near_x = near.x.data();
      const Scalar* const near_y = near.y.data();
      const Scalar* const near_z = near.z.data();
      const std::uint32_t* const near_number = near.number.data();

      for (std::size_t i = from; i < to; ++i, ++self) {
        const Place row = chunk.place(count + row_step, workspace.beside());
        const std::size_t own = in_order ? self : workspace.rank[self];
        const Number own_x(x[i]), own_y(y[i]), own_z(z[i]);
        std::size_t length = 0;
        for (std::size_t k = 0; k < count; k += Number::width) {
          const Number x_between = domain_.separation(0, own_x, Number::load(near_x + k)),
                       y_between = domain_.separation(1, own_y, Number::load(near_y + k)),
                       z_between = domain_.separation(2, own_z, Number::load(near_z + k));
          std::uint32_t bits = (squared_length(x_between, y_between, z_between) < limit).bits();
          bits &= own - k < Number::width ? ~(1u << (own - k)) : ~0u;
          detail::compress_bits(row.x + length, x_between, bits);
          detail::compress_bits(row.y + length, y_between, bits);
          detail::compress_bits(row.z + length, z_between, bits);
          length += detail::compress_bits<Scalar>(row.index + length, near_number + k, bits);
        }
        chunk.close(in_order ? static_cast<std::uint32_t>(i) : order[i], row, length);
      }
    });
    for (std::size_t k = std::max(begin, std::min(end, grid.placed())); k < end; ++k) {
      chunk.close(order[k], workspace.beside(), 0);  // not finite: no neighbours
    }
  }

  Domain domain_;
  std::size_t count_ = 0;
  std::size_t chunk_room_ = 48 * chunk_size;  // a resting liquid has about 30 neighbours within two spacings
  detail::Scratch<Row> rows_;
  detail::Scratch<std::uint32_t> index_;
  detail::Scratch<Scalar> x_, y_, z_;  ///< x_i - x_j in the order of index_ [m]
  detail::Scratch<Scalar> records_;
  std::vector<Workspace> workspaces_;
  std::vector<std::size_t> needed_;
};

}  // namespace decant::inline DECANT_TARGET
