// SPDX-License-Identifier: MIT
#pragma once

/// The pours of experiments: which there are, and how they are recorded.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "experiment_folder.hpp"
#include "pour_twin.hpp"

namespace example {

/// A recording of an experiment: its folder's name and how it is made.
struct Pour {
  std::string name;
  PourTwin twin;
};

inline Pour pour(const std::string& prefix, const std::string& container, int percent, std::uint32_t seed) {
  PourTwin twin;
  twin.container = container;
  twin.fill_fraction = 0.01 * percent;
  twin.seed = seed;
  return {prefix + container + "_" + std::to_string(percent) + "_" + std::to_string(seed), twin};
}

/// The paper's: cup and bottle, three amounts, two trials each.
inline std::vector<Pour> paper_pours() {
  std::vector<Pour> pours;
  std::uint32_t seed = 0;
  for (const char* container : {"cup", "bottle"}) {
    for (const int percent : {30, 60, 90}) {
      for (int trial = 0; trial < 2; ++trial) {
        pours.push_back(pour("", container, percent, ++seed));
      }
    }
  }
  return pours;
}

inline bool has_pour(const std::vector<Pour>& pours, const std::string& name) {
  return std::any_of(pours.begin(), pours.end(), [&](const Pour& each) { return each.name == name; });
}

/// Those of the names; all if there are no names.
inline void keep_pours(std::vector<Pour>& pours, const std::vector<std::string>& names) {
  std::erase_if(pours, [&](const Pour& each) {
    return !names.empty() && std::find(names.begin(), names.end(), each.name) == names.end();
  });
}

/// @param spacing of the reality's particles [m]. @param duration [s].
inline ExperimentRecording recording_of(const Pour& pour, double spacing, double duration) {
  PourTwin twin = pour.twin;
  twin.threads = 1;  // recordings are made side by side
  twin.spacing = spacing;
  twin.duration = duration;
  const auto frames = static_cast<std::size_t>(std::lround(duration * twin.frames_per_second));
  return {pour.name, twin.seed, spacing, frames,
          [twin](const auto& folder, const auto& progress) { record_pour(twin, folder, progress); }};
}

}  // namespace example
