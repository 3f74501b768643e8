// SPDX-License-Identifier: MIT
#pragma once

/// The laws of a SmoothingKernel.

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <type_traits>
#include <vector>

#include <decant/core/target.hpp>
#include <decant/kernel/concept.hpp>
#include <decant/testing/law.hpp>

namespace decant::inline DECANT_TARGET::testing {

/// Tries the laws of a kernel at one smoothing length [m]; run it at several, since a wrong power of h hides at h = 1.
/// Takes about a millisecond.
template <SmoothingKernel Kernel>
std::vector<Law> kernel_laws(typename Kernel::Scalar smoothing_length) {
  using Scalar = typename Kernel::Scalar;
  const Scalar h = smoothing_length;
  const Scalar support = static_cast<Scalar>(Kernel::support_factor) * h;
  const double rounding = std::numeric_limits<Scalar>::epsilon();
  const auto value = [h](Scalar r) { return static_cast<double>(Kernel::value(r, h)); };
  const auto slope = [h](Scalar r) { return static_cast<double>(Kernel::derivative(r, h)); };
  const auto slope_over_radius = [h](Scalar r) { return static_cast<double>(Kernel::derivative_over_radius(r, h)); };

  // Midpoint rule: no sample at r = 0, where a kernel may be steep, and an error far below the bounds.
  constexpr int samples = 20000;
  const double step = static_cast<double>(support) / samples;
  double integral = 0;
  double drop = 0;
  double steepest = 0;
  double not_positive = 0;
  double rising = 0;
  double inconsistent = 0;
  for (int k = 0; k < samples; ++k) {
    const double r = (k + 0.5) * step;
    const auto radius = static_cast<Scalar>(r);
    integral += 4 * std::numbers::pi * r * r * value(radius) * step;
    drop -= slope(radius) * step;
    steepest = std::max(steepest, -slope(radius));
    not_positive += r < 0.99 * static_cast<double>(support) && !(value(radius) > 0) ? 1 : 0;
    rising += slope(radius) <= 0 ? 0 : 1;
    if (r >= 1e-3 * static_cast<double>(support)) {
      const double difference = std::abs(r * slope_over_radius(radius) - slope(radius));
      inconsistent = difference <= inconsistent ? inconsistent : difference;  // keeps a NaN
    }
  }

  double against_differences = 0;
  for (int k = 1; k <= 400; ++k) {
    const double r = static_cast<double>(support) * (0.1 + 0.88 * k / 400);
    // Fourth-order central difference. The step is a compromise between rounding, which asks for more in float, and
    // the spline's knot and kernels that rise like 1/r, which ask for less; at these steps neither exceeds 5e-5.
    const double widest = (std::is_same_v<Scalar, float> ? 6e-3 : 2e-3) * static_cast<double>(support);
    const auto d = static_cast<Scalar>(std::min(widest, r / 30));
    const auto x = static_cast<Scalar>(r);
    const auto spread = [&](Scalar a) {
      return (value(x + a) - value(x - a)) / (static_cast<double>(x + a) - static_cast<double>(x - a));
    };
    const double error = std::abs((4 * spread(d) - spread(2 * d)) / 3 - slope(x));
    against_differences = error <= against_differences ? against_differences : error;
  }

  double beyond = 0;
  for (const double factor : {1.0 + 8 * rounding, 1.001, 2.0, 1000.0}) {
    const auto r = static_cast<Scalar>(factor * static_cast<double>(support));
    const bool zero =
        Kernel::value(r, h) == 0 && Kernel::derivative(r, h) == 0 && Kernel::derivative_over_radius(r, h) == 0;
    beyond += zero ? 0 : 1;
  }
  const bool finite_at_zero = std::isfinite(Kernel::value(Scalar(0), h)) &&
                              std::isfinite(Kernel::derivative_over_radius(Scalar(0), h)) &&
                              std::isfinite(Kernel::derivative(Scalar(0), h));

  return {
      {"the support factor is positive and finite", support > 0 && std::isfinite(support) ? 0.0 : 1.0, 0},
      {"the kernel integrates to one over space", std::abs(integral - 1), 1e-3},
      {"the kernel is positive inside 0.99 of its support (samples that are not)", not_positive, 0},
      {"value and derivatives are zero from the support on (radii where they are not)", beyond, 0},
      {"value and derivatives are finite at zero distance", finite_at_zero ? 0.0 : 1.0, 0},
      {"the derivative is never positive (samples where it is)", rising, 0},
      {"the derivative equals differences of the value, relative to the steepest slope", against_differences / steepest,
       1e-4},
      {"the derivative integrates to the value at zero distance, relative", std::abs(drop / value(Scalar(0)) - 1),
       1e-3},
      {"radius times derivative_over_radius is the derivative, relative to the steepest slope", inconsistent / steepest,
       16 * rounding},
  };
}

}  // namespace decant::inline DECANT_TARGET::testing
