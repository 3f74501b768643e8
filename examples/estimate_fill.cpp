// SPDX-License-Identifier: MIT
// How much liquid was in the container that a recording shows being poured from:
//   estimate_fill RECORDING_DIR --json OUT.json --report OUT.html
// Exit status 0: done; 1: the recording could not be followed to its end; 2: it, a file or an argument is wrong.

#include <algorithm>
#include <cstdio>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <decant/core/stopwatch.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/progress.hpp>
#include <decant/io/recording_reader.hpp>
#include <decant/io/report.hpp>
#include <decant/io/table.hpp>

#include "support/fill_estimate.hpp"
#include "support/hypothesis_report.hpp"
#include "support/result_file.hpp"
#include "support/tool.hpp"

namespace {

/// Probabilities [%] by method and level.
decant::Table table_of(const example::FillResult& result, const example::FillOptions& options) {
  std::vector<std::string> header{"probability of [%]"};
  for (const int level : std::set<int>(options.levels.begin(), options.levels.end())) {
    header.push_back(std::to_string(level) + " % full");
  }
  header.push_back("none of these");
  decant::Table table(header);
  for (const std::string& name : options.methods) {
    const example::PosteriorCourse& course = result.by_method.at(name);
    std::vector<std::string> row{name};
    for (const double probability : course.last()) {
      row.push_back(decant::detail::fixed_text(100 * probability, 1));
    }
    table.add(row);
  }
  return table;
}

std::string sentence(const example::FillResult& result) {
  using decant::detail::fixed_text;
  if (!result.volume_ml) {
    return result.container + ": the amount could not be estimated: " + result.grid.status;
  }
  const auto& volume = *result.volume_ml;
  return result.container + ": " + fixed_text(volume.median, 0) + " ml (90 %: " + fixed_text(volume.low, 0) + " .. " +
         fixed_text(volume.high, 0) + ") of " + fixed_text(result.container_ml, 0) + " ml that it holds";
}

/// The same by the likelihood as printed in the paper.
decant::Table table_as_printed(const example::FillResult& result, const example::FillOptions& options) {
  std::vector<std::string> header{"probability of [%]"};
  for (const int level : std::set<int>(options.levels.begin(), options.levels.end())) {
    header.push_back(std::to_string(level) + " % full");
  }
  decant::Table table(header);
  for (const std::string& name : options.methods) {
    std::vector<std::string> row{name};
    for (const double probability : example::probability_schenck2017(result.by_method.at(name))) {
      row.push_back(decant::detail::fixed_text(100 * probability, 1));
    }
    table.add(row);
  }
  return table;
}

/// A run over the recording with its name in the report.
using NamedCourse = std::pair<std::string, const example::PosteriorCourse*>;

void add_amount(decant::HtmlReport& report, const example::FillResult& result, const example::FillOptions& options,
                const std::vector<NamedCourse>& courses) {
  const std::size_t frames = result.grid.time.size();
  if (!result.volume_ml || frames == 0) {
    return;
  }
  report.heading("How much, by the default method");
  std::vector<example::NamedDensity> densities;
  const std::vector<double> times = example::times_of(result.grid);
  for (const std::size_t part : {std::size_t{1}, std::size_t{2}, std::size_t{3}}) {
    const std::size_t frame = (frames - 1) * part / 3;
    if (const auto density = example::amount_density(result, frame)) {
      densities.push_back(
          {part == 3 ? "at the end" : "after " + decant::detail::fixed_text(times[frame], 2) + " s", *density});
    }
  }
  report.chart(example::density_chart("What is known of the amount", "amount [ml]", "density [1/ml]", densities,
                                      result.grid_ml.front(), result.grid_ml.back()));
  decant::LineChart course{"The amount over time", "time [s]", "amount [ml]", {}, {}, {0, result.container_ml}};
  example::add_estimate_lines(
      course, "median", result.grid, [&](std::size_t frame) { return example::amount_density(result, frame); },
      options.confidence);
  report.chart(course);
  report.chart(example::followed_chart(courses));
}

void write_report(const std::string& file, const decant::Recording& recording, const example::FillResult& result,
                  const example::FillOptions& options) {
  decant::HtmlReport report("How much was in it: " + recording.name);
  report.paragraph(sentence(result) + ".");
  std::vector<NamedCourse> courses;
  if (!options.methods.empty()) {
    report.heading("Which level, by method");
    report.table(table_of(result, options));
    for (const std::string& name : options.methods) {
      const example::PosteriorCourse& course = result.by_method.at(name);
      courses.emplace_back(name, &course);
      report.chart(example::course_chart("Probability of each level: " + name, course, " % full"));
    }
    report.paragraph(
        "The likelihood as printed in the paper, in which every pixel of the picture counts by itself and a "
        "nat takes 25,000 of them, would have said:");
    report.table(table_as_printed(result, options));
  }
  courses.emplace_back("default, every amount", &result.grid);
  add_amount(report, result, options, courses);
  example::add_best_overlays(report, recording, courses, " % full", {options.tracking.threads});
  report.write(file);
}

}  // namespace

int main(int count, char** values) {
  std::string folder, json_file, report_file;
  example::FillOptions options;
  options.tracking.spacing = 0;
  double spacing_mm = 0;
  CLI::App app("Estimates how much liquid was in the container that a recording shows being poured from.");
  app.add_option("recording", folder, "folder of a recording, format version 1; what it says of the amount is not used")
      ->required();
  app.add_option("--json", json_file, "writes the posterior and the amount");
  app.add_option("--report", report_file, "writes a page with charts, for a browser");
  app.add_option("--methods", options.methods, "that choose from the levels; several by commas")
      ->delimiter(',')
      ->check(CLI::IsMember(example::weighing_methods()));
  app.add_option("--levels", options.levels, "to choose from [% of what the container holds], by commas")
      ->delimiter(',')
      ->check(CLI::Range(0, 100));
  app.add_option("--grid-step", options.grid_step, "of the amounts between which the estimate lies [%]")
      ->check(CLI::Range(2, 50));
  app.add_option("--spacing-mm", spacing_mm, "of the model's particles; 0: 6000 of them in the full container")
      ->check(CLI::Range(0.0, 20.0));
  app.add_option("--threads", options.tracking.threads, "0: all")->check(CLI::Range(0, 1024));
  return example::run_tool(app, count, values, [&] {
    options.tracking.spacing = 1e-3 * spacing_mm;
    example::expect_writable({json_file, report_file});
    options.tracking.keep_overlays = !report_file.empty();
    const decant::Recording recording = decant::read_recording(folder);
    decant::Progress progress(recording.name, 1);
    double milliseconds = 0;
    example::FillResult result;
    {
      const decant::Stopwatch watch(milliseconds);
      result = example::estimate_fill(recording, options,
                                      [&](const std::string& what, double share) { progress.update(share, what); });
    }
    progress.finish();
    std::printf("%s\n%s", sentence(result).c_str(), table_of(result, options).text().c_str());
    if (!json_file.empty()) {
      nlohmann::json json = example::fill_json(result, options.confidence);
      json["seconds"] = 1e-3 * milliseconds;
      example::write_result(json_file, json);
    }
    if (!report_file.empty()) {
      write_report(report_file, recording, result, options);
    }
    return result.grid.status == "ok" ? 0 : 1;
  });
}
