// SPDX-License-Identifier: MIT
#pragma once

/// Catch2 for every test, version 2.13 or 3, and the few names that differ between the two.

#include <string>

#if __has_include(<catch2/catch_all.hpp>)
#include <catch2/catch_all.hpp>
using Catch::Approx;  // version 2 has it in the global namespace already
#else
#include <catch2/catch.hpp>
#endif

namespace decant_test {

/// Matches text that contains `part`: REQUIRE_THROWS_WITH(call(), contains("must be > 0")).
inline auto contains(const std::string& part) {
#if __has_include(<catch2/catch_all.hpp>)
  return Catch::Matchers::ContainsSubstring(part);
#else
  return Catch::Matchers::Contains(part);
#endif
}

}  // namespace decant_test
