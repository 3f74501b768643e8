// SPDX-License-Identifier: MIT
#pragma once

/// What a frame of simulation took, and how it went.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

enum class StepStatus {
  Ok,
  NotConverged,  ///< the step was taken, but the pressure solver stopped short of its tolerance in some sub-step
  BadTimeStep,   ///< the frame time is not a finite number >= 0; state unchanged
  TooManySteps,  ///< something moves too fast for the limit on sub-steps; state unchanged
  NonFinite,     ///< a position or velocity became infinite or NaN; state unchanged
};

constexpr std::string_view to_string(StepStatus status) {
  switch (status) {
    case StepStatus::Ok: return "ok";
    case StepStatus::NotConverged: return "not converged";
    case StepStatus::BadTimeStep: return "bad time step";
    case StepStatus::TooManySteps: return "too many sub-steps";
    case StepStatus::NonFinite: return "non-finite";
  }
  return "unknown";
}

/// Liquid in one container that is watched (Simulator::watch_contents).
struct ContainedLiquid {
  std::uint32_t body = 0;  ///< a BodyId
  Index particles = 0;     ///< below the container's rim, however it is tilted
  double volume = 0;       ///< theirs, mass over rest density [m^3]
};

/// One entry per watched container, in the order in which watching began. Holds its entries in itself, so that reports
/// are copied and kept without allocation.
class ContentsList {
 public:
  static constexpr std::size_t capacity = 16;  ///< so many containers can be watched

  const ContainedLiquid* begin() const noexcept { return entries_.data(); }
  const ContainedLiquid* end() const noexcept { return entries_.data() + size_; }
  std::size_t size() const noexcept { return size_; }
  bool empty() const noexcept { return size_ == 0; }
  const ContainedLiquid& operator[](std::size_t place) const noexcept { return entries_[place]; }

  /// What is in a body; nullptr if that is not watched.
  const ContainedLiquid* find(std::uint32_t body) const noexcept {
    for (const ContainedLiquid& entry : *this) {
      if (entry.body == body) {
        return &entry;
      }
    }
    return nullptr;
  }

  /// Appends an entry; what is beyond the capacity is left out.
  void push_back(const ContainedLiquid& entry) noexcept {
    if (size_ < capacity) {
      entries_[size_++] = entry;
    }
  }

 private:
  std::array<ContainedLiquid, capacity> entries_{};
  std::size_t size_ = 0;
};

/// Wall time of a frame's sub-steps by what it was spent on [ms].
struct StepTimes {
  double sorting_ms = 0;    ///< particles into cells, and their neighbour lists
  double walls_ms = 0;      ///< what bodies add at each particle, and what they hide
  double sums_ms = 0;       ///< densities and corrected gradients
  double forces_ms = 0;     ///< all force terms
  double pressure_ms = 0;   ///< the pressure solver
  double moving_ms = 0;     ///< particles along their velocities, with the guard at walls

  double total() const noexcept { return sorting_ms + walls_ms + sums_ms + forces_ms + pressure_ms + moving_ms; }
};

/// One frame. Sums and maxima are over the frame's sub-steps.
struct StepReport {
  StepStatus status = StepStatus::Ok;
  int sub_steps = 0;
  int density_iterations = 0;
  int divergence_iterations = 0;
  double density_error = 0;        ///< largest of the sub-steps: mean compression over rest density [-], as predicted to
                                   ///< first order: where particles collide, more remains
  double divergence_error = 0;     ///< likewise, compression per sub-step that velocities still carry [-]
  double kinetic_energy = 0;       ///< at the end of the frame [J]
  double volume = 0;               ///< mass over rest density [m^3]
  Index particles = 0;
  Index guarded = 0;               ///< steps that swept contact had to bend
  Index lost = 0;                  ///< particles that passed a wall because bodies left them no room, since the start
  double drained = 0;              ///< volume that went out through outlets, since the start [m^3]; what goes on from an
                                   ///< outlet's exit is in `volume` as well
  Index non_finite = 0;            ///< particles with a non-finite position or velocity (status NonFinite)
  ContentsList contents{};         ///< of the containers that are watched, at the end of the frame
  StepTimes times{};

  /// True if the frame was simulated; false if the state is unchanged.
  bool advanced() const { return status == StepStatus::Ok || status == StepStatus::NotConverged; }
};

}  // namespace decant::inline DECANT_TARGET
