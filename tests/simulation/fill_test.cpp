// SPDX-License-Identifier: MIT
// Filling by fraction, volume and level; what is filled in is at rest, and the body has not moved meanwhile.

#include <decant/simulation/fill.hpp>

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <decant/boundary/shapes.hpp>
#include <decant/simulation/simulator.hpp>

#include "catch.hpp"
#include "scene.hpp"

using namespace decant;

namespace {

using std::numbers::pi;

using decant_test::with_spacing;

}  // namespace

TEMPLATE_TEST_CASE("fill: fraction and volume are met to half a particle", "", float, double) {
  const double spacing = 0.008, one = std::pow(spacing, 3);
  const CylinderInside glass{0.04, 0.08, 0.002, Face::PositiveZ};
  const double capacity = pi * 0.04 * 0.04 * 0.08;
  {
    Simulator<DefaultParts<TestType>> simulator(with_spacing(spacing));
    const BodyId body = simulator.add_body("glass", glass);
    const FillReport report = fill(simulator, body, FillAmount::fraction(0.5));
    // of columns: volumes are within 0.3 % (boundary/cavity.hpp)
    CHECK(report.capacity == Approx(capacity).epsilon(0.004));
    CHECK(std::abs(report.volume - 0.5 * report.capacity) <= 0.5 * one * (1 + 1e-9));
    CHECK(report.particles == simulator.fluid().size());
    CHECK(report.settled == 1);
    CHECK(report.level == Approx(0.04).margin(spacing));
    CHECK(simulator.time() == 0);
    CHECK(simulator.fluid().velocity.isZero());
    CHECK((simulator.fluid().origin.array() == body).all());
    // stays as it is
    const auto before = simulator.fluid();
    double fastest = 0;
    for (int k = 0; k < 10; ++k) {
      const StepReport step = simulator.step(0.02);
      REQUIRE(step.advanced());
      fastest = std::max(fastest, std::sqrt(2 * step.kinetic_energy / (report.volume * 998.2)));
    }
    CHECK(fastest < 0.05);
    CHECK((simulator.fluid().position.row(2).mean()) == Approx(before.position.row(2).mean()).margin(0.1 * spacing));
  }
  {
    Simulator<DefaultParts<TestType>> simulator(with_spacing(spacing));
    const BodyId body = simulator.add_body("glass", glass);
    const FillReport report = fill(simulator, body, FillAmount::volume(1e-4));
    CHECK(std::abs(report.volume - 1e-4) <= 0.5 * one * (1 + 1e-9));
    for (Index i = 0; i < report.particles; ++i) {
      const Vector3<double> x = simulator.fluid().position.col(i).template cast<double>();
      REQUIRE(std::hypot(x[0], x[1]) < 0.04005);
      REQUIRE(x[2] > 0);
    }
    // empty fillings are fillings
    CHECK(fill(simulator, body, FillAmount::volume(0)).particles == 0);
    CHECK(simulator.fluid().size() == report.particles);
  }
}

TEST_CASE("fill: a level is met within a quarter of a spacing") {
  const double spacing = 0.006;
  for (const double level : {0.02, 0.033}) {
    LiquidSimulator simulator(with_spacing(spacing));
    const BodyId body = simulator.add_body("glass", CylinderInside{0.03, 0.06, 0.002, Face::PositiveZ});
    const FillReport report = fill(simulator, body, FillAmount::level(level));
    INFO("level " << report.level << " for " << level << ", tries " << report.settled);
    CHECK(report.level == Approx(level).margin(0.25 * spacing));
    CHECK(report.volume == Approx(level * pi * 0.03 * 0.03).epsilon(0.15));
    CHECK(report.settled <= 6);
    CHECK(report.particles == simulator.fluid().size());
  }
}

TEST_CASE("fill: a tilted and turned container elsewhere in the world") {
  const double spacing = 0.008;
  const Pose pose{Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 1, 0).normalized())), {1, -2, 3}};
  LiquidSimulator simulator(with_spacing(spacing));
  const BodyId body = simulator.add_body("cup", Cup{0.03, 0.04, 0.09, 0.002}, PoseTrack(pose));
  const FillReport report = fill(simulator, body, FillAmount::fraction(0.5));
  // tilted, it holds less than upright
  CHECK(report.capacity < 0.9 * Cup{0.03, 0.04, 0.09, 0.002}.volume());
  CHECK(report.particles > 100);
  for (Index i = 0; i < report.particles; ++i) {
    const Vector3<double> x = pose.inverse() * Vector3<double>(simulator.fluid().position.col(i).cast<double>());
    REQUIRE(std::hypot(x[0], x[1]) < 0.03 + x[2] / 9 + 1e-4);
    REQUIRE(x[2] > 0);
  }
}

TEST_CASE("fill: a moving container is held while it is filled") {
  const double spacing = 0.008;
  LiquidSimulator simulator(with_spacing(spacing));
  const Pose later{Eigen::Quaterniond::Identity(), {1, 0, 0}};
  const BodyId body = simulator.add_body("glass", CylinderInside{0.04, 0.08, 0.002, Face::PositiveZ},
                                         PoseTrack({{0, Pose{}}, {1, later}}));
  fill(simulator, body, FillAmount::fraction(0.3));
  CHECK(simulator.time() == 0);
  CHECK(simulator.bodies()[body].motion.end_time() == 1);
  CHECK(simulator.fluid().position.row(0).maxCoeff() < 0.041f);
}

TEST_CASE("fill: what cannot be filled is refused by name") {
  LiquidSimulator simulator(with_spacing(0.008));
  const BodyId ball = simulator.add_body("ball", Sphere{{0, 0, 0}, 0.03});
  REQUIRE_THROWS_WITH(fill(simulator, ball, FillAmount::fraction(0.1)),
                      decant_test::contains("fill: body 'ball'") && decant_test::contains("holds liquid"));
  const BodyId glass = simulator.add_body("glass", CylinderInside{0.03, 0.06, 0.002, Face::PositiveZ},
                                          PoseTrack(Pose{Eigen::Quaterniond::Identity(), {0.2, 0, 0}}));
  REQUIRE_THROWS_WITH(fill(simulator, glass, FillAmount::fraction(1.5)),
                      decant_test::contains("body 'glass'") && decant_test::contains("fraction"));
  REQUIRE_THROWS_WITH(fill(simulator, glass, FillAmount::volume(1)), decant_test::contains("volume [m^3]"));
  REQUIRE_THROWS_WITH(fill(simulator, glass, FillAmount::level(0.07)), decant_test::contains("level [m]"));
  REQUIRE_THROWS_WITH(fill(simulator, 9, FillAmount::level(0.01)), decant_test::contains("fill: body"));
  SimulatorSettings floating = with_spacing(0.008);
  floating.gravity.setZero();
  LiquidSimulator weightless(floating);
  weightless.add_body("glass", CylinderInside{0.03, 0.06, 0.002, Face::PositiveZ});
  REQUIRE_THROWS_WITH(fill(weightless, 0, FillAmount::fraction(0.1)), decant_test::contains("gravity"));
  CHECK(simulator.fluid().size() == 0);
}

TEST_CASE("fill: a container far too large for the spacing is refused at once") {
  // 100 m at 10 mm: some 1e12 particles, and as many places to look at
  const BoxInside tank{{-100, -100, 0}, {100, 100, 100}, 0.5, Face::PositiveZ};
  const CylinderInside silo{100, 100, 0.5, Face::PositiveZ};
  LiquidSimulator simulator(with_spacing(0.01));
  simulator.add_body("tank", tank);
  simulator.add_body("silo", silo, PoseTrack(Pose{Eigen::Quaterniond::Identity(), {300, 0, 0}}));
  for (const auto& [body, amount] : {std::pair{BodyId(0), FillAmount::fraction(0.5)},
                                     {0, FillAmount::volume(1000)},
                                     {0, FillAmount::level(20)},
                                     {1, FillAmount::fraction(1)}}) {
    const auto line =
        decant_test::contains(body == 0 ? "fill: body 'tank': number of particles in all must be at most 1e8"
                                        : "fill: body 'silo': number of particles in all must be at most 1e8");
    CHECK_THROWS_WITH(fill(simulator, body, amount), line);
  }
  CHECK(simulator.fluid().size() == 0);
  // a little liquid is not looked for all over the tank
  CHECK(fill(simulator, 0, FillAmount::volume(1e-4)).particles == 100);
}
