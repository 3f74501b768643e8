// SPDX-License-Identifier: MIT
// Tanks that accelerate and spin.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <decant/simulation/fill.hpp>
#include <decant/simulation/simulator.hpp>

#include "catch.hpp"
#include "physics/scene.hpp"

using decant::Index;
using Vector = decant::Vector3<double>;

TEST_CASE("in an accelerated tank the surface leans by a over g") {
  const double spacing = 0.01, length = 0.2, depth = 0.1, slope = 0.3, ramp = 1.5, end = 4;
  const double acceleration = slope * 9.81;
  const double start_speed = -0.5 * acceleration * (end - 0.5 * ramp);  // so that the tank turns around half-way
  std::vector<decant::PoseTrack::Sample> samples;
  const auto place = [&](double t) {
    const double in_ramp = std::min(t, ramp), after = t - in_ramp;
    return start_speed * t +
           acceleration * (std::pow(in_ramp, 3) / (6 * ramp) + 0.5 * ramp * after + 0.5 * after * after);
  };
  for (int k = 0; k <= static_cast<int>(end * 1000) + 10; ++k) {
    samples.push_back({0.001 * k, {Eigen::Quaterniond::Identity(), Vector(place(0.001 * k), 0, 0)}});
  }
  decant::SimulatorSettings settings;
  settings.spacing = spacing;
  settings.threads = {1};
  decant::LiquidSimulator simulator(settings);
  const auto tank = simulator.add_body("tank", decant::BoxInside{{0, 0, 0}, {length, 0.04, 0.25}, 0.02, {}},
                                       decant::PoseTrack(samples));
  const auto places = decant_test::block<float>({0, 0, 0}, 20, 4, 10, spacing);
  decant::PointArray<float> velocity = decant::PointArray<float>::Zero(3, places.cols());
  velocity.row(0).setConstant(static_cast<float>(start_speed));
  simulator.add_particles(places, velocity, 0);

  // a plane surface puts the centre of mass length^2 tan / (12 depth) behind the middle
  double total = 0;
  int count = 0;
  while (simulator.time() < end - 1e-9) {
    REQUIRE(simulator.step(0.01).advanced());
    const auto& fluid = simulator.fluid();
    const double middle = simulator.bodies()[tank].motion.at(simulator.time()).translation.x() + 0.5 * length;
    const double behind = middle - decant_test::mean_over(fluid, [&](Index i) { return fluid.position(0, i); });
    if (simulator.time() > ramp + 0.5) {
      total += behind * 12 * depth / (length * length);
      ++count;
    }
  }
  CHECK(total / count == Approx(slope).epsilon(0.03));
}

TEST_CASE("in a spinning tank the surface is a paraboloid", "[slow]") {
  const double spacing = 0.01, radius = 0.1, depth = 0.08, rise = 0.06, end = 5;
  const double spin = std::sqrt(2 * 9.81 * rise) / radius;  // [rad/s]
  decant::SimulatorSettings settings;
  settings.spacing = spacing;
  settings.liquid.dynamic_viscosity = 1;  // so that the liquid follows the wall within R^2 / (5.8 nu) = 1.7 s
  settings.threads = {1};
  decant::LiquidSimulator simulator(settings);
  std::vector<decant::PoseTrack::Sample> samples;
  for (int k = 0; k <= static_cast<int>(end * 200) + 10; ++k) {
    const double time = 0.005 * k;
    samples.push_back({time, {Eigen::Quaterniond(Eigen::AngleAxisd(spin * time, Vector::UnitZ())), Vector::Zero()}});
  }
  const auto tank = simulator.add_body("tank", decant::CylinderInside{radius, 0.25, 0.02, decant::Face::PositiveZ},
                                       decant::PoseTrack(samples), decant::Slip::None);
  decant::fill(simulator, tank, decant::FillAmount::volume(std::numbers::pi * radius * radius * depth));
  auto& fluid = simulator.fluid();
  for (Index i = 0; i < fluid.size(); ++i) {
    const decant::Vector3<float> x = fluid.position.col(i);
    fluid.velocity.col(i) = static_cast<float>(spin) * decant::Vector3<float>::UnitZ().cross(x);
  }
  double total = 0;
  int count = 0;
  while (simulator.time() < end - 1e-9) {
    REQUIRE(simulator.step(0.02).advanced());
    if (simulator.time() > end - 1.5) {
      total += decant_test::mean_over(fluid, [&](Index i) { return fluid.position.col(i).head<2>().squaredNorm(); });
      ++count;
    }
  }
  // z = spin^2 r^2 / 2g takes the mean of r^2 from radius^2 / 2 to rise radius^2 / (12 depth) more
  const double measured = (total / count - 0.5 * radius * radius) * 12 * depth / (radius * radius);
  CHECK(measured == Approx(rise).epsilon(0.03));
}
