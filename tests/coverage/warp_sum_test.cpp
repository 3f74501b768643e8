// SPDX-License-Identifier: MIT
#include <decant/coverage/warp_sum.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "catch.hpp"
#include "masks.hpp"
#include "thread_check.hpp"

namespace {

using namespace decant;

// The longest vector on a lattice of 8 pixels: a few percent below the true maximum, so that errors relative to it come
// out too large if anything.
double longest(const Mask& mask, const Image<float>& coverage) {
  double result = 0;
  for (Index v = 0; v < mask.rows(); v += 8) {
    for (Index u = 0; u < mask.cols(); u += 8) {
      result = std::max(result, warp_sum(mask, coverage, Eigen::Vector2d(u, v)).norm());
    }
  }
  return result;
}

}  // namespace

TEST_CASE("The warp sum is the one that the paper prints") {
  Mask mask = Mask::Zero(300, 300);
  Image<float> coverage = Image<float>::Zero(300, 300);
  CHECK(warp_sum(mask, coverage, {150, 150}) == Eigen::Vector2d(0, 0));
  mask(160, 130) = 255;
  // toward the pixel, by the vector's length times the weight
  const Eigen::Vector2d pull = warp_sum(mask, coverage, {150, 150});
  CHECK(pull.x() == Approx(-20 * std::exp(-500.0 / 1089)));
  CHECK(pull.y() == Approx(10 * std::exp(-500.0 / 1089)));
  CHECK(warp_sum(mask, coverage, {130, 160}).norm() == 0);
  coverage(160, 130) = 3;
  CHECK((warp_sum(mask, coverage, {150, 150}) - pull / 4).norm() < 1e-12);
  CHECK(warp_sum(mask, coverage, {230, 160}).x() == Approx(-25 * std::exp(-1e4 / 1089)));
  CHECK(warp_sum(mask, coverage, {230.001, 160}).norm() == 0);
  for (const double far : {1e300, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
    CHECK(warp_sum(mask, coverage, {far, 150}).norm() == 0);
  }
  // a pixel to the left and one to the right cancel
  coverage.setZero();
  mask(160, 170) = 255;
  CHECK(std::abs(warp_sum(mask, coverage, {150, 150}).x()) < 1e-12);
  CHECK(warp_sum(mask, coverage, {150, 150}).y() == Approx(20 * std::exp(-500.0 / 1089)));
}

TEST_CASE("The warp field is as near to the reference as promised") {
  for (const auto& [name, mask, about_the_cut] : decant_test::masks()) {
    for (const bool covered : {false, true}) {
      const Image<float> coverage = covered ? decant_test::some_coverage(mask.rows(), mask.cols(), 8)
                                            : Image<float>::Zero(mask.rows(), mask.cols());
      WarpSumField field(static_cast<int>(mask.cols()), static_cast<int>(mask.rows()));
      field.rebuild(mask, coverage);
      const double scale = longest(mask, coverage);
      std::mt19937 generator(6);
      std::uniform_real_distribution<double> u(-115, 375), v(-115, 355), near(-1, 1);
      double error = 0;
      for (int probe = 0; probe < 600; ++probe) {
        const Eigen::Vector2d p = about_the_cut && probe % 2 == 0
                                      ? Eigen::Vector2d(130 + near(generator), 120 + near(generator))
                                      : Eigen::Vector2d(u(generator), v(generator));
        error = std::max(error, (field.value(p) - warp_sum(mask, coverage, p)).norm());
      }
      INFO(name << (covered ? ", covered" : "") << ": " << error / scale);
      // what the docstring promises
      CHECK(error <= (about_the_cut ? 1.8e-3 : 5e-4) * scale);
    }
  }
}

TEST_CASE("The warp field is right for other kernels and sizes, and zero without liquid") {
  const ImageKernel kernel{12, 36};
  std::mt19937 generator(3);
  Mask mask(31, 47);
  for (Index k = 0; k < mask.size(); ++k) {
    mask.data()[k] = generator() % 5 == 0 ? 255 : 0;
  }
  const Image<float> coverage = decant_test::some_coverage(31, 47, 2);
  WarpSumField field(47, 31, kernel);
  CHECK(field.value({20, 20}).norm() == 0);
  field.rebuild(mask, coverage);
  double scale = 0, error = 0;
  std::uniform_real_distribution<double> u(-40, 90), v(-40, 75);
  for (int probe = 0; probe < 1000; ++probe) {
    const Eigen::Vector2d p(u(generator), v(generator));
    const Eigen::Vector2d expected = warp_sum(mask, coverage, p, kernel);
    scale = std::max(scale, expected.norm());
    error = std::max(error, (field.value(p) - expected).norm());
  }
  INFO(error / scale);
  CHECK(error < 1e-3 * scale);
  CHECK(field.value({47 + 60, 15}).norm() == 0);
  CHECK(field.value({std::numeric_limits<double>::quiet_NaN(), 15}).norm() == 0);
  field.rebuild(Mask::Zero(31, 47), coverage);
  for (double y = -50; y < 90; y += 1.7) {
    for (double x = -50; x < 100; x += 1.3) {
      CHECK(field.value({x, y}).norm() == 0);
    }
  }
}

TEST_CASE("In the middle of liquid without an end in sight nothing pulls") {
  WarpSumField field(260, 260);
  field.rebuild(Mask::Constant(260, 260, 255), Image<float>::Zero(260, 260));
  // the sums are of up to 3,400 terms of length 14, in float
  CHECK(field.value({129.5, 129.5}).norm() < 0.02);
  CHECK(field.value({131.25, 128.75}).norm() < 0.02);
  // at the border it pulls inward
  CHECK(field.value({0, 130}).x() > 1000);
  CHECK(field.value({259, 130}).x() < -1000);
  CHECK(std::abs(field.value({0, 129.5}).y()) < 0.02);
}

TEST_CASE("Any number of threads gives the same warp field") { decant_test::check_threads_agree<WarpSumField>(); }

TEST_CASE("Warp fields that cannot be are refused") {
  CHECK_THROWS_WITH(WarpSumField(0, 10), "WarpSumField: width [px] must be 1 to 32768, got 0");
  CHECK_THROWS_WITH(WarpSumField(10, 10, {33, 50}), decant_test::contains("WarpSumField: kernel.cut_px [px] must be"));
}
