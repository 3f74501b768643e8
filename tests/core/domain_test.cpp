// SPDX-License-Identifier: MIT
#include <decant/core/domain.hpp>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "catch.hpp"

namespace {

using decant::Batch;
using decant::OpenDomain;
using decant::PeriodicDomain;
using decant::Vector3;

}  // namespace

TEMPLATE_TEST_CASE("Open space measures differences", "", float, double) {
  const OpenDomain open;
  CHECK(open.separation(1, TestType(3), TestType(5)) == -2);
  CHECK(open.separation(Vector3<TestType>(1, 2, 3), Vector3<TestType>(0, 5, 3)) == Vector3<TestType>(1, -3, 0));
  CHECK(open.wrap(Vector3<TestType>(1, -20, 3)) == Vector3<TestType>(1, -20, 3));
}

TEMPLATE_TEST_CASE("A periodic domain measures to the nearest image", "", float, double) {
  const PeriodicDomain<TestType> domain(Vector3<TestType>(1, 0, 2));
  const auto near = [](TestType value) { return Approx(value).margin(1e-4); };
  CHECK(domain.separation(0, TestType(0.9), TestType(0.1)) == near(TestType(-0.2)));
  CHECK(domain.separation(0, TestType(0.1), TestType(0.9)) == near(TestType(0.2)));
  CHECK(domain.separation(0, TestType(0.4), TestType(0.1)) == near(TestType(0.3)));
  CHECK(domain.separation(1, TestType(100), TestType(0)) == 100);  // open axis
  CHECK(domain.separation(2, TestType(1.5), TestType(0.1)) == near(TestType(-0.6)));
  CHECK(domain.separation(0, TestType(217.3), TestType(-40.1)) == near(TestType(0.4)));  // many periods apart
  CHECK(domain.separation(Vector3<TestType>(TestType(0.9), 7, TestType(0.2)), Vector3<TestType>(0, 0, TestType(1.9)))
            .isApprox(Vector3<TestType>(TestType(-0.1), 7, TestType(0.3)), TestType(1e-5)));
}

TEMPLATE_TEST_CASE("Separations are mutual to the bit for numbers and batches", "", float, double) {
  using B = Batch<TestType>;
  const PeriodicDomain<TestType> domain(Vector3<TestType>(TestType(0.7), 0, TestType(1.3)));
  for (int axis = 0; axis < 3; ++axis) {
    for (int k = 0; k < 200; ++k) {
      const TestType a = static_cast<TestType>(k) * TestType(0.0931);
      const TestType b = static_cast<TestType>((k * 37) % 200) * TestType(0.0517) - 3;
      const TestType ab = domain.separation(axis, a, b);
      CHECK(ab == -domain.separation(axis, b, a));
      CHECK(domain.separation(axis, B(a), B(b))[B::width - 1] == ab);
    }
  }
}

TEMPLATE_TEST_CASE("Wrapped positions lie in the first period", "", float, double) {
  const TestType tiny = std::numeric_limits<TestType>::denorm_min();
  const PeriodicDomain<TestType> domain(Vector3<TestType>(TestType(0.7), 0, 2));
  for (const TestType x : {TestType(0), TestType(0.7), TestType(-0.7), TestType(0.69999), -tiny, TestType(-1e-9),
                           TestType(123.456), TestType(-77.7), TestType(1e30), TestType(-1e30)}) {
    const Vector3<TestType> wrapped = domain.wrap(Vector3<TestType>(x, x, x));
    CHECK((wrapped[0] >= 0 && wrapped[0] < TestType(0.7)));
    CHECK(wrapped[1] == x);
    CHECK((wrapped[2] >= 0 && wrapped[2] < 2));
    if (std::abs(x) < 1000) {
      CHECK(domain.separation(0, wrapped[0], x) == Approx(0).margin(1e-4));
      CHECK(domain.separation(2, wrapped[2], x) == Approx(0).margin(1e-4));
    }
  }
  CHECK(std::isnan(domain.wrap(Vector3<TestType>::Constant(std::numeric_limits<TestType>::quiet_NaN()))[0]));
}

TEMPLATE_TEST_CASE("Periods that make no sense are refused", "", float, double) {
  const auto make = [](TestType period) { return PeriodicDomain<TestType>(Vector3<TestType>(0, period, 0)); };
  CHECK_THROWS_WITH(make(-1), decant_test::contains("PeriodicDomain: period [m] must be >= 0 and finite, got -1"));
  CHECK_THROWS_AS(make(std::numeric_limits<TestType>::quiet_NaN()), std::invalid_argument);
  CHECK_THROWS_AS(make(std::numeric_limits<TestType>::infinity()), std::invalid_argument);
}
