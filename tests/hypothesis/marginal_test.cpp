// SPDX-License-Identifier: MIT

#include <cmath>
#include <limits>
#include <vector>

#include <decant/hypothesis/marginal.hpp>

#include "catch.hpp"

using namespace decant;

TEST_CASE("marginal: probabilities of hypotheses with one value are added up") {
  const double never = -std::numeric_limits<double>::infinity();
  const std::vector<double> value{2, 1, 2, 1, 3, 3}, probability{0.1, 0.3, 0.2, 0.15, 0.25, 0};
  std::vector<double> log_posterior;
  for (const double p : probability) {
    log_posterior.push_back(p > 0 ? std::log(p) - 2000 : never);  // smaller than any double
  }
  const Marginal result = marginal(value, log_posterior);
  REQUIRE(result.values == std::vector<double>{1, 2, 3});
  CHECK(result.log_density[0] + 2000 == Approx(std::log(0.45)));
  CHECK(result.log_density[1] + 2000 == Approx(std::log(0.3)));
  CHECK(result.log_density[2] + 2000 == Approx(std::log(0.25)));
  const std::vector<double> one{1}, impossible{never}, broken{std::nan("")}, none;
  CHECK(marginal(one, impossible).log_density[0] == never);
  CHECK_THROWS_WITH(marginal(one, broken), Catch::Contains("a number"));
  CHECK_THROWS_WITH(marginal(broken, one), Catch::Contains("finite"));
  CHECK_THROWS_WITH(marginal(one, none), Catch::Contains("that of values"));
  CHECK_THROWS_WITH(marginal(none, none), Catch::Contains("at least 1"));
}
