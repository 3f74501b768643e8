// SPDX-License-Identifier: MIT
#include <decant/force/viscosity.hpp>

#include <algorithm>
#include <cmath>

#include <decant/force/concept.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/kernel/wendland_c2.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"
#include "laws.hpp"

using decant::CubicSpline;
using decant::Index;
using decant::PointArray;
using decant::Vector3;
using decant::Viscosity;
using namespace decant::testing;

TEMPLATE_TEST_CASE("Viscosity keeps the laws of a force", "", float, double) {
  Viscosity<TestType> force;
  force.kinematic_viscosity = TestType(1e-3);
  decant_test::check(force_laws<CubicSpline<TestType>>(force, Keeps::LinearAndAngular));
  decant_test::check(force_laws<decant::WendlandC2<TestType>>(force, Keeps::LinearAndAngular));
}

TEMPLATE_TEST_CASE("Viscosity of zero leaves everything as it is", "", float, double) {
  auto liquid = loose_ball<CubicSpline<TestType>>(TestType(0.005), 3, 0.1, 1.0);
  Viscosity<TestType> force;
  force.kinematic_viscosity = 0;
  PointArray<TestType> acceleration = PointArray<TestType>::Zero(3, liquid.fluid.size());
  force.accumulate(liquid.view(), acceleration);
  CHECK(acceleration.cwiseAbs().maxCoeff() == 0);
  CHECK(std::isinf(force.largest_step(liquid.view())));
}

TEMPLATE_TEST_CASE("Viscosity brakes shear waves as the Laplacian does", "", float, double) {
  using Scalar = TestType;
  Viscosity<Scalar> force;
  force.kinematic_viscosity = Scalar(2e-3);
  // A lattice answers a little differently along its axes and its diagonals; here directions are averaged over: forty
  // waves.
  auto liquid = loose_ball<CubicSpline<Scalar>>(Scalar(0.005), 7, 0.0, 0.0);
  const Scalar wave_number = Scalar(0.3) / liquid.spacing;
  double product = 0, square = 0;
  for (int n = 0; n < 40; ++n) {
    const double up = 1 - (2 * n + 1) / 40.0, turn = 2.399963 * n;  // Fibonacci lattice on the sphere
    const Vector3<double> along(std::sqrt(1 - up * up) * std::cos(turn), std::sqrt(1 - up * up) * std::sin(turn), up);
    const Vector3<Scalar> k = along.cast<Scalar>();
    const Vector3<double> other(std::cos(1.7 * n), std::sin(1.7 * n), 0.3);
    const Vector3<Scalar> across = along.cross(other).normalized().cast<Scalar>();
    for (Index i = 0; i < liquid.fluid.size(); ++i) {
      liquid.fluid.velocity.col(i) = std::sin(wave_number * k.dot(liquid.fluid.position.col(i))) * across;
    }
    PointArray<Scalar> acceleration = PointArray<Scalar>::Zero(3, liquid.fluid.size());
    force.accumulate(liquid.view(), acceleration);
    for (Index i = 0; i < liquid.fluid.size(); ++i) {
      if (liquid.fluid.position.col(i).norm() < 4 * liquid.spacing) {
        product += static_cast<double>(acceleration.col(i).dot(liquid.fluid.velocity.col(i)));
        square += static_cast<double>(liquid.fluid.velocity.col(i).squaredNorm());
      }
    }
  }
  const double rate = static_cast<double>(force.kinematic_viscosity * wave_number * wave_number);
  // sum instead of integral - 1 %, (k h)^2 terms - 1.5 %
  CHECK(-product / square == Approx(rate).epsilon(0.03));
}

TEMPLATE_TEST_CASE("Viscosity is nearly the same for shear and for strain, even on a lattice", "", float, double) {
  using Scalar = TestType;
  Viscosity<Scalar> force;
  force.kinematic_viscosity = Scalar(2e-3);
  auto liquid = loose_ball<CubicSpline<Scalar>>(Scalar(0.005), 4, 0.0, 0.0);
  Index middle = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    middle = liquid.fluid.position.col(i).norm() < liquid.fluid.position.col(middle).norm() ? i : middle;
  }
  // The force on the particle in the middle, while velocities along x are the square of how far they are along an axis.
  const auto brake = [&](Index axis) {
    for (Index i = 0; i < liquid.fluid.size(); ++i) {
      const Scalar apart = liquid.fluid.position(axis, i) - liquid.fluid.position(axis, middle);
      liquid.fluid.velocity.col(i) = Vector3<Scalar>(apart * apart, 0, 0);
    }
    PointArray<Scalar> acceleration = PointArray<Scalar>::Zero(3, liquid.fluid.size());
    force.accumulate(liquid.view(), acceleration);
    return static_cast<double>(acceleration(0, middle) / (2 * force.kinematic_viscosity));
  };
  // nu (laplace v + 2 grad div v); 0.715 and 1.228 times that with the cubic spline's slope in place of the hat
  CHECK(brake(2) == Approx(1).epsilon(0.06));
  CHECK(brake(0) == Approx(3).epsilon(0.06));
}

TEMPLATE_TEST_CASE("Viscosity does not brake rigid motion", "", float, double) {
  using Scalar = TestType;
  auto liquid = loose_ball<CubicSpline<Scalar>>(Scalar(0.005), 4, 0.2, 0.0);
  const Vector3<Scalar> spin(Scalar(3), Scalar(-2), Scalar(5));
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    liquid.fluid.velocity.col(i) = Vector3<Scalar>(1, 2, 3) + spin.cross(Vector3<Scalar>(liquid.fluid.position.col(i)));
  }
  Viscosity<Scalar> force;
  force.kinematic_viscosity = Scalar(1e-3);
  PointArray<Scalar> acceleration = PointArray<Scalar>::Zero(3, liquid.fluid.size());
  force.accumulate(liquid.view(), acceleration);
  // v_ij is a difference of speeds near 4 m/s; 1e-3 * 15 / d^2 is the rate it is multiplied with
  const double rounding = 4.0 * static_cast<double>(std::numeric_limits<Scalar>::epsilon()) * 1e-3 * 15 / 2.5e-5;
  CHECK(static_cast<double>(acceleration.cwiseAbs().maxCoeff()) < 10 * rounding);
}

TEMPLATE_TEST_CASE("Viscosity is stable at its longest step", "", float, double) {
  using Scalar = TestType;
  auto liquid = loose_ball<CubicSpline<Scalar>>(Scalar(0.005), 4, 0.2, 1.0);
  Viscosity<Scalar> force;
  force.kinematic_viscosity = Scalar(1e-2);
  const Scalar dt = force.largest_step(liquid.view());
  CHECK(static_cast<double>(dt) == Approx(0.1325 * 2.5e-5 / 1e-2).epsilon(0.01));
  double energy = static_cast<double>(liquid.fluid.velocity.squaredNorm());
  for (int k = 0; k < 100; ++k) {
    PointArray<Scalar> acceleration = PointArray<Scalar>::Zero(3, liquid.fluid.size());
    force.accumulate(liquid.view(), acceleration);
    liquid.fluid.velocity += dt * acceleration;
    const double after = static_cast<double>(liquid.fluid.velocity.squaredNorm());
    REQUIRE(after <= energy * (1 + 1e-6));
    energy = after;
  }
}

TEMPLATE_TEST_CASE("Walls that hold the liquid pull it along and never overshoot", "", float, double) {
  using Scalar = TestType;
  LooseLiquid<CubicSpline<Scalar>> liquid;
  liquid.place(PointArray<Scalar>::Zero(3, 1));
  liquid.fluid.velocity.col(0) = Vector3<Scalar>(1, 0, 2);
  liquid.walls.contact_count[0] = 1;
  auto& contact = *liquid.walls.contacts_of(0);
  contact.gradient = Vector3<Scalar>(0, 0, -100);
  contact.velocity = Vector3<Scalar>(0, 3, 0);
  contact.friction = Scalar(1e4);
  Viscosity<Scalar> force;
  for (const double nu : {1e-6, 1e-2, 1e2}) {
    force.kinematic_viscosity = static_cast<Scalar>(nu);
    PointArray<Scalar> acceleration = PointArray<Scalar>::Zero(3, 1);
    force.accumulate(liquid.view(), acceleration);
    const double rate = nu * 1e4, dt = static_cast<double>(liquid.time_step);
    const double fraction = std::min(rate * dt, 1.0);  // of the slip that one step takes away
    CHECK(static_cast<double>(acceleration(0, 0)) * dt == Approx(-fraction).epsilon(1e-4));
    CHECK(static_cast<double>(acceleration(1, 0)) * dt == Approx(3 * fraction).epsilon(1e-4));
    CHECK(acceleration(2, 0) == 0);
  }
  // What pushes the liquid does not change the pull: it may be gravity, which pressure will balance.
  liquid.fluid.velocity.col(0) = Vector3<Scalar>(0, 3, 0);
  PointArray<Scalar> acceleration = PointArray<Scalar>::Constant(3, 1, Scalar(2));
  force.accumulate(liquid.view(), acceleration);
  CHECK(acceleration == PointArray<Scalar>::Constant(3, 1, Scalar(2)));
  contact.friction = 0;
  acceleration.setZero();
  force.accumulate(liquid.view(), acceleration);
  CHECK(acceleration.norm() == 0);
}
