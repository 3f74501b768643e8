// SPDX-License-Identifier: MIT
#pragma once

/// Walls asked several times over with hardly anything moved in between: only what moved is asked anew.

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <decant/boundary/wall_state.hpp>
#include <decant/core/growable.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Where particles and bodies were when a WallState was sampled last. Bodies without sample_again (boundary/concept.hpp
/// does not ask for it) are sampled from the beginning each time; results are the same bits either way.
template <class ScalarType>
class RememberedWalls {
 public:
  using Scalar = ScalarType;

  /// What was sampled has been written over since.
  void forget() noexcept { known_ = false; }

  /// As bodies.sample, with the bodies at `time` [s]. @param walls as sampled here last, unless forget() was called.
  template <class Bodies>
  void sample(const Bodies& bodies, double time, const Growable<Scalar, 3>& position, double spacing, Threads threads,
              WallState<Scalar>& walls) noexcept {
    if constexpr (requires { bodies.sample_again(position, again_, spacing, threads, walls); }) {
      const Index count = position.count();
      const bool bodies_stand = note_poses(bodies, time);
      if (known_ && bodies_stand && position_.count() == count) {
        again_.resize(static_cast<std::size_t>(count));
        parallel_for(count, threads, [&](Index i) {
          again_[static_cast<std::size_t>(i)] = position.col(i) == position_.col(i) ? 0 : 1;
        });
        bodies.sample_again(position, again_, spacing, threads, walls);
      } else {
        bodies.sample(position, spacing, threads, walls);
      }
      position_ = position;
      known_ = true;
    } else {
      bodies.sample(position, spacing, threads, walls);
    }
  }

  /// The particles were put into another order: place k now holds what was at order[k].
  void reorder(std::span<const std::uint32_t> order, Threads threads, WallState<Scalar>& walls) noexcept {
    if (!known_) {
      return;
    }
    const auto count = static_cast<Index>(order.size());
    std::swap(walls, walls_before_);
    walls.resize(count);
    std::swap(position_, position_before_);
    position_.set_count(count);
    parallel_for(count, threads, [&](Index k) {
      const auto from = static_cast<Index>(order[static_cast<std::size_t>(k)]);
      walls.take(k, walls_before_, from);
      position_.col(k) = position_before_.col(from);
    });
  }

 private:
  /// @return whether bodies are where they were.
  template <class Bodies>
  bool note_poses(const Bodies& bodies, double time) noexcept {
    bool same = poses_.size() == bodies.size();
    poses_.resize(bodies.size());
    for (std::size_t body = 0; body < poses_.size(); ++body) {
      const Pose now = bodies[static_cast<std::uint32_t>(body)].motion.at(time);
      Pose& before = poses_[body];
      same = same && now.translation == before.translation && now.rotation.coeffs() == before.rotation.coeffs();
      before = now;
    }
    return same;
  }

  bool known_ = false;
  std::vector<Pose> poses_{};
  Growable<Scalar, 3> position_{};
  std::vector<std::uint8_t> again_{};  ///< N, 1 for particles that moved
  // scratch
  WallState<Scalar> walls_before_{};
  Growable<Scalar, 3> position_before_{};
};

}  // namespace decant::inline DECANT_TARGET
