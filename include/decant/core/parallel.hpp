// SPDX-License-Identifier: MIT
#pragma once

/// Parallel loops over particles, the only place where OpenMP is spoken to. Without OpenMP everything runs on one
/// thread. Results never depend on the number of threads: loops write disjoint entries, and reductions add up partial
/// sums of fixed blocks in a fixed order.

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <vector>

#ifdef _OPENMP
#include <omp.h>
#endif

#include <decant/core/subnormal.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// How many threads a call may use; 0 means all that the machine offers.
struct Threads {
  int count = 0;

  /// The number that a loop gets: at least 1, and 1 without OpenMP.
  int resolved() const {
#ifdef _OPENMP
    return count > 0 ? count : omp_get_max_threads();
#else
    return 1;
#endif
  }
};

/// Calls f(begin, end) for consecutive ranges that cover [0, count). Ranges are of `grain` entries (the last may be
/// shorter) whatever the number of threads, and are shared out however few they are: a range should be worth some
/// microseconds, which is what waking a thread costs. f must not throw. It computes with SubnormalsAsZero, on any
/// number of threads.
template <class Function>
void parallel_ranges(Index count, Threads threads, Index grain, Function&& f) {
  const Index ranges = (count + grain - 1) / grain;
#ifdef _OPENMP
  const int workers = static_cast<int>(std::min<Index>(threads.resolved(), ranges));
  if (workers > 1) {
#pragma omp parallel num_threads(workers)
    {
      const SubnormalsAsZero quick;
#pragma omp for schedule(static)
      for (Index r = 0; r < ranges; ++r) {
        f(r * grain, std::min(count, (r + 1) * grain));
      }
    }
    return;
  }
#else
  (void)threads;
#endif
  const SubnormalsAsZero quick;
  for (Index r = 0; r < ranges; ++r) {
    f(r * grain, std::min(count, (r + 1) * grain));
  }
}

/// Particles per range: few enough to share 8,000 particles evenly, enough that starting a range costs nothing.
inline constexpr Index default_grain = 256;

/// Loops over fewer particles per thread than this are not shared out.
inline constexpr Index least_per_thread = 512;

/// As many threads as a loop over particles is worth.
inline Threads threads_for(Index particles, Threads threads) {
  return {static_cast<int>(std::clamp<Index>(particles / least_per_thread, 1, threads.resolved()))};
}

/// Calls f(i) for i in [0, count), particles, in parallel. f writes only what belongs to i, and must not throw.
template <class Function>
void parallel_for(Index count, Threads threads, Function&& f) {
  parallel_ranges(count, threads_for(count, threads), default_grain, [&f](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      f(i);
    }
  });
}

/// Calls f(k) for k in [0, count), pieces of work that take long and differ in how long: whichever thread is free takes
/// the next. f may throw: then no more begin, and of what was thrown that of the lowest k is thrown again when all that
/// run have ended.
template <class Function>
void parallel_jobs(Index count, Threads threads, Function&& f) {
  std::atomic<bool> failed{false};
  std::vector<std::exception_ptr> thrown(static_cast<std::size_t>(std::max<Index>(count, 0)));
  const auto guarded = [&](Index k) noexcept {
    if (!failed) {
      try {
        f(k);
      } catch (...) {
        thrown[static_cast<std::size_t>(k)] = std::current_exception();
        failed = true;
      }
    }
  };
#ifdef _OPENMP
  const int workers = static_cast<int>(std::min<Index>(threads.resolved(), count));
  if (workers > 1) {
#pragma omp parallel for schedule(dynamic, 1) num_threads(workers)
    for (Index k = 0; k < count; ++k) {
      guarded(k);
    }
  } else
#else
  (void)threads;
#endif
  {
    for (Index k = 0; k < count; ++k) {
      guarded(k);
    }
  }
  for (const std::exception_ptr& exception : thrown) {
    if (exception) {
      std::rethrow_exception(exception);
    }
  }
}

/// Scratch memory of reductions; keep one beside the data, so that nothing is allocated in a loop.
template <class Value>
class Reduction {
 public:
  /// combine(...combine(combine(start, f(range 0)), f(range 1))...): the same bits for any number of threads.
  template <class RangeFunction, class Combine>
  Value over(Index count, Threads threads, Value start, RangeFunction&& f, Combine&& combine) {
    const Index ranges = (count + default_grain - 1) / default_grain;
    partial_.resize(static_cast<std::size_t>(ranges));
    parallel_ranges(count, threads_for(count, threads), default_grain, [&](Index begin, Index end) {
      partial_[static_cast<std::size_t>(begin / default_grain)] = f(begin, end);
    });
    for (const Value& value : partial_) {
      start = combine(start, value);
    }
    return start;
  }

 private:
  std::vector<Value> partial_;
};

}  // namespace decant::inline DECANT_TARGET
