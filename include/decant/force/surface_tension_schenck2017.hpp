// SPDX-License-Identifier: MIT
#pragma once

/// The surface tension of Schenck and Fox 2017 as it is printed.

#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <vector>

#include <decant/core/batch.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Schenck and Fox 2017, "Reasoning About Liquids via Closed-Loop Simulation" (RSS), after Mueller et al. 2003, section
/// 3.3: the colour field c = sum_j V_j W_ij is one in the liquid and zero outside, its gradient n points into the
/// liquid, its Laplacian over |n| is the curvature, and
///   a_i = -(sigma / rho_i) (Laplacian c) n / |n|    where |n| exceeds a threshold, else 0.
/// The threshold is there because n / |n| is noise inside the liquid. What differs from SurfaceTension: forces are not
/// mutual, so a free drop gains momentum and drifts; the sum over a support that is cut off at the surface takes flat
/// surfaces for curved, so the pull is of the right direction but not of the right size. Walls count as liquid in n
/// only. Kept for comparison with the paper; take SurfaceTension for anything else.
template <class ScalarType>
struct SurfaceTensionSchenck2017 {
  using Scalar = ScalarType;

  Scalar surface_tension = Scalar(0.0728);  ///< sigma [N/m], >= 0
  /// On |n| times the support radius [-], >= 0; about 1 at a flat surface.
  Scalar normal_threshold = Scalar(0.3);

  template <class Step>
  void accumulate(const Step& step, PointArray<Scalar>& acceleration) noexcept {
    if (!(surface_tension > 0)) {
      return;
    }
    using Kernel = typename Step::Kernel;
    using B = Batch<Scalar>;
    const Index count = step.fluid.size();
    const Scalar h = step.smoothing_length;
    const Scalar threshold = normal_threshold / (static_cast<Scalar>(Kernel::support_factor) * h);
    volume_.resize(static_cast<std::size_t>(count));
    parallel_for(count, step.threads,
                 [&](Index i) { volume_[static_cast<std::size_t>(i)] = step.fluid.mass[i] / step.fluid.density[i]; });
    parallel_for(count, step.threads, [&](Index i) {
      B x(Scalar(0)), y(Scalar(0)), z(Scalar(0)), bend(Scalar(0));
      step.neighbors.for_each_batch(i, [&](const auto& pair) {
        const B r = square_root(pair.distance_squared);
        const B volume = gather(volume_.data(), pair.neighbor);
        const B slope = volume * Kernel::derivative_over_radius(r, h);
        x = multiply_add(slope, pair.x, x);
        y = multiply_add(slope, pair.y, y);
        z = multiply_add(slope, pair.z, z);
        bend += select(pair.valid, volume * laplacian<Kernel>(r, h), B(Scalar(0)));
      });
      const Vector3<Scalar> normal = Vector3<Scalar>(sum(x), sum(y), sum(z)) + Scalar(0.5) * step.walls.gradient.col(i);
      const Scalar steepness = normal.norm();
      if (steepness > threshold) {
        const Scalar own = volume_[static_cast<std::size_t>(i)] * 3 * Kernel::derivative_over_radius(Scalar(0), h);
        acceleration.col(i) -= surface_tension / step.fluid.density[i] * (sum(bend) + own) / steepness * normal;
      }
    });
  }

  template <class Step>
  Scalar largest_step(const Step& step) const noexcept {
    if (!(surface_tension > 0)) {
      return std::numeric_limits<Scalar>::infinity();
    }
    // a quarter of the shortest capillary wave's period over 2 pi
    const Scalar d = step.spacing;
    return Scalar(0.25) * std::sqrt(step.rest_density * d * d * d / (2 * std::numbers::pi_v<Scalar> * surface_tension));
  }

 private:
  /// W'' + 2 W'/r, with W'' = F + r F' and F = W'/r; F' by a difference, which is far above rounding.
  template <class Kernel>
  static Batch<Scalar> laplacian(Batch<Scalar> r, Scalar h) noexcept {
    using B = Batch<Scalar>;
    const Scalar width = Scalar(0.01) * h;
    const B near = maximum(r, B(2 * width));
    const B change =
        (Kernel::derivative_over_radius(near + width, h) - Kernel::derivative_over_radius(near - width, h)) /
        (2 * width);
    return 3 * Kernel::derivative_over_radius(r, h) + r * change;
  }

  std::vector<Scalar> volume_{};
};

}  // namespace decant::inline DECANT_TARGET
