// SPDX-License-Identifier: MIT
#include <decant/force/pair_kernel.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include <decant/kernel/cubic_spline.hpp>
#include <decant/kernel/lattice.hpp>
#include <decant/kernel/wendland_c2.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"

using decant::Index;
using namespace decant::testing;

namespace {

/// Density of one particle in double, from all others [kg/m^3].
template <class KernelOfDouble, class Kernel>
double density_by_all(const LooseLiquid<Kernel>& liquid, Index i) {
  const auto h = static_cast<double>(liquid.smoothing_length);
  double density = static_cast<double>(liquid.rest_density * liquid.walls.share[i]);
  for (Index j = 0; j < liquid.fluid.size(); ++j) {
    if (j == i) {
      density += static_cast<double>(liquid.fluid.mass[i]) *
                 decant::own_value<KernelOfDouble>(h, static_cast<double>(liquid.spacing));
      continue;
    }
    const decant::Vector3<double> apart =
        (liquid.fluid.position.col(i) - liquid.fluid.position.col(j)).template cast<double>();
    density += static_cast<double>(liquid.fluid.mass[j]) * KernelOfDouble::value(apart.norm(), h);
  }
  return density;
}

template <class Kernel, class KernelOfDouble>
void check_against_all_pairs(LooseLiquid<Kernel>& liquid) {
  using Scalar = typename Kernel::Scalar;
  constexpr double rounding = 50 * static_cast<double>(std::numeric_limits<Scalar>::epsilon());
  liquid.walls.share[7] = Scalar(0.25);
  decant::PairKernel<Scalar> pairs;
  auto view = liquid.view();
  const decant::StepView<Kernel, typename LooseLiquid<Kernel>::Neighbors> step{liquid.fluid,
                                                                               liquid.neighbors,
                                                                               pairs,
                                                                               liquid.walls,
                                                                               liquid.correction,
                                                                               liquid.shift,
                                                                               view.smoothing_length,
                                                                               view.spacing,
                                                                               view.rest_density,
                                                                               view.time_step,
                                                                               0.0,
                                                                               {1}};
  pairs.compute(step);
  double worst_density = 0, worst_slope = 0;
  Index compared = 0;
  const auto h = static_cast<double>(liquid.smoothing_length);
  const double steepest = std::abs(KernelOfDouble::derivative_over_radius(1e-3 * h, h));
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    const double right = density_by_all<KernelOfDouble>(liquid, i);
    worst_density = std::max(worst_density, std::abs(static_cast<double>(liquid.fluid.density[i]) - right) / right);
    liquid.neighbors.for_each_batch(i, [&](const auto& pair) {
      std::array<Scalar, decant::Batch<Scalar>::width> slope;
      pairs.slope(pair.slot).store(slope.data());
      for (int lane = 0; lane < decant::Batch<Scalar>::width; ++lane) {
        const auto j = static_cast<Index>(pair.neighbor[lane]);
        if (j == i) {
          continue;  // rows are filled up with the particle itself
        }
        const double distance =
            (liquid.fluid.position.col(i) - liquid.fluid.position.col(j)).template cast<double>().norm();
        const double expected = KernelOfDouble::derivative_over_radius(distance, h);
        worst_slope = std::max(
            worst_slope, std::abs(static_cast<double>(slope[static_cast<std::size_t>(lane)]) - expected) / steepest);
        ++compared;
      }
    });
  }
  CHECK(compared > 10 * liquid.fluid.size());
  CHECK(worst_density < rounding);
  CHECK(worst_slope < rounding);
}

}  // namespace

TEMPLATE_TEST_CASE("PairKernel: slopes and densities are those of all pairs, whether masses are alike or not", "",
                   float, double) {
  auto liquid = loose_ball<decant::CubicSpline<TestType>>(TestType(0.005), 5, 0.2, 0);
  check_against_all_pairs<decant::CubicSpline<TestType>, decant::CubicSpline<double>>(liquid);
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    liquid.fluid.mass[i] *= TestType(1) + TestType(0.1) * static_cast<TestType>(i % 7);
  }
  check_against_all_pairs<decant::CubicSpline<TestType>, decant::CubicSpline<double>>(liquid);

  auto other = loose_ball<decant::WendlandC2<TestType>>(TestType(0.004), 4, 0.2, 0);
  check_against_all_pairs<decant::WendlandC2<TestType>, decant::WendlandC2<double>>(other);
}

TEST_CASE("PairKernel: says whether there is one mass") {
  auto liquid = loose_ball<decant::CubicSpline<float>>(0.005f, 4, 0.2, 0);
  CHECK(liquid.pairs.common_mass() == liquid.fluid.mass[0]);
  liquid.fluid.mass[3] *= 2;
  liquid.update();
  CHECK(liquid.pairs.common_mass() == 0);
  liquid.place(decant::PointArray<float>(3, 0));
  CHECK(liquid.pairs.common_mass() == 0);
}
