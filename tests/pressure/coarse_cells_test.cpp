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

/// Z, one column per cell: cells of a lattice with `width` that begins at the lowest coordinates.
Eigen::MatrixXd indicator(const decant::FluidState<double>& fluid, double width, const std::vector<double>& contact) {
  const Eigen::Vector3d low = fluid.position.rowwise().minCoeff();
  std::map<std::tuple<int, int, int>, Index> number;
  std::vector<Index> cell;
  for (Index i = 0; i < fluid.size(); ++i) {
    const Eigen::Vector3i at = ((fluid.position.col(i) - low) / width).array().floor().cast<int>();
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
    cells.solve();
    const Eigen::VectorXd expected = z * (z.transpose() * decant_test::matrix_of(step, *system) * z).ldlt().solve(sums);
    double off = 0;
    for (Index i = 0; i < step.fluid.size(); ++i) {
      const auto own = static_cast<std::size_t>(i);
      off = std::max(off, std::abs(contact[own] * cells.correction(own) - expected[i]));
    }
    CHECK(off < 1e-8 * expected.cwiseAbs().maxCoeff());
  }
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
  cells.solve();
  CHECK(cells.correction(0) == 0);
  liquid.fluid.position.col(1).setConstant(std::nan(""));
  cells.sort(liquid.view());
  CHECK(cells.cells() >= 1);
}
