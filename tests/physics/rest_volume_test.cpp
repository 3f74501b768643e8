// SPDX-License-Identifier: MIT
// Liquid at rest takes up the room that its mass has at rest density, whatever the kernel and the pressure solver.

#include <cmath>

#include <decant/boundary/shapes.hpp>
#include <decant/kernel/wendland_c2.hpp>
#include <decant/kernel/wendland_c4.hpp>
#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator.hpp>

#include "catch.hpp"
#include "physics/scene.hpp"

using decant::Index;

namespace {

template <class Base, template <class> class KernelType>
struct With : Base {
  using Kernel = KernelType<typename Base::Scalar>;
};

/// How much higher than poured in the liquid stands, from the height of its centre of mass [-].
template <class Parts>
double rise() {
  constexpr double spacing = 0.01;
  constexpr int across = 6, layers = 20;
  decant::SimulatorSettings settings;
  settings.spacing = spacing;
  settings.threads = {1};
  decant::Simulator<Parts> simulator(settings);
  const double side = across * spacing, filled = layers * spacing;
  simulator.add_body("column", decant::BoxInside{{0, 0, 0}, {side, side, 1.5 * filled}, 2 * spacing, {}});
  const auto places = decant_test::block<float>({0, 0, 0}, across, across, layers, spacing, 0.05);
  simulator.add_particles(places, decant::PointArray<float>::Zero(3, places.cols()), 0);
  double center = 0;
  constexpr int frames = 75, looked_at = 25;
  for (int frame = 0; frame < frames; ++frame) {
    REQUIRE(simulator.step(0.02).advanced());
    if (frame >= frames - looked_at) {
      center += decant_test::mean_over(simulator.fluid(), [&](Index i) { return simulator.fluid().position(2, i); }) /
                looked_at;
    }
  }
  return center / (0.5 * filled) - 1;
}

}  // namespace

TEST_CASE("liquid at rest stands as high as it was poured in, whatever the kernel") {
  const double cubic = rise<decant::DefaultParts<float>>();
  const double c2 = rise<With<decant::DefaultParts<float>, decant::WendlandC2>>();
  const double c4 = rise<With<decant::DefaultParts<float>, decant::WendlandC4>>();
  const double position_based = rise<decant::PositionBasedParts<float>>();
  const double position_based_c2 = rise<With<decant::PositionBasedParts<float>, decant::WendlandC2>>();
  CAPTURE(cubic, c2, c4, position_based, position_based_c2);
  // with W(0) for a particle's own value: 4.2 % and 7 % with C2 and C4, 3.7 % more with C2 position-based than now
  CHECK(std::abs(cubic) < 0.01);
  CHECK(std::abs(c2) < 0.01);
  CHECK(std::abs(c4) < 0.01);
  // few sweeps leave it compressed by a hundredth under the weight of twenty layers, with one kernel as with the other
  CHECK(std::abs(position_based_c2 - position_based) < 0.01);
}
