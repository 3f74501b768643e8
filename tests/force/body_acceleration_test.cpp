// SPDX-License-Identifier: MIT
#include <decant/force/body_acceleration.hpp>

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

struct PulledParts : decant::DefaultParts<double> {
  using Forces = std::tuple<decant::Gravity<double>, decant::BodyAcceleration<double>>;
};

/// One particle that starts at rest, in sub-steps of this length, under weight and a pull.
decant::Simulator<PulledParts> pulled(const decant::BodyAcceleration<double>& pull, double sub_step,
                                      const decant::Vector3<double>& gravity = {0, 0, 0}) {
  decant::SimulatorSettings settings;
  settings.threads = {1};
  settings.gravity = gravity;
  settings.fixed_step = sub_step;
  decant::Simulator<PulledParts> simulator(settings);
  simulator.force<decant::BodyAcceleration<double>>() = pull;
  simulator.add_particles(decant::PointArray<double>::Zero(3, 1), decant::PointArray<double>::Zero(3, 1), 0);
  return simulator;
}

const double without_end = std::numeric_limits<double>::infinity();

}  // namespace

TEMPLATE_TEST_CASE("body acceleration keeps the laws of a force", "", float, double) {
  decant::BodyAcceleration<TestType> force;
  force.pull = {1, -2, 3};
  decant_test::check(
      decant::testing::force_laws<decant::CubicSpline<TestType>>(force, decant::testing::Keeps::Neither));
}

TEST_CASE("body acceleration: what is pulled all the time goes half of pull times time squared") {
  const double sub_step = 1e-3, seconds = 0.5;
  auto simulator = pulled({{1, -2, 0}}, sub_step, {0, 0, -9.81});
  REQUIRE(simulator.step(seconds).advanced());
  // places move by the speed at the end of a sub-step
  const double way = 0.5 * seconds * (seconds + sub_step);
  CHECK(simulator.fluid().position(0, 0) == Approx(way).epsilon(1e-9));
  CHECK(simulator.fluid().position(1, 0) == Approx(-2 * way).epsilon(1e-9));
  CHECK(simulator.fluid().position(2, 0) == Approx(-9.81 * way).epsilon(1e-9));
  CHECK(simulator.fluid().velocity(0, 0) == Approx(seconds).epsilon(1e-9));
}

TEST_CASE("body acceleration: a window's impulse does not depend on sub-steps") {
  const double from = 0.1234, until = 0.3017, pull = 7;
  for (const double sub_step : {0.0007, 0.013, 0.25, 1.0}) {
    CAPTURE(sub_step);
    auto simulator = pulled({{0, pull, 0}, from, until}, sub_step);
    REQUIRE(simulator.step(0.1).advanced());
    CHECK(simulator.fluid().velocity.norm() == 0);
    REQUIRE(simulator.step(0.1).advanced());
    CHECK(simulator.fluid().velocity(1, 0) == Approx(pull * (0.2 - from)).epsilon(1e-9));
    REQUIRE(simulator.step(0.8).advanced());
    CHECK(simulator.fluid().velocity(1, 0) == Approx(pull * (until - from)).epsilon(1e-9));
  }
}

TEST_CASE("body acceleration: a window shorter than a sub-step, and ones open to a side") {
  auto gust = pulled({{100, 0, 0}, 0.41, 0.42}, 1);
  REQUIRE(gust.step(1).advanced());
  CHECK(gust.fluid().velocity(0, 0) == Approx(1).epsilon(1e-9));
  auto later = pulled({{1, 0, 0}, 0.4, without_end}, 0.3);
  REQUIRE(later.step(1).advanced());
  CHECK(later.fluid().velocity(0, 0) == Approx(0.6).epsilon(1e-9));
  auto earlier = pulled({{1, 0, 0}, -without_end, 0.4}, 0.3);
  REQUIRE(earlier.step(1).advanced());
  CHECK(earlier.fluid().velocity(0, 0) == Approx(0.4).epsilon(1e-9));
}

TEMPLATE_TEST_CASE("body acceleration changes no bit where there is none", "", float, double) {
  using Scalar = TestType;
  using Pull = decant::BodyAcceleration<Scalar>;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  auto liquid = decant::testing::loose_ball<decant::CubicSpline<Scalar>>(Scalar(0.005), 3, 0.1, 1.0);
  const decant::PointArray<Scalar> before = decant::PointArray<Scalar>::Random(3, liquid.fluid.size());
  // the sub-step begins at 0
  for (Pull force : {Pull{}, Pull{{1, 1, 1}, 0, 0}, Pull{{1, 1, 1}, 5e-4, 3e-4}, Pull{{1, 1, 1}, nan, without_end},
                     Pull{{1, 1, 1}, -without_end, nan}, Pull{{1, 1, 1}, -2, -1}, Pull{{1, 1, 1}, 1e-3, 2}}) {
    CAPTURE(force.from, force.until);
    auto step = liquid.view();
    step.time_step = Scalar(0x1p-10);
    decant::PointArray<Scalar> acceleration = before;
    force.accumulate(step, acceleration);
    CHECK(acceleration == before);
  }
  // and inside of the window nothing is lost by rounding
  Pull force{{1, 1, 1}, -0.3, 1e6};
  auto step = liquid.view();
  step.time = 1.1;
  decant::PointArray<Scalar> acceleration = decant::PointArray<Scalar>::Zero(3, liquid.fluid.size());
  force.accumulate(step, acceleration);
  CHECK(acceleration == decant::PointArray<Scalar>::Ones(3, liquid.fluid.size()));
}
