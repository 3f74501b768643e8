// SPDX-License-Identifier: MIT
// A neighbor search whose for_each may throw, in a bundle of parts.
// expect: Parts::NeighborSearch must model decant::NeighborSearch, see <decant/neighbor/concept.hpp>
// expect: built.for_each(i, f)
#include <decant/neighbor/brute_force.hpp>
#include <decant/simulation/simulator.hpp>

struct Search : decant::BruteForce<double, decant::OpenDomain> {
  using Base = decant::BruteForce<double, decant::OpenDomain>;
  using Base::Base;
#ifdef DECANT_TWIN
  template <class F>
  void for_each(decant::Index i, F&& f) const noexcept {
    Base::for_each(i, f);
  }
#else
  template <class F>
  void for_each(decant::Index i, F&& f) const {
    Base::for_each(i, f);
  }
#endif
};

struct MyParts : decant::DefaultParts<double> {
  using NeighborSearch = Search;
};
static_assert(sizeof(decant::Simulator<MyParts>) > 0);
