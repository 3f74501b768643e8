// SPDX-License-Identifier: MIT
#pragma once

/// Which effect is missing, if one is: all of them judged by what recordings say, against what chance says.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/effect_evidence.hpp>

namespace decant::inline DECANT_TARGET {

/// What chance does where nothing is missing, by draws left out.
struct ChanceLevel {
  double distance = 0;              ///< in the mean: what is farther is reducible
  double largest_distance = 0;      ///< beyond it something is off that is not tolerated
  double fall = 0;                  ///< relative_fall by any effect: what is larger is no chance
  double overlap = 0, blurred = 0;  ///< the same of the gaps, over the gap itself
};

/// By how much a distance falls, over what is left of it. What chance does grows with all that nothing explains, such
/// as what a solver has of its own, and that is the scale of what is left: so is the F-test's of linear models.
inline double relative_fall(double before, double after) noexcept { return (before - after) / std::max(after, 1e-12); }

/// Whether what leaves a distance may yet turn out to be what leaves least.
inline bool comes_near(double distance, double best, const ChanceLevel& chance) noexcept {
  return relative_fall(distance, best) < 3 * chance.fall;
}

/// The logarithm of how likely something is [nat], up to a constant, as far as a few runs of a model tell.
struct Evidence {
  double value = 0;
  double deviation = 0;  ///< standard, of the runs
};

/// What recordings say by how much of them is left: noise of a size that is not known has the likelihood d^(-N/2). N is
/// not the number of features, which are not independent, but what makes ChanceLevel::fall as rare as it is: one number
/// more that is fitted takes away more in one of 50 cases (the 0.98 quantile of chi squared with one degree of freedom
/// is 5.41). What is left of next to nothing is no proof without end: less than a hundredth of what chance leaves
/// counts as that.
inline Evidence evidence_of(double distance, double deviation, const ChanceLevel& chance) noexcept {
  const double half = 0.5 * 5.41 / std::log1p(std::max(chance.fall, 1e-3));
  const double left = std::max({distance, 0.01 * chance.distance, 1e-12});
  return {-half * std::log(left), half * deviation / left};
}

/// Of which one is true, all as probable before. Where few runs do not tell evidence well, it says less: each
/// difference to the best is moderated as a classifier's output is (MacKay, Neural Computation 4, 1992).
inline std::vector<double> probabilities(const std::vector<Evidence>& of) {
  std::size_t best = 0;
  for (std::size_t k = 1; k < of.size(); ++k) {
    best = of[k].value > of[best].value ? k : best;
  }
  std::vector<double> result(of.size(), 1);
  double sum = 0;
  for (std::size_t k = 0; k < of.size(); ++k) {
    if (k != best) {
      const double deviation = std::hypot(of[k].deviation, of[best].deviation);
      const double moderation = std::sqrt(1 + 0.125 * std::numbers::pi * deviation * deviation);
      result[k] = std::exp((of[k].value - of[best].value) / moderation);
    }
    sum += result[k];
  }
  for (double& each : result) {
    each /= sum;
  }
  return result;
}

/// What is chance: factors on what draws do, by a quantile of them.
struct JudgementSettings {
  double quantile = 0.98;        ///< 0 .. 1; the largest of many is the larger the more there are
  double distance_factor = 1.3;  ///< >= 1: a solver is farther from reality than its own runs are from each other
  double fall_factor = 1.3;      ///< >= 1
  double gap_factor = 1.3;       ///< >= 1
  double least_share = 0.6;      ///< of what is reducible an effect has to explain, or bring it down to chance; 0 .. 1
  double vote_margin = 0.15;     ///< families this close to the best are not told apart; 0 .. 1
};

/// An effect, as recordings together see it.
struct EffectStanding {
  std::size_t effect = 0;
  Eigen::VectorXd strength{};                         ///< at which it explains most
  std::vector<std::pair<double, double>> interval{};  ///< by component: strengths that chance cannot tell from it
  double distance = 0;                                ///< that is left then
  double improvement = 0;                             ///< of the distance
  double fall = 0;                                    ///< the same over what is left, see relative_fall
  double share = 0;                                   ///< of what is reducible, see share_of_reducible
  double vote = 0;                                    ///< over all gaps, 1 for the best of each; no probability
};

/// What is answered.
enum class Verdict {
  Nothing,      ///< no gap beyond what is tolerated
  Named,        ///< one effect, or one family
  OneOf,        ///< one of several that these recordings do not tell apart
  Unexplained,  ///< there is a gap, and no effect of the catalogue explains it
};

struct Judgement {
  Verdict verdict = Verdict::Nothing;
  std::vector<std::size_t> named{};  ///< numbers in `standings` of what is answered, by vote; the nearest one where the
                                     ///< gap is unexplained
  std::vector<EffectStanding> standings{};  ///< all that something is known of, the best first
  double distance = 0;                      ///< of the model as it is
  ChanceLevel chance{};
  /// Whether all of the distance may be chance: then only what an effect takes away may be a gap.
  bool is_faint() const noexcept { return !(distance > chance.largest_distance); }
  bool has_gap() const noexcept { return !is_faint() || fall() > chance.fall; }
  /// The largest of any effect.
  double fall() const noexcept {
    double best = 0;
    for (const EffectStanding& each : standings) {
      best = std::max(best, each.fall);
    }
    return best;
  }
};

namespace detail {

/// Evidence of several recordings with one and the same effect: means.
struct JointEvidence {
  double distance = 0;
  std::vector<std::optional<StrengthProfile>> profile{};  ///< sums; divide by the number of recordings
  std::vector<double> overlap{}, blurred{};               ///< by effect, over the gap
};

inline JointEvidence joined(const std::vector<EffectEvidence>& of) {
  expects(!of.empty(), "judge_effects: recordings", "at least one", "none");
  JointEvidence result;
  const auto count = static_cast<double>(of.size());
  const std::size_t effects = of.front().profile.size();
  result.profile = of.front().profile;
  result.overlap.assign(effects, 0);
  result.blurred.assign(effects, 0);
  for (std::size_t k = 0; k < of.size(); ++k) {
    expects(of[k].profile.size() == effects, "judge_effects: effects of a recording", "those of the first one",
            of[k].profile.size());
    result.distance += of[k].distance / count;
    for (std::size_t effect = 0; effect < effects; ++effect) {
      if (k > 0) {
        if (result.profile[effect] && of[k].profile[effect]) {
          *result.profile[effect] += *of[k].profile[effect];
        } else {
          result.profile[effect].reset();
        }
      }
      result.overlap[effect] += of[k].overlap.by[effect] / std::max(of[k].overlap.without, 1e-12) / count;
      result.blurred[effect] += of[k].blurred.by[effect] / std::max(of[k].blurred.without, 1e-12) / count;
    }
  }
  return result;
}

/// Between the two values next to it; of none 0.
inline double quantile(std::vector<double> values, double share) {
  if (values.empty()) {
    return 0;
  }
  std::sort(values.begin(), values.end());
  const double place = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return std::lerp(values[below], values[above], place - static_cast<double>(below));
}

inline double largest(const std::vector<double>& values) noexcept {
  double best = 0;
  for (const double value : values) {
    best = std::max(best, value);
  }
  return best;
}

}  // namespace detail

/// What chance does. @param draws by recording and draw: what each draw left out says.
inline ChanceLevel chance_level(const std::vector<std::vector<EffectEvidence>>& draws,
                                const JudgementSettings& settings = {}) {
  expects(!draws.empty(), "chance_level: recordings", "at least one", "none");
  std::size_t count = draws.front().size();
  for (const auto& each : draws) {
    count = std::min(count, each.size());
  }
  expects(count >= 5, "chance_level: draws", "at least 5", count);
  expects(settings.quantile >= 0 && settings.quantile <= 1, "JudgementSettings: quantile", "0 .. 1", settings.quantile);
  std::vector<double> distance, fall, overlap, blurred;  // by draw, the last three the most of any effect
  for (std::size_t draw = 0; draw < count; ++draw) {
    std::vector<EffectEvidence> of;
    for (const auto& each : draws) {
      of.push_back(each[draw]);
    }
    const detail::JointEvidence joint = detail::joined(of);
    distance.push_back(joint.distance);
    fall.push_back(0);
    for (const auto& profile : joint.profile) {
      if (profile) {
        const double left = joint.distance - profile->improvement() / static_cast<double>(of.size());
        fall.back() = std::max(fall.back(), relative_fall(joint.distance, left));
      }
    }
    overlap.push_back(detail::largest(joint.overlap));
    blurred.push_back(detail::largest(joint.blurred));
  }
  ChanceLevel level;
  level.distance =
      settings.distance_factor * std::accumulate(distance.begin(), distance.end(), 0.0) / static_cast<double>(count);
  level.largest_distance = settings.distance_factor * detail::quantile(distance, settings.quantile);
  level.fall = settings.fall_factor * detail::quantile(fall, settings.quantile);
  level.overlap = settings.gap_factor * detail::quantile(overlap, settings.quantile);
  level.blurred = settings.gap_factor * detail::quantile(blurred, settings.quantile);
  return level;
}

/// Of a gap, how much of what is reducible something takes away: at most 1, and at least -1 where it adds to it.
/// @param noise the gap where nothing is missing. @param best that with whatever makes it least, which may be less.
inline double share_of_reducible(double before, double after, double noise, double best) noexcept {
  return std::clamp((before - after) / std::max(before - std::min(noise, best), 1e-12), -1.0, 1.0);
}

/// Judges effects by what one or more recordings say, all of which have the effect at one strength.
/// The vote: the improvement of the distance, twice, and those of the gaps, each over the best effect's; a gap is asked
/// only if it shrinks by more than chance makes it.
/// @param effects in the order of the evidence. Throws std::invalid_argument if evidence does not fit.
inline Judgement judge_effects(const std::vector<Effect>& effects, const std::vector<EffectEvidence>& recordings,
                               const ChanceLevel& chance, const JudgementSettings& settings = {}) {
  const detail::JointEvidence joint = detail::joined(recordings);
  expects(joint.profile.size() == effects.size(), "judge_effects: effects", "as many as in the evidence",
          effects.size());
  const auto count = static_cast<double>(recordings.size());
  Judgement result;
  result.chance = chance;
  result.distance = joint.distance;
  const double best_overlap = detail::largest(joint.overlap), best_blurred = detail::largest(joint.blurred);
  double best_improvement = 0;
  for (std::size_t k = 0; k < effects.size(); ++k) {
    if (!joint.profile[k]) {
      continue;
    }
    const StrengthProfile& profile = *joint.profile[k];
    EffectStanding one;
    one.effect = k;
    one.strength = profile.best();
    one.improvement = profile.improvement() / count;
    one.distance = joint.distance - one.improvement;
    one.fall = relative_fall(joint.distance, one.distance);
    for (std::size_t component = 0; component < profile.components(); ++component) {
      one.interval.push_back(profile.within(component, std::max(chance.fall * one.distance, 1e-9) * count));
    }
    best_improvement = std::max(best_improvement, one.improvement);
    result.standings.push_back(std::move(one));
  }
  for (EffectStanding& one : result.standings) {
    one.share = share_of_reducible(joint.distance, one.distance, chance.distance, joint.distance - best_improvement);
    double votes = 2;
    one.vote = 2 * one.improvement / std::max(best_improvement, 1e-12);
    const auto ask = [&](double by, double best, double by_chance) {
      if (best > by_chance) {
        one.vote += by / best;
        votes += 1;
      }
    };
    ask(joint.overlap[one.effect], best_overlap, chance.overlap);
    ask(joint.blurred[one.effect], best_blurred, chance.blurred);
    one.vote /= votes;
  }
  std::stable_sort(result.standings.begin(), result.standings.end(),
                   [](const auto& a, const auto& b) { return a.vote > b.vote; });
  if (result.standings.empty()) {
    result.verdict = result.is_faint() ? Verdict::Nothing : Verdict::Unexplained;
    return result;
  }
  if (!result.has_gap()) {
    return result;
  }
  const EffectStanding& best = result.standings.front();
  result.named.push_back(0);
  const bool improves = best.fall > chance.fall;
  const bool explains = best.share >= settings.least_share || best.distance <= chance.largest_distance;
  if (!improves || !explains) {
    result.verdict = Verdict::Unexplained;
    return result;
  }
  std::set<std::string> answers{effects[best.effect].answer()};
  for (std::size_t k = 1; k < result.standings.size(); ++k) {
    const EffectStanding& other = result.standings[k];
    if (other.vote >= best.vote - settings.vote_margin && other.fall > chance.fall) {
      if (answers.insert(effects[other.effect].answer()).second) {
        result.named.push_back(k);
      }
    }
  }
  result.verdict = answers.size() > 1 ? Verdict::OneOf : Verdict::Named;
  return result;
}

}  // namespace decant::inline DECANT_TARGET
