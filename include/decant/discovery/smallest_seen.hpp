// SPDX-License-Identifier: MIT
#pragma once

/// How strong an effect would have had to be to be seen: what makes an answer of "nothing" an answer.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/target.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/effect_curve.hpp>
#include <decant/discovery/effect_evidence.hpp>
#include <decant/discovery/effect_judgement.hpp>

namespace decant::inline DECANT_TARGET {

/// The least strengths of an effect's component, to both sides of its base, that would have been told from chance in
/// about nine of ten recordings; NaN where none would have been up to the end of the range.
struct SmallestSeen {
  std::size_t effect = 0, component = 0;
  double below = std::numeric_limits<double>::quiet_NaN(), above = std::numeric_limits<double>::quiet_NaN();
};

/// Of each effect that all recordings have runs of, by the energy that it has in them together.
/// @param recorded at least one. @param least_share of those that were simulated, see DictionarySettings::shares.
inline std::vector<SmallestSeen> smallest_seen(const std::vector<Effect>& effects,
                                               const std::vector<RecordedEvidence>& recorded, const ChanceLevel& chance,
                                               double least_share) {
  // Three times the strength at which energy is what chance may explain: a recording has noise of its own, and a curve
  // does not follow all that happens at strengths that were not simulated. Measured on thrown balls, for nine of ten.
  constexpr double margin = 3 * 3;
  const double needed = margin * chance.fall * chance.distance * static_cast<double>(recorded.size());
  std::vector<double> chaos;
  for (const RecordedEvidence& each : recorded) {
    chaos.push_back(each.chaos());
  }
  std::vector<SmallestSeen> result;
  for (std::size_t effect = 0; effect < effects.size(); ++effect) {
    std::vector<EffectCurve> curves;  // by recording
    for (const RecordedEvidence& each : recorded) {
      if (auto curve = each.curve(effect)) {
        curves.push_back(std::move(*curve));
      }
    }
    if (curves.size() < recorded.size()) {
      continue;
    }
    for (std::size_t component = 0; component < effects[effect].components.size(); ++component) {
      const EffectComponent& of = effects[effect].components[component];
      const auto energy = [&](double strength) {
        Eigen::VectorXd at = effects[effect].base();
        at[static_cast<Eigen::Index>(component)] = strength;
        double sum = 0;
        for (std::size_t k = 0; k < curves.size(); ++k) {
          sum += curves[k].energy(at, chaos[k]);
        }
        return sum;
      };
      const auto least = [&](double end) {
        const auto at = [&](double share) { return of.base + share * (end - of.base); };
        if (end == of.base || energy(end) <= needed) {
          return std::numeric_limits<double>::quiet_NaN();
        }
        // Below what was simulated, energy grows with the square of the strength at first, and less from where things
        // are off by more than a feature's size on: so it is at least so large.
        if (const double there = energy(at(least_share)); there > needed) {
          return at(least_share * std::sqrt(needed / there));
        }
        double unseen = least_share, seen = 1;
        for (int halving = 0; halving < 20; ++halving) {
          const double half = 0.5 * (unseen + seen);
          (energy(at(half)) > needed ? seen : unseen) = half;
        }
        return at(seen);
      };
      result.push_back({effect, component, least(of.low), least(of.high)});
    }
  }
  return result;
}

}  // namespace decant::inline DECANT_TARGET
