// SPDX-License-Identifier: MIT
#pragma once

/// A coarse level for pressure: what varies slowly in space, solved at once.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <decant/core/batch.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/pressure/pressure_system.hpp>

namespace decant::inline DECANT_TARGET {

/// A sweep over neighbours carries information by one support radius, so that a deep column takes as many sweeps as it
/// has layers. This finds in one go the best pressure that is linear between the nodes of a grid, four support radii
/// apart: with the matrix A of a PressureSystem and, for each node, its hat function Z over the particles in contact,
///   z = Z (Z^T A Z)^-1 Z^T r
/// which is the coarse half of a two-level preconditioner (deflation: Nicolaides 1987, SIAM J. Numer. Anal. 24). Z^T A
/// Z is the sum of f f^T over particles, where f is what a particle is accelerated by a unit of pressure at each node;
/// a particle feels no more than how large the pressure is where it is and how steep:
///   f = hat a + Q grad hat,     a = sum over neighbours of -push_ij,     Q = sum of push_ij (x_i - x_j)^T
/// with push_ij from PressureSystem, over those in contact. This is exact for pressure that is linear over the support.
/// (Pressure that is constant within cells would do with exact products, but pushes between cells only: what is inside
/// of one goes on falling.)
/// The matrix is factorized within its profile; there are at most some thousand nodes, farther apart in more liquid.
template <class ScalarType>
class CoarseGrid {
 public:
  using Scalar = ScalarType;

  /// Sorts the particles of a sub-step into the grid's cells.
  template <class Step>
  void sort(const Step& step) {
    lay_out(step);
    while (!number_cells(step) || !number_nodes()) {
      coarsen(step);
    }
    gather_members(step);
    make_room();
  }

  std::size_t nodes() const noexcept { return node_keys_.size(); }

  /// Takes r: Z^T r, over the particles with contact[i] == 1 (else 0). @return sum over nodes of what came out, without
  /// its sign.
  double restrict(const std::vector<Scalar>& residual, const std::vector<Scalar>& contact, Threads threads) noexcept {
    sum_at_nodes(residual, contact, threads, value_);
    double sum = 0;
    for (const double value : value_) {
      sum += std::abs(value);
    }
    return sum;
  }

  /// Computes and factorizes Z^T A Z. After sort().
  template <class Step>
  void assemble(const Step& step, const PressureSystem<Scalar>& system, const std::vector<Scalar>& contact) {
    products_.resize(cells_.size());
    for_each_cell(step.threads, [&](const Cell& cell) {
      products_[number_of(cell)] = products_of(cell, step.neighbors, system, contact);
    });
    matrix_.assign(nodes() == 0 ? 0 : row_.back() + nodes(), 0.0);
    for (const Cell& cell : cells_) {
      const Products& products = products_[number_of(cell)];
      for (std::size_t k = 0; k < corners; ++k) {
        for (std::size_t l = 0; l < corners; ++l) {
          if (cell.node[l] <= cell.node[k]) {
            entry(cell.node[k], cell.node[l]) += static_cast<double>(products[std::max(k, l)][std::min(k, l)]);
          }
        }
      }
    }
    factorize();
    sum_at_nodes(contact, contact, step.threads, weight_);
  }

  /// Whether around some node far more particles are in contact than when assemble() was called. What the matrix takes
  /// for soft, because hardly anything was there, would be corrected out of all proportion.
  bool outgrown(const std::vector<Scalar>& contact, Threads threads) noexcept {
    sum_at_nodes(contact, contact, threads, weight_now_);
    for (std::size_t n = 0; n < nodes(); ++n) {
      if (weight_now_[n] > most_growth * weight_[n]) {
        return true;
      }
    }
    return false;
  }

  /// Puts z for what restrict() took into correction, one entry per particle. @param time_step [s].
  void solve(Scalar time_step, Threads threads, std::vector<Scalar>& correction) noexcept {
    substitute();
    const double squared_step = static_cast<double>(time_step) * static_cast<double>(time_step);
    for (double& value : value_) {
      value /= squared_step;
    }
    for_each_cell(threads, [&](const Cell& cell) {
      for_each_batch(cell, [&](std::size_t at, const auto&) {
        const std::array<B, corners> hat = hats(at);
        B z(Scalar(0));
        for (std::size_t k = 0; k < corners; ++k) {
          z = multiply_add(hat[k], B(static_cast<Scalar>(value_[cell.node[k]])), z);
        }
        for (std::size_t lane = 0; lane < std::min(width, cell.end - at); ++lane) {
          correction[member_[at + lane]] = z[static_cast<int>(lane)];
        }
      });
    });
  }

 private:
  static constexpr std::size_t most_nodes = 1500;
  static constexpr Scalar supports_per_cell = Scalar(4);
  static constexpr double most_growth = 1.5;         ///< of contacts around a node, for the matrix to be of use
  static constexpr Scalar coarsening = Scalar(1.4);  ///< of cells' widths, until there are few enough
  static constexpr std::size_t corners = 8;
  static constexpr Index cells_per_range = 8;

  using B = Batch<Scalar>;
  static constexpr auto width = static_cast<std::size_t>(B::width);
  using Products = std::array<std::array<Scalar, corners>, corners>;  ///< lower triangle

  /// Of cells of liquid. Corner k is the far one along x, y, z where k has the bit 1, 2, 4.
  struct Cell {
    std::uint64_t key;
    std::size_t begin = 0, end = 0;             ///< of its members; the next cell's start at a whole batch
    std::array<std::uint32_t, corners> node{};  ///< at its corners
  };

  /// How space is divided along an axis.
  struct Axis {
    Scalar width = 0;          ///< of cells [m]
    Scalar period = 0;         ///< after which space repeats itself [m], 0 for never
    std::int32_t repeats = 0;  ///< cells in a period
    int shift = 0;             ///< of the cell's number in keys

    static constexpr std::int32_t middle = 1 << 20;

    /// Which cell x is in, and where in it, 0 .. 1. What is too far out, or not a number, goes somewhere.
    struct Place {
      std::int32_t number;
      Scalar along;
    };
    [[gnu::always_inline]] Place place(Scalar x) const noexcept {
      const Scalar within = period > 0 ? x - period * std::floor(x / period) : x;
      const Scalar cells = within / width, whole = std::floor(cells);
      constexpr auto farthest = static_cast<Scalar>(middle - 2);
      if (!(std::abs(whole) < farthest)) {
        return {whole > 0 ? 2 * middle - 2 : 0, Scalar(0)};
      }
      return {static_cast<std::int32_t>(whole) + middle, cells - whole};  // apart: the sum has no room for both
    }
    /// Part of the key of the cell with this number, or of the node at its near end.
    [[gnu::always_inline]] std::uint64_t key(std::int32_t number) const noexcept {
      const std::int32_t wrapped = repeats > 0 ? (number - middle) % repeats + middle : number;
      return static_cast<std::uint64_t>(wrapped) << shift;
    }
    std::int32_t number(std::uint64_t key) const noexcept {
      return static_cast<std::int32_t>(key >> shift & (2 * middle - 1));
    }
  };

  /// Numbers keys as they come. Open addressing: there are few keys, and each is asked for many times.
  class Numbers {
   public:
    void clear() noexcept {
      table_.assign(table_size, {0, none});
      keys_.clear();
    }
    std::uint32_t of(std::uint64_t key) {
      std::size_t at = (key * 0x9e3779b97f4a7c15ull) >> (64 - table_bits);
      while (table_[at].second != none && table_[at].first != key) {
        at = (at + 1) % table_size;
      }
      if (table_[at].second == none) {
        table_[at] = {key, static_cast<std::uint32_t>(keys_.size())};
        keys_.push_back(key);
      }
      return table_[at].second;
    }
    const std::vector<std::uint64_t>& keys() const noexcept { return keys_; }

   private:
    static constexpr int table_bits = 13;
    static constexpr std::size_t table_size = std::size_t{1} << table_bits;
    static constexpr std::uint32_t none = ~std::uint32_t{0};
    static_assert(table_size > 4 * most_nodes);

    std::vector<std::pair<std::uint64_t, std::uint32_t>> table_{};
    std::vector<std::uint64_t> keys_{};
  };

  std::size_t number_of(const Cell& cell) const noexcept { return static_cast<std::size_t>(&cell - cells_.data()); }

  template <class Function>
  void for_each_cell(Threads threads, Function&& f) const {
    parallel_ranges(static_cast<Index>(cells_.size()), threads, cells_per_range, [&](Index begin, Index end) {
      for (auto c = static_cast<std::size_t>(begin); c < static_cast<std::size_t>(end); ++c) {
        f(cells_[c]);
      }
    });
  }

  /// Calls f(first place in member_, mask of the lanes that are members).
  template <class Function>
  [[gnu::always_inline]] void for_each_batch(const Cell& cell, Function&& f) const noexcept {
    for (std::size_t at = cell.begin; at < cell.end; at += width) {
      f(at, B::Mask::first(cell.end - at));
    }
  }

  /// The hat functions of a cell's corners at a batch of its members.
  [[gnu::always_inline]] std::array<B, corners> hats(std::size_t at) const noexcept {
    const B one(Scalar(1));
    const B x = B::load(&along_[0][at]), y = B::load(&along_[1][at]), z = B::load(&along_[2][at]);
    const std::array<B, 4> face{(one - x) * (one - y), x * (one - y), (one - x) * y, x * y};
    std::array<B, corners> hat;
    for (std::size_t k = 0; k < 4; ++k) {
      hat[k + 4] = face[k] * z;
      hat[k] = face[k] - hat[k + 4];
    }
    return hat;
  }

  /// Z^T v, over the particles with contact[i] == 1 (else 0).
  void sum_at_nodes(const std::vector<Scalar>& values, const std::vector<Scalar>& contact, Threads threads,
                    std::vector<double>& sums_at_nodes) noexcept {
    for_each_cell(threads, [&](const Cell& cell) {
      std::array<B, corners> sums;
      sums.fill(B(Scalar(0)));
      for_each_batch(cell, [&](std::size_t at, const auto& valid) {
        const std::uint32_t* const member = &member_[at];
        const B v = select(valid, gather(values.data(), member) * gather(contact.data(), member), B(Scalar(0)));
        const std::array<B, corners> hat = hats(at);
        for (std::size_t k = 0; k < corners; ++k) {
          sums[k] = multiply_add(v, hat[k], sums[k]);
        }
      });
      cell_sums_[number_of(cell)] = sum_each(sums);
    });
    sums_at_nodes.assign(nodes(), 0.0);
    for (const Cell& cell : cells_) {
      const std::array<Scalar, corners>& sums = cell_sums_[number_of(cell)];
      for (std::size_t k = 0; k < corners; ++k) {
        sums_at_nodes[cell.node[k]] += static_cast<double>(sums[k]);
      }
    }
  }

  /// What some particles feel, one per lane: a, then the rows of Q. Zero in lanes without a particle.
  struct Response {
    std::array<std::array<Scalar, width>, 12> of_lane{};

    [[gnu::always_inline]] B operator[](std::size_t k) const noexcept { return B::load(of_lane[k].data()); }
  };

  /// For the members of a cell from place `at` on.
  template <class Neighbors>
  Response response_of(const Cell& cell, std::size_t at, const Neighbors& list, const PressureSystem<Scalar>& system,
                       const std::vector<Scalar>& contact) const noexcept {
    Response response;
    for (std::size_t lane = 0; lane < std::min(width, cell.end - at); ++lane) {
      const std::size_t own = member_[at + lane];
      const B zero(Scalar(0));
      std::array<B, 12> sums;
      sums.fill(zero);
      system.for_each_response(list, static_cast<Index>(own), [&](const auto& pair, B x, B y, B z) {
        const B in_contact = gather(contact.data(), pair.neighbor);
        const std::array<B, 3> push{in_contact * x, in_contact * y, in_contact * z};
        for (std::size_t axis = 0; axis < 3; ++axis) {
          sums[axis] += push[axis];
          sums[3 + 3 * axis] = multiply_add(push[axis], pair.x, sums[3 + 3 * axis]);
          sums[4 + 3 * axis] = multiply_add(push[axis], pair.y, sums[4 + 3 * axis]);
          sums[5 + 3 * axis] = multiply_add(push[axis], pair.z, sums[5 + 3 * axis]);
        }
      });
      const std::array<Scalar, 12> felt = sum_each(sums);
      for (std::size_t k = 0; k < 12; ++k) {
        response.of_lane[k][lane] =
            k < 3 ? -felt[k] - contact[own] * system.own_response(static_cast<Index>(own))[k] : felt[k];
      }
    }
    return response;
  }

  /// Z^T A Z of one cell's particles.
  template <class Neighbors>
  Products products_of(const Cell& cell, const Neighbors& list, const PressureSystem<Scalar>& system,
                       const std::vector<Scalar>& contact) const noexcept {
    const B zero(Scalar(0)), one(Scalar(1));
    std::array<std::array<B, corners>, corners> sums;
    for (auto& row : sums) {
      row.fill(zero);
    }
    for_each_batch(cell, [&](std::size_t at, const auto&) {
      const Response response = response_of(cell, at, list, system, contact);
      const std::array<B, 3> along{B::load(&along_[0][at]), B::load(&along_[1][at]), B::load(&along_[2][at])};
      const std::array<B, corners> hat = hats(at);
      std::array<Batch3<Scalar>, corners> felt;
      for (std::size_t k = 0; k < corners; ++k) {
        std::array<B, 3> share, slope;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const bool far = (k >> axis & 1) != 0;
          share[axis] = far ? along[axis] : one - along[axis];
          slope[axis] = B((far ? 1 : -1) / axes_[axis].width);
        }
        const std::array<B, 3> steep{slope[0] * share[1] * share[2], slope[1] * share[2] * share[0],
                                     slope[2] * share[0] * share[1]};
        const auto along_axis = [&](std::size_t axis) {
          B sum = multiply_add(hat[k], response[axis], response[3 + 3 * axis] * steep[0]);
          sum = multiply_add(response[4 + 3 * axis], steep[1], sum);
          return multiply_add(response[5 + 3 * axis], steep[2], sum);
        };
        felt[k] = {along_axis(0), along_axis(1), along_axis(2)};
      }
      for (std::size_t k = 0; k < corners; ++k) {
        for (std::size_t l = 0; l <= k; ++l) {
          B sum = multiply_add(felt[k].x, felt[l].x, sums[k][l]);
          sum = multiply_add(felt[k].y, felt[l].y, sum);
          sums[k][l] = multiply_add(felt[k].z, felt[l].z, sum);
        }
      }
    });
    Products products;
    for (std::size_t k = 0; k < corners; ++k) {
      products[k] = sum_each(sums[k]);
    }
    return products;
  }

  // ---- the grid ---------------------------------------------------------------------------------------------------

  template <class Step>
  void lay_out(const Step& step) {
    const auto& position = step.fluid.position;
    const Index count = step.fluid.size();
    Vector3<Scalar> extent = Vector3<Scalar>::Zero();
    if (count > 0) {
      extent = position.rowwise().maxCoeff() - position.rowwise().minCoeff();
      extent = extent.array().isFinite().select(extent, Scalar(0));  // what is not a number has no order
    }
    // The longest axis counts most: nodes that touch then have numbers close to each other, and the profile is small.
    std::array<std::size_t, 3> order{0, 1, 2};
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return extent[static_cast<Index>(a)] > extent[static_cast<Index>(b)];
    });
    for (int rank = 0; rank < 3; ++rank) {
      axes_[order[static_cast<std::size_t>(rank)]].shift = 42 - 21 * rank;
    }
    cell_width_ = supports_per_cell * static_cast<Scalar>(Step::Kernel::support_factor) * step.smoothing_length;
    divide(step);
  }

  template <class Step>
  void coarsen(const Step& step) {
    cell_width_ *= coarsening;
    divide(step);
  }

  template <class Step>
  void divide([[maybe_unused]] const Step& step) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Axis& along = axes_[axis];
      along.width = cell_width_;
      along.period = 0;
      along.repeats = 0;
      if constexpr (Step::Neighbors::Domain::periodic) {
        along.period = step.neighbors.domain().period()[static_cast<Index>(axis)];
        if (along.period > 0) {
          along.repeats = std::max(1, static_cast<std::int32_t>(std::min(along.period / cell_width_, Scalar(1 << 19))));
          along.width = along.period / static_cast<Scalar>(along.repeats);
        }
      }
    }
  }

  /// Finds the cells that hold liquid, and in cell_ that of each particle. @return false if there are too many.
  template <class Step>
  bool number_cells(const Step& step) {
    const Index count = step.fluid.size();
    key_.resize(static_cast<std::size_t>(count));
    parallel_for(count, step.threads, [&](Index i) {
      std::uint64_t key = 0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        key += axes_[axis].key(axes_[axis].place(step.fluid.position(static_cast<Index>(axis), i)).number);
      }
      key_[static_cast<std::size_t>(i)] = key;
    });
    numbers_.clear();
    cells_.clear();
    cell_.resize(key_.size());
    std::uint64_t last_key = ~std::uint64_t{0};
    std::uint32_t last = 0;
    for (std::size_t i = 0; i < key_.size(); ++i) {
      if (key_[i] != last_key) {
        last_key = key_[i];
        last = numbers_.of(last_key);
        if (last == cells_.size()) {
          if (cells_.size() == most_nodes) {
            return false;  // every cell has a node of its own
          }
          cells_.push_back({last_key});
        }
      }
      cell_[i] = last;
      ++cells_[last].end;
    }
    return true;
  }

  /// Finds the nodes at the cells' corners. @return false if there are too many.
  bool number_nodes() {
    numbers_.clear();
    for (Cell& cell : cells_) {
      for (std::size_t k = 0; k < corners; ++k) {
        std::uint64_t key = 0;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          key += axes_[axis].key(axes_[axis].number(cell.key) + static_cast<std::int32_t>(k >> axis & 1));
        }
        cell.node[k] = numbers_.of(key);
        if (numbers_.keys().size() > most_nodes) {
          return false;
        }
      }
    }
    node_keys_ = numbers_.keys();
    std::sort(node_keys_.begin(), node_keys_.end());
    rank_.resize(node_keys_.size());
    for (std::size_t n = 0; n < rank_.size(); ++n) {
      rank_[n] = static_cast<std::uint32_t>(std::lower_bound(node_keys_.begin(), node_keys_.end(), numbers_.keys()[n]) -
                                            node_keys_.begin());
    }
    for (Cell& cell : cells_) {
      for (std::uint32_t& node : cell.node) {
        node = rank_[node];
      }
    }
    return true;
  }

  /// Lists the particles of each cell, and where in it they are.
  template <class Step>
  void gather_members(const Step& step) {
    std::size_t end = 0;
    for (Cell& cell : cells_) {
      const std::size_t count = cell.end;
      cell.begin = cell.end = end;
      end += (count + width - 1) / width * width;
    }
    member_.assign(end, 0);
    for (std::size_t i = 0; i < cell_.size(); ++i) {
      member_[cells_[cell_[i]].end++] = static_cast<std::uint32_t>(i);
    }
    for (auto& along : along_) {
      along.resize(end);
    }
    for_each_cell(step.threads, [&](const Cell& cell) {
      for (std::size_t at = cell.begin; at < cell.end; ++at) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const Scalar x = step.fluid.position(static_cast<Index>(axis), static_cast<Index>(member_[at]));
          along_[axis][at] = axes_[axis].place(x).along;
        }
      }
    });
    cell_sums_.resize(cells_.size());
  }

  /// Frames must not allocate just because the grid is called for the first time, or liquid has spread a little.
  void make_room() {
    const auto room = [](auto& values, std::size_t size) {
      if (values.capacity() < size) {
        values.reserve(2 * size);
      }
    };
    room(cells_, cells_.size() + 1);
    room(cell_sums_, cells_.size() + 1);
    room(products_, cells_.size() + 1);
    lay_out_profile();
    room(matrix_, row_.empty() ? 0 : row_.back() + nodes());
    for (auto* values : {&first_, &rank_}) {
      room(*values, nodes() + 1);
    }
    room(node_keys_, nodes() + 1);
    room(row_, nodes() + 1);
    for (auto* values : {&value_, &weight_, &weight_now_}) {
      room(*values, nodes() + 1);
    }
    room(member_, member_.size() + 1);
    for (auto& along : along_) {
      room(along, member_.size() + 1);
    }
  }

  // ---- the matrix -------------------------------------------------------------------------------------------------

  /// The lower triangle, each row from its first entry that is not zero.
  double& entry(std::size_t row, std::size_t column) noexcept { return matrix_[row_[row] + column]; }

  void lay_out_profile() {
    first_.resize(nodes());
    for (std::size_t n = 0; n < nodes(); ++n) {
      first_[n] = static_cast<std::uint32_t>(n);
    }
    for (const Cell& cell : cells_) {
      const std::uint32_t lowest = *std::min_element(cell.node.begin(), cell.node.end());
      for (const std::uint32_t node : cell.node) {
        first_[node] = std::min(first_[node], lowest);
      }
    }
    row_.resize(nodes());
    std::size_t entries = 0;
    for (std::size_t n = 0; n < nodes(); ++n) {
      row_[n] = entries - first_[n];  // never negative: each row before has an entry
      entries += n - first_[n] + 1;
    }
  }

  /// Rows are short, and one sum after the other would wait for each addition.
  static double sum_of_products(const double* a, const double* b, std::size_t count) noexcept {
    using Wide = Batch<double>;
    constexpr auto lanes = static_cast<std::size_t>(Wide::width);
    Wide sums(0.0);
    std::size_t k = 0;
    for (; k + lanes <= count; k += lanes) {
      sums = multiply_add(Wide::load(a + k), Wide::load(b + k), sums);
    }
    double total = sum(sums);
    for (; k < count; ++k) {
      total += a[k] * b[k];
    }
    return total;
  }

  /// Cholesky in place; diagonal entries are left inverted.
  void factorize() noexcept {
    for (std::size_t a = 0; a < nodes(); ++a) {
      const double whole = entry(a, a);
      double rest = whole;
      for (std::size_t b = first_[a]; b < a; ++b) {
        const std::size_t from = std::max(first_[a], first_[b]);
        const double value = (entry(a, b) - sum_of_products(&entry(a, from), &entry(b, from), b - from)) * entry(b, b);
        entry(a, b) = value;
        rest -= value * value;
      }
      // A node without contact, or one that says nothing new, takes no part: of one that others make up for but for a
      // hundredth (in length), sums of floats tell nothing.
      constexpr double least_news = 1e-4;
      entry(a, a) = rest > least_news * whole ? 1 / std::sqrt(rest) : 0;
    }
  }

  /// Solves for value_, in place.
  void substitute() noexcept {
    for (std::size_t a = 0; a < nodes(); ++a) {
      const std::size_t from = first_[a];
      value_[a] = (value_[a] - sum_of_products(&entry(a, from), &value_[from], a - from)) * entry(a, a);
    }
    for (std::size_t a = nodes(); a-- > 0;) {
      value_[a] *= entry(a, a);
      for (std::size_t b = first_[a]; b < a; ++b) {
        value_[b] -= entry(a, b) * value_[a];
      }
    }
  }

  std::array<Axis, 3> axes_{};
  Scalar cell_width_ = 0;  ///< where space does not repeat itself [m]
  Numbers numbers_{};
  std::vector<std::uint64_t> key_{};   ///< of each particle's cell
  std::vector<std::uint32_t> cell_{};  ///< of each particle
  std::vector<Cell> cells_{};
  std::vector<std::uint64_t> node_keys_{};  ///< in order
  std::vector<std::uint32_t> rank_{};
  std::vector<std::uint32_t> member_{};         ///< the particles, cell by cell, filled up to whole batches
  std::array<std::vector<Scalar>, 3> along_{};  ///< where in its cell each of these is, 0 .. 1
  std::vector<std::array<Scalar, corners>> cell_sums_{};
  std::vector<Products> products_{};
  std::vector<std::uint32_t> first_{};
  std::vector<std::size_t> row_{};  ///< where column 0 of each row would be
  std::vector<double> matrix_{}, value_{};
  std::vector<double> weight_{}, weight_now_{};  ///< particles in contact around each node: for the matrix, and now
};

}  // namespace decant::inline DECANT_TARGET
