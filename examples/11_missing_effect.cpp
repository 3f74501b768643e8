// SPDX-License-Identifier: MIT
// A simulation does not go as two recorded pours do. Where do they differ, which effect does the model lack, how strong
// is it, does the other pour agree, and how well does the model predict that one when it has it?

#include <cstddef>
#include <cstdio>
#include <filesystem>

#include <decant/discovery/missing_effect.hpp>
#include <decant/discovery/silhouette_gap.hpp>
#include <decant/hypothesis/thread_executor.hpp>
#include <decant/io/progress.hpp>
#include <decant/io/recording_reader.hpp>

#include "support/missing_effect_output.hpp"
#include "support/recorded_interaction.hpp"

using namespace decant;
using example::RecordedModel;

int main(int count, char** values) {
  const std::filesystem::path folder = count > 1 ? values[1] : DECANT_EXAMPLE_DATA "/pour_hidden_effect";
  // the model: a liquid without the effects of the catalogue, among the recorded bodies; coarse, so it is soon done
  example::InteractionOptions options;
  options.model.spacing = 0.008;
  const auto pour = example::recorded_interaction(read_recording(folder / "a"), options);
  const auto other = example::recorded_interaction(read_recording(folder / "b"), options);
  MissingEffectSettings settings;
  settings.dictionary.draws = 16;  // more of them know better what is chance
  settings.most_effects = 1;

  ThreadExecutor executor;
  Progress progress("simulating", 200);
  double runs = 0;
  const auto told = [&](std::size_t, const JobResult&) { progress.update(++runs); };
  MissingEffectSearch<RecordedModel> search({pour.interaction("a")}, {other.interaction("b")},
                                            run_jobs_on(executor, told), settings);
  const MissingEffect result = search.find();
  progress.finish();

  for (const Disagreement& each : result.where.front()) {
    std::printf("from %.2f s on, at u %.0f, v %.0f px: %s\n", each.begin, each.onset_u, each.onset_v,
                each.unexpected ? "liquid where none is expected" : "no liquid where some is expected");
  }
  std::printf("%s\n", example::missing_effect_sentence(result.judged, result).c_str());
  if (result.verdict != Verdict::Named) {
    return 1;
  }
  const RefinedEffect& found = result.found.front();
  const Effect& effect = result.judged[found.judged];
  const auto [low, high] = found.interval_90(0);
  std::printf("That is: %s; 90 %% within %.2g .. %.2g %s.\n", effect.meaning.c_str(), low, high, effect.unit.c_str());
  std::printf("In the model: %s\n", example::detail::effect_code(result.judged, found).c_str());
  std::printf("The other pour %s.\n", result.confirmation == Confirmation::Confirmed ? "agrees" : "does not agree");

  // the mended model; a Tracker takes it from here as well
  const ModelRun mended{result.mended(), 1};
  const double before = overlap_gap(other.seen.silhouettes, other.model.predict({{}, 1}).silhouettes);
  const double after = overlap_gap(other.seen.silhouettes, other.model.predict(mended).silhouettes);
  const example::EffectModel simulator = other.model.started(mended);
  std::printf("Its silhouettes overlap by %.0f %% without, and %.0f %% with it (%d particles).\n", 100 * (1 - before),
              100 * (1 - after), static_cast<int>(simulator.fluid().size()));
  return effect.name == "wall_adhesion" && result.confirmation == Confirmation::Confirmed && after < before ? 0 : 1;
}
