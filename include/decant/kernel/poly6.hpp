// SPDX-License-Identifier: MIT
#pragma once

/// Mueller's poly6 kernel, made for densities: it takes the squared distance and no square root.

#include <numbers>

#include <decant/core/batch.hpp>
#include <decant/core/target.hpp>
#include <decant/kernel/concept.hpp>

namespace decant::inline DECANT_TARGET {

/// Poly6 (Mueller, Charypar & Gross 2003, eq. 20): W = 315 / (64 pi H^9) (H^2 - r^2)^3. The paper's h is the support
/// radius; here it is H = 2 h, so that kernels can be exchanged at the same smoothing length. Its gradient vanishes at
/// r = 0, which lets particles clump under pressure: the paper pairs it with Spiky.
template <class ScalarType>
struct Poly6 {
  using Scalar = ScalarType;
  static constexpr Scalar support_factor = 2;

  template <class Number>
  static Number value(Number r, Scalar h) noexcept {
    return from_squared(r * r, h);
  }

  /// The same for a squared distance [m^2].
  template <class Number>
  static Number from_squared(Number r_squared, Scalar h) noexcept {
    const Scalar support = support_factor * h;
    const Number t = inside(r_squared, support);
    return scale / (support * support * support) * (t * t * t);
  }

  template <class Number>
  static Number derivative(Number r, Scalar h) noexcept {
    return derivative_over_radius(r, h) * r;
  }

  template <class Number>
  static Number derivative_over_radius(Number r, Scalar h) noexcept {
    const Scalar support = support_factor * h;
    const Number t = inside(r * r, support);
    return -6 * scale / (support * support * support * support * support) * (t * t);
  }

 private:
  // 1 - (r/H)^2; the paper's H^9 would leave the range of float for a support of 10 um
  template <class Number>
  static Number inside(Number r_squared, Scalar support) noexcept {
    return maximum(1 - r_squared * (1 / (support * support)), Number(0));
  }

  static constexpr Scalar scale = 315 * std::numbers::inv_pi_v<Scalar> / 64;
};

static_assert(SmoothingKernel<Poly6<float>>);
static_assert(SmoothingKernel<Poly6<double>>);

}  // namespace decant::inline DECANT_TARGET
