// SPDX-License-Identifier: MIT
#pragma once

/// Mueller's viscosity kernel, made for its Laplacian, which is positive everywhere: damping that never accelerates.

#include <numbers>

#include <decant/core/batch.hpp>
#include <decant/core/target.hpp>
#include <decant/kernel/concept.hpp>

namespace decant::inline DECANT_TARGET {

/// Mueller, Charypar & Gross 2003, eq. 22. The paper's h is the support radius; here it is H = 2 h, so that kernels can
/// be exchanged at the same smoothing length. With s = r/H the paper's polynomial factorises to
/// W = 15 / (4 pi H^3) (1 - s)^3 (1 + s) / s, dW/ds = -15 / (4 pi H^3) (1 - s)^2 (1 + 2 s + 3 s^2) / s^2.
/// As printed W has no value at r = 0. Below s = 0.01 it is continued here by the parabola in s that has the same value
/// and slope there: W(0) is finite, gradient and value agree, and the integral is short of one by 1.5e-4. W(0) is still
/// 76 times that of Poly6: do not sum densities with it. laplacian() is the paper's at every r.
template <class ScalarType>
struct MuellerViscosity {
  using Scalar = ScalarType;
  static constexpr Scalar support_factor = 2;

  template <class Number>
  static Number value(Number r, Scalar h) noexcept {
    const Scalar support = support_factor * h;
    const Number s = r * (1 / support);
    const Number clamped = maximum(s, Number(innermost));
    const Number t = maximum(1 - clamped, Number(0));
    const Number as_printed = t * t * t * (1 + clamped) / clamped;
    const Number parabola = slope_over_s(clamped) / 2 * (s * s - clamped * clamped);  // zero where nothing was clamped
    return scale / (support * support * support) * (as_printed + parabola);
  }

  template <class Number>
  static Number derivative(Number r, Scalar h) noexcept {
    return derivative_over_radius(r, h) * r;
  }

  template <class Number>
  static Number derivative_over_radius(Number r, Scalar h) noexcept {
    const Scalar support = support_factor * h;
    const Number clamped = maximum(r * (1 / support), Number(innermost));
    return scale / (support * support * support * support * support) * slope_over_s(clamped);
  }

  /// The Laplacian [1/m^5], 45 / (pi H^6) (H - r): what the viscosity force of the paper uses.
  template <class Number>
  static Number laplacian(Number r, Scalar h) noexcept {
    const Scalar support = support_factor * h;
    return 12 * scale / (support * support * support * support * support) * maximum(1 - r * (1 / support), Number(0));
  }

 private:
  // dW/ds / s without the scale
  template <class Number>
  static Number slope_over_s(Number s) noexcept {
    const Number t = maximum(1 - s, Number(0));
    return -(t * t) * (1 + s * (2 + 3 * s)) / (s * s * s);
  }

  static constexpr Scalar innermost = Scalar(0.01);
  static constexpr Scalar scale = 15 * std::numbers::inv_pi_v<Scalar> / 4;
};

static_assert(SmoothingKernel<MuellerViscosity<float>>);
static_assert(SmoothingKernel<MuellerViscosity<double>>);

}  // namespace decant::inline DECANT_TARGET
