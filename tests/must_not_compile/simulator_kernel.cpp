// SPDX-License-Identifier: MIT
// A kernel without derivative_over_radius in a bundle of parts.
// expect: Parts::Kernel must model decant::SmoothingKernel, see <decant/kernel/concept.hpp>
// expect: derivative_over_radius
#include <decant/simulation/simulator.hpp>

struct Kernel {
  using Scalar = double;
  static constexpr double support_factor = 2;
  template <class Number>
  static Number value(Number r, double h) noexcept {
    return decant::CubicSpline<double>::value(r, h);
  }
  template <class Number>
  static Number derivative(Number r, double h) noexcept {
    return decant::CubicSpline<double>::derivative(r, h);
  }
#ifdef DECANT_TWIN
  template <class Number>
  static Number derivative_over_radius(Number r, double h) noexcept {
    return decant::CubicSpline<double>::derivative_over_radius(r, h);
  }
#endif
};

struct MyParts : decant::DefaultParts<double> {
  using Kernel = ::Kernel;
};
static_assert(sizeof(decant::Simulator<MyParts>) > 0);
