// SPDX-License-Identifier: MIT
#include <decant/hypothesis/evaluation.hpp>

#include <cmath>
#include <limits>
#include <vector>

#include <decant/hypothesis/thread_executor.hpp>

#include "catch.hpp"

TEST_CASE("Evaluation: what is no misfit is an infinite one") {
  const double infinity = std::numeric_limits<double>::infinity();
  const auto misfit = [](decant::JobResult result) { return decant::Evaluation{{0.5}, std::move(result)}.misfit(); };
  CHECK(misfit({3, 1}) == 3);
  CHECK(misfit({0}) == 0);
  CHECK(misfit({}) == infinity);
  CHECK(misfit({-1, 3}) == infinity);
  CHECK(misfit({std::numeric_limits<double>::quiet_NaN()}) == infinity);
  CHECK(misfit({infinity}) == infinity);
}

TEST_CASE("evaluate_on: results in the order of points, and each is told") {
  for (const int threads : {1, 2, 4}) {
    decant::ThreadExecutor executor{{threads}};
    std::size_t told = 0;
    auto evaluate = decant::evaluate_on(
        executor, [](const std::vector<double>& point) { return decant::JobResult{point.at(0) * point.at(1)}; },
        [&](std::size_t, const decant::JobResult&) { ++told; });
    static_assert(decant::PointEvaluator<decltype(evaluate)>);
    const auto results = evaluate({{1, 2}, {3, 4}, {5, 6}});
    REQUIRE(results.size() == 3);
    CHECK(results[0].front() == 2);
    CHECK(results[1].front() == 12);
    CHECK(results[2].front() == 30);
    CHECK(told == 3);
    CHECK(evaluate({}).empty());
  }
}
