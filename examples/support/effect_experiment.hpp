// SPDX-License-Identifier: MIT
#pragma once

/// Pours in which something is hidden, and what the workflow for missing effects says of them.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/core/stopwatch.hpp>
#include <decant/discovery/missing_effect.hpp>
#include <decant/discovery/next_interaction.hpp>
#include <decant/hypothesis/thread_executor.hpp>
#include <decant/io/journal.hpp>
#include <decant/io/recording_reader.hpp>
#include <decant/version.hpp>

#include "effect_recording.hpp"
#include "experiment_folder.hpp"
#include "missing_effect_output.hpp"
#include "recorded_interaction.hpp"

namespace example {

struct EffectExperimentOptions {
  std::filesystem::path folder;  ///< of the recordings, with results/ and runs/ in it
  EffectRecordingSettings recording{};
  InteractionOptions model{};
  decant::MissingEffectSettings search{};
  bool both = false;   ///< learns from both pours of a case, and holds out none
  int references = 0;  ///< recordings in which nothing is missing, of other pours of the range; of pours alone
  int threads = 0;     ///< how many recordings or runs are in work side by side; 0: one per core
  bool again = false;  ///< judges anew what is there already
};

/// Makes both recordings of each case and judges them, or finds both in its folder. Runs of the model are kept by
/// scenario, as all cases of one share most of them.
class EffectExperiment {
 public:
  /// Throws std::runtime_error where the folder cannot be written to.
  explicit EffectExperiment(EffectExperimentOptions options)
      : options_(std::move(options)),
        folder_(options_.folder, options_.threads, options_.again),
        executor_({options_.threads}) {
    decant::detail::make_folder(options_.folder / "runs");
  }

  /// Judges what is not judged yet; see ExperimentFolder::run.
  void run(const std::vector<EffectCase>& cases) {
    std::vector<ExperimentJob> jobs;
    for (const EffectCase& each : cases) {
      jobs.push_back(job(each));
    }
    folder_.run("finding effects", jobs, true);  // the runs for one are made side by side
  }

  /// Whether run() finds its result there.
  bool is_answered(const EffectCase& of) { return folder_.is_computed(job(of)); }

  /// Of a case that was run, as missing_effect_json has it, with the truth beside it; others are an std::out_of_range.
  const nlohmann::json& result(const EffectCase& of) const { return folder_.result(key(of)); }

  /// For cases that leave several effects: asks which of the further interactions would tell them apart, and learns
  /// again from that one as well, and from one that is drawn by chance. These take simulations of all effects anew,
  /// which all cases of the scenario that ask for the same one share.
  void follow_advice(const std::vector<EffectCase>& cases) {
    std::vector<ExperimentJob> jobs;
    for (const EffectCase& each : cases) {
      if (result(each).at("verdict") == "one_of") {
        jobs.push_back({advised_key(each), settings_json(each), recordings_of(each, {0, 1, 2, 3, 4, 5}),
                        [this, each](const auto&) { return judge_with_further(each); }});
      }
    }
    folder_.run("following advice", jobs, true);
  }

  /// What came of advice, or null where none was asked for: `left` before it; of each of `after_advised` and
  /// `after_drawn` which interaction it was, and the answer as result() has it.
  const nlohmann::json* followed(const EffectCase& of) const {
    const auto found = folder_.results().find(advised_key(of));
    return found == folder_.results().end() ? nullptr : &found->second;
  }

  /// How many recordings cases take, those of which others were asked for included.
  std::size_t recordings(const std::vector<EffectCase>& cases) const {
    std::set<std::string> names;
    for (const EffectCase& each : cases) {
      for (std::size_t which = 0; which < (followed(each) == nullptr ? 2 : 2 + further_interactions); ++which) {
        names.insert(recording_name(each, which));
      }
      for (int k = 0; k < options_.references; ++k) {
        names.insert(reference(each, k).name);
      }
    }
    return names.size();
  }

  const ExperimentFolder& folder() const { return folder_; }

 private:
  using Kept = std::vector<std::unique_ptr<RecordedInteraction>>;
  using Interactions = std::vector<decant::Interaction<RecordedModel>>;

  /// Runs of a scenario's model.
  struct ScenarioRuns {
    decant::Journal journal;
    std::size_t computed = 0;  ///< the others were there
  };

  ExperimentJob job(const EffectCase& of) {
    ExperimentJob job{key(of), settings_json(of), recordings_of(of, {0, 1}),
                      [this, of](const auto&) { return judge(of); }};
    for (int k = 0; k < options_.references; ++k) {
      job.recordings.push_back(reference(of, k));
    }
    return job;
  }

  std::string solver() const {
    return options_.recording.solver == RealitySolver::DivergenceFree ? "" : "_position_based";
  }
  std::string key(const EffectCase& of) const {
    return case_name(of) + solver() +
           (options_.references > 0 ? "_" + std::to_string(options_.references) + "_references" : "") +
           (options_.both ? "_both" : "");
  }
  std::string advised_key(const EffectCase& of) const { return key(of) + "_advised"; }
  std::string recording_name(const EffectCase& of, std::size_t which) const {
    return case_name(of) + solver() + "_" + interaction_letter(which);
  }

  ExperimentRecording recording(const EffectCase& of, std::size_t which, std::string name) const {
    const EffectRecordingSettings settings = options_.recording;
    return {std::move(name), of.seed, reality_spacing(of, settings), case_frames(of, which, settings),
            [of, which, settings](const auto& folder, const auto& progress) {
              record_case(of, which, folder, settings, progress);
            }};
  }

  std::vector<ExperimentRecording> recordings_of(const EffectCase& of, const std::vector<std::size_t>& which) const {
    std::vector<ExperimentRecording> recordings;
    for (const std::size_t each : which) {
      recordings.push_back(recording(of, each, recording_name(of, each)));
    }
    return recordings;
  }

  /// Of the range's other scenarios in turn, and of their first pours before their second ones.
  ExperimentRecording reference(const EffectCase& of, int number) const {
    const std::vector<std::size_t> scenarios = scenarios_of(case_ranges().at(of.range), CaseKind::Nothing);
    const auto own =
        static_cast<std::size_t>(std::find(scenarios.begin(), scenarios.end(), of.scenario) - scenarios.begin());
    const std::size_t others = scenarios.size() - 1, k = static_cast<std::size_t>(number);
    const std::size_t scenario = scenarios[(own + 1 + k % others) % scenarios.size()], which = k / others % 2;
    const std::size_t seed = 1 + k / (2 * others);
    return recording(reference_case(scenario, static_cast<std::uint32_t>(seed)), which,
                     "reference_" + std::to_string(scenario) + "_" + std::to_string(seed) + solver() + "_" +
                         interaction_letter(which));
  }

  /// Of a case's model. A cylinder holds three times what is poured, and is read more often: particles are as coarse as
  /// may be, with six of them across its radius heights are right to 2 mm, with five only to 5 mm. A junction takes
  /// twice as much as a pour, and three particles across a leg will do.
  InteractionOptions model_of_case(const EffectCase& of) const {
    InteractionOptions options = options_.model;
    if (is_of_cylinder(of)) {
      options.model.spacing *= 1.6;
      options.frames_per_second = cylinder_frames_per_second;
      options.reading_errors["height_mm"] = 1.5;  // of a sensor that errs by less, and of coarse particles
    }
    if (is_of_junction(of)) {
      options.model.spacing *= 1.4;
    }
    return options;
  }

  // What a result depends on, beside the program.
  nlohmann::json settings_json(const EffectCase& of) const {
    return {{"case", case_name(of)},
            {"both", options_.both},
            {"model_spacing_mm", 1e3 * model_of_case(of).model.spacing},
            {"reality_spacing_mm", 1e3 * reality_spacing(of, options_.recording)},
            {"draws", options_.search.dictionary.draws},
            {"longest_s", number_json(options_.recording.longest)}};
  }

  std::unique_ptr<RecordedInteraction> interaction(const EffectCase& of, const std::string& name) const {
    InteractionOptions options = model_of_case(of);
    decant::Recording recording = decant::read_recording(folder_.recording(name));
    options.gain_of = uncertain_gains(recording);
    options.names = names_by_role(decant::read_recording(folder_.recording(recording_name(of, 0))));
    return std::make_unique<RecordedInteraction>(recorded_interaction(std::move(recording), options));
  }

  ScenarioRuns runs_of(const EffectCase& of) const {
    const std::string scenario = (is_of_cylinder(of)   ? "cylinder_"
                                  : is_of_junction(of) ? "junction_"
                                                       : "scenario_") +
                                 std::to_string(of.scenario);
    return {decant::Journal(options_.folder / "runs" / (scenario + ".journal"),
                            std::string("effect_experiment of decant ") + DECANT_VERSION + " at " +
                                decant::detail::number_text(1e3 * model_of_case(of).model.spacing) + " mm")};
  }

  /// For as long as `runs` is there.
  decant::RunJobs jobs_of(ScenarioRuns& runs) {
    return [&](const std::vector<std::string>& keys, const std::function<decant::JobResult(std::size_t)>& work) {
      return decant::run_journaled(executor_, runs.journal, keys, work,
                                   [&](std::size_t, const decant::JobResult&) { ++runs.computed; });
    };
  }

  decant::MissingEffectSettings search_of(const EffectCase& of) const {
    return search_settings(options_.search, model_of_case(of));
  }

  decant::MissingEffect search(const EffectCase& of, Interactions learn, Interactions held_out, ScenarioRuns& runs,
                               Interactions references = {}) {
    return decant::MissingEffectSearch<RecordedModel>(std::move(learn), std::move(held_out), jobs_of(runs),
                                                      search_of(of), std::move(references))
        .find();
  }

  nlohmann::json judge(const EffectCase& of) {
    Kept kept;
    Interactions learn, held_out, references;
    for (const std::size_t which : {std::size_t{0}, std::size_t{1}}) {
      kept.push_back(interaction(of, recording_name(of, which)));
      (which == 0 || options_.both ? learn : held_out).push_back(kept.back()->interaction(interaction_letter(which)));
    }
    for (int k = 0; k < options_.references; ++k) {
      const std::string name = reference(of, k).name;
      kept.push_back(interaction(of, name));
      references.push_back(kept.back()->interaction(name));
    }
    ScenarioRuns runs = runs_of(of);
    double milliseconds = 0;
    decant::MissingEffect found;
    {
      const decant::Stopwatch watch(milliseconds);
      found = search(of, std::move(learn), std::move(held_out), runs, std::move(references));
    }
    nlohmann::json json = missing_effect_json(found.judged, found, kept[0]->recording.gravity);
    json["status"] = "ok";
    json["seconds"] = 1e-3 * milliseconds;
    json["runs_computed"] = runs.computed;
    json["truth"] = folder_.truth(recording_name(of, 0));
    return json;
  }

  nlohmann::json judge_with_further(const EffectCase& of) {
    Kept kept;
    Interactions seen;
    for (std::size_t which = 0; which < 2 + further_interactions; ++which) {
      kept.push_back(interaction(of, recording_name(of, which)));
      seen.push_back(kept.back()->interaction(interaction_letter(which)));
    }
    Interactions proposed(seen.begin() + 2, seen.end());  // advice looks at which frames and sensors there are, no more
    ScenarioRuns runs = runs_of(of);
    const decant::MissingEffect found = search(of, {seen[0]}, {seen[1]}, runs);
    const std::vector<decant::PossibleEffect> possible = decant::possible_effects(found, kept.front()->model.effects());
    nlohmann::json json{{"status", "ok"}, {"left", nlohmann::json::array()}};
    for (const decant::PossibleEffect& each : possible) {
      json["left"].push_back(kept.front()->model.effects().at(each.effect.effect).name);
    }
    if (possible.size() < 2) {
      return json;
    }
    const std::vector<decant::InteractionAdvice> advice =
        decant::advise_next_interaction(possible, std::move(proposed), found.learn, jobs_of(runs), search_of(of));
    const std::size_t by_chance = detail::mixed_seed({of.seed, 31U}) % further_interactions;
    for (const auto& [key, which] : {std::pair{"after_advised", advice.front().which}, {"after_drawn", by_chance}}) {
      const decant::MissingEffect after = search(of, {seen[0], seen[2 + which]}, {seen[1]}, runs);
      nlohmann::json& told = json[key] = missing_effect_json(after.judged, after, kept[0]->recording.gravity);
      told["interaction"] = interaction_letter(2 + which);
      told["truth"] = folder_.truth(recording_name(of, 0));
      const auto asked = std::find_if(advice.begin(), advice.end(),
                                      [&, asked_of = which](const auto& each) { return each.which == asked_of; });
      told["gain_bit"] = number_json(asked->gain);
      told["settles"] = number_json(asked->settles);
    }
    return json;
  }

  EffectExperimentOptions options_;
  ExperimentFolder folder_;
  decant::ThreadExecutor executor_;
};

}  // namespace example
