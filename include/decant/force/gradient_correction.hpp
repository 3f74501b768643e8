// SPDX-License-Identifier: MIT
#pragma once

/// What makes kernel gradients exact for velocities that vary linearly, whatever the arrangement of the particles.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <decant/boundary/wall_state.hpp>
#include <decant/core/batch.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// One symmetric matrix L_i per particle, close to the inverse of
///   A_i = sum_j V_j (-W'/r) r r^T + sum over walls of |grad s| a n n^T,    r = x_i - x_j
/// with the volumes V_j = m_j / rho_0 and, for each face of a wall, its distance a, its normal n and the gradient of
/// its share s (boundary/wall_function.hpp). sum_j V_j (v_j - v_i) . L_i grad W_ij is then the divergence of a linear
/// velocity field exactly (Bonet and Lok 1999, "Variational and momentum preservation aspects of SPH formulations",
/// CMAME 180). Uncorrected, a liquid of disordered particles takes shear for compression: its pressure then resists
/// shear, waves run too fast and die within a few periods.
///
/// With E = 1 - A the inverse is cut short to (1 + E)(1 + E^2) = A^-1 (1 - E^4): exact to a few per mille inside of a
/// disordered liquid, and at most 4 where a particle has hardly any neighbours and no inverse exists.
template <class ScalarType>
class GradientCorrection {
 public:
  using Scalar = ScalarType;

  /// For the particles, neighbours and walls of a sub-step; step is a StepView.
  template <class Step>
  void compute(const Step& step) noexcept {
    using B = Batch<Scalar>;
    const Index count = step.fluid.size();
    first_.resize(4 * static_cast<std::size_t>(count));
    second_.resize(4 * static_cast<std::size_t>(count));
    parallel_for(count, step.threads, [&](Index i) {
      const B zero(Scalar(0));
      B xx = zero, xy = zero, xz = zero, yy = zero, yz = zero, zz = zero;
      step.neighbors.for_each_batch(i, [&](const auto& pair) {
        const B slope = step.mass(pair.neighbor) * step.pairs.slope(pair.slot);
        const B x = slope * pair.x, y = slope * pair.y, z = slope * pair.z;
        xx = multiply_add(x, pair.x, xx);
        xy = multiply_add(x, pair.y, xy);
        xz = multiply_add(x, pair.z, xz);
        yy = multiply_add(y, pair.y, yy);
        yz = multiply_add(y, pair.z, yz);
        zz = multiply_add(z, pair.z, zz);
      });
      const Scalar volume = -1 / step.rest_density;
      const auto wall = step.walls.moment.col(i);
      const std::array<Scalar, 6> pairs = sum_each(std::array{xx, xy, xz, yy, yz, zz});
      set(i,
          shortened_inverse({volume * pairs[0] + wall[0], volume * pairs[1] + wall[1], volume * pairs[2] + wall[2],
                             volume * pairs[3] + wall[3], volume * pairs[4] + wall[4], volume * pairs[5] + wall[5]}));
    });
  }

  Index size() const noexcept { return static_cast<Index>(first_.size() / 4); }

  /// L_i times a gradient.
  [[gnu::always_inline]] Vector3<Scalar> apply(Index i, const Vector3<Scalar>& g) const noexcept {
    const Scalar* a = &first_[4 * static_cast<std::size_t>(i)];
    const Scalar* b = &second_[4 * static_cast<std::size_t>(i)];
    return {a[0] * g[0] + a[1] * g[1] + a[2] * g[2], a[1] * g[0] + b[0] * g[1] + b[1] * g[2],
            a[2] * g[0] + b[1] * g[1] + b[2] * g[2]};
  }

  /// The part of L_i times a wall's gradient that is along that gradient: pressure must not pull liquid along a wall,
  /// nor a wall that slides by compress it.
  Vector3<Scalar> at_wall(Index i, const Vector3<Scalar>& g) const noexcept {
    const Scalar squared = g.squaredNorm();
    return squared > 0 ? Vector3<Scalar>(g.dot(apply(i, g)) / squared * g) : g;
  }

  /// L_i times the gradient in each lane, rounded as by the function below: what two particles do to each other stays
  /// equal to the last bit.
  [[gnu::always_inline]] Batch3<Scalar> apply(Index i, const Batch3<Scalar>& g) const noexcept {
    using B = Batch<Scalar>;
    const Scalar* a = &first_[4 * static_cast<std::size_t>(i)];
    const Scalar* b = &second_[4 * static_cast<std::size_t>(i)];
    return product({B(a[0]), B(a[1]), B(a[2])}, {B(b[0]), B(b[1]), B(b[2])}, g);
  }

  /// L_j times a gradient for each lane's j.
  [[gnu::always_inline]] Batch3<Scalar> apply(const std::uint32_t* index, const Batch3<Scalar>& g) const noexcept {
    return product(gather3(first_.data(), index), gather3(second_.data(), index), g);
  }

 private:
  [[gnu::always_inline]] static Batch3<Scalar> product(const Batch3<Scalar>& a, const Batch3<Scalar>& b,
                                                       const Batch3<Scalar>& g) noexcept {
    return {multiply_add(a.z, g.z, multiply_add(a.y, g.y, a.x * g.x)),
            multiply_add(b.y, g.z, multiply_add(b.x, g.y, a.y * g.x)),
            multiply_add(b.z, g.z, multiply_add(b.y, g.y, a.z * g.x))};
  }

  /// A symmetric matrix.
  struct Symmetric {
    Scalar xx, xy, xz, yy, yz, zz;

    Scalar largest_row_sum() const noexcept {
      return std::max({std::abs(xx) + std::abs(xy) + std::abs(xz), std::abs(xy) + std::abs(yy) + std::abs(yz),
                       std::abs(xz) + std::abs(yz) + std::abs(zz)});
    }
    /// Of two that commute, so that their product is symmetric.
    friend Symmetric operator*(const Symmetric& a, const Symmetric& b) noexcept {
      return {a.xx * b.xx + a.xy * b.xy + a.xz * b.xz, a.xx * b.xy + a.xy * b.yy + a.xz * b.yz,
              a.xx * b.xz + a.xy * b.yz + a.xz * b.zz, a.xy * b.xy + a.yy * b.yy + a.yz * b.yz,
              a.xy * b.xz + a.yy * b.yz + a.yz * b.zz, a.xz * b.xz + a.yz * b.yz + a.zz * b.zz};
    }
  };

  static Symmetric shortened_inverse(const Symmetric& moment) noexcept {
    // liquid that is far too dense: the series wants eigenvalues below two
    const Scalar shrink = 1 / std::max(Scalar(1), moment.largest_row_sum() / Scalar(1.5));
    const Symmetric e{1 - shrink * moment.xx, -shrink * moment.xy, -shrink * moment.xz,
                      1 - shrink * moment.yy, -shrink * moment.yz, 1 - shrink * moment.zz};
    const Symmetric e2 = e * e, e3 = e * e2;
    return {shrink * (1 + e.xx + e2.xx + e3.xx), shrink * (e.xy + e2.xy + e3.xy), shrink * (e.xz + e2.xz + e3.xz),
            shrink * (1 + e.yy + e2.yy + e3.yy), shrink * (e.yz + e2.yz + e3.yz), shrink * (1 + e.zz + e2.zz + e3.zz)};
  }

  void set(Index i, const Symmetric& m) noexcept {
    Scalar* a = &first_[4 * static_cast<std::size_t>(i)];
    Scalar* b = &second_[4 * static_cast<std::size_t>(i)];
    a[0] = m.xx;
    a[1] = m.xy;
    a[2] = m.xz;
    b[0] = m.yy;
    b[1] = m.yz;
    b[2] = m.zz;
    a[3] = b[3] = 0;
  }

  std::vector<Scalar> first_{}, second_{};  ///< records of four: xx, xy, xz and yy, yz, zz, the last one unused
};

}  // namespace decant::inline DECANT_TARGET
