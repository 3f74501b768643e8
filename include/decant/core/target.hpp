// SPDX-License-Identifier: MIT
#pragma once

/// Which processor this translation unit is compiled for. All of decant lives in an inline namespace of that name,
/// since widths of batches, what Compact numbers are and how Eigen aligns its matrices follow the compiler's flags: two
/// translation units with other flags each have a decant of their own, and handing an object from one to the other is
/// an error of the linker in place of one that shows when the program runs. Users write `decant::` as ever. Eigen has
/// no such guard: a program of which parts are compiled with other flags must align alike in all of them, by
/// -DEIGEN_MAX_ALIGN_BYTES=64 -DEIGEN_MAX_STATIC_ALIGN_BYTES=16.

#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
#define DECANT_TARGET avx512
#elif defined(__AVX512F__)
#define DECANT_TARGET avx512_in_part
#elif defined(__AVX2__) && defined(__FMA__) && defined(__F16C__)
#define DECANT_TARGET avx2
#elif defined(__AVX2__)
#define DECANT_TARGET avx2_in_part
#elif defined(__AVX__) && defined(__F16C__)
#define DECANT_TARGET avx_f16c
#elif defined(__AVX__)
#define DECANT_TARGET avx
#elif defined(__SSE4_2__)
#define DECANT_TARGET sse4
#elif defined(__SSE2__)
#define DECANT_TARGET sse2
#elif defined(__ARM_FEATURE_SVE)
#define DECANT_TARGET sve
#elif defined(__ARM_NEON)
#define DECANT_TARGET neon
#else
#define DECANT_TARGET scalar
#endif

// Headers write namespace decant::inline DECANT_TARGET; for those who look before the first of them:
namespace decant {
inline namespace DECANT_TARGET {}
}  // namespace decant
