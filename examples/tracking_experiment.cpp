// SPDX-License-Identifier: MIT
// The tracking experiment of Schenck and Fox (2017) on twins of their pours:
//   tracking_experiment FOLDER --set pours --json OUT.json --report OUT.html
// Recordings and results are kept in the folder: a run that was stopped goes on where it was, another only prints.
// Exit status 0: done; 1: a method failed on the way; 2: a recording, a file or an argument is wrong.

#include <algorithm>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "support/experiment_command.hpp"
#include "support/experiment_tables.hpp"
#include "support/result_file.hpp"
#include "support/tool.hpp"
#include "support/tracking_experiment.hpp"
#include "support/tracking_methods.hpp"

namespace {

struct Plan {
  std::vector<example::Pour> pours;
  std::vector<std::string> methods;
  std::vector<const example::Condition*> conditions;  // of a sweep
};

std::vector<std::string> condition_names() {
  std::vector<std::string> names;
  for (const example::Condition& condition : example::sweep_conditions()) {
    names.push_back(condition.name);
  }
  return names;
}

std::vector<example::Pour> pours_of(const std::string& set) {
  if (set == "harmless") {
    return example::harmless_pours();
  }
  if (set == "wrong_amount") {
    return example::pours_named({"cup_60_3", "cup_60_4", "bottle_60_9", "bottle_60_10"});
  }
  if (set == "sweep") {
    return example::pours_named({"cup_30_1", "cup_60_3", "cup_90_5", "bottle_60_9"});
  }
  return example::paper_pours();
}

/// Throws std::runtime_error where `only` names a recording that the set does not have.
Plan plan_of(const std::string& set, std::vector<std::string> methods, const std::vector<std::string>& only,
             const std::vector<std::string>& conditions) {
  Plan plan;
  plan.pours = pours_of(set);
  for (const std::string& name : only) {
    if (!example::has_pour(plan.pours, name)) {
      throw std::runtime_error("--only: set " + set + " has no recording " + name);
    }
  }
  example::keep_pours(plan.pours, only);
  if (methods.empty()) {
    methods = {"open_loop", "default"};
    if (set == "pours") {
      methods = example::tracking_method_names();
      std::erase(methods, "default_amounts");  // the paper's pours are told the amount
    } else if (set == "wrong_amount") {
      methods.push_back("default_amounts");
    }
  }
  if (set == "harmless" || set == "sweep") {
    methods.insert(methods.begin(), "open_loop");  // which the others are compared with
  }
  for (std::string& method : methods) {
    if (std::find(plan.methods.begin(), plan.methods.end(), method) == plan.methods.end()) {
      plan.methods.push_back(std::move(method));
    }
  }
  for (const example::Condition& condition : example::sweep_conditions()) {
    if (conditions.empty() || std::find(conditions.begin(), conditions.end(), condition.name) != conditions.end()) {
      plan.conditions.push_back(&condition);
    }
  }
  return plan;
}

std::vector<example::TrackingJob> jobs_of(const std::string& set, const Plan& plan) {
  std::vector<example::TrackingJob> jobs;
  for (const example::Pour& each : plan.pours) {
    for (const std::string& method : plan.methods) {
      jobs.push_back({each, method});
      std::vector<const example::Condition*> conditions;
      if (set == "wrong_amount") {
        conditions = {&example::amount_condition()};
      } else if (set == "sweep") {
        conditions = plan.conditions;
      }
      for (const example::Condition* condition : conditions) {
        for (const double value : condition->values) {
          if (method != "open_loop" || !condition->in_masks) {  // open loop looks at no mask
            jobs.push_back({each, method, condition, value});
          }
        }
      }
    }
    if (set == "pours") {
      jobs.push_back({each, example::true_effects});
      jobs.push_back({each, example::perfect_state});
    }
  }
  return jobs;
}

std::vector<example::ExperimentSection> sections_of(const std::string& set, const Plan& plan,
                                                    const example::TrackingExperiment& experiment) {
  auto sections = set == "harmless"       ? example::harmless_tables(experiment, plan.pours, plan.methods)
                  : set == "wrong_amount" ? example::amount_tables(experiment, plan.pours, plan.methods)
                  : set == "sweep"        ? example::sweep_tables(experiment, plan.pours, plan.methods, plan.conditions)
                                          : example::pour_tables(experiment, plan.pours, plan.methods);
  for (auto& section : example::failures_of(experiment.results())) {
    sections.push_back(std::move(section));
  }
  return sections;
}

nlohmann::json results_json(const std::vector<example::TrackingJob>& jobs,
                            const example::TrackingExperiment& experiment) {
  nlohmann::json json;
  for (const example::TrackingJob& job : jobs) {
    json[job.key()] = experiment.result(job);
  }
  return json;
}

}  // namespace

int main(int count, char** values) {
  std::string set = "pours";
  std::vector<std::string> methods, only, conditions;
  example::ExperimentOptions options;
  example::ExperimentCommand command(options);
  CLI::App app("Tracks twins of pours by several methods, as in Schenck and Fox (2017), and scores them.");
  command.add_to(app, 1);
  app.add_option("--set", set,
                 "pours: the paper's, by method; harmless: nothing is wrong with the model; wrong_amount: the model is "
                 "told too much or too little; sweep: what a camera and a tracker of poses get wrong, more and more")
      ->check(CLI::IsMember({"pours", "harmless", "wrong_amount", "sweep"}));
  app.add_option("--corrector", methods,
                 "methods as of track, several by commas; without it all (pours) or open_loop,default")
      ->delimiter(',')
      ->check(CLI::IsMember(example::tracking_method_names()));
  app.add_option("--condition", conditions, "of a sweep, several by commas; without it all")
      ->delimiter(',')
      ->check(CLI::IsMember(condition_names()));
  app.add_option("--only", only, "recordings of the set, such as cup_30_1, several by commas")->delimiter(',');
  return example::run_tool(app, count, values, [&] {
    command.give_to(options);
    example::expect_writable({command.json_file, command.report_file});
    const Plan plan = plan_of(set, methods, only, conditions);
    const std::vector<example::TrackingJob> jobs = jobs_of(set, plan);
    example::TrackingExperiment experiment(options);
    experiment.run(jobs);
    const std::vector<example::ExperimentSection> sections = sections_of(set, plan, experiment);
    example::print_sections(sections);
    std::printf("%zu of %zu recordings made, %zu of %zu results computed\n", experiment.recorded(), plan.pours.size(),
                experiment.computed(), experiment.asked());
    if (!command.json_file.empty()) {
      nlohmann::json json;
      json["set"] = set;
      json["results"] = results_json(jobs, experiment);
      json["tables"] = example::sections_json(sections);
      json["computed"] = experiment.computed();
      example::write_result(command.json_file, json);
    }
    if (!command.report_file.empty()) {
      example::write_experiment_report(command.report_file, "Tracking experiment: " + set,
                                       std::to_string(plan.pours.size()) +
                                           (plan.pours.size() == 1 ? " recording of " : " recordings of ") +
                                           example::detail::figure(options.duration, 1) + " s; particles of " +
                                           example::detail::figure(command.reality_mm, 1) + " mm in reality and " +
                                           example::detail::figure(command.model_mm, 1) +
                                           " mm in the model. Scores are intersections over unions of silhouettes.",
                                       sections);
    }
    const auto& results = experiment.results();
    return std::any_of(results.begin(), results.end(), [](const auto& entry) { return entry.second["status"] != "ok"; })
               ? 1
               : 0;
  });
}
