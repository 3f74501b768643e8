// SPDX-License-Identifier: MIT
#pragma once

/// The effects that explain most, looked at more closely: strengths, places and times by runs of their own, one step
/// after another.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/target.hpp>
#include <decant/discovery/compared_recordings.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/effect_curve.hpp>
#include <decant/discovery/effect_evidence.hpp>
#include <decant/discovery/effect_judgement.hpp>
#include <decant/discovery/effect_refinement.hpp>
#include <decant/discovery/forward_model.hpp>
#include <decant/discovery/interaction_runs.hpp>
#include <decant/discovery/missing_effect_result.hpp>
#include <decant/discovery/missing_effect_settings.hpp>
#include <decant/discovery/observation.hpp>
#include <decant/discovery/refinement_path.hpp>

namespace decant::inline DECANT_TARGET {

/// Effects together, refined.
struct RefinedTogether {
  std::vector<RefinedEffect> effects{};  ///< the new one last
  double distance = 0, share = 0;        ///< see RefinedEffect
  double distance_deviation = 0;         ///< standard, of few runs
  double grown = 0;                      ///< see grown_gap
  /// Of what is left, less one for each number that was fitted: so much they take away by chance (Akaike, IEEE Trans.
  /// Autom. Control 19, 1974).
  Evidence evidence{};
};

/// Refines the best effects of a judgement.
template <ForwardModel Model>
class EffectRefiner {
 public:
  /// @param runs, of have to outlive it; all of the interactions have the effect at one strength.
  EffectRefiner(InteractionRuns<Model>& runs, const MissingEffectSettings& settings,
                const std::vector<Interaction<Model>>& of)
      : runs_(&runs), settings_(settings), of_(&of) {}

  /// The best of different answers, each refined together with what was found before; by evidence, the best first.
  /// How well strengths are known takes runs, and is not asked where even the best one gains no more than by chance.
  /// @param before the distance to the model without any. @param after with what was found before.
  std::vector<RefinedTogether> best(const Judgement& judgement, const ComparedRecordings& known,
                                    const std::vector<RefinedEffect>& found, double before, double after) {
    std::vector<Candidate> candidates = chosen(judgement, known, found);
    add_beats(candidates, known, found);
    move(candidates, known);
    const bool faint = before <= known.chance.largest_distance;  // few runs would tell more of chaos than of it
    const std::vector<Reached> reached = reached_by(candidates, known, faint ? 3 : 1);
    std::vector<Evidence> evidence;
    double least = std::numeric_limits<double>::infinity();
    for (const Reached& each : reached) {
      evidence.push_back(each.evidence);
      least = std::min(least, each.left.value);
    }
    const std::vector<double> probability = reached.empty() ? std::vector<double>() : probabilities(evidence);
    const bool gains = !reached.empty() && relative_fall(after, reached.front().left.value) > known.chance.fall;
    std::vector<RefinedTogether> refined;
    for (std::size_t k = 0; k < reached.size(); ++k) {
      const double share = share_of_reducible(before, reached[k].left.value, known.chance.distance, least);
      const bool may_be_it = k == 0 || probability[k] > 0.5 * (1 - settings_.sure);  // also for what others say
      refined.push_back(described(reached[k], share, gains && may_be_it, known, found));
    }
    return refined;
  }

 private:
  using Run = typename InteractionRuns<Model>::Run;
  using Views = std::vector<RefinementView>;

  std::size_t middle_seeds() const noexcept { return static_cast<std::size_t>(settings_.refinement_seeds); }
  /// Of runs to each side of a number. Where many numbers move, each of them is off by a lot there.
  std::size_t slope_seeds(const EffectPoint& point) const noexcept {
    return point.moving() <= 3 ? middle_seeds() : (middle_seeds() + 1) / 2;
  }

  /// An effect on its way to where it explains most.
  struct Candidate {
    std::size_t judged = 0;  ///< its number in the Judgement
    RefinementPath path;
  };

  /// Where a candidate got to.
  struct Reached {
    const Candidate* candidate = nullptr;
    EffectPoint point{};
    DistanceLeft left{};
    Evidence evidence{};
  };

  /// A run with an effect, and what is left with it.
  struct NearestRun {
    Eigen::VectorXd strength{};
    double distance = std::numeric_limits<double>::infinity();
  };

  /// The runs of the dictionary with an effect at one strength that are nearest to what was recorded; infinitely far
  /// where none worked.
  static NearestRun nearest_run(std::size_t effect, const ComparedRecordings& known) {
    const EffectDictionary& first = known.dictionary.front();
    NearestRun nearest;
    std::vector<std::size_t> left = first.of_effect(effect);
    while (!left.empty()) {
      const Eigen::VectorXd strength = first.strength(left.front());
      const auto others = std::stable_partition(left.begin(), left.end(),
                                                [&](std::size_t run) { return first.strength(run) == strength; });
      std::vector<Observation> seen;
      for (const EffectDictionary& each : known.dictionary) {
        std::for_each(left.begin(), others, [&](std::size_t run) { seen.push_back(each.seen[run]); });
      }
      left.erase(left.begin(), others);
      const double distance = distance_left(known.recorded, seen).value;
      if (distance < nearest.distance) {
        nearest = {strength, distance};
      }
    }
    return nearest;
  }

  /// By component, half of how far strengths have to be apart to differ by four times as much as two runs' mean does by
  /// chaos; of what is too faint for that, half of all strengths.
  static Eigen::VectorXd telling_steps(std::size_t judged, const Eigen::VectorXd& at, const ComparedRecordings& known) {
    constexpr double enough = 4;
    const Effect& effect = known.effects[judged];
    std::vector<EffectCurve> curves;
    double chaos = 0;
    for (const RecordedEvidence& each : known.recorded) {
      curves.push_back(*each.curve(judged));
      chaos += each.chaos();
    }
    Eigen::VectorXd steps(at.size());
    for (Eigen::Index k = 0; k < steps.size(); ++k) {
      const EffectComponent& of = effect.components[static_cast<std::size_t>(k)];
      const double end = at[k] < of.base || of.high == of.base ? of.low : of.high;
      const auto tells = [&](double share) {
        Eigen::VectorXd strength = effect.base();
        strength[k] = of.base + share * (end - of.base);
        double energy = 0;
        for (std::size_t which = 0; which < curves.size(); ++which) {
          energy += curves[which].energy(strength, known.recorded[which].chaos());
        }
        return energy >= enough * chaos;
      };
      double share = 1;
      for (double less = 0.95; less > 0 && tells(less); less -= 0.05) {
        share = less;
      }
      steps[k] = 0.5 * share * std::abs(end - of.base);
    }
    return steps;
  }

  /// One of the judged effects beside those that were found before. @param guess to begin with.
  Candidate candidate(std::size_t judged, const AppliedEffect& guess, const ComparedRecordings& known,
                      const std::vector<RefinedEffect>& found) const {
    EffectPoint point;
    for (const RefinedEffect& each : found) {
      point.add(of_->front().model->effects()[each.effect], each.effect, each.applied());
    }
    point.add(known.effects[judged], guess.effect, guess, telling_steps(judged, guess.strength, known));
    return {judged, RefinementPath(point.rounded())};
  }

  /// Whether one answer has several such effects: in different places, or for a while at different times. By a curve
  /// none of them may be where, or when, it is.
  static bool may_be_several(const Effect& effect) { return effect.place || effect.window; }

  /// Those that are looked at closely: of one answer the best effect, and of one that may be in several places, or at
  /// several times, two of them, by evidence. What lasts for a while explains more by chance than what lasts. Answers
  /// that chance does not tell from the best of these by their curves are rivals all the same, up to as many more.
  /// Where what an effect does is bent, as a front's is that comes later, a curve through few runs promises less than
  /// one of them has: answers that come near the best by such a run are looked at from there on, although no curve has
  /// them among the best.
  std::vector<Candidate> chosen(const Judgement& judgement, const ComparedRecordings& known,
                                const std::vector<RefinedEffect>& found) const {
    struct Instance {
      Candidate candidate;
      double distance;  ///< that is left by the curve
      double evidence;  ///< of it
    };
    std::map<std::string, std::vector<Instance>> of_answer;
    std::vector<std::string> order;  // of answers, by vote, as often as each has an effect
    for (const EffectStanding& standing : judgement.standings) {
      const Effect& effect = known.effects[standing.effect];
      const std::size_t number = known.number[standing.effect];
      if (std::any_of(found.begin(), found.end(), [&](const auto& other) { return other.effect == number; })) {
        continue;
      }
      Candidate one = candidate(standing.effect, {number, standing.strength, {}}, known, found);
      const double evidence =
          evidence_of(standing.distance, 0, known.chance).value - static_cast<double>(one.path.point().size());
      of_answer[effect.answer()].push_back({std::move(one), standing.distance, evidence});
      if (standing.improvement > 0) {
        order.push_back(effect.answer());
      }
    }
    for (auto& [answer, instances] : of_answer) {
      std::stable_sort(instances.begin(), instances.end(),
                       [](const auto& a, const auto& b) { return a.evidence > b.evidence; });
    }
    std::map<std::string, std::size_t> taken;
    std::vector<Candidate> result;
    double best = judgement.distance;
    const auto most = static_cast<std::size_t>(settings_.refined);
    for (const std::string& answer : order) {
      const std::vector<Instance>& instances = of_answer[answer];
      const std::size_t next = taken[answer];
      if (result.size() < most && next < instances.size() &&
          next < (may_be_several(known.effects[instances[next].candidate.judged]) ? 2U : 1U)) {
        best = std::min(best, instances[next].distance);
        result.push_back(instances[next].candidate);
        ++taken[answer];
      }
    }
    const double like_best = std::max((1 + known.chance.fall) * best, known.chance.distance);
    for (const std::string& answer : order) {
      const Instance& first = of_answer[answer].front();
      if (result.size() < 2 * most && taken[answer] == 0 && first.distance <= like_best) {
        result.push_back(first.candidate);
        ++taken[answer];
      }
    }
    for (const auto& [answer, instances] : of_answer) {
      if (taken[answer] > 0) {
        continue;
      }
      NearestRun run;
      const Instance* with = nullptr;
      for (const Instance& each : instances) {
        NearestRun other = nearest_run(each.candidate.judged, known);
        if (other.distance < run.distance) {
          run = std::move(other);
          with = &each;
        }
      }
      const bool bent = with != nullptr && relative_fall(with->distance, run.distance) > known.chance.fall;
      if (bent && comes_near(run.distance, best, known.chance)) {
        EffectPoint point = with->candidate.path.point();
        const auto [begin, count] = point.strength_of(found.size());
        for (Eigen::Index k = 0; k < count; ++k) {
          point = point.with(begin + k, run.strength[k]);
        }
        result.push_back({with->candidate.judged, RefinementPath(std::move(point))});
      }
    }
    return result;
  }

  /// Beside each candidate of which there are beats to try the one whose run is nearest to what was recorded.
  void add_beats(std::vector<Candidate>& candidates, const ComparedRecordings& known,
                 const std::vector<RefinedEffect>& found) {
    const std::size_t given = candidates.size();
    for (std::size_t which = 0; which < given; ++which) {
      const std::size_t judged = candidates[which].judged;
      const Effect& effect = known.effects[judged];
      std::vector<Candidate> others;
      std::vector<Run> runs;
      for (const TimeWindow& beat : effect.beats) {
        AppliedEffect in_beats = candidates[which].path.point().applied(found.size());
        in_beats.window = beat;
        others.push_back(candidate(judged, in_beats, known, found));
        for (const Interaction<Model>& of : *of_) {
          runs.emplace_back(&of, others.back().path.point().run(4001 + static_cast<std::uint32_t>(runs.size())));
        }
      }
      const std::vector<DistanceLeft> left = distances_left(*runs_, runs, 1, known.recorded);
      const auto nearest =
          std::min_element(left.begin(), left.end(), [](const auto& a, const auto& b) { return a.value < b.value; });
      if (nearest != left.end() && std::isfinite(nearest->value)) {
        candidates.push_back(std::move(others[static_cast<std::size_t>(nearest - left.begin())]));
      }
    }
  }

  /// Leaves the best one, the next best one as its rival, and all others that may come near it.
  static void keep_promising(std::vector<Candidate>& candidates, const ChanceLevel& chance) {
    std::vector<double> sorted;
    for (const Candidate& each : candidates) {
      sorted.push_back(each.path.expected());
    }
    std::sort(sorted.begin(), sorted.end());
    const double rival = sorted[std::min<std::size_t>(1, sorted.size() - 1)];
    std::erase_if(candidates, [&](const Candidate& each) {
      return each.path.expected() > rival && !comes_near(each.path.expected(), sorted.front(), chance);
    });
  }

  /// Only the best one goes on. What is far from where it is looked for first takes more steps than others, and what it
  /// has not got to by then would be another effect's to explain.
  static void settle_others(std::vector<Candidate>& candidates) {
    const auto best = std::min_element(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) {
      return a.path.expected() < b.path.expected();
    });
    for (auto each = candidates.begin(); each != candidates.end(); ++each) {
      if (each != best) {
        each->path.settle();
      }
    }
  }

  /// All of them towards where they explain most, fewer of them in each round.
  void move(std::vector<Candidate>& candidates, const ComparedRecordings& known) {
    const int most = std::max(settings_.refinement_rounds, settings_.last_refinement_rounds);
    for (int round = 0; round < most && !candidates.empty(); ++round) {
      if (round >= settings_.refinement_rounds) {
        settle_others(candidates);
      }
      // none that distances are measured with
      step_all(candidates, known, static_cast<std::uint32_t>((round < 3 ? 5001 : 10001) + 1000 * round));
      if (round + 1 < settings_.refinement_rounds) {
        keep_promising(candidates, known.chance);
      }
    }
  }

  /// One step for each of the candidates that is not settled, all runs side by side. A point at which runs fail stays.
  void step_all(std::vector<Candidate>& candidates, const ComparedRecordings& known, std::uint32_t seed) {
    std::vector<Run> runs;
    const auto ask = [&](const Interaction<Model>& of, const EffectPoint& point, std::size_t seeds) {
      for (std::size_t k = 0; k < seeds; ++k) {
        runs.emplace_back(&of, point.run(seed + static_cast<std::uint32_t>(runs.size())));
      }
    };
    for (const Candidate& each : candidates) {
      if (each.path.is_settled()) {
        continue;
      }
      const EffectPoint& point = each.path.point();
      for (const Interaction<Model>& of : *of_) {
        ask(of, point, middle_seeds());
        for (Eigen::Index k = 0; k < point.size(); ++k) {
          if (!point.is_held(k)) {
            ask(of, point.with(k, point.value()[k] - point.step(k)), slope_seeds(point));
            ask(of, point.with(k, point.value()[k] + point.step(k)), slope_seeds(point));
          }
        }
      }
    }
    const std::vector<Observation> seen = (*runs_)(runs);
    const Observation* next = seen.data();
    for (Candidate& each : candidates) {
      if (each.path.is_settled()) {
        continue;
      }
      const EffectPoint& point = each.path.point();
      Views views;
      std::vector<Eigen::VectorXd> features;
      for (const RecordedEvidence& recorded : known.recorded) {
        if (auto view = view_of(point, recorded, next)) {
          views.push_back(std::move(*view));
          features.push_back(recorded.recorded_features());
        }
        next += middle_seeds() + slope_seeds(point) * 2 * point.moving();
      }
      if (views.size() < known.recorded.size()) {
        each.path.fail();
      } else {
        each.path.step(std::move(views), features, known.chance);
        each.path.stand_at(placed(each.path.point()));
      }
    }
  }

  /// Places that are off where effects can act drift, as nothing says how far off; and the nearer to a container's
  /// middle a place is, the farther along its wall a step of it goes.
  EffectPoint placed(EffectPoint point) const {
    if constexpr (PlacingModel<Model>) {
      for (std::size_t part = 0; part < point.effects(); ++part) {
        const AppliedEffect applied = point.applied(part);
        if (applied.place) {
          point = point.with_place(part, of_->front().model->placed(applied.effect, *applied.place));
        }
      }
    }
    return point;
  }

  /// @param seen of runs at the point, then below and above of each of its numbers that is not held.
  std::optional<RefinementView> view_of(const EffectPoint& point, const RecordedEvidence& recorded,
                                        const Observation* seen) const {
    const std::size_t seeds = slope_seeds(point);
    const auto middle = recorded.mean_features({seen, middle_seeds()});
    seen += middle_seeds();
    if (!middle) {
      return std::nullopt;
    }
    RefinementView view{&recorded.space(), *middle};
    view.side_chaos =
        recorded.chaos() / static_cast<double>(seeds) - recorded.chaos() / static_cast<double>(middle_seeds());
    view.chaos.resize(point.size());
    for (Eigen::MatrixXd* each : {&view.slope, &view.below, &view.above}) {
      each->resize(middle->size(), point.size());
    }
    for (Eigen::Index k = 0; k < point.size(); ++k) {
      if (point.is_held(k)) {
        view.slope.col(k).setZero();
        view.chaos[k] = 0;
        view.below.col(k) = *middle;
        view.above.col(k) = *middle;
        continue;
      }
      const auto below = recorded.mean_features({seen, seeds});
      seen += seeds;
      const auto above = recorded.mean_features({seen, seeds});
      seen += seeds;
      const double apart = point.with(k, point.value()[k] + point.step(k)).value()[k] -
                           point.with(k, point.value()[k] - point.step(k)).value()[k];
      if (!below || !above || !(apart > 0)) {
        return std::nullopt;
      }
      view.slope.col(k) = (*above - *below) / apart;
      view.chaos[k] = 2 * recorded.chaos() / static_cast<double>(seeds) / (apart * apart);
      view.below.col(k) = *below;
      view.above.col(k) = *above;
    }
    return view;
  }

  static Reached reached_at(EffectPoint point, const DistanceLeft& left, const Candidate& by,
                            const ChanceLevel& chance) {
    Evidence evidence = evidence_of(left.value, left.deviation, chance);
    evidence.value -= static_cast<double>(point.size());
    return {&by, std::move(point), left, evidence};
  }

  /// Without those for which runs fail there; by evidence, the best one first. @param candidates have to outlive it.
  /// @param times see distances
  std::vector<Reached> reached_by(const std::vector<Candidate>& candidates, const ComparedRecordings& known,
                                  int times) {
    std::vector<EffectPoint> points;
    for (const Candidate& each : candidates) {
      points.push_back(each.path.point());
    }
    const std::vector<DistanceLeft> left = distances(points, known, times);
    std::vector<Reached> reached;
    for (std::size_t k = 0; k < points.size(); ++k) {
      if (std::isfinite(left[k].value)) {
        reached.push_back(reached_at(points[k], left[k], candidates[k], known.chance));
      }
    }
    std::stable_sort(reached.begin(), reached.end(),
                     [](const Reached& a, const Reached& b) { return a.evidence.value > b.evidence.value; });
    if (!reached.empty()) {
      take_back_last_step(reached.front(), known, times);
    }
    return reached;
  }

  /// Nobody has checked the last step; where it led away, the point before it is taken.
  void take_back_last_step(Reached& best, const ComparedRecordings& known, int times) {
    const RefinementPath& path = best.candidate->path;
    const auto leaves_less = [&](double distance) {
      return relative_fall(best.left.value, distance) > known.chance.fall;
    };
    if (leaves_less(path.least_distance())) {
      const DistanceLeft there = distances({path.nearest()}, known, times).front();
      if (leaves_less(there.value)) {
        best = reached_at(path.nearest(), there, *best.candidate, known.chance);
      }
    }
  }

  /// @param with_deviations how well strengths are known, which takes runs.
  RefinedTogether described(const Reached& reached, double share, bool with_deviations, const ComparedRecordings& known,
                            const std::vector<RefinedEffect>& found) {
    const EffectPoint& point = reached.point;
    Eigen::VectorXd deviation = Eigen::VectorXd::Constant(point.size(), std::numeric_limits<double>::quiet_NaN());
    if (with_deviations) {
      // where more is left than chance leaves, estimates are off by more as well (Birge, Phys. Rev. 40, 1932)
      const double more = std::sqrt(std::max(1.0, reached.left.value / std::max(known.chance.distance, 1e-12)));
      deviation = more * deviations(point, reached.candidate->path.views(), known);
    }
    const DistanceLeft& left = reached.left;
    RefinedTogether one{{}, left.value, share, left.deviation, left.grown, reached.evidence};
    for (std::size_t part = 0; part < point.effects(); ++part) {
      const AppliedEffect applied = point.applied(part);
      const auto [begin, count] = point.strength_of(part);
      const std::size_t judged = part < found.size() ? found[part].judged : reached.candidate->judged;
      one.effects.push_back({applied.effect, judged, applied.strength, deviation.segment(begin, count), applied.place,
                             applied.window, applied.speed, one.distance, one.share, one.grown});
    }
    return one;
  }

  /// Standard deviation of each number of a point: what would be found in recordings of it in which all that is
  /// tolerated is drawn (a parametric bootstrap: Efron and Tibshirani, An Introduction to the Bootstrap, 1993).
  Eigen::VectorXd deviations(const EffectPoint& point, const Views& views, const ComparedRecordings& known) {
    Eigen::VectorXd square = Eigen::VectorXd::Zero(point.size());
    std::vector<Run> runs;
    for (int draw = 0; draw < settings_.repeats; ++draw) {
      for (const Interaction<Model>& of : *of_) {
        runs.emplace_back(&of, point.run(7001 + static_cast<std::uint32_t>(runs.size())));
        runs.back().second.tolerated = true;
      }
    }
    const std::vector<Observation> seen = (*runs_)(runs);
    std::vector<Eigen::VectorXd> moves;
    for (const Observation* next = seen.data(); !views.empty() && next < seen.data() + seen.size();
         next += of_->size()) {
      std::vector<Eigen::VectorXd> features;
      for (std::size_t k = 0; k < of_->size(); ++k) {
        if (const auto one = known.recorded[k].mean_features({next + k, 1})) {
          features.push_back(*one);
        }
      }
      if (features.size() == of_->size()) {
        moves.push_back(refinement(point, views, features, true));
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

  /// What is left of the learnt recordings at each point; infinite where runs fail. All points have the same seeds:
  /// what chaos does to all alike tells nothing of them. @param times as many runs as there are baselines.
  std::vector<DistanceLeft> distances(const std::vector<EffectPoint>& points, const ComparedRecordings& known,
                                      int times) {
    const auto seeds = static_cast<std::size_t>(times * settings_.dictionary.baselines);
    std::vector<Run> runs;
    for (const EffectPoint& point : points) {
      std::uint32_t seed = 9001;
      for (const Interaction<Model>& of : *of_) {
        for (std::size_t k = 0; k < seeds; ++k) {
          runs.emplace_back(&of, point.run(seed++));
        }
      }
    }
    return distances_left(*runs_, runs, seeds, known.recorded);
  }

  InteractionRuns<Model>* runs_;
  MissingEffectSettings settings_;
  const std::vector<Interaction<Model>>* of_;
};

}  // namespace decant::inline DECANT_TARGET
