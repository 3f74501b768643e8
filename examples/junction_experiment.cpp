// SPDX-License-Identifier: MIT
// What blocks a pipe junction: the third experiment of Schenck and Fox (2017) on twins of their junction:
//   junction_experiment FOLDER --json OUT.json --report OUT.html
// Recordings and results are kept in the folder: a run that was stopped goes on where it was, another only prints.
// Exit status 0: done; 1: a recording could not be followed to its end; 2: a recording, a file or an argument is wrong.

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "support/experiment_command.hpp"
#include "support/experiment_output.hpp"
#include "support/junction_experiment.hpp"
#include "support/junction_tables.hpp"
#include "support/tool.hpp"

namespace {

/// Those of the names; all if there are no names. @return how many of the names were there.
std::size_t keep(std::vector<example::JunctionCase>& cases, const std::vector<std::string>& names) {
  const std::size_t before = cases.size();
  std::erase_if(cases, [&](const auto& each) {
    return !names.empty() && std::find(names.begin(), names.end(), each.name) == names.end();
  });
  return names.empty() ? before : cases.size();
}

}  // namespace

int main(int count, char** values) {
  std::string set = "all";
  std::vector<std::string> only, methods{example::default_method};
  example::JunctionExperimentOptions options;
  example::ExperimentCommand command(options);
  bool keep_all = false;
  CLI::App app("Finds what blocks pipe junctions by what runs out of them, and scores the answers.");
  command.add_to(app, 0);
  app.add_option("--set", set,
                 "configurations: the paper's five, four trials each, by each method; openings: one leg 10 to 90 % "
                 "open; others: what is none of the five; all: these three")
      ->check(CLI::IsMember({"configurations", "openings", "others", "all"}));
  app.add_option("--methods", methods, "for the configurations, several by commas")
      ->delimiter(',')
      ->check(CLI::IsMember(example::weighing_methods()));
  app.add_option("--only", only, "recordings of the set, such as pipe_left_1, several by commas")->delimiter(',');
  app.add_flag("--keep-all", keep_all,
               "gives up no hypothesis, to see what giving up saves and whether it changes answers");
  return example::run_tool(app, count, values, [&] {
    command.give_to(options);
    options.least_probability = keep_all ? 0 : options.least_probability;
    example::expect_writable({command.json_file, command.report_file});
    const auto chosen = [&](const char* name, std::vector<example::JunctionCase> cases) {
      return set == "all" || set == name ? cases : std::vector<example::JunctionCase>();
    };
    auto configurations = chosen("configurations", example::junction_configurations());
    auto openings = chosen("openings", example::junction_openings());
    auto others = chosen("others", example::junction_others());
    const std::size_t recordings = keep(configurations, only) + keep(openings, only) + keep(others, only);
    if (!only.empty() && recordings != only.size()) {
      throw std::runtime_error("--only: the experiment has " + std::to_string(recordings) + " of the " +
                               std::to_string(only.size()) + " recordings that are named");
    }
    if (std::find(methods.begin(), methods.end(), example::default_method) == methods.end()) {
      methods.push_back(example::default_method);
    }
    example::JunctionExperiment experiment(options);
    for (const auto* cases : {&configurations, &openings, &others}) {
      experiment.run(*cases, cases == &configurations ? methods : std::vector<std::string>{example::default_method});
    }
    return example::tell_experiment(
        {"What blocks the junction", recordings, options.duration, command.reality_mm,
         "five of them across a leg in the model. What blocks a leg is hidden from the answers."},
        experiment.folder(), example::junction_tables(experiment, configurations, openings, others, methods),
        command.json_file, command.report_file);
  });
}
