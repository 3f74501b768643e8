// SPDX-License-Identifier: MIT
#pragma once

/// Counts allocations while `watching` is set. Replaces operator new for the whole program, so one file per test program
/// includes it; what Eigen takes straight from malloc does not show. The operators only count, and only while somebody
/// watches, so that other tests of the program are not disturbed. They are not inlined: GCC would see malloc meet delete
/// and warn. Under Clang's thread sanitizer nothing is counted: its run time defines the same operators, so that the
/// program would not link, and its hook for malloc also counts what the OpenMP run time takes for each loop.

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

/// 1 where allocations are counted, else 0.
#define DECANT_TEST_COUNTS_ALLOCATIONS 1
#if defined(__has_feature)
#if __has_feature(thread_sanitizer)
#undef DECANT_TEST_COUNTS_ALLOCATIONS
#define DECANT_TEST_COUNTS_ALLOCATIONS 0
#endif
#endif

namespace decant_test {

inline std::atomic<bool> watching{false};
inline std::atomic<long> allocations{0};

inline void* allocate(std::size_t size) {
  if (watching.load(std::memory_order_relaxed)) {
    allocations.fetch_add(1, std::memory_order_relaxed);
  }
  return std::malloc(size == 0 ? 1 : size);
}

inline void* allocate_aligned(std::size_t size, std::align_val_t alignment) {
  if (watching.load(std::memory_order_relaxed)) {
    allocations.fetch_add(1, std::memory_order_relaxed);
  }
  const auto step = static_cast<std::size_t>(alignment);
  return std::aligned_alloc(step, (size + step - 1) / step * step);
}

inline void* or_throw(void* place) {
  if (place == nullptr) {
    throw std::bad_alloc();
  }
  return place;
}

}  // namespace decant_test

#if DECANT_TEST_COUNTS_ALLOCATIONS
[[gnu::noinline]] void* operator new(std::size_t size) { return decant_test::or_throw(decant_test::allocate(size)); }
[[gnu::noinline]] void* operator new[](std::size_t size) { return decant_test::or_throw(decant_test::allocate(size)); }
[[gnu::noinline]] void* operator new(std::size_t size, const std::nothrow_t&) noexcept { return decant_test::allocate(size); }
[[gnu::noinline]] void* operator new[](std::size_t size, const std::nothrow_t&) noexcept { return decant_test::allocate(size); }
[[gnu::noinline]] void* operator new(std::size_t size, std::align_val_t alignment) { return decant_test::or_throw(decant_test::allocate_aligned(size, alignment)); }
[[gnu::noinline]] void* operator new[](std::size_t size, std::align_val_t alignment) { return decant_test::or_throw(decant_test::allocate_aligned(size, alignment)); }
[[gnu::noinline]] void operator delete(void* place) noexcept { std::free(place); }
[[gnu::noinline]] void operator delete[](void* place) noexcept { std::free(place); }
[[gnu::noinline]] void operator delete(void* place, std::size_t) noexcept { std::free(place); }
[[gnu::noinline]] void operator delete[](void* place, std::size_t) noexcept { std::free(place); }
[[gnu::noinline]] void operator delete(void* place, std::align_val_t) noexcept { std::free(place); }
[[gnu::noinline]] void operator delete[](void* place, std::align_val_t) noexcept { std::free(place); }
[[gnu::noinline]] void operator delete(void* place, std::size_t, std::align_val_t) noexcept { std::free(place); }
[[gnu::noinline]] void operator delete[](void* place, std::size_t, std::align_val_t) noexcept { std::free(place); }
#endif
