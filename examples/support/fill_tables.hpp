// SPDX-License-Identifier: MIT
#pragma once

/// The tables and charts of the fill experiment, for terminals, scripts and browsers.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/hypothesis/value_estimate.hpp>
#include <decant/io/detail/text.hpp>

#include "experiment_report.hpp"
#include "fill_experiment.hpp"

namespace example {

namespace detail {

/// One recording's result with its truth, and what the score needs of both.
struct FillCase {
  const Pour* pour;
  const nlohmann::json* result;

  int percent() const { return result->at("true_percent").get<int>(); }
  double true_ml() const { return result->at("true_ml").get<double>(); }
  double container_ml() const { return result->at("container_ml").get<double>(); }
  double volume_ml() const { return number_at(*result, "/volume_ml"); }
  double error_percent() const { return 100 * (volume_ml() - true_ml()) / container_ml(); }

  double probability_of_truth(const std::string& method) const {
    return number_at(*result, "/posterior/" + method + "/" + std::to_string(percent()));
  }
  bool right(const std::string& method) const {
    return number_at(*result, "/most_probable_percent/" + method) == percent();
  }

  decant::ValueDensity density() const {
    std::vector<double> ml, log_density;
    for (const nlohmann::json& amount : result->at("amounts")) {
      ml.push_back(amount.at("ml").get<double>());
      const double value = number_of(amount.at("log_posterior"));
      log_density.push_back(std::isnan(value) ? -std::numeric_limits<double>::infinity() : value);
    }
    return {ml, log_density};
  }
};

inline std::vector<FillCase> cases_of(const FillExperiment& experiment, const std::vector<Pour>& pours) {
  std::vector<FillCase> cases;
  for (const Pour& each : pours) {
    cases.push_back({&each, &experiment.result(each)});
  }
  return cases;
}

inline std::vector<FillCase> cases_where(const std::vector<FillCase>& cases, auto condition) {
  std::vector<FillCase> chosen;
  std::copy_if(cases.begin(), cases.end(), std::back_inserter(chosen), condition);
  return chosen;
}

inline double mean_probability(const std::vector<FillCase>& cases, const std::string& method) {
  std::vector<double> values;
  for (const FillCase& each : cases) {
    values.push_back(each.probability_of_truth(method));
  }
  return mean_of(values);
}

inline std::string level_name(int percent) { return percent == 0 ? "empty" : std::to_string(percent) + " %"; }

inline std::vector<int> levels_of(const std::vector<FillCase>& cases) {
  std::set<int> levels;
  for (const FillCase& each : cases) {
    levels.insert(each.percent());
  }
  return {levels.begin(), levels.end()};
}

/// Means over trials, and in how many the true level was the most probable.
inline ExperimentSection levels_by_method(const std::vector<FillCase>& cases, const std::vector<std::string>& methods) {
  std::vector<std::string> header{"method"};
  ExperimentSection section{"Probability of the true level, by method [%]", decant::Table(header)};
  std::vector<std::pair<std::string, std::vector<FillCase>>> columns;
  const std::vector<int> levels = levels_of(cases);
  section.look.groups = {{"", 1}};
  for (const char* container : {"cup", "bottle"}) {
    std::size_t count = 0;
    for (const int level : levels) {
      auto of = cases_where(cases, [&](const FillCase& each) {
        return each.pour->twin.container == container && each.percent() == level;
      });
      if (!of.empty()) {
        columns.emplace_back(level_name(level), std::move(of));
        ++count;
      }
    }
    if (count > 0) {
      section.look.groups.emplace_back(container, count);
    }
  }
  section.look.groups.emplace_back("all", 3);
  for (const auto& column : columns) {
    header.push_back(column.first);
  }
  header.insert(header.end(), {"mean", "lowest", "right"});
  section.table = decant::Table(header);
  section.bars.emplace();
  section.bars->title = "Mean probability of the true level";
  section.bars->x_label = "true level";
  section.bars->y_label = "probability";
  section.bars->y_within = {1};
  for (const int level : levels) {
    section.bars->groups.push_back(level_name(level));
  }
  for (const std::string& method : methods) {
    std::vector<std::string> row{method};
    for (const auto& column : columns) {
      row.push_back(percent_text(mean_probability(column.second, method)));
    }
    double lowest = 1;
    for (const FillCase& each : cases) {
      lowest = std::min(lowest, each.probability_of_truth(method));
    }
    const std::size_t right = cases_where(cases, [&](const FillCase& each) { return each.right(method); }).size();
    row.insert(row.end(),
               {percent_text(mean_probability(cases, method)), percent_text(lowest), count_text(right, cases.size())});
    section.table.add(row);
    section.json[method] = {
        {"mean", number_json(mean_probability(cases, method))}, {"lowest", lowest}, {"right", right}};
    decant::BarChart::Bars bars{method, {}};
    for (const int level : levels) {
      bars.heights.push_back(
          mean_probability(cases_where(cases, [&](const FillCase& each) { return each.percent() == level; }), method));
    }
    section.bars->bars.push_back(std::move(bars));
  }
  section.note = "Means over trials; the paper has more than 70 % on the true level for each of its methods.";
  return section;
}

/// Where the default method's probability goes, by what was true.
inline ExperimentSection levels_by_truth(const std::vector<FillCase>& cases) {
  std::vector<std::string> names;
  for (const auto& [name, probability] : cases.front().result->at("posterior").at(default_method).items()) {
    names.push_back(name);
  }
  std::sort(names.begin(), names.end(), [](const std::string& a, const std::string& b) {
    return std::pair(a == PosteriorCourse::none_name, a.size()) <
               std::pair(b == PosteriorCourse::none_name, b.size()) ||
           (a.size() == b.size() && a < b);
  });
  std::vector<std::string> header{"true level"};
  ExperimentSection section{"Probability by true level, default method [%]", decant::Table(header)};
  section.bars = decant::BarChart{"Mean probability of each level", "true level", "probability", {}, {}, {1}};
  for (const std::string& name : names) {
    const bool none = name == PosteriorCourse::none_name;
    header.push_back(none ? "none of these" : level_name(std::stoi(name)));
    section.bars->bars.push_back({header.back(), {}});
  }
  section.table = decant::Table(header);
  for (const int level : levels_of(cases)) {
    std::vector<std::string> row{level_name(level)};
    section.bars->groups.push_back(level_name(level));
    for (std::size_t k = 0; k < names.size(); ++k) {
      std::vector<double> values;
      for (const FillCase& each : cases) {
        if (each.percent() == level) {
          values.push_back(number_at(*each.result, "/posterior/" + default_method + "/" + names[k]));
        }
      }
      row.push_back(percent_text(mean_of(values)));
      section.bars->bars[k].heights.push_back(mean_of(values));
    }
    section.table.add(row);
  }
  return section;
}

/// By which of a run's figures the true level could have been told: the one in which it is the smallest.
inline ExperimentSection evidence_that_tells(const std::vector<FillCase>& cases,
                                             const std::vector<std::string>& methods) {
  const std::array<std::pair<const char*, const char*>, 5> kinds{
      {{"squared_before", "cells that differ from the prediction (decides)"},
       {"differing_before_px", "pixels that differ from the prediction"},
       {"differing_after_px", "pixels that differ after the correction"},
       {"moved_ml_m", "liquid moved, times how far"},
       {"relocated_ml", "liquid taken from place to place"}}};
  std::vector<std::string> header{"smallest where it is true"};
  header.insert(header.end(), methods.begin(), methods.end());
  ExperimentSection section{"What tells the true level", decant::Table(header)};
  for (const auto& [kind, title] : kinds) {
    std::vector<std::string> row{title};
    for (const std::string& method : methods) {
      std::size_t right = 0;
      bool differs = false;
      for (const FillCase& each : cases) {
        double own = 0, others = std::numeric_limits<double>::infinity();
        for (const auto& [name, figures] : each.result->at("evidence").at(method).items()) {
          const double value = number_at(figures, std::string("/") + kind);
          differs = differs || value > 0;
          (name == std::to_string(each.percent()) ? own : others) =
              name == std::to_string(each.percent()) ? value : std::min(others, value);
        }
        right += own < others ? 1 : 0;
      }
      row.push_back(differs ? count_text(right, cases.size()) : "-");
      section.json[kind][method] = differs ? nlohmann::json(right) : nlohmann::json();
    }
    section.table.add(row);
  }
  // the figure of the second row, as the paper weighs it
  std::vector<std::string> row{"likelihood as printed: mean probability of the truth [%]"};
  for (const std::string& method : methods) {
    std::vector<double> probability;
    for (const FillCase& each : cases) {
      probability.push_back(
          number_at(*each.result, "/posterior_schenck2017/" + method + "/" + std::to_string(each.percent())));
    }
    row.push_back(percent_text(mean_of(probability)));
    section.json["probability_schenck2017"][method] = number_json(mean_of(probability));
  }
  section.table.add(row);
  section.note =
      "In how many recordings the figure is the smallest under the true level; - where a method has no such figure. "
      "The likelihood as printed in the paper ranks by the second one, with delta = 0.50001.";
  return section;
}

/// How far estimates are off, and how often intervals hold the truth.
inline ExperimentSection amounts(const std::vector<FillCase>& cases) {
  const std::array<double, 4> confidences{0.5, 0.8, 0.9, 0.95};
  std::vector<std::string> header{"recordings", "number", "median", "worst", "width"};
  for (const double confidence : confidences) {
    header.push_back(percent_text(confidence, 0) + " %");
  }
  ExperimentSection section{"Amount, default method [% of what the container holds]", decant::Table(header)};
  section.look.groups = {{"", 2}, {"error", 2}, {"90 % interval", 1}, {"truth is within the interval of", 4}};
  const auto add = [&](const std::string& name, const std::vector<FillCase>& of) {
    std::vector<double> errors, widths;
    std::array<std::size_t, 4> within{};
    for (const FillCase& each : of) {
      const decant::ValueDensity density = each.density();
      errors.push_back(std::abs(each.error_percent()));
      const auto [low, high] = density.interval(0.9);
      widths.push_back(100 * (high - low) / each.container_ml());
      for (std::size_t k = 0; k < confidences.size(); ++k) {
        const auto [from, to] = density.interval(confidences[k]);
        within[k] += from <= each.true_ml() && each.true_ml() <= to ? 1 : 0;
      }
    }
    if (of.empty()) {
      return;
    }
    const double worst = *std::max_element(errors.begin(), errors.end());
    std::vector<std::string> row{name, std::to_string(of.size()), decant::detail::fixed_text(median_of(errors), 1),
                                 decant::detail::fixed_text(worst, 1),
                                 decant::detail::fixed_text(median_of(widths), 1)};
    section.json[name] = {
        {"cases", of.size()}, {"median_error_percent", median_of(errors)}, {"worst_error_percent", worst}};
    for (std::size_t k = 0; k < confidences.size(); ++k) {
      const double share = static_cast<double>(within[k]) / static_cast<double>(of.size());
      row.push_back(percent_text(share, 0) + " %");
      section.json[name]["coverage_" + percent_text(confidences[k], 0)] = share;
    }
    section.table.add(row);
  };
  for (const char* container : {"cup", "bottle"}) {
    add(container, cases_where(cases, [&](const FillCase& each) { return each.pour->twin.container == container; }));
  }
  add("all", cases);

  decant::LineChart chart{"Estimated over true amount",
                          "true amount [% of the container]",
                          "estimated [% of the container]",
                          {},
                          {0, 100},
                          {0, 100}};
  chart.lines = {{"90 % interval", {}, {}}, {"estimate", {}, {}}, {"equal", {0, 100}, {0, 100}, true}};
  const double gap = std::numeric_limits<double>::quiet_NaN();
  for (const FillCase& each : cases) {
    const auto percent = [&](double ml) { return 100 * ml / each.container_ml(); };
    const auto [low, high] = each.density().interval(0.9);
    const double x = percent(each.true_ml()), y = percent(each.volume_ml());
    chart.lines[0].x.insert(chart.lines[0].x.end(), {x, x, gap});
    chart.lines[0].y.insert(chart.lines[0].y.end(), {percent(low), percent(high), gap});
    chart.lines[1].x.insert(chart.lines[1].x.end(), {x - 0.7, x + 0.7, gap});
    chart.lines[1].y.insert(chart.lines[1].y.end(), {y, y, gap});
  }
  section.chart = std::move(chart);
  return section;
}

/// Whether what is said with some probability is true as often.
inline ExperimentSection reliability(const std::vector<FillCase>& cases) {
  constexpr int bins = 5;
  std::array<std::vector<double>, bins> stated, true_ones;
  for (const FillCase& each : cases) {
    const decant::ValueDensity density = each.density();
    for (int percent = 10; percent <= 90; percent += 10) {
      const double ml = 0.01 * percent * each.container_ml(), probability = 1 - density.share_below(ml);
      const bool is_true = each.true_ml() > ml;
      if (probability > 0.01 && probability < 0.99) {  // the rest is as good as certain, and most of all statements
        const auto bin = static_cast<std::size_t>(std::min(bins - 1, static_cast<int>(bins * probability)));
        stated[bin].push_back(probability);
        true_ones[bin].push_back(is_true ? 1 : 0);
      }
    }
  }
  ExperimentSection section{"Reliability: 'there was more than X % in it', X = 10 .. 90, stated with 1 .. 99 %",
                            decant::Table({"stated [%]", "statements", "mean of stated [%]", "true [%]"})};
  for (std::size_t bin = 0; bin < bins; ++bin) {
    const double low = static_cast<double>(bin) / bins, high = static_cast<double>(bin + 1) / bins;
    section.table.add({percent_text(low, 0) + " .. " + percent_text(high, 0), std::to_string(stated[bin].size()),
                       percent_text(mean_of(stated[bin])), percent_text(mean_of(true_ones[bin]))});
    section.json.push_back({{"statements", stated[bin].size()},
                            {"stated", number_json(mean_of(stated[bin]))},
                            {"true", number_json(mean_of(true_ones[bin]))}});
  }
  return section;
}

inline ExperimentSection every_amount(const std::vector<FillCase>& cases) {
  ExperimentSection section{"Amounts one by one [ml]",
                            decant::Table({"recording", "true", "estimate", "from", "to", "error [%]"})};
  for (const FillCase& each : cases) {
    const auto [low, high] = each.density().interval(0.9);
    const auto ml = [](double value) { return decant::detail::fixed_text(value, 0); };
    section.table.add({each.pour->name, ml(each.true_ml()), ml(each.volume_ml()), ml(low), ml(high),
                       decant::detail::fixed_text(each.error_percent(), 1)});
  }
  section.note = "From .. to: the 90 % interval. Errors are in percent of what the container holds.";
  return section;
}

}  // namespace detail

/// @param levels pours that were run with all methods, or none; @param amounts others, or none.
inline std::vector<ExperimentSection> fill_tables(const FillExperiment& experiment, const std::vector<Pour>& levels,
                                                  const std::vector<Pour>& amounts,
                                                  const std::vector<std::string>& methods) {
  std::vector<ExperimentSection> sections;
  const std::vector<detail::FillCase> of_levels = detail::cases_of(experiment, levels);
  std::vector<detail::FillCase> all = of_levels, others = detail::cases_of(experiment, amounts);
  all.insert(all.end(), others.begin(), others.end());
  if (!of_levels.empty()) {
    sections.push_back(detail::levels_by_method(of_levels, methods));
    if (std::find(methods.begin(), methods.end(), default_method) != methods.end()) {
      sections.push_back(detail::levels_by_truth(of_levels));
    }
    sections.push_back(detail::evidence_that_tells(of_levels, methods));
  }
  std::erase_if(all, [](const detail::FillCase& each) { return !each.result->contains("volume_ml"); });
  if (!all.empty()) {
    sections.push_back(detail::amounts(all));
    sections.push_back(detail::reliability(all));
    sections.push_back(detail::every_amount(all));
  }
  return sections;
}

}  // namespace example
