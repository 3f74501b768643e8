// SPDX-License-Identifier: MIT
#include <decant/pressure/coarse_cells.hpp>

#include <cmath>
#include <map>
#include <tuple>
#include <vector>

#include <decant/kernel/cubic_spline.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"
#include "pressure/matrix_of.hpp"

using decant::CoarseCells;
using decant::Index;
using decant::PressureSystem;
using namespace decant::testing;
using Kernel = decant::CubicSpline<double>;

namespace {

/// Z, one column per cell: cells of a lattice with `width`, one of whose corners is the origin.
Eigen::MatrixXd indicator(const decant::FluidState<double>& fluid, double width, const std::vector<double>& contact) {
  std::map<std::tuple<int, int, int>, Index> number;
  std::vector<Index> cell;
  for (Index i = 0; i < fluid.size(); ++i) {
    const Eigen::Vector3i at = (fluid.position.col(i) / width).array().floor().cast<int>();
    cell.push_back(number.try_emplace({at.x(), at.y(), at.z()}, static_cast<Index>(number.size())).first->second);
  }
  Eigen::MatrixXd z = Eigen::MatrixXd::Zero(fluid.size(), static_cast<Index>(number.size()));
  for (Index i = 0; i < fluid.size(); ++i) {
    z(i, cell[static_cast<std::size_t>(i)]) = contact[static_cast<std::size_t>(i)];
  }
  return z;
}

}  // namespace

TEST_CASE("CoarseCells finds the best pressure that is constant within cells") {
  const double spacing = 0.005;
  auto liquid = loose_ball<Kernel>(spacing, 7, 0.2, 0.1);
  const auto step = liquid.view();
  PressureSystem<double> plain, corrected;
  plain.assemble(step);
  corrected.correct(plain, step);
  std::vector<double> contact, residual;
  for (Index i = 0; i < step.fluid.size(); ++i) {
    contact.push_back(i % 7 == 3 ? 0 : 1);
    residual.push_back(std::sin(0.37 * static_cast<double>(i)) + 0.2);
  }
  const Eigen::Map<const Eigen::VectorXd> r(residual.data(), step.fluid.size());
  const Eigen::MatrixXd z = indicator(step.fluid, 2.0001 * 2 * spacing, contact);
  CoarseCells<double> cells;
  cells.sort(step);
  REQUIRE(cells.cells() == static_cast<std::size_t>(z.cols()));
  REQUIRE(cells.cells() > 20);
  for (auto* system : {&plain, &corrected}) {
    const Eigen::VectorXd sums = z.transpose() * r;
    CHECK(cells.restrict(residual, contact, {1}) == Approx(sums.cwiseAbs().sum()));
    cells.assemble(step, *system, contact);
    cells.solve(step.time_step);
    const Eigen::VectorXd expected = z * (z.transpose() * decant_test::matrix_of(step, *system) * z).ldlt().solve(sums);
    double off = 0;
    for (Index i = 0; i < step.fluid.size(); ++i) {
      const auto own = static_cast<std::size_t>(i);
      off = std::max(off, std::abs(contact[own] * cells.correction(own) - expected[i]));
    }
    CHECK(off < 1e-8 * expected.cwiseAbs().maxCoeff());
  }
}

TEST_CASE("CoarseCells: cells stand still, so that a matrix serves later sub-steps; what is in new cells waits") {
  const double spacing = 0.005;
  auto liquid = loose_ball<Kernel>(spacing, 7, 0.2, 0.1);
  PressureSystem<double> system;
  system.assemble(liquid.view());
  std::vector<double> contact(static_cast<std::size_t>(liquid.fluid.size()), 1.0), residual;
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    residual.push_back(std::sin(0.37 * static_cast<double>(i)) + 0.2);
  }
  const Eigen::MatrixXd z = indicator(liquid.fluid, 2.0001 * 2 * spacing, contact);
  const Eigen::MatrixXd matrix = z.transpose() * decant_test::matrix_of(liquid.view(), system) * z;
  CoarseCells<double> cells;
  cells.sort(liquid.view());
  CHECK_FALSE(cells.assembled());
  cells.assemble(liquid.view(), system, contact);

  const Index gone = 5;
  liquid.fluid.position(2, gone) += 1;
  const auto step = liquid.view();
  cells.sort(step);
  REQUIRE(cells.assembled());
  REQUIRE(cells.cells() == static_cast<std::size_t>(z.cols()) + 1);
  cells.restrict(residual, contact, {1});
  const double shorter = 0.5 * step.time_step;
  cells.solve(shorter);
  residual[gone] = 0;  // to the cell that it has left
  const Eigen::Map<const Eigen::VectorXd> r(residual.data(), step.fluid.size());
  const Eigen::VectorXd expected = 4 * (z * matrix.ldlt().solve(z.transpose() * r));
  CHECK(cells.correction(gone) == 0);
  for (Index i = 0; i < step.fluid.size(); ++i) {
    if (i != gone) {
      REQUIRE(cells.correction(static_cast<std::size_t>(i)) ==
              Approx(expected[i]).margin(1e-8 * expected.cwiseAbs().maxCoeff()));
    }
  }

  liquid.smoothing_length *= 1.5;  // other cells: nothing of the matrix is of use
  cells.sort(liquid.view());
  CHECK_FALSE(cells.assembled());
}

TEST_CASE("CoarseCells: cells without contact, far-away drops and coordinates that are not numbers") {
  auto liquid = loose_ball<Kernel>(0.005, 4, 0.2, 0.1);
  liquid.fluid.position.col(0) = decant::Vector3<double>(1e9, -1e9, 3e7);
  const auto step = liquid.view();
  PressureSystem<double> system;
  system.assemble(step);
  CoarseCells<double> cells;
  const std::vector<double> none(static_cast<std::size_t>(step.fluid.size()), 0.0);
  cells.sort(step);
  CHECK(cells.restrict(none, none, {1}) == 0);
  cells.assemble(step, system, none);
  cells.solve(step.time_step);
  CHECK(cells.correction(0) == 0);
  liquid.fluid.position.col(1).setConstant(std::nan(""));
  cells.sort(liquid.view());
  CHECK(cells.cells() >= 1);
}
