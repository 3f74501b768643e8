// SPDX-License-Identifier: MIT
#pragma once

/// Wendland's C2 kernel: no clumping of particles, at the price of a polynomial of higher degree.

#include <numbers>

#include <decant/core/batch.hpp>
#include <decant/core/target.hpp>
#include <decant/kernel/concept.hpp>

namespace decant::inline DECANT_TARGET {

/// Wendland C2 in three dimensions (Wendland 1995; scaled as in Dehnen & Aly 2012, table 1), support 2 h. With q = r/h,
/// W = 21 / (16 pi h^3) (1 - q/2)^4 (2 q + 1), dW/dq = -105 / (16 pi h^3) q (1 - q/2)^3.
template <class ScalarType>
struct WendlandC2 {
  using Scalar = ScalarType;
  static constexpr Scalar support_factor = 2;

  template <class Number>
  static Number value(Number r, Scalar h) noexcept {
    const Number q = r * (1 / h);
    const Number t = maximum(1 - q / 2, Number(0));
    return scale / (h * h * h) * (t * t) * (t * t) * (2 * q + 1);
  }

  template <class Number>
  static Number derivative(Number r, Scalar h) noexcept {
    return derivative_over_radius(r, h) * r;
  }

  template <class Number>
  static Number derivative_over_radius(Number r, Scalar h) noexcept {
    const Number t = maximum(1 - r * (1 / h) / 2, Number(0));
    return -5 * scale / (h * h * h * h * h) * (t * t * t);
  }

 private:
  static constexpr Scalar scale = 21 * std::numbers::inv_pi_v<Scalar> / 16;
};

static_assert(SmoothingKernel<WendlandC2<float>>);
static_assert(SmoothingKernel<WendlandC2<double>>);

}  // namespace decant::inline DECANT_TARGET
