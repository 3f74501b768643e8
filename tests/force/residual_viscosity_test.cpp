// SPDX-License-Identifier: MIT
#include <decant/force/residual_viscosity.hpp>

#include <cmath>
#include <optional>

#include <decant/force/concept.hpp>
#include <decant/force/viscosity.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/kernel/wendland_c2.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"
#include "laws.hpp"

using decant::CubicSpline;
using decant::Index;
using decant::PointArray;
using decant::ResidualViscosity;
using decant::Vector3;
using namespace decant::testing;

TEMPLATE_TEST_CASE("ResidualViscosity keeps the laws of a force", "", float, double) {
  ResidualViscosity<TestType> force;
  force.numerical_viscosity = TestType(1e-3);
  decant_test::check(force_laws<CubicSpline<TestType>>(force, Keeps::LinearAndAngular));
  decant_test::check(force_laws<decant::WendlandC2<TestType>>(force, Keeps::LinearAndAngular));
  force.numerical_viscosity = TestType(1e9);  // as much as all passes stand
  decant_test::check(force_laws<CubicSpline<TestType>>(force, Keeps::LinearAndAngular));
}

namespace {

/// Power that a force takes out of the middle of a disordered ball with this velocity field, over what plain viscosity
/// of the same size takes out of jitter as large as that field [-].
template <class Velocity>
double relative_power(Velocity&& velocity) {
  using Kernel = CubicSpline<double>;
  const double nu = 1e-3;
  auto liquid = loose_ball<Kernel>(0.005, 8, 0.2, 1.0);
  const auto power_over_square = [&](auto& force) {
    PointArray<double> acceleration = PointArray<double>::Zero(3, liquid.fluid.size());
    force.accumulate(liquid.view(), acceleration);
    double power = 0, square = 0;
    for (Index i = 0; i < liquid.fluid.size(); ++i) {
      if (liquid.fluid.position.col(i).norm() < 5 * liquid.spacing) {
        power -= acceleration.col(i).dot(liquid.fluid.velocity.col(i));
        square += liquid.fluid.velocity.col(i).squaredNorm();
      }
    }
    return power / square;
  };
  decant::Viscosity<double> plain;
  plain.kinematic_viscosity = nu;
  const double jitter = power_over_square(plain);
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    if (const auto v = velocity(Vector3<double>(liquid.fluid.position.col(i) / liquid.spacing)); v.has_value()) {
      liquid.fluid.velocity.col(i) = *v;
    }
  }
  ResidualViscosity<double> residual;
  residual.numerical_viscosity = nu;
  return power_over_square(residual) / jitter;
}

using Maybe = std::optional<Vector3<double>>;

}  // namespace

TEST_CASE("ResidualViscosity leaves linear velocities alone and brakes jitter as viscosity does") {
  const auto linear = [](const Vector3<double>& x) {
    return Maybe(Vector3<double>(0.3 * x.x() - x.y() + 1, 0.5 * x.z() - 0.2 * x.x(), -0.3 * x.z() + 0.1 * x.y()));
  };
  CHECK(std::abs(relative_power(linear)) < 1e-4);
  const auto jitter = [](const Vector3<double>&) { return Maybe(); };
  CHECK(relative_power(jitter) == Approx(1).margin(0.3));
}

TEST_CASE("ResidualViscosity brakes long waves by the square of their wave number less") {
  const auto wave = [](double wave_number) {
    return [wave_number](const Vector3<double>& x) {
      return Maybe(Vector3<double>(0, std::sin(wave_number * x.x() + 0.4), 0));
    };
  };
  const double longer = relative_power(wave(0.3)), shorter = relative_power(wave(0.6));
  CHECK(longer > 0);
  CHECK(longer < 0.02);
  // fourth power of the wave number; plain viscosity has the second, 4
  CHECK(shorter / longer > 10);
  CHECK(shorter / longer < 20);
}

TEST_CASE("ResidualViscosity grows with the square root of pressure, as far as the sub-step stands it") {
  using Kernel = CubicSpline<double>;
  auto liquid = loose_ball<Kernel>(0.005, 5, 0.2, 1.0);
  const double head = 2.0;  // [m^2/s^2], 20 cm of water
  const auto strength = [&](double least, double share, double pressure, double time_step) {
    liquid.fluid.pressure.setConstant(pressure);
    ResidualViscosity<double> force;
    force.numerical_viscosity = least;
    force.pressure_share = share;
    auto step = liquid.view();
    step.time_step = time_step;
    PointArray<double> acceleration = PointArray<double>::Zero(3, liquid.fluid.size());
    force.accumulate(step, acceleration);
    return acceleration.norm();
  };
  const double rest_density = liquid.view().rest_density, nu = 0.2 * 0.005 * std::sqrt(head);
  const double one = strength(nu, 0, 0, 1e-5);
  CHECK(strength(0, 0.2, head * rest_density, 1e-5) == Approx(one));
  CHECK(strength(0, 0.2, 4 * head * rest_density, 1e-5) == Approx(2 * one));
  CHECK(strength(0.5 * nu, 0.2, -head * rest_density, 1e-5) == Approx(0.5 * one));
  CHECK(strength(0, 0, head * rest_density, 1e-5) == 0);
  const double most = strength(1e9, 0, 0, 0.01);
  CHECK(strength(1e9, 0, 0, 0.02) == Approx(0.5 * most));
  CHECK(strength(0, 0.2, 1e12, 0.02) == Approx(0.5 * most));
}

TEST_CASE("ResidualViscosity takes another pass where one would not stand what is asked for") {
  using Kernel = CubicSpline<double>;
  auto liquid = loose_ball<Kernel>(0.005, 8, 0.2, 1.0);
  const PointArray<double> jitter = liquid.fluid.velocity;
  auto step = liquid.view();
  step.time_step = 0.01;
  // kinetic energy that so many sub-steps leave of jitter in the middle
  const auto left_over = [&](double nu, int most_passes, int sub_steps) {
    ResidualViscosity<double> force;
    force.numerical_viscosity = nu;
    force.most_passes = most_passes;
    liquid.fluid.velocity = jitter;
    for (int k = 0; k < sub_steps; ++k) {
      PointArray<double> acceleration = PointArray<double>::Zero(3, liquid.fluid.size());
      force.accumulate(step, acceleration);
      liquid.fluid.velocity += step.time_step * acceleration;
    }
    double before = 0, after = 0;
    for (Index i = 0; i < liquid.fluid.size(); ++i) {
      if (liquid.fluid.position.col(i).norm() < 5 * liquid.spacing) {
        before += jitter.col(i).squaredNorm();
        after += liquid.fluid.velocity.col(i).squaredNorm();
      }
    }
    return after / before;
  };
  const double one = left_over(1e9, 1, 1), two = left_over(1e9, 2, 1), three = left_over(1e9, 3, 1);
  CHECK(one < 0.5);
  // the second pass sees what the first one left, but for gradients, as another sub-step would
  const double again = left_over(1e9, 1, 2);
  CHECK(two < one - 0.7 * (one - again));
  CHECK(three < two);
  // what one pass stands is one pass, however many there may be
  const double stands = 0.1 * 0.005 * 0.005 / 0.01;
  CHECK(left_over(stands, 3, 1) == left_over(stands, 1, 1));
}
