// SPDX-License-Identifier: MIT
#include <decant/camera/affine_registered_camera.hpp>

#include <limits>

#include "catch.hpp"

using decant::PinholeCamera;
using Registered = decant::AffineRegisteredCamera<PinholeCamera>;

namespace {

const PinholeCamera pinhole(600, 500, 320, 240, 640, 480);

Registered::Affine affine(double a, double b, double c, double d, double e, double f) {
  Registered::Affine result;
  result << a, b, c, d, e, f;
  return result;
}

}  // namespace

// The recording format's example: thermal pixel (100, 200) is image pixel (0.98 100 + 0.01 200 + 12.3, ...).
TEST_CASE("The matrix takes pixels of the second imager to the first") {
  const Registered thermal(pinhole, affine(0.98, 0.01, 12.3, -0.01, 0.98, 4.2), 640, 512);
  CHECK((thermal.in_first({100, 200}) - Eigen::Vector2d(112.3, 199.2)).norm() < 1e-12);
  const decant::Vector3<double> x = pinhole.unproject({112.3, 199.2}, 0.7);
  CHECK((thermal.project(x).pixel - Eigen::Vector2d(100, 200)).norm() < 1e-9);
  CHECK(thermal.project(x).depth == 0.7);
  CHECK((thermal.unproject({100, 200}, 0.7) - x).norm() < 1e-12);
}

TEST_CASE("The second imager's image is its own") {
  const Registered small(pinhole, affine(2, 0, 100, 0, 2, 50), 200, 150);
  CHECK(small.width() == 200);
  CHECK(small.height() == 150);
  const auto at = [](double u, double v) { return pinhole.unproject({u, v}, 1); };
  CHECK(small.project(at(101, 51)).visible);
  CHECK_FALSE(small.project(at(50, 51)).visible);  // in the first image only
  CHECK_FALSE(small.project(at(600, 51)).visible);
  const Registered wide(pinhole, affine(1, 0, -100, 0, 1, 0), 840, 480);
  CHECK(wide.project(at(-50, 10)).visible);  // in the second image only
  CHECK_FALSE(pinhole.project(at(-50, 10)).visible);
  CHECK_FALSE(wide.project({0, 0, -1}).visible);
}

TEST_CASE("What is not a registered camera is refused in one line") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(Registered(pinhole, affine(1, 2, 0, 2, 4, 0), 640, 512),
                    "AffineRegisteredCamera: determinant of the 2x3 matrix's linear part must be far enough from 0 for "
                    "the map to have an inverse, got 0");
  CHECK_THROWS_WITH(Registered(pinhole, affine(1, 0, nan, 0, 1, 0), 640, 512),
                    "AffineRegisteredCamera: entry of the 2x3 matrix must be finite and within 1e9, got nan");
  CHECK_THROWS_WITH(Registered(pinhole, affine(1, 0, 0, 0, 1, 0), 0, 512),
                    "AffineRegisteredCamera: width [px] must be 1 to 32768, got 0");
  CHECK_THROWS_WITH(Registered(pinhole, affine(1, 0, 0, 0, 1, 0), 640, -5),
                    "AffineRegisteredCamera: height [px] must be 1 to 32768, got -5");
}
