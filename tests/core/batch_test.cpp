// SPDX-License-Identifier: MIT
#include <decant/core/batch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "catch.hpp"

namespace {

using decant::Batch;

// Numbers of both signs and many sizes, none of them equal, and their lanes in a batch.
template <class Scalar>
struct Samples {
  static constexpr int width = Batch<Scalar>::width;
  std::array<Scalar, 64> a, b, c;

  Samples() {
    std::uint32_t state = 7;
    const auto next = [&state] {
      state = state * 1664525u + 1013904223u;
      return static_cast<Scalar>(static_cast<double>(state) / 2147483648.0 - 1.0) * Scalar(37);
    };
    std::generate(a.begin(), a.end(), next);
    std::generate(b.begin(), b.end(), next);
    std::generate(c.begin(), c.end(), next);
  }

  // Applies a formula to batches and to numbers: the bits must agree.
  template <class Formula>
  bool agree(Formula formula) const {
    bool same = true;
    for (int start = 0; start + width <= 64; ++start) {
      const auto at = static_cast<std::size_t>(start);
      const Batch<Scalar> batch =
          formula(Batch<Scalar>::load(&a[at]), Batch<Scalar>::load(&b[at]), Batch<Scalar>::load(&c[at]));
      for (int lane = 0; lane < width; ++lane) {
        const auto k = static_cast<std::size_t>(start + lane);
        same = same && batch[lane] == formula(a[k], b[k], c[k]);
      }
    }
    return same;
  }
};

}  // namespace

TEMPLATE_TEST_CASE("A formula gives a batch what it gives each number", "", float, double) {
  const Samples<TestType> samples;
  const TestType two = 2;
  CHECK(samples.agree([](auto x, auto y, auto) { return x + y; }));
  CHECK(samples.agree([](auto x, auto y, auto) { return x - y; }));
  CHECK(samples.agree([](auto x, auto y, auto) { return x * y; }));
  CHECK(samples.agree([](auto x, auto y, auto) { return x / y; }));
  CHECK(samples.agree([](auto x, auto, auto) { return -x; }));
  CHECK(samples.agree([two](auto x, auto, auto) { return two / x; }));
  CHECK(samples.agree([two](auto x, auto, auto) { return x * two; }));
  CHECK(samples.agree([](auto x, auto y, auto z) {
    x += y;
    x *= z;
    x -= y;
    x /= z;
    return x;
  }));
  CHECK(samples.agree([](auto x, auto y, auto z) { return decant::multiply_add(x, y, z); }));
  CHECK(samples.agree([](auto x, auto y, auto z) { return decant::squared_length(x, y, z); }));
  CHECK(samples.agree([two](auto x, auto, auto) { return decant::minimum(two, decant::maximum(x, -two)); }));
  CHECK(samples.agree([two](auto x, auto y, auto) { return decant::select(x < y, two, x); }));
  CHECK(samples.agree([two](auto x, auto y, auto) { return decant::multiply_add(two, y, x); }));
  CHECK(samples.agree([](auto x, auto, auto) { return decant::absolute(x); }));
  CHECK(samples.agree([](auto x, auto, auto) { return decant::square_root(decant::absolute(x)); }));
  CHECK(samples.agree([](auto x, auto y, auto) { return decant::minimum(x, y); }));
  CHECK(samples.agree([](auto x, auto y, auto) { return decant::maximum(x, y); }));
  CHECK(samples.agree([](auto x, auto y, auto z) { return decant::select(x < y, y, z); }));
  CHECK(samples.agree([](auto x, auto y, auto z) { return decant::select(x > y, y, z); }));
  CHECK(samples.agree([](auto x, auto y, auto z) { return decant::select(x <= x, y, z); }));
  CHECK(samples.agree([](auto x, auto y, auto z) { return decant::select(x >= y, y, z); }));
  CHECK(samples.agree([](auto x, auto y, auto z) { return decant::select(x == x, y, z); }));
  CHECK(samples.agree([](auto x, auto y, auto z) { return decant::select(x != y, y, z); }));
}

TEMPLATE_TEST_CASE("Batches treat NaN and signed zeros as documented", "", float, double) {
  using B = Batch<TestType>;
  const TestType nan = std::numeric_limits<TestType>::quiet_NaN();
  CHECK(decant::minimum(B(nan), B(3))[0] == 3);
  CHECK(std::isnan(decant::minimum(B(3), B(nan))[0]));
  CHECK(decant::maximum(B(nan), B(3))[0] == 3);
  CHECK(std::isnan(decant::maximum(B(3), B(nan))[0]));
  CHECK(decant::minimum(nan, TestType(3)) == 3);
  CHECK(std::isnan(decant::maximum(TestType(3), nan)));
  CHECK_FALSE(any(B(nan) < B(3)));
  CHECK_FALSE(any(B(nan) >= B(3)));
  CHECK_FALSE(any(B(nan) == B(nan)));
  CHECK(all(B(nan) != B(nan)));
  CHECK(std::signbit((-B(0))[0]));
  CHECK(std::signbit(B(TestType(-0.0))[B::width - 1]));
}

TEMPLATE_TEST_CASE("Masks combine count and begin where they should", "", float, double) {
  using B = Batch<TestType>;
  using Mask = typename B::Mask;
  std::array<TestType, B::width> steps;
  std::iota(steps.begin(), steps.end(), TestType(0));
  const B lane = B::load(steps.data());
  for (int n = 0; n <= B::width + 3; ++n) {
    const Mask first = Mask::first(static_cast<std::size_t>(n));
    CHECK(first.bits() == (lane < static_cast<TestType>(n)).bits());
    CHECK(count(first) == std::min(n, B::width));
    CHECK(any(first) == (n > 0));
    CHECK(all(first) == (n >= B::width));
    CHECK((!first).bits() == (lane >= static_cast<TestType>(n)).bits());
    CHECK((first & (lane > TestType(0))).bits() == (first.bits() & ~1u));
    CHECK((first | (lane == TestType(0))).bits() == (first.bits() | 1u));
    CHECK(first[0] == (n > 0));
  }
  CHECK(all(Mask::first(std::size_t{1} << 40)));
}

TEMPLATE_TEST_CASE("Sum adds all lanes", "", float, double) {
  using B = Batch<TestType>;
  std::array<TestType, B::width> powers;
  for (int lane = 0; lane < B::width; ++lane) {
    powers[static_cast<std::size_t>(lane)] = static_cast<TestType>(1 << lane);  // every lane shows in the sum
  }
  CHECK(decant::sum(B::load(powers.data())) == static_cast<TestType>((1 << B::width) - 1));
  CHECK(decant::sum(TestType(5)) == 5);
}

namespace {

/// sum_each() of `count` batches against sum() of each, with lanes whose sum depends on the order of additions.
template <class Scalar, std::size_t count>
void sums_are_those_of_each() {
  using B = Batch<Scalar>;
  std::array<B, count> of;
  std::array<Scalar, B::width> lanes;
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t lane = 0; lane < lanes.size(); ++lane) {
      lanes[lane] =
          std::sin(static_cast<Scalar>(31 * k + 7 * lane + 1)) * static_cast<Scalar>(1 << (5 * lane + k) % 17);
    }
    of[k] = B::load(lanes.data());
  }
  const std::array<Scalar, count> sums = decant::sum_each(of);
  for (std::size_t k = 0; k < count; ++k) {
    INFO(k << " of " << count);
    CHECK(sums[k] == decant::sum(of[k]));
  }
}

}  // namespace

TEMPLATE_TEST_CASE("Sums of several batches have the bits of each batch's own", "", float, double) {
  sums_are_those_of_each<TestType, 1>();
  sums_are_those_of_each<TestType, 2>();
  sums_are_those_of_each<TestType, 3>();
  sums_are_those_of_each<TestType, 4>();
  sums_are_those_of_each<TestType, 8>();
  sums_are_those_of_each<TestType, 9>();
  sums_are_those_of_each<TestType, 12>();
}

TEMPLATE_TEST_CASE("The largest lane is found wherever it is", "", float, double) {
  using B = Batch<TestType>;
  for (std::size_t largest = 0; largest < static_cast<std::size_t>(B::width); ++largest) {
    std::array<TestType, B::width> lanes;
    lanes.fill(TestType(-3));
    lanes[largest] = TestType(-2);
    CHECK(decant::largest_lane(B::load(lanes.data())) == TestType(-2));
  }
  CHECK(decant::largest_lane(TestType(-4)) == TestType(-4));
}

TEMPLATE_TEST_CASE("Numbers side by side are read and written as one or as a batch", "", float, double) {
  using B = Batch<TestType>;
  std::vector<TestType> from(B::width + 2), to(from.size(), TestType(0));
  std::iota(from.begin(), from.end(), TestType(1));
  decant::store_as(decant::load_as<B>(&from[1]), &to[1]);
  CHECK(to[0] == 0);
  CHECK(std::equal(from.begin() + 1, from.end() - 1, to.begin() + 1));
  CHECK(to.back() == 0);
  decant::store_as(decant::load_as<TestType>(&from.back()), &to.back());
  CHECK(to.back() == from.back());
}

TEMPLATE_TEST_CASE("Gather reads what the indices name", "", float, double) {
  using B = Batch<TestType>;
  std::vector<TestType> records(4 * 50);
  std::iota(records.begin(), records.end(), TestType(1));
  std::vector<std::uint32_t> index(B::width);
  for (std::uint32_t lane = 0; lane < B::width; ++lane) {
    index[lane] = (lane * 31 + 7) % 50;
  }
  const B single = decant::gather(records.data(), index.data());
  const decant::Batch4<TestType> four = decant::gather4(records.data(), index.data());
  const decant::Batch3<TestType> three = decant::gather3(records.data(), index.data());
  for (int lane = 0; lane < B::width; ++lane) {
    const std::uint32_t j = index[static_cast<std::size_t>(lane)];
    CHECK(single[lane] == static_cast<TestType>(j + 1));
    CHECK(four.x[lane] == static_cast<TestType>(4 * j + 1));
    CHECK(four.y[lane] == static_cast<TestType>(4 * j + 2));
    CHECK(four.z[lane] == static_cast<TestType>(4 * j + 3));
    CHECK(four.w[lane] == static_cast<TestType>(4 * j + 4));
    CHECK(three.x[lane] == four.x[lane]);
    CHECK(three.y[lane] == four.y[lane]);
    CHECK(three.z[lane] == four.z[lane]);
  }
}

TEMPLATE_TEST_CASE("Compress keeps the chosen lanes in order", "", float, double) {
  using B = Batch<TestType>;
  std::array<TestType, B::width> numbers;
  std::array<std::uint32_t, B::width> index;
  std::iota(numbers.begin(), numbers.end(), TestType(10));
  std::iota(index.begin(), index.end(), 100u);
  for (std::uint32_t pattern = 0; pattern < 1024; ++pattern) {
    const std::uint32_t wanted = (pattern * 40503u >> 2) & ((1u << B::width) - 1);
    std::array<TestType, B::width> flag;
    for (int lane = 0; lane < B::width; ++lane) {
      flag[static_cast<std::size_t>(lane)] = (wanted >> lane & 1u) != 0 ? TestType(1) : TestType(0);
    }
    const auto mask = B::load(flag.data()) > TestType(0);
    std::array<TestType, B::width> packed;
    std::array<std::uint32_t, B::width> packed_index;
    const std::size_t kept = decant::compress(packed.data(), B::load(numbers.data()), mask);
    const std::size_t kept_index = decant::compress<TestType>(packed_index.data(), index.data(), mask);
    std::size_t next = 0;
    bool right = true;
    for (int lane = 0; lane < B::width; ++lane) {
      if ((wanted >> lane & 1u) != 0) {
        right = right && packed[next] == static_cast<TestType>(10 + lane) &&
                packed_index[next] == static_cast<std::uint32_t>(100 + lane);
        ++next;
      }
    }
    REQUIRE((right && kept == next && kept_index == next));
  }
}
