// SPDX-License-Identifier: MIT
#include <decant/hypothesis/executor.hpp>
#include <decant/hypothesis/thread_executor.hpp>
#include <decant/testing/executor.hpp>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <stdexcept>
#include <thread>
#include <vector>

#include "catch.hpp"

using decant::JobResult;
using decant::ThreadExecutor;

TEST_CASE("Threads obey the laws of executors") {
  for (const int threads : {1, 2, 4}) {
    ThreadExecutor executor{{threads}};
    for (const decant::testing::Law& law : decant::testing::executor_laws(executor)) {
      INFO(threads << " threads, " << law.text());
      CHECK(law.holds());
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
      // else the other thread is through with all of them while this one waits for its core
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      return {};
    };
    CHECK_THROWS_AS(executor.run(1000, work, decant::tell_nobody), std::out_of_range);
    CHECK(begun < 1000);
  }
}
