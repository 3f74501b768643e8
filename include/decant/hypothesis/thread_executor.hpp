// SPDX-License-Identifier: MIT
#pragma once

/// Runs jobs on the threads of this process.

#include <cstddef>
#include <mutex>
#include <vector>

#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/hypothesis/executor.hpp>

namespace decant::inline DECANT_TARGET {

/// An Executor of one process: whichever thread is free takes the next job. Give each job's simulations one thread.
struct ThreadExecutor {
  Threads threads{};

  template <class Work, class Done>
  std::vector<JobResult> run(std::size_t count, Work&& work, Done&& done) {
    std::vector<JobResult> results(count);
    std::mutex one_at_a_time;
    parallel_jobs(static_cast<Index>(count), threads, [&](Index job) {
      const auto k = static_cast<std::size_t>(job);
      results[k] = work(k);
      const std::lock_guard lock(one_at_a_time);
      done(k, results[k]);
    });
    return results;
  }

  std::size_t processes() const noexcept { return 1; }
  std::size_t process() const noexcept { return 0; }
};
static_assert(Executor<ThreadExecutor>);

}  // namespace decant::inline DECANT_TARGET
