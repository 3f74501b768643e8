// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdio>

#include <decant/core/fluid_state.hpp>
#include <decant/core/parallel.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/version.hpp>

#include "level.hpp"

/// A block of particles 5 mm apart has the density of water in its middle; says so, and fails where it has not.
int main() {
  const double spacing = 0.005;
  const int edge = 9;
  decant::FluidState<double> fluid;
  fluid.resize(edge * edge * edge);
  for (decant::Index i = 0; i < fluid.size(); ++i) {
    fluid.position.col(i) << double(i % edge), double(i / edge % edge), double(i / edge / edge);
    fluid.mass[i] = 998.0 * spacing * spacing * spacing;
  }
  fluid.position *= spacing;
  const double middle = spacing * (edge / 2);
  const double density = density_at({middle, middle, middle}, fluid, spacing);
  std::printf("decant %s: %.1f kg/m^3, threads: %d\n", DECANT_VERSION, density, decant::Threads{}.resolved());
  return std::abs(density - 998.0) < 20 ? 0 : 1;
}
