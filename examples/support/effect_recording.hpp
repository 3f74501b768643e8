// SPDX-License-Identifier: MIT
#pragma once

/// Records cases in which something is hidden, whatever they are of: pours, cylinders that a robot moves, pipe
/// junctions.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <functional>

#include "effect_cases.hpp"
#include "effect_scenarios.hpp"
#include "effect_twin.hpp"
#include "junction_effect_twin.hpp"
#include "moved_cylinder_twin.hpp"

namespace example {

inline bool is_of_cylinder(const EffectCase& of) {
  const auto kind = case_kinds().find(of.kind);  // a reference has none
  return kind != case_kinds().end() && is_of_cylinder(kind->second);
}

inline bool is_of_junction(const EffectCase& of) { return of.kind == word(CaseKind::Junction); }

/// Of the reality's particles [m]; a cylinder holds three times what is poured, and a junction takes twice as much.
inline double reality_spacing(const EffectCase& of, const EffectRecordingSettings& settings) {
  return is_of_cylinder(of) ? 1.6 * settings.spacing : is_of_junction(of) ? 1.1 * settings.spacing : settings.spacing;
}

/// How many frames a recording of a case has. @param which 0: a, to learn from; 1: b, to be predicted; then further
/// ones.
inline std::size_t case_frames(const EffectCase& of, std::size_t which, const EffectRecordingSettings& settings) {
  if (is_of_cylinder(of)) {
    return static_cast<std::size_t>(cylinder_frames(of, which, settings));
  }
  if (is_of_junction(of)) {
    return static_cast<std::size_t>(junction_frames(of, which, settings));
  }
  const double seconds = std::min(effect_scenarios().at(of.scenario).pour(which).duration, settings.longest);
  return static_cast<std::size_t>(std::max(1L, std::lround(seconds * settings.frames_per_second)));
}

/// See record_effect_pour, record_moved_cylinder and record_effect_junction.
inline void record_case(const EffectCase& of, std::size_t which, const std::filesystem::path& folder,
                        EffectRecordingSettings settings, const std::function<void(double)>& progress) {
  settings.spacing = reality_spacing(of, settings);
  if (is_of_cylinder(of)) {
    record_moved_cylinder(of, which, folder, settings, progress);
  } else if (is_of_junction(of)) {
    record_effect_junction(of, which, folder, settings, progress);
  } else {
    record_effect_pour(of, which, folder, settings, progress);
  }
}

}  // namespace example
