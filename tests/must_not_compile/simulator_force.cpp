// SPDX-License-Identifier: MIT
// A force term that forgets noexcept, in a bundle of parts.
// expect: every type in Parts::Forces must model decant::ForceTerm, see <decant/force/concept.hpp>
#include <limits>
#include <tuple>

#include <decant/simulation/simulator.hpp>

struct Wind {
#ifdef DECANT_TWIN
  template <class Step>
  void accumulate(const Step&, decant::PointArray<double>& acceleration) noexcept {
    acceleration.row(0).array() += 1;
  }
#else
  template <class Step>
  void accumulate(const Step&, decant::PointArray<double>& acceleration) {
    acceleration.row(0).array() += 1;
  }
#endif
  template <class Step>
  double largest_step(const Step&) const noexcept {
    return std::numeric_limits<double>::infinity();
  }
};

struct MyParts : decant::DefaultParts<double> {
  using Forces = std::tuple<decant::Gravity<double>, Wind>;
};
static_assert(sizeof(decant::Simulator<MyParts>) > 0);
