// SPDX-License-Identifier: MIT
// An inlet delivers the integral of its flow to within one particle, with the speed of plug flow.

#include <decant/simulation/inlet.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <decant/simulation/simulator.hpp>

#include "catch.hpp"

using namespace decant;
using std::numbers::pi;

namespace {

InletSettings pouring(std::vector<std::pair<double, double>> flow) {
  InletSettings inlet;
  inlet.position = {0.1, 0.2, 0.3};
  inlet.direction = {0, 0, -2};
  inlet.radius = 0.01;
  inlet.flow = std::move(flow);
  return inlet;
}

}  // namespace

TEST_CASE("inlet: flow is linear between entries and zero outside") {
  const Inlet inlet(pouring({{1, 0}, {2, 4e-5}, {4, 2e-5}}), 0.004);
  CHECK(inlet.flow(0.5) == 0);
  CHECK(inlet.flow(1.5) == Approx(2e-5));
  CHECK(inlet.flow(2) == Approx(4e-5));
  CHECK(inlet.flow(3) == Approx(3e-5));
  CHECK(inlet.flow(4.5) == 0);
  CHECK(Inlet(pouring({}), 0.004).flow(1) == 0);
  CHECK(inlet.settings().direction.norm() == Approx(1));
}

TEST_CASE("inlet: volume delivered is the integral of the flow within one particle") {
  const double spacing = 0.004, one = std::pow(spacing, 3);
  for (const double step : {0.0007, 0.003, 0.02}) {
    Inlet inlet(pouring({{0, 0}, {0.5, 4e-5}, {1.5, 4e-5}, {2, 0}}), spacing);
    Index count = 0;
    double integral = 0;
    for (double t = 0; t < 2.2; t += step) {
      inlet.advance(t, step, [&](const Vector3<double>& x, const Vector3<double>& v) {
        ++count;
        REQUIRE(std::hypot(x[0] - 0.1, x[1] - 0.2) <= 0.01 + 0.5 * spacing);
        // plug flow over the opening
        REQUIRE(-v[2] == Approx(inlet.flow(t + 0.5 * step) / (pi * 0.01 * 0.01)));
        REQUIRE(x[2] <= 0.3 + 1e-12);
        REQUIRE(0.3 - x[2] <= -v[2] * step + spacing);
      });
      integral += step * inlet.flow(t + 0.5 * step);
      REQUIRE(static_cast<double>(count) * one <= integral + 1e-12);
      REQUIRE(static_cast<double>(count) * one > integral - one - 1e-12);
    }
    INFO("step " << step);
    CHECK(integral == Approx(6e-5).epsilon(0.01));
  }
}

TEST_CASE("inlet: the jet is the same at every spacing and has the liquid's density everywhere") {
  for (const double spacing : {0.0017, 0.004, 0.0043, 0.005, 0.007, 0.012, 0.03}) {
    INFO("spacing " << spacing);
    Inlet inlet(pouring({{0, 3e-5}, {1000, 3e-5}}), spacing);
    CHECK(inlet.speed(1) == Approx(3e-5 / (pi * 1e-4)));
    // where each particle would be in a jet that goes on as it left the opening, behind its first one
    std::vector<Vector3<double>> jet;
    for (double t = 0; jet.size() < 400; t += 0.0031) {
      inlet.advance(t, 0.0031, [&](const Vector3<double>& x, const Vector3<double>& v) {
        const double when = t + 0.0031 - (0.3 - x[2]) / -v[2];
        jet.emplace_back(x[0] - 0.1, x[1] - 0.2, when * -v[2]);
      });
    }
    const double apart = std::pow(spacing, 3) / (pi * 1e-4);  // of particles along the jet: each fills its own volume
    double nearest = 1, widest = 0;
    Vector3<double> middle = Vector3<double>::Zero();  // of a stretch of the jet
    for (std::size_t k = 1; k < jet.size(); ++k) {
      REQUIRE(jet[k].z() - jet[k - 1].z() == Approx(apart).epsilon(1e-6));
      widest = std::max(widest, jet[k].head<2>().norm());
      middle += jet[k] / 399;
      for (std::size_t other = k > 40 ? k - 40 : 0; other < k; ++other) {
        nearest = std::min(nearest, (jet[k] - jet[other]).norm());
      }
    }
    CHECK(widest <= 0.01 + 0.5 * spacing);
    CHECK(middle.head<2>().norm() < 0.002);
    CHECK(nearest > 0.8 * std::min(spacing, apart));
  }
}

TEST_CASE("inlet: another flow takes over at once, and nonsense leaves the old one") {
  SimulatorSettings settings;
  settings.spacing = 0.006;
  settings.threads = {1};
  LiquidSimulator simulator(settings);
  InletSettings inlet = pouring({{0, 5e-5}, {9, 5e-5}});
  simulator.add_inlet(inlet, 0);
  REQUIRE(simulator.inlet_count() == 1);
  REQUIRE(simulator.step(0.2).advanced());
  const double particle = std::pow(0.006, 3);
  CHECK(simulator.fluid().mass.sum() / 998.2 == Approx(1e-5).margin(particle));
  using Flow = std::vector<std::pair<double, double>>;
  CHECK_THROWS_AS(simulator.set_inlet_flow(1, Flow{}), std::invalid_argument);
  CHECK_THROWS_AS(simulator.set_inlet_flow(0, Flow{{1, 1e-5}, {1, 1e-5}}), std::invalid_argument);
  CHECK_THROWS_AS(simulator.set_inlet_flow(0, Flow{{1, -1e-5}}), std::invalid_argument);
  CHECK(simulator.inlet(0).flow(0.2) == Approx(5e-5));
  simulator.set_inlet_flow(0, Flow{{0, 1e-4}, {9, 1e-4}});
  CHECK(simulator.inlet(0).flow(0.2) == Approx(1e-4));
  REQUIRE(simulator.step(0.2).advanced());
  CHECK(simulator.fluid().mass.sum() / 998.2 == Approx(3e-5).margin(2 * particle));
}

TEST_CASE("inlet: in a simulator the liquid arrives and carries its origin") {
  SimulatorSettings settings;
  settings.spacing = 0.006;
  settings.threads = {1};
  LiquidSimulator simulator(settings);
  InletSettings inlet = pouring({{0, 5e-5}, {0.5, 5e-5}});
  inlet.position = {0, 0, 0.1};
  simulator.add_body("glass", CylinderInside{0.04, 0.08, 0.002, Face::PositiveZ});
  simulator.add_inlet(inlet, 42);
  StepReport report;
  for (int k = 0; k < 40; ++k) {
    report = simulator.step(0.02);
    REQUIRE(report.advanced());
  }
  const double particle = std::pow(0.006, 3);
  CHECK(report.volume <= 2.5e-5 * (1 + 1e-6));
  CHECK(report.volume > 2.5e-5 - 1.01 * particle);
  CHECK((simulator.fluid().origin.array() == 42u).all());
  CHECK((simulator.fluid().position.row(2).array() > 0).all());
  CHECK(report.lost == 0);
}
