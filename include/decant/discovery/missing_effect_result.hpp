// SPDX-License-Identifier: MIT
#pragma once

/// What the workflow that finds what a model lacks comes to.

#include <algorithm>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/discovery/disagreement.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/effect_judgement.hpp>
#include <decant/discovery/forward_model.hpp>
#include <decant/discovery/smallest_seen.hpp>

namespace decant::inline DECANT_TARGET {

/// An effect with what is known of it after refinement.
struct RefinedEffect {
  std::size_t effect = 0;  ///< its number among the model's
  std::size_t judged = 0;  ///< and in MissingEffect::judged
  Eigen::VectorXd strength{};
  Eigen::VectorXd deviation{};             ///< standard deviation, by component
  std::optional<Vector3<double>> place{};  ///< [m], where it was looked for
  std::optional<TimeWindow> window{};      ///< likewise
  std::optional<double> speed{};           ///< [m/s], likewise
  double distance = 0;                     ///< that is left of the recordings it was found in
  double share = 0;                        ///< of what is reducible, at most 1
  double grown = 0;                        ///< by how much the gap grows at some moments, see grown_gap
  /// That it is what is missing, alone, if one of those that were refined first is; by all recordings.
  double probability = std::numeric_limits<double>::quiet_NaN();

  AppliedEffect applied() const { return {effect, strength, place, window, speed}; }
  /// Strengths that hold the truth with 90 %, by component.
  std::pair<double, double> interval_90(std::size_t component) const {
    const auto k = static_cast<Eigen::Index>(component);
    return {strength[k] - 1.645 * deviation[k], strength[k] + 1.645 * deviation[k]};
  }
};

/// Whether any of an effect's components is stronger than is tolerated, as far as its interval tells; no if that is not
/// known.
inline bool is_beyond_tolerance(const RefinedEffect& found, const Effect& effect) {
  for (std::size_t k = 0; k < effect.components.size(); ++k) {
    const EffectComponent& of = effect.components[k];
    const auto [low, high] = found.interval_90(k);
    if (low > of.base + of.tolerance || high < of.base - of.tolerance) {
      return true;
    }
  }
  return false;
}

/// Whether any of an effect's components came to a limit of what is looked for, and would go on. The base is none.
inline bool is_at_limit(const RefinedEffect& found, const Effect& effect) {
  for (std::size_t k = 0; k < effect.components.size(); ++k) {
    const auto [low, high] = effect.components[k].limits();
    const double strength = found.strength[static_cast<Eigen::Index>(k)], base = effect.components[k].base;
    const double close = 1e-6 * (high - low);  // strengths are rounded
    if ((high > base && strength >= high - close) || (low < base && strength <= low + close)) {
      return true;
    }
  }
  return false;
}

/// Whether an effect that was found also explains recordings that were not used.
enum class Confirmation {
  Untested,     ///< there were no such recordings, or nothing was found
  NotTestable,  ///< they show no gap
  Confirmed,    ///< their gap shrinks by more than chance, by more than with any rival, and at all times
  Refuted       ///< it does not
};

/// How a gap changed, in the workflow's own distance: about 1 to 1.5 where nothing is missing, see NuisanceSpace.
struct GapChange {
  double before = std::numeric_limits<double>::quiet_NaN();
  double after = std::numeric_limits<double>::quiet_NaN();
  double noise = std::numeric_limits<double>::quiet_NaN();       ///< where nothing is missing, in the mean
  double by_chance = std::numeric_limits<double>::quiet_NaN();   ///< a smaller relative_fall than this is none
  double best_rival = std::numeric_limits<double>::quiet_NaN();  ///< after with the best other effect of those refined

  double share() const noexcept { return share_of_reducible(before, after, noise, after); }
};

/// What was found.
struct MissingEffect {
  Verdict verdict = Verdict::Nothing;
  std::vector<RefinedEffect> found{};  ///< one after another; of OneOf the best of the first ones
  std::vector<RefinedEffect>
      refined{};                      ///< all that were looked at closely in the first round, the most probable first
  std::vector<std::size_t> one_of{};  ///< of OneOf: numbers of effects that are not told apart
  bool told_apart_by_others = false;  ///< the recordings learnt from leave several; those held out, one of them
  Judgement judgement{};              ///< of the first round, before refinement
  std::vector<Effect> judged{};       ///< what its numbers are of: the models' effects, and then those of them that
                                      ///< were also tried where recordings begin to disagree
  std::vector<std::vector<Disagreement>> where{};              ///< in pictures, by recording, before anything was added
  std::vector<std::vector<ReadingDisagreement>> where_read{};  ///< the same of sensors
  std::vector<SmallestSeen> smallest_seen{};                   ///< of each effect that is judged
  GapChange learn{}, held_out{};
  Confirmation confirmation = Confirmation::Untested;
  std::vector<AppliedEffect> surroundings{};  ///< that were taken to be there, see EffectKind
  std::size_t taught_by = 0;  ///< references that look like each of the recordings: these are compared without what
                              ///< reality does differently all the same
  std::size_t lessons = 0;    ///< references of other interactions whose ReferenceLesson was taken off, where none look
                              ///< alike
  std::size_t runs = 0;       ///< of models

  /// What explains most of those that were refined, whatever it takes for it; nothing if none was.
  const RefinedEffect* nearest() const noexcept {
    const auto least = std::min_element(refined.begin(), refined.end(),
                                        [](const auto& a, const auto& b) { return a.distance < b.distance; });
    return least == refined.end() ? nullptr : &*least;
  }

  /// The mended model is one that runs with these.
  std::vector<AppliedEffect> mended() const {
    std::vector<AppliedEffect> all = surroundings;
    for (const RefinedEffect& each : found) {
      all.push_back(each.applied());
    }
    return all;
  }
};

}  // namespace decant::inline DECANT_TARGET
