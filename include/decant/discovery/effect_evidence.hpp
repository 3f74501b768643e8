// SPDX-License-Identifier: MIT
#pragma once

/// What one recording says about each effect, and what a recording would say in which nothing is missing.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/effect_curve.hpp>
#include <decant/discovery/effect_dictionary.hpp>
#include <decant/discovery/gap_over_time.hpp>
#include <decant/discovery/nuisance_space.hpp>
#include <decant/discovery/observation.hpp>
#include <decant/discovery/observation_features.hpp>
#include <decant/discovery/reading_features.hpp>
#include <decant/discovery/reference_lesson.hpp>
#include <decant/discovery/silhouette_features.hpp>
#include <decant/discovery/silhouette_gap.hpp>
#include <decant/discovery/silhouette_series.hpp>
#include <decant/discovery/strength_profile.hpp>

namespace decant::inline DECANT_TARGET {

/// How a gap between silhouettes would shrink.
struct GapGain {
  double without = 0;        ///< the gap to the model as it is
  std::vector<double> by{};  ///< by effect: by how much it would shrink at the best strength, >= 0
};

/// What a recording says.
struct EffectEvidence {
  double distance = 0;                                    ///< to the model as it is, as NuisanceSpace has it
  std::vector<std::optional<StrengthProfile>> profile{};  ///< by effect; none where nothing is known of it
  GapGain overlap{}, blurred{};                           ///< see overlap_gap and blurred_gap
};

/// Settings of RecordedEvidence.
struct RecordedEvidenceSettings {
  SilhouetteFeatureSettings features{};
  ReadingFeatureSettings readings{};
  NuisanceSettings nuisance{};
  double lesson_held_back = 3;  ///< > 0: of lesson_of. References of pours by another solver, left out one at a time,
                                ///< are predicted as well with 1 to 10
};

/// A recording in which nothing is missing, and runs of a model of it: baselines and draws.
struct ReferenceRecording {
  Observation recording{};
  const EffectDictionary* dictionary = nullptr;  ///< has to outlive those that it is given to
};

/// Compares a recording with a dictionary of the same interaction.
class RecordedEvidence {
 public:
  /// @param dictionary has to outlive it. @param references of interactions that the model
  /// predicts alike(): what they are off from their predictions is taken off what was recorded, see NuisanceSpace.
  /// @param lessons of references of other interactions: so is what they make expected.
  /// Throws std::invalid_argument if fewer than five draws or no baseline worked, or if cameras, sensors or times are
  /// others.
  RecordedEvidence(Observation recording, const EffectDictionary& dictionary,
                   const RecordedEvidenceSettings& settings = {}, std::vector<ReferenceRecording> references = {},
                   const ReferenceLessons& lessons = {})
      : recording_(std::move(recording)),
        dictionary_(&dictionary),
        settings_(settings),
        references_(std::move(references)),
        lessons_(lessons.of_reference.size()),
        features_(recording_, working(dictionary), settings.features, settings.readings),
        over_time_(features_) {
    const std::vector<std::size_t> baselines = dictionary.of_role(RunRole::Baseline);
    draws_ = dictionary.of_role(RunRole::Draw);
    expects(!baselines.empty(), "RecordedEvidence: baselines that worked", "at least one", "none");
    expects(draws_.size() >= 5, "RecordedEvidence: draws that worked", "at least 5", draws_.size());
    expects(features_.size() > 0, "RecordedEvidence: liquid in the recording or in runs, or readings", "some", "none");
    for (std::size_t run = 0; run < dictionary.runs.size(); ++run) {
      if (dictionary.worked(run)) {
        of_run_[run] = features_.of(dictionary.seen[run]);
      }
    }
    const auto columns = [&](const std::vector<std::size_t>& runs) {
      Eigen::MatrixXd result(static_cast<Eigen::Index>(features_.size()), static_cast<Eigen::Index>(runs.size()));
      for (std::size_t k = 0; k < runs.size(); ++k) {
        result.col(static_cast<Eigen::Index>(k)) = of_run_.at(runs[k]);
      }
      return result;
    };
    sample_.baseline = columns(baselines);
    sample_.draws = columns(draws_);
    // Templates begin as the first baseline does, so that they differ from it by the error of measurement alone.
    if (baselines.front() == 0) {
      sample_.templates = columns(dictionary.of_role(RunRole::Template)).colwise() - of_run_.at(0);
    }
    sample_.references.resize(sample_.draws.rows(), static_cast<Eigen::Index>(references_.size() + lessons_));
    for (std::size_t k = 0; k < references_.size(); ++k) {
      sample_.references.col(static_cast<Eigen::Index>(k)) = residual(references_[k]);
    }
    if (lessons_ > 0) {
      const std::vector<EffectChange> changes = changes_by_effects();
      for (std::size_t k = 0; k < lessons_; ++k) {
        sample_.references.col(static_cast<Eigen::Index>(references_.size() + k)) =
            expected_residual(lessons.of_reference[k], changes, sample_.draws.rows());
      }
      sample_.reference_error = lessons.error;
    }
    sample_.floor = features_.floor(settings.nuisance.floor);
    space_ = std::make_unique<NuisanceSpace>(sample_, settings.nuisance);
    own_ = space_->as_modelled(features_.of(recording_));
    note_chance();
  }

  const ObservationFeatures& features() const noexcept { return features_; }
  const NuisanceSpace& space() const noexcept { return *space_; }
  std::size_t draws() const noexcept { return draws_.size(); }

  std::size_t references() const noexcept { return references_.size(); }
  std::size_t lessons() const noexcept { return lessons_; }

  /// If nothing is missing in it, how much there is of what references teach, 1 where it is just that.
  double as_taught() const {
    const Eigen::VectorXd expected_off = space_->standardised_difference(sample_.references.rowwise().mean());
    const double size = space_->distance(expected_off);
    const Eigen::VectorXd off = space_->standardised_difference(features_.of(recording_) - expected(*dictionary_));
    return size > 0 ? space_->inner(expected_off, off) / size : 0;
  }

  /// What it teaches about recordings of other interactions, if nothing is missing in it.
  ReferenceLesson lesson() const {
    return lesson_of(own_ - expected(*dictionary_), changes_by_effects(), *space_, settings_.lesson_held_back);
  }

  /// How far the recording is off what is expected, by feature, in standard deviations.
  Eigen::VectorXd standardised() const { return space_->standardised(own_); }
  /// What a model would have to predict for what was recorded.
  const Eigen::VectorXd& recorded_features() const noexcept { return own_; }
  const Eigen::VectorXd& draw_features(std::size_t draw) const { return of_run_.at(draws_.at(draw)); }

  /// How far the recording is off what a model predicts, by feature, over what draws are off there.
  Eigen::VectorXd beyond_chance(const Eigen::VectorXd& predicted) const {
    return space_->standardised_difference(own_ - predicted).cwiseQuotient(usual_);
  }
  /// See grown_gap: from the model as it is to one that predicts this.
  double gap_grown(const Eigen::VectorXd& predicted) const {
    return grown_gap(over_time_(beyond_chance(space_->center())), over_time_(beyond_chance(predicted)), gap_by_chance_);
  }

  /// The mean features of runs; nothing if one of them failed.
  std::optional<Eigen::VectorXd> mean_features(std::span<const Observation> runs) const {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(features_.size()));
    for (const Observation& run : runs) {
      if (run.empty()) {
        return std::nullopt;
      }
      sum += features_.of(run);
    }
    return sum / static_cast<double>(runs.size());
  }

  /// What an effect changes; nothing where nothing is known of it. This has to outlive it.
  std::optional<EffectCurve> curve(std::size_t effect) const {
    const std::vector<std::size_t> runs = telling_runs(effect);
    return runs.empty() ? std::nullopt : std::optional<EffectCurve>(curve(effect, runs, *space_, chaos()));
  }
  /// Mean distance of a single run of the model as it is from the mean of many; 0 with only one of them.
  double chaos() const { return chaos(*space_); }

  /// What the recording says.
  EffectEvidence of_recording() const { return evidence(recording_, own_, *space_); }

  /// How much a reference would look like this interaction, as the model has both: the distance between predictions
  /// where nothing is missing, about 1 for what is within tolerances. Infinite where cameras, sensors or times are
  /// others.
  double unlikeness(const ReferenceRecording& reference) const {
    const Observation& other = reference.recording;
    bool same = features_.fit(other);
    for (std::size_t camera = 0; same && camera < recording_.silhouettes.size(); ++camera) {
      const SilhouetteSeries& own = recording_.silhouettes[camera];
      same = at_same_times(own, other.silhouettes[camera], own.frames());
    }
    for (std::size_t sensor = 0; same && sensor < recording_.readings.size(); ++sensor) {
      const ReadingSeries& own = recording_.readings[sensor];
      same = at_same_times(own, other.readings[sensor], own.size());
    }
    return same ? space_->distance(space_->standardised(expected(*reference.dictionary)))
                : std::numeric_limits<double>::infinity();
  }

  /// What one of the references would say as the recording, if there were only the others.
  EffectEvidence of_reference(std::size_t reference) const {
    const auto k = static_cast<Eigen::Index>(reference);
    const NuisanceSpace rest(sample_.without_reference(k), settings_.nuisance);
    return evidence(references_.at(reference).recording, rest.as_modelled(rest.center() + sample_.references.col(k)),
                    rest);
  }

  /// What one of the draws would say as the recording, to a dictionary that does not have it.
  EffectEvidence of_draw(std::size_t draw) const {
    const std::size_t run = draws_.at(draw);
    const NuisanceSpace rest(sample_.without_draw(static_cast<Eigen::Index>(draw)), settings_.nuisance);
    return evidence(dictionary_->seen[run], of_run_.at(run), rest);
  }

 private:
  static std::vector<std::vector<SilhouetteSeries>> working(const EffectDictionary& dictionary) {
    std::vector<std::vector<SilhouetteSeries>> result;
    for (std::size_t run = 0; run < dictionary.runs.size(); ++run) {
      if (dictionary.worked(run)) {
        result.push_back(dictionary.seen[run].silhouettes);
      }
    }
    return result;
  }

  /// Counted from the first one, within half of what is between two.
  template <class Series>
  static bool at_same_times(const Series& own, const Series& other, std::size_t count) {
    bool same = true;
    for (std::size_t k = 1; same && k < count; ++k) {
      const double between = own.time(k) - own.time(k - 1);
      same = std::abs(other.time(k) - other.time(0) - (own.time(k) - own.time(0))) < 0.5 * between;
    }
    return same;
  }

  /// What a model predicts where nothing is missing, as NuisanceSpace::center has it.
  Eigen::VectorXd expected(const EffectDictionary& of) const {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(features_.size()));
    for (const RunRole role : {RunRole::Baseline, RunRole::Draw}) {
      const std::vector<std::size_t> runs = of.of_role(role);
      expects(!runs.empty(), "RecordedEvidence: baselines and draws of a reference that worked", "at least one",
              "none");
      for (const std::size_t run : runs) {
        sum += 0.5 / static_cast<double>(runs.size()) * features_.of(of.seen[run]);
      }
    }
    return sum;
  }

  std::vector<EffectChange> changes_by_effects() const {
    return effect_changes(
        *dictionary_, [this](std::size_t run) -> const Eigen::VectorXd& { return of_run_.at(run); },
        expected(*dictionary_));
  }

  /// Nothing is known of what the reference's cameras did not see.
  Eigen::VectorXd residual(const ReferenceRecording& reference) const {
    Eigen::VectorXd off = features_.of(reference.recording) - expected(*reference.dictionary);
    const std::vector<bool> seen = features_.seen_in(reference.recording);
    for (std::size_t k = 0; k < seen.size(); ++k) {
      if (!seen[k]) {
        off[static_cast<Eigen::Index>(k)] = 0;
      }
    }
    return off;
  }

  /// Numbers of the effect's runs, if they say something of each component.
  std::vector<std::size_t> telling_runs(std::size_t effect) const {
    const Effect& of = dictionary_->effects[effect];
    std::vector<std::size_t> runs =
        of.kind == EffectKind::Nuisance ? std::vector<std::size_t>() : dictionary_->of_effect(effect);
    for (std::size_t component = 0; component < of.components.size(); ++component) {
      if (std::none_of(runs.begin(), runs.end(), [&](std::size_t run) {
            return dictionary_->strength(run)[static_cast<Eigen::Index>(component)] != of.components[component].base;
          })) {
        return {};
      }
    }
    return runs;
  }

  /// What draws are off by, in the mean by feature, and the most of them by moment.
  void note_chance() {
    Eigen::VectorXd square = Eigen::VectorXd::Zero(space_->features());
    for (std::size_t draw = 0; draw < draws(); ++draw) {
      square += space_->standardised(draw_features(draw)).cwiseAbs2() / static_cast<double>(draws());
    }
    usual_ = square.array().sqrt() + 0.5;
    gap_by_chance_ = over_time_(Eigen::VectorXd::Zero(space_->features()));
    for (std::size_t draw = 0; draw < draws(); ++draw) {
      const Eigen::VectorXd off = space_->standardised(draw_features(draw)).cwiseQuotient(usual_);
      gap_by_chance_ = gap_by_chance_.cwiseMax(over_time_(off));
    }
  }

  EffectEvidence evidence(const Observation& seen, const Eigen::VectorXd& features, const NuisanceSpace& space) const {
    EffectEvidence result;
    const Eigen::VectorXd standardised = space.standardised(features);
    result.distance = space.distance(standardised);
    const auto overlap = [&](const Observation& other) { return overlap_gap(seen.silhouettes, other.silhouettes); };
    const auto blurred = [&](const Observation& other) { return blurred_gap(seen.silhouettes, other.silhouettes); };
    result.overlap.without = baseline_gap(overlap);
    result.blurred.without = baseline_gap(blurred);
    const double chaotic = chaos(space);
    for (std::size_t effect = 0; effect < dictionary_->effects.size(); ++effect) {
      const std::vector<std::size_t> runs = telling_runs(effect);
      result.profile.emplace_back();
      result.overlap.by.push_back(0);
      result.blurred.by.push_back(0);
      if (runs.empty()) {
        continue;
      }
      result.profile.back() = curve(effect, runs, space, chaotic).profile(standardised);
      result.overlap.by.back() = gain(effect, runs, result.overlap.without, overlap);
      result.blurred.by.back() = gain(effect, runs, result.blurred.without, blurred);
    }
    return result;
  }

  double chaos(const NuisanceSpace& space) const {
    const Eigen::MatrixXd off = sample_.baseline.colwise() - sample_.baseline.rowwise().mean();
    double sum = 0;
    for (Eigen::Index k = 0; k < off.cols(); ++k) {
      sum += space.distance(space.standardised_difference(off.col(k)));
    }
    return off.cols() > 1 ? sum / static_cast<double>(off.cols() - 1) : 0;
  }

  EffectCurve curve(std::size_t effect, const std::vector<std::size_t>& runs, const NuisanceSpace& space,
                    double chaotic) const {
    std::vector<Eigen::VectorXd> strengths;
    Eigen::MatrixXd differences(space.features(), static_cast<Eigen::Index>(runs.size()));
    for (std::size_t k = 0; k < runs.size(); ++k) {
      strengths.push_back(dictionary_->strength(runs[k]));
      differences.col(static_cast<Eigen::Index>(k)) = of_run_.at(runs[k]) - space.center();
    }
    return EffectCurve(space, dictionary_->effects[effect].base(), strengths, differences, chaotic);
  }

  template <class Gap>
  double baseline_gap(const Gap& gap) const {
    double sum = 0;
    const std::vector<std::size_t> runs = dictionary_->of_role(RunRole::Baseline);
    for (const std::size_t run : runs) {
      sum += gap(dictionary_->seen[run]);
    }
    return sum / static_cast<double>(runs.size());
  }

  /// The gap shrinks with the strength and its square.
  template <class Gap>
  double gain(std::size_t effect, const std::vector<std::size_t>& runs, double without, const Gap& gap) const {
    const Effect& of = dictionary_->effects[effect];
    double total = 0;
    for (std::size_t component = 0; component < of.components.size(); ++component) {
      const EffectComponent& with = of.components[component];
      std::vector<double> strength, shrunk;
      double low = with.base, high = with.base;
      for (const std::size_t run : runs) {
        const double s = dictionary_->strength(run)[static_cast<Eigen::Index>(component)];
        if (s != with.base) {
          strength.push_back(s);
          shrunk.push_back(without - gap(dictionary_->seen[run]));
          low = std::min(low, s);
          high = std::max(high, s);
        }
      }
      const StrengthLaw law{with.base, std::max(high - with.base, with.base - low), 1, true};
      const Eigen::Index terms = strength.size() > 1 ? 2 : 1;
      Eigen::MatrixXd at(static_cast<Eigen::Index>(strength.size()), terms);
      for (std::size_t k = 0; k < strength.size(); ++k) {
        const std::array<double, 2> both = law(strength[k]);
        for (Eigen::Index term = 0; term < terms; ++term) {
          at(static_cast<Eigen::Index>(k), term) = both[static_cast<std::size_t>(term)];
        }
      }
      const Eigen::VectorXd c =
          (at.transpose() * at)
              .ldlt()
              .solve(at.transpose() * Eigen::Map<const Eigen::VectorXd>(shrunk.data(), at.rows()));
      double best = 0;
      for (int step = 0; step <= 40; ++step) {
        const std::array<double, 2> both = law(low + step * (high - low) / 40);
        best = std::max(best, c[0] * both[0] + (terms > 1 ? c[1] * both[1] : 0));
      }
      total += best;
    }
    return total;
  }

  Observation recording_;
  const EffectDictionary* dictionary_;
  RecordedEvidenceSettings settings_;
  std::vector<ReferenceRecording> references_{};
  std::size_t lessons_;
  ObservationFeatures features_;
  std::vector<std::size_t> draws_{};
  Eigen::VectorXd own_{};  ///< features of the recording, see recorded_features
  std::map<std::size_t, Eigen::VectorXd> of_run_{};
  NuisanceSample sample_{};
  std::unique_ptr<NuisanceSpace> space_{};
  GapOverTime over_time_;
  Eigen::VectorXd usual_{};          ///< by feature: what draws are off by, see beyond_chance
  Eigen::VectorXd gap_by_chance_{};  ///< by moment: the largest of any draw
};

}  // namespace decant::inline DECANT_TARGET
