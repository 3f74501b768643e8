// SPDX-License-Identifier: MIT
#pragma once

/// What a liquid simulation has to provide to be tracked.

#include <concepts>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/concept.hpp>
#include <decant/core/fluid_state.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// A simulation of liquid among rigid bodies, decant's own or somebody else's. A simulation that keeps its particles in
/// arrays of its own copies them into a FluidState after each step and back at the start of the next.
/// fluid(): the particles, 3xN [m] and [m/s] in the world; correctors change places and velocities between steps.
/// time() [s], spacing() [m]: how far particles are apart at rest.
/// bodies(): size(), and for each number from 0 up `surface` (a shared_ptr to a BoundingVolumeHierarchy in the body's
/// frame) and `motion` (a PoseTrack, of which the pose at time() is asked), as RigidBodies has them and TrackedBodies.
/// move_body(body, pose, duration [s]): from now on the body goes from where it is to that pose, in that time.
/// step(duration [s]): lets time pass; the answer's advanced() is false, and nothing has changed, if that failed.
/// A model may also say adopt_moves(before, longest_path, sweeps), see Simulator::adopt_moves. If it does not, the
/// tracker stops moves at walls itself, and what was moved too close is left for the model to push apart.
template <class M>
concept LiquidModel = requires(M& model, const M& asked, BodyId body, const Pose& pose, double duration) {
  requires std::floating_point<typename M::Scalar>;
  { model.fluid() } -> std::same_as<FluidState<typename M::Scalar>&>;
  { asked.time() } -> std::convertible_to<double>;
  { asked.spacing() } -> std::convertible_to<double>;
  { asked.bodies().size() } -> std::convertible_to<std::size_t>;
  { *asked.bodies()[body].surface } -> std::convertible_to<const BoundingVolumeHierarchy&>;
  { asked.bodies()[body].motion } -> std::convertible_to<const PoseTrack&>;
  model.move_body(body, pose, duration);
  { model.step(duration).advanced() } -> std::same_as<bool>;
};

}  // namespace decant::inline DECANT_TARGET
