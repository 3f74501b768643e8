// SPDX-License-Identifier: MIT
#include <decant/testing/camera.hpp>

#include <limits>
#include <type_traits>

#include <decant/camera/affine_registered_camera.hpp>
#include <decant/camera/distorted_pinhole_camera.hpp>
#include <decant/camera/orthographic_camera.hpp>
#include <decant/camera/pinhole_camera.hpp>

#include "catch.hpp"

namespace {

using decant::AffineRegisteredCamera;
using decant::DistortedPinholeCamera;
using decant::OrthographicCamera;
using decant::PinholeCamera;
using decant::Projection;
using Point = decant::Vector3<double>;
using Affine = Eigen::Matrix<double, 2, 3>;

const PinholeCamera off_center(606, 611, 317.3, 243.9, 640, 480);

// The thermal imager of the recording format's example.
Affine thermal() {
  Affine result;
  result << 0.98, 0.01, 12.3, -0.01, 0.98, 4.2;
  return result;
}

template <class Camera>
void check_laws(const char* name, const Camera& camera) {
  for (const auto& law : decant::testing::camera_laws(camera)) {
    INFO(name << ": " << law.text());
    CHECK(law.holds());
  }
}

// What the laws have to notice.
template <int Fault>
struct Faulty {
  PinholeCamera base = off_center;

  Projection project(const Point& x) const noexcept {
    Projection seen = base.project(x);
    if (Fault == 1 && seen.visible) {
      seen.pixel.x() += 1e-5;
    }
    if (Fault == 2 && seen.projected()) {
      seen.depth = x.norm();
    }
    if (Fault == 3 && x.z() < 0) {
      seen.pixel = {base.fx() * x.x() / x.z() + base.cx(), base.fy() * x.y() / x.z() + base.cy()};
      seen.depth = -x.z();
      seen.visible = decant::inside_image(seen.pixel, width(), height());
    }
    if (Fault == 4 && !x.allFinite()) {
      seen.pixel.setConstant(std::numeric_limits<double>::quiet_NaN());
    }
    if (Fault == 5) {
      seen.visible = seen.projected() && seen.pixel.x() >= 0 && seen.pixel.y() >= 0 && seen.pixel.x() < width() &&
                     seen.pixel.y() < height();
    }
    if (Fault == 6) {
      seen.visible = seen.projected();
    }
    return seen;
  }
  Point unproject(const Eigen::Vector2d& pixel, double depth) const noexcept {
    return base.unproject(Fault == 7 ? Eigen::Vector2d(pixel.array() + 0.5) : pixel,
                          Fault == 8 ? 1.01 * depth : depth) +
           (Fault == 10 ? Point(0, depth * depth * 1e-6, 0) : Point(0, 0, 0));
  }
  Eigen::Matrix<double, 2, 3> jacobian(const Point& x) const noexcept {
    Eigen::Matrix<double, 2, 3> rate = base.jacobian(x);
    if (Fault == 9) {
      rate(0, 2) *= -1;
    }
    return rate;
  }
  int width() const noexcept { return base.width(); }
  int height() const noexcept { return base.height(); }
};

template <int Fault>
int broken_laws() {
  int broken = 0;
  for (const auto& law : decant::testing::camera_laws(Faulty<Fault>{})) {
    broken += law.holds() ? 0 : 1;
  }
  return broken;
}

}  // namespace

TEST_CASE("Every camera keeps the laws of its concept") {
  check_laws("pinhole", off_center);
  check_laws("pinhole of one pixel", PinholeCamera(3, 4, 0, 0, 1, 1));
  check_laws("wide pinhole", PinholeCamera(300, 250, 950, 500, 1920, 1080));
  check_laws("pinhole whose axis is outside of the image", PinholeCamera(900, 900, -200, 1300, 640, 480));
  const DistortedPinholeCamera barrel(off_center, {-0.28, 0.09, 4e-4, -7e-4, -0.012});
  check_laws("barrel", barrel);
  check_laws("pincushion", DistortedPinholeCamera(off_center, {0.12, 0.03, -2e-3, 1e-3, 0.01}));
  check_laws("without distortion", DistortedPinholeCamera(off_center, {}));
  check_laws("lens that folds inside the image",
             DistortedPinholeCamera(PinholeCamera(400, 400, 320, 240, 640, 480), {-0.4, 0.0, 1e-3, 0.0, 0.0}));
  check_laws("orthographic", OrthographicCamera(900, 310.5, 244.25, 640, 480));
  check_laws("thermal beside pinhole", AffineRegisteredCamera<PinholeCamera>(off_center, thermal(), 640, 512));
  check_laws("thermal beside lens", AffineRegisteredCamera<DistortedPinholeCamera>(barrel, thermal(), 640, 512));
  Affine mirrored;
  mirrored << -2.1, 0.3, 640, 0.2, 1.9, -7;
  check_laws("mirrored, half as large", AffineRegisteredCamera<PinholeCamera>(off_center, mirrored, 320, 240));
  check_laws("beside orthographic",
             AffineRegisteredCamera<OrthographicCamera>(OrthographicCamera(800, 0, 0, 10, 10), thermal(), 320, 240));
}

TEST_CASE("The laws notice what is wrong with a camera") {
  CHECK(broken_laws<0>() == 0);
  CHECK(broken_laws<1>() > 0);
  CHECK(broken_laws<2>() > 0);
  CHECK(broken_laws<3>() > 0);
  CHECK(broken_laws<4>() > 0);
  CHECK(broken_laws<5>() > 0);
  CHECK(broken_laws<6>() > 0);
  CHECK(broken_laws<7>() > 0);
  CHECK(broken_laws<8>() > 0);
  CHECK(broken_laws<9>() > 0);
  CHECK(broken_laws<10>() > 0);
}

TEST_CASE("Cameras know whether their rays are affine in the pixel") {
  CHECK(decant::has_affine_rays<PinholeCamera>);
  CHECK(decant::has_affine_rays<OrthographicCamera>);
  CHECK(decant::has_affine_rays<AffineRegisteredCamera<PinholeCamera>>);
  CHECK_FALSE(decant::has_affine_rays<DistortedPinholeCamera>);
  CHECK_FALSE(decant::has_affine_rays<AffineRegisteredCamera<DistortedPinholeCamera>>);
  CHECK_FALSE(decant::has_affine_rays<Faulty<0>>);  // says nothing of it
}
