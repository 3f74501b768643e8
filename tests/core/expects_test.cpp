// SPDX-License-Identifier: MIT
#include <decant/core/expects.hpp>

#include <limits>
#include <stdexcept>

#include "catch.hpp"

TEST_CASE("expects names the thing, what was expected and what came") {
  CHECK_THROWS_AS(decant::expects(false, "PinholeCamera: fx [px]", "> 0", -3), std::invalid_argument);
  CHECK_THROWS_WITH(decant::expects(false, "PinholeCamera: fx [px]", "> 0", -3),
                    "PinholeCamera: fx [px] must be > 0, got -3");
  CHECK_THROWS_WITH(decant::expects(false, "Box: min_m [m]", "below max_m", 0.125),
                    "Box: min_m [m] must be below max_m, got 0.125");
  CHECK_THROWS_WITH(decant::expects(false, "Scene: composition", "known", "magic"),
                    "Scene: composition must be known, got magic");
}

TEST_CASE("expects refuses NaN in checks that are written as positive statements") {
  const double value = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(decant::expects(value > 0, "Liquid: density [kg/m^3]", "> 0", value),
                    decant_test::contains("must be > 0, got nan"));
}

TEST_CASE("expects lets pass what holds") { CHECK_NOTHROW(decant::expects(true, "x", "> 0", 1)); }
