// SPDX-License-Identifier: MIT
#pragma once

/// Pipe junctions into which less than half a litre is poured, and how: for recordings in which an effect is hidden.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <stdexcept>
#include <utility>
#include <vector>

#include <decant/boundary/pipe_network.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/types.hpp>
#include <decant/simulation/inlet.hpp>

namespace example {

/// What narrows a leg, or leaves it open.
struct LegOpenings {
  double left = 1, right = 1;  ///< open shares of the bores, > 0
  double place = 0.5;          ///< of what narrows them, as a share of a leg's way aside
};

/// An inverted T whose legs bend down over two bowls.
struct JunctionScenario {
  double leg_radius = 0.0105, stem_radius = 0.018;  ///< of the bores [m]
  double reach = 0.12;                              ///< of each leg aside [m]
  double fall = 0.01;                               ///< from the stem's foot to a leg's bend [m]
  /// What is poured, to learn from and to predict: volume [m^3], and for how long [s].
  std::array<std::pair<double, double>, 2> pours{};

  static constexpr double begin = 0.2;     ///< of pours [s]
  static constexpr double runs_out = 0.7;  ///< for which it is watched after [s]

  /// Volume [m^3] and time [s] of one of the two, or of another like the first: faster, slower, less, more. Throws
  /// std::out_of_range for what is none of them.
  std::pair<double, double> pour(std::size_t which) const {
    if (which < pours.size()) {
      return pours[which];
    }
    const auto [volume, seconds] = pours[0];
    switch (which) {
      case 2:
        return {volume, 0.75 * seconds};
      case 3:
        return {volume, 1.3 * seconds};
      case 4:
        return {0.6 * volume, seconds};
      case 5:
        return {1.2 * volume, seconds};
      default:
        throw std::out_of_range("JunctionScenario::pour: expected one of six");
    }
  }

  double duration(std::size_t which) const { return begin + pour(which).second + runs_out; }  ///< [s]

  /// A leg that is blocked in part has a bore that narrows and widens again at once.
  decant::PipeNetwork pipes(const LegOpenings& open = {}) const {
    constexpr double foot = 0.18, stem = 0.26, outlet = 0.02;  // [m]
    decant::PipeNetwork network;
    network.radius = stem_radius;
    const double bend = foot - fall;
    network.places = {{0, foot + stem}, {-reach, bend},          {reach, bend},
                      {0, foot},        {-reach, bend - outlet}, {reach, bend - outlet}};
    network.pipes = {{0, 3}, {3, 1}, {3, 2}, {1, 4}, {2, 5}};
    const double slim = leg_radius / stem_radius;
    for (const std::size_t leg : {std::size_t{1}, std::size_t{2}}) {
      const double opening = leg == 1 ? open.left : open.right;
      auto& bore = network.pipes[leg].bore;
      bore = {{0, 1}, {0.2, slim}};
      if (opening < 1) {
        const double narrow = slim * std::sqrt(opening);
        bore.insert(bore.end(), {{open.place - 0.06, slim},
                                 {open.place - 0.05, narrow},
                                 {open.place + 0.05, narrow},
                                 {open.place + 0.06, slim}});
      }
      bore.emplace_back(1, slim);
      network.pipes[leg + 2].bore = {{0, slim}, {1, slim}};
    }
    return network;
  }

  /// Just above the legs: a jet that falls from the top of the stem would have speed enough for any leg.
  /// @param factor of the flow. @param delay [s].
  decant::InletSettings inlet(std::size_t which, double factor = 1, double delay = 0) const {
    decant::InletSettings from_above;
    from_above.position = {0, 0, 0.207};
    from_above.radius = 0.015;
    const auto [volume, seconds] = pour(which);
    constexpr int steps = 30;
    for (int k = 0; k <= steps; ++k) {  // grows and ends smoothly
      const double share = static_cast<double>(k) / steps;
      const double flow = volume / seconds * (1 - std::cos(2 * std::numbers::pi * share));
      from_above.flow.emplace_back(begin + delay + share * seconds, factor * std::max(flow, 0.0));
    }
    return from_above;
  }

  static decant::Bowl bowl() { return {0.09, 0.07, 0.003}; }
  std::array<decant::Pose, 2> bowl_poses() const {
    return {decant::Pose{Eigen::Quaterniond::Identity(), {-reach - 0.01, 0, 0.02}},
            decant::Pose{Eigen::Quaterniond::Identity(), {reach + 0.01, 0, 0.02}}};
  }
};

/// The first one is to develop with, the others to report on.
inline constexpr std::size_t junction_scenarios_to_develop = 1;

inline const std::vector<JunctionScenario>& junction_scenarios() {
  static const std::vector<JunctionScenario> scenarios{
      {0.0105, 0.018, 0.12, 0.010, {{{4.0e-4, 1.5}, {3.4e-4, 1.1}}}},
      {0.0115, 0.019, 0.13, 0.020, {{{4.4e-4, 1.4}, {3.6e-4, 1.5}}}},
      {0.0105, 0.017, 0.11, 0.005, {{{3.6e-4, 1.5}, {4.0e-4, 1.3}}}},
      {0.0110, 0.018, 0.14, 0.015, {{{3.8e-4, 1.3}, {4.2e-4, 1.6}}}},
  };
  return scenarios;
}

}  // namespace example
