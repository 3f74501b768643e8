// SPDX-License-Identifier: MIT
#pragma once

/// Where effects may be that are not where they usually are: where recordings begin to disagree with a model.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/discovery/disagreement.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/forward_model.hpp>

namespace decant::inline DECANT_TARGET {

namespace detail {

/// How long it may take until something is seen of an effect [s].
inline constexpr double latest_sight = 0.3;

}  // namespace detail

/// Effects at the places, and from the times on, where recordings say that they are, without strengths. Of each name
/// the one whose usual place is nearest to that; none that would be far from all that are usual. What may come with a
/// speed is tried with several: jets that fall apart do not overlap, and say nothing of each other.
/// @param models by recording, all with the same effects; at least one. @param where by recording; the first one that
/// disagrees is asked. Throws std::invalid_argument if there are not as many.
template <LocatingModel Model>
std::vector<AppliedEffect> located_effects(const std::vector<const Model*>& models,
                                           const std::vector<std::vector<Disagreement>>& where) {
  expects(!models.empty() && models.size() == where.size(), "located_effects: disagreements", "those of each model",
          where.size());
  constexpr double farthest = 3;  // from the usual place, in its tolerance
  const std::vector<Effect>& effects = models.front()->effects();
  std::map<std::string, std::pair<double, AppliedEffect>> nearest;  // by name, with how far off that is
  for (std::size_t k = 0; k < effects.size(); ++k) {
    const Effect& effect = effects[k];
    if (effect.seen_first == SeenFirst::Nothing || effect.place_tolerance == 0 ||
        effect.kind == EffectKind::Tolerated) {
      continue;
    }
    const Disagreement* onset = nullptr;
    std::size_t recording = 0;
    for (; recording < where.size(); ++recording) {
      onset = earliest(where[recording], effect.seen_first != SeenFirst::Either);
      if (onset != nullptr) {
        break;
      }
    }
    if (onset == nullptr) {
      continue;
    }
    Sighting sighting{onset->camera, {onset->onset_u, onset->onset_v}, onset->begin, {}};
    for (const DisagreeingSquare& square : onset->squares) {
      if (square.begin <= onset->begin) {
        sighting.squares.push_back(square.middle());
      }
    }
    const std::optional<Vector3<double>> place = models[recording]->place_of(k, sighting);
    const double off = place ? (*place - *effect.place).norm() / effect.place_tolerance : farthest;
    const auto other = nearest.find(effect.name);
    if (!(off < farthest) || (other != nearest.end() && other->second.first <= off)) {
      continue;
    }
    AppliedEffect located{k, {}, place, {}, {}};
    if (effect.window && std::isfinite(effect.window->from)) {  // it takes a moment to be seen
      located.window = effect.window;
      located.window->from = std::min(onset->begin - 0.3 * detail::latest_sight, effect.window->until);
    }
    nearest[effect.name] = {off, std::move(located)};
  }
  std::vector<AppliedEffect> located;
  for (const auto& [name, found] : nearest) {
    const double fastest = effects[found.second.effect].fastest;
    constexpr int quarters = 4;
    for (int k = 0; k <= (fastest > 0 ? quarters : 0); ++k) {
      located.push_back(found.second);
      if (fastest > 0) {
        located.back().speed = fastest * k / quarters;
      }
    }
  }
  return located;
}

}  // namespace decant::inline DECANT_TARGET
