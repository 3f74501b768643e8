// SPDX-License-Identifier: MIT
#pragma once

/// What the walls of a simulation have to provide.

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string>

#include <decant/boundary/body_shape.hpp>
#include <decant/boundary/wall_state.hpp>
#include <decant/core/fluid_state.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Names a body of a simulation; as an Origin, the liquid that started in it.
using BodyId = std::uint32_t;

/// How liquid moves along a wall.
enum class Slip {
  Free,  ///< without friction: right where the boundary layer is thinner than a particle
  None,  ///< the liquid at the wall moves with it, pulled by its viscosity
};

/// What guarding a step took.
struct GuardReport {
  Index slid = 0;     ///< particles whose path was bent at a wall
  Index stopped = 0;  ///< particles that were held in place because no free path was found
  Index lost = 0;     ///< particles squeezed between bodies that left no room: counted as lost through a wall
};

/// All that liquid cannot enter: bodies with numbers from 0 up, each with a pose at any time. A plain value; copies are
/// independent (snapshots are copies) and may share what never changes. Positions are 3xN [m], world frame.
///
/// At set-up, from one thread; these may allocate, and throw std::invalid_argument for what they do not support:
/// add<Kernel>(name, shape, motion, slip, smoothing_length [m], spacing [m], threads): takes one more body and prepares
/// its wall for this kernel. Returns its number, which is the old size().
/// size(): the number of bodies.
/// operator[](body): something with `motion` (PoseTrack) and `bounds` (an AlignedBox3d around the body, in its own
/// frame [m]; of a wall without end, any box). fill, Contents and watch_contents ask for `name` and `surface` as well,
/// and mesh_report for `shape`, all as in RigidBodies::Body: without these they do not compile; everything else does.
/// set_motion(body, motion): replaces a body's poses. Also the simulator's way to hold a body still.
/// push_out(body, clearance, fluid): takes particles out of the body's material, `clearance` [m] off its surface, with
/// the body where the last set_interval put it. Returns how many.
///
/// In the frame loop; these may not throw, and allocate only while the number of particles grows:
/// set_interval(time [s], time_step [s]): bodies go from their poses at `time` to those at time + time_step; with a
/// time_step of 0 they stand. The four below are about this interval.
/// largest_relative_speed(fluid, threads, reduction) [m/s]: of any particle past any body near it over the interval, or
/// in the world where nothing moves; NaN if any velocity is. Keeps sub-steps short.
/// sample(position, spacing [m], threads, walls): sizes and fills every array of `walls`, for bodies at the interval's
/// start. Where no wall is felt share, gradient, moment, flux and contact_count are 0 and distance is how far walls are
/// felt; distance may be off by a tenth. share and gradient have to be a function and its derivative, or still water
/// will not stay still; WallFunction has a pair for plane walls.
/// separated(a, b, contacts, count): whether a wall stands between two points, of which one has these contacts. Called
/// from many threads; has to be true of (b, a) where it is of (a, b).
/// guard(before, clearance [m], threads, walls, fluid): the end of a sub-step. `walls` is as sampled at `before`,
/// fluid.position is where particles want to go: bends steps that would cross a wall or end nearer to it than
/// `clearance`, and takes the part of their velocity that points into it. What it lets pass has leaked.
/// Results have to be the same bits for any number of threads. Laws: decant/testing/boundary.hpp.
template <class B, class Kernel>
concept Boundary =
    std::copyable<B> && std::default_initializable<B> &&
    requires(B& bodies, const B& built, std::string name, BodyShape shape, PoseTrack motion, Slip slip, double number,
             Threads threads, BodyId body, const ConstPointsView<typename B::Scalar>& position,
             const Vector3<typename B::Scalar>& x, const WallContact<typename B::Scalar>* contacts, int count,
             WallState<typename B::Scalar>& walls, const WallState<typename B::Scalar>& sampled,
             FluidState<typename B::Scalar>& fluid, const FluidState<typename B::Scalar>& sampled_fluid,
             Reduction<double>& reduction) {
      requires std::same_as<typename B::Scalar, typename Kernel::Scalar>;
      { bodies.template add<Kernel>(name, shape, motion, slip, number, number, threads) } -> std::same_as<BodyId>;
      { built.size() } noexcept -> std::convertible_to<std::size_t>;
      { built[body].motion } -> std::convertible_to<const PoseTrack&>;
      { built[body].bounds } -> std::convertible_to<const Eigen::AlignedBox3d&>;
      bodies.set_motion(body, motion);
      { built.push_out(body, number, fluid) } -> std::same_as<Index>;
      { bodies.set_interval(number, number) } noexcept -> std::same_as<void>;
      { built.largest_relative_speed(sampled_fluid, threads, reduction) } noexcept -> std::same_as<double>;
      { built.sample(position, number, threads, walls) } noexcept -> std::same_as<void>;
      { built.separated(x, x, contacts, count) } noexcept -> std::same_as<bool>;
      { built.guard(position, number, threads, sampled, fluid) } noexcept -> std::same_as<GuardReport>;
    };

}  // namespace decant::inline DECANT_TARGET
