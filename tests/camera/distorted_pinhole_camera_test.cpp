// SPDX-License-Identifier: MIT
#include <decant/camera/distorted_pinhole_camera.hpp>

#include <cmath>
#include <complex>
#include <limits>
#include <random>
#include <vector>

#include "catch.hpp"

namespace {

using decant::DistortedPinholeCamera;
using decant::LensDistortion;
using decant::PinholeCamera;
using Place = Eigen::Vector2d;

const PinholeCamera ideal(600, 610, 320, 240, 640, 480);

// The lens in complex numbers: with w = a + i b and t = p2 + i p1 its tangential part is 2 w Re(conj(t) w) + t |w|^2.
Place complex_distortion(const LensDistortion& lens, const Place& place) {
  const std::complex<double> w(place.x(), place.y());
  const std::complex<double> t(lens.p2, lens.p1);
  const double r = std::abs(w);
  const std::complex<double> radial =
      w + w * (lens.k1 * std::pow(r, 2) + lens.k2 * std::pow(r, 4) + lens.k3 * std::pow(r, 6));
  const std::complex<double> bent = radial + 2.0 * w * (std::conj(t) * w).real() + t * std::norm(w);
  return {bent.real(), bent.imag()};
}

std::vector<LensDistortion> lenses() {
  std::vector<LensDistortion> result{{}, {-0.3, 0, 0, 0, 0}, {0.1, 0, 0, 0, 0}, {0, 0, 0.01, 0, 0}};
  std::mt19937 random(3);
  const auto uniform = [&random](double size) {
    return size * (2.0 * static_cast<double>(random()) / 4294967296.0 - 1);
  };
  for (int k = 0; k < 40; ++k) {
    result.push_back({uniform(0.5), uniform(0.3), uniform(0.01), uniform(0.01), uniform(0.2)});
  }
  return result;
}

Place random_place(std::mt19937& random, double radius) {
  const double turn = 6.283185307179586 * static_cast<double>(random()) / 4294967296.0;
  const double r = radius * std::sqrt(static_cast<double>(random()) / 4294967296.0);
  return {r * std::cos(turn), r * std::sin(turn)};
}

}  // namespace

// By hand at (0.3, -0.2): r^2 = 0.13, c = 1 - 0.0325 + 0.001352 - 0.00002197 = 0.96883003;
// a' = 0.290649009 - 0.00012 - 0.00062, b' = -0.193766006 + 0.00021 + 0.00024.
TEST_CASE("The lens bends as plumb_bob does, in OpenCV's order of coefficients") {
  const DistortedPinholeCamera camera(ideal, {-0.25, 0.08, 0.001, -0.002, -0.01});
  const decant::Projection seen = camera.project({0.6, -0.4, 2});
  CHECK(seen.pixel.x() == Approx(600 * 0.289909009 + 320).epsilon(1e-12));
  CHECK(seen.pixel.y() == Approx(610 * -0.193316006 + 240).epsilon(1e-12));
  CHECK(seen.depth == 2);
  CHECK(seen.visible);

  std::mt19937 random(1);
  for (const LensDistortion& lens : lenses()) {
    const DistortedPinholeCamera other(ideal, lens);
    for (int n = 0; n < 50; ++n) {
      const Place place = random_place(random, 0.8);
      CHECK((other.distorted(place) - complex_distortion(lens, place)).norm() < 1e-14);
    }
  }
}

TEST_CASE("Without coefficients the lens camera is the pinhole") {
  const DistortedPinholeCamera camera(ideal, {});
  CHECK(std::isinf(camera.largest_radius()));
  std::mt19937 random(2);
  for (int n = 0; n < 200; ++n) {
    const Place place = random_place(random, 3);
    const decant::Vector3<double> x(1.7 * place.x(), 1.7 * place.y(), 1.7);
    CHECK((camera.project(x).pixel - ideal.project(x).pixel).norm() < 1e-9);
    CHECK(camera.project(x).visible == ideal.project(x).visible);
    CHECK((camera.jacobian(x) - ideal.jacobian(x)).norm() < 1e-9);
  }
}

TEST_CASE("Newton finds back to every point that the lens takes in") {
  std::mt19937 random(4);
  for (const LensDistortion& lens : lenses()) {
    const DistortedPinholeCamera camera(ideal, lens);
    const double radius = std::min(camera.largest_radius(), 3.0);
    for (int n = 0; n < 300; ++n) {
      const Place place = random_place(random, 0.98 * radius);
      const Place back = camera.undistorted(complex_distortion(lens, place));
      // 1e-12 in the image, times how much the lens shrinks: at 0.98 of the fold, some 1 / 0.04
      CHECK((back - place).norm() < 1e-10 * std::max(1.0, camera.distorted(place).norm()));
    }
  }
}

TEST_CASE("The lens is one to one up to its largest radius, and that is where it folds") {
  // radial only: d(rc)/dr = 1 - 0.9 r^2
  CHECK(DistortedPinholeCamera(ideal, {-0.3, 0, 0, 0, 0}).largest_radius() == Approx(std::sqrt(1 / 0.9)).epsilon(1e-5));
  CHECK(std::isinf(DistortedPinholeCamera(ideal, {0.1, 0, 0, 0, 0}).largest_radius()));
  // tangential only: along the worst direction the place goes to r - 3 p r^2
  CHECK(DistortedPinholeCamera(ideal, {0, 0, 0.003, 0.004, 0}).largest_radius() == Approx(1 / 0.03).epsilon(1e-5));

  // against a scan of the derivative's determinant, from differences of the complex form
  for (const LensDistortion& lens : lenses()) {
    const double radius = DistortedPinholeCamera(ideal, lens).largest_radius();
    double first_fold = std::numeric_limits<double>::infinity();
    for (int step = 1; step <= 1500 && std::isinf(first_fold); ++step) {
      const double r = 0.002 * step;
      for (int k = 0; k < 64; ++k) {
        const Place at(r * std::cos(0.09817477 * k), r * std::sin(0.09817477 * k));
        const double d = 1e-5;
        Eigen::Matrix2d rate;
        for (int axis = 0; axis < 2; ++axis) {
          Place shift = Place::Zero();
          shift[axis] = d;
          rate.col(axis) = (complex_distortion(lens, at + shift) - complex_distortion(lens, at - shift)) / (2 * d);
        }
        if (!(rate.determinant() > 0)) {
          first_fold = r;
        }
      }
    }
    INFO("k1 " << lens.k1 << " k2 " << lens.k2 << " p1 " << lens.p1 << " p2 " << lens.p2 << " k3 " << lens.k3);
    // never too large; too small by the scan's step, and by 64 directions that miss the worst one
    CHECK_FALSE(radius > first_fold + 1e-6);
    if (first_fold < 2.9) {
      CHECK(radius > 0.99 * first_fold - 0.002);
    }
  }
}

TEST_CASE("What lies beyond the fold does not come back into the image") {
  const DistortedPinholeCamera camera(ideal, {-0.3, 0, 0, 0, 0});
  const decant::Vector3<double> beside(1.5, 0, 1);  // the polynomial alone would put it at 1.5 (1 - 0.675) = 0.4875
  CHECK(decant::inside_image({600 * camera.distorted({1.5, 0}).x() + 320, 240}, 640, 480) == true);
  CHECK_FALSE(camera.project(beside).visible);
  CHECK_FALSE(camera.project(beside).projected());
  CHECK(camera.project(beside).pixel.allFinite());
  CHECK(camera.jacobian(beside).norm() == 0);
  CHECK(camera.project({1.05, 0, 1}).projected());
  CHECK_FALSE(camera.project({1.06, 0, 1}).projected());

  // the farthest that this lens reaches is 0.703 focal lengths: beyond, pixels have no point, and say so by coming back
  // elsewhere
  for (const Place& pixel : {Place(320 + 600 * 0.71, 240), Place(320 + 600 * 0.9, 240 - 610 * 0.9), Place(-1e6, 3e5)}) {
    const decant::Vector3<double> x = camera.unproject(pixel, 2);
    CHECK(x.allFinite());
    CHECK(x.z() == 2);
    CHECK((camera.project(x).pixel - pixel).norm() > 1);
  }
  const Place inside(320 + 600 * 0.70, 240);
  CHECK((camera.project(camera.unproject(inside, 2)).pixel - inside).norm() < 1e-6);
}

TEST_CASE("What is not a lens is refused in one line") {
  CHECK_THROWS_WITH(DistortedPinholeCamera(ideal, {0, 0, std::numeric_limits<double>::quiet_NaN(), 0, 0}),
                    "DistortedPinholeCamera: coefficient of the lens [-] must be finite and within 1e6, got nan");
  CHECK_THROWS_WITH(DistortedPinholeCamera(ideal, {0, -2e6, 0, 0, 0}),
                    "DistortedPinholeCamera: coefficient of the lens [-] must be finite and within 1e6, got 2000000");
}
