// SPDX-License-Identifier: MIT
#pragma once

/// Mueller's (Desbrun's) spiky kernel, made for pressure: its gradient stays large as particles meet.

#include <numbers>

#include <decant/core/batch.hpp>
#include <decant/core/target.hpp>
#include <decant/kernel/concept.hpp>

namespace decant::inline DECANT_TARGET {

/// Spiky (Mueller, Charypar & Gross 2003, eq. 21): W = 15 / (pi H^6) (H - r)^3, dW/dr = -45 / (pi H^6) (H - r)^2. The
/// paper's h is the support radius; here it is H = 2 h, so that kernels can be exchanged at the same smoothing length.
/// The gradient has no limit at r = 0: derivative_over_radius divides by at least H / 1e6, so that the gradient of two
/// particles at one place is zero and that of any others is the paper's.
template <class ScalarType>
struct Spiky {
  using Scalar = ScalarType;
  static constexpr Scalar support_factor = 2;

  template <class Number>
  static Number value(Number r, Scalar h) noexcept {
    const Scalar support = support_factor * h;
    const Number t = maximum(1 - r * (1 / support), Number(0));
    return scale / (support * support * support) * (t * t * t);
  }

  template <class Number>
  static Number derivative(Number r, Scalar h) noexcept {
    const Scalar support = support_factor * h;
    const Number t = maximum(1 - r * (1 / support), Number(0));
    return -3 * scale / (support * support * support * support) * (t * t);
  }

  template <class Number>
  static Number derivative_over_radius(Number r, Scalar h) noexcept {
    const Scalar smallest = support_factor * h * Scalar(1e-6);
    return derivative(r, h) / maximum(r, Number(smallest));
  }

 private:
  static constexpr Scalar scale = 15 * std::numbers::inv_pi_v<Scalar>;
};

static_assert(SmoothingKernel<Spiky<float>>);
static_assert(SmoothingKernel<Spiky<double>>);

}  // namespace decant::inline DECANT_TARGET
