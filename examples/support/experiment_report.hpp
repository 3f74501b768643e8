// SPDX-License-Identifier: MIT
#pragma once

/// Tables and charts of an experiment, for terminals, scripts and browsers.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/io/detail/text.hpp>
#include <decant/io/report.hpp>
#include <decant/io/table.hpp>

namespace example {

/// One table of an experiment, with what belongs to it.
struct ExperimentSection {
  std::string title;
  decant::Table table;
  decant::HtmlReport::TableLook look{};
  std::string note{};
  std::optional<decant::LineChart> chart{};
  std::optional<decant::BarChart> bars{};
  nlohmann::json json{};  ///< figures for scripts, beside the table's cells
};

namespace detail {

inline double number_of(const nlohmann::json& json) {
  return json.is_number() ? json.get<double>() : std::numeric_limits<double>::quiet_NaN();
}

/// NaN where there is no such entry, as of a forecast that a short recording has no frames for.
inline double number_at(const nlohmann::json& result, const std::string& pointer) {
  const nlohmann::json::json_pointer place(pointer);
  return result.contains(place) ? number_of(result.at(place)) : std::numeric_limits<double>::quiet_NaN();
}

/// Over those that are finite, NaN if none is.
inline double mean_of(const std::vector<double>& values) {
  double sum = 0, count = 0;
  for (const double value : values) {
    sum += std::isfinite(value) ? value : 0.0;
    count += std::isfinite(value) ? 1 : 0;
  }
  return count > 0 ? sum / count : std::numeric_limits<double>::quiet_NaN();
}

inline double median_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.empty()           ? std::numeric_limits<double>::quiet_NaN()
         : values.size() % 2 == 1 ? values[half]
                                  : 0.5 * (values[half - 1] + values[half]);
}

inline std::string percent_text(double share, int digits = 1) {
  return std::isfinite(share) ? decant::detail::fixed_text(100 * share, digits) : "-";
}

inline std::string count_text(std::size_t count, std::size_t of) {
  return std::to_string(count) + " of " + std::to_string(of);
}

}  // namespace detail

/// What did not run to its end; its scores are of the frames before. Nothing if all did.
inline std::vector<ExperimentSection> failures_of(const std::map<std::string, nlohmann::json>& results) {
  decant::Table table({"job", "status"});
  for (const auto& [key, result] : results) {
    if (const std::string status = result.at("status"); status != "ok") {
      table.add({key, status});
    }
  }
  if (table.rows().size() == 1) {
    return {};
  }
  return {{"Stopped early", std::move(table), {}, "Scores of these are of the frames before."}};
}

inline void print_sections(const std::vector<ExperimentSection>& sections) {
  for (const ExperimentSection& section : sections) {
    std::printf("%s\n\n%s%s%s\n", section.title.c_str(), section.table.text().c_str(), section.note.c_str(),
                section.note.empty() ? "" : "\n");
  }
}

inline nlohmann::json sections_json(const std::vector<ExperimentSection>& sections) {
  nlohmann::json json = nlohmann::json::array();
  for (const ExperimentSection& section : sections) {
    json.push_back({{"title", section.title}, {"rows", section.table.rows()}, {"figures", section.json}});
  }
  return json;
}

/// Throws std::runtime_error where the file cannot be written.
inline void write_experiment_report(const std::filesystem::path& path, const std::string& title,
                                    const std::string& about, const std::vector<ExperimentSection>& sections) {
  decant::HtmlReport report(title);
  report.paragraph(about);
  for (const ExperimentSection& section : sections) {
    report.heading(section.title);
    report.table(section.table, section.look);
    if (!section.note.empty()) {
      report.paragraph(section.note);
    }
    if (section.chart) {
      report.chart(*section.chart);
    }
    if (section.bars) {
      report.bar_chart(*section.bars);
    }
  }
  report.write(path);
}

}  // namespace example
