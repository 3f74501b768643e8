// SPDX-License-Identifier: MIT
#pragma once

/// Liquid that pours in from a round opening.

#include <cmath>
#include <cstddef>
#include <numbers>
#include <numeric>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/simulation/detail/flow_table.hpp>

namespace decant::inline DECANT_TARGET {

/// What an inlet is asked to do.
struct InletSettings {
  Vector3<double> position = Vector3<double>::Zero();     ///< centre of the opening, world frame [m]
  Vector3<double> direction = -Vector3<double>::UnitZ();  ///< of the flow; normalised
  double radius = 0.01;                                   ///< of the opening [m], > 0.01 spacings
  std::vector<std::pair<double, double>> flow{};          ///< (time [s], flow [m^3/s]), linear between, 0 outside
};

/// Hands out particles one by one, each as soon as its volume has come in, in turn at places all over the opening: a
/// jet that gets thin as it falls does not fall apart into slices. Plug flow: each leaves with the speed that the flow
/// has over the opening. A lattice covers no circle exactly, so its places are spread until each has its share of the
/// circle: the jet is the same at every spacing.
class Inlet {
 public:
  /// @param spacing particle spacing [m].
  Inlet(InletSettings settings, double spacing) : settings_(std::move(settings)) {
    expects(settings_.position.allFinite(), "Inlet: position [m]", "finite", settings_.position.transpose());
    expects(settings_.direction.allFinite() && settings_.direction.norm() > 1e-9, "Inlet: direction",
            "a finite vector other than zero", settings_.direction.transpose());
    expects(settings_.radius > 0.01 * spacing && settings_.radius < 1e3 * spacing, "Inlet: radius [m]",
            "between 0.01 and 1000 spacings", settings_.radius);
    detail::expects_flow("Inlet", settings_.flow);
    settings_.direction.normalize();
    const Vector3<double> across = settings_.direction.unitOrthogonal();
    const Vector3<double> along = settings_.direction.cross(across);
    const double radius = settings_.radius;
    const int reach = static_cast<int>(std::ceil(radius / spacing));
    std::vector<Vector3<double>> offsets;
    for (int i = -reach; i <= reach; ++i) {
      for (int j = -reach; j <= reach; ++j) {
        const Vector3<double> offset = spacing * (i * across + j * along);
        if (offset.norm() <= radius) {
          offsets.push_back(offset);
        }
      }
    }
    opening_ = std::numbers::pi * radius * radius;
    volume_ = spacing * spacing * spacing;
    const std::size_t count = offsets.size();
    const double spread = std::sqrt(opening_ / static_cast<double>(count)) / spacing;
    // places that follow each other are far apart: so many on as the golden section of them, or the next that meets all
    auto stride = static_cast<std::size_t>(std::lround(0.618 * static_cast<double>(count)));
    while (std::gcd(stride, count) != 1) {
      ++stride;
    }
    for (std::size_t k = 0; k < count; ++k) {
      places_.push_back(settings_.position + spread * offsets[k * stride % count]);
    }
  }

  /// Volume flow at a time [m^3/s].
  double flow(double time) const noexcept { return detail::flow_at(settings_.flow, time); }

  /// Of the liquid that comes in [m/s].
  double speed(double time) const noexcept { return flow(time) / opening_; }

  /// Lets time pass; calls emit(position, velocity) for each particle that has come in meanwhile.
  template <class Emit>
  void advance(double time, double time_step, Emit&& emit) {
    const Vector3<double> velocity = speed(time + 0.5 * time_step) * settings_.direction;
    pending_ += flow(time + 0.5 * time_step) * time_step;
    while (pending_ >= volume_) {
      pending_ -= volume_;
      // it passed the opening a moment ago; what came in after it is behind it
      emit(Vector3<double>(places_[next_] + pending_ / opening_ * settings_.direction), velocity);
      next_ = (next_ + 1) % places_.size();
    }
  }

  const InletSettings& settings() const noexcept { return settings_; }

  /// Another flow from now on. Throws std::invalid_argument for one whose times do not increase, or below 0.
  void set_flow(std::vector<std::pair<double, double>> flow) {
    detail::expects_flow("Inlet", flow);
    settings_.flow = std::move(flow);
  }

 private:
  InletSettings settings_;
  double opening_ = 0;  ///< its area [m^2]
  double volume_ = 0;   ///< of a particle [m^3]
  double pending_ = 0;  ///< volume that came in since the last particle [m^3]
  std::vector<Vector3<double>> places_{};
  std::size_t next_ = 0;
};

}  // namespace decant::inline DECANT_TARGET
