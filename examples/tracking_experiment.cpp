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
  std::string set = "pours", folder, json_file, report_file;
  std::vector<std::string> methods, only, conditions;
  example::ExperimentOptions options;
  double reality_mm = 1e3 * options.reality_spacing, model_mm = 1e3 * options.model_spacing;
  CLI::App app("Tracks twins of pours by several methods, as in Schenck and Fox (2017), and scores them.");
  app.add_option("folder", folder, "where recordings and results are kept")->required();
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
  app.add_option("--threads", options.threads, "runs side by side, each on one thread; 0: one per core")
      ->check(CLI::Range(0, 1024));
  app.add_option("--json", json_file, "writes results and tables");
  app.add_option("--report", report_file, "writes a page with tables and charts, for a browser");
  app.add_flag("--again", options.again, "computes results that are there already anew; recordings are kept");
  // smaller recordings, for tests; group "" is not in the help
  app.add_option("--seconds", options.duration)->check(CLI::Range(0.1, 60.0))->group("");
  app.add_option("--spacing-mm", reality_mm)->check(CLI::Range(1.0, 20.0))->group("");
  app.add_option("--model-spacing-mm", model_mm)->check(CLI::Range(1.0, 20.0))->group("");
  return example::run_tool(app, count, values, [&] {
    options.folder = folder;
    options.reality_spacing = 1e-3 * reality_mm;
    options.model_spacing = 1e-3 * model_mm;
    example::expect_writable({json_file, report_file});
    const Plan plan = plan_of(set, methods, only, conditions);
    const std::vector<example::TrackingJob> jobs = jobs_of(set, plan);
    example::TrackingExperiment experiment(options);
    experiment.run(jobs);
    const std::vector<example::ExperimentSection> sections = sections_of(set, plan, experiment);
    example::print_sections(sections);
    std::printf("%zu of %zu recordings made, %zu of %zu results computed\n", experiment.recorded(), plan.pours.size(),
                experiment.computed(), experiment.asked());
    if (!json_file.empty()) {
      nlohmann::json json;
      json["set"] = set;
      json["results"] = results_json(jobs, experiment);
      json["tables"] = example::sections_json(sections);
      json["computed"] = experiment.computed();
      example::write_result(json_file, json);
    }
    if (!report_file.empty()) {
      example::write_experiment_report(
          report_file, "Tracking experiment: " + set,
          std::to_string(plan.pours.size()) + (plan.pours.size() == 1 ? " recording of " : " recordings of ") +
              example::detail::figure(options.duration, 1) + " s; particles of " +
              example::detail::figure(reality_mm, 1) + " mm in reality and " + example::detail::figure(model_mm, 1) +
              " mm in the model. Scores are intersections over unions of silhouettes.",
          sections);
    }
    const auto& results = experiment.results();
    return std::any_of(results.begin(), results.end(), [](const auto& entry) { return entry.second["status"] != "ok"; })
               ? 1
               : 0;
  });
}
