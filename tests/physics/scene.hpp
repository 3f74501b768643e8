// SPDX-License-Identifier: MIT
#pragma once

/// Blocks of liquid and readings that the physics tests share.

#include <cmath>
#include <random>

#include <decant/core/fluid_state.hpp>
#include <decant/core/types.hpp>
#include <decant/simulation/simulator.hpp>

namespace decant_test {

/// A cubic lattice with its first layer half a spacing off `corner`, each coordinate moved by up to `jitter` spacings.
template <class Scalar>
decant::PointArray<Scalar> block(const decant::Vector3<double>& corner, int nx, int ny, int nz, double spacing,
                                 double jitter = 0) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> moved(-jitter, jitter);
  decant::PointArray<Scalar> places(3, nx * ny * nz);
  decant::Index next = 0;
  for (int k = 0; k < nz; ++k) {
    for (int j = 0; j < ny; ++j) {
      for (int i = 0; i < nx; ++i) {
        const decant::Vector3<double> x(i + 0.5 + moved(random), j + 0.5 + moved(random), k + 0.5 + moved(random));
        places.col(next++) = (corner + spacing * x).template cast<Scalar>();
      }
    }
  }
  return places;
}

/// A simulator of a slice of the world: `width` particles across, which is y, and periodic there. One thread.
inline decant::Simulator<decant::PeriodicParts<>> slice(double spacing, int width) {
  decant::SimulatorSettings settings;
  settings.spacing = spacing;
  settings.threads = {1};
  const decant::PeriodicParts<>::Domain domain(decant::Vector3<float>(0, static_cast<float>(width * spacing), 0));
  return decant::Simulator<decant::PeriodicParts<>>(settings, domain);
}

/// The block of a slice, from the origin on. @param length, depth along x and z [m].
inline decant::PointArray<float> slice_block(double length, int width, double depth, double spacing) {
  return block<float>({0, 0, 0}, static_cast<int>(std::lround(length / spacing)), width,
                      static_cast<int>(std::lround(depth / spacing)), spacing);
}

/// Mean of f(particle) over all particles.
template <class Scalar, class Function>
double mean_over(const decant::FluidState<Scalar>& fluid, Function&& f) {
  double total = 0;
  for (decant::Index i = 0; i < fluid.size(); ++i) {
    total += static_cast<double>(f(i));
  }
  return total / static_cast<double>(fluid.size());
}

}  // namespace decant_test
