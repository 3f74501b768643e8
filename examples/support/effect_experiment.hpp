// SPDX-License-Identifier: MIT
#pragma once

/// Pours in which something is hidden, and what the workflow for missing effects says of them.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/core/stopwatch.hpp>
#include <decant/discovery/missing_effect.hpp>
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
  int threads = 0;     ///< how many recordings or runs are in work side by side; 0: one per core
  bool again = false;  ///< judges anew what is there already
};

/// "develop_moderate_007"
inline std::string case_name(const EffectCase& of) {
  std::string number = std::to_string(of.number);
  number.insert(0, number.size() < 3 ? 3 - number.size() : 0, '0');
  return of.range + "_" + of.kind + "_" + number;
}

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
      jobs.push_back(
          {key(each), settings_json(each), {recording_of(each, 0), recording_of(each, 1)}, [this, each](const auto&) {
             return judge(each);
           }});
    }
    folder_.run("finding effects", jobs, true);  // the runs for one are made side by side
  }

  /// Of a case that was run, as missing_effect_json has it, with the truth beside it; others are an std::out_of_range.
  const nlohmann::json& result(const EffectCase& of) const { return folder_.result(key(of)); }
  const ExperimentFolder& folder() const { return folder_; }

 private:
  std::string key(const EffectCase& of) const { return case_name(of) + (options_.both ? "_both" : ""); }
  static std::string recording_name(const EffectCase& of, std::size_t which) {
    return case_name(of) + (which == 0 ? "_a" : "_b");
  }

  ExperimentRecording recording_of(const EffectCase& of, std::size_t which) const {
    const EffectRecordingSettings settings = options_.recording;
    return {recording_name(of, which), of.seed, reality_spacing(of, settings), case_frames(of, which, settings),
            [of, which, settings](const auto& folder, const auto& progress) {
              record_case(of, which, folder, settings, progress);
            }};
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

  nlohmann::json judge(const EffectCase& of) {
    InteractionOptions options = model_of_case(of);
    std::vector<RecordedInteraction> kept;
    for (const std::size_t which : {0, 1}) {
      decant::Recording recording = decant::read_recording(folder_.recording(recording_name(of, which)));
      options.gain_of = uncertain_gains(recording);
      kept.push_back(recorded_interaction(std::move(recording), options));
    }
    std::vector<decant::Interaction<RecordedModel>> learn{kept[0].interaction("a")}, held_out;
    (options_.both ? learn : held_out).push_back(kept[1].interaction("b"));
    const std::string scenario = (is_of_cylinder(of)   ? "cylinder_"
                                  : is_of_junction(of) ? "junction_"
                                                       : "scenario_") +
                                 std::to_string(of.scenario);
    decant::Journal journal(options_.folder / "runs" / (scenario + ".journal"),
                            std::string("effect_experiment of decant ") + DECANT_VERSION + " at " +
                                decant::detail::number_text(1e3 * options.model.spacing) + " mm");
    std::size_t computed = 0;
    const decant::RunJobs run_jobs = [&](const std::vector<std::string>& keys,
                                         const std::function<decant::JobResult(std::size_t)>& work) {
      return decant::run_journaled(executor_, journal, keys, work,
                                   [&](std::size_t, const decant::JobResult&) { ++computed; });
    };
    double milliseconds = 0;
    decant::MissingEffect found;
    {
      const decant::Stopwatch watch(milliseconds);
      found = decant::MissingEffectSearch<RecordedModel>(std::move(learn), std::move(held_out), run_jobs,
                                                         search_settings(options_.search, options))
                  .find();
    }
    nlohmann::json json = missing_effect_json(found.judged, found, kept[0].recording.gravity);
    json["status"] = "ok";
    json["seconds"] = 1e-3 * milliseconds;
    json["runs_computed"] = computed;
    json["truth"] = folder_.truth(recording_name(of, 0));
    return json;
  }

  EffectExperimentOptions options_;
  ExperimentFolder folder_;
  decant::ThreadExecutor executor_;
};

}  // namespace example
