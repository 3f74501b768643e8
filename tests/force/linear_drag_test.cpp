// SPDX-License-Identifier: MIT

#include <cmath>
#include <tuple>

#include <decant/force/linear_drag.hpp>
#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator.hpp>

#include "catch.hpp"

using namespace decant;

namespace {

struct SlowedParts : DefaultParts<double> {
  using Forces = std::tuple<Gravity<double>, Viscosity<double>, LinearDrag<double>>;
};

/// One particle, which nothing but weight and drag acts on.
Simulator<SlowedParts> thrown(double rate, const Vector3<double>& velocity, const Vector3<double>& medium) {
  SimulatorSettings settings;
  settings.threads = {1};
  Simulator<SlowedParts> simulator(settings);
  simulator.force<LinearDrag<double>>() = {rate, medium};
  PointArray<double> position = PointArray<double>::Zero(3, 1), speed(3, 1);
  speed.col(0) = velocity;
  simulator.add_particles(position, speed, 0);
  return simulator;
}

}  // namespace

TEST_CASE("linear drag: speed falls exponentially to that of the medium") {
  auto simulator = thrown(3, {2, 0, 0}, {0.5, 1, 0});
  REQUIRE(simulator.step(0.4).advanced());
  const double left = std::exp(-3 * 0.4);
  CHECK(simulator.fluid().velocity(0, 0) == Approx(0.5 + 1.5 * left).epsilon(1e-9));
  CHECK(simulator.fluid().velocity(1, 0) == Approx(1 - left).epsilon(1e-9));
}

TEST_CASE("linear drag: what falls gets no faster than weight over rate") {
  const double rate = 20;
  auto simulator = thrown(rate, {0, 0, 0}, {0, 0, 0});
  REQUIRE(simulator.step(1).advanced());
  // weight and drag act one after the other in a sub-step: at most a share of rate * sub-step off
  CHECK(simulator.fluid().velocity(2, 0) == Approx(-9.81 / rate).epsilon(0.06));
}

TEST_CASE("linear drag: none changes no bit") {
  auto without = thrown(0, {1, 0, 2}, {5, 5, 5}), plain = thrown(0, {1, 0, 2}, {0, 0, 0});
  REQUIRE(without.step(0.2).advanced());
  REQUIRE(plain.step(0.2).advanced());
  CHECK(without.fluid().position == plain.fluid().position);
  CHECK(without.fluid().velocity(0, 0) == Approx(1).epsilon(1e-12));
}
