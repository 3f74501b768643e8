// SPDX-License-Identifier: MIT
#include <decant/core/compact.hpp>

#include <array>
#include <cmath>
#include <cstddef>

#include "catch.hpp"

using decant::Batch;
using decant::Compact;

TEMPLATE_TEST_CASE("Compact numbers come back to within their precision, in their order and with their signs", "",
                   float, double) {
  constexpr auto width = static_cast<std::size_t>(Batch<TestType>::width);
  constexpr bool half = sizeof(Compact<TestType>) < sizeof(TestType);
  std::array<TestType, width> numbers;
  std::array<Compact<TestType>, width> kept, kept_negative;
  for (int round = 0; round < 200; ++round) {
    for (std::size_t lane = 0; lane < width; ++lane) {
      const double size = std::exp2(-12 + (7 * round + 3 * static_cast<int>(lane)) % 20);
      numbers[lane] = static_cast<TestType>(size * (1 + std::abs(std::sin(round + 0.37 * static_cast<double>(lane)))));
    }
    const auto batch = Batch<TestType>::load(numbers.data());
    decant::store_compact(batch, kept.data());
    decant::store_compact(-batch, kept_negative.data());
    const auto back = decant::load_compact<TestType>(kept.data()),
               negative = decant::load_compact<TestType>(kept_negative.data());
    for (std::size_t lane = 0; lane < width; ++lane) {
      const auto at = static_cast<int>(lane);
      // binary16 keeps eleven bits and rounds to the nearest
      REQUIRE(std::abs(back[at] - numbers[lane]) <= (half ? TestType(0x1p-11) * numbers[lane] : TestType(0)));
      REQUIRE(negative[at] == -back[at]);
    }
  }
}
