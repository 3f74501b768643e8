// SPDX-License-Identifier: MIT
#pragma once

/// Thin walls: liquid on two sides of a wall must not feel each other, however close it is.

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <decant/boundary/wall_state.hpp>
#include <decant/core/batch.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Takes out of a neighbour list the pairs that a body's wall separates. Few pairs near walls are,
/// so what walls do to particles (WallState) answers two cheap questions first, a batch of neighbours at a time: a pair
/// that a wall separates is farther apart than both are from walls, and one of the two is behind the plane that touches
/// the wall nearest to the other. Only particles that feel a wall are asked, which name the others. Then rays are sent
/// to the surface.
template <class ScalarType>
class WallShield {
 public:
  using Scalar = ScalarType;

  /// @param walls of the positions that the list was built from. The list becomes one of fewer pairs, still symmetric.
  template <class Bodies, class Neighbors>
  void apply(const Bodies& bodies, const WallState<Scalar>& walls, Neighbors& neighbors, Threads threads) noexcept {
    if (bodies.size() == 0) {
      return;
    }
    note_walls(walls, neighbors.size(), threads);
    if (!find_suspects(walls, neighbors, threads)) {
      return;
    }
    neighbors.remove_if([&](Index i) { return suspect_[static_cast<std::size_t>(i)] != 0; },
                        [&](Index i, Index j, const Vector3<Scalar>& from_j_to_i) {
                          if (!may_be_separated(i, j, from_j_to_i)) {
                            return false;
                          }
                          // the same question from both ends, so that pairs stay symmetric
                          const Index a = std::min(i, j), b = std::max(i, j);
                          const Vector3<Scalar> x_a = neighbors.position(a), x_b = neighbors.position(b);
                          return bodies.separated(x_a, x_b, walls.contacts_of(a), walls.contact_count[a]) ||
                                 bodies.separated(x_a, x_b, walls.contacts_of(b), walls.contact_count[b]);
                        },
                        threads);
  }

 private:
  /// Looked-up distances may be off by a fraction of a grid cell; a tenth covers that.
  static constexpr Scalar sure_of_distance = Scalar(0.9);
  static constexpr Scalar sure_of_plane = Scalar(0.5);

  /// Puts what is asked for side by side.
  void note_walls(const WallState<Scalar>& walls, Index count, Threads threads) noexcept {
    wall_.resize(4 * static_cast<std::size_t>(count));
    parallel_for(count, threads, [&](Index i) {
      Scalar* const record = &wall_[4 * static_cast<std::size_t>(i)];
      record[0] = walls.gradient(0, i);
      record[1] = walls.gradient(1, i);
      record[2] = walls.gradient(2, i);
      record[3] = walls.distance[i];
    });
  }

  /// Whether what is `x` [m] away from a particle lies behind the plane that touches the wall nearest to it. False
  /// where no wall is felt.
  template <class Number>
  static auto behind_wall(const Number& into_x, const Number& into_y, const Number& into_z, const Number& distance,
                          const Number& x, const Number& y, const Number& z) noexcept {
    const Number depth = into_x * x + into_y * y + into_z * z;
    const Number reach = Number(sure_of_plane) * distance;
    return (depth > Number(Scalar(0))) & (depth * depth > reach * reach * squared_length(into_x, into_y, into_z));
  }

  bool may_be_separated(Index i, Index j, const Vector3<Scalar>& from_j_to_i) const noexcept {
    const Scalar* const one = &wall_[4 * static_cast<std::size_t>(i)];
    const Scalar* const other = &wall_[4 * static_cast<std::size_t>(j)];
    const Scalar between = sure_of_distance * (one[3] + other[3]);
    const Scalar x = from_j_to_i[0], y = from_j_to_i[1], z = from_j_to_i[2];
    return squared_length(x, y, z) > between * between &&
           (behind_wall<Scalar>(one[0], one[1], one[2], one[3], -x, -y, -z) ||
            behind_wall<Scalar>(other[0], other[1], other[2], other[3], x, y, z));
  }

  /// Notes the particles that walls may separate from a neighbour. @return whether there are any.
  template <class Neighbors>
  bool find_suspects(const WallState<Scalar>& walls, const Neighbors& neighbors, Threads threads) noexcept {
    suspect_.assign(static_cast<std::size_t>(neighbors.size()), 0);
    std::atomic<bool> any{false};
    parallel_for(neighbors.size(), threads, [&](Index i) {
      if (walls.contact_count[i] > 0 && note_suspects(neighbors, i)) {
        any.store(true, std::memory_order_relaxed);
      }
    });
    return any;
  }

  /// The neighbours j of which the particle's nearest wall may separate it, and itself if there are any. A little more
  /// is suspected than may_be_separated does, so that rounding makes no difference.
  template <class Neighbors>
  bool note_suspects(const Neighbors& neighbors, Index i) noexcept {
    using B = Batch<Scalar>;
    const Scalar* const own = &wall_[4 * static_cast<std::size_t>(i)];
    const B own_x(own[0]), own_y(own[1]), own_z(own[2]), own_distance(own[3]);
    const B nearly(Scalar(0.99)), zero(Scalar(0));
    bool found = false;
    neighbors.for_each_batch(i, [&](const auto& pair) {
      const auto behind =
          behind_wall<B>(own_x, own_y, own_z, nearly * own_distance, zero - pair.x, zero - pair.y, zero - pair.z);
      std::uint32_t lanes = (pair.valid & behind).bits();
      if (lanes == 0) {
        return;
      }
      const B distance = gather4(wall_.data(), pair.neighbor).w;
      const B between = nearly * sure_of_distance * (own_distance + distance);
      for (lanes &= (pair.distance_squared > between * between).bits(); lanes != 0; lanes &= lanes - 1) {
        note(static_cast<Index>(pair.neighbor[std::countr_zero(lanes)]));
        found = true;
      }
    });
    if (found) {
      note(i);
    }
    return found;
  }

  void note(Index i) noexcept {  // threads may meet here
    std::atomic_ref(suspect_[static_cast<std::size_t>(i)]).store(1, std::memory_order_relaxed);
  }

  std::vector<Scalar> wall_{};           ///< records of four: gradient of the share, distance
  std::vector<std::uint8_t> suspect_{};  ///< of being separated from a neighbour
};

}  // namespace decant::inline DECANT_TARGET
