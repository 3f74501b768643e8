// SPDX-License-Identifier: MIT
// The default simulator with boundary particles for walls (SampledWall) in place of shadow integrals.

#include <cmath>

#include <decant/boundary/rigid_bodies.hpp>
#include <decant/boundary/sampled_wall.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/simulation/fill.hpp>
#include <decant/simulation/simulator.hpp>

#include "catch.hpp"

namespace {

struct SampledParts : decant::DefaultParts<float> {
  using Boundary = decant::RigidBodies<float, decant::SampledWall>;
};

}  // namespace

TEST_CASE("boundary particles: a cup holds water at its level, upright and when it is tilted") {
  decant::SimulatorSettings settings;
  settings.spacing = 0.006;
  settings.threads = {1};
  decant::Simulator<SampledParts> simulator(settings);
  const decant::CylinderInside vessel{0.04, 0.09, 0.004, decant::Face::PositiveZ};
  const auto cup = simulator.add_body("cup", vessel.mesh());
  decant::fill(simulator, cup, decant::FillAmount::fraction(0.5));
  simulator.watch_contents(cup);
  const decant::Index count = simulator.fluid().size();
  const auto middle = [&] {
    return decant::Vector3<double>(simulator.fluid().position.rowwise().mean().cast<double>());
  };
  REQUIRE(simulator.step(0.5).advanced());
  // Boundary particles lie on the surface, so liquid begins half a spacing off it: the vessel is narrower by as much.
  const double off = 0.5 * settings.spacing, radius = 0.04 - off;
  const double depth = 0.045 * std::pow(0.04 / radius, 2);
  CHECK(middle().z() == Approx(off + 0.5 * depth).margin(0.2 * settings.spacing));

  const double angle = 0.5;
  const Eigen::Quaterniond tilted(Eigen::AngleAxisd(angle, decant::Vector3<double>::UnitY()));
  simulator.set_motion(cup, decant::PoseTrack({{0.5, {}}, {1.5, {tilted, {0, 0, 0}}}}));
  decant::StepReport report;
  for (int frame = 0; frame < 20; ++frame) {
    report = simulator.step(0.1);
    REQUIRE(report.advanced());
  }
  CHECK(report.contents[0].particles == count);
  // The surface stays level: in the cup's frame it leans by tan(angle), which moves the middle across.
  const decant::Vector3<double> in_cup = tilted.conjugate() * middle();
  const double across = radius * radius * std::tan(angle) / (4 * depth);
  CHECK(in_cup.x() == Approx(across).margin(0.2 * settings.spacing));
}
