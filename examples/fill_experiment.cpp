// SPDX-License-Identifier: MIT
// How much was in it: the second experiment of Schenck and Fox (2017) on twins of their pours:
//   fill_experiment FOLDER --json OUT.json --report OUT.html
// Recordings and results are kept in the folder: a run that was stopped goes on where it was, another only prints.
// Exit status 0: done; 1: a recording could not be followed to its end; 2: a recording, a file or an argument is wrong.

#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "support/experiment_command.hpp"
#include "support/experiment_output.hpp"
#include "support/fill_experiment.hpp"
#include "support/fill_tables.hpp"
#include "support/tool.hpp"

namespace {

/// Throws std::runtime_error where `only` names a recording that there is none of.
void keep(const std::vector<std::string>& only, std::vector<example::Pour>& levels,
          std::vector<example::Pour>& amounts) {
  for (const std::string& name : only) {
    if (!example::has_pour(levels, name) && !example::has_pour(amounts, name)) {
      throw std::runtime_error("--only: the experiment has no recording " + name);
    }
  }
  example::keep_pours(levels, only);
  example::keep_pours(amounts, only);
}

}  // namespace

int main(int count, char** values) {
  std::string set = "all";
  std::vector<std::string> only;
  example::FillExperimentOptions options;
  example::ExperimentCommand command(options);
  CLI::App app("Estimates how much was in containers that are poured from, and scores the estimates.");
  command.add_to(app, 0);
  app.add_option("--set", set,
                 "levels: the paper's pours, empty to 90 % full, by each method; amounts: any amounts, by the default "
                 "method; all: both")
      ->check(CLI::IsMember({"levels", "amounts", "all"}));
  app.add_option("--only", only, "recordings of the set, such as cup_30_1, several by commas")->delimiter(',');
  // a coarser grid, for tests; group "" is not in the help
  app.add_option("--grid-step", options.grid_step)->check(CLI::Range(2, 50))->group("");
  return example::run_tool(app, count, values, [&] {
    command.give_to(options);
    example::expect_writable({command.json_file, command.report_file});
    const std::vector<std::string> methods = example::FillOptions{}.methods;
    auto levels = set == "amounts" ? std::vector<example::Pour>() : example::level_pours();
    auto amounts = set == "levels" ? std::vector<example::Pour>() : example::amount_pours();
    keep(only, levels, amounts);
    example::FillExperiment experiment(options);
    experiment.run(levels, methods);
    experiment.run(amounts, {});
    return example::tell_experiment(
        {"How much was in it", levels.size() + amounts.size(), options.duration, command.reality_mm,
         "6000 of them in a full container of the model. The amount is hidden from the "
         "estimates."},
        experiment.folder(), example::fill_tables(experiment, levels, amounts, methods), command.json_file,
        command.report_file);
  });
}
