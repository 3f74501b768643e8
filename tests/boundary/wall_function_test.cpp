// SPDX-License-Identifier: MIT

#include <cmath>

#include <decant/boundary/wall_function.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/kernel/wendland_c2.hpp>

#include "catch.hpp"

TEMPLATE_TEST_CASE("a wall stands in for the half-lattice behind it", "", decant::CubicSpline<double>,
                   decant::WendlandC2<double>) {
  const double d = 0.005, h = 2 * d / TestType::support_factor;
  const auto wall = decant::WallFunction::of<TestType>(h, d);
  // density and pressure force of one particle of the first layer, summed over an explicit half-lattice
  double density = 0, force = 0;
  for (int k = 0; k <= 2; ++k) {
    for (int j = -2; j <= 2; ++j) {
      for (int i = -2; i <= 2; ++i) {
        const double r = d * std::sqrt(i * i + j * j + k * k);
        density += TestType::value(r, h) * d * d * d;
        force += r > 0 ? 2 * TestType::derivative(r, h) * (-k * d / r) * d * d * d : 0;
      }
    }
  }
  double full = 0;
  for (int k = -2; k <= 2; ++k) {
    for (int j = -2; j <= 2; ++j) {
      for (int i = -2; i <= 2; ++i) {
        full += TestType::value(d * std::sqrt(i * i + j * j + k * k), h) * d * d * d;
      }
    }
  }
  CHECK(density + wall.share(d / 2) == Approx(full).epsilon(1e-9));
  CHECK(force - wall.slope(d / 2) == Approx(0).margin(1e-6 * wall.slope(d / 2)));
}

TEST_CASE("wall function and its slope and weight belong together") {
  const double d = 0.005;
  const auto wall = decant::WallFunction::of<decant::CubicSpline<double>>(d, d);
  CHECK(wall.reach() == Approx(d));
  CHECK(wall.share(wall.reach()) == 0);
  CHECK(wall.share(2 * d) == 0);
  for (const double a : {-0.6, -0.2, 0.1, 0.4, 0.8}) {
    const double step = 1e-5 * d;
    CHECK(wall.slope(a * d) ==
          Approx((wall.share(a * d - step) - wall.share(a * d + step)) / (2 * step)).epsilon(1e-5));
  }
  for (const double a : {-1.5, -0.7, -1e-3, 0.0, 0.3, 0.9, 0.9999, 1.0, 1.5}) {
    const auto both = wall.share_and_slope(a * d);
    CHECK(both.share == Approx(wall.share(a * d)).epsilon(1e-13));
    CHECK(both.slope == Approx(wall.slope(a * d)).epsilon(1e-13));
  }
  for (const double a : {0.0, 1e-3, 0.3, 0.9, 0.9999, 1.0, 1.5}) {
    const auto terms = wall.terms(a * d);
    CHECK(terms.share == Approx(wall.share(a * d)).epsilon(1e-13));
    CHECK(terms.slope == Approx(wall.slope(a * d)).epsilon(1e-13));
    CHECK(terms.radius_times_weight == Approx(wall.radius_times_weight(a * d)).epsilon(1e-13));
  }
  // int over the half-space behind a plane of w(r) dV = int_a^R 2 pi r w(r) (r - a) dr
  const double a = 0.3 * d;
  const int steps = 20000;
  double integral = 0;
  for (int k = 0; k < steps; ++k) {
    const double r = a + (wall.reach() - a) * (k + 0.5) / steps;
    integral += 2 * 3.14159265358979 * wall.radius_times_weight(r) * (r - a) * (wall.reach() - a) / steps;
  }
  CHECK(integral == Approx(wall.share(a)).epsilon(1e-4));
}

TEST_CASE("wall function refuses what is none") {
  using Kernel = decant::CubicSpline<double>;
  CHECK_THROWS_WITH(decant::WallFunction::of<Kernel>(0, 1),
                    decant_test::contains("WallFunction: smoothing length [m] must be > 0, got 0"));
  CHECK_THROWS_WITH(decant::WallFunction::of<Kernel>(0.005, 0.01),
                    decant_test::contains("WallFunction: particle spacing [m] must be"));
}
