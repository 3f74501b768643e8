// SPDX-License-Identifier: MIT
#include <decant/testing/kernel.hpp>

#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <decant/kernel/cubic_spline.hpp>
#include <decant/kernel/mueller_viscosity.hpp>
#include <decant/kernel/poly6.hpp>
#include <decant/kernel/spiky.hpp>
#include <decant/kernel/wendland_c2.hpp>
#include <decant/kernel/wendland_c4.hpp>

#include "catch.hpp"

namespace {

using decant::CubicSpline;
using decant::MuellerViscosity;
using decant::Poly6;
using decant::Spiky;
using decant::WendlandC2;
using decant::WendlandC4;

// What the laws have to notice.
template <int Fault>
struct Faulty {
  using Scalar = double;
  static constexpr double support_factor = Fault == 1 ? 1.9 : 2.0;
  static double value(double r, double h) noexcept {
    const double w = CubicSpline<double>::value(r, h);
    return Fault == 2 ? 1.01 * w : Fault == 3 ? w * h : Fault == 4 && r > 1.9 * h ? 0.0 : w;
  }
  static double derivative(double r, double h) noexcept {
    const double d = CubicSpline<double>::derivative(r, h);
    return Fault == 5 ? -d : Fault == 6 ? d * (1 + 2e-3 * r / h) : Fault == 7 && r < 0.05 * h ? 0.9 * d + 1e-9 : d;
  }
  static double derivative_over_radius(double r, double h) noexcept {
    const double d = CubicSpline<double>::derivative_over_radius(r, h);
    return Fault == 8 ? 1.0001 * d : Fault == 9 && r == 0 ? d / r : d;
  }
};

template <class Kernel>
int broken_laws() {
  int broken = 0;
  for (const auto& law : decant::testing::kernel_laws<Kernel>(0.005)) {
    broken += law.holds() ? 0 : 1;
  }
  return broken;
}

}  // namespace

TEMPLATE_TEST_CASE("Every kernel keeps the laws of its concept", "", CubicSpline<float>, CubicSpline<double>,
                   WendlandC2<float>, WendlandC2<double>, WendlandC4<float>, WendlandC4<double>, Poly6<float>,
                   Poly6<double>, Spiky<float>, Spiky<double>, MuellerViscosity<float>, MuellerViscosity<double>) {
  using Scalar = typename TestType::Scalar;
  for (const double h : {0.0005, 0.005, 0.1, 1.0, 30.0}) {
    for (const auto& law : decant::testing::kernel_laws<TestType>(static_cast<Scalar>(h))) {
      INFO("h = " << h << " m: " << law.text());
      CHECK(law.holds());
    }
  }
}

TEST_CASE("The laws notice what is wrong with a kernel") {
  CHECK(broken_laws<Faulty<0>>() == 0);
  CHECK(broken_laws<Faulty<1>>() > 0);
  CHECK(broken_laws<Faulty<2>>() > 0);
  CHECK(broken_laws<Faulty<3>>() > 0);
  CHECK(broken_laws<Faulty<4>>() > 0);
  CHECK(broken_laws<Faulty<5>>() > 0);
  CHECK(broken_laws<Faulty<6>>() > 0);
  CHECK(broken_laws<Faulty<7>>() > 0);
  CHECK(broken_laws<Faulty<8>>() > 0);
  CHECK(broken_laws<Faulty<9>>() > 0);
}

// Values worked out by hand from the published formulas at h = 1, in units of 1/pi.
TEMPLATE_TEST_CASE("Kernels have their published values", "", float, double) {
  using S = TestType;
  const double pi = std::numbers::pi;
  const auto at = [](double r) { return static_cast<S>(r); };
  const S h = 1;
  CHECK(pi * CubicSpline<S>::value(at(0), h) == Approx(1));
  CHECK(pi * CubicSpline<S>::value(at(0.5), h) == Approx(0.71875));  // 1 - 1.5/4 + 0.75/8
  CHECK(pi * CubicSpline<S>::value(at(1), h) == Approx(0.25));
  CHECK(pi * CubicSpline<S>::value(at(1.5), h) == Approx(0.03125));  // (1/2)^3 / 4
  CHECK(pi * CubicSpline<S>::derivative_over_radius(at(0), h) == Approx(-3));
  CHECK(pi * WendlandC2<S>::value(at(1), h) == Approx(21.0 / 16 * 3 / 16));
  CHECK(pi * WendlandC4<S>::value(at(1), h) == Approx(495.0 / 256 / 64 * (35.0 / 12 + 4)));
  CHECK(pi * Poly6<S>::value(at(1), h) == Approx(315.0 / 64 / 512 * 27));  // H = 2: (4 - 1)^3 / 2^9
  CHECK(pi * Poly6<S>::from_squared(at(1), h) == Approx(315.0 / 64 / 512 * 27));
  CHECK(pi * Spiky<S>::value(at(0.5), h) == Approx(15.0 / 64 * 3.375));  // (2 - 0.5)^3 / 2^6
  CHECK(pi * Spiky<S>::derivative(at(0.5), h) == Approx(-45.0 / 64 * 2.25));
  // eq. 22 as printed: 15 / (2 pi H^3) (-r^3/(2 H^3) + r^2/H^2 + H/(2 r) - 1)
  CHECK(pi * MuellerViscosity<S>::value(at(0.5), h) ==
        Approx(15.0 / 16 * (-0.125 / 16 + 0.25 / 4 + 2 / (2 * 0.5) - 1)));
  CHECK(pi * MuellerViscosity<S>::laplacian(at(0.5), h) == Approx(45.0 / 64 * 1.5));
}

TEST_CASE("The viscosity kernel's Laplacian belongs to its value") {
  // in three dimensions (r W)'' / r, by central differences
  using Kernel = MuellerViscosity<double>;
  const double h = 0.005;
  for (const double q : {0.2, 0.5, 1.0, 1.7}) {
    const double r = q * h;
    const double d = 1e-3 * h;
    const auto times_radius = [h](double x) { return x * Kernel::value(x, h); };
    const double differences = (times_radius(r + d) - 2 * times_radius(r) + times_radius(r - d)) / (d * d * r);
    CHECK(Kernel::laplacian(r, h) == Approx(differences).epsilon(1e-4));
  }
  CHECK(Kernel::laplacian(2.1 * h, h) == 0);
}

TEMPLATE_TEST_CASE("A batch of distances gives the numbers that single distances give", "", CubicSpline<float>,
                   CubicSpline<double>, WendlandC2<float>, WendlandC2<double>, WendlandC4<float>, WendlandC4<double>,
                   Poly6<float>, Poly6<double>, Spiky<float>, Spiky<double>, MuellerViscosity<float>,
                   MuellerViscosity<double>) {
  using Scalar = typename TestType::Scalar;
  using Batch = decant::Batch<Scalar>;
  const Scalar h = Scalar(0.005);
  for (int first = 0; first < 64; ++first) {
    std::array<Scalar, Batch::width> radius;
    for (int lane = 0; lane < Batch::width; ++lane) {
      // 0 to 1.2 supports, neighboring lanes far apart
      radius[static_cast<std::size_t>(lane)] = h * Scalar(2.4) * Scalar((first + 23 * lane) % 64) / 63;
    }
    const Batch r = Batch::load(radius.data());
    const Batch value = TestType::value(r, h);
    const Batch derivative = TestType::derivative(r, h);
    const Batch over_radius = TestType::derivative_over_radius(r, h);
    for (int lane = 0; lane < Batch::width; ++lane) {
      const Scalar x = radius[static_cast<std::size_t>(lane)];
      // the compiler may contract a * b + c in one of the two and not in the other: a few roundings of the largest term
      const double few = 64.0 * std::numeric_limits<Scalar>::epsilon();
      const auto near = [few](Scalar expected, Scalar largest) {
        return Approx(expected).epsilon(few).margin(few * std::abs(static_cast<double>(largest)));
      };
      CHECK(value[lane] == near(TestType::value(x, h), 1 / (h * h * h)));
      CHECK(derivative[lane] == near(TestType::derivative(x, h), 1 / (h * h * h * h)));
      CHECK(over_radius[lane] == near(TestType::derivative_over_radius(x, h), 1 / (h * h * h * h * h)));
    }
  }
}
