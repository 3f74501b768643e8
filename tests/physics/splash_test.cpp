// SPDX-License-Identifier: MIT
// A splash on a floor: what weakly compressible solvers, whose sub-steps follow the speed of sound, may not add to it.

#include <algorithm>
#include <cmath>
#include <random>
#include <tuple>

#include <decant/boundary/shapes.hpp>
#include <decant/kernel/wendland_c2.hpp>
#include <decant/pressure/state_equation.hpp>
#include <decant/pressure/state_equation_schenck2017.hpp>
#include <decant/simulation/simulator.hpp>

#include "catch.hpp"
#include "physics/scene.hpp"

using decant::Index;
using Vector = decant::Vector3<double>;

namespace {

template <class Solver>
struct SplashParts : decant::DefaultParts<float> {
  using Kernel = decant::WendlandC2<float>;
  using Forces = std::tuple<decant::Gravity<float>>;
  using PressureSolver = Solver;
};

void set_sound(decant::StateEquation<float>& solver, float speed) { solver.set_sound_speed(speed, 1000); }
void set_sound(decant::StateEquationSchenck2017<float>& solver, float speed) { solver.sound_speed = 1000 * speed; }

}  // namespace

TEMPLATE_TEST_CASE("a splash throws nothing faster than it fell", "", decant::StateEquation<float>,
                   decant::StateEquationSchenck2017<float>) {
  const double fall = 0.2, entry = 1.5, spray = 0.4, top = fall + 0.05 + spray;
  decant::SimulatorSettings settings;
  settings.spacing = 0.003;
  settings.threads = {1};
  decant::Simulator<SplashParts<TestType>> simulator(settings);
  simulator.add_body("pan", decant::CylinderInside{0.13, 0.3, 0.003, decant::Face::PositiveZ});
  set_sound(simulator.pressure_solver(), 14);  // four times as fast as the last drop arrives
  const auto block = decant_test::block<float>({-0.0165, -0.0165, fall}, 11, 11, 14, settings.spacing, 0.13);
  simulator.add_particles(block, Vector(0, 0, -entry).cast<float>().replicate(1, block.cols()), 0);
  // drops of one particle, which have no pressure until two of them meet at the floor
  std::mt19937 random(1);
  std::uniform_real_distribution<double> share(0, 1);
  for (int k = 0; k < 700; ++k) {
    const Vector place(0.08 * (share(random) - 0.5), 0.08 * (share(random) - 0.5), top - spray * share(random));
    simulator.add_particles(place.cast<float>(), Vector(0, 0, -entry).cast<float>(), 0);
  }
  const double fastest = std::sqrt(entry * entry + 2 * 9.81 * top);
  for (int frame = 0; frame < 12; ++frame) {
    REQUIRE(simulator.step(1.0 / 60).advanced());
    // crowded particles share the energy unevenly, so a few may be somewhat faster than any that fell
    CHECK(static_cast<double>(simulator.fluid().velocity.colwise().norm().maxCoeff()) < 1.2 * fastest);
  }
}
