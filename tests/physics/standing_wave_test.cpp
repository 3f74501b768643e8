// SPDX-License-Identifier: MIT
// A wave that stands in a tank: its frequency is that of linear theory, and it lasts.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <decant/simulation/simulator.hpp>

#include "catch.hpp"
#include "physics/scene.hpp"

using decant::Index;
using Vector = decant::Vector3<double>;

namespace {

struct Wave {
  double squared_frequency_error = 0;  // of omega^2, relative to theory
  double kept = 0;                     // fourth amplitude over the first
};

/// Half a wave length in 20 cm, 10 cm deep, periodic across; 0.1 m/s at the surface, so amplitudes stay below a tenth
/// of the depth. The centre of mass goes to and fro as the wave does.
Wave watch_wave(double spacing) {
  const double length = 0.2, depth = 0.1, k = std::numbers::pi / length, speed = 0.1;
  const int width = 6;
  auto simulator = decant_test::slice(spacing, width);
  simulator.add_body("tank", decant::BoxInside{{0, -0.5, 0}, {length, 0.5, 2 * depth}, 0.02, {}});
  const auto places = decant_test::slice_block(length, width, depth, spacing);
  decant::PointArray<float> velocity(3, places.cols());
  for (Index i = 0; i < places.cols(); ++i) {
    const double x = static_cast<double>(places(0, i)), z = static_cast<double>(places(2, i));
    const Vector v(std::cosh(k * z) * std::sin(k * x), 0, -std::sinh(k * z) * std::cos(k * x));
    velocity.col(i) = (speed / std::cosh(k * depth) * v).cast<float>();
  }
  simulator.add_particles(places, velocity, 0);

  const double frame = 0.005;
  std::vector<double> crossings, amplitudes;
  double last = 0, amplitude = 0;
  while (crossings.size() < 5 && simulator.time() < 3) {
    REQUIRE(simulator.step(frame).advanced());
    const auto& fluid = simulator.fluid();
    const double off = decant_test::mean_over(fluid, [&](Index i) { return fluid.position(0, i); }) - 0.5 * length;
    amplitude = std::max(amplitude, std::abs(off));
    if (simulator.time() > 0.1 && last * off < 0) {
      crossings.push_back(simulator.time() - frame * off / (off - last));
      amplitudes.push_back(amplitude);
      amplitude = 0;
    }
    last = off;
  }
  REQUIRE(crossings.size() == 5);
  const double omega = std::numbers::pi * 4 / (crossings[4] - crossings[0]);
  const double theory = 9.81 * k * std::tanh(k * depth);
  return {omega * omega / theory - 1, amplitudes[3] / amplitudes[0]};
}

}  // namespace

TEST_CASE("a standing wave has the frequency of linear theory and lasts") {
  const Wave coarse = watch_wave(0.02), middle = watch_wave(0.01), fine = watch_wave(0.005);
  CAPTURE(coarse.squared_frequency_error, middle.squared_frequency_error, fine.squared_frequency_error);
  CHECK(std::abs(coarse.squared_frequency_error) < 0.03);
  CHECK(std::abs(middle.squared_frequency_error) < 0.03);
  CHECK(std::abs(fine.squared_frequency_error) < 0.03);
  // water's own friction would take 1e-4 in two periods
  CAPTURE(coarse.kept, middle.kept, fine.kept);
  CHECK(middle.kept > 0.9);
  CHECK(fine.kept > 0.9);
}
