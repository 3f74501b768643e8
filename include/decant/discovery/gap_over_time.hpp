// SPDX-License-Identifier: MIT
#pragma once

/// When a recording is off from a model, and whether an effect makes it worse at some time.

#include <algorithm>
#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/target.hpp>
#include <decant/discovery/observation_features.hpp>

namespace decant::inline DECANT_TARGET {

/// Moments of an observation: windows of time of silhouettes, all cameras together, and such of readings.
class GapOverTime {
 public:
  explicit GapOverTime(const ObservationFeatures& features) {
    std::map<std::pair<bool, int>, Eigen::Index> numbers;  // of silhouettes, then of readings
    const auto add = [&](bool reading, int window) {
      const auto number = static_cast<Eigen::Index>(numbers.size());
      moment_.push_back(numbers.try_emplace({reading, window}, number).first->second);
    };
    for (std::size_t k = 0; k < features.silhouettes().size(); ++k) {
      add(false, features.silhouettes().place(k).window);
    }
    for (std::size_t k = 0; k < features.readings().size(); ++k) {
      add(true, features.readings().place(k).window);
    }
    moments_ = static_cast<Eigen::Index>(numbers.size());
  }

  /// By moment, the sum of squares. @param off by feature.
  Eigen::VectorXd operator()(const Eigen::VectorXd& off) const {
    Eigen::VectorXd gap = Eigen::VectorXd::Zero(moments_);
    for (std::size_t k = 0; k < moment_.size(); ++k) {
      const double of = off[static_cast<Eigen::Index>(k)];
      gap[moment_[k]] += of * of;
    }
    return gap;
  }

 private:
  std::vector<Eigen::Index> moment_{};  ///< of each feature
  Eigen::Index moments_ = 0;
};

/// How much gaps grow at the moments at which they do, over all of the gap. What is missing takes a gap away whenever
/// there is one; what stands in for it takes most of it away, and makes one at other times.
/// @param before, after, by_chance by moment; what is no more than by chance has not grown.
inline double grown_gap(const Eigen::VectorXd& before, const Eigen::VectorXd& after, const Eigen::VectorXd& by_chance) {
  const double grown = (after - before.cwiseMax(by_chance)).cwiseMax(0).sum();
  return grown / std::max(before.sum(), 1e-12);
}

}  // namespace decant::inline DECANT_TARGET
