// SPDX-License-Identifier: MIT
// Tracks the liquid of a recording and scores how well:
//   track RECORDING_DIR --corrector open_loop,default --json OUT.json --report OUT.html
// Exit status 0: done; 1: a method failed on the way; 2: the recording, a file or an argument is wrong.

#include <cstdio>
#include <exception>
#include <filesystem>
#include <functional>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <decant/io/progress.hpp>
#include <decant/io/recording_reader.hpp>
#include <decant/io/table.hpp>

#include "support/result_file.hpp"
#include "support/tracking_methods.hpp"
#include "support/tracking_report.hpp"
#include "support/tracking_run.hpp"

int main(int count, char** values) {
  std::string folder, json_file, report_file;
  std::vector<std::string> names{"open_loop", "default"};
  example::TrackingOptions options;
  options.forecasts = {0.25, 0.5, 1};
  double spacing_mm = 1e3 * options.spacing;
  bool without_forecasts = false;
  CLI::App app("Keeps a simulation in step with the masks of a recording, by one or more methods.");
  app.add_option("recording", folder, "folder of a recording, format version 1")->required();
  app.add_option(
         "--corrector", names,
         "open_loop, map_filter, warp_field (both as printed), map_filter_mended, transport, default; default_adapting "
         "(of several parameters) and default_amounts (of the initial amount) take several simulations; several by "
         "commas")
      ->delimiter(',')
      ->check(CLI::IsMember(example::tracking_method_names()));
  app.add_option("--json", json_file, "writes the scores");
  app.add_option("--report", report_file, "writes a page with charts and silhouettes, for a browser");
  app.add_option("--spacing-mm", spacing_mm, "of the model's particles")->check(CLI::Range(1.0, 20.0));
  app.add_option("--threads", options.threads, "0: all")->check(CLI::Range(0, 1024));
  app.add_flag("--no-forecasts", without_forecasts, "leaves out the scores ahead, which double the time");
  try {
    app.parse(count, values);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  options.spacing = 1e-3 * spacing_mm;
  options.keep_overlays = !report_file.empty();
  if (without_forecasts) {
    options.forecasts.clear();
  }
  nlohmann::json json;
  std::vector<example::NamedResult> results;
  bool failed = false;
  try {
    if (!json_file.empty()) {
      example::expect_writable(json_file);
    }
    if (!report_file.empty()) {
      example::expect_writable(report_file);
    }
    const decant::Recording recording = decant::read_recording(folder);
    const example::TrackingModel model = example::model_of<example::TrackingParts>(recording, options);
    std::printf("%s: %zu frames, %td particles of %.1f mm\n%-17s %6s %6s %6s %6s %8s\n", recording.name.c_str(),
                recording.frames, model.fluid().size(), spacing_mm, "", "IoU", "pooled", "prior", "+0.5 s", "frames/s");
    for (const std::string& name : names) {
      decant::Progress progress(name, static_cast<double>(recording.frames));
      example::TrackingResult result = example::tracking_method(name)(
          recording, model, options, {}, [&](std::size_t done) { progress.update(static_cast<double>(done)); });
      progress.finish();
      json["correctors"][name] = example::tracking_json(result, recording, options.forecasts);
      failed = failed || result.status != "ok";
      const double seconds =
          1e-3 * (result.physics_ms + result.drawing_ms + result.correction_ms + result.relaxation_ms);
      const double ahead = result.forecasts.size() > 1 ? result.forecasts[1].mean_over_frames() : std::nan("");
      std::printf("%-17s %6.3f %6.3f %6.3f %6s %8.1f  %s\n", name.c_str(), result.posterior.mean_over_frames(),
                  result.posterior.pooled_over_pixels(), result.prior.mean_over_frames(),
                  example::detail::figure(ahead, 3).c_str(), static_cast<double>(result.frames) / seconds,
                  result.status == "ok" ? "" : result.status.c_str());
      for (const auto& [parameter, value] : result.parameters) {
        std::printf("  %s %.3g", parameter.c_str(), value);
      }
      if (result.initial_ml) {
        std::printf("  at first %.0f ml (90 %%: %.0f .. %.0f ml)%s", result.initial_ml->mean, result.initial_ml->low,
                    result.initial_ml->high, result.initial_ml->at_end ? ", or beyond what was asked about" : "");
      }
      if (!result.parameters.empty() || result.initial_ml) {
        std::putchar('\n');
      }
      std::fflush(stdout);
      results.push_back({name, std::move(result)});
    }
    if (!json_file.empty()) {
      decant::detail::write_text_file(json_file, json.dump(1));
    }
    if (!report_file.empty()) {
      example::write_tracking_report(report_file, recording, options, results);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
  return failed ? 1 : 0;
}
