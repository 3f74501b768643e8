// SPDX-License-Identifier: MIT
#pragma once

/// A coarse level for pressure: what is the same all over a cell of some sixty particles, solved at once.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include <decant/core/batch.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/pressure/pressure_system.hpp>

namespace decant::DECANT_TARGET {

/// A sweep over neighbours carries information by one support radius, so that a deep column takes as many sweeps as it
/// has layers. This finds in one go the best pressure that is constant within cells: with the matrix A of a
/// PressureSystem and the indicator Z of the cells over the particles in contact,
///   z = Z (Z^T A Z)^-1 Z^T r
/// which is the coarse half of a two-level preconditioner (deflation: Nicolaides 1987, SIAM J. Numer. Anal. 24). Z^T A
/// Z is the exact product, summed from what each particle feels of its cells, and factorized within its profile; there
/// are at most some two thousand cells, which are made larger for more liquid. Cells stand still in space, so the
/// matrix of a few sub-steps ago will do: liquid has moved little, and what has come into new cells waits.
template <class ScalarType>
class CoarseCells {
 public:
  using Scalar = ScalarType;

  /// Sorts the particles of a sub-step into cells.
  template <class Step>
  void sort(const Step& step) {
    const auto count = static_cast<std::size_t>(step.fluid.size());
    const Scalar width_before = layout_.width;
    number_cells(step);
    if (layout_.width != width_before) {
      forget();
    }
    find_in_matrix();
    begin_.assign(keys_.size() + 1, 0);
    cell_.resize(count);
    slot_.resize(count);
    std::uint32_t cell = 0;
    for (std::size_t i = 0; i < count; ++i) {
      if (keys_[cell] != key_[i]) {
        cell = static_cast<std::uint32_t>(std::lower_bound(keys_.begin(), keys_.end(), key_[i]) - keys_.begin());
      }
      cell_[i] = cell;
      // Which of the eight cells of its group: the lowest bits of the cell's three numbers, which the key has side by
      // side.
      slot_[i] = static_cast<std::uint8_t>((key_[i] >> 40 & 4) | (key_[i] >> 20 & 2) | (key_[i] & 1));
      ++begin_[cell + 1];
    }
    for (std::size_t c = 1; c < begin_.size(); ++c) {
      begin_[c] += begin_[c - 1];
    }
    member_.resize(count);
    cursor_.assign(begin_.begin(), begin_.end());
    for (std::size_t i = 0; i < count; ++i) {
      member_[cursor_[cell_[i]]++] = static_cast<std::uint32_t>(i);
    }
    value_.assign(keys_.size(), 0.0);
  }

  std::size_t cells() const noexcept { return keys_.size(); }

  /// Takes r: sums it over each cell's particles with contact[i] == 1 (else 0). @return sum over cells of what came
  /// out, without its sign.
  double restrict(const std::vector<Scalar>& residual, const std::vector<Scalar>& contact, Threads threads) noexcept {
    const Index cells_per_range = 16;
    parallel_ranges(static_cast<Index>(value_.size()), threads, cells_per_range, [&](Index begin, Index end) {
      for (auto cell = static_cast<std::size_t>(begin); cell < static_cast<std::size_t>(end); ++cell) {
        double total = 0;
        for (std::uint32_t k = begin_[cell]; k < begin_[cell + 1]; ++k) {
          total += static_cast<double>(contact[member_[k]] * residual[member_[k]]);
        }
        value_[cell] = total;
      }
    });
    double sum = 0;
    for (const double value : value_) {
      sum += std::abs(value);
    }
    return sum;
  }

  /// Forgets the matrix.
  void forget() noexcept { matrix_keys_.clear(); }

  /// Whether there is a matrix for cells like these.
  bool assembled() const noexcept { return !matrix_keys_.empty(); }

  /// Computes and factorizes Z^T A Z. After sort().
  template <class Step>
  void assemble(const Step& step, const PressureSystem<Scalar>& system, const std::vector<Scalar>& contact) {
    felt_.resize(cell_.size());
    part_of_.resize(cell_.size());
    parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      const auto own = static_cast<std::size_t>(i);
      part_of_[own] = static_cast<Scalar>(contact[own] > 0 ? slot_[own] : slots);
    });
    parallel_for(step.fluid.size(), step.threads,
                 [&](Index i) { feel(step.neighbors, system, i, felt_[static_cast<std::size_t>(i)]); });
    find_groups();
    lay_out_profile();
    products_.resize(groups_.size());
    const Index groups_per_range = 64;
    parallel_ranges(static_cast<Index>(groups_.size()), step.threads, groups_per_range, [&](Index begin, Index end) {
      for (auto g = static_cast<std::size_t>(begin); g < static_cast<std::size_t>(end); ++g) {
        Products gathered = Products::Zero();
        for (std::size_t i = g == 0 ? 0 : groups_[g - 1].end; i < groups_[g].end; ++i) {
          gathered.noalias() += felt_[i].part.lazyProduct(felt_[i].part.transpose());
        }
        products_[g] = gathered;
      }
    });
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      const auto& cell = groups_[g].cell;
      for (std::size_t k = 0; k < slots; ++k) {
        for (std::size_t l = 0; l < slots && cell[k] != none; ++l) {
          if (cell[l] <= cell[k]) {
            entry(cell[k], cell[l]) += static_cast<double>(products_[g](static_cast<Index>(k), static_cast<Index>(l)));
          }
        }
      }
    }
    factorize();
    matrix_keys_ = keys_;
    find_in_matrix();
  }

  /// Replaces what restrict() took by z, see correction(); 0 in cells that assemble() has not seen.
  /// @param time_step [s].
  void solve(Scalar time_step) noexcept {
    const std::size_t cells = matrix_keys_.size();
    solution_.assign(cells, 0.0);
    for (std::size_t c = 0; c < keys_.size(); ++c) {
      if (place_[c] != none) {
        solution_[place_[c]] = value_[c];
      }
    }
    for (std::size_t a = 0; a < cells; ++a) {
      double value = solution_[a];
      for (std::size_t b = first_[a]; b < a; ++b) {
        value -= entry(a, b) * solution_[b];
      }
      solution_[a] = value * entry(a, a);
    }
    for (std::size_t a = cells; a-- > 0;) {
      solution_[a] *= entry(a, a);
      for (std::size_t b = first_[a]; b < a; ++b) {
        solution_[b] -= entry(a, b) * solution_[a];
      }
    }
    const double squared_step = static_cast<double>(time_step) * static_cast<double>(time_step);
    for (std::size_t c = 0; c < keys_.size(); ++c) {
      value_[c] = place_[c] != none ? solution_[place_[c]] / squared_step : 0;
    }
  }

  /// z of a particle in contact.
  Scalar correction(std::size_t i) const noexcept { return static_cast<Scalar>(value_[cell_[i]]); }

 private:
  static constexpr std::size_t most_cells = 2000;
  /// Over the support radius: a particle then feels no more than two cells along an axis.
  static constexpr Scalar cell_width = Scalar(2.0001);
  static constexpr std::size_t slots = 8;
  static constexpr auto none = std::numeric_limits<std::uint32_t>::max();

  using Parts = Eigen::Matrix<Scalar, static_cast<int>(slots), 3>;
  using Products = Eigen::Matrix<Scalar, static_cast<int>(slots), static_cast<int>(slots)>;

  /// Minus the acceleration of a particle by a unit of pressure in each of the cells around it. Two that follow each
  /// other along each axis, so whether a cell's numbers are even or odd says in which slot it is. (At the seam of a
  /// periodic domain two cells may be taken for one: the preconditioner is less exact there.)
  struct Felt {
    std::array<std::uint32_t, slots> cell{none, none, none, none, none, none, none, none};
    Parts part = Parts::Zero();
  };

  template <class Neighbors>
  void feel(const Neighbors& list, const PressureSystem<Scalar>& system, Index i, Felt& felt) const noexcept {
    using B = Batch<Scalar>;
    const auto own = static_cast<std::size_t>(i);
    felt = Felt{};
    std::array<Batch3<Scalar>, slots> sums;
    system.for_each_response(list, i, [&](const std::uint32_t* neighbor, B x, B y, B z) {
      const B part = gather(part_of_.data(), neighbor);
      for (std::size_t slot = 0; slot < slots; ++slot) {
        const auto in_slot = part == B(static_cast<Scalar>(slot));
        const std::uint32_t lanes = in_slot.bits();
        if (lanes == 0) {
          continue;
        }
        const B zero(Scalar(0));
        if (felt.cell[slot] == none) {
          felt.cell[slot] = cell_[neighbor[std::countr_zero(lanes)]];
          sums[slot] = {zero, zero, zero};
        }
        sums[slot].x += select(in_slot, x, zero);
        sums[slot].y += select(in_slot, y, zero);
        sums[slot].z += select(in_slot, z, zero);
      }
    });
    for (std::size_t slot = 0; slot < slots; ++slot) {
      if (felt.cell[slot] != none) {
        felt.part.row(static_cast<Index>(slot)) << sum(sums[slot].x), sum(sums[slot].y), sum(sums[slot].z);
      }
    }
    if (const std::size_t slot = slot_[own]; part_of_[own] < static_cast<Scalar>(slots)) {
      felt.cell[slot] = cell_[own];
      felt.part.row(static_cast<Index>(slot)) += Eigen::Map<const Eigen::Matrix<Scalar, 1, 3>>(system.own_response(i));
    }
  }

  /// Particles that follow each other in the list and feel the same cells, or no others: what they add to the matrix is
  /// gathered before it goes there.
  struct Group {
    std::array<std::uint32_t, slots> cell;
    std::size_t end;

    bool take(const Felt& felt) noexcept {
      std::array<std::uint32_t, slots> both;
      std::uint32_t different = 0;
      for (std::size_t k = 0; k < slots; ++k) {
        const std::uint32_t a = cell[k], b = felt.cell[k];
        both[k] = std::min(a, b);
        different |= std::max(a, b) == none ? 0 : a ^ b;
      }
      const bool same = different == 0;
      cell = same ? both : cell;
      return same;
    }
  };

  void find_groups() {
    groups_.clear();
    for (std::size_t i = 0; i < felt_.size(); ++i) {
      if (groups_.empty() || !groups_.back().take(felt_[i])) {
        groups_.push_back({felt_[i].cell, i});
      }
      groups_.back().end = i + 1;
    }
  }

  /// Finds the cells that hold liquid, and in key_ the cell of each particle.
  template <class Step>
  void number_cells(const Step& step) {
    const auto& position = step.fluid.position;
    const Index count = step.fluid.size();
    const Vector3<Scalar> extent = position.rowwise().maxCoeff() - position.rowwise().minCoeff();
    std::array<Index, 3>& axis = layout_.axis;
    if (!assembled()) {
      // the longest axis counts most: cells that touch then have numbers close to each other, and the profile is small
      axis = {0, 1, 2};
      std::sort(axis.begin(), axis.end(), [&](Index a, Index b) { return extent[a] > extent[b]; });
    }
    key_.resize(static_cast<std::size_t>(count));
    layout_.width = cell_width * static_cast<Scalar>(Step::Kernel::support_factor) * step.smoothing_length;
    while (true) {
      constexpr Scalar middle = Scalar(1 << 20), most = Scalar((1 << 21) - 1);  // also for what is not a number
      const Scalar per_width = 1 / layout_.width;
      const auto along = [&](Index a, Index i) {
        const Scalar place = std::floor(position(a, i) * per_width) + middle;
        return place > 0 ? static_cast<std::uint64_t>(std::min(place, most)) : std::uint64_t{0};
      };
      keys_.clear();
      for (Index i = 0; i < count; ++i) {
        const std::uint64_t key = (along(axis[0], i) << 42) + (along(axis[1], i) << 21) + along(axis[2], i);
        key_[static_cast<std::size_t>(i)] = key;
        if (keys_.empty() || keys_.back() != key) {
          keys_.push_back(key);
        }
      }
      std::sort(keys_.begin(), keys_.end());
      keys_.erase(std::unique(keys_.begin(), keys_.end()), keys_.end());
      if (keys_.size() <= most_cells) {
        return;
      }
      layout_.width *= 2;
    }
  }

  /// Which rows of the matrix belong to the cells that there are now.
  void find_in_matrix() {
    place_.resize(keys_.size());
    std::size_t row = 0;
    for (std::size_t c = 0; c < keys_.size(); ++c) {
      while (row < matrix_keys_.size() && matrix_keys_[row] < keys_[c]) {
        ++row;
      }
      const bool found = row < matrix_keys_.size() && matrix_keys_[row] == keys_[c];
      place_[c] = found ? static_cast<std::uint32_t>(row) : none;
    }
  }

  /// The lower triangle, each row from its first entry that is not zero.
  double& entry(std::size_t row, std::size_t column) noexcept { return matrix_[row_[row] + column]; }

  void lay_out_profile() {
    const std::size_t cells = keys_.size();
    first_.resize(cells);
    for (std::size_t c = 0; c < cells; ++c) {
      first_[c] = static_cast<std::uint32_t>(c);
    }
    for (const Group& group : groups_) {
      const std::uint32_t lowest = *std::min_element(group.cell.begin(), group.cell.end());
      for (const std::uint32_t cell : group.cell) {
        if (cell != none) {
          first_[cell] = std::min(first_[cell], lowest);
        }
      }
    }
    row_.resize(cells);
    std::size_t entries = 0;
    for (std::size_t c = 0; c < cells; ++c) {
      row_[c] = entries - first_[c];  // never negative: each row before has an entry
      entries += c - first_[c] + 1;
    }
    matrix_.assign(entries, 0.0);
  }

  /// Cholesky in place; diagonal entries are left inverted.
  void factorize() noexcept {
    for (std::size_t a = 0; a < keys_.size(); ++a) {
      const double whole = entry(a, a);
      double rest = whole;
      for (std::size_t b = first_[a]; b < a; ++b) {
        double value = entry(a, b);
        for (std::size_t k = std::max(first_[a], first_[b]); k < b; ++k) {
          value -= entry(a, k) * entry(b, k);
        }
        value *= entry(b, b);
        entry(a, b) = value;
        rest -= value * value;
      }
      // a cell without contact, or one that says nothing new, takes no part
      entry(a, a) = rest > 1e-6 * whole ? 1 / std::sqrt(rest) : 0;
    }
  }

  /// What keys mean.
  struct Layout {
    std::array<Index, 3> axis{0, 1, 2};  ///< which counts most, which least
    Scalar width = 0;                    ///< of cells [m]
  };

  Layout layout_{};
  std::vector<std::uint64_t> keys_{}, key_{};                 ///< of all cells, in order; of each particle's
  std::vector<std::uint64_t> matrix_keys_{};                  ///< of the cells that the matrix is about
  std::vector<std::uint32_t> place_{};                        ///< in the matrix, of each cell; or none
  std::vector<std::uint32_t> cell_{};                         ///< of each particle
  std::vector<std::uint8_t> slot_{};                          ///< of its cell, see Felt
  std::vector<std::uint32_t> begin_{}, member_{}, cursor_{};  ///< the particles of each cell
  std::vector<Scalar> part_of_{};                             ///< slot_ of particles in contact, else `slots`
  std::vector<Felt> felt_{};
  std::vector<Products, Eigen::aligned_allocator<Products>> products_{};  ///< of each group
  std::vector<Group> groups_{};
  std::vector<std::uint32_t> first_{};
  std::vector<std::size_t> row_{};  ///< where column 0 of each row would be
  std::vector<double> matrix_{}, solution_{}, value_{};
};

}  // namespace decant::DECANT_TARGET
