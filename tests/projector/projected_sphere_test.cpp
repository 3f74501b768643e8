// SPDX-License-Identifier: MIT
#include <decant/projector/projected_sphere.hpp>

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

PointArray<double> one(const Vector3<double>& x) {
  PointArray<double> position(3, 1);
  position = x;
  return position;
}

// Distance of closest approach between a ray's part before the eye and a point, found by another formula than the
// library's: the foot of the perpendicular.
double approach(const Vector3<double>& direction, const Vector3<double>& center) {
  const double along = std::max(0.0, direction.dot(center) / direction.squaredNorm());
  return (along * direction - center).norm();
}

}  // namespace

TEST_CASE("The outline off the axis is the ellipse that the tangent cone cuts") {
  // finely sampled image: 4,000 px of focal length
  const PinholeCamera camera(4000, 4000, -1500, 700, 1400, 1400);
  const double radius = 0.05;
  const Vector3<double> center(0.55, 0.0, 1.0);
  const double theta = std::atan2(0.55, 1.0);
  const double alpha = std::asin(radius / center.norm());
  const Image<float> image = drawn(ProjectedSphere<double>(radius), one(center), camera);
  // along the radius, the cone's edges are at theta +- alpha
  const double u_low = 4000 * std::tan(theta - alpha) - 1500, u_high = 4000 * std::tan(theta + alpha) - 1500;
  const double half_v =
      4000 * std::sin(alpha) / std::sqrt(std::cos(theta) * std::cos(theta) - std::sin(alpha) * std::sin(alpha));
  int first_u = 1400, last_u = -1, first_v = 1400, last_v = -1;
  for (int v = 0; v < 1400; ++v) {
    for (int u = 0; u < 1400; ++u) {
      if (image(v, u) > 0) {
        first_u = std::min(first_u, u);
        last_u = std::max(last_u, u);
        first_v = std::min(first_v, v);
        last_v = std::max(last_v, v);
      }
    }
  }
  // The axis of the ellipse along u lies in pixel row 700: exact there. Across, the outermost column need not be a
  // whole number: an arc of curvature a / b^2 loses less than a hundredth of a pixel within half a pixel.
  CHECK(first_u == static_cast<int>(std::ceil(u_low)));
  CHECK(last_u == static_cast<int>(std::floor(u_high)));
  CHECK(std::abs(first_v - (700 - half_v)) < 1.01);
  CHECK(std::abs(last_v - (700 + half_v)) < 1.01);
  // lattice points in a smooth convex curve of 200 px radius: off by about sqrt(200), here 4 times that at most
  const double area = std::numbers::pi * (u_high - u_low) / 2 * half_v;
  CHECK(std::abs(image.sum() - area) < 4 * std::sqrt(200));
  CHECK(area > 1.1 * std::numbers::pi * std::pow(4000 * 0.05, 2));  // and it is not the disc of DiscSplat
}

TEST_CASE("A pixel counts if and only if its ray meets the sphere before the camera") {
  const PinholeCamera camera(200, 230, 70, 65, 160, 120);
  std::mt19937 generator(11);
  std::uniform_real_distribution<double> x(-0.6, 0.6), y(-0.4, 0.4), z(-0.2, 1.2);
  const double radius = 0.06;
  const Index count = 600;  // enough for rows to be shared among threads
  PointArray<double> position(3, count);
  for (Index i = 0; i < count; ++i) {
    position.col(i) = Vector3<double>(x(generator), y(generator), z(generator));
  }
  position.col(0) = Vector3<double>(0.01, 0.02, 0.03);    // around the eye
  position.col(1) = Vector3<double>(0.3, 0.1, 0.02);      // through the plane of the eye
  position.col(2) = Vector3<double>(0.07, -0.02, 0.059);  // barely
  position.col(3) = Vector3<double>(0.02, -0.02, 0.0601);
  position.col(4) = Vector3<double>(-0.0605, 0, 0.01);  // beside the eye: rays to the right pass it backward
  Image<float> expected = Image<float>::Zero(120, 160);
  for (Index i = 0; i < count; ++i) {
    if (!(position(2, i) > 0)) {
      continue;
    }
    for (int v = 0; v < 120; ++v) {
      for (int u = 0; u < 160; ++u) {
        const Vector3<double> direction((u - 70) / 200.0, (v - 65) / 230.0, 1);
        expected(v, u) += approach(direction, position.col(i)) <= radius ? 1.0f : 0.0f;
      }
    }
  }
  CHECK(expected.minCoeff() >= 1);  // the eye is in a sphere
  const decant_test::ForeignPinhole foreign{camera};
  for (const int threads : {1, 2, 4}) {
    INFO("threads " << threads);
    CHECK((drawn(ProjectedSphere<double>(radius), position, camera, threads) == expected).all());
    CHECK((drawn(ProjectedSphere<double>(radius), position, foreign, threads) == expected).all());
  }
  // spheres of a few pixels and fractions of one: the box around them must not cut any
  for (const double small : {0.0005, 0.003, 0.012}) {
    const PointArray<double> rest = position.rightCols(count - 5);
    CHECK((drawn(ProjectedSphere<double>(small), rest, camera) == drawn(ProjectedSphere<double>(small), rest, foreign))
              .all());
  }
}

TEST_CASE("Parallel rays see discs, whatever the depth") {
  const decant_test::Parallel camera;
  for (const double depth : {0.004, 0.1, 2.0}) {
    const Image<float> image = drawn(ProjectedSphere<double>(0.0033), one({0.0101, -0.0203, depth}), camera);
    for (int v = 0; v < 120; ++v) {
      for (int u = 0; u < 160; ++u) {
        CHECK(image(v, u) == (std::hypot(u - 90.1, v - 39.7) <= 3.3 ? 1 : 0));
      }
    }
  }
}

TEST_CASE("The rectangle returned is the ellipse's") {
  const PinholeCamera camera(200, 200, 80, 60, 160, 120);
  Image<float> image(120, 160);
  ProjectedSphere<float> projector(0.05);
  PointArray<float> position(3, 1);
  position.col(0) = Vector3<float>(0.1f, -0.05f, 0.5f);
  const PixelBox box = projector.render(position, {}, camera, {}, image);
  PixelBox tight;
  for (int v = 0; v < 120; ++v) {
    for (int u = 0; u < 160; ++u) {
      tight = image(v, u) > 0 ? tight.hull({u, v, u + 1, v + 1}) : tight;
    }
  }
  CHECK(box.hull(tight) == box);
  CHECK(box.width() <= tight.width() + 2);  // an outermost column may hold no pixel's centre
  CHECK(box.height() <= tight.height() + 2);
}

TEST_CASE("A sphere's radius that is not one is refused") {
  for (const double radius :
       {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    CHECK_THROWS_WITH(ProjectedSphere<float>(radius),
                      decant_test::contains("ProjectedSphere: radius [m] must be > 0, got"));
  }
}
