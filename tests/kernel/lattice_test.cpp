// SPDX-License-Identifier: MIT
#include <decant/kernel/lattice.hpp>

#include <cmath>
#include <numbers>

#include <decant/kernel/cubic_spline.hpp>
#include <decant/kernel/mueller_viscosity.hpp>
#include <decant/kernel/poly6.hpp>
#include <decant/kernel/spiky.hpp>
#include <decant/kernel/wendland_c2.hpp>
#include <decant/kernel/wendland_c4.hpp>

#include "catch.hpp"

namespace {

/// One on the support, and nothing beyond.
struct Ball {
  using Scalar = double;
  static constexpr double support_factor = 1;
  static double value(double r, double h) noexcept { return r < h ? 3 / (4 * std::numbers::pi * h * h * h) : 0.0; }
  static double derivative(double, double) noexcept { return 0; }
  static double derivative_over_radius(double, double) noexcept { return 0; }
};

/// How much too large the density at rest is with W(0) for a particle's own [-].
template <class Kernel>
double excess_at(double support_in_spacings, double spacing = 0.004) {
  const double h = support_in_spacings * spacing / Kernel::support_factor;
  return (decant::sum_over_others<Kernel>(h, spacing) + Kernel::value(0.0, h)) * spacing * spacing * spacing - 1;
}

}  // namespace

TEST_CASE("a lattice's others are counted: 6 faces, 12 edges, 8 corners") {
  const double each = Ball::value(0, 1);
  CHECK(decant::sum_over_others<Ball>(1, 1.01) == 0);
  CHECK(decant::sum_over_others<Ball>(1, 0.99) == Approx(6 * each));
  CHECK(decant::sum_over_others<Ball>(1, 0.70) == Approx(18 * each));
  CHECK(decant::sum_over_others<Ball>(1, 0.57) == Approx(26 * each));
}

TEMPLATE_TEST_CASE("with a particle's own value a lattice has its density, whatever the kernel and its support", "",
                   decant::CubicSpline<double>, decant::WendlandC2<double>, decant::WendlandC4<double>,
                   decant::Poly6<double>, decant::Spiky<double>, decant::MuellerViscosity<double>) {
  for (const double support : {1.76, 2.0, 2.6, 3.0}) {
    const double spacing = 0.003, h = support * spacing / TestType::support_factor;
    const double density = decant::own_value<TestType>(h, spacing) + decant::sum_over_others<TestType>(h, spacing);
    CHECK(density * spacing * spacing * spacing == Approx(1).epsilon(1e-12));
  }
}

TEST_CASE("the sum over a lattice is too large by what is known of each kernel, and less so with more neighbours") {
  CHECK(std::abs(excess_at<decant::CubicSpline<double>>(2)) < 1e-3);
  CHECK(excess_at<decant::WendlandC2<double>>(2) == Approx(0.034).margin(1e-3));
  CHECK(excess_at<decant::WendlandC4<double>>(2) == Approx(0.067).margin(1e-3));
  CHECK(std::abs(excess_at<decant::WendlandC2<double>>(4)) < 0.1 * excess_at<decant::WendlandC2<double>>(2));
  CHECK(excess_at<decant::WendlandC2<double>>(2, 0.02) == Approx(excess_at<decant::WendlandC2<double>>(2)));
}
