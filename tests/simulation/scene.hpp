// SPDX-License-Identifier: MIT
#pragma once

/// What the scenes of the simulator's tests are put together from.

#include <cmath>
#include <vector>

#include <decant/core/pose.hpp>
#include <decant/core/types.hpp>
#include <decant/simulation/simulator_settings.hpp>

namespace decant_test {

inline decant::SimulatorSettings with_spacing(double spacing, int threads = 1) {
  decant::SimulatorSettings settings;
  settings.spacing = spacing;
  settings.threads = {threads};
  return settings;
}

/// A cubic lattice of nx x ny x nz places, its first one half a spacing off `corner` each way.
template <class Scalar>
decant::PointArray<Scalar> block(int nx, int ny, int nz, double spacing,
                                 const decant::Vector3<double>& corner = decant::Vector3<double>::Zero()) {
  decant::PointArray<Scalar> places(3, nx * ny * nz);
  decant::Index next = 0;
  for (int i = 0; i < nx; ++i) {
    for (int j = 0; j < ny; ++j) {
      for (int k = 0; k < nz; ++k) {
        const decant::Vector3<double> x(i + 0.5, j + 0.5, k + 0.5);
        places.col(next++) = (corner + spacing * x).template cast<Scalar>();
      }
    }
  }
  return places;
}

/// Turns about y by 0.1 sin(rate t) [rad] and shifts along x by reach sin(shift_rate t) [m], in poses 10 ms apart.
inline decant::PoseTrack rocking(double seconds, double rate, double reach = 0, double shift_rate = 0) {
  std::vector<decant::PoseTrack::Sample> samples;
  for (int k = 0; k <= std::lround(100 * seconds); ++k) {
    const double t = 0.01 * k;
    const Eigen::AngleAxisd turn(0.1 * std::sin(rate * t), Eigen::Vector3d::UnitY());
    samples.push_back({t, {Eigen::Quaterniond(turn), {reach * std::sin(shift_rate * t), 0, 0}}});
  }
  return decant::PoseTrack(samples);
}

}  // namespace decant_test
