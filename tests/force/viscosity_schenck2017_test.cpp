// SPDX-License-Identifier: MIT
#include <decant/force/viscosity_schenck2017.hpp>

#include <cmath>
#include <numbers>

#include <decant/force/concept.hpp>
#include <decant/force/viscosity.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"
#include "laws.hpp"

using decant::CubicSpline;
using decant::Index;
using decant::PointArray;
using decant::Vector3;
using decant::ViscositySchenck2017;
using namespace decant::testing;

TEMPLATE_TEST_CASE("ViscositySchenck2017 keeps the laws of a force but not momentum", "", float, double) {
  ViscositySchenck2017<TestType> force;
  force.kinematic_viscosity = TestType(1e-3);
  decant_test::check(force_laws<CubicSpline<TestType>>(force, Keeps::Neither));
}

TEMPLATE_TEST_CASE("ViscositySchenck2017 is the printed sum", "", float, double) {
  auto liquid = loose_ball<CubicSpline<TestType>>(TestType(0.005), 3, 0.2, 1.0);
  ViscositySchenck2017<TestType> force;
  force.kinematic_viscosity = TestType(1e-3);
  PointArray<TestType> got = PointArray<TestType>::Zero(3, liquid.fluid.size());
  force.accumulate(liquid.view(), got);
  const double support = 0.01, mu = 1e-3 * 1000;
  double worst = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    Vector3<double> expected = Vector3<double>::Zero();
    const auto term = [&](Index k) {
      const double density = static_cast<double>(liquid.fluid.density[k]);
      return Vector3<double>(liquid.fluid.velocity.col(k).template cast<double>() / (density * density));
    };
    for (Index j = 0; j < liquid.fluid.size(); ++j) {
      const double r = static_cast<double>((liquid.fluid.position.col(i) - liquid.fluid.position.col(j)).norm());
      if (j != i && r < support) {
        const double laplacian = 45 / (std::numbers::pi * std::pow(support, 6)) * (support - r);
        expected -= mu * static_cast<double>(liquid.fluid.mass[j]) * laplacian * (term(i) + term(j));
      }
    }
    worst = std::max(worst, (expected - got.col(i).template cast<double>()).norm() / (1 + expected.norm()));
  }
  CHECK(worst < 2e-5);
}

TEMPLATE_TEST_CASE("ViscositySchenck2017 brakes uniform motion and Viscosity does not", "", float, double) {
  auto liquid = loose_ball<CubicSpline<TestType>>(TestType(0.005), 5, 0.1, 0.0);
  liquid.fluid.velocity.row(2).setConstant(-2);
  ViscositySchenck2017<TestType> printed;
  printed.kinematic_viscosity = TestType(1e-3);
  decant::Viscosity<TestType> standard;
  standard.kinematic_viscosity = TestType(1e-3);
  PointArray<TestType> braked = PointArray<TestType>::Zero(3, liquid.fluid.size()), kept = braked;
  printed.accumulate(liquid.view(), braked);
  standard.accumulate(liquid.view(), kept);
  CHECK(kept.cwiseAbs().maxCoeff() == 0);
  CHECK(braked.row(2).minCoeff() > 0);
  // inside: 2 nu 15 / H^2, less the particle's own share of the integral, (d/H)^3 * 45 / pi = 1.79 of 15
  Index inside = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    inside = liquid.fluid.position.col(i).norm() < liquid.fluid.position.col(inside).norm() ? i : inside;
  }
  CHECK(static_cast<double>(braked(2, inside)) / 2 == Approx(2e-3 * (15 - 1.79) / 1e-4).epsilon(0.1));
}

TEMPLATE_TEST_CASE("ViscositySchenck2017 does not overshoot at its longest step", "", float, double) {
  auto liquid = loose_ball<CubicSpline<TestType>>(TestType(0.005), 4, 0.1, 0.0);
  liquid.fluid.velocity.row(0).setConstant(1);
  ViscositySchenck2017<TestType> force;
  force.kinematic_viscosity = TestType(1e-2);
  PointArray<TestType> acceleration = PointArray<TestType>::Zero(3, liquid.fluid.size());
  force.accumulate(liquid.view(), acceleration);
  const TestType dt = force.largest_step(liquid.view());
  CHECK((liquid.fluid.velocity + dt * acceleration).row(0).minCoeff() > 0);
  CHECK((liquid.fluid.velocity + dt * acceleration).row(0).minCoeff() < TestType(0.8));
  force.kinematic_viscosity = 0;
  CHECK(std::isinf(force.largest_step(liquid.view())));
}
