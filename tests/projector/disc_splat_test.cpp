// SPDX-License-Identifier: MIT
#include <decant/projector/disc_splat.hpp>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "cameras.hpp"
#include "catch.hpp"
#include "drawn.hpp"

namespace {

using namespace decant;
using decant_test::drawn;

// Particles whose projections lie at chosen pixels and depths.
PointArray<double> at(const PinholeCamera& camera, std::initializer_list<Vector3<double>> pixels_and_depths) {
  PointArray<double> position(3, static_cast<Index>(pixels_and_depths.size()));
  Index i = 0;
  for (const auto& place : pixels_and_depths) {
    position.col(i++) = camera.unproject(place.head<2>(), place.z());
  }
  return position;
}

}  // namespace

TEST_CASE("A disc covers the pixels whose centres are within radius f / z of its own") {
  const PinholeCamera camera(500, 500, 80, 60, 160, 120);
  std::mt19937 generator(5);
  std::uniform_real_distribution<double> u(-30, 190), v(-30, 150), z(0.1, 3);
  const double radius = 0.004;
  PointArray<double> position(3, 700);
  Image<float> expected = Image<float>::Zero(120, 160);
  for (Index i = 0; i < position.cols(); ++i) {
    const Eigen::Vector2d center(u(generator), v(generator));
    const double depth = z(generator);
    position.col(i) = camera.unproject(center, depth);
    const double radius_px = radius * 500 / depth;
    bool any = false;
    for (int row = -60; row < 240; ++row) {
      for (int column = -60; column < 280; ++column) {
        if (std::hypot(column - center.x(), row - center.y()) <= radius_px) {
          any = true;
          if (row >= 0 && row < 120 && column >= 0 && column < 160) {
            expected(row, column) += 1;
          }
        }
      }
    }
    if (!any && inside_image(center, 160, 120)) {
      expected(static_cast<Index>(std::lround(center.y())), static_cast<Index>(std::lround(center.x()))) += 1;
    }
  }
  for (const int threads : {1, 2, 4}) {
    INFO("threads " << threads);
    CHECK((drawn(DiscSplat<double>(radius), position, camera, threads) == expected).all());
  }
}

TEST_CASE("Discs have the area of the sphere at its depth") {
  const PinholeCamera camera(600, 400, 319.5, 239.5, 640, 480);  // pixels that are not square
  const double area = std::numbers::pi * 0.02 * 0.02 * 600 * 400 / (0.4 * 0.4);
  for (const double shift : {0.0, 0.25, 0.5, 0.7}) {
    const Image<float> image =
        drawn(DiscSplat<double>(0.02), at(camera, {{100 + shift, 300 - shift / 3, 0.4}}), camera);
    // the number of grid points in a circle of radius R differs from its area by less than 4 sqrt(R) (R = 24.5 px)
    CHECK(std::abs(image.sum() - area) < 4 * std::sqrt(24.5));
    CHECK(image.maxCoeff() == 1);
  }
}

TEST_CASE("A disc that holds no pixel's centre covers one pixel") {
  const PinholeCamera camera(500, 500, 80, 60, 160, 120);
  for (const double radius : {1e-9, 1e-4, 5e-4}) {  // up to a quarter of a pixel at 1 m
    const Image<float> image = drawn(DiscSplat<double>(radius), at(camera, {{20.4, 30.6, 1}, {20.3, 31.4, 1}}), camera);
    CHECK(image.sum() == 2);
    CHECK(image(31, 20) == 2);
  }
  // beyond the border it is lost, as its centre is
  CHECK(drawn(DiscSplat<double>(1e-5), at(camera, {{-0.6, 3, 1}, {4, 119.6, 1}}), camera).sum() == 0);
  CHECK(drawn(DiscSplat<double>(1e-5), at(camera, {{-0.4, 3, 1}, {4, 119.4, 1}}), camera).sum() == 2);
}

TEST_CASE("A disc whose centre is beside the image still covers what it reaches") {
  const PinholeCamera camera(500, 500, 80, 60, 160, 120);
  const Image<float> image = drawn(DiscSplat<double>(0.02), at(camera, {{-5, 60, 1}}), camera);  // 10 px
  CHECK(image(60, 0) == 1);
  CHECK(image(60, 5) == 1);
  CHECK(image(60, 6) == 0);
  CHECK(image(69, 0) == 0);  // hypot(5, 9) > 10
  CHECK(image(68, 0) == 1);
}

TEST_CASE("Particles that nearly touch the eye cover the image and break nothing") {
  const PinholeCamera camera(500, 500, 80, 60, 160, 120);
  const PointArray<double> position = at(camera, {{80, 60, 2e-6}, {80, 60, 1e-3}});
  CHECK((drawn(DiscSplat<double>(0.003), position, camera) == 2).all());
}

TEST_CASE("Discs are drawn for any camera") {
  const decant_test::Parallel camera;
  PointArray<float> position(3, 2);
  position.col(0) = Vector3<float>(0.0101f, -0.0203f, 0.5f);  // pixel (90.1, 39.7)
  position.col(1) = Vector3<float>(0.0101f, -0.0203f, -0.5f);
  Image<float> image(120, 160);
  DiscSplat<float> projector(0.0032);
  const PixelBox box = projector.render(position, {}, camera, {}, image);
  for (int v = 0; v < 120; ++v) {
    for (int u = 0; u < 160; ++u) {
      CHECK(image(v, u) == (std::hypot(u - 90.1, v - 39.7) <= 3.2 ? 1 : 0));
    }
  }
  CHECK(box == PixelBox{87, 37, 94, 43});
}

TEST_CASE("A radius that is not one is refused") {
  for (const double radius :
       {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    CHECK_THROWS_WITH(DiscSplat<float>(radius), decant_test::contains("DiscSplat: radius [m] must be > 0, got"));
  }
}
