// SPDX-License-Identifier: MIT
#include <decant/force/quadratic_drag.hpp>

#include <cmath>
#include <limits>
#include <tuple>

#include <decant/force/concept.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"
#include "laws.hpp"

namespace {

struct DraggedParts : decant::DefaultParts<double> {
  using Forces = std::tuple<decant::Gravity<double>, decant::QuadraticDrag<double>>;
};

/// One particle, which nothing but weight and drag acts on, in sub-steps of this length.
decant::Simulator<DraggedParts> flying(double drag, const decant::Vector3<double>& velocity,
                                       const decant::Vector3<double>& medium, const decant::Vector3<double>& gravity,
                                       double sub_step) {
  decant::SimulatorSettings settings;
  settings.threads = {1};
  settings.gravity = gravity;
  settings.fixed_step = sub_step;
  decant::Simulator<DraggedParts> simulator(settings);
  simulator.force<decant::QuadraticDrag<double>>() = {drag, medium};
  decant::PointArray<double> speed(3, 1);
  speed.col(0) = velocity;
  simulator.add_particles(decant::PointArray<double>::Zero(3, 1), speed, 0);
  return simulator;
}

const decant::Vector3<double> weightless(0, 0, 0);

}  // namespace

TEMPLATE_TEST_CASE("quadratic drag keeps the laws of a force", "", float, double) {
  decant::QuadraticDrag<TestType> force;
  force.drag = 3;
  force.medium = {1, 0, 0};
  decant_test::check(
      decant::testing::force_laws<decant::CubicSpline<TestType>>(force, decant::testing::Keeps::Neither));
}

TEST_CASE("quadratic drag: the inverse of speed grows evenly, however long sub-steps are") {
  const double drag = 2, start = 5, seconds = 0.4;
  const double left = 1 / (1 / start + drag * seconds);
  for (const double sub_step : {0.4, 0.05, 0.003}) {
    auto simulator = flying(drag, {0.6 * start + 1, 0, 0.8 * start}, {1, 0, 0}, weightless, sub_step);
    REQUIRE(simulator.step(seconds).advanced());
    CHECK(simulator.fluid().velocity(0, 0) == Approx(0.6 * left + 1).epsilon(1e-9));
    CHECK(simulator.fluid().velocity(1, 0) == 0);
    CHECK(simulator.fluid().velocity(2, 0) == Approx(0.8 * left).epsilon(1e-9));
  }
}

TEST_CASE("quadratic drag: the way that is left is the logarithm of the time") {
  auto simulator = flying(2, {5, 0, 0}, {0, 0, 0}, weightless, 1e-4);
  REQUIRE(simulator.step(0.2).advanced());
  // places move by the speed at the end of a sub-step: half a sub-step of what speed is lost, 2e-4 of the way
  CHECK(simulator.fluid().position(0, 0) == Approx(std::log1p(2 * 5 * 0.2) / 2).epsilon(1e-3));
}

TEST_CASE("quadratic drag: what falls gets as fast as the root of weight over drag") {
  const double drag = 0.8, terminal = std::sqrt(9.81 / drag), sub_step = 1e-3;
  auto simulator = flying(drag, {0, 0, 0}, {0, 0, 0}, {0, 0, -9.81}, sub_step);
  const double time = terminal / 9.81;
  REQUIRE(simulator.step(time).advanced());
  // a sub-step's drag is of the speed before weight has acted: half of drag * speed * sub-step too little
  const double error = drag * terminal * sub_step;
  CHECK(simulator.fluid().velocity(2, 0) == Approx(-terminal * std::tanh(1.0)).epsilon(error));
  REQUIRE(simulator.step(4 * time).advanced());
  CHECK(simulator.fluid().velocity(2, 0) == Approx(-terminal).epsilon(error));
}

TEMPLATE_TEST_CASE("quadratic drag of less than nothing, none or NaN changes no bit", "", float, double) {
  using Scalar = TestType;
  auto liquid = decant::testing::loose_ball<decant::CubicSpline<Scalar>>(Scalar(0.005), 3, 0.1, 1.0);
  for (const Scalar drag : {Scalar(0), Scalar(-1), std::numeric_limits<Scalar>::quiet_NaN()}) {
    decant::QuadraticDrag<Scalar> force{drag, {5, 5, 5}};
    const decant::PointArray<Scalar> before = decant::PointArray<Scalar>::Random(3, liquid.fluid.size());
    decant::PointArray<Scalar> acceleration = before;
    force.accumulate(liquid.view(), acceleration);
    CHECK(acceleration == before);
    CHECK(std::isinf(force.largest_step(liquid.view())));
  }
}
