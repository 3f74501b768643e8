// SPDX-License-Identifier: MIT
#pragma once

/// Thin walls: liquid on two sides of a wall must not feel each other, however close it is.

#include <algorithm>

#include <decant/boundary/wall_state.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/types.hpp>

namespace decant {

namespace detail {

/// Whether j, `apart` away from i, lies behind the plane that touches the wall nearest to i.
template <class Scalar>
bool beyond_wall_of(const WallState<Scalar>& walls, Index i, const Vector3<Scalar>& apart) noexcept {
  const Vector3<Scalar> into = walls.gradient.col(i);
  const Scalar depth = apart.dot(into);
  const Scalar reach = Scalar(0.5) * walls.distance[i];
  return depth > 0 && depth * depth > reach * reach * into.squaredNorm();
}

/// Cheap first questions, of which a pair that a wall separates passes both: the two are farther apart than both
/// walls are near, and one of them is behind the plane that touches the wall nearest to the other.
template <class Scalar>
bool may_be_separated(const WallState<Scalar>& walls, Index i, Index j, const Vector3<Scalar>& apart) noexcept {
  if (walls.contact_count[i] == 0 && walls.contact_count[j] == 0) {
    return false;
  }
  // looked-up distances may be off by a fraction of a grid cell; a tenth covers that
  const Scalar walls_between = Scalar(0.9) * (walls.distance[i] + walls.distance[j]);
  return apart.squaredNorm() > walls_between * walls_between &&
         (beyond_wall_of(walls, i, apart) || beyond_wall_of<Scalar>(walls, j, -apart));
}

}  // namespace detail

/// Takes out of a neighbour list the pairs that a body's wall separates. @param walls sampled at these positions.
template <class Bodies, class Scalar, class Positions, class Neighbors>
void shield_neighbors(const Bodies& bodies, const WallState<Scalar>& walls, const Positions& position,
                      Neighbors& neighbors, Threads threads) noexcept {
  if (bodies.size() == 0) {
    return;
  }
  neighbors.remove_if(
      [&](Index i, Index j) {
        const Vector3<Scalar> apart = position.col(j) - position.col(i);
        if (!detail::may_be_separated(walls, i, j, apart)) {
          return false;
        }
        // the same question from both ends, so that pairs stay symmetric
        const Index a = std::min(i, j), b = std::max(i, j);
        const Vector3<Scalar> x_a = position.col(a), x_b = position.col(b);
        return bodies.separated(x_a, x_b, walls.contacts_of(a), walls.contact_count[a]) ||
               bodies.separated(x_a, x_b, walls.contacts_of(b), walls.contact_count[b]);
      },
      threads);
}

}  // namespace decant
