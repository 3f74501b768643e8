// SPDX-License-Identifier: MIT
#pragma once

/// Friction of the layer that touches a wall, whatever the wall's slip and however thin the liquid.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <decant/boundary/concept.hpp>
#include <decant/boundary/wall_state.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// a = -rate u for liquid that touches a wall, with u the part along the wall of its velocity relative to the wall,
/// nothing along the normal: from free slip (0) to no slip (beyond one over the sub-step). It is Navier's law of slip,
/// a stress of friction_coefficient * u at the wall (Navier 1823; see Lauga, Brenner and Stone 2007, "Microfluidics:
/// the no-slip boundary condition", in Springer's Handbook of Experimental Fluid Mechanics), taken up by one layer of
/// particles: rate = friction_coefficient / (rho_0 d), so that the same wall has half the rate at twice the spacing d.
/// With viscosity nu the slip length is nu / (rate d). A layer on a slope slides with g sin(theta) / rate.
///
/// How it differs from the walls of Viscosity (Slip::None): those pull with a rate that follows from nu, 2 nu / d^2 or
/// so, and hold what is resolved; where the boundary layer is thinner than a particle, as with water in a cup, that
/// is next to nothing. Here the rate is a number of its own, found by a measurement or a fit: what a rough wall, a
/// boundary layer that is not resolved, or liquid that wets costs. It acts at every body, that of Slip::Free too, and
/// adds to what Viscosity does.
///
/// What touches a wall is nearer to it than `depth` spacings: with 1, the layer at half a spacing with as much room
/// again for disorder, and not the next one at one and a half. Deeper than the wall is felt (the support radius less a
/// spacing, one spacing by default) it never reaches. Of several bodies the nearest counts in full; others by how steep
/// their share of the density is against that of the nearest: equal in a corner, nothing behind another. Where one body
/// has an edge, its walls count as one that faces the same way as their sum.
///
/// The slip falls as exp(-rate t) over a sub-step, as a whole: nothing overshoots. It is the slip before the sub-step,
/// in which pressure has balanced weight: still water at an upright wall is not held up. What else accelerates liquid
/// along the wall in a sub-step comes on top of the slip that is left. With a rate of zero, and no body that is
/// rougher, it costs nothing and changes no bit.
template <class ScalarType>
struct WallFriction {
  using Scalar = ScalarType;

  Scalar rate = 0;   ///< [1/s], >= 0
  Scalar depth = 1;  ///< of what touches a wall [spacings], > 0
  /// Bodies that are rougher than the others, with how much is added to the rate at them [1/s], >= 0.
  std::vector<std::pair<BodyId, Scalar>> rougher{};

  template <class Step>
  void accumulate(const Step& step, PointArray<Scalar>& acceleration) noexcept {
    if ((!(rate > 0) && rougher.empty()) || !(step.time_step > 0)) {
      return;
    }
    const Scalar deepest = depth * step.spacing;
    parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      if (step.walls.contact_count[i] > 0 && step.walls.distance[i] < deepest) {
        slow(step, i, acceleration);
      }
    });
  }

  template <class Step>
  Scalar largest_step(const Step&) const noexcept {
    return std::numeric_limits<Scalar>::infinity();
  }

 private:
  Scalar rate_at(std::uint32_t body) const noexcept {
    Scalar all = rate > 0 ? rate : Scalar(0);
    for (const auto& [rough, more] : rougher) {
      all += rough == body && more > 0 ? more : Scalar(0);
    }
    return all;
  }

  template <class Step>
  void slow(const Step& step, Index i, PointArray<Scalar>& acceleration) const noexcept {
    const WallContact<Scalar>* contacts = step.walls.contacts_of(i);
    const Scalar steepest = contacts[0].gradient.norm();    // the nearest comes first
    Vector3<Scalar> velocity = step.fluid.velocity.col(i);  // after the walls so far
    for (int k = 0; k < step.walls.contact_count[i]; ++k) {
      const Scalar steepness = contacts[k].gradient.norm();
      if (!(steepness > 0)) {
        continue;
      }
      const Vector3<Scalar> normal = contacts[k].gradient / steepness;
      const Vector3<Scalar> past = velocity - contacts[k].velocity;
      const Scalar own_rate = rate_at(contacts[k].body) * std::min(steepness / steepest, Scalar(1));
      if (!(own_rate > 0)) {
        continue;
      }
      const Scalar mean_rate = -std::expm1(-own_rate * step.time_step) / step.time_step;
      const Vector3<Scalar> pull = -mean_rate * (past - past.dot(normal) * normal);
      velocity += step.time_step * pull;
      acceleration.col(i) += pull;
    }
  }
};

}  // namespace decant::inline DECANT_TARGET
