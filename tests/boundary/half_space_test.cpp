// SPDX-License-Identifier: MIT

#include <cmath>

#include <decant/boundary/half_space.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/kernel/wendland_c2.hpp>

#include "catch.hpp"

namespace {

// Midpoint sums over a box of cells: slow, independent of the closed forms.
template <class Kernel>
double brute_force_fraction(double a, double h) {
  const double support = static_cast<double>(Kernel::support_factor) * h;
  const int cells = 120;
  const double width = 2 * support / cells;
  double total = 0;
  for (int i = 0; i < cells; ++i) {
    for (int j = 0; j < cells; ++j) {
      for (int k = 0; k < cells; ++k) {
        const double x = -support + (i + 0.5) * width, y = -support + (j + 0.5) * width;
        const double z = -support + (k + 0.5) * width;
        // cells that the plane cuts count by their part behind it
        const double behind = std::min(1.0, std::max(0.0, (z - a) / width + 0.5));
        total += behind * Kernel::value(std::sqrt(x * x + y * y + z * z), h) * width * width * width;
      }
    }
  }
  return total;
}

}  // namespace

TEMPLATE_TEST_CASE("half-space integrals agree with a sum over space", "", decant::CubicSpline<double>,
                   decant::WendlandC2<double>) {
  const double h = 0.005;
  const auto plane = decant::HalfSpace::of<TestType>(h);
  for (const double a : {-0.6, 0.0, 0.3, 0.5, 1.0, 1.5}) {
    INFO("distance over h " << a);
    CHECK(plane.fraction(a * h) == Approx(brute_force_fraction<TestType>(a * h, h)).margin(5e-4));
  }
}

TEST_CASE("half-space slope is the derivative of the fraction") {
  const double h = 0.005;
  const auto plane = decant::HalfSpace::of<decant::CubicSpline<double>>(h);
  CHECK(plane.fraction(0) == Approx(0.5).epsilon(1e-12));
  CHECK(plane.fraction(plane.support()) == 0);
  CHECK(plane.slope(1.01 * plane.support()) == 0);
  for (const double a : {-1.2, -0.4, 0.2, 0.7, 1.3, 1.8}) {
    const double step = 1e-2;
    const double difference = (plane.fraction((a - step) * h) - plane.fraction((a + step) * h)) / (2 * step * h);
    CHECK(plane.slope(a * h) ==
          Approx(difference).epsilon(2e-3).margin(2e-3 * plane.slope(0)));  // differences over 0.02 h
  }
}

TEST_CASE("half-space refuses a smoothing length that is none") {
  CHECK_THROWS_WITH(decant::HalfSpace::of<decant::CubicSpline<double>>(-1),
                    decant_test::contains("HalfSpace: smoothing length [m] must be > 0, got -1"));
}
