// SPDX-License-Identifier: MIT
#include <decant/pressure/dfsph.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include <decant/kernel/cubic_spline.hpp>
#include <decant/pressure/concept.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"

using decant::CubicSpline;
using decant::Dfsph;
using decant::Index;
using decant::PointArray;
using decant::PressureReport;
using decant::Vector3;
using namespace decant::testing;

namespace {

/// A ball, its places scaled, with the velocity flow * x.
template <class Scalar>
auto dense_ball(double scale, const Eigen::Matrix3d& flow = Eigen::Matrix3d::Zero()) {
  auto liquid = loose_ball<CubicSpline<Scalar>>(Scalar(0.005), 6, 0.1, 0);
  liquid.place(static_cast<Scalar>(scale) * liquid.fluid.position);
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    liquid.fluid.velocity.col(i) =
        (flow * liquid.fluid.position.col(i).template cast<double>()).template cast<Scalar>();
  }
  return liquid;
}

template <class Liquid>
Vector3<double> momentum(const Liquid& liquid) {
  return liquid.fluid.velocity.template cast<double>() * liquid.fluid.mass.template cast<double>();
}

/// By how much velocities compress the liquid within a sub-step, in the mean over particles at least at rest density,
/// over rest density: the divergence that is exact for linear velocities, summed pair by pair.
template <class Liquid>
double compression_by_velocities(const Liquid& liquid) {
  using Scalar = typename Liquid::Scalar;
  double total = 0;
  int counted = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    if (liquid.fluid.density[i] < liquid.rest_density) {
      continue;
    }
    double rate = 0;
    liquid.neighbors.for_each(i, [&](Index j, const Vector3<Scalar>& apart, Scalar r_squared) {
      const Vector3<Scalar> slope =
          Liquid::Kernel::derivative_over_radius(std::sqrt(r_squared), liquid.smoothing_length) * apart;
      const Vector3<Scalar> difference = liquid.fluid.velocity.col(i) - liquid.fluid.velocity.col(j);
      rate += static_cast<double>(liquid.fluid.mass[j] * difference.dot(liquid.correction.apply(i, slope)));
    });
    total += std::max(0.0, rate * static_cast<double>(liquid.time_step / liquid.rest_density));
    ++counted;
  }
  return total / counted;
}

/// One sub-step's part of a solver that remembers nothing: solve or correct_places.
template <class Solver, class Liquid, class Part>
PressureReport report_of(Solver& solver, Liquid& liquid, Part&& part) {
  PressureReport report;
  solver.begin_frame();
  solver.begin_step(liquid.view(), report);
  part(liquid.view(), report);
  return report;
}

}  // namespace

TEMPLATE_TEST_CASE("Dfsph: velocities no longer compress liquid at rest density, and momentum is kept", "", float,
                   double) {
  auto liquid = dense_ball<TestType>(0.98, -20 * Eigen::Matrix3d::Identity());  // 6 % in a sub-step of 1 ms
  liquid.fluid.velocity.row(0).array() += TestType(0.3);
  const Vector3<double> before = momentum(liquid);
  CHECK(compression_by_velocities(liquid) > 0.02);
  Dfsph<TestType> solver;
  const PressureReport report =
      report_of(solver, liquid, [&](const auto& step, PressureReport& taken) { solver.solve(step, taken); });
  CHECK(report.converged);
  CHECK(report.divergence_error <= 1e-4);
  // the mean of the report is over all particles, of which a third is loose
  CHECK(compression_by_velocities(liquid) < 3e-4);
  const double rounding = static_cast<double>(std::numeric_limits<TestType>::epsilon());
  CHECK((momentum(liquid) - before).norm() < 20 * rounding * before.norm());
  CHECK(liquid.fluid.pressure.minCoeff() >= 0);
  CHECK(liquid.fluid.pressure.maxCoeff() > 0);
  CHECK(liquid.fluid.position.allFinite());
}

TEMPLATE_TEST_CASE("Dfsph: shear, rotation and expansion meet no pressure", "", float, double) {
  Eigen::Matrix3d shear, turn, expansion;
  shear << 0, 30, 0, 0, 0, 0, 0, -10, 0;
  turn << 0, -20, 5, 20, 0, -10, -5, 10, 0;
  expansion << 10, 0, 0, 0, 5, 0, 0, 0, 20;
  for (const Eigen::Matrix3d& flow : {shear, turn, expansion}) {
    auto liquid = dense_ball<TestType>(0.98, flow);
    const PointArray<TestType> before = liquid.fluid.velocity;
    Dfsph<TestType> solver;
    const PressureReport report =
        report_of(solver, liquid, [&](const auto& step, PressureReport& taken) { solver.solve(step, taken); });
    CHECK(report.converged);
    // gradients are kept to one part in 4,000; the ball's edge moves at 0.6 m/s
    CHECK((liquid.fluid.velocity - before).cwiseAbs().maxCoeff() < 2e-3);
  }
}

namespace {

template <class Liquid>
double over_dense(const Liquid& liquid) {
  double total = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    total += std::max(0.0, static_cast<double>(liquid.fluid.density[i] / liquid.rest_density) - 1);
  }
  return total / static_cast<double>(liquid.fluid.size());
}

}  // namespace

TEMPLATE_TEST_CASE("Dfsph: what is too dense moves apart, and gains no speed", "", float, double) {
  auto liquid = dense_ball<TestType>(0.99);
  const double before = over_dense(liquid);
  CHECK(before > 0.02);
  Dfsph<TestType> solver;
  const PressureReport report =
      report_of(solver, liquid, [&](const auto& step, PressureReport& taken) { solver.correct_places(step, taken); });
  CHECK(report.converged);
  CHECK(report.density_error <= 1e-3);
  CHECK(liquid.fluid.velocity.isZero(0));
  const PointArray<double> shift = PointArray<TestType>(liquid.shift).template cast<double>();
  const double most = shift.colwise().norm().maxCoeff();
  CHECK(most > 0);
  const Vector3<double> total = shift * liquid.fluid.mass.template cast<double>();
  const double rounding = static_cast<double>(std::numeric_limits<TestType>::epsilon());
  CHECK(total.norm() < 20 * rounding * most * static_cast<double>(liquid.fluid.mass.sum()));
  liquid.fluid.position += PointArray<TestType>(liquid.shift);
  liquid.update();
  // the formula is linear in the shift, so what it leaves is of second order
  CHECK(over_dense(liquid) < 0.1 * before);
}
