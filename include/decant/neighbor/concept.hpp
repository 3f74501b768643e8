// SPDX-License-Identifier: MIT
#pragma once

/// What a neighbour search has to provide.

#include <cmath>
#include <concepts>

#include <decant/core/expects.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Finds the particles near a particle. A plain value; it keeps what it needs of the positions, so the caller's array
/// may change or vanish after rebuild.
/// rebuild(position, support_radius, threads): position 3xN [m] of up to 2^31 - 1 particles, support_radius [m] > 0;
/// throws std::invalid_argument for another radius. May allocate if N has grown.
/// for_each(i, f): calls f(Index j, Scalar r_squared [m^2]) once for each j != i with |x_i - x_j| < support_radius, in
/// an order of its own that does not depend on the number of threads. r_squared is squared_length (core/batch.hpp) of
/// domain().separation, so that all searches agree on who is a neighbour. Callable from many threads; does not
/// allocate. A particle whose position is not finite has no neighbours and is nobody's neighbour. size(): the N of the
/// last rebuild, 0 before. domain(): how separations are measured (core/domain.hpp). Laws: decant/testing/neighbor.hpp.
template <class N>
concept NeighborSearch = requires(N& search, const N& built, const ConstPointsView<typename N::Scalar>& position,
                                  typename N::Scalar support_radius, Threads threads, Index i,
                                  void (&f)(Index, typename N::Scalar)) {
  requires std::floating_point<typename N::Scalar>;
  search.rebuild(position, support_radius, threads);
  { built.for_each(i, f) }
  noexcept->std::same_as<void>;
  { built.size() }
  noexcept->std::same_as<Index>;
  built.domain().separation(0, support_radius, support_radius);
};

namespace detail {

// What every search's rebuild has to refuse.
template <class Domain, class Scalar>
void check_search(const Domain& domain, Index count, Scalar support_radius) {
  expects(support_radius > 0 && std::isfinite(support_radius * support_radius) && support_radius * support_radius > 0,
          "NeighborSearch: support_radius [m]", "> 0 with a finite square", support_radius);
  expects(count < (Index{1} << 31), "NeighborSearch: number of particles", "below 2^31", count);
  if constexpr (Domain::periodic) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto period = domain.period()[axis];
      // A nearer period would make a particle its neighbour's neighbour twice.
      expects(period == 0 || period >= 2 * support_radius, "PeriodicDomain: period [m]",
              "0 or at least twice the support radius", period);
    }
  } else {
    (void)domain;
  }
}

}  // namespace detail

}  // namespace decant::inline DECANT_TARGET
