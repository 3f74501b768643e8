// SPDX-License-Identifier: MIT
#include <decant/hypothesis/executor.hpp>
#include <decant/hypothesis/thread_executor.hpp>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <stdexcept>
#include <vector>

#include "catch.hpp"

using decant::JobResult;
using decant::ThreadExecutor;

TEST_CASE("Threads run each job once and give results in order") {
  for (const int threads : {1, 2, 4}) {
    for (const std::size_t count : {std::size_t{0}, std::size_t{1}, std::size_t{7}}) {
      ThreadExecutor executor{{threads}};
      std::vector<std::atomic<int>> runs(count);
      std::vector<std::size_t> told;
      const auto results = executor.run(
          count,
          [&](std::size_t k) {
            ++runs[k];
            return JobResult(k, 1.0 / static_cast<double>(k + 1));  // as many numbers as its place
          },
          [&](std::size_t k, const JobResult& result) {
            told.push_back(k);
            CHECK(result.size() == k);
          });
      INFO(threads << " threads, " << count << " jobs");
      REQUIRE(results.size() == count);
      std::sort(told.begin(), told.end());
      REQUIRE(told.size() == count);
      for (std::size_t k = 0; k < count; ++k) {
        CHECK(runs[k] == 1);
        CHECK(told[k] == k);
        CHECK(results[k] == JobResult(k, 1.0 / static_cast<double>(k + 1)));
      }
    }
  }
}

TEST_CASE("A job that throws ends the run with what it threw") {
  for (const int threads : {1, 2}) {
    ThreadExecutor executor{{threads}};
    std::atomic<int> begun{0};
    const auto work = [&](std::size_t k) -> JobResult {
      ++begun;
      if (k == 3) {
        throw std::out_of_range("job 3");
      }
      return {};
    };
    CHECK_THROWS_AS(executor.run(1000, work, decant::tell_nobody), std::out_of_range);
    CHECK(begun < 1000);
  }
}
