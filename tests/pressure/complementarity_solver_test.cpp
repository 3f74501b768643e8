// SPDX-License-Identifier: MIT
#include <decant/pressure/complementarity_solver.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

#include <decant/kernel/cubic_spline.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"
#include "pressure/matrix_of.hpp"

using decant::ComplementaritySolver;
using decant::Index;
using decant::PointArray;
using decant::PressureSystem;
using decant::Vector3;
using decant_test::matrix_of;
using namespace decant::testing;
using Kernel = decant::CubicSpline<double>;

namespace {

/// Projected Gauss-Seidel, until nothing changes: slow, and nothing to go wrong.
Eigen::VectorXd reference(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& offset) {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(offset.size());
  for (int sweep = 0; sweep < 20000; ++sweep) {
    double moved = 0;
    for (Index i = 0; i < x.size(); ++i) {
      const double next = std::max(0.0, x[i] + (offset[i] - matrix.row(i).dot(x)) / matrix(i, i));
      moved = std::max(moved, std::abs(next - x[i]) * matrix(i, i));
      x[i] = next;
    }
    if (moved < 1e-10) {
      break;
    }
  }
  return x;
}

}  // namespace

TEST_CASE("PressureSystem: what pressure does and what compression costs are adjoint, with and without correction") {
  auto liquid = loose_ball<Kernel>(0.005, 3, 0.2, 0.1);
  const auto step = liquid.view();
  PressureSystem<double> plain, corrected;
  plain.assemble(step);
  corrected.correct(plain, step);
  for (auto* system : {&plain, &corrected}) {
    const Eigen::MatrixXd matrix = matrix_of(step, *system);
    CHECK((matrix - matrix.transpose()).norm() < 1e-12 * matrix.norm());
    for (Index i = 0; i < matrix.rows(); ++i) {
      REQUIRE(step.time_step * step.time_step * system->diagonal()[i] == Approx(matrix(i, i)).epsilon(1e-9));
    }
  }
}

TEST_CASE("PressureSystem: the corrected pressure of a free drop turns and pushes nothing as a whole") {
  auto liquid = loose_ball<Kernel>(0.005, 4, 0.25, 0.1);
  const auto step = liquid.view();
  PressureSystem<double> plain, corrected;
  plain.assemble(step);
  corrected.correct(plain, step);
  std::vector<double> pressure(static_cast<std::size_t>(step.fluid.size()));
  for (std::size_t i = 0; i < pressure.size(); ++i) {
    pressure[i] = 1 + 0.7 * std::sin(3.0 * static_cast<double>(i));
  }
  corrected.accelerate(step.neighbors, pressure.data(), step.threads);
  Vector3<double> push = Vector3<double>::Zero(), torque = push;
  double size = 0;
  for (Index i = 0; i < step.fluid.size(); ++i) {
    const Eigen::Map<const Vector3<double>> a(corrected.accelerations() + 4 * i);
    push += a;
    torque += Vector3<double>(step.fluid.position.col(i)).cross(a);
    size += a.norm();
  }
  CHECK(push.norm() < 1e-13 * size);
  CHECK(torque.norm() < 1e-13 * size * 0.02);
}

TEST_CASE("PressureSystem in half precision: close to the exact one, and pairs push each other alike to rounding") {
  const auto vary = [](auto& liquid) {
    for (Index i = 0; i < liquid.fluid.size(); ++i) {
      liquid.fluid.mass[i] *= 1 + static_cast<float>(i % 3) / 4;
    }
    liquid.update();
  };
  auto rough = loose_ball<decant::CubicSpline<float>>(0.005f, 5, 0.25, 0.1);
  auto exact = loose_ball<Kernel>(0.005, 5, 0.25, 0.1);
  for (const bool same_mass : {true, false}) {
    if (!same_mass) {
      vary(rough);
      vary(exact);
    }
    PressureSystem<float> rough_plain, rough_corrected;
    rough_plain.assemble(rough.view());
    rough_corrected.correct(rough_plain, rough.view());
    PressureSystem<double> plain, corrected;
    plain.assemble(exact.view());
    corrected.correct(plain, exact.view());
    const auto count = static_cast<std::size_t>(exact.fluid.size());
    std::vector<float> rough_pressure(count);
    std::vector<double> pressure(count);
    for (std::size_t i = 0; i < count; ++i) {
      rough_pressure[i] = 1 + 0.7f * std::sin(3.0f * static_cast<float>(i));
      pressure[i] = static_cast<double>(rough_pressure[i]);
    }
    for (auto [rough_system, system] : {std::pair{&rough_plain, &plain}, std::pair{&rough_corrected, &corrected}}) {
      rough_system->accelerate(rough.neighbors, rough_pressure.data(), {1});
      system->accelerate(exact.neighbors, pressure.data(), {1});
      Vector3<double> push = Vector3<double>::Zero();
      double size = 0, off = 0, rate_off = 0, rate_size = 0;
      for (Index i = 0; i < exact.fluid.size(); ++i) {
        const Vector3<double> a =
            Eigen::Map<const decant::Vector3<float>>(rough_system->accelerations() + 4 * i).cast<double>();
        push += static_cast<double>(rough.fluid.mass[i]) * a;
        size += static_cast<double>(rough.fluid.mass[i]) * a.norm();
        off += static_cast<double>(rough.fluid.mass[i]) *
               (a - Eigen::Map<const Vector3<double>>(system->accelerations() + 4 * i)).norm();
        const double rate = system->density_rate(exact.neighbors, system->accelerations(), i, false);
        rate_size += std::abs(rate);
        rate_off += std::abs(rate - static_cast<double>(rough_system->density_rate(
                                        rough.neighbors, rough_system->accelerations(), i, false)));
      }
      INFO("masses " << (same_mass ? "alike" : "different"));
      CHECK(push.norm() < 1e-6 * size);
      CHECK(off < 5e-4 * size);  // half precision rounds by at most 2^-11
      CHECK(rate_off < 1e-3 * rate_size);
    }
  }
}

TEST_CASE("ComplementaritySolver: finds what projected Gauss-Seidel finds") {
  auto liquid = loose_ball<Kernel>(0.005, 4, 0.2, 0.1);
  const auto step = liquid.view();
  PressureSystem<double> plain, corrected;
  plain.assemble(step);
  corrected.correct(plain, step);
  std::vector<double> offset(static_cast<std::size_t>(step.fluid.size()));
  for (std::size_t i = 0; i < offset.size(); ++i) {  // some want to be pushed apart, some have room
    offset[i] = 30 * std::sin(2.3 * static_cast<double>(i)) + 5;
  }
  const Eigen::Map<const Eigen::VectorXd> wanted(offset.data(), step.fluid.size());
  for (auto* system : {&plain, &corrected}) {
    const Eigen::MatrixXd matrix = matrix_of(step, *system);
    const Eigen::VectorXd expected = reference(matrix, wanted);
    const auto zeros = (expected.array() == 0).count();
    REQUIRE(zeros > 20);  // contacts are there to be found
    REQUIRE(zeros < expected.size() - 20);
    ComplementaritySolver<double> solver;
    solver.mean_tolerance = solver.largest_tolerance = 1e-10;
    solver.most_iterations = 2000;
    for (const double start : {0.0, 1e-3}) {
      std::vector<double> term(offset.size(), start);
      solver.begin_step();
      const auto report = solver.solve(step, *system, offset, term);
      CHECK(report.converged);
      const Eigen::Map<const Eigen::VectorXd> found(term.data(), step.fluid.size());
      CHECK(found.minCoeff() >= 0);
      // the matrix is nearly singular, so effects are compared, not pressures
      CHECK((matrix * (found - expected)).cwiseAbs().maxCoeff() < 1e-5);
      // what the system holds is the answer's
      const double rate = system->density_rate(step.neighbors, system->accelerations(), 7, false);
      CHECK(-step.time_step * step.time_step * rate == Approx(matrix.row(7).dot(found)).margin(1e-8));
    }
  }
}

TEST_CASE("ComplementaritySolver: says so when it is not given enough iterations, and what it returns is usable") {
  auto liquid = loose_ball<Kernel>(0.005, 4, 0.2, 0.1);
  const auto step = liquid.view();
  PressureSystem<double> system;
  system.assemble(step);
  std::vector<double> offset(static_cast<std::size_t>(step.fluid.size()), 50.0), term(offset.size(), 0.0);
  ComplementaritySolver<double> solver;
  solver.mean_tolerance = solver.largest_tolerance = 1e-10;
  double last = 1;
  for (const int iterations : {1, 4, 12, 40}) {
    solver.most_iterations = iterations;
    std::fill(term.begin(), term.end(), 0.0);
    const auto report = solver.solve(step, system, offset, term);
    CHECK_FALSE(report.converged);
    CHECK(report.iterations <= iterations + 1);
    CHECK(report.error <= last);
    last = report.error;
    CHECK(*std::min_element(term.begin(), term.end()) >= 0);
  }
  CHECK(last < 1e-3);
}

TEST_CASE("ComplementaritySolver: a particle that feels nothing holds nobody up") {
  // one far from the others, with the pressure that it had among them
  auto liquid = loose_ball<Kernel>(0.005, 4, 0.2, 0.1);
  const Index alone = 17;
  PointArray<double> places = liquid.fluid.position;
  places(0, alone) += 1;
  liquid.place(places);
  const auto step = liquid.view();
  PressureSystem<double> system;
  system.assemble(step);
  REQUIRE(system.diagonal()[alone] == 0);
  const auto count = static_cast<std::size_t>(step.fluid.size());
  for (const double room : {-680.0, 50.0}) {  // it may come nearer, or be too dense: no pressure changes that
    std::vector<double> offset(count, 3.0), term(count, 1e-3);
    offset[alone] = room;
    ComplementaritySolver<double> solver;
    solver.begin_step();
    const auto report = solver.solve(step, system, offset, term);
    INFO("room " << room << ", " << report.iterations << " iterations");
    CHECK(report.converged);
    CHECK(report.iterations < 60);
    CHECK(term[alone] == 0);
  }
}
