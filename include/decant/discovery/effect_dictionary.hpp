// SPDX-License-Identifier: MIT
#pragma once

/// Runs of a forward model that tell what each effect would change, and what differs anyway.

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/forward_model.hpp>
#include <decant/discovery/observation.hpp>

namespace decant::inline DECANT_TARGET {

/// What a run is for.
enum class RunRole {
  Baseline,  ///< the model as it is
  Draw,      ///< with all that is tolerated drawn at random
  Template,  ///< with an error of measurement of one tolerance that is taken account of, not named
  Effect     ///< with an effect at some strength
};

struct PlannedRun {
  RunRole role = RunRole::Baseline;
  std::size_t effect = 0;  ///< of templates and effects
  ModelRun run{};
};

/// How many runs there are.
struct DictionarySettings {
  int baselines = 4;                      ///< >= 1
  int draws = 48;                         ///< >= 5: with few of them much passes for chance that is not
  std::vector<double> shares{0.35, 1.0};  ///< of the range to each side of an effect's base, in (0, 1]; at least one
  int repeats = 4;                        ///< at most, of the strongest run to each side, >= 0; see repeats_of_faint
};

/// The runs for all effects that are looked for. Seeds follow from the run's number in its role, so that runs of one
/// model and settings are the same ones whatever recording they are compared with; those of effects that are only
/// tolerated are counted as well, so that the others are the same ones whatever is looked for.
/// @param added effects that the model has been given already: all runs have them, but for those that are about one of
/// them. Throws std::invalid_argument if settings are out of range.
inline std::vector<PlannedRun> plan_dictionary(const std::vector<Effect>& effects,
                                               const DictionarySettings& settings = {},
                                               const std::vector<AppliedEffect>& added = {}) {
  expects(settings.baselines >= 1, "DictionarySettings: baselines", ">= 1", settings.baselines);
  expects(settings.draws >= 5, "DictionarySettings: draws", ">= 5", settings.draws);
  expects(!settings.shares.empty(), "DictionarySettings: shares", "at least one", "none");
  expects(settings.repeats >= 0, "DictionarySettings: repeats", ">= 0", settings.repeats);
  for (const double share : settings.shares) {
    expects(share > 0 && share <= 1, "DictionarySettings: share", "in (0, 1]", share);
  }
  std::vector<PlannedRun> runs;
  for (int k = 0; k < settings.baselines; ++k) {
    runs.push_back({RunRole::Baseline, 0, {added, static_cast<std::uint32_t>(k + 1), false}});
  }
  for (int k = 0; k < settings.draws; ++k) {
    runs.push_back({RunRole::Draw, 0, {added, static_cast<std::uint32_t>(1001 + k), true}});
  }
  std::uint32_t seed = 2001;
  for (std::size_t which = 0; which < effects.size(); ++which) {
    const Effect& effect = effects[which];
    validate(effect);
    if (effect.kind == EffectKind::Surroundings) {
      continue;
    }
    for (std::size_t component = 0; component < effect.components.size(); ++component) {
      const EffectComponent& of = effect.components[component];
      const auto add = [&](RunRole role, double strength, std::uint32_t with) {
        AppliedEffect applied{which, effect.base(), {}};
        applied.strength[static_cast<Eigen::Index>(component)] = strength;
        PlannedRun planned{role, which, {added, with, false}};
        std::erase_if(planned.run.effects, [which](const AppliedEffect& other) { return other.effect == which; });
        planned.run.effects.push_back(std::move(applied));
        runs.push_back(std::move(planned));
      };
      if (effect.kind == EffectKind::Nuisance) {
        if (of.tolerance > 0) {
          add(RunRole::Template, of.base + of.tolerance, 1);  // beside the first baseline
        }
        continue;
      }
      for (const double end : {of.low, of.high}) {
        for (const double share : settings.shares) {
          if (end == of.base) {
            continue;
          }
          if (effect.kind != EffectKind::Tolerated) {
            add(RunRole::Effect, of.base + share * (end - of.base), seed);
          }
          ++seed;
        }
      }
    }
  }
  return runs;
}

/// Whether an effect is as strong as it is in any run to that side.
inline bool is_strongest(const Effect& effect, const Eigen::VectorXd& strength, const DictionarySettings& settings) {
  const double largest = *std::max_element(settings.shares.begin(), settings.shares.end());
  for (std::size_t k = 0; k < effect.components.size(); ++k) {
    const EffectComponent& of = effect.components[k];
    const double more = strength[static_cast<Eigen::Index>(k)] - of.base;
    const double end = (more < 0 ? of.low : of.high) - of.base;
    if (more != 0 && std::abs(more) >= (largest - 1e-9) * std::abs(end)) {
      return true;
    }
  }
  return false;
}

/// What a run depends on beside its model, as text: for journals.
inline std::string run_key(const std::vector<Effect>& effects, const ModelRun& run) {
  const auto text = [](double value) {
    std::array<char, 40> digits{};  // as many as tell one number from the next, whatever the locale
    return std::string(digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr);
  };
  std::string key = "seed " + std::to_string(run.seed) + (run.tolerated ? " tolerated" : "");
  for (const AppliedEffect& applied : run.effects) {
    const Effect& effect = effects.at(applied.effect);
    key += ", ";
    key += effect.words();
    key += " =";
    for (const double strength : applied.strength) {
      key += ' ';
      key += text(strength);
    }
    if (applied.place) {
      key += " at";
      for (const double x : *applied.place) {
        key += ' ';
        key += text(x);
      }
    }
    if (applied.window) {
      key += " from " + text(applied.window->from);
      key += " until " + text(applied.window->until);
    }
    if (applied.speed) {
      key += " with " + text(*applied.speed);
    }
  }
  return key;
}

/// Runs with what they came to.
struct EffectDictionary {
  std::vector<Effect> effects{};
  std::vector<PlannedRun> runs{};
  std::vector<Observation> seen{};  ///< by run; of runs that failed empty

  bool worked(std::size_t run) const { return !seen.at(run).empty(); }
  /// Numbers of the runs of a role that did not fail.
  std::vector<std::size_t> of_role(RunRole role) const {
    std::vector<std::size_t> which;
    for (std::size_t k = 0; k < runs.size(); ++k) {
      if (runs[k].role == role && worked(k)) {
        which.push_back(k);
      }
    }
    return which;
  }
  /// Of those the ones of an effect.
  std::vector<std::size_t> of_effect(std::size_t effect) const {
    std::vector<std::size_t> which;
    for (const std::size_t k : of_role(RunRole::Effect)) {
      if (runs[k].effect == effect) {
        which.push_back(k);
      }
    }
    return which;
  }
  /// The strength of an effect's run.
  const Eigen::VectorXd& strength(std::size_t run) const { return runs.at(run).run.effects.back().strength; }
};

}  // namespace decant::inline DECANT_TARGET
