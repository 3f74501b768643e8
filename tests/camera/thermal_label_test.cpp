// SPDX-License-Identifier: MIT
#include <decant/camera/thermal_label.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "catch.hpp"

namespace {

using decant::AffineMap;
using decant::Image;
using decant::label_by_threshold;
using decant::Mask;
using decant::ThermalLabel;

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

AffineMap map_of(double a, double b, double c, double d, double e, double f) {
  AffineMap::Matrix matrix;
  matrix << a, b, c, d, e, f;
  return AffineMap(matrix);
}

// 0 and 255 as text, to be read in a test.
std::string text(const Mask& mask) {
  std::string lines;
  for (Eigen::Index v = 0; v < mask.rows(); ++v) {
    for (Eigen::Index u = 0; u < mask.cols(); ++u) {
      lines += mask(v, u) == 255 ? '#' : mask(v, u) == 0 ? '.' : '?';
    }
    lines += v + 1 < mask.rows() ? "/" : "";
  }
  return lines;
}

}  // namespace

TEMPLATE_TEST_CASE("Thermal label: from the threshold on", "", std::uint8_t, std::uint16_t, float, double) {
  Image<TestType> image(2, 3);
  image << 99, 100, 101, 0, 200, 100;
  Mask mask = Mask::Constant(2, 3, 7);
  const auto labelled = [&](double threshold) {
    mask.setConstant(7);
    label_by_threshold(image, threshold, mask);
    return text(mask);
  };
  CHECK(labelled(100) == ".##/.##");
  CHECK(labelled(100.5) == "..#/.#.");
  CHECK(labelled(99.5) == ".##/.##");
  CHECK(labelled(0) == "###/###");
  CHECK(labelled(-5) == "###/###");
  CHECK(labelled(-infinite) == "###/###");
  CHECK(labelled(200.5) == ".../...");
  CHECK(labelled(1e300) == ".../...");
  CHECK(labelled(infinite) == ".../...");
  CHECK(labelled(not_a_number) == ".../...");
}

TEST_CASE("Thermal label: extreme values") {
  Image<std::uint16_t> image(1, 3);
  image << 0, 65534, 65535;
  Mask mask(1, 3);
  label_by_threshold(image, 65535, mask);
  CHECK(text(mask) == "..#");
  label_by_threshold(image, 65535.5, mask);
  CHECK(text(mask) == "...");
  // a threshold between two floats: the lower one is below it
  Image<float> warm(1, 2);
  warm << 0.3F, std::nextafter(0.3F, 0.0F);
  label_by_threshold(warm, static_cast<double>(warm(0, 1)) + 1e-12, mask.leftCols(2));
  CHECK(text(mask.leftCols(2)) == "#.");
  warm << std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity();
  label_by_threshold(warm, 0, mask.leftCols(2));
  CHECK(text(mask.leftCols(2)) == ".#");
}

TEST_CASE("Thermal label: sizes that differ, empty images, padded rows") {
  Image<std::uint8_t> image = Image<std::uint8_t>::Constant(3, 4, 200);
  Mask larger = Mask::Constant(4, 6, 7);
  label_by_threshold(image, 100, larger);
  CHECK(text(larger) == "####../####../####../......");
  Mask smaller = Mask::Constant(2, 2, 7);
  label_by_threshold(image, 100, smaller);
  CHECK(text(smaller) == "##/##");
  label_by_threshold(Image<std::uint8_t>(), 100, smaller);
  CHECK(text(smaller) == "../..");
  Mask none;
  label_by_threshold(image, 100, none);
  CHECK(none.size() == 0);

  image(1, 2) = 3;
  std::vector<std::uint8_t> counts(3 * 7, 255), labels(3 * 9, 7);
  Eigen::Map<Image<std::uint8_t>, 0, Eigen::OuterStride<>> padded_image(counts.data(), 3, 4, Eigen::OuterStride<>(7));
  Eigen::Map<Mask, 0, Eigen::OuterStride<>> padded_mask(labels.data(), 3, 4, Eigen::OuterStride<>(9));
  padded_image = image;
  label_by_threshold(padded_image, 100, padded_mask);
  CHECK(text(padded_mask) == "####/##.#/####");
  ThermalLabel(100, AffineMap()).label(padded_image, padded_mask);
  CHECK(text(padded_mask) == "####/##.#/####");
  ThermalLabel(100, AffineMap()).mark_seen(padded_image, padded_mask);
  CHECK(text(padded_mask) == "####/####/####");
  for (std::size_t i = 0; i < labels.size(); ++i) {
    CHECK((i % 9 < 4 || labels[i] == 7));  // what follows a row is not ours
  }
}

TEMPLATE_TEST_CASE("Thermal label: the map takes thermal pixels to the image's", "", std::uint8_t, std::uint16_t, float,
                   double) {
  Image<TestType> thermal = Image<TestType>::Zero(3, 4);
  thermal(1, 2) = 100;
  Mask mask(6, 6);
  // (u, v) = (2, 1) moves three to the right and four down
  ThermalLabel(51, map_of(1, 0, 3, 0, 1, 4)).label(thermal, mask);
  CHECK(text(mask) == "....../....../....../....../....../.....#");
  // a quarter turn: x' = 4 - y, y' = x
  ThermalLabel(51, map_of(0, -1, 4, 1, 0, 0)).label(thermal, mask);
  CHECK(text(mask) == "....../....../...#../....../....../......");
  Mask seen(6, 6);
  ThermalLabel(51, map_of(0, -1, 4, 1, 0, 0)).mark_seen(thermal, seen);
  CHECK(text(seen) == "..###./..###./..###./..###./....../......");
}

TEST_CASE("Thermal label: counts are interpolated, then compared") {
  // A step from 0 to 100 between columns 1 and 2, seen four times as large: it crosses 25 at 1.25, which is u = 5, and
  // 75 at 1.75. Labelling first would put the edge at 1.5 for both.
  Image<std::uint8_t> thermal(1, 4);
  thermal << 0, 0, 100, 100;
  Mask mask(1, 16);
  const AffineMap larger = map_of(4, 0, 0, 0, 1, 0);
  ThermalLabel(25, larger).label(thermal, mask);
  CHECK(text(mask) == ".....#########..");
  ThermalLabel(75, larger).label(thermal, mask);
  CHECK(text(mask) == ".......#######..");
  // both ways: x y / 16 of 100 in the square of four pixels
  Image<double> corner(2, 2);
  corner << 0, 0, 0, 100;
  Mask square(5, 5);
  for (const double threshold : {10.0, 30.0, 60.0}) {
    ThermalLabel(threshold, map_of(4, 0, 0, 0, 4, 0)).label(corner, square);
    for (int v = 0; v < 5; ++v) {
      for (int u = 0; u < 5; ++u) {
        CHECK(decant::is_liquid(square(v, u)) == (100.0 * u * v / 16 >= threshold));
      }
    }
  }
}

TEST_CASE("Thermal label: what is not seen is told from what is not liquid") {
  // half a pixel beyond the outermost centres belongs to the image, as everywhere
  const Image<std::uint16_t> thermal = Image<std::uint16_t>::Constant(2, 2, 500);
  Mask liquid(10, 10), seen(10, 10);
  const ThermalLabel label(400, map_of(4, 0, 3, 0, 4, 3));  // thermal pixel k covers 4 k + 1 up to 4 k + 5
  label.label(thermal, liquid);
  label.mark_seen(thermal, seen);
  CHECK(text(liquid) == text(seen));
  CHECK(text(seen.row(1)) == ".########.");
  CHECK(text(seen.col(1).transpose()) == ".########.");
  CHECK((seen == 255).count() == 64);
  // cold: no liquid, seen all the same
  label.label(Image<std::uint16_t>::Constant(2, 2, 300).eval(), liquid);
  CHECK((liquid == 0).all());
  // a map that leads elsewhere, and no image
  ThermalLabel(400, map_of(1, 0, 1e6, 0, 1, 0)).mark_seen(thermal, seen);
  CHECK((seen == 0).all());
  seen.setConstant(7);
  liquid.setConstant(7);
  label.mark_seen(Image<std::uint16_t>(), seen);
  label.label(Image<std::uint16_t>(), liquid);
  CHECK((seen == 0).all());
  CHECK((liquid == 0).all());
  // a single pixel, and a single row
  label.mark_seen(Image<std::uint16_t>::Constant(1, 1, 500).eval(), seen);
  CHECK((seen == 255).count() == 16);
  label.label(Image<std::uint16_t>::Constant(1, 2, 500).eval(), liquid);
  CHECK((liquid == 255).count() == 32);
}

TEMPLATE_TEST_CASE("Thermal label: a dead pixel is not seen", "", float, double) {
  Image<TestType> thermal = Image<TestType>::Constant(3, 3, 50);
  thermal(1, 1) = std::numeric_limits<TestType>::quiet_NaN();
  Mask liquid(3, 3), seen(3, 3);
  const ThermalLabel label(40, AffineMap());
  label.label(thermal, liquid);
  label.mark_seen(thermal, seen);
  CHECK(text(liquid) == "###/#.#/###");  // and does not spoil its neighbors
  CHECK(text(seen) == "###/#.#/###");
}

TEST_CASE("Thermal label: a disc is found to a fraction of a thermal pixel") {
  // A warm disc, blurred by the optics over about a pixel, in a camera whose pixels are 1.57 times as wide as the
  // image's.
  const AffineMap image_from_thermal = map_of(1.57, 0.03, -24, 0.05, 1.5, -20);
  const Eigen::Vector2d centre(61.3, 48.7);
  const double radius = 17.4;
  Image<std::uint16_t> thermal(100, 120);
  for (int v = 0; v < 100; ++v) {
    for (int u = 0; u < 120; ++u) {
      const double beyond = (Eigen::Vector2d(u, v) - centre).norm() - radius;
      thermal(v, u) = static_cast<std::uint16_t>(30000 + 3000 / (1 + std::exp(2 * beyond)));
    }
  }
  Mask labelled(120, 160), nearest(120, 160), truth(120, 160);
  ThermalLabel(31500, image_from_thermal).label(thermal, labelled);
  const AffineMap thermal_from_image = image_from_thermal.inverse();
  for (int v = 0; v < 120; ++v) {
    for (int u = 0; u < 160; ++u) {
      const Eigen::Vector2d x = thermal_from_image.apply(Eigen::Vector2d(u, v));
      truth(v, u) = (x - centre).norm() <= radius ? 255 : 0;
      const auto column = static_cast<int>(std::lround(x.x()));
      const auto row = static_cast<int>(std::lround(x.y()));
      nearest(v, u) = row >= 0 && row < 100 && column >= 0 && column < 120 && thermal(row, column) >= 31500 ? 255 : 0;
    }
  }
  const double edge_px = 6.2832 * radius * 1.53;  // pixels of the image along the disc's edge
  const double wrong = static_cast<double>((labelled != truth).count());
  const double wrong_nearest = static_cast<double>((nearest != truth).count());
  INFO(wrong << " wrong pixels, " << wrong_nearest << " with the nearest label, of " << edge_px << " along the edge");
  CHECK(wrong / edge_px < 0.06);  // the edge, on average, within as many pixels of the image
  CHECK(wrong < 0.4 * wrong_nearest);
}

TEST_CASE("Thermal label: settings are checked") {
  using Catch::Matchers::StartsWith;
  for (const double bad : {not_a_number, infinite, -infinite}) {
    CHECK_THROWS_WITH(ThermalLabel(bad, AffineMap()),
                      StartsWith("ThermalLabel: threshold [counts] must be finite, got"));
  }
  const ThermalLabel label(5, map_of(2, 0, 6, 0, 2, 8));
  CHECK(label.threshold() == 5);
  CHECK(label.thermal_from_image().apply(Eigen::Vector2d(6, 8)).norm() < 1e-12);
}
