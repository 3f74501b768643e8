// SPDX-License-Identifier: MIT
#include <decant/force/suction.hpp>

#include <algorithm>
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

struct DrawnParts : decant::DefaultParts<double> {
  using Forces = std::tuple<decant::Suction<double>>;
};

/// What liquid at x is accelerated by.
template <class Scalar>
decant::Vector3<double> suction_at(decant::Suction<Scalar> suction, const decant::Vector3<double>& x) {
  decant::testing::LooseLiquid<decant::CubicSpline<Scalar>> liquid;
  liquid.place(x.cast<Scalar>());
  decant::PointArray<Scalar> acceleration = decant::PointArray<Scalar>::Zero(3, 1);
  suction.accumulate(liquid.view(), acceleration);
  return acceleration.col(0).template cast<double>();
}

}  // namespace

TEMPLATE_TEST_CASE("suction keeps the laws of a force", "", float, double) {
  decant::Suction<TestType> force;
  force.strength = 3;
  force.point = {TestType(0.01), 0, 0};
  decant_test::check(
      decant::testing::force_laws<decant::CubicSpline<TestType>>(force, decant::testing::Keeps::Neither));
}

TEMPLATE_TEST_CASE("suction points to its point and has the strength that it is given", "", float, double) {
  decant::Suction<TestType> force;
  force.strength = 3;
  force.point = {1, 2, 3};
  const decant::Vector3<double> point(1, 2, 3), aside = decant::Vector3<double>(2, -1, 2) / 3;
  for (const double core_radius : {0.001, 0.01, 0.08}) {
    force.core_radius = static_cast<TestType>(core_radius);
    const decant::Vector3<double> a = suction_at(force, point + 0.05 * aside);
    // places have a few digits less after a distance is taken from them
    CHECK((a + 3 * aside).norm() < (sizeof(TestType) == 4 ? 1e-4 : 1e-12));
  }
}

TEMPLATE_TEST_CASE("suction falls as the square of the distance and is finite in the core", "", float, double) {
  decant::Suction<TestType> force;
  force.strength = 2;
  force.core_radius = TestType(0.01);
  const auto at = [&](double r) { return suction_at(force, {0, 0, r})[2]; };
  const double c = 0.01, factor = 2 * std::pow(0.05 * 0.05 + c * c, 1.5) / 0.05;
  for (const double r : {1e-4, 0.005, 0.02, 0.05, 0.3, 2.0}) {
    CHECK(at(r) == Approx(-factor * r * std::pow(r * r + c * c, -1.5)).epsilon(1e-5));
    CHECK(at(-r) == -at(r));
  }
  CHECK(at(2) / at(4) == Approx(4).epsilon(1e-4));
  // the same through all spheres that are large against the core
  CHECK(at(0.8) * 0.8 * 0.8 == Approx(at(0.2) * 0.2 * 0.2).epsilon(0.005));
  CHECK(at(0) == 0);
  const double largest = at(-c / std::sqrt(2.0));
  CHECK(largest == Approx(2 / std::sqrt(27.0) * factor / (c * c)).epsilon(1e-5));
  CHECK(at(-0.9 * c / std::sqrt(2.0)) < largest);
  CHECK(at(-1.1 * c / std::sqrt(2.0)) < largest);
}

TEST_CASE("suction does the work of its potential on what falls into it") {
  decant::SimulatorSettings settings;
  settings.threads = {1};
  settings.fixed_step = 1e-4;
  decant::Simulator<DrawnParts> simulator(settings);
  const double strength = 4, c = 0.01;
  simulator.force<decant::Suction<double>>() = {strength, {0.1, 0, 0}, 0.05, c};
  decant::PointArray<double> place(3, 1), velocity(3, 1);
  place.col(0) = decant::Vector3<double>(0, 0, 0.02);
  velocity.col(0) = decant::Vector3<double>(0, 0.1, 0);  // aside, so that it passes the point in a bow
  simulator.add_particles(place, velocity, 0);
  const double factor = strength * std::pow(0.05 * 0.05 + c * c, 1.5) / 0.05;
  double nearest = 1, most = 0;
  const auto energy = [&] {
    const decant::Vector3<double> x = simulator.fluid().position.col(0) - decant::Vector3<double>(0.1, 0, 0);
    // places and speeds of a sub-step are half of one apart
    const decant::Vector3<double> a = -factor * x * std::pow(x.squaredNorm() + c * c, -1.5);
    const decant::Vector3<double> v = simulator.fluid().velocity.col(0) + 0.5 * settings.fixed_step * a;
    nearest = std::min(nearest, x.norm());
    most = std::max(most, 0.5 * v.squaredNorm());
    return 0.5 * v.squaredNorm() - factor / std::sqrt(x.squaredNorm() + c * c);
  };
  const double before = energy(), at_first = most;
  for (int frame = 0; frame < 60; ++frame) {
    REQUIRE(simulator.step(0.01).advanced());
    CHECK(energy() == Approx(before).margin(1e-3 * most));
  }
  CHECK(nearest < 0.03);  // it has been there
  CHECK(most > 10 * at_first);
}

TEMPLATE_TEST_CASE("suction of nothing, or out of range, changes no bit", "", float, double) {
  using Scalar = TestType;
  const Scalar nan = std::numeric_limits<Scalar>::quiet_NaN();
  auto liquid = decant::testing::loose_ball<decant::CubicSpline<Scalar>>(Scalar(0.005), 3, 0.1, 1.0);
  const decant::PointArray<Scalar> before = decant::PointArray<Scalar>::Random(3, liquid.fluid.size());
  const Scalar d = Scalar(0.05), c = Scalar(0.01);
  for (decant::Suction<Scalar> force : {decant::Suction<Scalar>{},
                                        {0, {1, 0, 0}, d, c},
                                        {nan, {1, 0, 0}, d, c},
                                        {1, {1, 0, 0}, 0, c},
                                        {1, {1, 0, 0}, -d, c},
                                        {1, {1, 0, 0}, nan, c},
                                        {1, {1, 0, 0}, d, 0},
                                        {1, {1, 0, 0}, d, nan}}) {
    decant::PointArray<Scalar> acceleration = before;
    force.accumulate(liquid.view(), acceleration);
    CHECK(acceleration == before);
    CHECK(std::isinf(force.largest_step(liquid.view())));
  }
  decant::Suction<Scalar> blows{-1, {0, 0, 0}, d, c};
  CHECK(suction_at(blows, {0.05, 0, 0})[0] == Approx(1).epsilon(1e-5));
  CHECK(blows.largest_step(liquid.view()) > 0);
}

TEST_CASE("suction lets liquid swing through its core without gaining speed") {
  decant::Suction<double> force;
  force.strength = 4;
  decant::testing::LooseLiquid<decant::CubicSpline<double>> liquid;
  liquid.place(decant::Vector3<double>(0.004, 0, 0));
  liquid.time_step = force.largest_step(liquid.view());
  double farthest = 0;
  for (int k = 0; k < 1000; ++k) {
    decant::PointArray<double> acceleration = decant::PointArray<double>::Zero(3, 1);
    force.accumulate(liquid.view(), acceleration);
    liquid.fluid.velocity += liquid.time_step * acceleration;
    liquid.fluid.position += liquid.time_step * liquid.fluid.velocity;
    farthest = std::max(farthest, liquid.fluid.position.col(0).norm());
  }
  CHECK(farthest < 0.0044);
  CHECK(farthest > 0.0036);
}
