// SPDX-License-Identifier: MIT
#include <decant/coverage/activation.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include "catch.hpp"
#include "masks.hpp"
#include "thread_check.hpp"

namespace {

using namespace decant;

// The largest value on a lattice of 12 pixels: up to 6 % (8.5 px off the top of a Gaussian of 33 px) below the true
// maximum, so that errors relative to it come out too large if anything.
double largest(const Mask& mask, const Image<float>& coverage) {
  double result = 0;
  for (Index v = 0; v < mask.rows(); v += 12) {
    for (Index u = 0; u < mask.cols(); u += 12) {
      result = std::max(result, activation(mask, coverage, Eigen::Vector2d(u, v)));
    }
  }
  return result;
}

}  // namespace

TEST_CASE("Activation is the sum that the paper prints") {
  Mask mask = Mask::Zero(300, 300);
  Image<float> coverage = Image<float>::Zero(300, 300);
  CHECK(activation(mask, coverage, {150, 150}) == 0);
  mask(150, 150) = 255;
  CHECK(activation(mask, coverage, {150, 150}) == 1);
  CHECK(activation(mask, coverage, {150 + 33, 150}) == Approx(std::exp(-1)));
  CHECK(activation(mask, coverage, {150.6, 149.2}) == Approx(std::exp(-(0.36 + 0.64) / (33 * 33))));
  // the cut is a circle and belongs to the inside
  CHECK(activation(mask, coverage, {250, 150}) == Approx(std::exp(-1e4 / 1089)));
  CHECK(activation(mask, coverage, {210, 70}) == Approx(std::exp(-1e4 / 1089)));
  CHECK(activation(mask, coverage, {250.001, 150}) == 0);
  CHECK(activation(mask, coverage, {221, 221}) == 0);
  CHECK(activation(mask, coverage, {250, 150}, ImageKernel{33, 99.9}) == 0);
  CHECK(activation(mask, coverage, {150, 160}, ImageKernel{10, 99.9}) == Approx(std::exp(-1)));
  coverage(150, 150) = 3;
  CHECK(activation(mask, coverage, {150, 150}) == 0.25);
  // what is not liquid does not count, however often it is covered
  coverage(150, 151) = 1;
  mask(150, 151) = 127;
  CHECK(activation(mask, coverage, {150, 150}) == 0.25);
  mask(150, 151) = 128;
  CHECK(activation(mask, coverage, {150, 150}) == Approx(0.25 + 0.5 * std::exp(-1.0 / 1089)));
  for (const double far :
       {1e9, -1e300, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
    CHECK(activation(mask, coverage, {far, 150}) == 0);
    CHECK(activation(mask, coverage, {150, far}) == 0);
  }
}

TEST_CASE("The field is within 1e-3 of the reference, relative to its maximum") {
  for (const auto& [name, mask, about_the_cut] : decant_test::masks()) {
    for (const bool covered : {false, true}) {
      const Image<float> coverage = covered ? decant_test::some_coverage(mask.rows(), mask.cols(), 8)
                                            : Image<float>::Zero(mask.rows(), mask.cols());
      ActivationField field(static_cast<int>(mask.cols()), static_cast<int>(mask.rows()));
      field.rebuild(mask, coverage);
      const double scale = largest(mask, coverage);
      std::mt19937 generator(6);
      // in the image, between its pixels, and beyond its border up to where nothing is left
      std::uniform_real_distribution<double> u(-115, 375), v(-115, 355), near(-1, 1);
      double error = 0;
      for (int probe = 0; probe < 600; ++probe) {
        const Eigen::Vector2d p = about_the_cut && probe % 2 == 0
                                      ? Eigen::Vector2d(130 + near(generator), 120 + near(generator))
                                      : Eigen::Vector2d(u(generator), v(generator));
        error = std::max(error, std::abs(field.value(p) - activation(mask, coverage, p)));
      }
      INFO(name << (covered ? ", covered" : "") << ": " << error / scale);
      // what the docstring promises
      CHECK(error <= (about_the_cut ? 6e-4 : 1e-4) * scale);
    }
  }
}

TEST_CASE("The field is exact for kernels of other lengths and images of other sizes") {
  unsigned seed = 1;
  for (const auto& [length, cut] : {std::pair{4.0, 12.0}, {9.0, 25.5}, {16.5, 50.0}, {70.0, 210.0}, {33.0, 1000.0}}) {
    for (const auto& [rows, columns] : {std::pair<Index, Index>{1, 1}, {1, 50}, {50, 1}, {37, 91}, {64, 64}}) {
      std::mt19937 generator(seed++);
      Mask mask(rows, columns);
      for (Index k = 0; k < mask.size(); ++k) {
        mask.data()[k] = generator() % 3 == 0 || k == 0 ? 130 : 100;  // not only 0 and 255
      }
      const Image<float> coverage = decant_test::some_coverage(rows, columns, seed++);
      const ImageKernel kernel{length, cut};
      ActivationField field(static_cast<int>(columns), static_cast<int>(rows), kernel);
      field.rebuild(mask, coverage);
      double scale = 0, error = 0;
      std::uniform_real_distribution<double> u(-10.0, static_cast<double>(columns) + 9),
          v(-10.0, static_cast<double>(rows) + 9);
      for (int probe = 0; probe < 300; ++probe) {
        const Eigen::Vector2d p(u(generator), v(generator));
        const double expected = activation(mask, coverage, p, kernel);
        scale = std::max(scale, expected);
        error = std::max(error, std::abs(field.value(p) - expected));
      }
      INFO("length " << length << ", " << rows << " x " << columns << ": " << error / scale);
      CHECK(error <= 1e-3 * scale);
    }
  }
}

TEST_CASE("Without liquid the field is exactly zero, also after a mask with liquid") {
  ActivationField field(120, 90);
  const Image<float> coverage = Image<float>::Zero(90, 120);
  const auto all_zero = [&] {
    for (double v = -150; v < 250; v += 3.7) {
      for (double u = -150; u < 300; u += 3.3) {
        if (field.value({u, v}) != 0) {
          return false;
        }
      }
    }
    return true;
  };
  CHECK(all_zero());  // never rebuilt
  field.rebuild(Mask::Constant(90, 120, 255), coverage);
  CHECK(!all_zero());
  field.rebuild(Mask::Zero(90, 120), coverage);
  CHECK(all_zero());
}

TEST_CASE("The field remembers nothing of masks before") {
  Mask mask = Mask::Zero(90, 120), other = mask;
  mask(80, 100) = 255;
  other.topLeftCorner(40, 50).setConstant(255);
  const Image<float> coverage = Image<float>::Zero(90, 120);
  ActivationField used(120, 90), fresh(120, 90);
  for (const Mask& before : {other, Mask(Mask::Constant(90, 120, 255)), other}) {
    used.rebuild(before, coverage);
    used.rebuild(mask, coverage);
    fresh.rebuild(mask, coverage);
    for (double v = -150; v < 250; v += 7.7) {
      for (double u = -150; u < 300; u += 7.3) {
        CHECK(used.value({u, v}) == fresh.value({u, v}));
      }
    }
  }
}

TEST_CASE("The field is continuous, never negative, and zero far away") {
  ActivationField field(120, 90);
  Mask mask = Mask::Zero(90, 120);
  mask(20, 30) = mask(21, 30) = mask(89, 119) = 255;
  field.rebuild(mask, Image<float>::Zero(90, 120));
  double before = 0, steepest = 0, least = 0;
  for (double u = -130; u < 260; u += 0.01) {
    const double here = field.value({u, 20.4});
    steepest = std::max(steepest, std::abs(here - before));
    least = std::min(least, here);
    before = here;
  }
  // two pixels side by side: at most 2 sqrt(2 / e) / 33 per px, over 0.01 px
  CHECK(steepest < 1.01 * 0.01 * 2 * std::sqrt(2 / std::exp(1.0)) / 33);
  CHECK(least == 0);
  for (const double far : {-500.0, 500.0, 1e9, -1e300, std::numeric_limits<double>::infinity(),
                           std::numeric_limits<double>::quiet_NaN()}) {
    CHECK(field.value({far, 20}) == 0);
    CHECK(field.value({30, far}) == 0);
  }
}

TEST_CASE("Any number of threads gives the same field") { decant_test::check_threads_agree<ActivationField>(); }

TEST_CASE("Coverage that is no count does no harm") {
  Mask mask = Mask::Zero(50, 50);
  mask(10, 10) = mask(10, 20) = mask(10, 30) = 255;
  Image<float> coverage = Image<float>::Zero(50, 50);
  coverage(10, 10) = std::numeric_limits<float>::quiet_NaN();
  coverage(10, 20) = -1;
  coverage(10, 30) = std::numeric_limits<float>::infinity();
  coverage(40, 40) = std::numeric_limits<float>::quiet_NaN();  // no liquid there
  ActivationField field(50, 50);
  field.rebuild(mask, coverage);
  CHECK(field.value({15, 10}) == Approx(2 * std::exp(-25.0 / 1089)).epsilon(1e-4));
  CHECK(activation(mask, coverage, {15, 10}) == Approx(2 * std::exp(-25.0 / 1089)));
}

TEST_CASE("Parts of larger images are taken as they lie") {
  const auto noise = decant_test::masks()[14].mask;
  const Image<float> coverage = decant_test::some_coverage(noise.rows(), noise.cols(), 3);
  const Mask mask = noise.block(20, 30, 50, 60);
  const Image<float> cover = coverage.block(20, 30, 50, 60);
  ActivationField field(60, 50), packed(60, 50);
  field.rebuild(noise.block(20, 30, 50, 60), coverage.block(20, 30, 50, 60));
  packed.rebuild(mask, cover);
  CHECK(field.value({12.3, 45.6}) == packed.value({12.3, 45.6}));
  CHECK(activation(noise.block(20, 30, 50, 60), coverage.block(20, 30, 50, 60), {12.3, 45.6}) ==
        activation(mask, cover, {12.3, 45.6}));
}

TEST_CASE("Fields that cannot be are refused") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  using decant_test::contains;
  CHECK_THROWS_WITH(ActivationField(0, 10), "ActivationField: width [px] must be 1 to 32768, got 0");
  CHECK_THROWS_WITH(ActivationField(10, -3), "ActivationField: height [px] must be 1 to 32768, got -3");
  CHECK_THROWS_WITH(ActivationField(10, 10, {nan, 100}), contains("kernel.length_px [px] must be 4 to 10000, got"));
  CHECK_THROWS_WITH(ActivationField(10, 10, {3, 100}), contains("kernel.length_px [px] must be 4 to 10000, got 3"));
  CHECK_THROWS_WITH(ActivationField(10, 10, {33, 50}), contains("kernel.cut_px [px] must be at least 2.6 times"));
  CHECK_THROWS_WITH(ActivationField(10, 10, {33, nan}), contains("kernel.cut_px [px] must be at least 2.6 times"));
}
