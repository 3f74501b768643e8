// SPDX-License-Identifier: MIT
#pragma once

/// How strongly a kernel couples neighbouring particles: what limits explicit steps of pair forces.

#include <cmath>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET::detail {

/// sum_j V_j |W'(r_j)| / r_j over a cubic lattice of the given spacing [1/m^2]. A few hundred kernel evaluations.
template <class Kernel>
typename Kernel::Scalar pair_stiffness(typename Kernel::Scalar smoothing_length,
                                       typename Kernel::Scalar spacing) noexcept {
  using Scalar = typename Kernel::Scalar;
  const Scalar support = static_cast<Scalar>(Kernel::support_factor) * smoothing_length;
  const int reach = static_cast<int>(support / spacing);
  Scalar total = 0;
  for (int i = -reach; i <= reach; ++i) {
    for (int j = -reach; j <= reach; ++j) {
      for (int k = -reach; k <= reach; ++k) {
        if (i != 0 || j != 0 || k != 0) {
          const Scalar r = spacing * std::sqrt(static_cast<Scalar>(i * i + j * j + k * k));
          total -= Kernel::derivative_over_radius(r, smoothing_length);
        }
      }
    }
  }
  return total * spacing * spacing * spacing;
}

}  // namespace decant::inline DECANT_TARGET::detail
