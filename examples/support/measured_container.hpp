// SPDX-License-Identifier: MIT
#pragma once

/// Containers of which only a scale and a ruler tell the shape: what they hold by height, and a body that holds as
/// much.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <numbers>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include <decant/boundary/shapes.hpp>
#include <decant/core/expects.hpp>

#include "monotone_curve.hpp"
#include "number_table.hpp"

namespace example {

/// How high so much water stands in a container.
struct FillReading {
  double level;   ///< above the floor [m]
  double volume;  ///< [m^3]
};

/// Readings of one container, in order of level.
struct FillReadings {
  FillReading empty, full;            ///< what is known of its inner depth and of what it holds
  std::vector<FillReading> partly{};  ///< in between

  /// Every other reading in between, from the first (0) or the second (1) on.
  std::vector<FillReading> every_other(std::size_t first) const {
    std::vector<FillReading> chosen;
    for (std::size_t k = first; k < partly.size(); k += 2) {
      chosen.push_back(partly[k]);
    }
    return chosen;
  }
};

inline constexpr double water_density = 998.2;  ///< at 20 degrees [kg/m^3]

/// Reads a table `mm,g`: the distance from the rim down to the water, and its mass. The first row is the empty
/// container, one row has 0 mm. Throws std::runtime_error.
inline FillReadings read_fill_readings(const std::filesystem::path& file) {
  const auto rows = read_numbers(file, 2);
  FillReadings readings{};
  bool is_full = false;
  for (const auto& row : rows) {
    const FillReading reading{1e-3 * (rows.front()[0] - row[0]), 1e-3 * row[1] / water_density};
    if (row[1] == 0) {
      readings.empty = reading;
    } else if (row[0] == 0) {
      readings.full = reading;
      is_full = true;
    } else {
      readings.partly.push_back(reading);
    }
  }
  if (!is_full || rows.front()[1] != 0) {
    throw std::runtime_error(file.string() + ": must have a first row with 0 g and one with 0 mm");
  }
  std::sort(readings.partly.begin(), readings.partly.end(), [](const FillReading& a, const FillReading& b) {
    return a.level != b.level ? a.level < b.level : a.volume < b.volume;
  });
  return readings;
}

/// What a container holds below a level, through some of its readings and those of its floor and rim. The floor is
/// where the level is 0 and the volume too; all else has noise.
inline MonotoneCurve fill_curve(const FillReadings& readings, const std::vector<FillReading>& used) {
  std::vector<MonotoneCurve::Reading> points{{readings.empty.level, readings.empty.volume}};
  for (const FillReading& reading : used) {
    points.push_back({reading.level, reading.volume});
  }
  points.push_back({readings.full.level, readings.full.volume});
  return MonotoneCurve(points, true);
}

/// A body of revolution that holds what the curve says: its cross-section is the curve's slope, A = dV/dz.
inline decant::Revolved container_of(const MonotoneCurve& volume_below, double wall = 0.003) {
  constexpr int steps = 48;
  std::vector<Eigen::Vector2d> inside;
  for (int k = 0; k <= steps; ++k) {
    const double height = std::lerp(volume_below.begin(), volume_below.end(), static_cast<double>(k) / steps);
    inside.emplace_back(std::sqrt(volume_below.slope(height) / std::numbers::pi), height);
  }
  decant::Revolved body;
  body.profile.emplace_back(0, -wall);
  body.profile.emplace_back(inside.front()[0] + wall, -wall);
  for (const Eigen::Vector2d& point : inside) {
    body.profile.emplace_back(point[0] + wall, point[1]);
  }
  body.profile.insert(body.profile.end(), inside.rbegin(), inside.rend());
  body.profile.emplace_back(0, 0);
  return body;
}

/// A SeriesModel of one channel, the level [m] above the floor, of which the only parameter is the volume [m^3]: what
/// was simulated at some volumes, and straight lines in between.
struct SettledLevels {
  std::vector<double> volume{};  ///< increasing, at least two
  std::vector<double> level{};   ///< at which each has settled

  double level_of(double amount) const {
    const auto above = std::lower_bound(volume.begin() + 1, volume.end() - 1, amount);
    const auto k = static_cast<std::size_t>(above - volume.begin());
    return std::lerp(level[k - 1], level[k], (amount - volume[k - 1]) / (volume[k] - volume[k - 1]));
  }

  std::vector<std::vector<double>> predict(std::span<const double> parameters, std::span<const double> times) const {
    decant::expects(parameters.size() == 1, "SettledLevels: number of parameters", "1", parameters.size());
    return {std::vector<double>(times.size(), level_of(parameters[0]))};
  }
};

}  // namespace example
