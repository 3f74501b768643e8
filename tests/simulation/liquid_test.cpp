// SPDX-License-Identifier: MIT
// The table of liquids against the literature it cites, and ranges of properties.

#include <decant/simulation/liquid.hpp>

#include <cmath>
#include <limits>

#include "catch.hpp"

using namespace decant;

TEST_CASE("liquid: the table's entries are valid and in the order of everyday experience") {
  for (const Liquid& liquid : {liquids::water, liquids::olive_oil, liquids::glycerol, liquids::honey, liquids::milk}) {
    CHECK_NOTHROW(validate(liquid));
    CHECK(liquid.density > 900);
    CHECK(liquid.density < 1500);
    CHECK(liquid.surface_tension > 0.02);
    CHECK(liquid.surface_tension <= 0.0728);
  }
  // IAPWS at 20 degrees Celsius
  CHECK(liquids::water.density == Approx(998.2).epsilon(1e-4));
  CHECK(liquids::water.kinematic_viscosity() == Approx(1.0034e-6).epsilon(1e-3));
  const double below_critical = 1 - 293.15 / 647.096;  // R1-76, equation 1
  CHECK(liquids::water.surface_tension ==
        Approx(0.2358 * std::pow(below_critical, 1.256) * (1 - 0.625 * below_critical)).epsilon(1e-4));
  // Bertsch 1983, whole and skim milk
  CHECK(liquids::milk.surface_tension == Approx(1e-3 * (1.8e-4 * 20 * 20 - 0.163 * 20 + 55.6)).epsilon(1e-3));
  CHECK(liquids::olive_oil.density < liquids::water.density);
  CHECK(liquids::water.density < liquids::milk.density);
  CHECK(liquids::milk.density < liquids::glycerol.density);
  CHECK(liquids::glycerol.density < liquids::honey.density);
  CHECK(liquids::water.dynamic_viscosity < liquids::milk.dynamic_viscosity);
  CHECK(liquids::milk.dynamic_viscosity < liquids::olive_oil.dynamic_viscosity);
  CHECK(liquids::olive_oil.dynamic_viscosity < liquids::glycerol.dynamic_viscosity);
  CHECK(liquids::glycerol.dynamic_viscosity < liquids::honey.dynamic_viscosity);
}

TEST_CASE("liquid: the default is water") {
  CHECK(Liquid{}.density == liquids::water.density);
  CHECK(Liquid{}.dynamic_viscosity == liquids::water.dynamic_viscosity);
  CHECK(Liquid{}.surface_tension == liquids::water.surface_tension);
}

TEST_CASE("liquid: properties out of range are refused") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  REQUIRE_THROWS_WITH(validate(Liquid{0, 1e-3, 0}), decant_test::contains("density [kg/m^3]"));
  REQUIRE_THROWS_WITH(validate(Liquid{nan, 1e-3, 0}), decant_test::contains("density [kg/m^3]"));
  REQUIRE_THROWS_WITH(validate(Liquid{1000, -1, 0}), decant_test::contains("viscosity [Pa s]"));
  REQUIRE_THROWS_WITH(validate(Liquid{1000, nan, 0}), decant_test::contains("viscosity [Pa s]"));
  REQUIRE_THROWS_WITH(validate(Liquid{1000, 0, -1}), decant_test::contains("surface tension [N/m]"));
  CHECK_NOTHROW(validate(Liquid{1000, 0, 0}));
}
