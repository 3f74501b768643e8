// SPDX-License-Identifier: MIT
#include <decant/hypothesis/parameter_axis.hpp>

#include <limits>
#include <stdexcept>

#include "catch.hpp"

using decant::AxisScale;
using decant::ParameterAxis;

TEST_CASE("ParameterAxis: decades are equally long on a logarithmic scale") {
  const ParameterAxis viscosity{"viscosity", "m^2/s", 1e-6, 1e-3, AxisScale::Logarithmic, 7};
  CHECK(viscosity.at(0) == 1e-6);
  CHECK(viscosity.at(1) == 1e-3);
  CHECK(viscosity.at(1.0 / 3) == Approx(1e-5));
  CHECK(viscosity.share_of(1e-4) == Approx(2.0 / 3));
  CHECK(viscosity.grid_value(0) == 1e-6);
  CHECK(viscosity.grid_value(4) == Approx(1e-4));
  CHECK(viscosity.grid_value(6) == 1e-3);
  CHECK(viscosity.nearest(1.2e-5) == 2);
  // half a step is the geometric mean of grid values 1e-5 and 10^-4.5
  CHECK(viscosity.nearest(1.7e-5) == 2);
  CHECK(viscosity.nearest(1.8e-5) == 3);
}

TEST_CASE("ParameterAxis: differences count on a linear scale, and what is beyond the range is at its end") {
  const ParameterAxis tension{"tension", "N/m", -1, 3, AxisScale::Linear, 5};
  CHECK(tension.at(0.25) == Approx(0));
  CHECK(tension.share_of(2) == Approx(0.75));
  CHECK(tension.grid_value(3) == Approx(2));
  CHECK(tension.nearest(-7) == 0);
  CHECK(tension.nearest(7) == 4);
  CHECK(tension.share_of(-7) == 0);
  CHECK(tension.share_of(std::numeric_limits<double>::infinity()) == 1);
}

TEST_CASE("ParameterAxis: axes that make no sense are refused") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_NOTHROW(validate(ParameterAxis{"a", "", 0, 1}));
  CHECK_THROWS_AS(validate(ParameterAxis{"a", "", 1, 1}), std::invalid_argument);
  CHECK_THROWS_AS(validate(ParameterAxis{"a", "", nan, 1}), std::invalid_argument);
  CHECK_THROWS_AS(validate(ParameterAxis{"a", "", 0, nan}), std::invalid_argument);
  CHECK_THROWS_AS(validate(ParameterAxis{"a", "", 0, 1, AxisScale::Logarithmic}), std::invalid_argument);
  CHECK_THROWS_AS(validate(ParameterAxis{"a", "", 0, 1, AxisScale::Linear, 1}), std::invalid_argument);
}
