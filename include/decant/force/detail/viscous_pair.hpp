// SPDX-License-Identifier: MIT
#pragma once

/// The weight that a pair has in viscosity.

#include <algorithm>
#include <cmath>
#include <numbers>

#include <decant/core/batch.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET::detail {

/// 2 (D + 2) (-W'/r) / r^2 with D = 3 and a kernel of its own whose slope is that of a hat,
/// -W' / r = 45 / (2 pi R^5) (1 - r / R). See Viscosity for why.
template <class Scalar>
class ViscousPair {
 public:
  /// @param support radius R [m], > 0.
  explicit ViscousPair(Scalar support) noexcept
      : support_(support), per_support_(1 / support), least_squared_(Scalar(1e-6) * support * support) {
    const Scalar squared = support * support;
    strength_ = 225 * std::numbers::inv_pi_v<Scalar> / (squared * squared * support);
  }

  /// The weight [m^-7]: times nu (m_j / rho_0) (v_ij . x_ij) (-x_ij), it is the acceleration by the pair.
  [[gnu::always_inline]] Batch<Scalar> operator()(Batch<Scalar> distance_squared) const noexcept {
    const Batch<Scalar> hat = maximum(1 - per_support_ * square_root(distance_squared), Batch<Scalar>(Scalar(0)));
    // particles at one place have no line between them
    return strength_ * hat / (distance_squared + least_squared_);
  }

  /// Sum over a lattice of V_j r^2 times the weight, three halves of the largest eigenvalue of the pair operator over
  /// nu [1/m^2].
  Scalar stiffness(Scalar spacing) const noexcept {
    const int reach = static_cast<int>(support_ * (1 / spacing));
    Scalar total = 0;
    for (int i = -reach; i <= reach; ++i) {
      for (int j = -reach; j <= reach; ++j) {
        for (int k = -reach; k <= reach; ++k) {
          const Scalar r = spacing * std::sqrt(static_cast<Scalar>(i * i + j * j + k * k));
          total += r > 0 ? std::max(1 - r * per_support_, Scalar(0)) : Scalar(0);
        }
      }
    }
    return strength_ * spacing * spacing * spacing * total;
  }

 private:
  Scalar support_, per_support_, least_squared_, strength_;
};

}  // namespace decant::inline DECANT_TARGET::detail
