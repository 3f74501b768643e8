// SPDX-License-Identifier: MIT

#include <decant/tracking/silhouette_cells.hpp>

#include "catch.hpp"

using namespace decant;

TEST_CASE("silhouette cells: shares of liquid, of cells that the border cuts as well") {
  Mask mask = Mask::Zero(25, 45);
  mask.block(0, 0, 20, 10).setConstant(mask_liquid);  // half of the first cell
  mask.block(20, 40, 5, 5).setConstant(mask_liquid);  // all of the last one
  mask(19, 20) = 127;                                 // none
  const auto shares = SilhouetteCells(20).shares(mask);
  REQUIRE(shares.rows() == 2);
  REQUIRE(shares.cols() == 3);
  Eigen::ArrayXXd expected = Eigen::ArrayXXd::Zero(2, 3);
  expected(0, 0) = 0.5;
  expected(1, 2) = 1;
  CHECK((shares - expected).abs().maxCoeff() < 1e-12);
  CHECK(SilhouetteCells(20).squared_difference(mask, Mask::Zero(25, 45)) == Approx(1.25));
  // what is off within a cell does not count
  Mask moved = Mask::Zero(25, 45);
  moved.block(0, 5, 20, 10).setConstant(mask_liquid);
  moved.block(20, 40, 5, 5).setConstant(mask_liquid);
  CHECK(SilhouetteCells(20).squared_difference(mask, moved) == Approx(0).margin(1e-12));
  CHECK(SilhouetteCells(5).squared_difference(mask, moved) == Approx(8));
  CHECK_THROWS_WITH(SilhouetteCells(0), decant_test::contains("cell_px must be >= 1"));
}
