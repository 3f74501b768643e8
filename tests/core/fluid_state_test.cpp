// SPDX-License-Identifier: MIT
#include <decant/core/fluid_state.hpp>

#include "catch.hpp"

TEMPLATE_TEST_CASE("FluidState resizes all of its arrays alike", "", float, double) {
  decant::FluidState<TestType> fluid;
  CHECK(fluid.size() == 0);
  fluid.resize(4);
  REQUIRE(fluid.size() == 4);
  int arrays = 0;
  fluid.each([&arrays](const auto& array) {
    CHECK(array.count() == 4);
    ++arrays;
  });
  CHECK(arrays == 7);
  CHECK(fluid.position.cols() == 4);
  CHECK(fluid.velocity.cols() == 4);
  CHECK(fluid.mass.size() == 4);
  CHECK(fluid.density.size() == 4);
  CHECK(fluid.pressure.size() == 4);
  CHECK(fluid.id.size() == 4);
  CHECK(fluid.origin.size() == 4);

  fluid.mass[3] = TestType(0.5);
  fluid.id[3] = 17;
  fluid.resize(6);
  CHECK(fluid.mass[3] == TestType(0.5));
  CHECK(fluid.mass[5] == 0);
  CHECK(fluid.id[3] == 17);
}

TEST_CASE("FluidState reserves for all of its arrays") {
  decant::FluidState<float> fluid;
  fluid.reserve(1000);
  fluid.resize(1);
  const float* position = fluid.position.data();
  const float* pressure = fluid.pressure.data();
  const decant::Origin* origin = fluid.origin.data();
  fluid.resize(1000);
  CHECK(fluid.position.data() == position);
  CHECK(fluid.pressure.data() == pressure);
  CHECK(fluid.origin.data() == origin);
}

TEST_CASE("FluidState is a value") {
  decant::FluidState<double> fluid;
  fluid.resize(2);
  fluid.position.col(1) << 1, 2, 3;
  decant::FluidState<double> copy = fluid;
  fluid.position.setZero();
  CHECK(copy.position(2, 1) == 3);
  fluid = copy;
  CHECK(fluid.position(2, 1) == 3);
}
