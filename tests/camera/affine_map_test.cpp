// SPDX-License-Identifier: MIT
#include <decant/camera/affine_map.hpp>

#include <limits>
#include <random>
#include <string>

#include "camera/affine_coefficients.hpp"
#include "catch.hpp"

namespace {

using decant::AffineMap;

using decant_test::coefficients;

}  // namespace

TEST_CASE("Affine map: coefficients mean x' = a x + b y + c") {
  const AffineMap map(coefficients(2, 3, 5, 7, 11, 13));
  CHECK(map.apply(Eigen::Vector2d(1, 10)) == Eigen::Vector2d(37, 130));
  CHECK(map.offset() == Eigen::Vector2d(5, 13));
  CHECK(map.linear()(0, 1) == 3);
  Eigen::Matrix2Xd pixels(2, 2);
  pixels << 0, 1, 0, 10;
  CHECK(map.apply_all(pixels).col(0) == Eigen::Vector2d(5, 13));
  CHECK(map.apply_all(pixels).col(1) == Eigen::Vector2d(37, 130));
  CHECK(AffineMap().apply(Eigen::Vector2d(4, -9)) == Eigen::Vector2d(4, -9));
  const Eigen::Vector2d pixel(1, 2);
  CHECK(noexcept(map.apply(pixel)));
  CHECK(noexcept(map.inverse()));
}

TEST_CASE("Affine map: inverse and composition") {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> slope(-2, 2);
  std::uniform_real_distribution<double> pixel(-500, 500);
  for (int trial = 0; trial < 100; ++trial) {
    const AffineMap b_from_a(
        coefficients(3 + slope(random), slope(random), pixel(random), slope(random), 4 + slope(random), pixel(random)));
    const AffineMap c_from_b(
        coefficients(slope(random), 4 + slope(random), pixel(random), 4 + slope(random), slope(random), pixel(random)));
    const Eigen::Vector2d x(pixel(random), pixel(random));
    // determinants of 1e-1 and more, coordinates up to 1e4
    CHECK((b_from_a.inverse().apply(b_from_a.apply(x)) - x).norm() < 1e-8);
    CHECK((b_from_a.apply(b_from_a.inverse().apply(x)) - x).norm() < 1e-8);
    CHECK(((c_from_b * b_from_a).apply(x) - c_from_b.apply(b_from_a.apply(x))).norm() < 1e-9);
  }
}

TEST_CASE("Affine map: what has no inverse is refused") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::string size = "AffineMap: largest coefficient must be finite and at most 1e9, got ";
  const std::string flat = "AffineMap: |det A| / |A|^2 must be > 1e-9, so that the map has an inverse, got ";
  using Catch::Matchers::StartsWith;
  CHECK_THROWS_WITH(AffineMap(coefficients(nan, 0, 0, 0, 1, 0)), StartsWith(size));
  CHECK_THROWS_WITH(AffineMap(coefficients(1, 0, std::numeric_limits<double>::infinity(), 0, 1, 0)), StartsWith(size));
  CHECK_THROWS_WITH(AffineMap(coefficients(1, 0, 0, 0, 1, -2e9)), StartsWith(size));
  CHECK_THROWS_WITH(AffineMap(coefficients(1, 2, 0, 2, 4, 0)), StartsWith(flat));
  CHECK_THROWS_WITH(AffineMap(coefficients(0, 0, 0, 0, 0, 0)), StartsWith(flat));
  CHECK_THROWS_WITH(AffineMap(coefficients(1e-200, 0, 0, 0, 1e-200, 0)), StartsWith(flat));
  CHECK_THROWS_AS(AffineMap(coefficients(1, 0, 0, 0, 1e-10, 0)), std::invalid_argument);
  const AffineMap thin(coefficients(1, 1, 3, 0, 1e-8, 4));
  CHECK_NOTHROW(AffineMap(thin.inverse().matrix()));
  CHECK_NOTHROW(AffineMap(coefficients(0, 1, 0, -1, 0, 0)));
}
