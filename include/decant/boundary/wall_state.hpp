// SPDX-License-Identifier: MIT
#pragma once

/// What the liquid feels of its walls, one entry per particle: all that pressure solvers and forces need to know about
/// bodies, whatever these are made of.

#include <algorithm>
#include <cstdint>
#include <vector>

#include <decant/core/growable.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// A wall's part in one particle's sums. Gradients are those of the share, so they point into the wall.
template <class Scalar>
struct WallContact {
  std::uint32_t body = 0;
  Scalar friction = 0;  ///< viscous rate per kinematic viscosity [1/m^2]; 0 for free slip
  Scalar distance = 0;  ///< to the body's surface [m], >= 0
  Vector3<Scalar> gradient = Vector3<Scalar>::Zero();  ///< [1/m]
  Vector3<Scalar> velocity = Vector3<Scalar>::Zero();  ///< of the body, as if it reached to the particle [m/s]
};

/// Sampled at the particles' positions, once per step.
/// A wall adds a share of rest density to the particles near it (boundary/wall_function.hpp) and moves at its own
/// speed.
template <class ScalarType>
struct WallState {
  using Scalar = ScalarType;
  /// A particle touches at most this many bodies; of more, the nearest count.
  static constexpr int max_contacts = 3;

  Growable<Scalar, 1> share;                  ///< N, added to the density, over rest density [-]
  Growable<Scalar, 3> gradient;               ///< 3xN, of share [1/m]
  Growable<Scalar, 6> moment;                 ///< 6xN, WallSample::moment: xx, xy, xz, yy, yz, zz [-]
  Growable<Scalar, 1> flux;                   ///< N, sum over bodies of gradient . wall velocity [1/s]
  Growable<Scalar, 1> distance;               ///< N, to the nearest wall; at most the reach of walls [m]
  Growable<std::uint8_t, 1> contact_count;    ///< N
  std::vector<WallContact<Scalar>> contacts;  ///< max_contacts per particle, the first contact_count valid

  void resize(Index count) {
    share.set_count(count);
    gradient.set_count(count);
    moment.set_count(count);
    flux.set_count(count);
    distance.set_count(count);
    contact_count.set_count(count);
    contacts.resize(static_cast<std::size_t>(count) * max_contacts);
  }

  /// Particle i is what another state's particle `from` is. Both are large enough.
  void take(Index i, const WallState& other, Index from) {
    share[i] = other.share[from];
    gradient.col(i) = other.gradient.col(from);
    moment.col(i) = other.moment.col(from);
    flux[i] = other.flux[from];
    distance[i] = other.distance[from];
    contact_count[i] = other.contact_count[from];
    std::copy_n(other.contacts_of(from), other.contact_count[from], contacts_of(i));
  }

  const WallContact<Scalar>* contacts_of(Index i) const {
    return &contacts[static_cast<std::size_t>(i) * max_contacts];
  }
  WallContact<Scalar>* contacts_of(Index i) { return &contacts[static_cast<std::size_t>(i) * max_contacts]; }
};

}  // namespace decant::inline DECANT_TARGET
