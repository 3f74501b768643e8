// SPDX-License-Identifier: MIT
// Which leg of the pipe junction that a recording shows is blocked, and how much of it is open:
//   find_blockage RECORDING_DIR --json OUT.json --report OUT.html
// Exit status 0: done; 1: the recording could not be followed to its end; 2: it, a file or an argument is wrong.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <decant/core/stopwatch.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/progress.hpp>
#include <decant/io/recording_reader.hpp>
#include <decant/io/report.hpp>
#include <decant/io/table.hpp>

#include "support/blockage.hpp"
#include "support/hypothesis_report.hpp"
#include "support/result_file.hpp"
#include "support/tool.hpp"

namespace {

using decant::detail::fixed_text;

decant::Table table_of(const example::BlockageResult& result) {
  decant::Table table({"configuration", "probability [%]"});
  for (const auto& [name, course] : result.configurations) {
    const bool none = name == example::PosteriorCourse::none_name;
    table.add({none ? "none of these" : name, course.empty() ? "-" : fixed_text(100 * course.back(), 1)});
  }
  return table;
}

decant::Table openings_of(const example::BlockageResult& result) {
  decant::Table table({"leg", "open [%]", "from", "to"});
  for (std::size_t leg = 0; leg < result.legs.size(); ++leg) {
    if (const auto& opening = result.leg_opening[leg]) {
      table.add({result.legs[leg].name, fixed_text(100 * opening->median, 0), fixed_text(100 * opening->low, 0),
                 fixed_text(100 * opening->high, 0)});
    }
  }
  return table;
}

std::string sentence(const example::BlockageResult& result) {
  const std::string answer = example::blockage_answer(result);
  const auto decided = example::decided_at(result, 0.9);
  const std::string what = answer == example::PosteriorCourse::none_name ? "none of the configurations"
                           : answer == "none"                            ? "no leg is blocked"
                                                                         : answer;
  return result.junction + ": " + what +
         (decided ? ", more than 90 % probable from " + fixed_text(*decided, 2) + " s on" : ", undecided");
}

/// Every configuration, over time.
decant::LineChart configurations_chart(const example::BlockageResult& result) {
  decant::LineChart chart{"Probability of each configuration", "time [s]", "probability", {}, {}, {0, 1}};
  for (const auto& [name, course] : result.configurations) {
    const bool none = name == example::PosteriorCourse::none_name;
    chart.lines.push_back({none ? "none of these" : name, example::times_of(result.course), course, none});
  }
  return chart;
}

void add_openings(decant::HtmlReport& report, const example::BlockageResult& result,
                  const example::BlockageOptions& options) {
  report.heading("How much of each leg is open");
  report.table(openings_of(result));
  report.paragraph("From .. to: the " + std::to_string(std::lround(100 * options.confidence)) +
                   " % interval, where all openings were as probable before.");
  const std::size_t frames = result.course.time.size();
  std::vector<example::NamedDensity> densities;
  decant::LineChart course{"The opening over time", "time [s]", "open [%]", {}, {}, {0, 100}};
  for (std::size_t leg = 0; leg < result.legs.size() && frames > 0; ++leg) {
    if (const auto density = example::opening_density(result, leg, frames - 1)) {
      densities.push_back({result.legs[leg].name, *density});
    }
    example::add_estimate_lines(
        course, result.legs[leg].name, result.course,
        [&](std::size_t frame) { return example::opening_density(result, leg, frame); }, options.confidence, 100);
  }
  report.chart(example::density_chart("What is known of each leg at the end", "open [%]", "density [1/%]", densities, 0,
                                      1, 100));
  report.chart(course);
}

void write_report(const std::string& file, const decant::Recording& recording, const example::BlockageResult& result,
                  const example::BlockageOptions& options) {
  decant::HtmlReport report("What is blocked: " + recording.name);
  report.paragraph(sentence(result) + ".");
  report.heading("Configurations");
  report.table(table_of(result));
  report.chart(configurations_chart(result));
  add_openings(report, result, options);
  report.heading("Every hypothesis");
  for (std::size_t leg = 0; leg < result.legs.size(); ++leg) {
    report.chart(example::course_chart("Opening of one leg [%]: " + result.legs[leg].name, result.course, "",
                                       [&](std::size_t k) {
                                         const std::size_t blocked = example::blocked_legs(result, k);
                                         return blocked == 0 || (blocked == 1 && example::blocks(result, k, leg));
                                       }));
  }
  report.chart(example::course_chart("Openings of two legs at once [%]", result.course, "",
                                     [&](std::size_t k) { return example::blocked_legs(result, k) > 1; }));
  report.chart(example::followed_chart({{"legs and openings", &result.course}}));
  const double all =
      static_cast<double>(std::max<std::size_t>(1, result.course.names.size() * result.course.time.size()));
  const auto share = [&](std::size_t frames) {
    return std::to_string(frames) + " frames were simulated, " +
           decant::detail::fixed_text(100.0 * static_cast<double>(frames) / all, 0) +
           " % of what it takes to follow every hypothesis to the end";
  };
  const std::size_t scouted = result.course.scouted_frames_run;
  report.paragraph(share(result.course.frames_run) +
                   (scouted > 0 ? "; before, in coarse particles, " + share(scouted) : "") + ".");
  example::add_best_overlays(report, recording, {{options.method, &result.course}}, "", {options.tracking.threads});
  report.write(file);
}

}  // namespace

int main(int count, char** values) {
  std::string folder, json_file, report_file;
  example::BlockageOptions options;
  double spacing_mm = 0;
  bool keep_all = false;
  CLI::App app("Finds out which leg of a pipe junction is blocked by what runs out of it.");
  app.add_option("recording", folder, "folder of a recording, format version 1, with a body of the role junction")
      ->required();
  app.add_option("--json", json_file, "writes the posterior over time and the openings");
  app.add_option("--report", report_file, "writes a page with charts, for a browser");
  app.add_option("--method", options.method, "how each hypothesis follows the recording")
      ->check(CLI::IsMember(example::weighing_methods()));
  app.add_flag("--keep-all", keep_all, "follows hopeless hypotheses to the end as well");
  app.add_option("--spacing-mm", spacing_mm, "of the model's particles; 0: five across a leg")
      ->check(CLI::Range(0.0, 20.0));
  app.add_option("--threads", options.tracking.threads, "0: all")->check(CLI::Range(0, 1024));
  return example::run_tool(app, count, values, [&] {
    options.tracking.spacing = 1e-3 * spacing_mm;
    options.least_probability = keep_all ? 0 : options.least_probability;
    example::expect_writable({json_file, report_file});
    options.tracking.keep_overlays = !report_file.empty();
    const decant::Recording recording = decant::read_recording(folder);
    decant::Progress progress(recording.name, 1);
    double milliseconds = 0;
    example::BlockageResult result;
    {
      const decant::Stopwatch watch(milliseconds);
      result = example::find_blockage(recording, options, [&](double share) { progress.update(share); });
    }
    progress.finish();
    std::printf("%s\n%s%s", sentence(result).c_str(), table_of(result).text().c_str(),
                openings_of(result).text().c_str());
    if (!json_file.empty()) {
      nlohmann::json json = example::blockage_json(result, options.confidence);
      json["seconds"] = 1e-3 * milliseconds;
      example::write_result(json_file, json);
    }
    if (!report_file.empty()) {
      write_report(report_file, recording, result, options);
    }
    return result.course.status == "ok" ? 0 : 1;
  });
}
