// SPDX-License-Identifier: MIT
#include "level.hpp"

#include <decant/core/parallel.hpp>
#include <decant/kernel/cubic_spline.hpp>

double density_at(const decant::Vector3<double>& x, const decant::FluidState<double>& fluid, double h) {
  decant::Reduction<double> reduction;
  const auto of_range = [&](decant::Index begin, decant::Index end) {
    double sum = 0;
    for (decant::Index i = begin; i < end; ++i) {
      sum += fluid.mass[i] * decant::CubicSpline<double>::value((fluid.position.col(i) - x).norm(), h);
    }
    return sum;
  };
  return reduction.over(fluid.size(), decant::Threads{}, 0.0, of_range, [](double a, double b) { return a + b; });
}
