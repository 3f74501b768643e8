// SPDX-License-Identifier: MIT
#include <decant/core/growable.hpp>

#include <cstdint>
#include <type_traits>
#include <utility>

#include "catch.hpp"

using decant::Growable;
using decant::Index;

TEMPLATE_TEST_CASE("Growable keeps its first columns and zeroes new ones", "", float, double) {
  Growable<TestType, 3> points;
  REQUIRE(points.count() == 0);
  REQUIRE(points.cols() == 0);
  points.set_count(2);
  points.col(1) << 1, 2, 3;
  points.set_count(1000);  // moves the memory
  REQUIRE(points.count() == 1000);
  REQUIRE(points.cols() == 1000);
  CHECK(points.col(0).isZero(0));
  CHECK(points.col(1) == decant::Vector3<TestType>(1, 2, 3));
  CHECK(points.rightCols(998).isZero(0));

  points.set_count(2);
  REQUIRE(points.cols() == 2);
  CHECK(points.col(1) == decant::Vector3<TestType>(1, 2, 3));
  points.col(1).setConstant(7);
  points.set_count(1);
  points.set_count(2);  // what was cut off does not come back
  CHECK(points.col(1).isZero(0));
}

TEMPLATE_TEST_CASE("Growable with one row is a vector", "", float, double, std::uint32_t) {
  Growable<TestType, 1> mass;
  mass.set_count(3);
  mass[2] = TestType(5);
  REQUIRE(mass.size() == 3);
  REQUIRE(mass.cols() == 1);
  CHECK(mass.sum() == TestType(5));
  const auto& read_only = mass;
  CHECK(read_only[2] == TestType(5));
}

TEST_CASE("Growable does not move its memory up to what was reserved") {
  Growable<double, 3> points;
  points.reserve(100);
  points.set_count(1);
  const double* before = points.data();
  points.col(0) << 1, 2, 3;
  points.set_count(100);
  CHECK(points.data() == before);
  points.reserve(100000);  // the view follows the memory
  CHECK(points.col(0) == decant::Vector3<double>(1, 2, 3));
}

TEST_CASE("Growable copies by value and keeps its capacity") {
  Growable<double, 3> a;
  a.set_count(2);
  a << 1, 2, 3, 4, 5, 6;
  Growable<double, 3> b(a);
  REQUIRE(b == a);
  CHECK(b.data() != a.data());
  b(0, 0) = 9;
  CHECK(a(0, 0) == 1);

  Growable<double, 3> c;
  c.set_count(50);
  const double* before = c.data();
  c = a;
  REQUIRE(c.count() == 2);
  CHECK(c == a);
  CHECK(c.data() == before);  // snapshots are restored without an allocation
  const auto& same = c;
  c = same;
  CHECK(c == a);
}

TEST_CASE("Growable moves its memory and leaves a valid rest") {
  Growable<double, 3> a;
  a.set_count(2);
  a << 1, 2, 3, 4, 5, 6;
  const Growable<double, 3> copy(a);
  const double* memory = a.data();
  static_assert(std::is_nothrow_move_constructible_v<Growable<double, 3>>);
  Growable<double, 3> b(std::move(a));
  CHECK(b.data() == memory);
  CHECK(b == copy);
  CHECK(a.cols() == 0);  // NOLINT(bugprone-use-after-move): that it may be used again is what is tested
  a.set_count(1);
  CHECK(a.isZero(0));

  a = std::move(b);
  CHECK(a.data() == memory);
  CHECK(a == copy);
  CHECK(b.cols() == b.count());  // NOLINT(bugprone-use-after-move)
}

TEST_CASE("Growable takes the size of an expression that is assigned to it") {
  Growable<double, 3> points;
  points = decant::PointArray<double>::Constant(3, 4, 2.0);
  REQUIRE(points.count() == 4);
  CHECK(points.sum() == 24);
  Growable<double, 1> mass;
  mass = decant::ScalarArray<double>::LinSpaced(5, 0, 4);
  REQUIRE(mass.count() == 5);
  CHECK(mass[4] == 4);
}

TEST_CASE("Growable is seen without a copy where functions take views") {
  Growable<float, 3> points;
  points.set_count(3);
  const auto address = [](decant::ConstPointsView<float> view) { return view.data(); };
  CHECK(address(points) == points.data());
  const auto write = [](decant::PointsView<float> view) { view.setOnes(); };
  write(points);
  CHECK(points.sum() == 9);
}
