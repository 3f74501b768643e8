// SPDX-License-Identifier: MIT
#pragma once

/// Wendland's C4 kernel: smoother than C2, for many neighbors per particle.

#include <numbers>

#include <decant/core/batch.hpp>
#include <decant/core/target.hpp>
#include <decant/kernel/concept.hpp>

namespace decant::inline DECANT_TARGET {

/// Wendland C4 in three dimensions (Wendland 1995; scaled as in Dehnen & Aly 2012, table 1), support 2 h. With q = r/h,
/// W = 495 / (256 pi h^3) (1 - q/2)^6 (35/12 q^2 + 3 q + 1), dW/dq = -1155 / (256 pi h^3) q (1 - q/2)^5 (5 q + 2).
template <class ScalarType>
struct WendlandC4 {
  using Scalar = ScalarType;
  static constexpr Scalar support_factor = 2;

  template <class Number>
  static Number value(Number r, Scalar h) noexcept {
    const Number q = r * (1 / h);
    const Number t = maximum(1 - q / 2, Number(0));
    return scale / (h * h * h) * (t * t) * (t * t) * (t * t) * ((Scalar(35) / 12 * q + 3) * q + 1);
  }

  template <class Number>
  static Number derivative(Number r, Scalar h) noexcept {
    return derivative_over_radius(r, h) * r;
  }

  template <class Number>
  static Number derivative_over_radius(Number r, Scalar h) noexcept {
    const Number q = r * (1 / h);
    const Number t = maximum(1 - q / 2, Number(0));
    return Scalar(-7) / 3 * scale / (h * h * h * h * h) * (t * t) * (t * t) * t * (5 * q + 2);
  }

 private:
  static constexpr Scalar scale = 495 * std::numbers::inv_pi_v<Scalar> / 256;
};

static_assert(SmoothingKernel<WendlandC4<float>>);
static_assert(SmoothingKernel<WendlandC4<double>>);

}  // namespace decant::inline DECANT_TARGET
