// SPDX-License-Identifier: MIT
// What a simulation lacks, on twins of pours in which something is hidden (record_effect), with the answers scored:
//   effect_experiment FOLDER --kinds nothing,moderate --json OUT.json --report OUT.html
// Recordings, runs of models and answers are kept in the folder: an experiment that was stopped goes on where it was.
// Exit status 0: done; 2: a recording, a file or an argument is wrong.

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "support/effect_experiment.hpp"
#include "support/effect_tables.hpp"
#include "support/experiment_command.hpp"
#include "support/experiment_output.hpp"
#include "support/tool.hpp"

int main(int count, char** values) {
  example::CaseRange range = example::CaseRange::Develop;
  std::vector<std::string> kinds{"nothing", "moderate", "weak", "outside", "measurement"};
  int first = 0, most = 1000;
  bool advise = false, answered = false;
  std::vector<std::size_t> scenarios;
  example::EffectExperimentOptions options;
  example::ExperimentCommand command(options.recording.longest, options.recording.spacing, options.model.model.spacing);
  CLI::App app("Finds what a simulation lacks in pours in which something is hidden, and scores the answers.");
  command.add_to(app, 1);
  app.add_option("--range", range, "develop: to choose a method by; report: to say how good it is")
      ->transform(CLI::CheckedTransformer(example::case_ranges()));
  app.add_option(
         "--kinds", kinds,
         "nothing, moderate, weak, two, outside, measurement, cylinder, cylinder_two, junction; several by commas")
      ->delimiter(',')
      ->check(CLI::IsMember(example::case_kinds()));
  app.add_option("--first", first, "number of the first case of each kind")->check(CLI::Range(0, 1000000));
  app.add_option("--cases", most, "of each kind, at most")->check(CLI::Range(1, 1000000));
  app.add_option("--scenarios", scenarios, "only cases of these, several by commas")->delimiter(',');
  app.add_option("--solver", options.recording.solver,
                 "of the reality of pours: divergence_free, as models have it, or position_based")
      ->transform(CLI::CheckedTransformer(example::reality_solvers()));
  app.add_option("--references", options.references,
                 "how many recordings of other pours are given in which nothing is missing; with kinds of pours")
      ->check(CLI::Range(0, 100));
  app.add_flag("--advise", advise,
               "where several effects are left, has another interaction recorded, one that is advised and one that is "
               "drawn by chance, and judges again");
  app.add_flag("--answered", answered, "only cases that have been answered before: tables of what is there");
  app.add_flag("--both", options.both, "learns from both pours of a case, and holds out none");
  app.add_option("--draws", options.search.dictionary.draws,
                 "runs with all that is tolerated drawn, to know what chance does")
      ->check(CLI::Range(5, 1000));
  return example::run_tool(app, count, values, [&] {
    options.folder = command.folder;
    options.threads = command.threads;
    options.again = command.again;
    options.recording.longest = command.seconds;
    options.recording.spacing = 1e-3 * command.reality_mm;
    options.model.model.spacing = 1e-3 * command.model_mm;
    example::expect_writable({command.json_file, command.report_file});
    std::vector<example::EffectCase> cases;
    for (const std::string& kind : kinds) {
      if (options.references > 0 && !example::is_of_pours(example::case_kinds().at(kind))) {
        throw std::runtime_error("--references: expected kinds of pours, not " + kind);
      }
      const example::CaseKind of = example::case_kinds().at(kind);
      const int end = std::min(first + most, example::usual_cases(range, of));
      for (int number = first; number < end; ++number) {
        cases.push_back(example::effect_case(range, of, number));
      }
    }
    std::erase_if(cases, [&](const example::EffectCase& each) {
      return !scenarios.empty() && std::find(scenarios.begin(), scenarios.end(), each.scenario) == scenarios.end();
    });
    // one scenario after the other: what is stopped has few dictionaries of runs begun
    std::stable_sort(cases.begin(), cases.end(), [](const auto& a, const auto& b) { return a.scenario < b.scenario; });
    example::EffectExperiment experiment(options);
    if (answered) {
      std::erase_if(cases, [&](const example::EffectCase& each) { return !experiment.is_answered(each); });
    }
    experiment.run(cases);
    if (advise) {
      experiment.follow_advice(cases);
    }
    std::vector<example::EffectScore> scores;
    for (const example::EffectCase& each : cases) {
      scores.push_back(
          {example::case_name(each), each.kind, each.scenario, &experiment.result(each), experiment.followed(each)});
    }
    return example::tell_experiment(
        {"What the model lacks", experiment.recordings(cases), 3, command.reality_mm,
         decant::detail::number_text(command.model_mm) + " mm in the model. What is hidden is not told to the search."},
        experiment.folder(), example::effect_tables(scores), command.json_file, command.report_file);
  });
}
