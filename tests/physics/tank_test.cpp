// SPDX-License-Identifier: MIT
// Tanks that accelerate, spin and slosh.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <vector>

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
    return start_speed * t + acceleration * (std::pow(in_ramp, 3) / (6 * ramp) + 0.5 * ramp * after + 0.5 * after * after);
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
  std::printf("accelerated: tan %.4f of %.4f\n", total / count, slope);
  CHECK(total / count == Approx(slope).epsilon(0.03));
}

TEST_CASE("in a spinning tank the surface is a paraboloid", "[slow]") {
  const double spacing = 0.01, radius = 0.1, depth = 0.08, rise = 0.08;
  const double spin = std::sqrt(2 * 9.81 * rise) / radius;  // [rad/s]
  decant::SimulatorSettings settings;
  settings.spacing = spacing;
  settings.liquid.dynamic_viscosity = 1;  // spins up in R^2 / (5.8 nu) = 1.7 s
  settings.threads = {1};
  const auto mean_square_radius = [&](bool spinning) {
    decant::LiquidSimulator simulator(settings);
    std::vector<decant::PoseTrack::Sample> samples;
    const double end = spinning ? 6 : 1;
    for (int k = 0; k <= static_cast<int>(end * 100) + 10; ++k) {
      const double angle = spinning ? spin * 0.01 * k : 0;
      samples.push_back({0.01 * k, {Eigen::Quaterniond(Eigen::AngleAxisd(angle, Vector::UnitZ())), Vector::Zero()}});
    }
    simulator.add_body("tank", decant::CylinderInside{radius, 0.25, 0.02, {}}, decant::PoseTrack(samples), decant::Slip::none);
    const auto cube = decant_test::block<float>({-radius, -radius, 0}, 20, 20, 8, spacing);
    for (Index i = 0; i < cube.cols(); ++i) {
      const decant::Vector3<float> x = cube.col(i);
      if (x.head<2>().norm() < static_cast<float>(radius - 0.4 * spacing)) {
        simulator.add_particles(x, static_cast<float>(spinning ? spin : 0) * decant::Vector3<float>::UnitZ().cross(x), 0);
      }
    }
    double total = 0;
    int count = 0;
    while (simulator.time() < end - 1e-9) {
      REQUIRE(simulator.step(0.02).advanced());
      if (simulator.time() > end - (spinning ? 1.5 : 0.5)) {
        total += decant_test::mean_over(simulator.fluid(), [&](Index i) {
          return simulator.fluid().position.col(i).head<2>().squaredNorm();
        });
        ++count;
      }
    }
    std::printf("n %ld\n", static_cast<long>(simulator.fluid().size()));
    const double real_depth = static_cast<double>(simulator.fluid().size()) * std::pow(spacing, 3) / (std::numbers::pi * radius * radius);
    return std::pair(total / count, real_depth);
  };
  // z = spin^2 r^2 / 2g moves the mean of r^2 by rise R^2 / (12 depth)
  const auto still = mean_square_radius(false), moved = mean_square_radius(true);
  const double measured = (moved.first - still.first) * 12 * moved.second / (radius * radius);
  std::printf("spinning: rise %.5f of %.5f; still <r2> %.6f vs %.6f depth %.4f\n", measured, rise, still.first, 0.5 * radius * radius, still.second);
  CHECK(measured == Approx(rise).epsilon(0.03));
  (void)depth;
}

namespace {

double frequency_error(double spacing, double seconds) {
  const double length = 0.2, depth = 0.1, k = std::numbers::pi / length, amplitude = 0.1;  // [m/s]
  decant::SimulatorSettings settings;
  settings.spacing = spacing;
  settings.threads = {1};
  decant::LiquidSimulator simulator(settings);
  simulator.add_body("tank", decant::BoxInside{{0, 0, 0}, {length, 4 * spacing, 0.2}, 0.02, {}});
  const auto places = decant_test::block<float>({0, 0, 0}, static_cast<int>(std::lround(length / spacing)), 4,
                                                static_cast<int>(std::lround(depth / spacing)), spacing);
  decant::PointArray<float> velocity(3, places.cols());
  for (Index i = 0; i < places.cols(); ++i) {
    const double x = static_cast<double>(places(0, i)), z = static_cast<double>(places(2, i));
    velocity.col(i) = (amplitude / std::cosh(k * depth) *
                       Vector(std::cosh(k * z) * std::sin(k * x), 0, -std::sinh(k * z) * std::cos(k * x))).cast<float>();
  }
  simulator.add_particles(places, velocity, 0);
  double last = 0, first_crossing = 0, last_crossing = 0, top = 0, late_top = 0;
  int crossings = 0;
  const double frame = 0.005;
  while (simulator.time() < seconds) {
    REQUIRE(simulator.step(frame).advanced());
    const double off = decant_test::mean_over(simulator.fluid(), [&](Index i) { return simulator.fluid().position(0, i); }) - 0.5 * length;
    if (simulator.time() < 0.7) top = std::max(top, off);
    if (simulator.time() > seconds - 0.7) late_top = std::max(late_top, off);
    if (simulator.time() > 0.1 && last * off < 0) {
      last_crossing = simulator.time() - frame * off / (off - last);
      first_crossing = crossings == 0 ? last_crossing : first_crossing;
      ++crossings;
    }
    last = off;
  }
  const double omega = std::numbers::pi * (crossings - 1) / (last_crossing - first_crossing);
  const double squared = 9.81 * k * std::tanh(k * depth);
  std::printf("wave d %.4f: omega^2 %.2f of %.2f (%.2f %%) crossings %d top %.5f late %.5f\n", spacing, omega * omega, squared,
              100 * (omega * omega / squared - 1), crossings, top, late_top);
  return omega * omega / squared - 1;
}

}  // namespace

TEST_CASE("a standing wave has its frequency at 20 mm") { CHECK(std::abs(frequency_error(0.02, 3)) < 0.03); }
TEST_CASE("a standing wave has its frequency at 10 mm") { CHECK(std::abs(frequency_error(0.01, 3)) < 0.03); }
TEST_CASE("a standing wave has its frequency at 5 mm", "[slow]") { CHECK(std::abs(frequency_error(0.005, 3)) < 0.03); }
