// SPDX-License-Identifier: MIT
#pragma once

/// A hole through which liquid leaves a simulation.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <decant/core/pose.hpp>
#include <decant/core/types.hpp>

namespace example {

/// Takes liquid away around a point of a body at a given flow, as far as there is any.
// OUTLET: the library's Outlet can take its place, once there is one
class Drain {
 public:
  /// @param point in the body's frame [m]. @param flow [m^3/s].
  Drain(decant::PoseTrack body, const decant::Vector3<double>& point, double flow)
      : body_(std::move(body)), point_(point), flow_(flow) {}

  /// After the reality has gone on by `time_step` [s].
  template <class Model>
  void drain(Model& reality, double time_step) {
    const double particle = std::pow(reality.spacing(), 3);
    pending_ += flow_ * time_step;
    const auto wanted = static_cast<std::size_t>(std::floor(pending_ / particle));
    const decant::Vector3<double> point = body_.at(reality.time()) * point_;
    near_.clear();
    for (decant::Index i = 0; i < reality.fluid().size(); ++i) {
      const double distance = (reality.fluid().position.col(i).template cast<double>() - point).norm();
      if (distance < reach_) {
        near_.emplace_back(distance, i);
      }
    }
    const std::size_t taken = std::min(wanted, near_.size());
    std::sort(near_.begin(), near_.end());
    near_.resize(taken);
    gone_.assign(static_cast<std::size_t>(reality.fluid().size()), false);
    for (const auto& [distance, i] : near_) {
      gone_[static_cast<std::size_t>(i)] = true;
    }
    reality.remove_particles_if([&](decant::Index i) { return gone_[static_cast<std::size_t>(i)]; });
    const double volume = static_cast<double>(taken) * particle;
    removed_ += volume;
    pending_ = taken < wanted ? 0 : pending_ - volume;  // what was not there is not made up for later
  }

  double removed() const { return removed_; }  ///< [m^3]

 private:
  static constexpr double reach_ = 0.012;  ///< [m]

  decant::PoseTrack body_;
  decant::Vector3<double> point_;
  double flow_, pending_ = 0, removed_ = 0;
  std::vector<std::pair<double, decant::Index>> near_{};
  std::vector<bool> gone_{};
};

}  // namespace example
