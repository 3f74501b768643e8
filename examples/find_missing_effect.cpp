// SPDX-License-Identifier: MIT
// What a simulation lacks, by recordings of what really happened:
//   find_missing_effect --learn DIR... --held-out DIR... --json OUT.json --report OUT.html
// Exit status 0: done; 2: a recording, a file or an argument is wrong.

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <variant>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <decant/core/stopwatch.hpp>
#include <decant/io/journal.hpp>
#include <decant/io/progress.hpp>
#include <decant/version.hpp>

#include "support/missing_effect_output.hpp"
#include "support/missing_effect_report.hpp"
#include "support/recorded_interaction.hpp"
#include "support/result_file.hpp"
#include "support/scene_interaction.hpp"
#include "support/sweep_executor.hpp"
#include "support/tool.hpp"

namespace {

using Interactions = std::vector<decant::Interaction<example::RecordedModel>>;

/// Throws std::runtime_error for what is no name with a number that is not negative.
std::map<std::string, double> numbers_by_name(const std::string& option, const std::vector<std::string>& texts,
                                              const std::string& example) {
  std::map<std::string, double> result;
  for (const std::string& each : texts) {
    const std::size_t sign = each.find('=');
    const std::string number = sign == std::string::npos ? "" : each.substr(sign + 1);
    double value = -1;
    const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), value);
    if (error != std::errc() || end != number.data() + number.size() || !(value >= 0) || !std::isfinite(value)) {
      throw std::runtime_error(option + ": expected a name and a number that is not negative, such as " + example +
                               ", not " + each);
    }
    result[each.substr(0, sign)] = value;
  }
  return result;
}

}  // namespace

int main(int count, char** values) {
  const example::SweepSession session;
  std::string json_file, report_file, journal_file;
  std::vector<std::string> learn_folders, held_out_folders, reference_folders, proposed_folders, tolerances,
      reading_errors, without;
  example::InteractionOptions options;
  decant::MissingEffectSettings settings;
  double usual_spacing_mm = 1e3 * options.model.spacing;
  std::optional<double> spacing_mm;
  const double usual_rate = options.frames_per_second;
  int threads = 0;
  CLI::App app("Finds which effect a simulation lacks, how strong it is, and whether other recordings agree.");
  app.add_option("--learn", learn_folders,
                 "folders of recordings that have it, format version 1; or of scenes: scene.json and measurements.csv")
      ->required();
  app.add_option("--held-out", held_out_folders, "folders of other recordings that have it, to check on");
  app.add_option(
      "--reference", reference_folders,
      "folders of recordings, of any pours, in which nothing is missing: how far reality is from the model; two or "
      "more that went like those to learn from tell best");
  app.add_option("--propose", proposed_folders,
                 "folders of interactions that may be recorded next, as recordings without pictures: where several "
                 "effects are left, says how well each would tell them apart");
  app.add_option("--journal", journal_file, "keeps the result of each run: a search that was stopped goes on");
  app.add_option("--json", json_file, "writes what was found");
  app.add_option("--report", report_file, "writes a page with a film, charts and tables, for a browser");
  app.add_option(
         "--tolerance", tolerances,
         "how far off the model may be and nothing is missing, such as latency=0.004 or body_pose=0.001, in the "
         "effect's unit; several by commas")
      ->delimiter(',');
  app.add_option("--without", without, "effects that are known not to be missing, such as gravity; several by commas")
      ->delimiter(',');
  app.add_option("--reading-error", reading_errors,
                 "standard deviations of what sensors read, a model of particles included, such as target_mass_g=2 or "
                 "level_mm=3, in the channel's unit; several by commas")
      ->delimiter(',');
  app.add_option("--spacing-mm", spacing_mm,
                 "of the model's particles: 5 unless given, for scenes what the first one to learn from says")
      ->check(CLI::Range(1.0, 1000.0));
  app.add_option("--frames-per-second", options.frames_per_second,
                 "of those that are compared; sensors are read in them")
      ->check(CLI::Range(1.0, 1000.0));
  app.add_option("--draws", settings.dictionary.draws,
                 "runs with all that is tolerated drawn, to know what chance does")
      ->check(CLI::Range(5, 1000));
  app.add_option("--threads", threads, "runs side by side, each on one thread; 0: one per core")
      ->check(CLI::Range(0, 1024));
  return example::run_tool(app, count, values, [&] {
    example::SweepExecutor executor = example::sweep_executor(threads);
    example::in_first_process(executor, [&] { example::expect_writable({json_file, report_file}); });
    example::expect_apart(learn_folders, held_out_folders, reference_folders);
    options.tolerances = numbers_by_name("--tolerance", tolerances, "latency=0.004");
    options.reading_errors = numbers_by_name("--reading-error", reading_errors, "target_mass_g=2");
    options.without.insert(without.begin(), without.end());
    std::map<std::string, example::InteractionSource> sources;
    for (const auto* folders : {&learn_folders, &held_out_folders, &reference_folders, &proposed_folders}) {
      for (const std::string& folder : *folders) {
        sources[folder] = example::read_interaction_source(folder);
        options.gain_of.merge(example::uncertain_gains(example::recording_of(sources[folder])));
      }
    }
    options.names = example::names_by_role(example::recording_of(sources[learn_folders.front()]));
    if (const auto* scene = std::get_if<example::MeasuredScene>(&sources[learn_folders.front()])) {
      usual_spacing_mm = 1e3 * scene->scene.spacing;
    }
    const double model_mm = spacing_mm.value_or(usual_spacing_mm);
    options.model.spacing = 1e-3 * model_mm;
    std::vector<std::unique_ptr<example::RecordedInteraction>> kept;
    const auto interactions_of = [&](const std::vector<std::string>& folders, bool planned = false) {
      Interactions interactions;
      options.planned = planned;
      for (const std::string& folder : folders) {
        kept.push_back(
            std::make_unique<example::RecordedInteraction>(example::interaction_of(sources.at(folder), options)));
        interactions.push_back(kept.back()->interaction(folder));
      }
      options.planned = false;
      return interactions;
    };
    Interactions learn = interactions_of(learn_folders);
    const std::vector<decant::Effect>& effects = kept.front()->model.effects();
    for (const decant::Effect& effect : effects) {
      options.elsewhere.insert(effect.name);
    }
    Interactions held_out = interactions_of(held_out_folders), references = interactions_of(reference_folders),
                 proposed = interactions_of(proposed_folders, true);
    for (const decant::Interaction<example::RecordedModel>& each : proposed) {
      example::expect_same_effects(effects, each.model->effects(), each.name);
    }
    const auto planned =
        static_cast<double>(decant::plan_dictionary(effects, settings.dictionary).size() * learn_folders.size());
    decant::Progress progress("finding", planned);
    double runs = 0, milliseconds = 0;
    const auto told = [&](std::size_t, const decant::JobResult&) {
      ++runs;
      progress.update(std::min(runs, planned), std::to_string(static_cast<long>(runs)) + " runs");
    };
    std::optional<decant::Journal> journal;
    if (!journal_file.empty()) {
      journal.emplace(executor, journal_file,
                      std::string("find_missing_effect of decant ") + DECANT_VERSION + " at " +
                          decant::detail::number_text(model_mm) + " mm" +
                          (options.frames_per_second == usual_rate
                               ? ""
                               : ", " + decant::detail::number_text(options.frames_per_second) + " frames a second"));
    }
    const decant::RunJobs run_jobs = [&](const std::vector<std::string>& keys,
                                         const std::function<decant::JobResult(std::size_t)>& work) {
      return journal ? decant::run_journaled(executor, *journal, keys, work, told)
                     : executor.run(keys.size(), work, told);
    };
    decant::MissingEffect result;
    {
      const decant::Stopwatch watch(milliseconds);
      settings = example::search_settings(settings, options);
      result = decant::MissingEffectSearch<example::RecordedModel>(std::move(learn), std::move(held_out), run_jobs,
                                                                   settings, std::move(references))
                   .find();
    }
    const std::vector<decant::PossibleEffect> possible = decant::possible_effects(result, effects);
    std::vector<decant::InteractionAdvice> advice;
    if (possible.size() > 1 && !proposed.empty()) {
      advice = decant::advise_next_interaction(possible, std::move(proposed), result.learn, run_jobs, settings);
    }
    progress.finish();
    std::vector<const example::RecordedInteraction*> interactions;
    std::vector<std::vector<std::string>> sensors;
    for (std::size_t k = 0; k < learn_folders.size() + held_out_folders.size(); ++k) {
      interactions.push_back(kept[k].get());
      sensors.push_back(kept[k]->sensors());
    }
    const bool read = std::any_of(sensors.begin(), sensors.end(), [](const auto& each) { return !each.empty(); });
    std::vector<example::ComparedModel> models;
    example::NamedPlaces places;
    example::in_first_process(executor, [&] {
      if (read || !report_file.empty()) {
        models = example::compared_models(interactions, result);
      }
      places = example::named_places(interactions, result);
    });
    std::printf("%s\n", example::missing_effect_sentence(result.judged, result).c_str());
    if (!result.surroundings.empty()) {
      std::printf("%s\n", example::surroundings_sentence(result.judged, result).c_str());
    }
    std::printf("%s\n%s%s%s", example::references_sentence(reference_folders.size(), result).c_str(),
                example::gap_table(result).text().c_str(),
                example::where_table(learn_folders, result, places).text().c_str(),
                example::candidates_table(result.judged, result).text().c_str());
    if (!proposed_folders.empty()) {
      std::printf("%s", possible.size() < 2 ? "Nothing is left for a further recording to tell apart.\n"
                                            : example::advice_table(proposed_folders, advice).text().c_str());
    }
    if (read) {
      std::printf("%s%s", example::where_read_table(learn_folders, sensors, result).text().c_str(),
                  example::readings_table(models, interactions).text().c_str());
    }
    if (result.verdict == decant::Verdict::Nothing) {
      std::printf("What would have been seen in about nine of ten such recordings:\n%s",
                  example::smallest_seen_table(result.judged, result).text().c_str());
    }
    example::in_first_process(executor, [&] {
      if (!json_file.empty()) {
        nlohmann::json json = example::missing_effect_json(result.judged, result, kept.front()->recording.gravity);
        json["seconds"] = 1e-3 * milliseconds;
        json["spacing_mm"] = model_mm;
        json["references"] = reference_folders.size();
        json["where"] = example::where_json(learn_folders, result, places);
        json["diffuse"] = example::is_diffuse(result);
        json["readings"] = example::readings_json(models, interactions);
        json["advice"] = example::advice_json(proposed_folders, advice);
        example::write_result(json_file, json);
      }
      if (!report_file.empty()) {
        example::write_missing_effect_report(report_file, interactions, learn_folders.size(), models, result,
                                             reference_folders.size(), places);
      }
    });
    return 0;
  });
}
