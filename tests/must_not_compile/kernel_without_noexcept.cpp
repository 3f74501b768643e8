// SPDX-License-Identifier: MIT
// A kernel that forgets noexcept on one function: the line of the concept is named.
// expect: ::derivative_over_radius(r, h)
#include <decant/kernel/concept.hpp>

struct Kernel {
  using Scalar = double;
  static constexpr double support_factor = 2;
  static double value(double, double) noexcept { return 0; }
  static double derivative(double, double) noexcept { return 0; }
#ifdef DECANT_TWIN
  static double derivative_over_radius(double, double) noexcept { return 0; }
#else
  static double derivative_over_radius(double, double) { return 0; }
#endif
};
static_assert(decant::SmoothingKernel<Kernel>);
