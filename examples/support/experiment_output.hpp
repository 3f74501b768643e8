// SPDX-License-Identifier: MIT
#pragma once

/// How experiments that keep their work in a folder end: tables on the terminal, files where they are asked for.

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/io/detail/text.hpp>

#include "experiment_folder.hpp"
#include "experiment_report.hpp"
#include "result_file.hpp"

namespace example {

/// What an experiment was, for the head of its report.
struct ExperimentTitle {
  std::string title;
  std::size_t recordings = 0;
  double seconds = 0;              ///< of each
  double reality_mm = 0;           ///< spacing of the particles that were recorded
  std::string model_and_secret{};  ///< "... mm in reality, and <this>"
};

/// Prints the sections, with what was not followed to its end, and writes the files that are named.
/// @return the exit status: 1 if something was not followed to its end.
inline int tell_experiment(const ExperimentTitle& of, const ExperimentFolder& folder,
                           std::vector<ExperimentSection> sections, const std::string& json_file,
                           const std::string& report_file) {
  const auto& results = folder.results();
  for (ExperimentSection& section : failures_of(results)) {
    sections.push_back(std::move(section));
  }
  print_sections(sections);
  std::printf("%zu of %zu recordings made, %zu of %zu results computed\n", folder.recorded(), of.recordings,
              folder.computed(), folder.asked());
  if (!json_file.empty()) {
    nlohmann::json json;
    json["results"] = results;
    json["tables"] = sections_json(sections);
    write_result(json_file, json);
  }
  if (!report_file.empty()) {
    const std::string about =
        std::to_string(of.recordings) + (of.recordings == 1 ? " recording of " : " recordings of ") +
        decant::detail::fixed_text(of.seconds, 1) + " s; particles of " + decant::detail::fixed_text(of.reality_mm, 1) +
        " mm in reality, and " + of.model_and_secret;
    write_experiment_report(report_file, of.title, about, sections);
  }
  return std::any_of(results.begin(), results.end(), [](const auto& entry) { return entry.second["status"] != "ok"; })
             ? 1
             : 0;
}

}  // namespace example
