// SPDX-License-Identifier: MIT
#pragma once

/// Attraction of liquid by walls: what lets a thin stream follow the spout instead of leaving it (the teapot effect),
/// and drops hang.

#include <algorithm>
#include <cmath>
#include <limits>

#include <decant/boundary/wall_state.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Acceleration toward the wall, of a size that only its distance a decides:
///   strength * shape(a / R),   shape(q) = (4 q (1 - q))^(1/4) for 0 < q < 1, else 0
/// The fourth root over a parabola is the adhesion kernel of Akinci, Akinci and Teschner 2013, "Versatile surface
/// tension and adhesion for SPH fluids" (ACM Trans. Graph. 32, 6), equation (7): there between zeros at half the
/// support radius and at the support radius, for pairs of a liquid and a boundary particle; here between the wall's
/// surface and R, as liquid comes to rest half a spacing off a wall's surface. It is 1 at q = 1/2, above 0.9 from q =
/// 0.23 to 0.77, and zero at both ends: liquid that touches is not pressed into the wall, and nothing is felt from
/// afar.
///
/// R = `range` spacings, but never more than walls are felt: the support radius less a spacing, one spacing by default
/// (SimulatorSettings::support_in_spacings = 2). It then holds the layer at half a spacing with all of `strength`, and
/// nothing behind that; with a support of 3 and a range of 2 it holds two layers with 0.93 of it. Pressure does not
/// pull: layers farther out fall off unless SurfaceTension binds them.
///
/// The direction is that in which the walls' share of the density grows, along the normal of a plane or a ball; walls
/// of bodies that face each other cancel, more and more toward their middle. On a smooth wall it is the derivative of a
/// potential of depth 0.874 strength R, so that liquid that lands and leaves neither gains nor loses speed. From half a
/// spacing on, with R = d, half of that is left to climb: a layer that is torn off takes the work of adhesion of a real
/// liquid, sigma (1 + cos(contact angle)) per area (Young and Dupre; de Gennes 1985, Rev. Mod. Phys. 57), at
///   strength = sigma (1 + cos(contact angle)) / (0.437 rho_0 d^2),
/// 13 m/s^2 for water on clean glass at a spacing of 5 mm. Bodies feel no force in return. A strength of zero costs
/// nothing and changes no bit.
template <class ScalarType>
struct WallAdhesion {
  using Scalar = ScalarType;

  Scalar strength = 0;  ///< the largest acceleration toward a wall [m/s^2], >= 0, finite
  Scalar range = 1;     ///< R [spacings], > 0; more than one only with a support of more than two spacings

  template <class Step>
  void accumulate(const Step& step, PointArray<Scalar>& acceleration) noexcept {
    const Scalar reach = reach_of_walls(step);
    if (!(strength > 0) || !(reach > 0)) {
      return;
    }
    parallel_for(step.fluid.size(), step.threads, [&](Index i) {
      const Scalar q = step.walls.distance[i] / reach;
      Scalar steepness = 0;
      const WallContact<Scalar>* contacts = step.walls.contacts_of(i);
      for (int k = 0; k < step.walls.contact_count[i]; ++k) {
        steepness += contacts[k].gradient.norm();
      }
      if (q > 0 && q < 1 && steepness > 0) {
        const Scalar shape = std::sqrt(std::sqrt(4 * q * (1 - q)));
        acceleration.col(i) += strength * shape / steepness * step.walls.gradient.col(i);
      }
    });
  }

  /// A quarter of the time in which a fall with `strength` crosses the range, as Monaghan 1992 limits steps by forces.
  template <class Step>
  Scalar largest_step(const Step& step) const noexcept {
    const Scalar reach = reach_of_walls(step);
    return strength > 0 && reach > 0 ? Scalar(0.25) * std::sqrt(reach / strength)
                                     : std::numeric_limits<Scalar>::infinity();
  }

 private:
  /// R [m]
  template <class Step>
  Scalar reach_of_walls(const Step& step) const noexcept {
    const Scalar felt = static_cast<Scalar>(Step::Kernel::support_factor) * step.smoothing_length - step.spacing;
    return std::min(range * step.spacing, felt);
  }
};

}  // namespace decant::inline DECANT_TARGET
