// SPDX-License-Identifier: MIT
#pragma once

/// Numbers so close to zero that processors compute with them a hundred times more slowly.

#include <cstdint>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// While one of these exists, its thread takes subnormal numbers (below 1.2e-38 in single precision) for zero; then the
/// thread is as it was. Neighbours at the very edge of the support have kernel values of such a size, and liquid that
/// falls as one has velocity differences next to them: forces took four times as long. Does nothing on processors other
/// than x86-64 and 64-bit ARM.
class SubnormalsAsZero {
 public:
  SubnormalsAsZero() noexcept : before_(control()) { set_control(before_ | flush); }
  ~SubnormalsAsZero() { set_control(before_); }
  SubnormalsAsZero(const SubnormalsAsZero&) = delete;
  SubnormalsAsZero& operator=(const SubnormalsAsZero&) = delete;

 private:
#if defined(__SSE2__)
  using Control = unsigned int;
  static constexpr Control flush = 0x8040;  // MXCSR: results (bit 15) and operands (bit 6)
  static Control control() noexcept { return _mm_getcsr(); }
  static void set_control(Control value) noexcept { _mm_setcsr(value); }
#elif defined(__aarch64__)
  using Control = std::uint64_t;
  static constexpr Control flush = std::uint64_t{1} << 24;  // FPCR: both
  static Control control() noexcept {
    Control value;
    asm volatile("mrs %0, fpcr" : "=r"(value));
    return value;
  }
  static void set_control(Control value) noexcept { asm volatile("msr fpcr, %0" : : "r"(value)); }
#else
  using Control = unsigned int;
  static constexpr Control flush = 0;
  static Control control() noexcept { return 0; }
  static void set_control(Control) noexcept {}
#endif

  Control before_;
};

}  // namespace decant::inline DECANT_TARGET
