// SPDX-License-Identifier: MIT
// A full cylinder that is tilted slowly keeps what is below the level through the lowest point of its rim.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <decant/simulation/fill.hpp>
#include <decant/simulation/simulator.hpp>

#include "catch.hpp"

using decant::Index;
using Vector = decant::Vector3<double>;

namespace {

enum class Walls { Analytic, Mesh };

/// Tilts a full cylinder with diameter and height of 10 cm until tan = 0.5 and on until tan = 1, each time waiting
/// until hardly anything pours.
/// @return largest error of what is left, pi R^2 (H - R tan), over what the cylinder holds.
double tilt(double spacing, Walls walls) {
  const double radius = 0.05, height = 0.1, full = std::numbers::pi * radius * radius * height;
  decant::SimulatorSettings settings;
  settings.spacing = spacing;
  settings.threads = {1};
  decant::LiquidSimulator simulator(settings);
  const decant::CylinderInside cylinder{radius, height, 0.004, decant::Face::PositiveZ};
  const auto cup = simulator.add_body(
      "cup", walls == Walls::Mesh ? decant::BodyShape(cylinder.mesh()) : decant::BodyShape(cylinder));
  decant::fill(simulator, cup, decant::FillAmount::fraction(1));
  simulator.watch_contents(cup);
  const auto wait = [&](double seconds) {
    double left = 0;
    const int frames = static_cast<int>(std::lround(seconds / 0.02));
    for (int frame = 0; frame < frames; ++frame) {
      const auto report = simulator.step(seconds / frames);
      REQUIRE(report.advanced());
      CHECK(report.lost == 0);
      left = report.contents[0].volume / full;
      // what has left would fall ever faster and shorten everybody's steps
      simulator.remove_particles_if([&](Index i) { return simulator.fluid().position(2, i) < -0.3F; });
    }
    return left;
  };
  CHECK(wait(0.3) == Approx(1).epsilon(0.01));  // upright it keeps all

  double angle = 0, worst = 0;
  for (const double slope : {0.5, 1.0}) {
    const double next = std::atan(slope), seconds = 2 * (next - angle);  // 0.5 rad/s
    std::vector<decant::PoseTrack::Sample> samples;
    for (int k = 0; k <= 50; ++k) {
      const double u = 0.02 * k, turned = angle + (next - angle) * u * u * (3 - 2 * u);
      samples.push_back({simulator.time() + seconds * u,
                         {Eigen::Quaterniond(Eigen::AngleAxisd(turned, Vector::UnitY())), Vector::Zero()}});
    }
    simulator.set_motion(cup, decant::PoseTrack(samples));
    double before = wait(seconds), left = wait(0.5);
    for (int k = 0; k < 8 && before - left > 0.003; ++k) {
      before = left;
      left = wait(0.5);
    }
    const double error = left - (1 - slope * radius / height);
    worst = std::max(worst, std::abs(error));
    angle = next;
  }
  return worst;
}

}  // namespace

// 2.7, 2.0 and 1.7 % at spacings of 10, 8 and 6 mm: a layer that is too thin to run off stands above the lip.

TEST_CASE("a full cylinder that is tilted slowly keeps what is below its rim") {
  CHECK(tilt(0.008, Walls::Mesh) < 0.03);
}

TEST_CASE("a full cylinder that is tilted slowly keeps what is below its rim, at a finer spacing", "[slow]") {
  CHECK(tilt(0.006, Walls::Mesh) < 0.03);
}

TEST_CASE("at the rim of an analytic cylinder that is tilted more stays than below it", "[slow]") {
  // Its edge is felt as a wall that goes on upward and holds back a part of a spacing: 6.1, 4.9 and 3.8 % too much at
  // spacings of 10, 8 and 6 mm, which is not within 3 %.
  const double coarse = tilt(0.01, Walls::Analytic), middle = tilt(0.008, Walls::Analytic);
  CAPTURE(coarse, middle);
  CHECK(coarse < 0.07);
  CHECK(middle < 0.057);
  CHECK(middle < coarse);
}
