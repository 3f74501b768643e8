// SPDX-License-Identifier: MIT
#include <decant/pressure/coarse_grid.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <type_traits>
#include <vector>

#include <Eigen/Eigenvalues>

#include <decant/core/domain.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/testing/force.hpp>

#include "catch.hpp"
#include "pressure/matrix_of.hpp"

using decant::CoarseGrid;
using decant::Index;
using decant::PressureSystem;
using namespace decant::testing;
using Kernel = decant::CubicSpline<double>;

namespace {

/// Z, a hat function per column, of the nodes of a grid with one node at the origin; and where the nodes are.
struct Hats {
  Eigen::MatrixXd z;
  Eigen::Matrix3Xd node;
};

Hats hats(const decant::FluidState<double>& fluid, double width, const std::vector<double>& contact) {
  std::map<std::tuple<int, int, int>, std::vector<std::pair<Index, double>>> nodes;
  for (Index i = 0; i < fluid.size(); ++i) {
    const Eigen::Vector3d place = fluid.position.col(i) / width;
    const Eigen::Vector3i near = place.array().floor().cast<int>();
    for (int k = 0; k < 8; ++k) {
      const Eigen::Vector3i at = near + Eigen::Vector3i(k & 1, k >> 1 & 1, k >> 2);
      const Eigen::Array3d hat = 1 - (place - at.cast<double>()).array().abs();
      nodes[{at[0], at[1], at[2]}].push_back({i, hat.prod() * contact[static_cast<std::size_t>(i)]});
    }
  }
  Hats result{Eigen::MatrixXd::Zero(fluid.size(), static_cast<Index>(nodes.size())),
              Eigen::Matrix3Xd(3, static_cast<Index>(nodes.size()))};
  Index n = 0;
  for (const auto& [at, entries] : nodes) {
    result.node.col(n) = width * Eigen::Vector3d(std::get<0>(at), std::get<1>(at), std::get<2>(at));
    for (const auto& [i, value] : entries) {
      result.z(i, n) = value;
    }
    ++n;
  }
  return result;
}

}  // namespace

TEST_CASE("CoarseGrid inverts what pressure between its nodes does") {
  const double spacing = 0.005;
  auto liquid = loose_ball<Kernel>(spacing, 9, 0.2, 0.1);
  const auto step = liquid.view();
  PressureSystem<double> plain, corrected;
  plain.assemble(step);
  corrected.correct(plain, step);
  const auto count = static_cast<std::size_t>(step.fluid.size());
  std::vector<double> contact;
  for (std::size_t i = 0; i < count; ++i) {
    contact.push_back(i % 7 == 3 ? 0 : 1);
  }
  const Hats hat = hats(step.fluid, 4 * 2 * spacing, contact);
  CoarseGrid<double> grid;
  grid.sort(step);
  REQUIRE(grid.nodes() == static_cast<std::size_t>(hat.z.cols()));
  REQUIRE(grid.nodes() > 20);
  const Eigen::MatrixXd overlap =
      (hat.z.transpose() * hat.z).ldlt().solve(Eigen::MatrixXd::Identity(hat.z.cols(), hat.z.cols()));
  for (auto* system : {&plain, &corrected}) {
    const Eigen::MatrixXd matrix = decant_test::matrix_of(step, *system);
    grid.assemble(step, *system, contact);
    // its inverse, column by column
    Eigen::MatrixXd inverse(hat.z.cols(), hat.z.cols());
    for (Index n = 0; n < hat.z.cols(); ++n) {
      const Eigen::VectorXd r = hat.z * overlap.col(n);  // so that Z^T r is 1 at one node
      const std::vector<double> residual(r.data(), r.data() + r.size());
      CHECK(grid.restrict(residual, contact, {1}) == Approx(1));
      std::vector<double> found(count);
      grid.solve(step.time_step, {1}, found);
      Eigen::VectorXd z = Eigen::Map<const Eigen::VectorXd>(found.data(), step.fluid.size());
      z.array() *= Eigen::Map<const Eigen::ArrayXd>(contact.data(), step.fluid.size());
      inverse.col(n) = overlap * (hat.z.transpose() * z);
    }
    REQUIRE((inverse - inverse.transpose()).norm() < 1e-6 * inverse.norm());
    const Eigen::MatrixXd own = inverse.ldlt().solve(Eigen::MatrixXd::Identity(hat.z.cols(), hat.z.cols())),
                          exact = hat.z.transpose() * matrix * hat.z;
    // exact for pressure that is linear in space
    for (const Eigen::Vector4d& pressure : {Eigen::Vector4d(1, 0, 0, 0), Eigen::Vector4d(0.5, 30, -20, 70)}) {
      const Eigen::VectorXd at_nodes = (hat.node.transpose() * pressure.tail<3>()).array() + pressure[0];
      CHECK(at_nodes.dot(own * at_nodes) == Approx(at_nodes.dot(exact * at_nodes)).epsilon(1e-6));
    }
    // And for others it must not be taken for much softer than it is, or its corrections overshoot. (Where hardly any
    // liquid is, it is taken for stiffer, and nothing is corrected.)
    const Eigen::VectorXd ratios =
        Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd>(own, exact, Eigen::EigenvaluesOnly).eigenvalues();
    CHECK(ratios.minCoeff() > 0.3);
    CHECK(ratios[ratios.size() / 2] < 2);
  }
}

TEST_CASE("CoarseGrid: single precision is as good as double, wherever the liquid is") {
  const auto coarse_part = []<class Scalar>(std::type_identity<Scalar>, double away) {
    auto liquid = loose_ball<decant::CubicSpline<Scalar>>(Scalar(0.005), 7, 0.2, 0.1);
    liquid.fluid.position.array() += static_cast<Scalar>(away);
    const auto step = liquid.view();
    PressureSystem<Scalar> system;
    system.assemble(step);
    const auto count = static_cast<std::size_t>(step.fluid.size());
    const std::vector<Scalar> contact(count, Scalar(1));
    std::vector<Scalar> residual(count), found(count);
    for (std::size_t i = 0; i < count; ++i) {
      residual[i] = 3 + static_cast<Scalar>(i % 5);
    }
    CoarseGrid<Scalar> grid;
    grid.sort(step);
    grid.assemble(step, system, contact);
    grid.restrict(residual, contact, {1});
    grid.solve(step.time_step, {1}, found);
    return Eigen::VectorXd(
        Eigen::Map<const Eigen::VectorX<Scalar>>(found.data(), step.fluid.size()).template cast<double>());
  };
  for (const double away : {0.0, -1.0, 16.0}) {
    INFO(away);
    const Eigen::VectorXd exact = coarse_part(std::type_identity<double>{}, away),
                          found = coarse_part(std::type_identity<float>{}, away);
    REQUIRE(exact.norm() > 0);
    // nodes that hardly any liquid is at may be left out by one and not by the other
    CHECK((found - exact).norm() < 0.02 * exact.norm());
  }
}

TEST_CASE("CoarseGrid: where space repeats itself, liquid has the same answer in every image") {
  const double spacing = 0.005, cell = 4 * 2 * spacing;
  const auto coarse_part = [&](double away, std::size_t& nodes) {
    LooseLiquid<Kernel, decant::PeriodicDomain<double>> liquid;
    liquid.domain = decant::PeriodicDomain<double>({2 * cell, 0, 0});
    decant::PointArray<double> places(3, 16 * 6 * 6);
    for (Index i = 0; i < places.cols(); ++i) {
      places.col(i) =
          spacing * decant::Vector3<double>(static_cast<double>(i % 16) + 0.3 * std::sin(5.0 * static_cast<double>(i)),
                                            static_cast<double>(i / 16 % 6) + 0.4, static_cast<double>(i / 96) + 0.2);
      places(0, i) += away;
    }
    liquid.place(places);
    const auto step = liquid.view();
    PressureSystem<double> system;
    system.assemble(step);
    const auto count = static_cast<std::size_t>(step.fluid.size());
    const std::vector<double> contact(count, 1.0);
    std::vector<double> residual(count), found(count);
    for (std::size_t i = 0; i < count; ++i) {
      residual[i] = 1 + std::sin(static_cast<double>(i % 16));  // varies across the seam
    }
    CoarseGrid<double> grid;
    grid.sort(step);
    nodes = grid.nodes();
    grid.assemble(step, system, contact);
    grid.restrict(residual, contact, {1});
    grid.solve(step.time_step, {1}, found);
    return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(found.data(), step.fluid.size()));
  };
  std::size_t nodes = 0;
  const Eigen::VectorXd here = coarse_part(0, nodes);
  CHECK(nodes == 2 * 2 * 2);
  REQUIRE(here.norm() > 0);
  for (const double away : {cell, -cell, 4 * cell, 201 * cell}) {
    INFO(away);
    CHECK((coarse_part(away, nodes) - here).norm() < 1e-7 * here.norm());
    CHECK(nodes == 2 * 2 * 2);
  }
}

TEST_CASE("CoarseGrid says when contacts are no longer those of its matrix") {
  auto liquid = loose_ball<Kernel>(0.005, 9, 0.2, 0.1);
  const auto step = liquid.view();
  PressureSystem<double> system;
  system.assemble(step);
  const auto below = [&](double height) {
    std::vector<double> contact;
    for (Index i = 0; i < step.fluid.size(); ++i) {
      contact.push_back(step.fluid.position(2, i) < height ? 1 : 0);
    }
    return contact;
  };
  CoarseGrid<double> grid;
  grid.sort(step);
  grid.assemble(step, system, below(0.0));
  CHECK_FALSE(grid.outgrown(below(0.0), {1}));
  CHECK_FALSE(grid.outgrown(below(-0.01), {1}));
  CHECK_FALSE(grid.outgrown(below(0.001), {1}));
  // The nodes at z = 0.04 have felt next to nothing of the particles below 0.
  CHECK(grid.outgrown(below(0.03), {1}));
  grid.assemble(step, system, below(0.03));
  CHECK_FALSE(grid.outgrown(below(0.03), {1}));
}

TEST_CASE("CoarseGrid: nodes without contact, far-away drops and coordinates that are not numbers") {
  auto liquid = loose_ball<Kernel>(0.005, 4, 0.2, 0.1);
  liquid.fluid.position.col(0) = decant::Vector3<double>(1e9, -1e9, 3e7);
  const auto step = liquid.view();
  PressureSystem<double> system;
  system.assemble(step);
  CoarseGrid<double> grid;
  const std::vector<double> none(static_cast<std::size_t>(step.fluid.size()), 0.0);
  std::vector<double> found(none.size(), 1.0);
  grid.sort(step);
  CHECK(grid.restrict(none, none, {1}) == 0);
  grid.assemble(step, system, none);
  grid.solve(step.time_step, {1}, found);
  CHECK(std::all_of(found.begin(), found.end(), [](double z) { return z == 0; }));
  liquid.fluid.position.col(1).setConstant(std::nan(""));
  grid.sort(liquid.view());
  CHECK(grid.nodes() >= 8);
}

TEST_CASE("CoarseGrid: nodes stand farther apart where there would be too many") {
  // particles far from each other: each has a cell of its own until cells are large
  auto liquid = loose_ball<Kernel>(0.005, 5, 0.2, 0.1);
  liquid.fluid.position *= 300;
  CoarseGrid<double> grid;
  grid.sort(liquid.view());
  CHECK(grid.nodes() > 100);
  CHECK(grid.nodes() <= 1500);
  const std::vector<double> ones(static_cast<std::size_t>(liquid.fluid.size()), 1.0);
  CHECK(grid.restrict(ones, ones, {1}) == Approx(liquid.fluid.size()));  // hats add up to one
}
