// SPDX-License-Identifier: MIT
#pragma once

/// Counts allocations while `watching` is set: with the GNU C library whatever goes through malloc, so that Eigen's own
/// arrays show, too; elsewhere, and under the address sanitizer, which has a malloc of its own, operator new. Both are
/// replaced for the whole program, so one file per test program includes this. The functions only count, and only while
/// somebody watches, so that other tests of the program are not disturbed. They are not inlined: GCC would see malloc
/// meet delete and warn. Under Clang's thread sanitizer nothing is counted: its run time defines the same operators, so
/// that the program would not link, and its hook for malloc also counts what the OpenMP run time takes for each loop.

#include <atomic>
#include <cerrno>
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
#if __has_feature(address_sanitizer)
#define DECANT_TEST_HAS_ANOTHER_MALLOC
#endif
#elif defined(__SANITIZE_ADDRESS__)
#define DECANT_TEST_HAS_ANOTHER_MALLOC
#endif
#if DECANT_TEST_COUNTS_ALLOCATIONS && defined(__GLIBC__) && !defined(DECANT_TEST_HAS_ANOTHER_MALLOC)
#define DECANT_TEST_COUNTS_MALLOC
#endif

namespace decant_test {

inline std::atomic<bool> watching{false};
inline std::atomic<long> allocations{0};

inline void count_allocation() noexcept {
  if (watching.load(std::memory_order_relaxed)) {
    allocations.fetch_add(1, std::memory_order_relaxed);
  }
}

inline void* allocate(std::size_t size) {
  count_allocation();
  return std::malloc(size == 0 ? 1 : size);
}

inline void* allocate_aligned(std::size_t size, std::align_val_t alignment) {
  count_allocation();
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

#if defined(DECANT_TEST_COUNTS_MALLOC)
extern "C" {
// what the C library's own are called beside their public names
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* place, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

[[gnu::noinline]] void* malloc(std::size_t size) noexcept {
  decant_test::count_allocation();
  return __libc_malloc(size);
}
[[gnu::noinline]] void* calloc(std::size_t count, std::size_t size) noexcept {
  decant_test::count_allocation();
  return __libc_calloc(count, size);
}
[[gnu::noinline]] void* realloc(void* place, std::size_t size) noexcept {
  decant_test::count_allocation();
  return __libc_realloc(place, size);
}
[[gnu::noinline]] void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  decant_test::count_allocation();
  return __libc_memalign(alignment, size);
}
[[gnu::noinline]] int posix_memalign(void** place, std::size_t alignment, std::size_t size) noexcept {
  decant_test::count_allocation();
  *place = __libc_memalign(alignment, size);
  return *place == nullptr ? ENOMEM : 0;
}
}
#elif DECANT_TEST_COUNTS_ALLOCATIONS
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
