// SPDX-License-Identifier: MIT
#include <decant/force/back_pressure.hpp>

#include <limits>
#include <numbers>
#include <tuple>
#include <vector>

#include <decant/force/concept.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"
#include "laws.hpp"

namespace {

using decant::Pose;
using decant::PoseTrack;
using decant::Vector3;

struct NeckParts : decant::DefaultParts<double> {
  using Forces = std::tuple<decant::Gravity<double>, decant::BackPressure<double>>;
};

/// One particle without weight, in a neck of 1 m by 0.2 m whose mouth is at the container's origin.
decant::Simulator<NeckParts> in_neck(const Vector3<double>& place, const Vector3<double>& velocity, double strength,
                                     const PoseTrack& container = {}) {
  decant::SimulatorSettings settings;
  settings.threads = {1};
  settings.gravity.setZero();
  settings.fixed_step = 1e-3;
  decant::Simulator<NeckParts> simulator(settings);
  decant::BackPressure<double>& force = simulator.force<decant::BackPressure<double>>();
  force.strength = strength;
  force.reach = 1;
  force.radius = 0.1;
  force.container = container;
  simulator.add_particles(decant::PointArray<double>(place), decant::PointArray<double>(velocity), 0);
  return simulator;
}

Vector3<double> velocity_after(decant::Simulator<NeckParts> simulator, double seconds) {
  REQUIRE(simulator.step(seconds).advanced());
  return simulator.fluid().velocity.col(0);
}

}  // namespace

TEMPLATE_TEST_CASE("back-pressure keeps the laws of a force", "", float, double) {
  decant::BackPressure<TestType> force;
  force.strength = 3;
  force.reach = force.radius = 1;
  decant_test::check(
      decant::testing::force_laws<decant::CubicSpline<TestType>>(force, decant::testing::Keeps::Neither));
}

TEST_CASE("back-pressure: what runs out is slowed evenly until it rests, and is never sent back") {
  const Vector3<double> inside(0, 0, -0.5), out(0.1, 0, 0.5);
  const Vector3<double> slower = velocity_after(in_neck(inside, out, 2), 0.1);
  CHECK(slower.z() == Approx(0.3).epsilon(1e-9));
  CHECK(slower.x() == 0.1);  // across the neck nothing holds it
  const Vector3<double> at_rest = velocity_after(in_neck(inside, out, 2), 0.6);
  CHECK(at_rest.z() == Approx(0).margin(1e-12));
}

TEST_CASE(
    "back-pressure: in beats it is none when a bubble comes in, twice as much between two, and the same in the mean") {
  const Vector3<double> inside(0, 0, -0.5), out(0, 0, 0.6);
  auto beating = in_neck(inside, out, 2);
  beating.force<decant::BackPressure<double>>().beat = {0.02, 0.12};  // as well as -0.08 to 0.02, and so on
  double before = 0.6;
  std::vector<double> lost;
  for (int k = 0; k < 100; ++k) {
    REQUIRE(beating.step(0.001).advanced());
    const double now = beating.fluid().velocity(2, 0);
    lost.push_back((before - now) / 0.001);
    before = now;
  }
  CHECK(before == Approx(0.4).epsilon(1e-9));  // as without beats
  CHECK(lost[20] == Approx(0).margin(0.01));
  CHECK(lost[70] == Approx(4).margin(0.01));
  CHECK(lost[45] == Approx(2).margin(0.07));
  // what has no end, or ends before it begins, is no beat
  decant::BackPressure<double>::Beat none;
  CHECK(none.share(0.3) == 1);
  none.until = std::numeric_limits<double>::infinity();
  CHECK(none.share(0.3) == 1);
  none = {2, 1};
  CHECK(none.share(0.3) == 1);
}

TEST_CASE("back-pressure: what runs in, or is not in the neck, is let go") {
  const Vector3<double> out(0, 0, 0.05);
  CHECK(velocity_after(in_neck({0, 0, -0.5}, -out, 2), 0.1) == -out);
  CHECK(velocity_after(in_neck({0, 0, 0.01}, out, 2), 0.1) == out);     // beyond the mouth
  CHECK(velocity_after(in_neck({0, 0, -1.1}, out, 2), 0.1) == out);     // behind the neck
  CHECK(velocity_after(in_neck({0, 0.11, -0.5}, out, 2), 0.1) == out);  // beside it
  CHECK(velocity_after(in_neck({0, 0.09, -0.5}, out, 2), 0.1).z() < 0.01);
  CHECK(velocity_after(in_neck({0, 0, -0.5}, out, 0), 0.1) == out);
}

TEST_CASE("back-pressure: what counts is the speed out of the container, wherever it points and goes") {
  // the mouth points to +x, and the container goes there at 0.4 m/s
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.5 * std::numbers::pi, Eigen::Vector3d::UnitY()));
  const PoseTrack moving({{0, Pose{turn, {0, 0, 0}}}, {10, Pose{turn, {4, 0, 0}}}});
  const Vector3<double> with_it = velocity_after(in_neck({-0.5, 0, 0}, {0.4, 0, 0}, 2, moving), 0.1);
  CHECK(with_it.x() == Approx(0.4).epsilon(1e-9));
  const Vector3<double> faster = velocity_after(in_neck({-0.5, 0, 0}, {0.9, 0, 0}, 2, moving), 0.1);
  CHECK(faster.x() == Approx(0.7).epsilon(1e-9));
  const Vector3<double> slower = velocity_after(in_neck({-0.5, 0, 0}, {0.1, 0, 0}, 2, moving), 0.1);
  CHECK(slower.x() == 0.1);
  CHECK(velocity_after(in_neck({-0.5, 0, 0}, {0.9, 0, 0}, 2, moving), 0.5).x() == Approx(0.4).epsilon(1e-9));
}
