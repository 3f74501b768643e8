// SPDX-License-Identifier: MIT
#pragma once

/// Neighbours by looking at every pair: the reference that faster searches are tested against.

#include <decant/core/batch.hpp>
#include <decant/core/domain.hpp>
#include <decant/core/target.hpp>
#include <decant/neighbor/concept.hpp>

namespace decant::inline DECANT_TARGET {

/// Compares each particle with all others, in ascending order: N operations per particle.
template <std::floating_point ScalarType, class DomainType = OpenDomain>
class BruteForce {
 public:
  using Scalar = ScalarType;
  using Domain = DomainType;

  explicit BruteForce(Domain domain = {}) : domain_(domain) {}

  void rebuild(const ConstPointsView<Scalar>& position, Scalar support_radius, Threads = {}) {
    detail::check_search(domain_, position.cols(), support_radius);
    position_ = position;
    radius_squared_ = support_radius * support_radius;
  }

  Index size() const noexcept { return position_.cols(); }
  const Domain& domain() const noexcept { return domain_; }

  template <class Function>
  void for_each(Index i, Function&& f) const noexcept {
    for (Index j = 0; j < position_.cols(); ++j) {
      const Scalar r_squared = squared_length(domain_.separation(0, position_(0, i), position_(0, j)),
                                              domain_.separation(1, position_(1, i), position_(1, j)),
                                              domain_.separation(2, position_(2, i), position_(2, j)));
      if (j != i && r_squared < radius_squared_) {
        f(j, r_squared);
      }
    }
  }

 private:
  Domain domain_;
  PointArray<Scalar> position_;
  Scalar radius_squared_ = 0;
};

static_assert(NeighborSearch<BruteForce<float>> && NeighborSearch<BruteForce<double, PeriodicDomain<double>>>);

}  // namespace decant::inline DECANT_TARGET
