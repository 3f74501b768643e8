// SPDX-License-Identifier: MIT
#include <decant/force/surface_tension.hpp>

#include <cmath>

#include <decant/force/concept.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/kernel/wendland_c2.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"
#include "laws.hpp"

using decant::CubicSpline;
using decant::Index;
using decant::PointArray;
using decant::SurfaceTension;
using decant::Vector3;
using namespace decant::testing;

TEMPLATE_TEST_CASE("SurfaceTension keeps the laws of a force and both momenta", "", float, double) {
  decant_test::check(force_laws<CubicSpline<TestType>>(SurfaceTension<TestType>{}, Keeps::LinearAndAngular));
  decant_test::check(force_laws<decant::WendlandC2<TestType>>(SurfaceTension<TestType>{}, Keeps::LinearAndAngular));
}

TEMPLATE_TEST_CASE("SurfaceTension of zero leaves everything as it is", "", float, double) {
  auto liquid = loose_ball<CubicSpline<TestType>>(TestType(0.005), 3, 0.1, 1.0);
  SurfaceTension<TestType> force;
  force.surface_tension = 0;
  PointArray<TestType> got = PointArray<TestType>::Zero(3, liquid.fluid.size());
  force.accumulate(liquid.view(), got);
  CHECK(got.cwiseAbs().maxCoeff() == 0);
  CHECK(std::isinf(force.largest_step(liquid.view())));
}

TEMPLATE_TEST_CASE("SurfaceTension is felt at the surface and pulls inward", "", float, double) {
  auto liquid = loose_ball<CubicSpline<TestType>>(TestType(0.005), 7, 0.0, 0.0);
  SurfaceTension<TestType> force;
  PointArray<TestType> got = PointArray<TestType>::Zero(3, liquid.fluid.size());
  force.accumulate(liquid.view(), got);
  double inside = 0, virial = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    const Vector3<double> x = liquid.fluid.position.col(i).template cast<double>();
    const Vector3<double> a = got.col(i).template cast<double>();
    inside = std::max(inside, x.norm() < 2.9 * 0.005 ? a.norm() : 0.0);
    virial -= static_cast<double>(liquid.fluid.mass[i]) * a.dot(x);
  }
  CHECK(inside < 1e-3 * static_cast<double>(got.colwise().norm().maxCoeff()));
  CHECK(virial > 0);
}

TEMPLATE_TEST_CASE("SurfaceTension and its damping are those of the formula", "", float, double) {
  using Kernel = CubicSpline<double>;
  auto liquid = loose_ball<CubicSpline<TestType>>(TestType(0.005), 3, 0.2, 0.1);
  SurfaceTension<TestType> force;
  PointArray<TestType> got = PointArray<TestType>::Zero(3, liquid.fluid.size());
  force.accumulate(liquid.view(), got);
  const double h = static_cast<double>(liquid.smoothing_length), mass = static_cast<double>(liquid.fluid.mass[0]);
  const double sigma = static_cast<double>(force.surface_tension), cohesion = static_cast<double>(force.cohesion);
  const double layer = static_cast<double>(force.surface_damping) * std::sqrt(sigma * h / 1000);
  const Index count = liquid.fluid.size();
  const auto place = [&](Index i) { return Vector3<double>(liquid.fluid.position.col(i).template cast<double>()); };
  PointArray<double> normal = PointArray<double>::Zero(3, count);
  for (Index i = 0; i < count; ++i) {
    for (Index j = 0; j < count; ++j) {
      const Vector3<double> x = place(i) - place(j);
      normal.col(i) += mass / 1000 * Kernel::derivative_over_radius(x.norm(), h) * x;
    }
  }
  double worst = 0, largest = 0;
  for (Index i = 0; i < count; ++i) {
    Vector3<double> expected = Vector3<double>::Zero();
    for (Index j = 0; j < count; ++j) {
      const Vector3<double> x = place(i) - place(j);
      const double r = x.norm();
      if (j == i || r >= 2 * h) {
        continue;
      }
      double pull = 0, weight = 0;
      for (const Index k : {i, j}) {
        const double length = std::sqrt(normal.col(k).squaredNorm() + 0.01 / (h * h));
        const double across = normal.col(k).dot(x) / r;
        weight += normal.col(k).squaredNorm() / length;
        pull += (cohesion * normal.col(k).squaredNorm() - across * across) / length;
      }
      const Vector3<double> v = (liquid.fluid.velocity.col(i) - liquid.fluid.velocity.col(j)).template cast<double>();
      const double slope = Kernel::derivative_over_radius(r, h);
      expected += mass * slope * (2 * sigma / 1e6 * pull + 10 * layer * h * weight / 1000 * v.dot(x) / (r * r)) * x;
    }
    worst = std::max(worst, (expected - got.col(i).template cast<double>()).norm());
    largest = std::max(largest, expected.norm());
  }
  CHECK(worst < 1e-3 * largest);  // r^2 carries a softening of 1e-4 h^2
}
