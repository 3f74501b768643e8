// SPDX-License-Identifier: MIT
#pragma once

/// A PressureSystem written out.

#include <vector>

#include <Eigen/Dense>

#include <decant/pressure/pressure_system.hpp>

namespace decant_test {

/// -dt^2 dD_i / dP_j, column by column.
template <class Step>
Eigen::MatrixXd matrix_of(const Step& step, decant::PressureSystem<double>& system) {
  const decant::Index n = step.fluid.size();
  Eigen::MatrixXd matrix(n, n);
  std::vector<double> unit(static_cast<std::size_t>(n), 0.0);
  for (decant::Index j = 0; j < n; ++j) {
    unit[static_cast<std::size_t>(j)] = 1;
    system.accelerate(step.neighbors, unit.data(), step.threads);
    unit[static_cast<std::size_t>(j)] = 0;
    for (decant::Index i = 0; i < n; ++i) {
      matrix(i, j) = -step.time_step * step.time_step *
                     system.density_rate(step.neighbors, system.accelerations(), i, false);
    }
  }
  return matrix;
}

}  // namespace decant_test
