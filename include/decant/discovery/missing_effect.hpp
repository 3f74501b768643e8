// SPDX-License-Identifier: MIT
#pragma once

/// The workflow: where simulation and recordings disagree, which effect the model lacks, how strong it is, and whether
/// the gap shrinks on recordings that were not used.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/discovery/compared_recordings.hpp>
#include <decant/discovery/disagreement.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/effect_dictionary.hpp>
#include <decant/discovery/effect_evidence.hpp>
#include <decant/discovery/effect_judgement.hpp>
#include <decant/discovery/effect_refiner.hpp>
#include <decant/discovery/forward_model.hpp>
#include <decant/discovery/interaction_runs.hpp>
#include <decant/discovery/missing_effect_result.hpp>
#include <decant/discovery/missing_effect_settings.hpp>
#include <decant/discovery/observation_features.hpp>
#include <decant/discovery/smallest_seen.hpp>

namespace decant::inline DECANT_TARGET {

/// Finds what a model lacks. One search for one set of recordings.
template <ForwardModel Model>
class MissingEffectSearch {
 public:
  /// @param learn recordings of which all have what is missing, at one strength. @param held_out others, to check on.
  /// Their models may know of fewer effects, or have them in another order; which one is which is told by its words.
  /// @param references recordings, of any poses, containers and amounts, in which nothing is missing: how far reality
  /// is from the model all the same. What those of nearly the same interaction are off by is taken off what was
  /// recorded; of others, what effects seem to be there for it (ReferenceLesson), and it is known how much is left
  /// then, and how much of it effects seem to explain. Without any, the
  /// model's own scatter and JudgementSettings::distance_factor stand for it.
  /// Throws std::invalid_argument if there is nothing to learn from, models of what is learnt from have other effects
  /// than the first one's, or one of those held out none of them, names are not all different, or a setting is out of
  /// range.
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
        const EffectNumbers numbers(effects(), each.model->effects());
        const bool fits = set == &references_ ||  // of which none is asked for by its number
                          (set == &learn_ ? numbers.same() : !numbers.none());
        expects(fits, "MissingEffectSearch: effects of '" + each.name + "'", "those of the first recording's model",
                each.model->effects().size());
      }
    }
    for (Interaction<Model>& each : held_out_) {
      each.numbers = EffectNumbers(effects(), each.model->effects());
    }
    expects(settings_.refined >= 1 && settings_.refinement_rounds >= 1 && settings_.refinement_seeds >= 1,
            "MissingEffectSettings: refined, refinement_rounds, refinement_seeds", ">= 1", settings_.refined);
    expects(settings_.most_effects >= 1, "MissingEffectSettings: most_effects", ">= 1", settings_.most_effects);
    expects(settings_.beam >= 1, "MissingEffectSettings: beam", ">= 1", settings_.beam);
    expects(settings_.least_share >= 0 && settings_.least_share <= 1, "MissingEffectSettings: least_share", "0 .. 1",
            settings_.least_share);
    expects(settings_.enough_share >= 0 && settings_.enough_share <= 1, "MissingEffectSettings: enough_share", "0 .. 1",
            settings_.enough_share);
    expects(settings_.most_grown >= 0, "MissingEffectSettings: most_grown", ">= 0", settings_.most_grown);
    expects(settings_.most_left > 0, "MissingEffectSettings: most_left", "> 0", settings_.most_left);
    expects(settings_.promising_factor >= 0, "MissingEffectSettings: promising_factor", ">= 0",
            settings_.promising_factor);
    expects(settings_.sure >= 0 && settings_.sure <= 1, "MissingEffectSettings: sure", "0 .. 1", settings_.sure);
    expects(settings_.most_unlike >= 0, "MissingEffectSettings: most_unlike", ">= 0", settings_.most_unlike);
    expects(settings_.least_references >= 2, "MissingEffectSettings: least_references", ">= 2",
            settings_.least_references);
    plan_dictionary(effects(), settings_.next_dictionary);  // which is not needed before the search has run for long
  }

  const std::vector<Effect>& effects() const { return learn_.front().model->effects(); }

  MissingEffect find() {
    MissingEffect result;
    InteractionRuns<Model> make(run_jobs_);
    RecordingComparison<Model> compare(make, settings_, references_);
    EffectRefiner<Model> refine(make, settings_, learn_);
    compare.consult_references();
    std::vector<Stage> stages;
    bool gap_stands = false;
    std::vector<std::vector<RefinedEffect>> beam{{}};  // sets that further effects are looked for beside
    for (int round = 0; round < settings_.most_effects; ++round) {
      const std::optional<std::vector<Answer>> answers = answers_beside(beam, make, compare, refine, result);
      if (!answers) {
        break;
      }
      // what effects explain by curves through few runs, and do not in runs with them, is no gap
      gap_stands = gap_stands || !result.judgement.is_faint();
      if (answers->empty()) {
        break;
      }
      const RefinedTogether& best = answers->front().refined;
      const ChanceLevel& chance = answers->front().chance;
      const bool gains = relative_fall(result.learn.after, best.distance) > chance.fall;
      gap_stands = gap_stands || gains;
      if (round == 0) {
        keep_refined(*answers, result);
      }
      const Explanation explanation = explained_by(best, chance);
      if (!gains || (!stages.empty() && stages.back().explains && !explanation.explains)) {
        break;  // what was found before stands
      }
      result.found = round == 0 ? std::vector{result.refined.front()} : best.effects;  // with its probability
      result.learn.after = best.distance;
      stages.push_back({result.found, result.learn.after, explanation.explains});
      if (round == 0 && explanation.explains) {
        result.one_of = undecided(result.refined, chance, result.learn.before);
      }
      if (explanation.is_enough || result.one_of.size() > 1 || !is_promising(best)) {
        break;
      }
      beam = best_sets(*answers);
    }
    std::optional<ComparedRecordings> others;
    if (!held_out_.empty() && !stages.empty()) {
      DictionarySettings settings = settings_.dictionary;
      settings.repeats = 0;
      others = compare(held_out_, compare.has_lessons() ? effects() : std::vector<Effect>(), settings);
      drop_idle(*others, make, result.learn.by_chance, stages);
      result.found = stages.back().found;
      result.learn.after = stages.back().after;
    }
    const bool explained = !stages.empty() && stages.back().explains;
    if (gap_stands) {
      result.verdict = !explained ? Verdict::Unexplained : result.one_of.size() > 1 ? Verdict::OneOf : Verdict::Named;
    }
    if (!explained) {  // what helps a little is among those that were refined
      result.found.clear();
      result.learn.after = result.learn.before;
    }
    if (others && !result.found.empty()) {
      check(*others, make, result);
    }
    result.runs = make.made();
    return result;
  }

 private:
  /// What was found after a round.
  struct Stage {
    std::vector<RefinedEffect> found;
    double after;   ///< what is left of the recordings learnt from
    bool explains;  ///< enough of them
  };

  /// Effects that may be what is missing, together, and what chance does beside those that were found before them.
  struct Answer {
    RefinedTogether refined;
    ChanceLevel chance;
  };

  /// How much of a gap effects explain.
  struct Explanation {
    bool explains;   ///< enough to be the answer
    bool is_enough;  ///< so much that no further one is looked for
  };

  static std::vector<AppliedEffect> applied(const std::vector<RefinedEffect>& effects) {
    std::vector<AppliedEffect> result;
    for (const RefinedEffect& each : effects) {
      result.push_back(each.applied());
    }
    return result;
  }

  Judgement judged(const ComparedRecordings& known) const {
    return judge_effects(known.effects, known.evidence, known.chance, settings_.judgement);
  }

  /// Of recordings as they are beside the model as it is. Notes in `result` where they disagree, and what would have
  /// been seen; effects are tried there as well, and added to what is known.
  Judgement first_judgement(ComparedRecordings& known, RecordingComparison<Model>& compare,
                            MissingEffect& result) const {
    Judgement judgement = judged(known);
    result.learn = {judgement.distance, judgement.distance, known.chance.distance, known.chance.fall};
    result.where.clear();
    result.where_read.clear();
    for (const RecordedEvidence& each : known.recorded) {
      const Eigen::VectorXd off = each.beyond_chance(each.space().center());
      const ObservationFeatures& features = each.features();
      result.where.push_back(
          find_disagreements(features.silhouettes(), features.of_silhouettes(off), settings_.threshold));
      result.where_read.push_back(
          find_disagreements(features.readings(), features.of_readings(off), settings_.threshold));
    }
    const std::vector<double>& shares = settings_.dictionary.shares;
    result.smallest_seen =
        smallest_seen(effects(), known.recorded, known.chance, *std::min_element(shares.begin(), shares.end()));
    if (judgement.has_gap() && compare.locate(learn_, result.where, known)) {
      judgement = judged(known);
    }
    result.judgement = judgement;
    result.judged = known.effects;
    result.taught_by = known.recorded.front().references();
    result.lessons = known.recorded.front().lessons();
    for (const RecordedEvidence& each : known.recorded) {
      result.taught_by = std::min(result.taught_by, each.references());
      result.lessons = std::min(result.lessons, each.lessons());
    }
    return judgement;
  }

  /// Whether there are surroundings, such as a table, which the model as it is may not meet at all: there are where the
  /// effects that seem to explain most explain more beside them. From then on all runs have them.
  /// @return whether the model as it is meets them.
  bool look_around(const Judgement& judgement, const ComparedRecordings& known, InteractionRuns<Model>& make,
                   MissingEffect& result) const {
    constexpr std::size_t most = 2, seeds = 2;
    if (!judgement.has_gap()) {
      return false;
    }
    std::vector<std::vector<AppliedEffect>> likely{{}};  // the model as it is first
    std::set<std::string> answers;
    for (const EffectStanding& standing : judgement.standings) {
      const Effect& of = known.effects[standing.effect];
      if (answers.size() < most && standing.improvement > 0 && answers.insert(of.answer()).second) {
        const auto speed = of.fastest > 0 ? std::optional(of.speed) : std::nullopt;
        likely.push_back({{known.number[standing.effect], standing.strength, of.place, of.window, speed}});
      }
    }
    bool is_met = false;
    for (std::size_t k = 0; k < effects().size(); ++k) {
      if (effects()[k].kind != EffectKind::Surroundings) {
        continue;
      }
      const AppliedEffect all{k, Eigen::VectorXd::Constant(1, effects()[k].components.front().high)};
      std::vector<std::vector<AppliedEffect>> sets = likely;
      for (std::vector<AppliedEffect> each : likely) {
        each.push_back(all);
        sets.push_back(std::move(each));
      }
      const std::vector<DistanceLeft> left = left_of(learn_, known, make, sets, 8501, seeds);
      const auto with = left.begin() + static_cast<std::ptrdiff_t>(likely.size());
      const auto nearer = [](const DistanceLeft& a, const DistanceLeft& b) { return a.value < b.value; };
      const auto helps = [&](const DistanceLeft& without, const DistanceLeft& there) {
        return relative_fall(without.value, there.value) > known.chance.fall;
      };
      if (helps(*std::min_element(left.begin(), with, nearer), *std::min_element(with, left.end(), nearer))) {
        result.surroundings.push_back(all);
        make.surround(effects()[k], all);
        is_met = is_met || helps(left.front(), *with) || helps(*with, left.front());
      }
    }
    return is_met;
  }

  /// The best effects beside each of some sets that were found before, the best first. Nothing where nothing is left to
  /// explain beside the first of these. @param beam an empty set at first, with which `result` begins.
  std::optional<std::vector<Answer>> answers_beside(const std::vector<std::vector<RefinedEffect>>& beam,
                                                    InteractionRuns<Model>& make, RecordingComparison<Model>& compare,
                                                    EffectRefiner<Model>& refine, MissingEffect& result) const {
    std::vector<Answer> answers;
    DictionarySettings next = settings_.next_dictionary;
    if (compare.has_lessons()) {
      next.shares = settings_.dictionary.shares;  // of which lessons are
    }
    for (const std::vector<RefinedEffect>& found : beam) {
      const bool is_first_round = found.empty();
      const DictionarySettings& settings = is_first_round ? settings_.dictionary : next;
      ComparedRecordings known = compare(learn_, effects(), settings, applied(found));
      Judgement judgement = is_first_round ? first_judgement(known, compare, result) : judged(known);
      if (is_first_round && look_around(judgement, known, make, result)) {
        known = compare(learn_, effects(), settings);
        judgement = first_judgement(known, compare, result);
      }
      if (judgement.verdict != Verdict::Nothing) {
        add(refine.best(judgement, known, found, result.learn.before, result.learn.after), known.chance, answers);
      } else if (&found == &beam.front()) {
        return std::nullopt;
      }
    }
    return answers;
  }

  /// Adds what was refined beside one set, the best first, to what was beside others. Of several effects each has to be
  /// stronger than what is tolerated: beside others, what may be tolerated as well is not what is missing.
  void add(const std::vector<RefinedTogether>& refined, const ChanceLevel& chance, std::vector<Answer>& answers) const {
    if (refined.empty() || (refined.front().effects.size() > 1 && !all_beyond_tolerance(refined.front().effects))) {
      return;
    }
    for (const RefinedTogether& each : refined) {
      answers.push_back({each, chance});
    }
    std::stable_sort(answers.begin(), answers.end(), [](const Answer& a, const Answer& b) {
      return a.refined.evidence.value > b.refined.evidence.value;
    });
  }

  bool all_beyond_tolerance(const std::vector<RefinedEffect>& found) const {
    return std::all_of(found.begin(), found.end(),
                       [&](const RefinedEffect& each) { return is_beyond_tolerance(each, effects()[each.effect]); });
  }

  /// Of each set of names the best; those that come near the best of all.
  /// @param answers the best one first.
  std::vector<std::vector<RefinedEffect>> best_sets(const std::vector<Answer>& answers) const {
    std::vector<std::vector<RefinedEffect>> sets;
    std::set<std::set<std::string>> names;
    const double least = answers.front().refined.distance;
    for (const Answer& each : answers) {
      std::set<std::string> own;
      for (const RefinedEffect& effect : each.refined.effects) {
        own.insert(answer(effect));
      }
      if (sets.size() < static_cast<std::size_t>(settings_.beam) &&
          comes_near(each.refined.distance, least, each.chance) && names.insert(own).second) {
        sets.push_back(each.refined.effects);
      }
    }
    return sets;
  }

  /// Of the first round, each with its probability.
  void keep_refined(const std::vector<Answer>& answers, MissingEffect& result) const {
    std::vector<Evidence> evidence;
    for (const Answer& each : answers) {
      result.refined.push_back(each.refined.effects.front());
      evidence.push_back(each.refined.evidence);
    }
    set_probabilities(result.refined, evidence);
  }

  /// The more effects, the more of what nothing in the catalogue explains they can take over. Where all that is left
  /// may be chance, as far as few runs tell, nothing is left to explain, whatever its share: what reality is off by
  /// where nothing is missing may be more than the model's own runs are. Of an effect that would have to be stronger
  /// than what it is looked for up to, it is not known what would be left: what is missing is likely to be another one
  /// that it stands in for. So is what makes the gap grow at some times, unless all of it may be chance.
  Explanation explained_by(const RefinedTogether& found, const ChanceLevel& chance) const {
    if (std::any_of(found.effects.begin(), found.effects.end(),
                    [&](const RefinedEffect& each) { return is_at_limit(each, effects()[each.effect]); })) {
      return {false, false};
    }
    const double least = 1 - (1 - settings_.least_share) / static_cast<double>(found.effects.size());
    const bool leaves_little = found.distance <= settings_.most_left * chance.largest_distance;
    const bool down_to_chance = found.distance - found.distance_deviation <= chance.largest_distance;
    const bool takes_away = leaves_little && found.grown <= settings_.most_grown;
    return {leaves_little && (down_to_chance || (takes_away && found.share >= least)),
            down_to_chance || (takes_away && found.share >= settings_.enough_share)};
  }

  /// Those that are the answer with enough probability together, the most probable ones first, if they are several;
  /// what explains no more than chance does is none of them. @param before the distance to the model without any.
  std::vector<std::size_t> undecided(std::vector<RefinedEffect> refined, const ChanceLevel& chance,
                                     double before) const {
    std::stable_sort(refined.begin(), refined.end(),
                     [](const auto& a, const auto& b) { return a.probability > b.probability; });
    std::vector<std::size_t> result;
    std::set<std::string> answers;
    double together = 0;
    for (const RefinedEffect& each : refined) {
      const bool explains = relative_fall(before, each.distance) > chance.fall;
      if (together < settings_.sure && explains && answers.insert(answer(each)).second) {
        together += each.probability;
        result.push_back(each.effect);
      }
    }
    return result.size() > 1 ? result : std::vector<std::size_t>();
  }

  /// Of answers, by the best effect of each. @param evidence for each effect.
  void set_probabilities(std::vector<RefinedEffect>& of, const std::vector<Evidence>& evidence) const {
    std::map<std::string, std::size_t> place;
    std::vector<Evidence> best;
    for (std::size_t k = 0; k < of.size(); ++k) {
      const auto [entry, is_new] = place.try_emplace(answer(of[k]), best.size());
      if (is_new) {
        best.push_back(evidence[k]);
      } else if (evidence[k].value > best[entry->second].value) {
        best[entry->second] = evidence[k];
      }
    }
    const std::vector<double> probability = probabilities(best);
    for (RefinedEffect& each : of) {
      each.probability = probability[place.at(answer(each))];
    }
  }

  const std::string& answer(const RefinedEffect& of) const { return effects()[of.effect].answer(); }

  /// Whether it may pay to look for one more. Of effects that are all as strong, n of n + 1 explain that share; the
  /// strongest are found first.
  bool is_promising(const RefinedTogether& found) const {
    const auto count = static_cast<double>(found.effects.size());
    return found.share >= settings_.promising_factor * count / (count + 1);
  }

  /// An effect that was added to others has to explain some of what was not learnt from, too: what the first ones leave
  /// may be how the model has them, and something that is not there would stand for it in the recordings learnt from
  /// alone. Where others are predicted no better with it, it is taken back.
  void drop_idle(const ComparedRecordings& others, InteractionRuns<Model>& make, double by_chance,
                 std::vector<Stage>& stages) const {
    if (stages.size() < 2) {
      return;
    }
    std::vector<std::vector<AppliedEffect>> sets;
    for (const Stage& stage : stages) {
      sets.push_back(applied(stage.found));
    }
    const std::vector<DistanceLeft> left = left_of_held_out(others, make, sets);
    for (std::size_t last = stages.size() - 1; last > 0; --last) {
      const double without = left[last - 1].value, with = left[last].value;
      const bool helps = relative_fall(without, with) > by_chance;
      const bool harms = relative_fall(with, without) > by_chance;
      if (helps || (without <= others.chance.largest_distance && !harms)) {  // or there was nothing left to explain
        break;
      }
      stages.pop_back();
    }
  }

  /// Of recordings that were not used, with each of some sets of effects.
  std::vector<DistanceLeft> left_of_held_out(const ComparedRecordings& known, InteractionRuns<Model>& make,
                                             const std::vector<std::vector<AppliedEffect>>& sets) const {
    return left_of(held_out_, known, make, sets, 9501, static_cast<std::size_t>(settings_.dictionary.baselines));
  }

  /// @param first of the seeds, which are the same ones for all sets. @param seeds how many runs of each recording.
  static std::vector<DistanceLeft> left_of(const std::vector<Interaction<Model>>& recordings,
                                           const ComparedRecordings& known, InteractionRuns<Model>& make,
                                           const std::vector<std::vector<AppliedEffect>>& sets, std::uint32_t first,
                                           std::size_t seeds) {
    std::vector<typename InteractionRuns<Model>::Run> runs;
    for (const auto& set : sets) {
      std::uint32_t seed = first;
      for (const Interaction<Model>& of : recordings) {
        for (std::size_t k = 0; k < seeds; ++k) {
          runs.emplace_back(&of, ModelRun{set, seed++, false});
        }
      }
    }
    return distances_left(make, runs, seeds, known.recorded);
  }

  /// Predicts recordings that were not used, with what was found and with its rivals, strengths as they were found.
  void check(const ComparedRecordings& known, InteractionRuns<Model>& make, MissingEffect& result) const {
    GapChange& gap = result.held_out;
    gap.before = 0;
    for (const EffectEvidence& each : known.evidence) {
      gap.before += each.distance / static_cast<double>(held_out_.size());
    }
    gap.noise = known.chance.distance;
    gap.by_chance = result.learn.by_chance;
    std::vector<std::vector<AppliedEffect>> sets{applied(result.found)};
    std::vector<std::size_t> rivals;  // of those refined; the first one is what was found
    for (std::size_t k = 0; k < result.refined.size(); ++k) {
      if (answer(result.refined[k]) != answer(result.found.front())) {
        rivals.push_back(k);
        sets.push_back({result.refined[k].applied()});
      }
    }
    std::vector<DistanceLeft> after = left_of_held_out(known, make, sets);
    if (result.found.size() == 1 && gap.before >= known.chance.largest_distance) {
      weigh(rivals, known.chance, after, result);
    }
    gap.after = after.front().value;
    for (std::size_t k = 1; k < after.size(); ++k) {
      gap.best_rival = k > 1 ? std::min(gap.best_rival, after[k].value) : after[k].value;
    }
    if (gap.before < known.chance.largest_distance) {
      result.confirmation = Confirmation::NotTestable;
    } else {
      const bool shrinks = relative_fall(gap.before, gap.after) > gap.by_chance;
      const bool best = !(gap.best_rival < gap.after);
      const bool at_all_times =
          after.front().grown <= settings_.most_grown || gap.after <= known.chance.largest_distance;
      result.confirmation = shrinks && best && at_all_times ? Confirmation::Confirmed : Confirmation::Refuted;
    }
  }

  /// Takes recordings that were not used for evidence, too: of several effects that those learnt from leave, it may be
  /// that of one only.
  /// @param rivals of the first of those refined, by their places there. @param after what is left of these recordings
  /// with the first one, then with each of its rivals; where one of these is the answer, they change places.
  void weigh(const std::vector<std::size_t>& rivals, ChanceLevel chance, std::vector<DistanceLeft>& after,
             MissingEffect& result) const {
    std::vector<RefinedEffect>& refined = result.refined;
    chance.fall = result.learn.by_chance;
    std::vector<Evidence> evidence(refined.size(), {-std::numeric_limits<double>::infinity(), 0});
    for (std::size_t k = 0; k < after.size(); ++k) {
      const std::size_t which = k == 0 ? 0 : rivals[k - 1];
      evidence[which] = evidence_of(after[k].value, after[k].deviation, chance);
      evidence[which].value += std::log(refined[which].probability);
    }
    set_probabilities(refined, evidence);
    if (result.verdict == Verdict::OneOf) {
      result.one_of = undecided(refined, result.judgement.chance, result.learn.before);
      std::size_t best = 0;  // 0: the first one; rivals from 1 on
      for (std::size_t k = 1; k < after.size(); ++k) {
        const std::size_t nearest = best == 0 ? 0 : rivals[best - 1];
        best = evidence[rivals[k - 1]].value > evidence[nearest].value ? k : best;
      }
      if (best > 0) {
        std::swap(refined.front(), refined[rivals[best - 1]]);
        std::swap(after.front(), after[best]);
      }
      result.verdict = result.one_of.size() > 1 ? Verdict::OneOf : Verdict::Named;
      result.told_apart_by_others = result.verdict == Verdict::Named;
    }
    result.found = {refined.front()};
    result.learn.after = refined.front().distance;
  }

  std::vector<Interaction<Model>> learn_, held_out_, references_;
  RunJobs run_jobs_;
  MissingEffectSettings settings_;
};

}  // namespace decant::inline DECANT_TARGET
