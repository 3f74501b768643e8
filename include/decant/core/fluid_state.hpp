// SPDX-License-Identifier: MIT
#pragma once

/// The liquid: a structure of arrays with one entry per particle. It is all that a corrector, a projector or a user
/// needs to see of a simulation.

#include <cstdint>

#include <decant/core/growable.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Where a particle came from: the number of a body it was filled into or of an inlet, as the simulation handed it out.
using Origin = std::uint32_t;

/// More particles than any sensible simulation has (each takes about a kilobyte). Set-up refuses more, so that a
/// mistyped length or spacing ends in a message and not in swapping.
inline constexpr double most_particles = 1e8;

/// N particles in the world frame. A simulator may put the particles in another order at any step (it sorts them by
/// place); `id` is what stays with a particle, `origin` says where its liquid started.
template <class ScalarType>
struct FluidState {
  using Scalar = ScalarType;

  Growable<Scalar, 3> position;   ///< 3xN [m]
  Growable<Scalar, 3> velocity;   ///< 3xN [m/s]
  Growable<Scalar, 1> mass;       ///< N [kg]
  Growable<Scalar, 1> density;    ///< N [kg/m^3], as of the last step
  Growable<Scalar, 1> pressure;   ///< N [Pa], as of the last step
  Growable<std::uint32_t, 1> id;  ///< N, unique, never reused
  Growable<Origin, 1> origin;     ///< N

  Index size() const { return position.count(); }

  /// Keeps the first particles; new ones are zero and have to be written by the caller.
  void resize(Index count) {
    each([count](auto& array) { array.set_count(count); });
  }

  void reserve(Index count) {
    each([count](auto& array) { array.reserve(count); });
  }

  /// Applies f to every array.
  template <class Function>
  void each(Function&& f) {
    f(position);
    f(velocity);
    f(mass);
    f(density);
    f(pressure);
    f(id);
    f(origin);
  }
};

}  // namespace decant::inline DECANT_TARGET
