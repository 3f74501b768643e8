// SPDX-License-Identifier: MIT
#pragma once

/// Sweeps that explicit viscosities share, whatever their viscosity depends on.

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include <decant/boundary/wall_state.hpp>
#include <decant/core/batch.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/force/detail/viscous_pair.hpp>

namespace decant::inline DECANT_TARGET::detail {

/// Velocities in records of four, for gather4; the last of each is the caller's.
template <class Step, class Scalar>
void note_velocities(const Step& step, std::vector<Scalar>& records) noexcept {
  records.resize(4 * static_cast<std::size_t>(step.fluid.size()));
  parallel_for(step.fluid.size(), step.threads, [&](Index i) {
    for (Index axis = 0; axis < 3; ++axis) {
      records[static_cast<std::size_t>(4 * i + axis)] = step.fluid.velocity(axis, i);
    }
  });
}

/// sum_j push_ij x_ij over the neighbours of particle i, with push = m_j (v_ij . x_ij) weight(r^2) as scaled(push, j's
/// record) makes it: times -nu / rho_0 it is what viscosity does to i.
template <class Step, class Scalar, class Scaled>
[[gnu::always_inline]] inline Vector3<Scalar> sum_of_pushes(const Step& step, Index i,
                                                            const std::vector<Scalar>& records,
                                                            const ViscousPair<Scalar>& weight,
                                                            Scaled&& scaled) noexcept {
  using B = Batch<Scalar>;
  const Scalar* own = &records[static_cast<std::size_t>(4 * i)];
  const B own_x(own[0]), own_y(own[1]), own_z(own[2]);
  B x(Scalar(0)), y(Scalar(0)), z(Scalar(0));
  step.neighbors.for_each_batch(i, [&](const auto& pair) {
    const auto other = gather4(records.data(), pair.neighbor);
    const B approach = (own_x - other.x) * pair.x + (own_y - other.y) * pair.y + (own_z - other.z) * pair.z;
    const B push = scaled(step.mass(pair.neighbor) * approach * weight(pair.distance_squared), other);
    x = multiply_add(push, pair.x, x);
    y = multiply_add(push, pair.y, y);
    z = multiply_add(push, pair.z, z);
  });
  return Vector3<Scalar>(sum_each(std::array{x, y, z}).data());
}

/// The pull along walls that hold the liquid, with the viscosity(contact, slip along the wall [m/s]) [m^2/s]: at most
/// all of the slip in a sub-step.
template <class Step, class Scalar, class ViscosityAt>
void add_wall_friction(const Step& step, Index i, PointArray<Scalar>& acceleration, ViscosityAt&& viscosity) noexcept {
  const WallContact<Scalar>* contacts = step.walls.contacts_of(i);
  Vector3<Scalar> velocity = step.fluid.velocity.col(i);  // after the walls so far
  for (int k = 0; k < step.walls.contact_count[i]; ++k) {
    const WallContact<Scalar>& contact = contacts[k];
    const Scalar steepness = contact.gradient.norm();
    if (!(contact.friction > 0) || !(steepness > 0)) {
      continue;
    }
    const Vector3<Scalar> normal = contact.gradient / steepness;
    const Vector3<Scalar> past = velocity - contact.velocity;
    const Vector3<Scalar> slip = past - past.dot(normal) * normal;
    const Scalar rate = std::min(viscosity(contact, slip) * contact.friction, 1 / step.time_step);
    const Vector3<Scalar> pull = -rate * slip;
    velocity += step.time_step * pull;
    acceleration.col(i) += pull;
  }
}

}  // namespace decant::inline DECANT_TARGET::detail
