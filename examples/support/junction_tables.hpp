// SPDX-License-Identifier: MIT
#pragma once

/// The tables and charts of the junction experiment, for terminals, scripts and browsers.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/io/detail/text.hpp>

#include "experiment_report.hpp"
#include "junction_experiment.hpp"

namespace example {

namespace detail {

/// One recording's result, and what the score needs of it.
struct JunctionScore {
  const JunctionCase* of;
  const nlohmann::json* result;

  bool right() const { return result->at("answer") == of->answer; }
  double probability_of_truth() const { return number_at(*result, "/posterior/" + of->answer); }
  double decided() const { return number_at(*result, "/decided_s"); }
  double third_poured() const { return number_at(*result, "/third_poured_s"); }
  bool in_time() const { return right() && decided() < third_poured(); }
  /// When a third of a litre has really run out and lies in the bowls; NaN if never.
  double third_in_bowls() const {
    const auto& bowls = result->at("truth").at("volume_ml");
    const auto& time = result->at("posterior_over_time").at("time_s");
    for (std::size_t frame = 0; frame < time.size(); ++frame) {
      double sum = 0;
      for (const auto& [body, volume] : bowls.items()) {
        sum += volume.at(frame).get<double>();
      }
      if (sum >= 1000.0 / 3) {  // of a litre, in ml
        return time.at(frame).get<double>();
      }
    }
    return std::numeric_limits<double>::quiet_NaN();
  }
  bool before_bowls() const { return right() && decided() < third_in_bowls(); }

  /// The leg that is not wholly open, of those that have one such leg; else the left one.
  std::string leg() const { return of->twin.right_opening < 1 ? "right" : "left"; }
  double true_opening() const { return std::min(of->twin.left_opening, of->twin.right_opening); }
  double opening() const { return number_at(*result, "/opening/" + leg() + "/median"); }
  double opening_end(int which) const {
    return number_at(*result, "/opening/" + leg() + "/interval_90/" + std::to_string(which));
  }
  std::string hidden() const { return result->at("truth").value("hidden", ""); }
  std::string solver() const { return result->at("truth").value("solver", ""); }
};

inline std::vector<JunctionScore> scores_of(const JunctionExperiment& experiment,
                                            const std::vector<JunctionCase>& cases, const std::string& method) {
  std::vector<JunctionScore> scores;
  for (const JunctionCase& each : cases) {
    scores.push_back({&each, &experiment.result(each, method)});
  }
  return scores;
}

inline std::string answer_text(const std::string& answer) {
  return answer == PosteriorCourse::none_name ? "none of these" : answer;
}

inline std::string seconds_text(double seconds) {
  return std::isfinite(seconds) ? decant::detail::fixed_text(seconds, 2) : "never";
}

/// Right answers and the mean probability of the truth, by method and configuration.
inline ExperimentSection configurations_by_method(const JunctionExperiment& experiment,
                                                  const std::vector<JunctionCase>& cases,
                                                  const std::vector<std::string>& methods) {
  std::vector<std::string> answers, header{"method"};
  for (const JunctionCase& each : cases) {
    if (std::find(answers.begin(), answers.end(), each.answer) == answers.end()) {
      answers.push_back(each.answer);
      header.push_back(answer_text(each.answer));
    }
  }
  header.insert(header.end(), {"right", "lowest [%]", "before a third is poured", "... is in the bowls"});
  ExperimentSection section{"Which configuration: mean probability of the true one [%]", decant::Table(header)};
  section.bars =
      decant::BarChart{"Mean probability of the true configuration", "true configuration", "probability", {}, {}, {1}};
  for (const std::string& answer : answers) {
    section.bars->groups.push_back(answer_text(answer));
  }
  for (const std::string& method : methods) {
    const std::vector<JunctionScore> scores = scores_of(experiment, cases, method);
    std::vector<std::string> row{method};
    decant::BarChart::Bars bars{method, {}};
    for (const std::string& answer : answers) {
      std::vector<double> probability;
      for (const JunctionScore& each : scores) {
        if (each.of->answer == answer) {
          probability.push_back(each.probability_of_truth());
        }
      }
      bars.heights.push_back(mean_of(probability));
      row.push_back(percent_text(mean_of(probability)));
    }
    double lowest = 1;
    std::size_t right = 0, in_time = 0, before_bowls = 0;
    for (const JunctionScore& each : scores) {
      lowest = std::min(lowest, each.probability_of_truth());
      right += each.right() ? 1 : 0;
      in_time += each.in_time() ? 1 : 0;
      before_bowls += each.before_bowls() ? 1 : 0;
    }
    row.insert(row.end(), {count_text(right, scores.size()), percent_text(lowest), count_text(in_time, scores.size()),
                           count_text(before_bowls, scores.size())});
    section.table.add(row);
    section.bars->bars.push_back(std::move(bars));
    section.json[method] = {
        {"right", right}, {"in_time", in_time}, {"before_bowls", before_bowls}, {"lowest", number_json(lowest)}};
  }
  section.note =
      "The paper: 5 of 5 for the warp field, 4 of 5 for open loop. The last columns count right answers that had "
      "90 % for good before a third of the liquid was poured into the pipe, as told, or had run out into the bowls.";
  return section;
}

/// The true opening of a leg against what was estimated.
inline ExperimentSection openings_table(const std::vector<JunctionScore>& scores) {
  ExperimentSection section{"How much of a leg is open [%], default method",
                            decant::Table({"recording", "solver", "open", "estimated", "from", "to", "off by"})};
  section.chart = decant::LineChart{"Opening of a leg", "true [%]", "estimated [%]", {}, {0, 100}, {0, 100}};
  decant::LineChart::Line estimated{"median", {}, {}}, low{"90 % from", {}, {}, true}, high{"90 % to", {}, {}, true};
  std::vector<double> errors;
  std::size_t within = 0, held = 0;
  for (const JunctionScore& each : scores) {
    const double truth = each.true_opening(), error = each.opening() - truth;
    errors.push_back(std::abs(error));
    within += std::abs(error) <= 0.15 ? 1 : 0;
    held += each.opening_end(0) <= truth && truth <= each.opening_end(1) ? 1 : 0;
    section.table.add({each.of->name, each.solver(), percent_text(truth, 0), percent_text(each.opening(), 0),
                       percent_text(each.opening_end(0), 0), percent_text(each.opening_end(1), 0),
                       percent_text(error, 0)});
  }
  std::vector<JunctionScore> sorted = scores;
  std::sort(sorted.begin(), sorted.end(),
            [](const auto& a, const auto& b) { return a.true_opening() < b.true_opening(); });
  for (const JunctionScore& each : sorted) {
    for (auto* line : {&estimated, &low, &high}) {
      line->x.push_back(100 * each.true_opening());
    }
    estimated.y.push_back(100 * each.opening());
    low.y.push_back(100 * each.opening_end(0));
    high.y.push_back(100 * each.opening_end(1));
  }
  section.chart->lines = {estimated, low, high, {"truth", {0, 100}, {0, 100}, true}};
  const double worst = errors.empty() ? 0 : *std::max_element(errors.begin(), errors.end());
  section.json = {{"within_15", within}, {"held", held}, {"cases", scores.size()}, {"worst", number_json(worst)}};
  section.note = count_text(within, scores.size()) + " within 15 points, the worst " + percent_text(worst, 0) +
                 "; the 90 % intervals hold the truth in " + count_text(held, scores.size()) + ".";
  return section;
}

inline ExperimentSection every_junction(const std::vector<JunctionScore>& scores) {
  ExperimentSection section{"One by one, default method",
                            decant::Table({"recording", "solver", "hidden", "answer", "right", "truth [%]",
                                           "decided [s]", "a third poured [s]", "in the bowls [s]"})};
  std::size_t hypotheses = 0, frames = 0, run = 0, coarse = 0;
  for (const JunctionScore& each : scores) {
    section.table.add({each.of->name, each.solver(), each.hidden(),
                       answer_text(each.result->at("answer").get<std::string>()), each.right() ? "yes" : "NO",
                       percent_text(each.probability_of_truth()), seconds_text(each.decided()),
                       seconds_text(each.third_poured()), seconds_text(each.third_in_bowls())});
    hypotheses = each.result->at("hypotheses").size();
    frames += hypotheses * each.result->at("posterior_over_time").at("time_s").size();
    run += each.result->at("frames_run").get<std::size_t>();
    coarse += each.result->at("scouted_frames_run").get<std::size_t>();
  }
  const auto share = [&](std::size_t part) {
    return frames > 0 ? static_cast<double>(part) / static_cast<double>(frames) : 0.0;
  };
  section.json = {{"frames_share", share(run)}, {"coarse_frames_share", share(coarse)}, {"hypotheses", hypotheses}};
  section.note = "Of the frames of " + std::to_string(hypotheses) + " hypotheses " + percent_text(share(run), 0) +
                 " % were simulated, after " + percent_text(share(coarse), 0) + " % in coarse particles.";
  return section;
}

}  // namespace detail

/// @param configurations, openings, others cases that were run, by the default method at least; or none.
inline std::vector<ExperimentSection> junction_tables(const JunctionExperiment& experiment,
                                                      const std::vector<JunctionCase>& configurations,
                                                      const std::vector<JunctionCase>& openings,
                                                      const std::vector<JunctionCase>& others,
                                                      const std::vector<std::string>& methods) {
  std::vector<ExperimentSection> sections;
  if (!configurations.empty()) {
    sections.push_back(detail::configurations_by_method(experiment, configurations, methods));
  }
  std::vector<detail::JunctionScore> all = detail::scores_of(experiment, configurations, default_method);
  const auto of_openings = detail::scores_of(experiment, openings, default_method);
  const auto of_others = detail::scores_of(experiment, others, default_method);
  if (!of_openings.empty()) {
    sections.push_back(detail::openings_table(of_openings));
  }
  all.insert(all.end(), of_openings.begin(), of_openings.end());
  all.insert(all.end(), of_others.begin(), of_others.end());
  if (!all.empty()) {
    sections.push_back(detail::every_junction(all));
  }
  return sections;
}

}  // namespace example
