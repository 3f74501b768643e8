// SPDX-License-Identifier: MIT
#include <decant/force/surface_tension_schenck2017.hpp>

#include <cmath>

#include <decant/force/concept.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"
#include "laws.hpp"

using decant::CubicSpline;
using decant::Index;
using decant::PointArray;
using decant::SurfaceTensionSchenck2017;
using decant::Vector3;
using namespace decant::testing;

TEMPLATE_TEST_CASE("SurfaceTensionSchenck2017 keeps the laws of a force but not momentum", "", float, double) {
  decant_test::check(force_laws<CubicSpline<TestType>>(SurfaceTensionSchenck2017<TestType>{}, Keeps::Neither));
}

TEMPLATE_TEST_CASE("SurfaceTensionSchenck2017 is curvature times normal of the colour field", "", float, double) {
  using Kernel = CubicSpline<double>;
  auto liquid = loose_ball<CubicSpline<TestType>>(TestType(0.005), 4, 0.2, 0.0);
  SurfaceTensionSchenck2017<TestType> force;
  PointArray<TestType> got = PointArray<TestType>::Zero(3, liquid.fluid.size());
  force.accumulate(liquid.view(), got);
  const double h = static_cast<double>(liquid.smoothing_length);
  int pulled = 0, still = 0;
  double worst = 0, largest = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    Vector3<double> normal = Vector3<double>::Zero();
    double laplacian = 0;
    for (Index j = 0; j < liquid.fluid.size(); ++j) {
      const double volume = static_cast<double>(liquid.fluid.mass[j]) / static_cast<double>(liquid.fluid.density[j]);
      const Vector3<double> x = (liquid.fluid.position.col(i) - liquid.fluid.position.col(j)).template cast<double>();
      const double r = x.norm(), e = 1e-4 * h;
      normal += volume * Kernel::derivative_over_radius(r, h) * x;
      laplacian += volume * (r > 2 * e ? (Kernel::derivative(r + e, h) - Kernel::derivative(r - e, h)) / (2 * e) +
                                             2 * Kernel::derivative_over_radius(r, h)
                                       : 3 * Kernel::derivative_over_radius(0.0, h));
    }
    const double threshold = static_cast<double>(force.normal_threshold) / (2 * h);
    const Vector3<double> a = got.col(i).template cast<double>();
    if (normal.norm() > 1.001 * threshold) {
      const Vector3<double> expected = -static_cast<double>(force.surface_tension) /
                                       static_cast<double>(liquid.fluid.density[i]) * laplacian * normal.normalized();
      worst = std::max(worst, (a - expected).norm());
      largest = std::max(largest, expected.norm());
      ++pulled;
    } else if (normal.norm() < 0.999 * threshold) {
      CHECK(a.norm() == 0);
      ++still;
    }
  }
  CHECK(pulled > 50);
  CHECK(still > 10);
  CHECK(worst < 0.01 * largest);  // second derivatives are differences over 2 % of h; the spline's has kinks
}

TEMPLATE_TEST_CASE("SurfaceTensionSchenck2017 pulls a drop together", "", float, double) {
  auto liquid = loose_ball<CubicSpline<TestType>>(TestType(0.005), 5, 0.0, 0.0);
  SurfaceTensionSchenck2017<TestType> force;
  PointArray<TestType> got = PointArray<TestType>::Zero(3, liquid.fluid.size());
  force.accumulate(liquid.view(), got);
  double inward = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    inward -= static_cast<double>(got.col(i).dot(liquid.fluid.position.col(i)));
  }
  CHECK(inward > 0);
  force.surface_tension = 0;
  CHECK(std::isinf(force.largest_step(liquid.view())));
  got.setZero();
  force.accumulate(liquid.view(), got);
  CHECK(got.cwiseAbs().maxCoeff() == 0);
}
