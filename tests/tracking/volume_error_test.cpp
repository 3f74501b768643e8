// SPDX-License-Identifier: MIT
#include <decant/tracking/volume_error.hpp>

#include <cmath>
#include <limits>

#include "catch.hpp"

using decant::VolumeError;

TEST_CASE("Volume error: in millilitres, from cubic metres") {
  VolumeError error;
  error.add(103e-6, 100e-6);  // + 3 ml
  error.add(94e-6, 100e-6);   // - 6 ml
  error.add(50e-6, 50e-6);
  error.add(51e-6, 50e-6);
  CHECK(error.count() == 4);
  CHECK(error.mean_ml() == Approx(-0.5));
  CHECK(error.mean_absolute_ml() == Approx(2.5));
  CHECK(error.rms_ml() == Approx(std::sqrt(46.0 / 4)));
  CHECK(error.largest_ml() == Approx(-6));
  CHECK(error.last_ml() == Approx(1));
}

TEST_CASE("Volume error: missing samples and failed estimates") {
  const double none = std::numeric_limits<double>::quiet_NaN();
  VolumeError error;
  CHECK(std::isnan(error.mean_ml()));
  CHECK(std::isnan(error.mean_absolute_ml()));
  CHECK(std::isnan(error.rms_ml()));
  CHECK(std::isnan(error.largest_ml()));
  CHECK(std::isnan(error.last_ml()));
  error.add(1e-4, none);
  error.add(none, none);
  CHECK(error.count() == 0);
  CHECK(error.failures() == 0);
  error.add(none, 1e-4);
  error.add(std::numeric_limits<double>::infinity(), 1e-4);
  CHECK(error.failures() == 2);
  error.add(2e-4, 1e-4);
  CHECK(error.count() == 1);
  CHECK(error.mean_ml() == Approx(100));
  error.add(1e-4, 1e-4);
  CHECK(error.largest_ml() == Approx(100));
  error.reset();
  CHECK(error.count() == 0);
  CHECK(error.failures() == 0);
  CHECK(std::isnan(error.rms_ml()));
}
