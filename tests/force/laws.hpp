// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <decant/testing/law.hpp>

#include "catch.hpp"

namespace decant_test {

inline void check(const std::vector<decant::testing::Law>& laws) {
  for (const decant::testing::Law& law : laws) {
    INFO(law.text());
    CHECK(law.holds());
  }
}

}  // namespace decant_test
