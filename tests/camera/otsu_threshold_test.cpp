// SPDX-License-Identifier: MIT
#include <decant/camera/otsu_threshold.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "catch.hpp"

namespace {

using decant::Image;
using decant::otsu_threshold;
using decant::PixelHistogram;

// Otsu's other definition: the threshold with the least variance within the two classes, found by trying every one.
template <class Pixel>
double variance_within(const Image<Pixel>& image, double threshold) {
  double within = 0;
  for (const bool upper : {false, true}) {
    double n = 0, sum = 0;
    for (Eigen::Index i = 0; i < image.size(); ++i) {
      const double value = image.data()[i];
      if ((value >= threshold) == upper) {
        n += 1;
        sum += value;
      }
    }
    for (Eigen::Index i = 0; i < image.size(); ++i) {
      const double value = image.data()[i];
      if ((value >= threshold) == upper) {
        within += (value - sum / n) * (value - sum / n);
      }
    }
  }
  return within;
}

template <class Pixel>
Image<Pixel> two_gaussians(Eigen::Index rows, Eigen::Index columns, double share, double low, double high,
                           double low_width, double high_width, unsigned seed) {
  std::mt19937 random(seed);
  std::bernoulli_distribution is_high(share);
  std::normal_distribution<double> normal(0, 1);
  Image<Pixel> image(rows, columns);
  const double most = std::numeric_limits<Pixel>::max();
  for (Eigen::Index i = 0; i < image.size(); ++i) {
    const double value = is_high(random) ? high + high_width * normal(random) : low + low_width * normal(random);
    image.data()[i] = static_cast<Pixel>(std::clamp(std::round(value), 0.0, most));
  }
  return image;
}

}  // namespace

TEST_CASE("Otsu: two values are split half way") {
  Image<std::uint8_t> image(2, 3);
  image << 10, 10, 10, 10, 10, 20;
  const auto found = otsu_threshold(image);
  REQUIRE(found);
  CHECK(found->counts == 15);
  CHECK(found->separability == Approx(1));
  Image<std::uint16_t> wide(1, 2);
  wide << 0, 65535;
  CHECK(otsu_threshold(wide)->counts == 32767.5);
}

TEST_CASE("Otsu: worked out by hand") {
  // 1 1 2 | 6 7: means 4/3 and 13/2, between-class variance 3 * 2 / 25 * (31/6)^2 = 6.4067, whole 6.64.
  // Splits after 1: 2 * 3 / 25 * 16 = 3.84; after 6: 4 * 1 / 25 * (9/2)^2 = 3.24.
  Image<std::uint8_t> image(1, 5);
  image << 7, 1, 6, 1, 2;
  const auto found = otsu_threshold(image);
  REQUIRE(found);
  CHECK(found->counts == 4);
  CHECK(found->separability == Approx(6.0 / 25 * 31 * 31 / 36 / 6.64));
}

TEST_CASE("Otsu: nothing to split") {
  CHECK_FALSE(otsu_threshold(Image<std::uint8_t>()));
  CHECK_FALSE(otsu_threshold(Image<std::uint16_t>(0, 7)));
  for (const int value : {0, 1, 128, 255}) {
    CHECK_FALSE(otsu_threshold(Image<std::uint8_t>::Constant(5, 7, static_cast<std::uint8_t>(value)).eval()));
    CHECK_FALSE(otsu_threshold(Image<std::uint16_t>::Constant(1, 1, static_cast<std::uint16_t>(257 * value)).eval()));
  }
}

TEST_CASE("Otsu: separability of known distributions") {
  // evenly spread over n values: the best split is the middle, between n^2/16, whole (n^2 - 1)/12
  Image<std::uint8_t> even(1, 256);
  for (int i = 0; i < 256; ++i) {
    even(0, i) = static_cast<std::uint8_t>(i);
  }
  CHECK(otsu_threshold(even)->counts == 127.5);
  CHECK(otsu_threshold(even)->separability == Approx(256.0 * 256 / 16 / ((256.0 * 256 - 1) / 12)));
  // one Gaussian: split at its mean, the means of the halves lie 2 sqrt(2/pi) deviations apart: 2/pi
  const auto one = otsu_threshold(two_gaussians<std::uint16_t>(400, 500, 0, 30000, 0, 1000, 0, 4));
  CHECK(one->separability == Approx(2 / std::numbers::pi).margin(0.005));  // 2e5 pixels: 1 / sqrt(2e5)
}

TEST_CASE("Otsu: the best of all thresholds") {
  unsigned seed = 0;
  for (const double share : {0.02, 0.1, 0.5}) {
    for (const double apart : {8.0, 40.0, 120.0}) {
      const auto image = two_gaussians<std::uint8_t>(40, 50, share, 60, 60 + apart, 6, 9, ++seed);
      const auto found = otsu_threshold(image);
      REQUIRE(found);
      double least = std::numeric_limits<double>::infinity();
      for (int t = image.minCoeff() + 1; t <= image.maxCoeff(); ++t) {
        least = std::min(least, variance_within<std::uint8_t>(image, t));
      }
      INFO("share " << share << ", apart " << apart << ", found " << found->counts);
      CHECK(variance_within<std::uint8_t>(image, found->counts) == Approx(least).epsilon(1e-12));
      const double whole = variance_within<std::uint8_t>(image, -1);
      CHECK(found->separability == Approx(1 - least / whole).epsilon(1e-9));
      CHECK((image.cast<double>() != found->counts).all());
    }
  }
}

TEST_CASE("Otsu: 16 bits, warm liquid on a cool ground") {
  const auto image = two_gaussians<std::uint16_t>(30, 40, 0.1, 29500, 33000, 150, 400, 9);
  const auto found = otsu_threshold(image);
  REQUIRE(found);
  std::vector<double> values(image.data(), image.data() + image.size());
  double least = std::numeric_limits<double>::infinity();
  for (const double value : values) {
    if (value > image.minCoeff()) {
      least = std::min(least, variance_within<std::uint16_t>(image, value));
    }
  }
  CHECK(variance_within<std::uint16_t>(image, found->counts) == Approx(least).epsilon(1e-12));
  CHECK(found->counts > 30000);
  CHECK(found->counts < 32500);
  CHECK(found->separability > 0.8);
}

TEST_CASE("Otsu: rows may be followed by padding, and images may be parts of others") {
  const auto image = two_gaussians<std::uint16_t>(12, 9, 0.3, 1000, 3000, 100, 100, 21);
  // what lies between the rows would move the threshold
  std::vector<std::uint16_t> buffer(12 * 16, 65535);
  Eigen::Map<Image<std::uint16_t>, 0, Eigen::OuterStride<>> padded(buffer.data(), 12, 9, Eigen::OuterStride<>(16));
  padded = image;
  Image<std::uint16_t> larger = Image<std::uint16_t>::Constant(20, 20, 65535);
  larger.block(3, 5, 12, 9) = image;
  CHECK(otsu_threshold(padded)->counts == otsu_threshold(image)->counts);
  CHECK(otsu_threshold(larger.block(3, 5, 12, 9))->counts == otsu_threshold(image)->counts);
}

TEST_CASE("Otsu: a histogram of several frames") {
  const auto first = two_gaussians<std::uint8_t>(20, 30, 0.01, 50, 150, 5, 5, 1);
  const auto second = two_gaussians<std::uint8_t>(20, 30, 0.4, 50, 150, 5, 5, 2);
  Image<std::uint8_t> both(40, 30);
  both << first, second;
  PixelHistogram<std::uint8_t> histogram;
  histogram.add(first);
  histogram.add(second);
  CHECK(histogram.otsu()->counts == otsu_threshold(both)->counts);
  CHECK(histogram.count(both(0, 0)) == (both == both(0, 0)).count());
  histogram.clear();
  CHECK_FALSE(histogram.otsu());
}
