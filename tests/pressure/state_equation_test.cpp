// SPDX-License-Identifier: MIT
#include <decant/pressure/state_equation.hpp>
#include <decant/pressure/state_equation_schenck2017.hpp>

#include <cmath>

#include <decant/kernel/cubic_spline.hpp>
#include <decant/pressure/concept.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"

using decant::CubicSpline;
using decant::Index;
using decant::PointArray;
using decant::PressureReport;
using decant::StateEquation;
using decant::StateEquationSchenck2017;
using decant::Vector3;
using namespace decant::testing;

namespace {

/// A ball squeezed to 95 % of its size, so that most of it is under pressure.
template <class Scalar>
auto squeezed_ball(double speed, int radius = 5) {
  auto liquid = loose_ball<CubicSpline<Scalar>>(Scalar(0.005), radius, 0.15, speed);
  const PointArray<Scalar> velocity = liquid.fluid.velocity;
  liquid.place(Scalar(0.95) * liquid.fluid.position);
  liquid.fluid.velocity = velocity;
  return liquid;
}

/// What a solver adds to velocities, over the step [m/s^2].
template <class Solver, class Liquid>
auto accelerations(Solver& solver, Liquid& liquid, int threads = 1) {
  using Scalar = typename Liquid::Scalar;
  const PointArray<Scalar> before = liquid.fluid.velocity;
  liquid.threads = {threads};
  PressureReport report;
  solver.begin_step(liquid.view(), report);
  solver.solve(liquid.view(), report);
  const PointArray<Scalar> result = (liquid.fluid.velocity - before) / liquid.time_step;
  liquid.fluid.velocity = before;
  return result;
}

/// Tait's equation in double precision.
template <class Solver>
double tait(const Solver& solver, double density) {
  return static_cast<double>(solver.stiffness) * (std::pow(density / 1000, static_cast<double>(solver.exponent)) - 1);
}

template <class Liquid, class Accelerations>
void check_momentum(const Liquid& liquid, const Accelerations& acceleration) {
  Vector3<double> linear = Vector3<double>::Zero(), angular = Vector3<double>::Zero();
  double size = 0, lever = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    const Vector3<double> push =
        static_cast<double>(liquid.fluid.mass[i]) * acceleration.col(i).template cast<double>();
    const Vector3<double> x = liquid.fluid.position.col(i).template cast<double>();
    linear += push;
    angular += x.cross(push);
    size += push.norm();
    lever += push.norm() * x.norm();
  }
  const double rounding = static_cast<double>(std::numeric_limits<typename Liquid::Scalar>::epsilon());
  REQUIRE(size > 0);
  CHECK(linear.norm() < 100 * rounding * size);
  CHECK(angular.norm() < 100 * rounding * lever);
}

}  // namespace

TEMPLATE_TEST_CASE("StateEquation: pressure of a density and speed of sound", "", float, double) {
  StateEquation<TestType> solver;
  const auto p = [&](double density) {
    return static_cast<double>(solver.pressure(static_cast<TestType>(density), TestType(1000)));
  };
  CHECK(p(1000) == 0);
  CHECK(p(990) == 0);
  CHECK(p(1020) == Approx(50000 * (std::pow(1.02, 7) - 1)).epsilon(1e-4));
  CHECK(static_cast<double>(solver.sound_speed(1000)) == Approx(18.708).epsilon(1e-3));
  CHECK((p(1001) - p(1000)) / 1 == Approx(350).epsilon(0.01));  // c^2 = dp / d rho
  solver.negative_pressure = true;
  CHECK(p(990) == Approx(50000 * (std::pow(0.99, 7) - 1)).epsilon(1e-4));
  solver.exponent = TestType(6.5);
  CHECK(p(1020) == Approx(50000 * (std::pow(1.02, 6.5) - 1)).epsilon(1e-3));
  solver.exponent = 1;
  solver.set_sound_speed(20, 1000);
  CHECK(p(1020) == Approx(400 * 20).epsilon(1e-4));
  CHECK(static_cast<double>(solver.sound_speed(1000)) == Approx(20));
}

TEMPLATE_TEST_CASE("StateEquation is the symmetric pair sum with walls", "", float, double) {
  using Spline = CubicSpline<double>;
  auto liquid = squeezed_ball<TestType>(0.0);
  Index pressed = 0;
  liquid.fluid.density.maxCoeff(&pressed);  // the wall's push is proportional to the pressure
  liquid.walls.gradient.col(pressed) = Vector3<TestType>(10, -20, 30);
  StateEquation<TestType> solver;
  const auto got = accelerations(solver, liquid);
  const double h = static_cast<double>(liquid.smoothing_length);
  const auto term = [&](Index i) {
    const double density = static_cast<double>(liquid.fluid.density[i]);
    return std::max(0.0, 50000 * (std::pow(density / 1000, 7) - 1)) / (density * density);
  };
  double worst = 0, largest = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    Vector3<double> expected = -1000 * term(i) * liquid.walls.gradient.col(i).template cast<double>();
    for (Index j = 0; j < liquid.fluid.size(); ++j) {
      const Vector3<double> x = (liquid.fluid.position.col(i) - liquid.fluid.position.col(j)).template cast<double>();
      expected -= static_cast<double>(liquid.fluid.mass[j]) * (term(i) + term(j)) *
                  Spline::derivative_over_radius(x.norm(), h) * x;
    }
    worst = std::max(worst, (expected - got.col(i).template cast<double>()).norm());
    largest = std::max(largest, expected.norm());
    CHECK(static_cast<double>(liquid.fluid.pressure[i]) ==
          Approx(term(i) * std::pow(static_cast<double>(liquid.fluid.density[i]), 2)).margin(1));
  }
  CHECK(largest > 0);
  CHECK(worst < 1e-4 * largest);
}

TEMPLATE_TEST_CASE("StateEquation keeps momentum and does not know the number of threads", "", float, double) {
  auto liquid = squeezed_ball<TestType>(0.5, radius_for_four_threads);
  StateEquation<TestType> solver;
  for (const double alpha : {0.0, 0.1}) {
    solver.artificial_viscosity = static_cast<TestType>(alpha);
    const auto once = accelerations(solver, liquid);
    check_momentum(liquid, once);
    for (const int threads : {2, 4}) {
      CHECK((accelerations(solver, liquid, threads) == once));
    }
  }
}

TEMPLATE_TEST_CASE("StateEquation: artificial viscosity brakes approach and nothing else", "", float, double) {
  LooseLiquid<CubicSpline<TestType>> liquid;
  PointArray<TestType> pair(3, 2);
  pair << 0, TestType(0.005), 0, 0, 0, 0;
  liquid.place(pair);
  StateEquation<TestType> solver;
  solver.artificial_viscosity = TestType(0.1);
  liquid.fluid.velocity(0, 0) = 1;  // towards the other
  const auto towards = accelerations(solver, liquid);
  const double h = 0.005, c = std::sqrt(350.0), mass = 1.25e-4;
  const double slope = -CubicSpline<double>::derivative(0.005, h) / 0.005;
  CHECK(static_cast<double>(towards(0, 0)) ==
        Approx(-0.1 * h * c * mass / 1000 * 0.005 / (1.01 * 0.005 * 0.005) * slope * 0.005).epsilon(1e-3));
  CHECK(static_cast<double>(towards(0, 1)) == Approx(-static_cast<double>(towards(0, 0))).epsilon(1e-6));
  liquid.fluid.velocity(0, 0) = -1;
  CHECK(accelerations(solver, liquid).norm() == 0);
  liquid.fluid.velocity.col(0) = Vector3<TestType>(0, 1, 0);
  CHECK(accelerations(solver, liquid).norm() == 0);
}

TEMPLATE_TEST_CASE("StateEquation: the longest step is that of sound", "", float, double) {
  auto liquid = squeezed_ball<TestType>(0.0);
  StateEquation<TestType> solver;
  CHECK(static_cast<double>(solver.largest_step(liquid.view())) == Approx(0.3 * 0.005 / 18.708).epsilon(1e-3));
  solver.artificial_viscosity = 20;
  CHECK(solver.largest_step(liquid.view()) < TestType(0.5 * 0.3 * 0.005 / 18.708));
}

TEMPLATE_TEST_CASE("StateEquation: compressed liquid is stiffer and asks for shorter steps", "", float, double) {
  auto liquid = squeezed_ball<TestType>(0.0);
  const double ratio = static_cast<double>(liquid.fluid.density.maxCoeff()) / 1000;
  REQUIRE(ratio > 1.1);
  for (const double exponent : {1.0, 2.5, 7.0}) {
    StateEquation<TestType> solver;
    solver.exponent = static_cast<TestType>(exponent);
    accelerations(solver, liquid);
    // the slope of the pressure at that density, by differences
    const double slope = (tait(solver, 1000 * (ratio + 1e-4)) - tait(solver, 1000 * (ratio - 1e-4))) / (2e-4 * 1000);
    CHECK(static_cast<double>(solver.largest_step(liquid.view())) ==
          Approx(0.3 * 0.005 / std::sqrt(slope)).epsilon(1e-3));
  }
}

TEMPLATE_TEST_CASE("StateEquation survives few particles and two at one place", "", float, double) {
  LooseLiquid<CubicSpline<TestType>> liquid;
  StateEquation<TestType> solver;
  solver.artificial_viscosity = TestType(0.1);
  for (const Index count : {0, 1, 2}) {
    liquid.place(PointArray<TestType>::Zero(3, count));
    CHECK(accelerations(solver, liquid).allFinite());
  }
}

TEMPLATE_TEST_CASE("StateEquationSchenck2017 is short of a factor of density squared", "", float, double) {
  auto liquid = squeezed_ball<TestType>(0.0);
  StateEquationSchenck2017<TestType> printed;
  StateEquation<TestType> standard;
  standard.exponent = 1;
  standard.set_sound_speed(printed.sound_speed, liquid.rest_density);
  const auto got = accelerations(printed, liquid), full = accelerations(standard, liquid);
  double product = 0, square = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    product += static_cast<double>(got.col(i).dot(full.col(i)));
    square += static_cast<double>(full.col(i).squaredNorm());
  }
  // rho_i rho_j where the pressure is: squeezed to 1.17 times rest density, uneven
  CHECK(square / product > 1.0e6);
  CHECK(square / product < 1.7e6);
  check_momentum(liquid, got);
  auto shared_out = squeezed_ball<TestType>(0.0, radius_for_four_threads);
  const auto alone = accelerations(printed, shared_out);
  for (const int threads : {2, 4}) {
    CHECK((accelerations(printed, shared_out, threads) == alone));
  }
  CHECK(static_cast<double>(printed.largest_step(liquid.view())) == Approx(0.4 * 0.005 / 20));
}

TEMPLATE_TEST_CASE("StateEquationSchenck2017 is the printed sum", "", float, double) {
  using Spline = CubicSpline<double>;
  auto liquid = squeezed_ball<TestType>(0.0);
  Index pressed = 0;
  liquid.fluid.density.maxCoeff(&pressed);  // the wall's push is proportional to the pressure
  liquid.walls.gradient.col(pressed) = Vector3<TestType>(10, -20, 30);
  StateEquationSchenck2017<TestType> solver;
  const auto got = accelerations(solver, liquid);
  const double h = static_cast<double>(liquid.smoothing_length);
  const auto density = [&](Index i) { return static_cast<double>(liquid.fluid.density[i]); };
  const auto term = [&](Index i) { return 4e8 * std::max(0.0, density(i) - 1000) / (density(i) * density(i)); };
  double worst = 0, largest = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    Vector3<double> force = -1 * term(i) * liquid.walls.gradient.col(i).template cast<double>();
    for (Index j = 0; j < liquid.fluid.size(); ++j) {
      const Vector3<double> x = (liquid.fluid.position.col(i) - liquid.fluid.position.col(j)).template cast<double>();
      force -= static_cast<double>(liquid.fluid.mass[j]) / density(j) * (term(i) + term(j)) *
               Spline::derivative_over_radius(x.norm(), h) * x;
    }
    worst = std::max(worst, (force / density(i) - got.col(i).template cast<double>()).norm());
    largest = std::max(largest, (force / density(i)).norm());
  }
  CHECK(largest > 0);
  CHECK(worst < 1e-3 * largest);  // density - rest density keeps four digits in float
}
