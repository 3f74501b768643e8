// SPDX-License-Identifier: MIT
#pragma once

/// Recordings beside dictionaries of runs: what they say of each effect, and what chance says.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/discovery/disagreement.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/effect_dictionary.hpp>
#include <decant/discovery/effect_evidence.hpp>
#include <decant/discovery/effect_judgement.hpp>
#include <decant/discovery/effect_location.hpp>
#include <decant/discovery/forward_model.hpp>
#include <decant/discovery/interaction_runs.hpp>
#include <decant/discovery/missing_effect_settings.hpp>
#include <decant/discovery/nuisance_space.hpp>
#include <decant/discovery/observation.hpp>

namespace decant::inline DECANT_TARGET {

/// What recordings say of a model.
struct ComparedRecordings {
  std::vector<Effect> effects{};      ///< of which there are runs
  std::vector<std::size_t> number{};  ///< of each among the model's
  std::vector<EffectDictionary> dictionary{};
  std::vector<RecordedEvidence> recorded{};
  std::vector<EffectEvidence> evidence{};
  ChanceLevel chance{};
};

/// What is left of recordings.
struct DistanceLeft {
  double value = 0;      ///< in the mean
  double deviation = 0;  ///< standard, of the few runs; by leaving out one of them at a time
  double grown = 0;      ///< see grown_gap; the most of any recording
};

namespace detail {

/// With the mean of some runs in place of the model as it is. What few runs' mean is off by through their own chaos is
/// taken off, as that of many is not. Infinite where a run failed. @param middle of the runs' features, if none failed.
inline double distance_left(const RecordedEvidence& of, const std::optional<Eigen::VectorXd>& middle,
                            std::size_t runs) {
  if (!middle) {
    return std::numeric_limits<double>::infinity();
  }
  const double distance = of.space().distance(of.space().standardised_difference(of.recorded_features() - *middle));
  return std::max(0.0, distance - of.chaos() / static_cast<double>(runs));
}

}  // namespace detail

/// What is left with the mean of some runs in place of the model as it is; infinite where a run failed.
/// @param runs as many of each recording in turn.
inline DistanceLeft distance_left(std::span<const RecordedEvidence> recorded, std::span<const Observation> runs) {
  DistanceLeft left;
  double variance = 0;
  const auto count = static_cast<double>(recorded.size());
  const std::size_t seeds = runs.size() / recorded.size();
  for (const RecordedEvidence& of : recorded) {
    const std::vector<Observation> own(runs.begin(), runs.begin() + static_cast<std::ptrdiff_t>(seeds));
    runs = runs.subspan(seeds);
    const auto middle = of.mean_features(own);
    left.value += detail::distance_left(of, middle, seeds) / count;
    left.grown = std::max(left.grown, middle ? of.gap_grown(*middle) : 0);
    // the jackknife (Efron and Tibshirani, An Introduction to the Bootstrap, 1993)
    double sum = 0, squares = 0;
    for (std::size_t k = 0; seeds > 1 && k < seeds; ++k) {
      std::vector<Observation> others = own;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
      const double one = detail::distance_left(of, of.mean_features(others), seeds - 1);
      sum += one;
      squares += one * one;
    }
    const auto runs_of = static_cast<double>(seeds);
    variance += std::max(0.0, squares - sum * sum / runs_of) * (runs_of - 1) / runs_of / (count * count);
  }
  left.deviation = std::isfinite(left.value) ? std::sqrt(variance) : 0;
  return left;
}

/// The same, set after set. @param runs `seeds` of them for each recording in turn, set after set.
template <ForwardModel Model>
std::vector<DistanceLeft> distances_left(InteractionRuns<Model>& make,
                                         const std::vector<typename InteractionRuns<Model>::Run>& runs,
                                         std::size_t seeds, const std::vector<RecordedEvidence>& recorded) {
  const std::vector<Observation> seen = make(runs);
  const std::size_t in_set = seeds * recorded.size();
  std::vector<DistanceLeft> result;
  for (std::size_t k = 0; k < seen.size(); k += in_set) {
    result.push_back(distance_left(recorded, std::span(seen).subspan(k, in_set)));
  }
  return result;
}

/// More of the strongest runs of faint effects, with other seeds: as many as make their mean's chaos an eighth of what
/// the effect does, if settings allow for so many. A curve through single runs of a faint effect is mostly chaos, and
/// what is told apart least are faint effects (gravity and a pull, thick liquid and shear-thinning). How many there are
/// depends on the model alone, as far as features do.
inline std::vector<PlannedRun> repeats_of_faint(const ComparedRecordings& known, const DictionarySettings& settings) {
  constexpr double enough = 8;
  std::vector<PlannedRun> repeats;
  std::uint32_t seed = 3001;
  const EffectDictionary& first = known.dictionary.front();
  for (std::size_t run = 0; run < first.runs.size(); ++run) {
    const PlannedRun& planned = first.runs[run];
    if (planned.role != RunRole::Effect ||
        !is_strongest(first.effects[planned.effect], first.strength(run), settings)) {
      continue;
    }
    int count = 0;
    for (std::size_t k = 0; k < known.recorded.size(); ++k) {
      const RecordedEvidence& recorded = known.recorded[k];
      const auto features = recorded.mean_features({&known.dictionary[k].seen[run], 1});
      if (features && recorded.chaos() > 0) {
        const NuisanceSpace& space = recorded.space();
        const double energy = space.distance(space.standardised(*features)) - recorded.chaos();
        const double runs = energy > 0 ? std::ceil(enough * recorded.chaos() / energy) : settings.repeats + 1.0;
        count = std::max(count, static_cast<int>(std::min(runs - 1, static_cast<double>(settings.repeats))));
      }
    }
    for (int repeat = 0; repeat < settings.repeats; ++repeat, ++seed) {
      if (repeat < count) {
        repeats.push_back(planned);
        repeats.back().run.seed = seed;
      }
    }
  }
  return repeats;
}

/// Runs dictionaries and compares recordings with them.
template <ForwardModel Model>
class RecordingComparison {
 public:
  /// @param runs has to outlive it. @param references see MissingEffectSearch.
  RecordingComparison(InteractionRuns<Model>& runs, MissingEffectSettings settings,
                      std::vector<Interaction<Model>> references)
      : runs_(&runs), settings_(std::move(settings)), references_(std::move(references)) {}

  /// Predicts references. Before anything else.
  void consult_references() {
    std::vector<EffectDictionary> dictionaries;  // references are judged without any
    for (const Interaction<Model>& each : references_) {
      ComparedRecordings known = runs_of({each}, {}, settings_.dictionary);
      judge({each}, {{}}, known);
      unlike_.include(known.evidence.front(), known.chance);
      dictionaries.push_back(std::move(known.dictionary.front()));
    }
    reference_dictionaries_ = std::move(dictionaries);
  }

  /// Whether something was learnt from references of other interactions: of recordings that are to be compared with
  /// what they teach, there have to be runs with effects.
  bool has_lessons() const noexcept { return unlike_by_effects_ && !unlike_by_effects_->lessons.of_reference.empty(); }

  /// Runs a dictionary of each interaction, and compares its recording with it.
  /// @param of have to outlive what is returned. @param effects of which there are runs; none where only the gap is
  /// asked about. @param added see plan_dictionary.
  ComparedRecordings operator()(const std::vector<Interaction<Model>>& of, const std::vector<Effect>& effects,
                                const DictionarySettings& settings, const std::vector<AppliedEffect>& added = {}) {
    ComparedRecordings known = runs_of(of, effects, settings, added);
    compare(of, known);
    const std::vector<PlannedRun> repeats = repeats_of_faint(known, settings);
    if (!repeats.empty()) {
      extend(of, repeats, known);
    }
    return known;
  }

  /// Effects that are seen first where they act are tried where recordings begin to disagree, too: a jet that does not
  /// overlap with the one that there is says nothing of it. @param where by recording. @return whether there are any.
  bool locate(const std::vector<Interaction<Model>>& of, const std::vector<std::vector<Disagreement>>& where,
              ComparedRecordings& known) {
    if constexpr (LocatingModel<Model>) {
      std::vector<const Model*> models;
      for (const Interaction<Model>& each : of) {
        models.push_back(each.model);
      }
      const std::vector<AppliedEffect> places = located_effects(models, where);
      if (places.empty()) {
        return false;
      }
      std::vector<PlannedRun> plan;
      std::uint32_t seed = 4001;
      for (const AppliedEffect& at : places) {
        Effect& effect = known.effects.emplace_back(of.front().model->effects()[at.effect]);
        known.number.push_back(at.effect);
        effect.place = at.place;
        effect.where = "where recordings begin to disagree";
        if (at.window) {
          effect.window = at.window;
          effect.window_tolerance = std::min(effect.window_tolerance, detail::latest_sight);
        }
        effect.speed = at.speed.value_or(effect.speed);
        for (const double share : settings_.dictionary.shares) {
          PlannedRun planned{RunRole::Effect, known.effects.size() - 1, {{at}, seed++, false}};
          planned.run.effects.back().strength = effect.base();
          const EffectComponent& component = effect.components.front();
          planned.run.effects.back().strength[0] += share * (component.high - component.base);
          plan.push_back(std::move(planned));
        }
      }
      extend(of, plan, known);
      return true;
    }
    return false;
  }

 private:
  using Run = typename InteractionRuns<Model>::Run;

  /// Dictionaries that recordings are not compared with yet.
  ComparedRecordings runs_of(const std::vector<Interaction<Model>>& of, const std::vector<Effect>& effects,
                             const DictionarySettings& settings, const std::vector<AppliedEffect>& added = {}) {
    const std::vector<PlannedRun> plan = plan_dictionary(effects, settings, added);
    ComparedRecordings known = without_runs(of.size(), effects);
    // the model as it is before all else: where it does not work, nobody has to wait for the others
    const auto others = plan.begin() + settings.baselines;
    run({plan.begin(), others}, of, known);
    for (std::size_t k = 0; k < of.size(); ++k) {
      expects(!known.dictionary[k].of_role(RunRole::Baseline).empty(),
              "MissingEffectSearch: runs of the model of '" + of[k].name + "' as it is that come to their end",
              "at least one", "none");
    }
    run({others, plan.end()}, of, known);
    return known;
  }

  /// Makes more runs of each interaction, and compares its recording with all that there are then.
  void extend(const std::vector<Interaction<Model>>& of, const std::vector<PlannedRun>& plan,
              ComparedRecordings& known) {
    for (EffectDictionary& dictionary : known.dictionary) {
      dictionary.effects = known.effects;
    }
    run(plan, of, known);
    compare(of, known);
  }

  /// Adds more runs of each interaction to its dictionary.
  void run(const std::vector<PlannedRun>& plan, const std::vector<Interaction<Model>>& of, ComparedRecordings& known) {
    std::vector<Run> runs;
    for (const Interaction<Model>& each : of) {
      for (const PlannedRun& planned : plan) {
        runs.emplace_back(&each, planned.run);
      }
    }
    const std::vector<Observation> seen = (*runs_)(runs);
    for (std::size_t k = 0; k < of.size(); ++k) {
      EffectDictionary& dictionary = known.dictionary[k];
      dictionary.runs.insert(dictionary.runs.end(), plan.begin(), plan.end());
      const auto begin = seen.begin() + static_cast<std::ptrdiff_t>(k * plan.size());
      dictionary.seen.insert(dictionary.seen.end(), begin, begin + static_cast<std::ptrdiff_t>(plan.size()));
    }
  }

  /// What references teach about a recording.
  struct Teaching {
    std::vector<ReferenceRecording> alike{};  ///< if there are any, there are no lessons
    ReferenceLessons lessons{};
  };

  /// Recordings with dictionaries, and with what is known of references.
  void compare(const std::vector<Interaction<Model>>& of, ComparedRecordings& known) {
    std::vector<Teaching> taught;
    for (std::size_t k = 0; k < of.size(); ++k) {
      Teaching& by = taught.emplace_back(Teaching{teachers(of[k], known.dictionary[k]), {}});
      if (by.alike.empty() && !references_.empty() && !known.effects.empty()) {
        by.lessons = unlike_by_effects().lessons;
      }
    }
    judge(of, taught, known);
    const Discrepancy most = discrepancy(known);
    const double factor = settings_.reference_factor;
    known.chance.largest_distance =
        std::max(known.chance.largest_distance, factor * most.distance * known.chance.distance);
    known.chance.fall = std::max(known.chance.fall, factor * most.fall);
    known.chance.overlap = std::max(known.chance.overlap, factor * most.overlap);
    known.chance.blurred = std::max(known.chance.blurred, factor * most.blurred);
  }

  /// Recordings with dictionaries alone, but for what they are taught: one of that for each.
  void judge(const std::vector<Interaction<Model>>& of, const std::vector<Teaching>& taught,
             ComparedRecordings& known) const {
    known.recorded.clear();
    known.evidence.clear();
    std::vector<std::vector<EffectEvidence>> draws;
    for (std::size_t k = 0; k < of.size(); ++k) {  // dictionaries are not moved from here on
      known.recorded.emplace_back(of[k].recording, known.dictionary[k], settings_.evidence, taught[k].alike,
                                  taught[k].lessons);
      known.evidence.push_back(known.recorded[k].of_recording());
      draws.emplace_back();
      for (std::size_t draw = 0; draw < known.recorded[k].draws(); ++draw) {
        draws.back().push_back(known.recorded[k].of_draw(draw));
      }
    }
    known.chance = chance_level(draws, settings_.judgement);
  }

  /// How far references are from the model, over how far its draws are, and how much of it effects seem to explain,
  /// though none is there; the most of all. Nothing without references.
  struct Discrepancy {
    double distance = 0, fall = 0;
    double overlap = 0, blurred = 0;  ///< see ChanceLevel

    void include(const EffectEvidence& reference, const ChanceLevel& chance) {
      distance = std::max(distance, reference.distance / std::max(chance.distance, 1e-12));
      for (const auto& profile : reference.profile) {
        if (profile) {
          fall = std::max(fall, relative_fall(reference.distance, reference.distance - profile->improvement()));
        }
      }
      const auto share = [](const GapGain& gap) { return detail::largest(gap.by) / std::max(gap.without, 1e-12); };
      overlap = std::max(overlap, share(reference.overlap));
      blurred = std::max(blurred, share(reference.blurred));
    }
  };

  /// References that look like a recording, if there are enough of them. Asked first with a dictionary to which nothing
  /// was added.
  std::vector<ReferenceRecording> teachers(const Interaction<Model>& of, const EffectDictionary& dictionary) {
    const auto reference = [&](std::size_t k) {
      return ReferenceRecording{references_[k].recording, &reference_dictionaries_[k]};
    };
    const auto [known, is_new] = teachers_.try_emplace(of.name);
    if (is_new && !reference_dictionaries_.empty()) {
      const RecordedEvidence alone(of.recording, dictionary, settings_.evidence);
      for (std::size_t k = 0; k < reference_dictionaries_.size(); ++k) {
        if (alone.unlikeness(reference(k)) <= settings_.most_unlike) {
          known->second.push_back(k);
        }
      }
      if (known->second.size() < static_cast<std::size_t>(settings_.least_references)) {
        known->second.clear();
      }
    }
    std::vector<ReferenceRecording> chosen;
    for (const std::size_t k : known->second) {
      chosen.push_back(reference(k));
    }
    return chosen;
  }

  /// Of references that look like the recordings with what the others of them teach; of any references where there are
  /// none.
  Discrepancy discrepancy(const ComparedRecordings& known) {
    Discrepancy most;
    const bool taught = std::all_of(known.recorded.begin(), known.recorded.end(),
                                    [](const RecordedEvidence& each) { return each.references() > 0; });
    if (!taught) {
      return known.effects.empty() ? unlike_ : unlike_by_effects().most;
    }
    for (const RecordedEvidence& each : known.recorded) {
      for (std::size_t k = 0; k < each.references(); ++k) {
        most.include(each.of_reference(k), known.chance);
      }
    }
    return most;
  }

  /// What is known of references that do not look like what they are asked about.
  struct UnlikeReferences {
    Discrepancy most{};          ///< of each by what the others teach, if they do
    ReferenceLessons lessons{};  ///< none where they are no nearer by what those of other interactions teach
  };

  /// With runs of all effects. What carries over is asked of each reference by leaving it out, with all that look like
  /// it: a second recording of one interaction would teach more about the first than about others.
  const UnlikeReferences& unlike_by_effects() {
    if (!unlike_by_effects_) {
      UnlikeReferences& result = unlike_by_effects_.emplace();
      std::vector<ComparedRecordings> known;
      ReferenceLessons lessons;
      known.reserve(references_.size());
      double farther = 0;
      for (std::size_t k = 0; k < references_.size(); ++k) {
        ComparedRecordings& own = known.emplace_back(reference_with_effects(k));
        judge({references_[k]}, {{}}, own);
        lessons.of_reference.push_back(own.recorded.front().lesson());
        result.most.include(own.evidence.front(), own.chance);
        farther -= std::log(relative_distance(own));
      }
      std::vector<Teaching> others(references_.size(), {{}, {{}, lessons.error}});
      for (std::size_t k = 0; k < references_.size(); ++k) {
        for (std::size_t other = 0; other < references_.size(); ++other) {
          if (!look_alike(known[k], known[other], references_[other])) {
            others[k].lessons.of_reference.push_back(lessons.of_reference[other]);
          }
        }
        if (others[k].lessons.of_reference.empty()) {
          return result;  // of one interaction alone it is not known what carries over
        }
      }
      double error = lessons.error * lessons.error;  // as much as one reference's would be worth
      for (std::size_t k = 0; k < references_.size(); ++k) {
        const RecordedEvidence taught(references_[k].recording, known[k].dictionary.front(), settings_.evidence, {},
                                      others[k].lessons);
        error += std::pow(taught.as_taught() - 1, 2);
      }
      lessons.error = std::min(0.5, std::sqrt(error / static_cast<double>(references_.size() + 1)));
      Discrepancy most;
      for (std::size_t k = 0; k < references_.size(); ++k) {
        others[k].lessons.error = lessons.error;
        judge({references_[k]}, {others[k]}, known[k]);
        most.include(known[k].evidence.front(), known[k].chance);
        farther += std::log(relative_distance(known[k]));
      }
      if (farther < 0) {
        result = {most, std::move(lessons)};
      }
    }
    return *unlike_by_effects_;
  }

  /// Whether references are of nearly the same interaction, such as one and the same reference.
  bool look_alike(const ComparedRecordings& one, const ComparedRecordings& other,
                  const Interaction<Model>& of_other) const {
    return one.recorded.front().unlikeness({of_other.recording, &other.dictionary.front()}) <= settings_.most_unlike;
  }

  static double relative_distance(const ComparedRecordings& of) {
    return std::max(of.evidence.front().distance, 1e-12) / std::max(of.chance.distance, 1e-12);
  }

  /// Adds runs with effects to those that there are of a reference.
  ComparedRecordings reference_with_effects(std::size_t reference) {
    const Interaction<Model>& of = references_[reference];
    ComparedRecordings known = without_runs(1, of.model->effects());
    known.dictionary.front().runs = reference_dictionaries_[reference].runs;
    known.dictionary.front().seen = reference_dictionaries_[reference].seen;
    std::vector<PlannedRun> plan = plan_dictionary(known.effects, settings_.dictionary);
    std::erase_if(plan,
                  [](const PlannedRun& each) { return each.role == RunRole::Baseline || each.role == RunRole::Draw; });
    run(plan, {of}, known);
    return known;
  }

  static ComparedRecordings without_runs(std::size_t recordings, const std::vector<Effect>& effects) {
    ComparedRecordings known;
    known.effects = effects;
    for (std::size_t k = 0; k < effects.size(); ++k) {
      known.number.push_back(k);
    }
    known.dictionary.assign(recordings, {effects, {}, {}});
    return known;
  }

  InteractionRuns<Model>* runs_;
  MissingEffectSettings settings_;
  std::vector<Interaction<Model>> references_;
  std::vector<EffectDictionary> reference_dictionaries_{};      ///< by reference: baselines and draws
  std::map<std::string, std::vector<std::size_t>> teachers_{};  ///< by recording: references that look like it
  Discrepancy unlike_{};                                        ///< of references without others' help, no effects
  std::optional<UnlikeReferences> unlike_by_effects_{};         ///< with effects, once it was asked for
};

}  // namespace decant::inline DECANT_TARGET
