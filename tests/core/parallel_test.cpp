// SPDX-License-Identifier: MIT
#include <decant/core/parallel.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <vector>

#include <decant/core/subnormal.hpp>

#include "catch.hpp"

using decant::Index;
using decant::Threads;

TEST_CASE("Every entry is visited once, by any number of threads") {
  for (const int threads : {1, 2, 4}) {
    for (const Index count : {Index(0), Index(1), Index(255), Index(256), Index(257), Index(10000)}) {
      std::vector<std::atomic<int>> visits(static_cast<std::size_t>(count));
      decant::parallel_for(count, Threads{threads}, [&visits](Index i) { ++visits[static_cast<std::size_t>(i)]; });
      Index once = 0;
      for (const auto& visit : visits) {
        once += visit == 1 ? 1 : 0;
      }
      INFO("threads " << threads << ", count " << count);
      CHECK(once == count);
    }
  }
}

TEST_CASE("Ranges depend on count and grain alone") {
  for (const int threads : {1, 2, 4}) {
    std::vector<Index> begin(4, -1);
    std::vector<Index> end(4, -1);
    decant::parallel_ranges(35, Threads{threads}, 10, [&](Index first, Index last) {
      begin[static_cast<std::size_t>(first / 10)] = first;
      end[static_cast<std::size_t>(first / 10)] = last;
    });
    CHECK(begin == std::vector<Index>{0, 10, 20, 30});
    CHECK(end == std::vector<Index>{10, 20, 30, 35});
  }
}

TEMPLATE_TEST_CASE("A reduction gives the same bits for any number of threads", "", float, double) {
  // terms of very different size: any other order of summing shows in the last bits
  const Index count = 30011;
  std::vector<TestType> terms(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < terms.size(); ++i) {
    terms[i] = static_cast<TestType>(std::sin(1.7 * static_cast<double>(i)) * std::exp(static_cast<double>(i % 13)));
  }
  const auto of_range = [&terms](Index begin, Index end) {
    TestType sum = 0;
    for (Index i = begin; i < end; ++i) {
      sum += terms[static_cast<std::size_t>(i)];
    }
    return sum;
  };
  const auto add = [](TestType a, TestType b) { return a + b; };
  decant::Reduction<TestType> reduction;
  const TestType alone = reduction.over(count, Threads{1}, TestType(0), of_range, add);
  double exact = 0;
  for (const TestType term : terms) {
    exact += static_cast<double>(term);
  }
  // rounding grows at most with the number of terms; each is below e^12
  CHECK(static_cast<double>(alone) ==
        Approx(exact).margin(static_cast<double>(std::numeric_limits<TestType>::epsilon()) * count * std::exp(12)));
  for (const int threads : {2, 3, 4}) {
    for (int repetition = 0; repetition < 20; ++repetition) {
      CHECK(reduction.over(count, Threads{threads}, TestType(0), of_range, add) == alone);
    }
  }
}

TEST_CASE("A reduction starts from its start and keeps the order of the ranges") {
  decant::Reduction<std::vector<Index>> reduction;
  const auto append = [](std::vector<Index> a, const std::vector<Index>& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
  };
  const auto firsts = reduction.over(
      3 * decant::default_grain + 1, Threads{4}, std::vector<Index>{-1},
      [](Index begin, Index) { return std::vector<Index>{begin}; }, append);
  const Index grain = decant::default_grain;
  CHECK(firsts == std::vector<Index>{-1, 0, grain, 2 * grain, 3 * grain});
  CHECK(reduction.over(
            0, Threads{2}, std::vector<Index>{-1}, [](Index, Index) { return std::vector<Index>{5}; }, append) ==
        std::vector<Index>{-1});
}

TEST_CASE("Threads are at least one, and one without OpenMP") {
  CHECK(Threads{}.resolved() >= 1);
  CHECK(Threads{-3}.resolved() >= 1);
#ifdef _OPENMP
  CHECK(Threads{3}.resolved() == 3);
#else
  CHECK(Threads{3}.resolved() == 1);
#endif
}

#ifdef _OPENMP
TEST_CASE("Loops run on the threads that were asked for") {
  std::atomic<int> most = 0;
  decant::parallel_ranges(4, Threads{4}, 1,
                          [&most](Index, Index) { most = std::max(most.load(), omp_get_num_threads()); });
  CHECK(most == 4);
  most = 0;
  decant::parallel_ranges(4, Threads{1}, 1,
                          [&most](Index, Index) { most = std::max(most.load(), omp_get_num_threads()); });
  CHECK(most == 1);
  // ranges of many rows or cells are few, and each of them is much
  decant::parallel_ranges(64, Threads{2}, 32,
                          [&most](Index, Index) { most = std::max(most.load(), omp_get_num_threads()); });
  CHECK(most == 2);
  most = 0;
  decant::parallel_for(2 * decant::least_per_thread - 1, Threads{2},
                       [&most](Index) { most = std::max(most.load(), omp_get_num_threads()); });
  CHECK(most == 1);  // so few particles are not worth a second thread
}
#endif

TEST_CASE("Loops take subnormal numbers for zero on all of their threads, and leave threads as they were") {
  const volatile float smallest = std::numeric_limits<float>::min(), half = 0.5F;
  const auto is_flushed = [&] { return smallest * half == 0; };
  REQUIRE_FALSE(is_flushed());
  for (const int threads : {1, 2, 4}) {
    std::atomic<int> flushed = 0;
    decant::parallel_ranges(8, Threads{threads}, 1, [&](Index, Index) { flushed += is_flushed() ? 1 : 0; });
    INFO("threads " << threads);
#if defined(__SSE2__) || defined(__aarch64__)
    CHECK(flushed == 8);
#endif
    CHECK_FALSE(is_flushed());
  }
  std::atomic<int> flushed = 0;
  {
    const decant::SubnormalsAsZero outer;
    { const decant::SubnormalsAsZero inner; }
    flushed = is_flushed() ? 1 : 0;
  }
#if defined(__SSE2__) || defined(__aarch64__)
  CHECK(flushed == 1);
#endif
  CHECK_FALSE(is_flushed());
}
