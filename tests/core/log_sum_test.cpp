// SPDX-License-Identifier: MIT
#include <decant/core/log_sum.hpp>

#include <cmath>
#include <limits>

#include "catch.hpp"

using decant::log_sum;

TEST_CASE("log sum: the logarithm of a sum, also of what no double holds") {
  const double nothing = -std::numeric_limits<double>::infinity();
  CHECK(log_sum(std::log(2.0), std::log(3.0)) == Approx(std::log(5.0)));
  CHECK(log_sum(std::log(3.0), std::log(2.0)) == log_sum(std::log(2.0), std::log(3.0)));
  CHECK(log_sum(-5000, -5000) == Approx(-5000 + std::log(2.0)));
  CHECK(log_sum(800, 790) == Approx(800 + std::log1p(std::exp(-10.0))));
  CHECK(log_sum(nothing, -3) == -3);
  CHECK(log_sum(-3, nothing) == -3);
  CHECK(log_sum(nothing, nothing) == nothing);
}
