// SPDX-License-Identifier: MIT
#include <decant/pressure/position_based.hpp>

#include <cmath>
#include <limits>

#include <decant/kernel/cubic_spline.hpp>
#include <decant/pressure/concept.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"

using decant::CubicSpline;
using decant::Index;
using decant::PointArray;
using decant::PositionBased;
using decant::PressureReport;
using decant::Vector3;
using namespace decant::testing;

namespace {

template <class Scalar>
auto ball(double scale, double disorder, double speed, int radius = 5) {
  auto liquid = loose_ball<CubicSpline<Scalar>>(Scalar(0.005), radius, disorder, speed);
  const PointArray<Scalar> velocity = liquid.fluid.velocity;
  liquid.place(static_cast<Scalar>(scale) * liquid.fluid.position);
  liquid.fluid.velocity = velocity;
  liquid.update(PositionBased<Scalar>::search_margin);
  return liquid;
}

template <class Liquid>
double mean_compression(const Liquid& liquid) {
  double sum = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    sum += std::max(0.0, static_cast<double>(liquid.fluid.density[i]) / 1000 - 1);
  }
  return sum / static_cast<double>(liquid.fluid.size());
}

template <class Solver, class Liquid>
PressureReport solve(Solver& solver, Liquid& liquid, int threads = 1) {
  liquid.threads = {threads};
  PressureReport report;
  solver.begin_step(liquid.view(), report);
  solver.solve(liquid.view(), report);
  return report;
}

}  // namespace

TEMPLATE_TEST_CASE("PositionBased reaches the rest density at the next positions", "", float, double) {
  auto liquid = ball<TestType>(0.98, 0.1, 0.0);
  const double before = mean_compression(liquid);
  CHECK(before > 0.01);
  PositionBased<TestType> solver;
  solver.most_iterations = 60;
  solver.recovery = 1;  // the paper's: all at once
  const PressureReport report = solve(solver, liquid);
  CHECK(report.converged);
  CHECK(report.density_iterations > 1);
  CHECK(report.density_iterations < 60);
  liquid.fluid.position += liquid.time_step * liquid.fluid.velocity;
  liquid.update();
  // what it says is what a fresh search over the new positions finds
  CHECK(mean_compression(liquid) == Approx(report.density_error).epsilon(0.01));
  CHECK(mean_compression(liquid) <= 1.001e-3);
  CHECK(liquid.fluid.pressure.maxCoeff() > 0);
  CHECK(liquid.fluid.pressure.minCoeff() >= 0);
}

TEMPLATE_TEST_CASE("PositionBased makes speed of a share of what was too dense before", "", float, double) {
  auto liquid = ball<TestType>(0.98, 0.1, 0.0);
  const double before = mean_compression(liquid);
  PositionBased<TestType> solver;
  solver.most_iterations = 60;
  solver.density_tolerance = TestType(1e-4);
  const PressureReport report = solve(solver, liquid);
  CHECK(report.converged);
  liquid.fluid.position += liquid.time_step * liquid.fluid.velocity;
  liquid.update();
  CHECK(mean_compression(liquid) == Approx(report.density_error).epsilon(0.01));
  // pushing one apart relieves its neighbours too, so rather less is left
  CHECK(report.density_error < (1 - 0.3) * before + 1e-4);
  CHECK(report.density_error > (1 - 2 * 0.3) * before);
  // what this sub-step compresses it undoes whole
  auto pressed = ball<TestType>(1.0, 0.0, 0.0);
  const double at_rest = mean_compression(pressed);
  pressed.fluid.velocity = TestType(-20) * pressed.fluid.position;  // by 2 % in a millisecond
  const PressureReport kept = solve(solver, pressed);
  CHECK(kept.converged);
  CHECK(kept.density_error < at_rest + 2e-4);
}

TEMPLATE_TEST_CASE("PositionBased keeps momentum and does not know the number of threads", "", float, double) {
  auto liquid = ball<TestType>(0.98, 0.1, 0.1, radius_for_four_threads);
  const PointArray<TestType> before = liquid.fluid.velocity;
  PositionBased<TestType> solver;
  solve(solver, liquid);
  const PointArray<TestType> once = liquid.fluid.velocity;
  Vector3<double> change = Vector3<double>::Zero();
  double size = 0;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    const Vector3<double> step = (once.col(i) - before.col(i)).template cast<double>();
    change += step;
    size += step.norm();
  }
  CHECK(size > 0);
  CHECK(change.norm() < 300 * static_cast<double>(std::numeric_limits<TestType>::epsilon()) * size);
  for (const int threads : {2, 4}) {
    liquid.fluid.velocity = before;
    solve(solver, liquid, threads);
    CHECK((PointArray<TestType>(liquid.fluid.velocity) == once));
  }
}

TEMPLATE_TEST_CASE("PositionBased leaves liquid alone that is not compressed", "", float, double) {
  auto liquid = ball<TestType>(1.1, 0.0, 0.0);
  liquid.fluid.velocity.row(1).setConstant(TestType(0.25));
  PositionBased<TestType> solver;
  const PressureReport report = solve(solver, liquid);
  CHECK(report.density_iterations == 0);
  CHECK(report.density_error == 0);
  CHECK(report.converged);
  CHECK((liquid.fluid.velocity.row(1).array() - TestType(0.25)).abs().maxCoeff() < TestType(1e-6));
  CHECK(liquid.fluid.velocity.row(0).cwiseAbs().maxCoeff() == 0);
  CHECK(liquid.fluid.pressure.cwiseAbs().maxCoeff() == 0);
}

TEMPLATE_TEST_CASE("PositionBased pushes off a wall that comes near", "", float, double) {
  auto liquid = ball<TestType>(1.0, 0.0, 0.0);
  PositionBased<TestType> solver;
  solver.density_tolerance = TestType(1e-6);  // of the mean over all, and here it is about one particle
  Index lowest = 0;
  liquid.fluid.position.row(2).minCoeff(&lowest);
  liquid.walls.gradient(2, lowest) = -160;
  // a wall that fills just what the liquid leaves
  const double own = static_cast<double>(liquid.fluid.density[lowest]) / 1000;
  liquid.walls.share[lowest] = static_cast<TestType>(1 - own);
  solve(solver, liquid);
  const TestType still = liquid.fluid.velocity(2, lowest);
  liquid.fluid.velocity.setZero();
  liquid.walls.flux[lowest] = -160 * TestType(0.5);  // moves up at 0.5 m/s
  solver.most_iterations = 100;
  solve(solver, liquid);
  CHECK(liquid.fluid.velocity(2, lowest) > still + TestType(0.05));
  CHECK(liquid.fluid.velocity(2, lowest) < TestType(1.0));
}

TEMPLATE_TEST_CASE("PositionBased reports what it did not reach and survives few particles", "", float, double) {
  auto liquid = ball<TestType>(0.9, 0.1, 0.0);
  PositionBased<TestType> solver;
  solver.most_iterations = 1;
  const PressureReport report = solve(solver, liquid);
  CHECK_FALSE(report.converged);
  CHECK(report.density_iterations == 1);
  CHECK(report.density_error > 1e-3);
  for (const Index count : {0, 1, 2}) {
    liquid.place(PointArray<TestType>::Zero(3, count));
    solve(solver, liquid);
    CHECK(liquid.fluid.velocity.allFinite());
  }
  liquid = ball<TestType>(0.9, 0.1, 0.0);
  liquid.time_step = 0;
  solve(solver, liquid);
  CHECK(liquid.fluid.velocity.cwiseAbs().maxCoeff() == 0);
}

TEMPLATE_TEST_CASE("PositionBased moves liquid of one mass, and liquid at rest, as it does any other", "", float,
                   double) {
  // a lone particle, far away, of another mass or with a speed: the others feel nothing of it, but are not alike
  const auto with_one_more = [](TestType factor, TestType speed) {
    auto liquid = ball<TestType>(0.96, 0.1, 0.0);
    PointArray<TestType> places(3, liquid.fluid.size() + 1);
    places << liquid.fluid.position, Vector3<TestType>(1, 0, 0);
    const TestType mass = liquid.fluid.mass[0];
    liquid.fluid.resize(places.cols());
    liquid.fluid.mass.setConstant(mass);
    liquid.place(places);
    liquid.fluid.mass[liquid.fluid.size() - 1] = factor * mass;
    liquid.fluid.velocity.setZero();
    liquid.fluid.velocity(0, liquid.fluid.size() - 1) = speed;
    liquid.update(PositionBased<TestType>::search_margin);
    return liquid;
  };
  const auto moves = [&](TestType factor, TestType speed, bool measures) {
    auto liquid = with_one_more(factor, speed);
    PositionBased<TestType> solver;
    solver.most_iterations = 3;
    solver.recovery = 1;
    solver.measures_what_is_left = measures;
    const PressureReport report = solve(solver, liquid);
    CHECK(report.density_iterations == 3);
    CHECK((report.density_error > 0) == measures);
    return PointArray<TestType>(liquid.fluid.velocity.leftCols(liquid.fluid.size() - 1));
  };
  const PointArray<TestType> alike = moves(1, 0, true), any = moves(2, 0, true), moving = moves(1, TestType(0.1), true);
  const TestType largest = alike.cwiseAbs().maxCoeff();
  const TestType rounding = 100 * std::numeric_limits<TestType>::epsilon() * largest;
  CHECK(largest > 0);
  CHECK((alike - any).cwiseAbs().maxCoeff() < rounding);
  CHECK((alike - moving).cwiseAbs().maxCoeff() < rounding);
  CHECK(moves(1, 0, false) == alike);
}
