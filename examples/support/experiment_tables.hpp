// SPDX-License-Identifier: MIT
#pragma once

/// The tables and charts of the tracking experiment, for terminals, scripts and browsers.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/io/report.hpp>
#include <decant/io/table.hpp>
#include <decant/tracking/volume_error.hpp>

#include "experiment_report.hpp"
#include "result_file.hpp"
#include "tracking_experiment.hpp"
#include "tracking_report.hpp"

namespace example {

namespace detail {

using Results = std::vector<const nlohmann::json*>;

/// Last entry of a column, in a container or in all of them together.
inline double volume_of(const nlohmann::json& result, const char* kind, const std::string& body, bool at_end) {
  double sum = std::numeric_limits<double>::quiet_NaN();
  if (result.contains(kind)) {
    for (const auto& [name, column] : result.at(kind).items()) {
      if ((body.empty() || body == name) && !column.empty()) {
        sum = (std::isfinite(sum) ? sum : 0.0) + number_of(at_end ? column.back() : column.front());
      }
    }
  }
  return sum;
}

/// A figure over several recordings.
using Measure = std::function<double(const Results&)>;

inline Measure mean_percent(const std::string& pointer) {
  return [pointer](const Results& results) {
    std::vector<double> values;
    for (const nlohmann::json* result : results) {
      values.push_back(100 * number_at(*result, pointer));
    }
    return mean_of(values);
  };
}

/// All intersections over all unions.
inline Measure pooled_percent(const std::string& pixels) {
  return [pixels](const Results& results) {
    double both = 0, all = 0;
    for (const nlohmann::json* result : results) {
      if (result->contains(pixels)) {
        both += number_at(*result, "/" + pixels + "/both");
        all += number_at(*result, "/" + pixels + "/union");
      }
    }
    return all > 0 ? 100 * both / all : std::numeric_limits<double>::quiet_NaN();
  };
}

inline decant::VolumeError pan_error(const Results& results) {
  decant::VolumeError error;
  for (const nlohmann::json* result : results) {
    if (result->contains("volume_ml")) {
      error.add(1e-6 * volume_of(*result, "volume_ml", "pan", true),
                1e-6 * volume_of(*result, "true_volume_ml", "pan", true));
    }
  }
  return error;
}

inline Results results_of(const TrackingExperiment& experiment, const std::vector<Pour>& pours,
                          const std::string& method, const Condition* condition = nullptr, double value = 0) {
  Results results;
  for (const Pour& each : pours) {
    results.push_back(&experiment.result({each, method, condition, value}));
  }
  return results;
}

}  // namespace detail

/// What the paper prints for a method, overall, in percent, or NaN.
inline double printed_in_paper(const std::string& method) {
  return method == "open_loop"    ? 65.66
         : method == "map_filter" ? 76.03
         : method == "warp_field" ? 78.41
                                  : std::numeric_limits<double>::quiet_NaN();
}

/// Rows are methods; columns are recordings as the paper groups them.
inline std::vector<ExperimentSection> pour_tables(const TrackingExperiment& experiment, const std::vector<Pour>& pours,
                                                  const std::vector<std::string>& methods) {
  struct Subject {
    std::string title;
    detail::Measure measure;
    int digits;
    bool highest_is_best, of_perfect_state;
    std::string note;
  };
  const std::string of_twelve = "Means over recordings of their means over frames [%].";
  const auto forecast = [&](const std::string& seconds) {
    return Subject{
        "Forecast of " + seconds + " s", detail::mean_percent("/forecast_iou/" + seconds), 1, true, false, of_twelve};
  };
  const std::vector<Subject> subjects{
      {"Assimilated", detail::mean_percent("/iou_mean"), 1, true, true,
       of_twelve + " Against the recorded masks, cleaned, after the correction. true_effects is open loop by a model "
                   "that was told what physics it lacks; perfect_state is the true silhouette in the tracker's place: "
                   "what the masks' noise alone takes away. The paper's figures are of its own recordings."},
      {"Assimilated, pooled over pixels", detail::pooled_percent("pixels"), 1, true, true,
       "All intersections over all unions [%]."},
      {"Prior", detail::mean_percent("/prior_iou"), 1, true, true,
       of_twelve + " Against the recorded masks, cleaned, before the frame's correction."},
      forecast("0.25"),
      forecast("0.5"),
      forecast("1"),
      {"Assimilated, against silhouettes without noise", detail::mean_percent("/truth_iou_mean"), 1, true, false,
       of_twelve + " All frames, also those without a mask."},
      {"Prior, against silhouettes without noise", detail::mean_percent("/truth_prior_iou"), 1, true, false,
       of_twelve + " All frames, also those without a mask."},
      {"Assimilated, against silhouettes without noise, pooled over pixels", detail::pooled_percent("truth_pixels"), 1,
       true, false, "All intersections over all unions [%]."},
      {"Liquid in the pan at the end: size of the error",
       [](const detail::Results& results) { return detail::pan_error(results).mean_absolute_ml(); }, 1, false, false,
       "Means over recordings [ml]."},
      {"Liquid in the pan at the end: error with its sign",
       [](const detail::Results& results) { return detail::pan_error(results).mean_ml(); }, 1, false, false,
       "Means over recordings [ml]; positive where there is too much."}};
  using Chosen = std::function<bool(const PourTwin&)>;
  const auto container = [](const char* name) -> Chosen {
    return [name](const PourTwin& twin) { return twin.container == name; };
  };
  const auto filled = [](int percent) -> Chosen {
    return [percent](const PourTwin& twin) { return std::lround(100 * twin.fill_fraction) == percent; };
  };
  const std::vector<std::pair<std::string, Chosen>> columns{
      {"cup", container("cup")}, {"bottle", container("bottle")},
      {"30 %", filled(30)},      {"60 %", filled(60)},
      {"90 %", filled(90)},      {"overall", [](const PourTwin&) { return true; }}};

  std::vector<ExperimentSection> sections;
  for (const Subject& subject : subjects) {
    const bool beside_paper = &subject == &subjects.front();
    std::vector<std::string> header{"method"};
    for (const auto& column : columns) {
      header.push_back(column.first);
    }
    if (beside_paper) {
      header.emplace_back("paper");
    }
    ExperimentSection section{subject.title, decant::Table(std::move(header)), {}, subject.note};
    std::vector<std::string> rows = methods;
    rows.push_back(true_effects);
    if (subject.of_perfect_state) {
      rows.push_back(perfect_state);
    }
    std::vector<std::vector<std::string>> cells;
    for (const std::string& method : rows) {
      std::vector<std::string> row{method};
      for (const auto& [name, chosen] : columns) {
        std::vector<Pour> members;
        std::copy_if(pours.begin(), pours.end(), std::back_inserter(members),
                     [&, &chosen = chosen](const Pour& each) { return chosen(each.twin); });
        const double value = subject.measure(detail::results_of(experiment, members, method));
        section.json[method][name] = number_json(value);
        row.push_back(detail::figure(value, subject.digits));
      }
      if (beside_paper) {
        row.push_back(detail::figure(printed_in_paper(method), 2));
      }
      section.table.add(std::move(row));
    }
    for (std::size_t column = 0; column < columns.size() && subject.highest_is_best && methods.size() > 1; ++column) {
      double best = -1;
      for (const std::string& method : methods) {
        const double value = detail::number_of(section.json[method][columns[column].first]);
        best = std::isfinite(value) ? std::max(best, value) : best;
      }
      for (std::size_t row = 1; row <= methods.size(); ++row) {  // what reads the same is as good
        if (section.table.rows()[row][column + 1] == detail::figure(best, subject.digits)) {
          section.look.bold.emplace_back(row, column + 1);
        }
      }
    }
    sections.push_back(std::move(section));
  }
  return sections;
}

/// What a method does that would better have done nothing. methods.front() is open loop.
inline std::vector<ExperimentSection> harmless_tables(const TrackingExperiment& experiment,
                                                      const std::vector<Pour>& pours,
                                                      const std::vector<std::string>& methods) {
  const std::vector<std::pair<std::string, std::string>> scores{
      {"assimilated", "/iou_mean"},        {"prior", "/prior_iou"},     {"+0.25 s", "/forecast_iou/0.25"},
      {"+0.5 s", "/forecast_iou/0.5"},     {"+1 s", "/forecast_iou/1"}, {"assimilated, truth", "/truth_iou_mean"},
      {"prior, truth", "/truth_prior_iou"}};
  std::vector<ExperimentSection> sections;
  for (std::size_t which = 1; which < methods.size(); ++which) {
    const std::string& method = methods[which];
    std::vector<std::string> header{"recording"}, share_header{"recording"};
    for (const auto& score : scores) {
      header.push_back(score.first);
    }
    share_header.insert(share_header.end(), {method, "open_loop", "truth", "difference"});
    share_header.insert(share_header.end(), {method, "open_loop", "truth", "difference"});
    ExperimentSection differences{method + " without need: scores",
                                  decant::Table(header),
                                  {},
                                  "Intersection over union, " + method +
                                      " less open loop, in points of percent: after and before the correction, of "
                                      "forecasts, and against silhouettes without noise."};
    ExperimentSection volumes{method + " without need: where the liquid is at the end",
                              decant::Table(share_header),
                              {{{"", 1}, {"in the container", 4}, {"in the pan", 4}}, {}},
                              "In percent of the liquid, each by its own amount at the start; the difference is " +
                                  method + " less open loop."};
    std::vector<std::vector<double>> all;
    const auto add_row = [](decant::Table& table, const std::string& name, auto begin, auto end) {
      std::vector<std::string> cells{name};
      std::for_each(begin, end, [&](double value) { cells.push_back(detail::figure(value, 1)); });
      table.add(std::move(cells));
    };
    const auto split = static_cast<std::ptrdiff_t>(scores.size());
    for (const Pour& each : pours) {
      const nlohmann::json& without = experiment.result({each, methods.front()});
      const nlohmann::json& with = experiment.result({each, method});
      std::vector<double> row;
      for (const auto& [name, pointer] : scores) {
        row.push_back(100 * (detail::number_at(with, pointer) - detail::number_at(without, pointer)));
        differences.json[each.name][name] = number_json(row.back());
      }
      for (const std::string& body : {each.twin.container, std::string("pan")}) {
        const auto share = [&](const nlohmann::json& result, const char* kind) {
          return 100 * detail::volume_of(result, kind, body, true) / detail::volume_of(result, kind, "", false);
        };
        const double here = share(with, "volume_ml"), open = share(without, "volume_ml");
        row.insert(row.end(), {here, open, share(with, "true_volume_ml"), here - open});
        volumes.json[each.name][body == "pan" ? "pan" : "container"] = {
            {method, number_json(here)}, {"open_loop", number_json(open)}, {"truth", number_json(row[row.size() - 2])}};
      }
      add_row(differences.table, each.name, row.begin(), row.begin() + split);
      add_row(volumes.table, each.name, row.begin() + split, row.end());
      all.push_back(std::move(row));
    }
    std::vector<double> means, worst;  // worst: the lowest of scores, the largest difference of volumes
    for (std::size_t column = 0; !all.empty() && column < all.front().size(); ++column) {
      std::vector<double> values;
      for (const auto& row : all) {
        values.push_back(row[column]);
      }
      means.push_back(detail::mean_of(values));
      worst.push_back(*std::min_element(values.begin(), values.end(), [](double a, double b) {
        return std::isfinite(a) && (!std::isfinite(b) || a < b);  // what is missing is never the lowest
      }));
    }
    add_row(differences.table, "mean", means.begin(), means.begin() + split);
    add_row(differences.table, "lowest", worst.begin(), worst.begin() + split);
    add_row(volumes.table, "mean", means.begin() + split, means.end());
    sections.push_back(std::move(differences));
    sections.push_back(std::move(volumes));
  }
  return sections;
}

/// What becomes of an amount that is wrong from the start.
inline std::vector<ExperimentSection> amount_tables(const TrackingExperiment& experiment,
                                                    const std::vector<Pour>& pours,
                                                    const std::vector<std::string>& methods) {
  const std::vector<std::string> columns{"told",      "method", "true at start", "at start", "true at end", "at end",
                                         "true, pan", "pan",    "assimilated",   "prior",    "from",        "to"};
  std::vector<std::string> header{"recording"};
  header.insert(header.end(), columns.begin(), columns.end());
  ExperimentSection section{"A wrong amount at the start",
                            decant::Table(header),
                            {{{"", 3},
                              {"all containers [ml]", 4},
                              {"at the end [ml]", 2},
                              {"IoU, truth [%]", 2},
                              {"90 % of the initial amount [ml]", 2}},
                             {}},
                            "Liquid in the containers, as it was and as the method has it; scores are against "
                            "silhouettes without noise. Methods that estimate the initial amount say between which two "
                            "amounts it is with a probability of 90 %."};
  ExperimentSection errors{
      "Errors of the amount",
      decant::Table({"told", "method", "at start", "at end", "worst at end", "pan at end", "interval holds truth"}),
      {},
      "Means over recordings of amount less true amount, in percent of the true amount in all "
      "containers; worst: the one farthest from zero. Last: in how many recordings the interval of "
      "the initial amount has the true one in it."};
  const Condition& condition = amount_condition();
  for (const double factor : condition.values) {
    const std::string told = detail::figure(100 * factor, 0) + " %";
    for (const std::string& method : methods) {
      std::vector<double> at_start, at_end, in_pan;
      int intervals = 0, held = 0;
      for (const Pour& each : pours) {
        const nlohmann::json& result = experiment.result({each, method, &condition, factor});
        const auto volume = [&](const char* kind, const char* body, bool end) {
          return detail::volume_of(result, kind, body, end);
        };
        const std::vector<double> values{volume("true_volume_ml", "", false),
                                         volume("volume_ml", "", false),
                                         volume("true_volume_ml", "", true),
                                         volume("volume_ml", "", true),
                                         volume("true_volume_ml", "pan", true),
                                         volume("volume_ml", "pan", true),
                                         100 * detail::number_at(result, "/truth_iou_mean"),
                                         100 * detail::number_at(result, "/truth_prior_iou"),
                                         detail::number_at(result, "/initial_ml/low_90"),
                                         detail::number_at(result, "/initial_ml/high_90")};
        std::vector<std::string> cells{each.name, told, method};
        nlohmann::json& json = section.json[each.name][method][decant::detail::number_text(factor)];
        for (std::size_t k = 0; k < values.size(); ++k) {
          cells.push_back(detail::figure(values[k], 1));
          json[columns[k + 2]] = number_json(values[k]);
        }
        section.table.add(std::move(cells));
        at_start.push_back(100 * (values[1] - values[0]) / values[0]);
        at_end.push_back(100 * (values[3] - values[2]) / values[2]);
        in_pan.push_back(100 * (values[5] - values[4]) / values[2]);
        const double low = values[8], high = values[9], initial = detail::number_at(result, "/true_initial_ml");
        intervals += std::isfinite(low) ? 1 : 0;
        held += low <= initial && initial <= high ? 1 : 0;
      }
      const double start = detail::mean_of(at_start), end = detail::mean_of(at_end), pan = detail::mean_of(in_pan);
      const double worst =
          *std::max_element(at_end.begin(), at_end.end(), [](double a, double b) { return std::abs(a) < std::abs(b); });
      errors.table.add({told, method, detail::figure(start, 1), detail::figure(end, 1), detail::figure(worst, 1),
                        detail::figure(pan, 1),
                        intervals > 0 ? std::to_string(held) + " of " + std::to_string(intervals) : "-"});
      errors.json[method][decant::detail::number_text(factor)] = {
          {"at_start", number_json(start)}, {"at_end", number_json(end)}, {"worst_at_end", number_json(worst)},
          {"pan_at_end", number_json(pan)}, {"intervals", intervals},     {"intervals_with_truth", held}};
    }
  }
  return {std::move(errors), std::move(section)};
}

/// How far a condition can go until a method is no better than none. methods.front() is open loop.
inline std::vector<ExperimentSection> sweep_tables(const TrackingExperiment& experiment, const std::vector<Pour>& pours,
                                                   const std::vector<std::string>& methods,
                                                   const std::vector<const Condition*>& conditions) {
  const detail::Measure assimilated = detail::mean_percent("/truth_iou_mean");
  const detail::Measure prior = detail::mean_percent("/truth_prior_iou");
  decant::Table breaking({"condition", "method", "assimilated", "prior"});
  nlohmann::json breaking_json;
  std::vector<ExperimentSection> sections;
  for (const Condition* condition : conditions) {
    std::vector<std::string> header{condition->label, "open_loop"};
    std::vector<decant::LineChart::Line> lines{{"open_loop", condition->values, {}, true}};
    for (std::size_t which = 1; which < methods.size(); ++which) {
      header.insert(header.end(), {methods[which], methods[which] + ", prior"});
      lines.push_back({methods[which], condition->values, {}});
      lines.push_back({methods[which] + ", prior", condition->values, {}});
    }
    ExperimentSection section{condition->title, decant::Table(header)};
    for (const double value : condition->values) {
      const std::string value_text = decant::detail::number_text(value);
      for (std::size_t which = 0; which < methods.size(); ++which) {
        // open loop looks at no mask: what is wrong with them changes nothing
        const bool as_it_is = which == 0 && condition->in_masks;
        const auto results =
            detail::results_of(experiment, pours, methods[which], as_it_is ? nullptr : condition, value);
        nlohmann::json& json = section.json[methods[which]][value_text];
        lines[which == 0 ? 0 : 2 * which - 1].y.push_back(assimilated(results));
        json["assimilated"] = number_json(assimilated(results));
        json["prior"] = number_json(prior(results));
        if (which > 0) {
          lines[2 * which].y.push_back(prior(results));
        }
      }
      std::vector<std::string> cells{value_text};
      for (const auto& line : lines) {
        cells.push_back(detail::figure(line.y.back(), 1));
      }
      section.table.add(std::move(cells));
    }
    for (std::size_t which = 1; which < methods.size(); ++which) {
      std::vector<std::string> cells{condition->title + ", " + condition->label, methods[which]};
      for (const std::size_t line : {2 * which - 1, 2 * which}) {
        std::optional<double> at;
        for (std::size_t k = 0; k < condition->values.size() && !at; ++k) {
          if (!(lines[line].y[k] > lines.front().y[k])) {
            at = condition->values[k];
          }
        }
        cells.push_back(at ? decant::detail::number_text(*at)
                           : "none up to " + decant::detail::number_text(condition->values.back()));
        breaking_json[condition->name][methods[which]][line == 2 * which ? "prior" : "assimilated"] =
            at ? nlohmann::json(*at) : nlohmann::json();
      }
      section.note += (section.note.empty() ? "" : " ") + methods[which] + ": breaking point " + cells[2] +
                      " (assimilated), " + cells[3] + " (prior).";
      breaking.add(std::move(cells));
    }
    section.chart = decant::LineChart{condition->title, condition->label, "intersection over union [%]", lines};
    sections.push_back(std::move(section));
  }
  ExperimentSection summary{"Breaking points",
                            std::move(breaking),
                            {},
                            "The first value at which a method scores no better than open loop at that value. Scores, "
                            "here and below, are means over " +
                                std::to_string(pours.size()) + (pours.size() == 1 ? " recording" : " recordings") +
                                " of intersections over unions with silhouettes without noise [%], after "
                                "(assimilated) and before (prior) each frame's correction; open loop has but one."};
  summary.json = std::move(breaking_json);
  sections.insert(sections.begin(), std::move(summary));
  return sections;
}

}  // namespace example
