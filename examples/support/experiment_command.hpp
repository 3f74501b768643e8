// SPDX-License-Identifier: MIT
#pragma once

/// What the command lines of experiments have in common.

#include <string>

#include <CLI/CLI.hpp>

namespace example {

/// What all experiments that keep their work in a folder are asked for, with lengths in millimetres.
struct ExperimentCommand {
  std::string folder{}, json_file{}, report_file{};
  int threads = 0;
  bool again = false;
  double seconds;               ///< of each recording
  double reality_mm, model_mm;  ///< spacing of particles

  /// @param options an experiment's own, for what is there unless it is asked for otherwise.
  template <class Options>
  explicit ExperimentCommand(const Options& options)
      : ExperimentCommand(options.duration, options.reality_spacing, options.model_spacing) {}
  /// @param duration of each recording [s]. @param reality_spacing, model_spacing of particles [m]
  ExperimentCommand(double duration, double reality_spacing, double model_spacing)
      : seconds(duration), reality_mm(1e3 * reality_spacing), model_mm(1e3 * model_spacing) {}

  /// @param least_model_mm 0 where that stands for a spacing that follows from what is recorded.
  void add_to(CLI::App& app, double least_model_mm) {
    app.add_option("folder", folder, "where recordings, runs of models and results are kept")->required();
    app.add_option("--threads", threads, "recordings or runs side by side, each on one thread; 0: one per core")
        ->check(CLI::Range(0, 1024));
    app.add_option("--json", json_file, "writes results and tables");
    app.add_option("--report", report_file, "writes a page with tables and charts, for a browser");
    app.add_flag("--again", again, "computes results that are there already anew; recordings and runs are kept");
    app.add_option("--model-spacing-mm", model_mm,
                   least_model_mm > 0 ? "of the model's particles"
                                      : "of the model's particles; 0: as many as estimates take by themselves")
        ->check(CLI::Range(least_model_mm, 20.0));
    // smaller recordings, for tests; group "" is not in the help
    app.add_option("--seconds", seconds)->check(CLI::Range(0.1, 60.0))->group("");
    app.add_option("--spacing-mm", reality_mm)->check(CLI::Range(1.0, 20.0))->group("");
  }

  /// What was asked for, as options of an experiment.
  template <class Options>
  void give_to(Options& options) const {
    options.folder = folder;
    options.threads = threads;
    options.again = again;
    options.duration = seconds;
    options.reality_spacing = 1e-3 * reality_mm;
    options.model_spacing = 1e-3 * model_mm;
  }
};

}  // namespace example
