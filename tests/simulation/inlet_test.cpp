// SPDX-License-Identifier: MIT
// An inlet delivers the integral of its flow to within one layer, with the speed of plug flow.

#include <decant/simulation/inlet.hpp>

#include <cmath>
#include <vector>

#include <decant/simulation/simulator.hpp>

#include "catch.hpp"

using namespace decant;

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

TEST_CASE("inlet: volume delivered is the integral of the flow within one layer") {
  const double spacing = 0.004, one = std::pow(spacing, 3);
  for (const double step : {0.0007, 0.003, 0.02}) {
    Inlet inlet(pouring({{0, 0}, {0.5, 4e-5}, {1.5, 4e-5}, {2, 0}}), spacing);
    Index layer = 0;
    for (int i = -3; i <= 3; ++i) {
      for (int j = -3; j <= 3; ++j) {
        layer += std::hypot(i, j) * spacing <= 0.01 ? 1 : 0;
      }
    }
    Index count = 0;
    double integral = 0;
    for (double t = 0; t < 2.2; t += step) {
      const Index before = count;
      inlet.advance(t, step, [&](const Vector3<double>& x, const Vector3<double>& v) {
        ++count;
        REQUIRE(std::hypot(x[0] - 0.1, x[1] - 0.2) <= 0.01 + 1e-12);
        // plug flow over the layer's area
        REQUIRE(-v[2] == Approx(inlet.flow(t + 0.5 * step) / (static_cast<double>(layer) * spacing * spacing)));
        REQUIRE(x[2] <= 0.3 + 1e-12);
        REQUIRE(0.3 - x[2] <= -v[2] * step + spacing);
      });
      CHECK((count - before) % layer == 0);
      integral += step * inlet.flow(t + 0.5 * step);
    }
    INFO("step " << step);
    CHECK(integral == Approx(6e-5).epsilon(0.01));
    CHECK(static_cast<double>(count) * one <= integral + 1e-12);
    CHECK(static_cast<double>(count) * one > integral - static_cast<double>(layer) * one);
  }
}

TEST_CASE("inlet: layers of a steady flow are one spacing apart") {
  const double spacing = 0.004;
  Inlet inlet(pouring({{0, 3e-5}, {10, 3e-5}}), spacing);
  std::vector<double> passed;  // when each layer was at the opening
  for (double t = 0; t < 1; t += 0.0031) {
    double last = -1;
    inlet.advance(t, 0.0031, [&](const Vector3<double>& x, const Vector3<double>& v) {
      const double when = t + 0.0031 - (0.3 - x[2]) / -v[2];
      if (when != last) {
        passed.push_back(when * -v[2]);
        last = when;
      }
    });
  }
  REQUIRE(passed.size() > 10);
  for (std::size_t k = 1; k < passed.size(); ++k) {
    REQUIRE(passed[k] - passed[k - 1] == Approx(spacing).epsilon(1e-6));
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
  const double layer = 9 * std::pow(0.006, 3);  // at most
  CHECK(simulator.fluid().mass.sum() / 998.2 == Approx(1e-5).margin(layer));
  using Flow = std::vector<std::pair<double, double>>;
  CHECK_THROWS_AS(simulator.set_inlet_flow(1, Flow{}), std::invalid_argument);
  CHECK_THROWS_AS(simulator.set_inlet_flow(0, Flow{{1, 1e-5}, {1, 1e-5}}), std::invalid_argument);
  CHECK_THROWS_AS(simulator.set_inlet_flow(0, Flow{{1, -1e-5}}), std::invalid_argument);
  CHECK(simulator.inlet(0).flow(0.2) == Approx(5e-5));
  simulator.set_inlet_flow(0, Flow{{0, 1e-4}, {9, 1e-4}});
  CHECK(simulator.inlet(0).flow(0.2) == Approx(1e-4));
  REQUIRE(simulator.step(0.2).advanced());
  CHECK(simulator.fluid().mass.sum() / 998.2 == Approx(3e-5).margin(layer));
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
  const double layer = 9 * std::pow(0.006, 3);  // at most: (2 * 1 + 1)^2 places
  CHECK(report.volume <= 2.5e-5 * (1 + 1e-6));
  CHECK(report.volume > 2.5e-5 - layer);
  CHECK((simulator.fluid().origin.array() == 42u).all());
  CHECK((simulator.fluid().position.row(2).array() > 0).all());
  CHECK(report.lost == 0);
}
