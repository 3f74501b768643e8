// SPDX-License-Identifier: MIT
// A drop in flight: what no force from outside changes.

#include <cmath>
#include <random>

#include <decant/simulation/simulator.hpp>

#include "catch.hpp"
#include "physics/scene.hpp"

using decant::Index;
using Vector = decant::Vector3<double>;

namespace {

struct Momentum {
  Vector linear = Vector::Zero(), angular = Vector::Zero(), center = Vector::Zero();
};

/// Angular momentum about the origin.
Momentum momentum_of(const decant::FluidState<double>& fluid) {
  Momentum momentum;
  for (Index i = 0; i < fluid.size(); ++i) {
    const Vector x = fluid.position.col(i), v = fluid.velocity.col(i);
    momentum.linear += fluid.mass[i] * v;
    momentum.angular += fluid.mass[i] * x.cross(v);
    momentum.center += x / static_cast<double>(fluid.size());
  }
  return momentum;
}

template <class Parts>
decant::Simulator<Parts> drop(const Vector& gravity, double step, unsigned seed = 2) {
  decant::SimulatorSettings settings;
  settings.spacing = 0.005;
  settings.gravity = gravity;
  settings.fixed_step = step;
  settings.threads = {1};
  decant::Simulator<Parts> simulator(settings);
  const auto cube = decant_test::block<double>({-0.03, -0.03, -0.03}, 12, 12, 12, settings.spacing, 0.1);
  std::mt19937 random(seed);
  std::normal_distribution<double> speed(0, 0.05);
  for (Index i = 0; i < cube.cols(); ++i) {
    const Vector x = cube.col(i);
    if (x.norm() < 0.028) {
      const Vector v =
          Vector(0.5, -0.2, 1) + Vector(2, 5, 3).cross(x) + Vector(speed(random), speed(random), speed(random));
      simulator.add_particles(x, v, 0);
    }
  }
  return simulator;
}

}  // namespace

TEST_CASE("a drop without gravity keeps its linear momentum to rounding") {
  auto simulator = drop<decant::DefaultParts<double>>(Vector::Zero(), 0.001);
  const Momentum before = momentum_of(simulator.fluid());
  for (int frame = 0; frame < 20; ++frame) {
    REQUIRE(simulator.step(0.01).advanced());
  }
  const Momentum after = momentum_of(simulator.fluid());
  CHECK((after.linear - before.linear).norm() < 1e-12 * before.linear.norm());
}

TEST_CASE("a drop without gravity keeps its angular momentum to 0.4 % in 0.2 s") {
  // Not to rounding: what sets places right (Dfsph) moves particles without their speed. About the centre 0.26 to
  // 0.32 % (four seeds, spacings of 3.5, 5 and 7 mm, steps of 0.5 and 1 ms), all of it before the drop has come loose.
  for (const unsigned seed : {2u, 3u}) {
    auto simulator = drop<decant::DefaultParts<double>>(Vector::Zero(), 0.001, seed);
    const auto spin = [&] {
      const Momentum momentum = momentum_of(simulator.fluid());
      return Vector(momentum.angular - momentum.center.cross(momentum.linear));
    };
    const Vector before = spin();
    for (int frame = 0; frame < 20; ++frame) {
      REQUIRE(simulator.step(0.01).advanced());
      CAPTURE(seed, frame);
      CHECK((spin() - before).norm() < 4e-3 * before.norm());
    }
  }
}

TEST_CASE("a weakly compressible drop without gravity keeps linear and angular momentum to rounding") {
  auto simulator = drop<decant::StateEquationParts<double>>(Vector::Zero(), 1e-4);
  const Momentum before = momentum_of(simulator.fluid());
  for (int frame = 0; frame < 20; ++frame) {
    REQUIRE(simulator.step(0.005).advanced());
  }
  const Momentum after = momentum_of(simulator.fluid());
  CHECK((after.linear - before.linear).norm() < 1e-12 * before.linear.norm());
  CHECK((after.angular - before.angular).norm() < 1e-12 * before.angular.norm());
}

TEST_CASE("a drop falls along a parabola") {
  const double step = 0.001, time = 0.3;
  const Vector gravity(0, 0, -9.81);
  auto simulator = drop<decant::DefaultParts<double>>(gravity, step);
  const Momentum before = momentum_of(simulator.fluid());
  const double mass = simulator.fluid().mass.sum();
  REQUIRE(simulator.step(time).advanced());
  const Momentum after = momentum_of(simulator.fluid());
  // steps of velocity before position: exact for g t (t + step) / 2
  const Vector expected = before.center + before.linear / mass * time + 0.5 * time * (time + step) * gravity;
  CHECK((after.center - expected).norm() < 1e-12);
  CHECK((after.linear - before.linear - mass * time * gravity).norm() < 1e-12 * mass);
}
