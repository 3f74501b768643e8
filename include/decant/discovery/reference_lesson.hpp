// SPDX-License-Identifier: MIT
#pragma once

/// What a recording in which nothing is missing teaches about recordings of other interactions.

#include <cmath>
#include <cstddef>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <decant/core/target.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/effect_dictionary.hpp>
#include <decant/discovery/nuisance_space.hpp>

namespace decant::inline DECANT_TARGET {

/// How a recording differs from its model, in terms of what effects would change. Pixels of one pour say nothing of
/// those of another one; but a reality that pours later than the model, or nearer to the cup, as with more of some
/// effects and less of others, does so whatever the container and its motion. The effects do not have to be there:
/// together they are a basis in which all interactions of a model have the same coordinates.
struct ReferenceLesson {
  /// A run with an effect: its side, and how strong it is over the end of the range there.
  using Run = std::pair<std::string, double>;
  std::map<Run, double> parts{};  ///< how much of what such a run changes there seems to be
};

/// Of several references.
struct ReferenceLessons {
  std::vector<ReferenceLesson> of_reference{};
  double error = 0.5;  ///< how much of what they have in common may not carry over, see NuisanceSample::reference_error
};

/// What an effect changes at a strength.
struct EffectChange {
  std::string side{};  ///< see effect_side
  double share = 0;    ///< of the range to that side, > 0
  Eigen::VectorXd change{};
};

/// An effect's component to one side of its base, in all models that know the effect.
inline std::string effect_side(const Effect& effect, std::size_t component, bool upper) {
  return effect.words() + ' ' + std::to_string(component) + (upper ? " more" : " less");
}

/// What runs with effects change, those of one strength in the mean.
/// @param features of a run that worked, p of them. @param center p features of the model as it is.
template <class Features>
std::vector<EffectChange> effect_changes(const EffectDictionary& dictionary, const Features& features,
                                         const Eigen::VectorXd& center) {
  std::map<ReferenceLesson::Run, std::vector<std::size_t>> runs;
  for (const std::size_t run : dictionary.of_role(RunRole::Effect)) {
    const Effect& effect = dictionary.effects[dictionary.runs[run].effect];
    for (std::size_t component = 0; component < effect.components.size(); ++component) {
      const EffectComponent& of = effect.components[component];
      const double more = dictionary.strength(run)[static_cast<Eigen::Index>(component)] - of.base;
      if (more != 0) {
        const double share = more / ((more < 0 ? of.low : of.high) - of.base);
        runs[{effect_side(effect, component, more > 0), std::round(1e6 * share) / 1e6}].push_back(run);
      }
    }
  }
  std::vector<EffectChange> changes;
  for (const auto& [of, which] : runs) {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(center.size());
    for (const std::size_t run : which) {
      sum += features(run) - center;
    }
    changes.push_back({of.first, of.second, sum / static_cast<double>(which.size())});
  }
  return changes;
}

/// The parts c that leave least of a residual r: |r - G c|^2 + l |c|^2 is smallest, G being what runs change and
/// distances those of the space. What do nearly the same share what is to be explained between them (ridge regression:
/// Hoerl and Kennard, Technometrics 12, 1970).
/// @param residual in features. @param held_back l > 0.
inline ReferenceLesson lesson_of(const Eigen::VectorXd& residual, const std::vector<EffectChange>& changes,
                                 const NuisanceSpace& space, double held_back) {
  const auto count = static_cast<Eigen::Index>(changes.size());
  const Eigen::VectorXd off = space.standardised_difference(residual);
  std::vector<Eigen::VectorXd> by;
  for (const EffectChange& each : changes) {
    by.push_back(space.standardised_difference(each.change));
  }
  Eigen::MatrixXd normal(count, count);
  Eigen::VectorXd answer(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::VectorXd& own = by[static_cast<std::size_t>(i)];
    answer[i] = space.inner(own, off);
    for (Eigen::Index j = 0; j <= i; ++j) {
      normal(i, j) = normal(j, i) = space.inner(own, by[static_cast<std::size_t>(j)]);
    }
    normal(i, i) += held_back;
  }
  const Eigen::VectorXd solved = normal.ldlt().solve(answer);
  ReferenceLesson lesson;
  for (Eigen::Index k = 0; k < count; ++k) {
    const EffectChange& of = changes[static_cast<std::size_t>(k)];
    lesson.parts[{of.side, of.share}] = solved[k];
  }
  return lesson;
}

/// What a recording is expected to be off its model by. Where there are no runs of a strength, those nearest to it
/// stand for it, in proportion; effects that are not known here change nothing.
inline Eigen::VectorXd expected_residual(const ReferenceLesson& lesson, const std::vector<EffectChange>& changes,
                                         Eigen::Index features) {
  Eigen::VectorXd residual = Eigen::VectorXd::Zero(features);
  for (const auto& [run, part] : lesson.parts) {
    const auto& [side, share] = run;
    const EffectChange* nearest = nullptr;
    for (const EffectChange& each : changes) {
      if (each.side == side &&
          (nearest == nullptr || std::abs(each.share - share) < std::abs(nearest->share - share))) {
        nearest = &each;
      }
    }
    if (nearest != nullptr) {
      residual += part * share / nearest->share * nearest->change;
    }
  }
  return residual;
}

}  // namespace decant::inline DECANT_TARGET
