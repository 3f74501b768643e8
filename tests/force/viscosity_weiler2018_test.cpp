// SPDX-License-Identifier: MIT
#include <decant/force/viscosity_weiler2018.hpp>

#include <cmath>

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
using decant::Viscosity;
using decant::ViscosityWeiler2018;
using namespace decant::testing;

namespace {

template <class Force, class Liquid>
auto accelerations(Force& force, Liquid& liquid) {
  using Scalar = typename Liquid::Scalar;
  PointArray<Scalar> result = PointArray<Scalar>::Zero(3, liquid.fluid.size());
  force.accumulate(liquid.view(), result);
  return result;
}

}  // namespace

TEMPLATE_TEST_CASE("ViscosityWeiler2018 keeps the laws of a force", "", float, double) {
  ViscosityWeiler2018<TestType> force;
  for (const double nu : {1e-4, 1e-2, 1.0}) {
    force.kinematic_viscosity = static_cast<TestType>(nu);
    decant_test::check(force_laws<CubicSpline<TestType>>(force, Keeps::LinearAndAngular));
  }
}

TEMPLATE_TEST_CASE("ViscosityWeiler2018 keeps momentum however early it stops", "", float, double) {
  ViscosityWeiler2018<TestType> force;
  force.kinematic_viscosity = 1;
  force.most_iterations = 3;
  decant_test::check(force_laws<CubicSpline<TestType>>(force, Keeps::LinearAndAngular));
  auto liquid = loose_ball<CubicSpline<TestType>>(TestType(0.005), 4, 0.2, 1.0);
  accelerations(force, liquid);
  CHECK(force.iterations() == 3);
}

TEMPLATE_TEST_CASE("ViscosityWeiler2018 is Viscosity for short steps", "", float, double) {
  auto liquid = loose_ball<CubicSpline<TestType>>(TestType(0.005), 4, 0.2, 1.0);
  liquid.time_step = TestType(1e-7);
  Viscosity<TestType> thin;
  thin.kinematic_viscosity = TestType(1e-3);
  ViscosityWeiler2018<TestType> thick;
  thick.kinematic_viscosity = TestType(1e-3);
  const auto expected = accelerations(thin, liquid), got = accelerations(thick, liquid);
  // 1e-7 s times the largest rate, 1e-3 * 15 / d^2, is 6e-5
  CHECK((got - expected).norm() < TestType(3e-4) * expected.norm());
}

TEMPLATE_TEST_CASE("ViscosityWeiler2018 is Viscosity at the velocities that it leads to", "", float, double) {
  auto liquid = loose_ball<CubicSpline<TestType>>(TestType(0.005), 4, 0.2, 1.0);
  liquid.time_step = TestType(2e-3);
  liquid.walls.contact_count[0] = 1;
  liquid.walls.contacts_of(0)->gradient = Vector3<TestType>(100, 0, 0);
  liquid.walls.contacts_of(0)->velocity = Vector3<TestType>(0, 2, 0);
  liquid.walls.contacts_of(0)->friction = TestType(1e5);
  ViscosityWeiler2018<TestType> force;
  force.kinematic_viscosity = TestType(1e-2);
  force.tolerance = TestType(1e-5);
  const auto got = accelerations(force, liquid);
  liquid.fluid.velocity += liquid.time_step * got;
  // Viscosity without walls here: it takes walls implicitly already
  const Vector3<TestType> slip = Vector3<TestType>(liquid.fluid.velocity.col(0)) - Vector3<TestType>(0, 2, 0);
  PointArray<TestType> expected = PointArray<TestType>::Zero(3, liquid.fluid.size());
  expected.col(0) -= TestType(1e-2) * TestType(1e5) * Vector3<TestType>(0, slip[1], slip[2]);
  liquid.walls.contact_count[0] = 0;
  Viscosity<TestType> thin;
  thin.kinematic_viscosity = TestType(1e-2);
  thin.accumulate(liquid.view(), expected);
  // the residual that is left, relative to the explicit change, which is about 12 times the implicit one
  CHECK((got - expected).norm() < TestType(1e-3) * got.norm());
}

TEMPLATE_TEST_CASE("Endlessly thick liquid moves as a rigid body with the momentum that it had", "", float, double) {
  using Scalar = TestType;
  auto liquid = loose_ball<CubicSpline<Scalar>>(Scalar(0.005), 4, 0.2, 0.2);
  const Vector3<Scalar> spin(Scalar(20), Scalar(-10), Scalar(30));
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    liquid.fluid.velocity.col(i) +=
        Vector3<Scalar>(1, 0, -1) + spin.cross(Vector3<Scalar>(liquid.fluid.position.col(i)));
  }
  liquid.time_step = Scalar(0.01);
  ViscosityWeiler2018<Scalar> force;
  force.kinematic_viscosity = 10;
  force.most_iterations = 1000;
  const auto got = accelerations(force, liquid);
  CHECK(force.iterations() > 1);

  // the rigid motion with the same momenta, all masses being equal
  Vector3<double> center = Vector3<double>::Zero(), linear = Vector3<double>::Zero(), angular = Vector3<double>::Zero();
  decant::Matrix3<double> inertia = decant::Matrix3<double>::Zero();
  const double count = static_cast<double>(liquid.fluid.size());
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    center += liquid.fluid.position.col(i).template cast<double>() / count;
    linear += liquid.fluid.velocity.col(i).template cast<double>() / count;
  }
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    const Vector3<double> x = liquid.fluid.position.col(i).template cast<double>() - center;
    angular += x.cross(liquid.fluid.velocity.col(i).template cast<double>());
    inertia += x.squaredNorm() * decant::Matrix3<double>::Identity() - x * x.transpose();
  }
  const Vector3<double> omega = inertia.inverse() * angular;
  double worst = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    const Vector3<double> v = (liquid.fluid.velocity.col(i) + liquid.time_step * got.col(i)).template cast<double>();
    const Vector3<double> x = liquid.fluid.position.col(i).template cast<double>() - center;
    worst = std::max(worst, (v - linear - omega.cross(x)).norm());
  }
  CHECK(worst < 0.01);  // of noise of 0.2 m/s; 10 m^2/s leaves 1 / (1 + nu dt k^2), below 1e-3 for the longest wave
}

TEMPLATE_TEST_CASE("ViscosityWeiler2018 takes walls implicitly", "", float, double) {
  LooseLiquid<CubicSpline<TestType>> liquid;
  liquid.place(PointArray<TestType>::Zero(3, 1));
  liquid.fluid.velocity.col(0) = Vector3<TestType>(1, 0, 2);
  liquid.walls.contact_count[0] = 1;
  liquid.walls.contacts_of(0)->gradient = Vector3<TestType>(0, 0, -100);
  liquid.walls.contacts_of(0)->velocity = Vector3<TestType>(0, 3, 0);
  liquid.walls.contacts_of(0)->friction = TestType(1e4);
  ViscosityWeiler2018<TestType> force;
  for (const double nu : {1e-4, 1e-2, 1e3}) {
    force.kinematic_viscosity = static_cast<TestType>(nu);
    const auto got = accelerations(force, liquid);
    const double rate = nu * 1e4 * 1e-3;
    CHECK(static_cast<double>(got(0, 0)) * 1e-3 == Approx(-rate / (1 + rate)).epsilon(1e-3));
    CHECK(static_cast<double>(got(1, 0)) * 1e-3 == Approx(3 * rate / (1 + rate)).epsilon(1e-3));
    CHECK(std::abs(static_cast<double>(got(2, 0))) * 1e-3 < 1e-5);
  }
}

TEMPLATE_TEST_CASE("ViscosityWeiler2018 ends on a state that is not finite", "", float, double) {
  auto liquid = loose_ball<CubicSpline<TestType>>(TestType(0.005), 3, 0.2, 1.0);
  liquid.fluid.velocity(0, 5) = std::numeric_limits<TestType>::quiet_NaN();
  ViscosityWeiler2018<TestType> force;
  const auto got = accelerations(force, liquid);
  CHECK(force.iterations() <= 1);
  CHECK(std::isinf(force.largest_step(liquid.view())));
  CHECK(got.cols() == liquid.fluid.size());
}
