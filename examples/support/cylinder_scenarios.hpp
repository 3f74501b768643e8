// SPDX-License-Identifier: MIT
#pragma once

/// Cylinders of water that a robot moves over a table, and how: for recordings of heights in which an effect is hidden.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <stdexcept>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include <decant/core/pose.hpp>
#include <decant/core/types.hpp>

namespace example {

/// Swings along three axes that grow out of rest and go back to it, and a turn about the cylinder's axis.
struct CylinderPath {
  decant::Vector3<double> reach{0, 0, 0};      ///< [m]
  decant::Vector3<double> frequency{0, 0, 0};  ///< [Hz]
  double turn = 0;                             ///< in all [rad]
  double moving = 0;                           ///< [s]

  static constexpr double rest = 0.3;   ///< before [s]
  static constexpr double decay = 1.5;  ///< for which liquid is watched after [s]

  double duration() const { return rest + moving + decay; }  ///< [s]

  /// World from the middle of the cylinder's floor.
  decant::Pose at(double time) const {
    const double share = std::clamp((time - rest) / moving, 0.0, 1.0);
    const double swing = smooth_step(4 * share) * smooth_step(4 * (1 - share));
    decant::Pose pose;
    pose.rotation = Eigen::AngleAxisd(turn * smooth_step(share), Eigen::Vector3d::UnitZ());
    for (decant::Index axis = 0; axis < 3; ++axis) {
      const double angle = 2 * std::numbers::pi * frequency[axis] * share * moving + static_cast<double>(axis);
      pose.translation[axis] = swing * reach[axis] * std::sin(angle);
    }
    return pose;
  }

 private:
  // without a jump in acceleration
  static double smooth_step(double x) {
    x = std::clamp(x, 0.0, 1.0);
    return x * x * x * (10 - 15 * x + 6 * x * x);
  }
};

/// A cylinder, and a path to learn from and another to predict.
struct CylinderScenario {
  double radius = 0, depth = 0;  ///< of the water [m]
  std::array<CylinderPath, 2> paths{};

  /// One of the two, or another like the first: turned by a right angle, in faster and smaller swings, in slower and
  /// larger ones, up and down as well. Throws std::out_of_range for what is none of them.
  CylinderPath path(std::size_t which) const {
    if (which < paths.size()) {
      return paths[which];
    }
    CylinderPath path = paths[0];
    switch (which) {
      case 2:
        std::swap(path.reach.x(), path.reach.y());
        std::swap(path.frequency.x(), path.frequency.y());
        break;
      case 3:
        path.reach *= 0.6;
        path.frequency *= 1.3;
        break;
      case 4:
        path.reach *= 1.5;
        path.frequency *= 0.75;
        break;
      case 5:
        path.reach.z() = 0.04;
        path.frequency.z() = 1.5;
        break;
      default:
        throw std::out_of_range("CylinderScenario::path: expected one of six");
    }
    return path;
  }
};

/// The first ones are to develop with, the others to report on. Paths to learn from are in no upright plane: to
/// heights, a pull and its mirror image would be the same.
inline constexpr std::size_t cylinder_scenarios_to_develop = 2;

inline const std::vector<CylinderScenario>& cylinder_scenarios() {
  static const std::vector<CylinderScenario> scenarios{
      {0.049, 0.078, {{{{0.05, 0.02, 0}, {1.1, 1.5, 0}, 3.1, 3.0}, {{0.03, 0.05, 0.02}, {1.3, 0.9, 0.7}, 0, 3.4}}}},
      {0.042, 0.065, {{{{0.04, 0.03, 0}, {1.2, 1.2, 0}, 0, 2.8}, {{0, 0.06, 0}, {0, 1.0, 0}, 1.6, 3.2}}}},
      {0.055, 0.070, {{{{0.06, 0.02, 0}, {0.9, 1.4, 0}, 1.6, 3.2}, {{0.04, 0, 0.03}, {1.2, 0, 1.0}, 0, 3.0}}}},
      {0.045, 0.085, {{{{0.03, 0.04, 0.02}, {1.3, 1.0, 0.8}, 0, 3.2}, {{0.05, 0.03, 0}, {1.0, 1.3, 0}, 3.1, 2.8}}}},
      {0.050, 0.060, {{{{0.02, 0.05, 0.02}, {1.4, 1.1, 1.2}, 4.7, 3.0}, {{0.06, 0.03, 0}, {0.8, 1.2, 0}, 0, 3.4}}}},
      {0.040, 0.075, {{{{0.05, 0.05, 0}, {1.0, 0.8, 0}, 0, 3.4}, {{0.03, 0, 0.02}, {1.4, 0, 0.9}, 3.1, 2.8}}}},
      {0.052, 0.080, {{{{0.04, 0.02, 0.03}, {1.3, 0.9, 0.7}, 3.1, 3.0}, {{0.05, 0.04, 0}, {0.9, 1.1, 0}, 1.6, 3.2}}}},
  };
  return scenarios;
}

}  // namespace example
