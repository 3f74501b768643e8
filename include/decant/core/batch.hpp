// SPDX-License-Identifier: MIT
#pragma once

/// A handful of numbers that are computed with at once: the machine's vector registers behind ordinary operators, so
/// that a kernel or a pair force is written once, for one number or for a batch of them. The width follows what the
/// compiler may assume of the processor (AVX-512, AVX2, else 16 bytes: SSE2, NEON); no flags are required.

#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

namespace detail {

// Which registers there are. AVX-512 is used where the parts that all but the first processors have are there.
enum class VectorUnit { Avx512, Avx2, Basic };
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
inline constexpr VectorUnit vector_unit = VectorUnit::Avx512;
#elif defined(__AVX2__)
inline constexpr VectorUnit vector_unit = VectorUnit::Avx2;
#else
inline constexpr VectorUnit vector_unit = VectorUnit::Basic;
#endif

// GCC 12 warns of intrinsics whose untouched lanes are undefined; the zeroing forms compile to the same instructions.
inline constexpr int vector_bytes = vector_unit == VectorUnit::Avx512 ? 64 : vector_unit == VectorUnit::Avx2 ? 32 : 16;

template <class Scalar, int Width>
struct VectorOf {
  typedef Scalar Type __attribute__((vector_size(Width * sizeof(Scalar))));  // `using` cannot carry a dependent size
};

// Compares give one bit per lane with AVX-512, and one integer of all ones or zeros per lane elsewhere.
template <class Scalar, int Width>
using MaskLanes = std::conditional_t<
    Width * sizeof(Scalar) == 64, std::uint32_t,
    typename VectorOf<std::conditional_t<sizeof(Scalar) == 4, std::int32_t, std::int64_t>, Width>::Type>;

}  // namespace detail

/// True or false for each lane of a Batch. Combine with & | !; choose with select.
template <std::floating_point Scalar, int Width = detail::vector_bytes / static_cast<int>(sizeof(Scalar))>
struct BatchMask {
  using Lanes = detail::MaskLanes<Scalar, Width>;
  static constexpr bool one_bit_per_lane = std::is_same_v<Lanes, std::uint32_t>;
  static constexpr std::uint32_t all_bits = (std::uint32_t{1} << Width) - 1;

  Lanes lanes;

  /// True in the lanes [0, count); count may be anything from 0 to beyond the width.
  [[gnu::always_inline]] static BatchMask first(std::size_t count) noexcept {
    if constexpr (one_bit_per_lane) {
      return {count >= static_cast<std::size_t>(Width) ? all_bits : (std::uint32_t{1} << count) - 1};
    } else {
      return first(count, std::make_index_sequence<static_cast<std::size_t>(Width)>{});
    }
  }

  /// Bit k says what lane k says.
  [[gnu::always_inline]] std::uint32_t bits() const noexcept {
    if constexpr (one_bit_per_lane) {
      return lanes;
    } else {
#if defined(__AVX2__)
      if constexpr (sizeof(Lanes) == 32 && sizeof(Scalar) == 4) {
        return static_cast<std::uint32_t>(_mm256_movemask_ps(std::bit_cast<__m256>(lanes)));
      } else if constexpr (sizeof(Lanes) == 32) {
        return static_cast<std::uint32_t>(_mm256_movemask_pd(std::bit_cast<__m256d>(lanes)));
      }
#endif
#if defined(__SSE2__)
      if constexpr (sizeof(Lanes) == 16 && sizeof(Scalar) == 4) {
        return static_cast<std::uint32_t>(_mm_movemask_ps(std::bit_cast<__m128>(lanes)));
      } else if constexpr (sizeof(Lanes) == 16) {
        return static_cast<std::uint32_t>(_mm_movemask_pd(std::bit_cast<__m128d>(lanes)));
      }
#endif
      std::uint32_t result = 0;
      for (int lane = 0; lane < Width; ++lane) {
        result |= static_cast<std::uint32_t>(lanes[lane] & 1) << lane;
      }
      return result;
    }
  }

  bool operator[](int lane) const noexcept { return ((bits() >> lane) & 1u) != 0; }

  [[gnu::always_inline]] friend BatchMask operator&(BatchMask a, BatchMask b) noexcept { return {a.lanes & b.lanes}; }
  [[gnu::always_inline]] friend BatchMask operator|(BatchMask a, BatchMask b) noexcept { return {a.lanes | b.lanes}; }
  [[gnu::always_inline]] friend BatchMask operator!(BatchMask a) noexcept {
    if constexpr (one_bit_per_lane) {
      return {~a.lanes & all_bits};
    } else {
      return {~a.lanes};
    }
  }
  friend bool any(BatchMask a) noexcept { return a.bits() != 0; }
  friend bool all(BatchMask a) noexcept { return a.bits() == all_bits; }
  friend int count(BatchMask a) noexcept { return std::popcount(a.bits()); }

 private:
  template <std::size_t... lane>
  [[gnu::always_inline]] static BatchMask first(std::size_t count, std::index_sequence<lane...>) noexcept {
    using Integer = std::remove_cvref_t<decltype(Lanes{}[0])>;
    const Integer limit = static_cast<Integer>(count < sizeof...(lane) ? count : sizeof...(lane));
    return {Lanes{static_cast<Integer>(lane)...} < Lanes{((void)lane, limit)...}};
  }
};

/// `width` numbers that every operation treats alike. A scalar stands for a batch of equal numbers, so that formulas
/// mix the two. The width is part of the type: code built for different processors does not share symbols.
template <std::floating_point ScalarType, int Width = detail::vector_bytes / static_cast<int>(sizeof(ScalarType))>
struct Batch {
  using Scalar = ScalarType;
  using Mask = BatchMask<Scalar, Width>;
  using Vector = typename detail::VectorOf<Scalar, Width>::Type;
  static constexpr int width = Width;

  Vector v;

  Batch() = default;  // not initialised, as a plain number
  [[gnu::always_inline]] Batch(Vector vector) noexcept : v(vector) {}
  [[gnu::always_inline]] Batch(Scalar everywhere) noexcept
      : v([&]<std::size_t... lane>(std::index_sequence<lane...>) {
          return Vector{((void)lane, everywhere)...};
        }(std::make_index_sequence<static_cast<std::size_t>(Width)>{})) {}

  /// Reads `width` numbers; no alignment needed.
  [[gnu::always_inline]] static Batch load(const Scalar* from) noexcept {
    Batch result;
    std::memcpy(&result.v, from, sizeof(Vector));
    return result;
  }
  [[gnu::always_inline]] void store(Scalar* to) const noexcept { std::memcpy(to, &v, sizeof(Vector)); }

  Scalar operator[](int lane) const noexcept { return v[lane]; }

  [[gnu::always_inline]] friend Batch operator+(Batch a, Batch b) noexcept { return a.v + b.v; }
  [[gnu::always_inline]] friend Batch operator-(Batch a, Batch b) noexcept { return a.v - b.v; }
  [[gnu::always_inline]] friend Batch operator*(Batch a, Batch b) noexcept { return a.v * b.v; }
  [[gnu::always_inline]] friend Batch operator/(Batch a, Batch b) noexcept { return a.v / b.v; }
  [[gnu::always_inline]] friend Batch operator-(Batch a) noexcept { return -a.v; }
  [[gnu::always_inline]] Batch& operator+=(Batch b) noexcept {
    v += b.v;
    return *this;
  }
  [[gnu::always_inline]] Batch& operator-=(Batch b) noexcept {
    v -= b.v;
    return *this;
  }
  [[gnu::always_inline]] Batch& operator*=(Batch b) noexcept {
    v *= b.v;
    return *this;
  }
  [[gnu::always_inline]] Batch& operator/=(Batch b) noexcept {
    v /= b.v;
    return *this;
  }

  [[gnu::always_inline]] friend Mask operator<(Batch a, Batch b) noexcept {
#if defined(__AVX512F__)
    if constexpr (sizeof(Vector) == 64 && sizeof(Scalar) == 4) {
      return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_LT_OQ)};
    } else if constexpr (sizeof(Vector) == 64) {
      return {_mm512_cmp_pd_mask(a.v, b.v, _CMP_LT_OQ)};
    } else
#endif
    {
      return {a.v < b.v};
    }
  }
  [[gnu::always_inline]] friend Mask operator<=(Batch a, Batch b) noexcept {
#if defined(__AVX512F__)
    if constexpr (sizeof(Vector) == 64 && sizeof(Scalar) == 4) {
      return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_LE_OQ)};
    } else if constexpr (sizeof(Vector) == 64) {
      return {_mm512_cmp_pd_mask(a.v, b.v, _CMP_LE_OQ)};
    } else
#endif
    {
      return {a.v <= b.v};
    }
  }
  [[gnu::always_inline]] friend Mask operator==(Batch a, Batch b) noexcept {
#if defined(__AVX512F__)
    if constexpr (sizeof(Vector) == 64 && sizeof(Scalar) == 4) {
      return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_EQ_OQ)};
    } else if constexpr (sizeof(Vector) == 64) {
      return {_mm512_cmp_pd_mask(a.v, b.v, _CMP_EQ_OQ)};
    } else
#endif
    {
      return {a.v == b.v};
    }
  }
  [[gnu::always_inline]] friend Mask operator>(Batch a, Batch b) noexcept { return b < a; }
  [[gnu::always_inline]] friend Mask operator>=(Batch a, Batch b) noexcept { return b <= a; }
  [[gnu::always_inline]] friend Mask operator!=(Batch a, Batch b) noexcept { return !(a == b); }

  /// Per lane: mask ? a : b.
  [[gnu::always_inline]] friend Batch select(Mask mask, Batch a, Batch b) noexcept {
#if defined(__AVX512F__)
    if constexpr (sizeof(Vector) == 64 && sizeof(Scalar) == 4) {
      return _mm512_mask_blend_ps(static_cast<__mmask16>(mask.lanes), b.v, a.v);
    } else if constexpr (sizeof(Vector) == 64) {
      return _mm512_mask_blend_pd(static_cast<__mmask8>(mask.lanes), b.v, a.v);
    } else
#endif
    {
      return mask.lanes ? a.v : b.v;
    }
  }

  /// a < b ? a : b; b where one of the two is NaN.
  [[gnu::always_inline]] friend Batch minimum(Batch a, Batch b) noexcept {
#if defined(__AVX512F__)
    if constexpr (sizeof(Vector) == 64 && sizeof(Scalar) == 4) {
      return _mm512_maskz_min_ps(0xffff, a.v, b.v);
    } else if constexpr (sizeof(Vector) == 64) {
      return _mm512_maskz_min_pd(0xff, a.v, b.v);
    }
#endif
#if defined(__AVX2__)
    if constexpr (sizeof(Vector) == 32 && sizeof(Scalar) == 4) {
      return _mm256_min_ps(a.v, b.v);
    } else if constexpr (sizeof(Vector) == 32) {
      return _mm256_min_pd(a.v, b.v);
    }
#endif
    return select(a < b, a, b);
  }
  /// a > b ? a : b; b where one of the two is NaN.
  [[gnu::always_inline]] friend Batch maximum(Batch a, Batch b) noexcept {
#if defined(__AVX512F__)
    if constexpr (sizeof(Vector) == 64 && sizeof(Scalar) == 4) {
      return _mm512_maskz_max_ps(0xffff, a.v, b.v);
    } else if constexpr (sizeof(Vector) == 64) {
      return _mm512_maskz_max_pd(0xff, a.v, b.v);
    }
#endif
#if defined(__AVX2__)
    if constexpr (sizeof(Vector) == 32 && sizeof(Scalar) == 4) {
      return _mm256_max_ps(a.v, b.v);
    } else if constexpr (sizeof(Vector) == 32) {
      return _mm256_max_pd(a.v, b.v);
    }
#endif
    return select(a > b, a, b);
  }
  /// a * b + c, rounded once where the processor has such an instruction: the same for a number and for a batch.
  [[gnu::always_inline]] friend Batch multiply_add(Batch a, Batch b, Batch c) noexcept {
#if defined(__AVX512F__)
    if constexpr (sizeof(Vector) == 64 && sizeof(Scalar) == 4) {
      return _mm512_fmadd_ps(a.v, b.v, c.v);
    } else if constexpr (sizeof(Vector) == 64) {
      return _mm512_fmadd_pd(a.v, b.v, c.v);
    }
#endif
#if defined(__FMA__)
    if constexpr (sizeof(Vector) == 32 && sizeof(Scalar) == 4) {
      return _mm256_fmadd_ps(a.v, b.v, c.v);
    } else if constexpr (sizeof(Vector) == 32) {
      return _mm256_fmadd_pd(a.v, b.v, c.v);
    } else if constexpr (sizeof(Vector) == 16 && sizeof(Scalar) == 4) {
      return _mm_fmadd_ps(a.v, b.v, c.v);
    } else if constexpr (sizeof(Vector) == 16) {
      return _mm_fmadd_pd(a.v, b.v, c.v);
    }
#elif defined(__ARM_FEATURE_FMA)
    for (int lane = 0; lane < Width; ++lane) {
      c.v[lane] = std::fma(a.v[lane], b.v[lane], c.v[lane]);
    }
    return c;
#endif
    return a.v * b.v + c.v;
  }

  // What square_root and sum stand for.
  [[gnu::always_inline]] Batch root() const noexcept {
#if defined(__AVX512F__)
    if constexpr (sizeof(Vector) == 64 && sizeof(Scalar) == 4) {
      return _mm512_maskz_sqrt_ps(0xffff, v);
    } else if constexpr (sizeof(Vector) == 64) {
      return _mm512_maskz_sqrt_pd(0xff, v);
    }
#endif
#if defined(__AVX2__)
    if constexpr (sizeof(Vector) == 32 && sizeof(Scalar) == 4) {
      return _mm256_sqrt_ps(v);
    } else if constexpr (sizeof(Vector) == 32) {
      return _mm256_sqrt_pd(v);
    }
#endif
#if defined(__SSE2__)
    if constexpr (sizeof(Vector) == 16 && sizeof(Scalar) == 4) {
      return _mm_sqrt_ps(v);
    } else if constexpr (sizeof(Vector) == 16) {
      return _mm_sqrt_pd(v);
    }
#endif
    Batch result;
    for (int lane = 0; lane < Width; ++lane) {
      result.v[lane] = std::sqrt(v[lane]);
    }
    return result;
  }

  [[gnu::always_inline]] Scalar total() const noexcept {
#if defined(__AVX512F__)
    if constexpr (sizeof(Vector) == 64 && sizeof(Scalar) == 4) {
      const __m512d bits = _mm512_castps_pd(v);
      return (Batch<Scalar, Width / 2>(_mm256_castpd_ps(_mm512_maskz_extractf64x4_pd(0xf, bits, 0))) +
              Batch<Scalar, Width / 2>(_mm256_castpd_ps(_mm512_maskz_extractf64x4_pd(0xf, bits, 1))))
          .total();
    } else if constexpr (sizeof(Vector) == 64) {
      return (Batch<Scalar, Width / 2>(_mm512_maskz_extractf64x4_pd(0xf, v, 0)) +
              Batch<Scalar, Width / 2>(_mm512_maskz_extractf64x4_pd(0xf, v, 1)))
          .total();
    }
#endif
#if defined(__AVX2__)
    if constexpr (sizeof(Vector) == 32 && sizeof(Scalar) == 4) {
      return (Batch<Scalar, Width / 2>(_mm256_castps256_ps128(v)) +
              Batch<Scalar, Width / 2>(_mm256_extractf128_ps(v, 1)))
          .total();
    } else if constexpr (sizeof(Vector) == 32) {
      return (Batch<Scalar, Width / 2>(_mm256_castpd256_pd128(v)) +
              Batch<Scalar, Width / 2>(_mm256_extractf128_pd(v, 1)))
          .total();
    }
#endif
    if constexpr (Width == 4) {
      return (v[0] + v[2]) + (v[1] + v[3]);
    } else if constexpr (Width == 2) {
      return v[0] + v[1];
    }
  }
};

/// The same functions for single numbers, so that one formula serves both.
template <std::floating_point Scalar>
[[gnu::always_inline]] inline Scalar minimum(Scalar a, Scalar b) noexcept {
  return a < b ? a : b;
}
template <std::floating_point Scalar>
[[gnu::always_inline]] inline Scalar maximum(Scalar a, Scalar b) noexcept {
  return a > b ? a : b;
}
template <std::floating_point Scalar>
[[gnu::always_inline]] inline Scalar select(bool choose, Scalar a, Scalar b) noexcept {
  return choose ? a : b;
}
template <std::floating_point Scalar>
[[gnu::always_inline]] inline Scalar absolute(Scalar a) noexcept {
  return std::abs(a);
}
template <std::floating_point Scalar>
[[gnu::always_inline]] inline Scalar square_root(Scalar a) noexcept {
  return std::sqrt(a);
}
template <std::floating_point Scalar>
[[gnu::always_inline]] inline Scalar multiply_add(Scalar a, Scalar b, Scalar c) noexcept {
#if defined(__FMA__) || defined(__ARM_FEATURE_FMA)
  return std::fma(a, b, c);
#else
  return a * b + c;
#endif
}
template <std::floating_point Scalar>
[[gnu::always_inline]] inline Scalar sum(Scalar a) noexcept {
  return a;
}
template <std::floating_point Scalar>
[[gnu::always_inline]] inline Scalar largest_lane(Scalar a) noexcept {
  return a;
}
[[gnu::always_inline]] inline bool any(bool a) noexcept { return a; }

// The batches' own functions, under their qualified names too, and for a batch mixed with numbers.
namespace detail {
template <class... Numbers>
struct BatchAmong {};
template <class Scalar, int Width, class... Rest>
struct BatchAmong<Batch<Scalar, Width>, Rest...> {
  using Type = Batch<Scalar, Width>;
};
template <std::floating_point Scalar, class... Rest>
struct BatchAmong<Scalar, Rest...> : BatchAmong<Rest...> {};
}  // namespace detail
template <class A, class B, class Number = typename detail::BatchAmong<A, B>::Type>
[[gnu::always_inline]] inline Number minimum(A a, B b) noexcept {
  return minimum(Number(a), Number(b));
}
template <class A, class B, class Number = typename detail::BatchAmong<A, B>::Type>
[[gnu::always_inline]] inline Number maximum(A a, B b) noexcept {
  return maximum(Number(a), Number(b));
}
template <class Scalar, int Width, class A, class B>
[[gnu::always_inline]] inline Batch<Scalar, Width> select(BatchMask<Scalar, Width> mask, A a, B b) noexcept {
  return select(mask, Batch<Scalar, Width>(a), Batch<Scalar, Width>(b));
}
template <class A, class B, class C, class Number = typename detail::BatchAmong<A, B, C>::Type>
[[gnu::always_inline]] inline Number multiply_add(A a, B b, C c) noexcept {
  return multiply_add(Number(a), Number(b), Number(c));
}
template <class Scalar, int Width>
[[gnu::always_inline]] inline Batch<Scalar, Width> absolute(Batch<Scalar, Width> a) noexcept {
  return maximum(a, -a);
}
template <class Scalar, int Width>
[[gnu::always_inline]] inline Batch<Scalar, Width> square_root(Batch<Scalar, Width> a) noexcept {
  return a.root();
}
/// Sum of all lanes, in an order that depends on the width only.
template <class Scalar, int Width>
[[gnu::always_inline]] inline Scalar sum(Batch<Scalar, Width> a) noexcept {
  return a.total();
}
/// The largest of all lanes, none of which is NaN.
template <class Scalar, int Width>
[[gnu::always_inline]] inline Scalar largest_lane(Batch<Scalar, Width> a) noexcept {
  Scalar largest = a[0];
  for (int lane = 1; lane < Width; ++lane) {
    largest = a[lane] > largest ? a[lane] : largest;
  }
  return largest;
}

namespace detail {

// Adds the halves of every run of `length` lanes of a, then of b: the runs that are left are half as long, and those of
// both fit into one batch.
template <int length, class Scalar, int Width>
[[gnu::always_inline]] inline Batch<Scalar, Width> fold(Batch<Scalar, Width> a, Batch<Scalar, Width> b) noexcept {
  constexpr auto from = [](int lane) {
    const int within = lane % (Width / 2);
    return within / (length / 2) * length + within % (length / 2) + (lane < Width / 2 ? 0 : Width);
  };
  return [&]<int... lane>(std::integer_sequence<int, lane...>) {
#if defined(__clang__) || __GNUC__ >= 12
    return Batch<Scalar, Width>(__builtin_shufflevector(a.v, b.v, from(lane)...) +
                                __builtin_shufflevector(a.v, b.v, (from(lane) + length / 2)...));
#else
    const auto at = [&](int k) { return k < Width ? a.v[k] : b.v[k - Width]; };
    return Batch<Scalar, Width>(
        typename Batch<Scalar, Width>::Vector{(at(from(lane)) + at(from(lane) + length / 2))...});
#endif
  }
  (std::make_integer_sequence<int, Width>{});
}

template <int length, class Scalar, int Width, std::size_t count>
[[gnu::always_inline]] inline auto fold_all(const std::array<Batch<Scalar, Width>, count>& of) noexcept {
  if constexpr (length == 1) {
    return of;
  } else {
    std::array<Batch<Scalar, Width>, (count + 1) / 2> halves;
    [&]<std::size_t... k>(std::index_sequence<k...>) {
      ((halves[k] = fold<length>(of[2 * k], of[2 * k + 1 < count ? 2 * k + 1 : 2 * k])), ...);
    }
    (std::make_index_sequence<(count + 1) / 2>{});
    return fold_all<length / 2>(halves);
  }
}

}  // namespace detail

/// Sums of several batches, the same bits as `sum` of each: together they take a third of the time.
template <class Scalar, int Width, std::size_t count>
[[gnu::always_inline]] inline std::array<Scalar, count> sum_each(
    const std::array<Batch<Scalar, Width>, count>& of) noexcept {
  const auto folded = detail::fold_all<Width>(of);
  std::array<Scalar, count> sums;
  if constexpr (count <= static_cast<std::size_t>(Width)) {
    std::memcpy(sums.data(), &folded[0].v, sizeof(sums));
  } else {
    for (std::size_t k = 0; k < count; ++k) {
      sums[k] = folded[k / static_cast<std::size_t>(Width)][static_cast<int>(k % static_cast<std::size_t>(Width))];
    }
  }
  return sums;
}

/// Numbers that lie side by side, read as one number or as a batch of them.
template <class Number, std::floating_point Scalar>
[[gnu::always_inline]] inline Number load_as(const Scalar* from) noexcept {
  if constexpr (std::is_same_v<Number, Scalar>) {
    return *from;
  } else {
    return Number::load(from);
  }
}
template <std::floating_point Scalar>
[[gnu::always_inline]] inline void store_as(Scalar number, Scalar* to) noexcept {
  *to = number;
}
template <class Scalar, int Width>
[[gnu::always_inline]] inline void store_as(Batch<Scalar, Width> number, Scalar* to) noexcept {
  number.store(to);
}

/// x^2 + y^2 + z^2, always rounded in the same way: whoever compares distances with a radius agrees with all others.
template <class Number>
[[gnu::always_inline]] inline Number squared_length(Number x, Number y, Number z) noexcept {
  return multiply_add(z, z, multiply_add(y, y, x * x));
}

/// base[index[k]] for each lane k; indices below 2^31.
template <std::floating_point Scalar>
[[gnu::always_inline]] inline Batch<Scalar> gather(const Scalar* base, const std::uint32_t* index) noexcept {
  using B = Batch<Scalar>;
#if defined(__AVX512F__) && defined(__AVX512VL__)
  if constexpr (B::width == 16) {
    return _mm512_mask_i32gather_ps(_mm512_setzero_ps(), 0xffff, _mm512_loadu_si512(index), base, 4);
  } else if constexpr (sizeof(typename B::Vector) == 64) {
    const __m256i lanes = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(index));
    return _mm512_mask_i32gather_pd(_mm512_setzero_pd(), 0xff, lanes, base, 8);
  }
#endif
#if defined(__AVX2__)
  if constexpr (B::width == 8 && sizeof(Scalar) == 4) {
    const __m256i lanes = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(index));
    const __m256 everywhere = _mm256_castsi256_ps(_mm256_set1_epi32(-1));
    return _mm256_mask_i32gather_ps(_mm256_setzero_ps(), base, lanes, everywhere, 4);
  } else if constexpr (B::width == 4 && sizeof(Scalar) == 8) {
    const __m128i lanes = _mm_loadu_si128(reinterpret_cast<const __m128i*>(index));
    const __m256d everywhere = _mm256_castsi256_pd(_mm256_set1_epi32(-1));
    return _mm256_mask_i32gather_pd(_mm256_setzero_pd(), base, lanes, everywhere, 8);
  }
#endif
  return [&]<std::size_t... lane>(std::index_sequence<lane...>) { return B(typename B::Vector{base[index[lane]]...}); }
  (std::make_index_sequence<static_cast<std::size_t>(B::width)>{});
}

/// Four batches side by side: what the four fields of a record become.
template <class Scalar>
struct Batch4 {
  Batch<Scalar> x, y, z, w;
};

/// The records of four numbers at `records4 + 4 * index[k]`, field by field. Loads whole records and turns them in
/// registers, which takes about half the time of four gathers. 16 bytes (float) or 32 bytes (double) per record.
template <std::floating_point Scalar>
[[gnu::always_inline]] inline Batch4<Scalar> gather4(const Scalar* records4, const std::uint32_t* index) noexcept {
  using B = Batch<Scalar>;
  const auto record = [&](int k) __attribute__((always_inline)) {
    return records4 + 4 * static_cast<std::size_t>(index[k]);
  };
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
  if constexpr (B::width == 16) {
    // Rows hold the records k, k+4, k+8, k+12; turning each 4x4 quarter then leaves the lanes in their natural order.
    const auto row = [&](int k) __attribute__((always_inline)) {
      __m512 r = _mm512_maskz_broadcast_f32x4(0xffff, _mm_loadu_ps(record(k)));
      r = _mm512_mask_broadcast_f32x4(r, 0x00f0, _mm_loadu_ps(record(k + 4)));
      r = _mm512_mask_broadcast_f32x4(r, 0x0f00, _mm_loadu_ps(record(k + 8)));
      return _mm512_mask_broadcast_f32x4(r, 0xf000, _mm_loadu_ps(record(k + 12)));
    };
    const __m512 r0 = row(0), r1 = row(1), r2 = row(2), r3 = row(3);
    const __m512d xy01 = _mm512_castps_pd(_mm512_maskz_unpacklo_ps(0xffff, r0, r1)),
                  zw01 = _mm512_castps_pd(_mm512_maskz_unpackhi_ps(0xffff, r0, r1));
    const __m512d xy23 = _mm512_castps_pd(_mm512_maskz_unpacklo_ps(0xffff, r2, r3)),
                  zw23 = _mm512_castps_pd(_mm512_maskz_unpackhi_ps(0xffff, r2, r3));
    return {B(_mm512_castpd_ps(_mm512_maskz_unpacklo_pd(0xff, xy01, xy23))),
            B(_mm512_castpd_ps(_mm512_maskz_unpackhi_pd(0xff, xy01, xy23))),
            B(_mm512_castpd_ps(_mm512_maskz_unpacklo_pd(0xff, zw01, zw23))),
            B(_mm512_castpd_ps(_mm512_maskz_unpackhi_pd(0xff, zw01, zw23)))};
  } else if constexpr (sizeof(typename B::Vector) == 64) {
    const auto row = [&](int k) __attribute__((always_inline)) {
      const __m512d lower = _mm512_maskz_broadcast_f64x4(0xff, _mm256_loadu_pd(record(k)));
      return _mm512_mask_broadcast_f64x4(lower, 0xf0, _mm256_loadu_pd(record(k + 4)));
    };
    const __m512d r0 = row(0), r1 = row(1), r2 = row(2), r3 = row(3);
    const __m512d xz01 = _mm512_maskz_unpacklo_pd(0xff, r0, r1), yw01 = _mm512_maskz_unpackhi_pd(0xff, r0, r1);
    const __m512d xz23 = _mm512_maskz_unpacklo_pd(0xff, r2, r3), yw23 = _mm512_maskz_unpackhi_pd(0xff, r2, r3);
    const __m512i front = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13),
                  back = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
    return {B(_mm512_permutex2var_pd(xz01, front, xz23)), B(_mm512_permutex2var_pd(yw01, front, yw23)),
            B(_mm512_permutex2var_pd(xz01, back, xz23)), B(_mm512_permutex2var_pd(yw01, back, yw23))};
  }
#endif
#if defined(__AVX2__)
  if constexpr (B::width == 8 && sizeof(Scalar) == 4) {
    const auto row = [&](int k) __attribute__((always_inline)) {
      return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(record(k))), _mm_loadu_ps(record(k + 4)), 1);
    };
    const __m256 r0 = row(0), r1 = row(1), r2 = row(2), r3 = row(3);
    const __m256d xy01 = _mm256_castps_pd(_mm256_unpacklo_ps(r0, r1)),
                  zw01 = _mm256_castps_pd(_mm256_unpackhi_ps(r0, r1));
    const __m256d xy23 = _mm256_castps_pd(_mm256_unpacklo_ps(r2, r3)),
                  zw23 = _mm256_castps_pd(_mm256_unpackhi_ps(r2, r3));
    return {B(_mm256_castpd_ps(_mm256_unpacklo_pd(xy01, xy23))), B(_mm256_castpd_ps(_mm256_unpackhi_pd(xy01, xy23))),
            B(_mm256_castpd_ps(_mm256_unpacklo_pd(zw01, zw23))), B(_mm256_castpd_ps(_mm256_unpackhi_pd(zw01, zw23)))};
  } else if constexpr (B::width == 4 && sizeof(Scalar) == 8) {
    const __m256d r0 = _mm256_loadu_pd(record(0)), r1 = _mm256_loadu_pd(record(1));
    const __m256d r2 = _mm256_loadu_pd(record(2)), r3 = _mm256_loadu_pd(record(3));
    const __m256d xz01 = _mm256_unpacklo_pd(r0, r1), yw01 = _mm256_unpackhi_pd(r0, r1);
    const __m256d xz23 = _mm256_unpacklo_pd(r2, r3), yw23 = _mm256_unpackhi_pd(r2, r3);
    return {B(_mm256_permute2f128_pd(xz01, xz23, 0x20)), B(_mm256_permute2f128_pd(yw01, yw23, 0x20)),
            B(_mm256_permute2f128_pd(xz01, xz23, 0x31)), B(_mm256_permute2f128_pd(yw01, yw23, 0x31))};
  }
#endif
#if defined(__SSE2__)
  if constexpr (B::width == 4 && sizeof(Scalar) == 4) {
    const __m128 r0 = _mm_loadu_ps(record(0)), r1 = _mm_loadu_ps(record(1));
    const __m128 r2 = _mm_loadu_ps(record(2)), r3 = _mm_loadu_ps(record(3));
    const __m128 xy01 = _mm_unpacklo_ps(r0, r1), zw01 = _mm_unpackhi_ps(r0, r1);
    const __m128 xy23 = _mm_unpacklo_ps(r2, r3), zw23 = _mm_unpackhi_ps(r2, r3);
    return {B(_mm_movelh_ps(xy01, xy23)), B(_mm_movehl_ps(xy23, xy01)), B(_mm_movelh_ps(zw01, zw23)),
            B(_mm_movehl_ps(zw23, zw01))};
  }
#endif
  Batch4<Scalar> result;
  for (int lane = 0; lane < B::width; ++lane) {
    const Scalar* const fields = record(lane);
    result.x.v[lane] = fields[0];
    result.y.v[lane] = fields[1];
    result.z.v[lane] = fields[2];
    result.w.v[lane] = fields[3];
  }
  return result;
}

/// Three batches side by side: a vector in space per lane.
template <class Scalar>
struct Batch3 {
  Batch<Scalar> x, y, z;
};

/// The first three fields of gather4.
template <std::floating_point Scalar>
[[gnu::always_inline]] inline Batch3<Scalar> gather3(const Scalar* records4, const std::uint32_t* index) noexcept {
  const Batch4<Scalar> all = gather4(records4, index);
  return {all.x, all.y, all.z};
}

namespace detail {

#if defined(__AVX2__)
// Entry m lists the set bits of m, one per byte, lowest first.
inline constexpr auto set_bits_of_byte = [] {
  struct {
    std::uint64_t lanes[256];
  } table{};
  for (int mask = 0; mask < 256; ++mask) {
    int filled = 0;
    for (int bit = 0; bit < 8; ++bit) {
      if ((mask >> bit & 1) != 0) {
        table.lanes[mask] |= static_cast<std::uint64_t>(bit) << (8 * filled++);
      }
    }
  }
  return table;
}();

[[gnu::always_inline]] inline __m256i lanes_of(std::uint32_t mask) noexcept {
  return _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(set_bits_of_byte.lanes[mask])));
}
#endif

// compress with bit k of the mask for lane k.
template <std::floating_point Scalar>
[[gnu::always_inline]] inline std::size_t compress_bits(Scalar* to, Batch<Scalar> from, std::uint32_t bits) noexcept {
  using B = Batch<Scalar>;
#if defined(__AVX512F__)
  if constexpr (B::width == 16) {
    _mm512_storeu_ps(to, _mm512_maskz_compress_ps(static_cast<__mmask16>(bits), from.v));
    return static_cast<std::size_t>(std::popcount(bits));
  } else if constexpr (sizeof(typename B::Vector) == 64) {
    _mm512_storeu_pd(to, _mm512_maskz_compress_pd(static_cast<__mmask8>(bits), from.v));
    return static_cast<std::size_t>(std::popcount(bits));
  }
#endif
#if defined(__AVX2__)
  if constexpr (B::width == 8 && sizeof(Scalar) == 4) {
    _mm256_storeu_ps(to, _mm256_permutevar8x32_ps(from.v, lanes_of(bits)));
    return static_cast<std::size_t>(std::popcount(bits));
  }
#endif
  std::size_t filled = 0;
  for (int lane = 0; lane < B::width; ++lane) {
    to[filled] = from.v[lane];
    filled += bits >> lane & 1u;
  }
  return filled;
}

template <std::floating_point Scalar>
[[gnu::always_inline]] inline std::size_t compress_bits(std::uint32_t* to, const std::uint32_t* from,
                                                        std::uint32_t bits) noexcept {
  using B = Batch<Scalar>;
#if defined(__AVX512F__) && defined(__AVX512VL__)
  if constexpr (B::width == 16) {
    _mm512_storeu_si512(to, _mm512_maskz_compress_epi32(static_cast<__mmask16>(bits), _mm512_loadu_si512(from)));
    return static_cast<std::size_t>(std::popcount(bits));
  } else if constexpr (B::width == 8) {
    const __m256i lanes = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(to),
                        _mm256_maskz_compress_epi32(static_cast<__mmask8>(bits), lanes));
    return static_cast<std::size_t>(std::popcount(bits));
  }
#elif defined(__AVX2__)
  if constexpr (B::width == 8) {
    const __m256i lanes = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), _mm256_permutevar8x32_epi32(lanes, lanes_of(bits)));
    return static_cast<std::size_t>(std::popcount(bits));
  } else if constexpr (B::width == 4) {
    const __m256i lanes = _mm256_castsi128_si256(_mm_loadu_si128(reinterpret_cast<const __m128i*>(from)));
    const __m256i packed = _mm256_permutevar8x32_epi32(lanes, lanes_of(bits));
    _mm_storeu_si128(reinterpret_cast<__m128i*>(to), _mm256_castsi256_si128(packed));
    return static_cast<std::size_t>(std::popcount(bits));
  }
#endif
  std::size_t filled = 0;
  for (int lane = 0; lane < B::width; ++lane) {
    to[filled] = from[lane];
    filled += bits >> lane & 1u;
  }
  return filled;
}

}  // namespace detail

/// Writes the numbers of the chosen lanes side by side, in lane order, and returns how many there are. May write up to
/// a whole width of numbers: leave room behind.
template <std::floating_point Scalar>
[[gnu::always_inline]] inline std::size_t compress(Scalar* to, Batch<Scalar> from,
                                                   typename Batch<Scalar>::Mask mask) noexcept {
  return detail::compress_bits(to, from, mask.bits());
}

/// The same for the `width` indices at `from`, chosen by a mask of Batch<Scalar>.
template <std::floating_point Scalar>
[[gnu::always_inline]] inline std::size_t compress(std::uint32_t* to, const std::uint32_t* from,
                                                   BatchMask<Scalar> mask) noexcept {
  return detail::compress_bits<Scalar>(to, from, mask.bits());
}

}  // namespace decant::inline DECANT_TARGET
