// SPDX-License-Identifier: MIT
#pragma once

/// The workflow: where simulation and recordings disagree, which effect the model lacks, how strong it is, and whether
/// the gap shrinks on recordings that were not used.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/discovery/disagreement.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/effect_dictionary.hpp>
#include <decant/discovery/effect_evidence.hpp>
#include <decant/discovery/effect_judgement.hpp>
#include <decant/discovery/effect_location.hpp>
#include <decant/discovery/effect_refinement.hpp>
#include <decant/discovery/forward_model.hpp>
#include <decant/discovery/silhouette_series.hpp>
#include <decant/discovery/smallest_seen.hpp>
#include <decant/hypothesis/executor.hpp>

namespace decant::inline DECANT_TARGET {

/// A recording and the model that predicts it.
template <ForwardModel Model>
struct Interaction {
  std::string name{};
  const Model* model = nullptr;               ///< has to outlive the workflow
  std::vector<SilhouetteSeries> recording{};  ///< by camera
  std::string
      of_model{};  ///< all that the model's predictions depend on, for RunJobs' keys; the name where it is empty
};

/// Runs jobs: work(k) for each key, results in the order of the keys. A key says all that a result depends on beside
/// the model, so that a journal can look results up.
using RunJobs = std::function<std::vector<JobResult>(const std::vector<std::string>& keys,
                                                     const std::function<JobResult(std::size_t)>& work)>;

/// @param executor has to outlive what is returned.
template <Executor ExecutorType, class Done = decltype(tell_nobody)>
RunJobs run_jobs_on(ExecutorType& executor, Done done = tell_nobody) {
  return [&executor, done](const std::vector<std::string>& keys, const std::function<JobResult(std::size_t)>& work) {
    return executor.run(keys.size(), work, done);
  };
}

struct MissingEffectSettings {
  DictionarySettings dictionary{};
  DictionarySettings next_dictionary{4, 16, {0.5}};  ///< after an effect was added, and something is still missing
  RecordedEvidenceSettings evidence{};
  JudgementSettings judgement{};
  int refined = 3;                     ///< so many of the best are looked at more closely, >= 1
  int refinement_rounds = 3;           ///< steps for each, >= 1
  int repeats = 8;                     ///< of the best one, to see how far estimates scatter, >= 3
  int refinement_seeds = 2;            ///< runs at each point, >= 1
  double least_share = 0.8;            ///< of what is reducible effects have to explain in the end, 0 .. 1
  double least_share_to_chance = 0.5;  ///< the same where no more is left than chance leaves, 0 .. 1
  double enough_share = 0.85;          ///< nothing else is looked for beside effects that explain so much, 0 .. 1:
                                       ///< what is left may be how the model has them
  int most_effects = 3;                ///< that are added one after another, >= 1
  double reference_factor = 1.1;       ///< on what references do, >= 1: beyond it something is missing
  double threshold = 4;                ///< of find_disagreements
};

/// An effect with what is known of it after refinement.
struct RefinedEffect {
  std::size_t effect = 0;  ///< its number among the model's
  std::size_t judged = 0;  ///< and in MissingEffect::judged
  Eigen::VectorXd strength{};
  Eigen::VectorXd deviation{};             ///< standard deviation, by component
  std::optional<Vector3<double>> place{};  ///< [m], where it was looked for
  std::optional<TimeWindow> window{};      ///< likewise
  double distance = 0;                     ///< that is left of the recordings it was found in
  double share = 0;                        ///< of what is reducible

  AppliedEffect applied() const { return {effect, strength, place, window}; }
  /// Strengths that hold the truth with 90 %, by component.
  std::pair<double, double> interval_90(std::size_t component) const {
    const auto k = static_cast<Eigen::Index>(component);
    return {strength[k] - 1.645 * deviation[k], strength[k] + 1.645 * deviation[k]};
  }
};

/// Whether an effect that was found also explains recordings that were not used.
enum class Confirmation {
  Untested,     ///< there were no such recordings, or nothing was found
  NotTestable,  ///< they show no gap
  Confirmed,    ///< their gap shrinks by more than chance, and by more than with any rival
  Refuted       ///< it does not
};

/// How a gap changed, in the workflow's own distance: about 1 to 1.5 where nothing is missing, see NuisanceSpace.
struct GapChange {
  double before = std::numeric_limits<double>::quiet_NaN();
  double after = std::numeric_limits<double>::quiet_NaN();
  double noise = std::numeric_limits<double>::quiet_NaN();       ///< where nothing is missing, in the mean
  double by_chance = std::numeric_limits<double>::quiet_NaN();   ///< a smaller relative_fall than this is none
  double best_rival = std::numeric_limits<double>::quiet_NaN();  ///< after with the best other effect of those refined

  /// Of what is reducible.
  double share() const noexcept { return (before - after) / std::max(before - noise, 1e-12); }
};

/// What was found.
struct MissingEffect {
  Verdict verdict = Verdict::Nothing;
  std::vector<RefinedEffect> found{};    ///< one after another; of OneOf the best of the first ones
  std::vector<RefinedEffect> refined{};  ///< all that were looked at closely in the first round, the best first
  std::vector<std::size_t> one_of{};     ///< of OneOf: numbers of effects that are not told apart
  Judgement judgement{};                 ///< of the first round, before refinement
  std::vector<Effect> judged{};          ///< what its numbers are of: the models' effects, and then those of them that
                                         ///< were also tried where recordings begin to disagree
  std::vector<std::vector<Disagreement>> where{};  ///< by recording, before anything was added
  std::vector<SmallestSeen> smallest_seen{};       ///< of each effect that is judged
  GapChange learn{}, held_out{};
  Confirmation confirmation = Confirmation::Untested;
  std::size_t runs = 0;  ///< of models
};

/// Finds what a model lacks. One search for one set of recordings.
template <ForwardModel Model>
class MissingEffectSearch {
 public:
  /// @param learn recordings of which all have what is missing, at one strength. @param held_out others, to check on.
  /// @param references recordings, of any poses, in which nothing is missing: how far reality is from the model all the
  /// same. Without any, the model's own scatter and JudgementSettings::distance_factor stand for it.
  /// Throws std::invalid_argument if there is nothing to learn from, models have other effects than the first one's,
  /// names are not all different, or a setting is out of range.
  MissingEffectSearch(std::vector<Interaction<Model>> learn, std::vector<Interaction<Model>> held_out, RunJobs run_jobs,
                      MissingEffectSettings settings = {}, std::vector<Interaction<Model>> references = {})
      : learn_(std::move(learn)),
        held_out_(std::move(held_out)),
        references_(std::move(references)),
        run_jobs_(std::move(run_jobs)),
        settings_(std::move(settings)) {
    expects(!learn_.empty(), "MissingEffectSearch: recordings to learn from", "at least one", "none");
    std::set<std::string> names;
    for (const auto* set : {&learn_, &held_out_, &references_}) {
      for (const Interaction<Model>& each : *set) {
        expects(each.model != nullptr, "MissingEffectSearch: model of '" + each.name + "'", "one", "none");
        expects(names.insert(each.name).second, "MissingEffectSearch: names", "all different", each.name);
        const std::vector<Effect>& own = each.model->effects();
        const bool same = std::equal(own.begin(), own.end(), effects().begin(), effects().end(),
                                     [](const Effect& a, const Effect& b) { return a.words() == b.words(); });
        expects(same, "MissingEffectSearch: effects of '" + each.name + "'", "those of the first recording's model",
                own.size());
      }
    }
    expects(settings_.refined >= 1 && settings_.refinement_rounds >= 1 && settings_.refinement_seeds >= 1,
            "MissingEffectSettings: refined, refinement_rounds, refinement_seeds", ">= 1", settings_.refined);
    expects(settings_.most_effects >= 1, "MissingEffectSettings: most_effects", ">= 1", settings_.most_effects);
    expects(settings_.enough_share >= 0 && settings_.enough_share <= 1, "MissingEffectSettings: enough_share", "0 .. 1",
            settings_.enough_share);
    plan_dictionary(effects(), settings_.next_dictionary);  // which is not needed before the search has run for long
  }

  const std::vector<Effect>& effects() const { return learn_.front().model->effects(); }

  MissingEffect find() {
    MissingEffect result;
    discrepancy_ = {};  // references are judged without any
    discrepancy_ = discrepancy();
    bool explained = false;
    for (int round = 0; round < settings_.most_effects; ++round) {
      Knowledge known =
          know(learn_, effects(), round == 0 ? settings_.dictionary : settings_.next_dictionary, applied(result.found));
      Judgement judgement = judge_effects(known.effects, known.evidence, known.chance, settings_.judgement);
      if (round == 0) {
        result.learn = {judgement.distance, judgement.distance, known.chance.distance, known.chance.fall};
        for (const RecordedEvidence& each : known.recorded) {
          result.where.push_back(find_disagreements(each.features(), beyond_chance(each), settings_.threshold));
        }
        const std::vector<double>& shares = settings_.dictionary.shares;
        result.smallest_seen =
            smallest_seen(effects(), known.recorded, known.chance, *std::min_element(shares.begin(), shares.end()));
        if (judgement.has_gap() && locate(known, result.where)) {
          judgement = judge_effects(known.effects, known.evidence, known.chance, settings_.judgement);
        }
        result.judgement = judgement;
        result.judged = known.effects;
      }
      if (judgement.verdict == Verdict::Nothing) {
        break;
      }
      const std::vector<Refined> refined = refine_best(judgement, known, result.found, result.learn.before);
      const bool gains =
          !refined.empty() && relative_fall(result.learn.after, refined.front().distance) > known.chance.fall;
      const bool down_to_chance = !refined.empty() && refined.front().distance <= known.chance.largest_distance;
      const bool explains =
          !refined.empty() &&
          refined.front().share >= (down_to_chance ? settings_.least_share_to_chance : settings_.least_share);
      if (round == 0) {
        for (const Refined& each : refined) {
          result.refined.push_back(each.effects.front());
        }
      }
      if (!gains) {
        break;
      }
      result.found = refined.front().effects;
      result.learn.after = refined.front().distance;
      explained = explains;
      if (round == 0 && explained) {
        result.one_of = alike(result.refined, known.chance);
      }
      if (result.learn.after <= known.chance.largest_distance || result.one_of.size() > 1 ||
          refined.front().share >= settings_.enough_share) {
        break;
      }
    }
    if (result.judgement.has_gap()) {
      result.verdict = !explained ? Verdict::Unexplained : result.one_of.size() > 1 ? Verdict::OneOf : Verdict::Named;
    }
    if (!explained) {  // what helps a little is among those that were refined
      result.found.clear();
      result.learn.after = result.learn.before;
    }
    if (!held_out_.empty() && !result.found.empty()) {
      check(result);
    }
    result.runs = runs_;
    return result;
  }

 private:
  /// What recordings say of a model.
  struct Knowledge {
    std::vector<Effect> effects{};      ///< of which there are runs
    std::vector<std::size_t> number{};  ///< of each among the model's
    std::vector<EffectDictionary> dictionary{};
    std::vector<RecordedEvidence> recorded{};
    std::vector<EffectEvidence> evidence{};
    ChanceLevel chance{};
  };

  using Series = std::vector<SilhouetteSeries>;

  /// Effects together, refined.
  struct Refined {
    std::vector<RefinedEffect> effects{};  ///< the new one last
    double distance = 0, share = 0;        ///< see RefinedEffect
  };

  static std::vector<AppliedEffect> applied(const std::vector<RefinedEffect>& effects) {
    std::vector<AppliedEffect> result;
    for (const RefinedEffect& each : effects) {
      result.push_back(each.applied());
    }
    return result;
  }

  /// Runs of several interactions, in their order; those that failed are empty.
  std::vector<Series> predictions(const std::vector<std::pair<const Interaction<Model>*, ModelRun>>& runs) {
    std::vector<std::string> keys;
    std::vector<std::size_t> job_of, first;  // equal runs are made once
    std::map<std::string, std::size_t> number;
    for (std::size_t k = 0; k < runs.size(); ++k) {
      const Interaction<Model>& of = *runs[k].first;
      std::string key = of.of_model.empty() ? of.name : of.of_model;
      key += ": " + run_key(effects(), runs[k].second);
      const auto [place, is_new] = number.try_emplace(key, keys.size());
      if (is_new) {
        keys.push_back(std::move(key));
        first.push_back(k);
      }
      job_of.push_back(place->second);
    }
    const std::vector<JobResult> results = run_jobs_(keys, [&](std::size_t job) {
      const auto& [interaction, run] = runs[first[job]];
      JobResult numbers;
      for (const SilhouetteSeries& series : interaction->model->predict(run)) {
        const std::vector<double> own = series.numbers();
        numbers.push_back(static_cast<double>(own.size()));
        numbers.insert(numbers.end(), own.begin(), own.end());
      }
      return numbers;
    });
    runs_ += keys.size();
    std::vector<Series> seen;
    for (std::size_t k = 0; k < runs.size(); ++k) {
      seen.push_back(series_of(results.at(job_of[k]), runs[k].first->recording));
    }
    return seen;
  }

  static Series series_of(const JobResult& numbers, const Series& recording) {
    Series seen;
    std::size_t begin = 0;
    for (const SilhouetteSeries& camera : recording) {
      if (begin >= numbers.size()) {
        return {};
      }
      const auto count = static_cast<std::size_t>(numbers[begin]);
      expects(begin + 1 + count <= numbers.size(), "MissingEffectSearch: numbers of a run", "as many as they say",
              numbers.size());
      seen.push_back(camera.with_numbers(std::span(numbers).subspan(begin + 1, count)));
      begin += 1 + count;
    }
    return seen;
  }

  /// @param effects of which there are runs; none where only the gap is asked about.
  Knowledge know(const std::vector<Interaction<Model>>& of, const std::vector<Effect>& effects,
                 const DictionarySettings& settings, const std::vector<AppliedEffect>& added = {}) {
    const std::vector<PlannedRun> plan = plan_dictionary(effects, settings, added);
    std::vector<std::pair<const Interaction<Model>*, ModelRun>> runs;
    for (const Interaction<Model>& each : of) {
      for (const PlannedRun& planned : plan) {
        runs.emplace_back(&each, planned.run);
      }
    }
    const std::vector<Series> seen = predictions(runs);
    Knowledge known;
    known.effects = effects;
    for (std::size_t k = 0; k < effects.size(); ++k) {
      known.number.push_back(k);
    }
    for (std::size_t k = 0; k < of.size(); ++k) {
      const auto begin = seen.begin() + static_cast<std::ptrdiff_t>(k * plan.size());
      known.dictionary.push_back({effects, plan, {begin, begin + static_cast<std::ptrdiff_t>(plan.size())}});
    }
    compare(of, known);
    return known;
  }

  /// Recordings with dictionaries.
  void compare(const std::vector<Interaction<Model>>& of, Knowledge& known) const {
    known.recorded.clear();
    known.evidence.clear();
    std::vector<std::vector<EffectEvidence>> draws;
    for (std::size_t k = 0; k < of.size(); ++k) {  // dictionaries are not moved from here on
      known.recorded.emplace_back(of[k].recording, known.dictionary[k], settings_.evidence);
      known.evidence.push_back(known.recorded[k].of_recording());
      draws.emplace_back();
      for (std::size_t draw = 0; draw < known.recorded[k].draws(); ++draw) {
        draws.back().push_back(known.recorded[k].of_draw(draw));
      }
    }
    known.chance = chance_level(draws, settings_.judgement);
    known.chance.largest_distance = std::max(
        known.chance.largest_distance, settings_.reference_factor * discrepancy_.distance * known.chance.distance);
    known.chance.fall = std::max(known.chance.fall, settings_.reference_factor * discrepancy_.fall);
  }

  /// Effects that are seen first where they act are tried where recordings begin to disagree, too: a jet that does not
  /// overlap with the one that there is says nothing of it. @param where by recording. @return whether there are any.
  bool locate(Knowledge& known, const std::vector<std::vector<Disagreement>>& where) {
    if constexpr (LocatingModel<Model>) {
      std::vector<const Model*> models;
      for (const Interaction<Model>& each : learn_) {
        models.push_back(each.model);
      }
      const std::vector<AppliedEffect> places = located_effects(models, where);
      if (places.empty()) {
        return false;
      }
      std::vector<PlannedRun> plan;
      std::uint32_t seed = 4001;
      for (const AppliedEffect& at : places) {
        Effect& effect = known.effects.emplace_back(effects()[at.effect]);
        known.number.push_back(at.effect);
        effect.place = at.place;
        effect.where = "where recordings begin to disagree";
        if (at.window) {
          effect.window = at.window;
          effect.window_tolerance = std::min(effect.window_tolerance, detail::latest_sight);
        }
        for (const double share : settings_.dictionary.shares) {
          PlannedRun planned{RunRole::Effect, known.effects.size() - 1, {{at}, seed++, false}};
          planned.run.effects.back().strength = effect.base();
          const EffectComponent& component = effect.components.front();
          planned.run.effects.back().strength[0] += share * (component.high - component.base);
          plan.push_back(std::move(planned));
        }
      }
      std::vector<std::pair<const Interaction<Model>*, ModelRun>> runs;
      for (const Interaction<Model>& each : learn_) {
        for (const PlannedRun& planned : plan) {
          runs.emplace_back(&each, planned.run);
        }
      }
      const std::vector<Series> seen = predictions(runs);
      for (std::size_t k = 0; k < learn_.size(); ++k) {
        EffectDictionary& dictionary = known.dictionary[k];
        dictionary.effects = known.effects;
        dictionary.runs.insert(dictionary.runs.end(), plan.begin(), plan.end());
        const auto begin = seen.begin() + static_cast<std::ptrdiff_t>(k * plan.size());
        dictionary.seen.insert(dictionary.seen.end(), begin, begin + static_cast<std::ptrdiff_t>(plan.size()));
      }
      compare(learn_, known);
      return true;
    }
    return false;
  }

  /// How far references are from the model, over how far its draws are, and how much of it effects seem to explain,
  /// though none is there; the most of all. Nothing without references.
  struct Discrepancy {
    double distance = 0, fall = 0;
  };
  Discrepancy discrepancy() {
    Discrepancy most;
    for (const Interaction<Model>& each : references_) {
      const Knowledge known = know({each}, effects(), settings_.dictionary);
      const EffectEvidence& evidence = known.evidence.front();
      most.distance = std::max(most.distance, evidence.distance / std::max(known.chance.distance, 1e-12));
      for (const auto& profile : evidence.profile) {
        if (profile) {
          most.fall = std::max(most.fall, relative_fall(evidence.distance, evidence.distance - profile->improvement()));
        }
      }
    }
    return most;
  }

  /// Deviations of the recording, each over what draws have there.
  static Eigen::VectorXd beyond_chance(const RecordedEvidence& recorded) {
    Eigen::VectorXd square = Eigen::VectorXd::Zero(recorded.space().features());
    for (std::size_t draw = 0; draw < recorded.draws(); ++draw) {
      const Eigen::VectorXd off = recorded.space().standardised(recorded.draw_features(draw));
      square.array() += off.array().square() / static_cast<double>(recorded.draws());
    }
    const Eigen::VectorXd usual = square.array().sqrt() + 0.5;
    return recorded.standardised().cwiseQuotient(usual);
  }

  /// The best of different answers, each refined together with what was found before; the best first.
  /// @param before the distance to the model without any.
  std::vector<Refined> refine_best(const Judgement& judgement, const Knowledge& known,
                                   const std::vector<RefinedEffect>& found, double before) {
    std::vector<Candidate> candidates;
    std::map<std::string, int> instances;
    for (const EffectStanding& standing : judgement.standings) {
      const Effect& effect = known.effects[standing.effect];
      const std::size_t number = known.number[standing.effect];
      const bool is_found =
          std::any_of(found.begin(), found.end(), [&](const RefinedEffect& other) { return other.effect == number; });
      // of one family the best one, and of an effect in several places two of them
      const int most = effect.place ? 2 : 1;
      if (candidates.size() < static_cast<std::size_t>(settings_.refined) && !is_found && standing.improvement > 0 &&
          instances[effect.answer()] < most) {
        ++instances[effect.answer()];
        candidates.emplace_back().judged = standing.effect;
        EffectPoint& point = candidates.back().point;
        for (const RefinedEffect& each : found) {
          point.add(effects()[each.effect], each.effect, each.applied());
        }
        point.add(effect, number, {number, standing.strength, {}});
      }
    }
    for (int round = 0; round < settings_.refinement_rounds && !candidates.empty(); ++round) {
      step_all(candidates, known, static_cast<std::uint32_t>(5001 + 1000 * round));
      if (round + 1 < settings_.refinement_rounds) {
        keep_promising(candidates, known.chance);
      }
    }
    std::vector<EffectPoint> points;
    for (const Candidate& each : candidates) {
      points.push_back(each.point);
    }
    const std::vector<double> distance = distances(points, known);
    const auto best = static_cast<std::size_t>(std::min_element(distance.begin(), distance.end()) - distance.begin());
    std::vector<Refined> refined;
    for (std::size_t k = 0; k < points.size(); ++k) {
      if (!std::isfinite(distance[k])) {
        continue;
      }
      Refined one;
      one.distance = distance[k];
      one.share = (before - one.distance) / std::max(before - known.chance.distance, 1e-12);
      const Eigen::VectorXd deviation =
          k == best ? deviations(points[k], candidates[k].views, known)
                    : Eigen::VectorXd::Constant(points[k].size(), std::numeric_limits<double>::quiet_NaN());
      for (std::size_t part = 0; part < points[k].effects(); ++part) {
        const AppliedEffect applied = points[k].applied(part);
        const auto [begin, count] = points[k].strength_of(part);
        const std::size_t judged = part < found.size() ? found[part].judged : candidates[k].judged;
        one.effects.push_back({applied.effect, judged, applied.strength, deviation.segment(begin, count), applied.place,
                               applied.window, one.distance, one.share});
      }
      refined.push_back(std::move(one));
    }
    std::stable_sort(refined.begin(), refined.end(),
                     [](const auto& a, const auto& b) { return a.distance < b.distance; });
    return refined;
  }

  /// The mean features of runs, or nothing if one of them failed.
  static std::optional<Eigen::VectorXd> mean_features(const RecordedEvidence& recorded, const Series* begin,
                                                      std::size_t count) {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(recorded.space().features());
    for (std::size_t k = 0; k < count; ++k) {
      if (begin[k].empty()) {
        return std::nullopt;
      }
      sum += recorded.features().of(begin[k]);
    }
    return sum / static_cast<double>(count);
  }

  using Views = std::vector<RefinementView>;  ///< by recording; empty where a run failed

  std::size_t middle_seeds() const noexcept { return static_cast<std::size_t>(settings_.refinement_seeds); }
  /// Of runs to each side of a number. Places and times have many numbers, each of which is off by a lot there.
  std::size_t slope_seeds(const EffectPoint& point) const noexcept {
    return point.size() <= 2 ? middle_seeds() : (middle_seeds() + 1) / 2;
  }

  /// An effect on its way to where it explains most.
  struct Candidate {
    std::size_t judged = 0;  ///< its number in the Judgement
    EffectPoint point{};
    Views views{};         ///< of the last step
    double expected = 0;   ///< distance after it, by the linear model that it was made with; infinite where runs fail
    bool settled = false;  ///< the last step was no gain that could be told from chance: there is no other one
  };

  /// Leaves the best one, the next best one as its rival, and all others that may come near it.
  static void keep_promising(std::vector<Candidate>& candidates, const ChanceLevel& chance) {
    std::vector<double> sorted;
    for (const Candidate& each : candidates) {
      sorted.push_back(each.expected);
    }
    std::sort(sorted.begin(), sorted.end());
    const double rival = sorted[std::min<std::size_t>(1, sorted.size() - 1)];
    std::erase_if(candidates, [&](const Candidate& each) {
      return each.expected > rival && relative_fall(each.expected, sorted.front()) >= 3 * chance.fall;
    });
  }

  /// One step for each of the candidates that is not settled, all runs side by side. A point at which runs fail stays.
  void step_all(std::vector<Candidate>& candidates, const Knowledge& known, std::uint32_t seed) {
    std::vector<std::pair<const Interaction<Model>*, ModelRun>> runs;
    const auto ask = [&](const Interaction<Model>& of, const EffectPoint& point, std::size_t seeds) {
      for (std::size_t k = 0; k < seeds; ++k) {
        runs.emplace_back(&of, point.run(seed + static_cast<std::uint32_t>(runs.size())));
      }
    };
    for (const Candidate& each : candidates) {
      if (each.settled) {
        continue;
      }
      const EffectPoint& point = each.point;
      for (const Interaction<Model>& of : learn_) {
        ask(of, point, middle_seeds());
        for (Eigen::Index k = 0; k < point.size(); ++k) {
          ask(of, point.with(k, point.value()[k] - point.step(k)), slope_seeds(point));
          ask(of, point.with(k, point.value()[k] + point.step(k)), slope_seeds(point));
        }
      }
    }
    const std::vector<Series> seen = predictions(runs);
    const Series* next = seen.data();
    for (Candidate& each : candidates) {
      if (each.settled) {
        continue;
      }
      each.views.clear();
      for (const RecordedEvidence& recorded : known.recorded) {
        if (auto view = view_of(each.point, recorded, next)) {
          each.views.push_back(std::move(*view));
        }
        next += middle_seeds() + slope_seeds(each.point) * static_cast<std::size_t>(2 * each.point.size());
      }
      if (each.views.size() < known.recorded.size()) {
        each.views.clear();
        each.expected = std::numeric_limits<double>::infinity();
        each.settled = true;
      } else {
        step(each, known);
      }
    }
  }

  /// By its views.
  void step(Candidate& candidate, const Knowledge& known) const {
    std::vector<Eigen::VectorXd> recorded;
    for (const RecordedEvidence& each : known.recorded) {
      recorded.push_back(each.recorded_features());
    }
    const Eigen::VectorXd move = refinement(candidate.point, candidate.views, recorded);
    double before = 0;
    candidate.expected = 0;
    for (std::size_t k = 0; k < candidate.views.size(); ++k) {
      const RefinementView& view = candidate.views[k];
      const auto share = [&](const Eigen::VectorXd& off) {
        return view.space->distance(view.space->standardised_difference(off)) /
               static_cast<double>(candidate.views.size());
      };
      before += share(recorded[k] - view.middle);
      candidate.expected += share(recorded[k] - view.middle - view.slope * move);
    }
    candidate.settled = relative_fall(before, candidate.expected) < 0.5 * known.chance.fall;
    const Eigen::VectorXd value = candidate.point.value() + move;
    for (Eigen::Index k = 0; k < candidate.point.size(); ++k) {
      candidate.point = candidate.point.with(k, value[k]);
    }
  }

  /// @param seen of runs at the point, then below and above of each of its numbers.
  std::optional<RefinementView> view_of(const EffectPoint& point, const RecordedEvidence& recorded,
                                        const Series* seen) const {
    const std::size_t seeds = slope_seeds(point);
    const auto middle = mean_features(recorded, seen, middle_seeds());
    seen += middle_seeds();
    if (!middle) {
      return std::nullopt;
    }
    RefinementView view{&recorded.space(), *middle, Eigen::MatrixXd(middle->size(), point.size())};
    for (Eigen::Index k = 0; k < point.size(); ++k) {
      const auto below = mean_features(recorded, seen, seeds);
      seen += seeds;
      const auto above = mean_features(recorded, seen, seeds);
      seen += seeds;
      const double apart = point.with(k, point.value()[k] + point.step(k)).value()[k] -
                           point.with(k, point.value()[k] - point.step(k)).value()[k];
      if (!below || !above || !(apart > 0)) {
        return std::nullopt;
      }
      view.slope.col(k) = (*above - *below) / apart;
    }
    return view;
  }

  /// Standard deviation of each number of a point: what would be found in recordings of it in which all that is
  /// tolerated is drawn (a parametric bootstrap: Efron and Tibshirani, An Introduction to the Bootstrap, 1993).
  Eigen::VectorXd deviations(const EffectPoint& point, const Views& views, const Knowledge& known) {
    Eigen::VectorXd square = Eigen::VectorXd::Zero(point.size());
    std::vector<std::pair<const Interaction<Model>*, ModelRun>> runs;
    for (int draw = 0; draw < settings_.repeats; ++draw) {
      for (const Interaction<Model>& of : learn_) {
        runs.emplace_back(&of, point.run(7001 + static_cast<std::uint32_t>(runs.size())));
        runs.back().second.tolerated = true;
      }
    }
    const std::vector<Series> seen = predictions(runs);
    std::vector<Eigen::VectorXd> moves;
    for (const Series* next = seen.data(); !views.empty() && next < seen.data() + seen.size(); next += learn_.size()) {
      std::vector<Eigen::VectorXd> features;
      for (std::size_t k = 0; k < learn_.size(); ++k) {
        if (const auto one = mean_features(known.recorded[k], next + k, 1)) {
          features.push_back(*one);
        }
      }
      if (features.size() == learn_.size()) {
        moves.push_back(refinement(point, views, features));
      }
    }
    if (moves.size() < 3) {
      return Eigen::VectorXd::Constant(point.size(), std::numeric_limits<double>::quiet_NaN());
    }
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(point.size());
    for (const Eigen::VectorXd& move : moves) {
      mean += move / static_cast<double>(moves.size());
    }
    for (const Eigen::VectorXd& move : moves) {
      square += (move - mean).cwiseAbs2() / static_cast<double>(moves.size() - 1);
    }
    return square.cwiseSqrt();
  }

  /// What is left of the learnt recordings at each point, by runs of their own seeds; infinite where runs fail.
  std::vector<double> distances(const std::vector<EffectPoint>& points, const Knowledge& known) {
    const auto seeds = static_cast<std::size_t>(settings_.dictionary.baselines);
    std::vector<std::pair<const Interaction<Model>*, ModelRun>> runs;
    for (const EffectPoint& point : points) {
      for (const Interaction<Model>& of : learn_) {
        for (std::size_t k = 0; k < seeds; ++k) {
          runs.emplace_back(&of, point.run(9001 + static_cast<std::uint32_t>(runs.size())));
        }
      }
    }
    return left(runs, seeds, known.recorded);
  }

  /// @param runs `seeds` for each recording, set after set. @return the mean distance of each set.
  std::vector<double> left(const std::vector<std::pair<const Interaction<Model>*, ModelRun>>& runs, std::size_t seeds,
                           const std::vector<RecordedEvidence>& recorded) {
    const std::vector<Series> seen = predictions(runs);
    std::vector<double> result;
    for (const Series* next = seen.data(); next < seen.data() + seen.size();) {
      double sum = 0;
      for (const RecordedEvidence& of : recorded) {
        const auto middle = mean_features(of, next, seeds);
        next += seeds;
        if (middle) {
          sum += of.space().distance(of.standardised() -
                                     of.space().standardised_difference(*middle - of.space().center()));
        } else {
          sum = std::numeric_limits<double>::infinity();
        }
      }
      result.push_back(sum / static_cast<double>(recorded.size()));
    }
    return result;
  }

  /// Those of other families that explain as much as the best one, within chance.
  std::vector<std::size_t> alike(const std::vector<RefinedEffect>& refined, const ChanceLevel& chance) const {
    std::vector<std::size_t> result;
    std::set<std::string> answers;
    for (const RefinedEffect& each : refined) {
      if (relative_fall(each.distance, refined.front().distance) < chance.fall && answers.insert(answer(each)).second) {
        result.push_back(each.effect);
      }
    }
    return result;
  }
  const std::string& answer(const RefinedEffect& of) const { return effects()[of.effect].answer(); }

  /// Predicts recordings that were not used, with what was found and with its rivals, strengths as they were found.
  void check(MissingEffect& result) {
    const Knowledge known = know(held_out_, {}, settings_.dictionary);
    GapChange& gap = result.held_out;
    gap.before = 0;
    for (const EffectEvidence& each : known.evidence) {
      gap.before += each.distance / static_cast<double>(held_out_.size());
    }
    gap.noise = known.chance.distance;
    gap.by_chance = result.learn.by_chance;
    const auto seeds = static_cast<std::size_t>(settings_.dictionary.baselines);
    std::vector<std::vector<AppliedEffect>> sets{applied(result.found)};
    for (const RefinedEffect& rival : result.refined) {
      if (answer(rival) != answer(result.found.front())) {
        sets.push_back({rival.applied()});
      }
    }
    std::vector<std::pair<const Interaction<Model>*, ModelRun>> runs;
    for (const auto& set : sets) {
      for (const Interaction<Model>& of : held_out_) {
        for (std::size_t k = 0; k < seeds; ++k) {
          runs.emplace_back(&of, ModelRun{set, static_cast<std::uint32_t>(9501 + runs.size()), false});
        }
      }
    }
    const std::vector<double> after = left(runs, seeds, known.recorded);
    gap.after = after.front();
    if (after.size() > 1) {
      gap.best_rival = *std::min_element(after.begin() + 1, after.end());
    }
    if (gap.before < known.chance.largest_distance) {
      result.confirmation = Confirmation::NotTestable;
    } else {
      const bool shrinks = relative_fall(gap.before, gap.after) > gap.by_chance;
      const bool best = !(gap.best_rival < gap.after);
      result.confirmation = shrinks && best ? Confirmation::Confirmed : Confirmation::Refuted;
    }
  }

  std::vector<Interaction<Model>> learn_, held_out_, references_;
  RunJobs run_jobs_;
  MissingEffectSettings settings_;
  Discrepancy discrepancy_{};
  std::size_t runs_ = 0;
};

}  // namespace decant::inline DECANT_TARGET
