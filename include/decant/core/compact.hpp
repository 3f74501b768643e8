// SPDX-License-Identifier: MIT
#pragma once

/// Numbers in half of the room, for what is computed once and read many times: sweeps over pairs wait for memory.

#include <concepts>
#include <cstdint>
#include <type_traits>

#include <decant/core/batch.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

#if defined(__AVX512F__) || defined(__F16C__)
inline constexpr bool has_half_precision = true;
#else
inline constexpr bool has_half_precision = false;  ///< converting one number at a time would cost more than it saves
#endif

/// What a float is kept as: IEEE 754 binary16, rounded to the nearest of 11 significant bits, from 6e-8 to 65504; where
/// the processor cannot convert a batch at once, and for double, the number itself.
template <std::floating_point Scalar>
using Compact = std::conditional_t<std::is_same_v<Scalar, float> && has_half_precision, std::uint16_t, Scalar>;

/// A batch from consecutive compact numbers.
template <std::floating_point Scalar>
[[gnu::always_inline]] inline Batch<Scalar> load_compact(const Compact<Scalar>* from) noexcept {
  using B = Batch<Scalar>;
  if constexpr (std::is_same_v<Compact<Scalar>, Scalar>) {
    return B::load(from);
  } else {
#if defined(__AVX512F__)
    if constexpr (B::width == 16) {
      return _mm512_maskz_cvtph_ps(0xffff, _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from)));
    }
#endif
#if defined(__F16C__)
    if constexpr (B::width == 8) {
      return _mm256_cvtph_ps(_mm_loadu_si128(reinterpret_cast<const __m128i*>(from)));
    } else if constexpr (B::width == 4) {
      return _mm_cvtph_ps(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(from)));
    }
#endif
  }
}

/// Writes all lanes to consecutive compact numbers. A number and its negative stay each other's negative.
template <std::floating_point Scalar>
[[gnu::always_inline]] inline void store_compact(Batch<Scalar> batch, Compact<Scalar>* to) noexcept {
  if constexpr (std::is_same_v<Compact<Scalar>, Scalar>) {
    batch.store(to);
  } else {
#if defined(__AVX512F__)
    if constexpr (Batch<Scalar>::width == 16) {
      constexpr int to_nearest = _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC;
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), _mm512_maskz_cvtps_ph(0xffff, batch.v, to_nearest));
      return;
    }
#endif
#if defined(__F16C__)
    if constexpr (Batch<Scalar>::width == 8) {
      _mm_storeu_si128(reinterpret_cast<__m128i*>(to), _mm256_cvtps_ph(batch.v, _MM_FROUND_TO_NEAREST_INT));
    } else if constexpr (Batch<Scalar>::width == 4) {
      _mm_storel_epi64(reinterpret_cast<__m128i*>(to), _mm_cvtps_ph(batch.v, _MM_FROUND_TO_NEAREST_INT));
    }
#endif
  }
}

}  // namespace decant::inline DECANT_TARGET
