// SPDX-License-Identifier: MIT
#pragma once

/// The cubic spline, the smoothing kernel that most of the literature means and decant's default.

#include <numbers>

#include <decant/core/batch.hpp>
#include <decant/core/target.hpp>
#include <decant/kernel/concept.hpp>

namespace decant::inline DECANT_TARGET {

/// Cubic B-spline in three dimensions (Monaghan 1992, section 7), support 2 h. With q = r/h,
/// W = [(2 - q)+^3 - 4 (1 - q)+^3] / (4 pi h^3), where x+ = max(x, 0): the usual two pieces without a branch.
template <class ScalarType>
struct CubicSpline {
  using Scalar = ScalarType;
  static constexpr Scalar support_factor = 2;

  template <class Number>
  static Number value(Number r, Scalar h) noexcept {
    const Number q = r * (1 / h);
    const Number outer = maximum(2 - q, Number(0));
    const Number inner = maximum(1 - q, Number(0));
    return scale / (h * h * h) * (outer * outer * outer - 4 * inner * inner * inner);
  }

  template <class Number>
  static Number derivative(Number r, Scalar h) noexcept {
    const Number q = r * (1 / h);
    const Number outer = maximum(2 - q, Number(0));
    const Number inner = maximum(1 - q, Number(0));
    return 3 * scale / (h * h * h * h) * (4 * inner * inner - outer * outer);
  }

  template <class Number>
  static Number derivative_over_radius(Number r, Scalar h) noexcept {
    // dW/dq / q is -3 (2 - q)^2 / q from q = 1 on and 9 q - 12 below. Clamping q at 1 turns the first into the constant
    // -3 below, which leaves -9 (1 - q): nothing is divided by a small q and nothing cancels.
    const Number q = r * (1 / h);
    const Number far = maximum(q, Number(1));
    const Number outer = maximum(2 - far, Number(0));
    const Number inner = maximum(1 - q, Number(0));
    return -3 * scale / (h * h * h * h * h) * (outer * outer / far + 3 * inner);
  }

 private:
  static constexpr Scalar scale = std::numbers::inv_pi_v<Scalar> / 4;
};

static_assert(SmoothingKernel<CubicSpline<float>>);
static_assert(SmoothingKernel<CubicSpline<double>>);

}  // namespace decant::inline DECANT_TARGET
