// SPDX-License-Identifier: MIT
#pragma once

/// Which interaction to record next, so that it tells apart the effects that those recorded leave: chosen by simulating
/// what would be recorded (Lindley, Annals of Mathematical Statistics 27, 1956).

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/discovery/compared_recordings.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/effect_dictionary.hpp>
#include <decant/discovery/effect_evidence.hpp>
#include <decant/discovery/effect_judgement.hpp>
#include <decant/discovery/forward_model.hpp>
#include <decant/discovery/interaction_runs.hpp>
#include <decant/discovery/missing_effect_result.hpp>
#include <decant/discovery/missing_effect_settings.hpp>

namespace decant::inline DECANT_TARGET {

/// An effect that may be what is missing.
struct PossibleEffect {
  AppliedEffect effect{};
  double probability = 0;  ///< > 0; over the sum of all
};

/// What a further recording would tell.
struct InteractionAdvice {
  std::size_t which = 0;  ///< of those proposed
  double gain = 0;        ///< expected information on which effect it is [bit], >= 0; 0 where the model fails
  double deviation = 0;   ///< of that, standard, of the few recordings that were simulated
  double settles = 0;     ///< how often the right effect would be probable enough to be named, 0 .. 1
};

/// The effects that are left of what was found, the best of each answer, those of less than `least` probability aside.
/// @param effects the models'.
inline std::vector<PossibleEffect> possible_effects(const MissingEffect& result, const std::vector<Effect>& effects,
                                                    double least = 0.02) {
  std::vector<PossibleEffect> left;
  std::vector<std::string> answers;
  for (const RefinedEffect& each : result.refined) {
    const std::string& answer = effects.at(each.effect).answer();
    if (each.probability >= least && std::find(answers.begin(), answers.end(), answer) == answers.end()) {
      answers.push_back(answer);
      left.push_back({each.applied(), each.probability});
    }
  }
  return left;
}

namespace detail {

/// A simulated recording: what is true there, and evidence of each effect.
struct JudgedDraw {
  std::size_t truth = 0;
  std::vector<Evidence> evidence{};
};

/// What recordings tell in the mean. Evidence is taken for as much as it proves to be worth in them: strengths are not
/// known to the last digit, which it does not know of. That is a power of it, the one with which they tell most.
inline void weigh(const std::vector<JudgedDraw>& draws, const std::vector<double>& prior, double sure,
                  InteractionAdvice& advice) {
  for (double power = 1; power > 0.01; power *= 0.7) {
    double weight = 0, sum = 0, square = 0, settled = 0;
    for (const JudgedDraw& draw : draws) {
      std::vector<Evidence> evidence = draw.evidence;
      for (std::size_t k = 0; k < evidence.size(); ++k) {
        evidence[k].value = power * evidence[k].value + std::log(prior[k]);
        evidence[k].deviation *= power;
      }
      constexpr double never = 1e-6;  // no run of a model rules out anything for good
      const double after = std::max(never, probabilities(evidence)[draw.truth]);
      const double gain = std::log2(after / prior[draw.truth]);
      weight += prior[draw.truth];
      sum += prior[draw.truth] * gain;
      square += prior[draw.truth] * gain * gain;
      settled += after >= sure ? prior[draw.truth] : 0;
    }
    if (weight > 0 && sum / weight > advice.gain) {
      advice.gain = sum / weight;
      advice.settles = settled / weight;
      const double variance = std::max(0.0, square / weight - advice.gain * advice.gain);
      advice.deviation = std::sqrt(variance / static_cast<double>(draws.size()));
    }
  }
}

}  // namespace detail

/// How much each of some interactions would tell of which of some effects is missing, the most telling one first. Each
/// effect is taken for the truth in turn: recordings are simulated with it, in which all that is tolerated is drawn,
/// and judged as MissingEffectSearch judges refined effects. The gain is that in the logarithm of the true one's
/// probability, in the mean.
/// @param possible at least two. @param proposed names and models; recordings are not looked at but for which frames
/// and sensors they have, and may be empty: the model then says. @param learnt MissingEffect::learn, by which evidence
/// is weighed. @param simulated recordings for each effect, >= 1. Throws std::invalid_argument for what is out of
/// range.
template <ForwardModel Model>
std::vector<InteractionAdvice> advise_next_interaction(const std::vector<PossibleEffect>& possible,
                                                       std::vector<Interaction<Model>> proposed,
                                                       const GapChange& learnt, const RunJobs& run_jobs,
                                                       const MissingEffectSettings& settings = {}, int simulated = 6) {
  expects(possible.size() >= 2, "advise_next_interaction: possible effects", "at least two", possible.size());
  expects(simulated >= 1, "advise_next_interaction: simulated", ">= 1", simulated);
  double sum = 0;
  std::vector<double> prior;
  for (const PossibleEffect& each : possible) {
    expects(each.probability > 0, "PossibleEffect: probability", "> 0", each.probability);
    sum += each.probability;
  }
  for (const PossibleEffect& each : possible) {
    prior.push_back(each.probability / sum);
  }
  using Run = typename InteractionRuns<Model>::Run;
  const auto seeds = static_cast<std::size_t>(settings.dictionary.baselines);
  const auto draws = static_cast<std::size_t>(simulated);
  const std::vector<PlannedRun> plan = plan_dictionary({}, settings.dictionary);
  std::vector<Run> runs;
  std::set<std::string> names;
  for (Interaction<Model>& each : proposed) {
    expects(names.insert(each.name).second, "advise_next_interaction: names", "all different", each.name);
    expects(each.model != nullptr, "advise_next_interaction: model of '" + each.name + "'", "one", "none");
    if (each.recording.empty()) {
      each.recording = each.model->predict({});
    }
    if (each.recording.empty()) {
      continue;
    }
    for (const PlannedRun& planned : plan) {
      runs.emplace_back(&each, planned.run);
    }
    for (const PossibleEffect& effect : possible) {
      for (std::size_t k = 0; k < seeds; ++k) {  // the same for all effects
        runs.emplace_back(&each, ModelRun{{effect.effect}, static_cast<std::uint32_t>(9001 + k), false});
      }
      for (std::size_t k = 0; k < draws; ++k) {
        runs.emplace_back(&each, ModelRun{{effect.effect}, static_cast<std::uint32_t>(8001 + k), true});
      }
    }
  }
  InteractionRuns<Model> make(run_jobs);
  const std::vector<Observation> seen = make(runs);

  ChanceLevel chance;
  chance.distance = learnt.noise;
  chance.fall = learnt.by_chance;
  std::vector<InteractionAdvice> advice;
  auto next = seen.begin();
  for (std::size_t which = 0; which < proposed.size(); ++which) {
    InteractionAdvice& one = advice.emplace_back();
    one.which = which;
    if (proposed[which].recording.empty()) {
      continue;
    }
    const auto end = next + static_cast<std::ptrdiff_t>(plan.size());
    const EffectDictionary dictionary{{}, plan, {next, end}};
    next = end;
    std::vector<std::vector<Observation>> with;
    const auto drawn = [&, first = next](std::size_t effect, std::size_t draw) {
      return first + static_cast<std::ptrdiff_t>(effect * (seeds + draws) + seeds + draw);
    };
    for (std::size_t effect = 0; effect < possible.size(); ++effect) {
      with.emplace_back(next, next + static_cast<std::ptrdiff_t>(seeds));
      next += static_cast<std::ptrdiff_t>(seeds + draws);
    }
    if (dictionary.of_role(RunRole::Baseline).empty() || dictionary.of_role(RunRole::Draw).size() < 5) {
      continue;  // the model fails there nearly always
    }
    std::vector<detail::JudgedDraw> judged;
    for (std::size_t truth = 0; truth < possible.size(); ++truth) {
      for (std::size_t draw = 0; draw < draws; ++draw) {
        const Observation& recording = *drawn(truth, draw);
        if (recording.empty()) {
          continue;
        }
        const RecordedEvidence recorded(recording, dictionary, settings.evidence);
        detail::JudgedDraw& as = judged.emplace_back();
        as.truth = truth;
        for (const std::vector<Observation>& each : with) {
          const DistanceLeft left = distance_left(std::span(&recorded, 1), each);
          as.evidence.push_back(evidence_of(left.value, left.deviation, chance));
        }
      }
    }
    detail::weigh(judged, prior, settings.sure, one);
  }
  std::stable_sort(advice.begin(), advice.end(), [](const auto& a, const auto& b) { return a.gain > b.gain; });
  return advice;
}

}  // namespace decant::inline DECANT_TARGET
