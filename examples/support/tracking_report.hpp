// SPDX-License-Identifier: MIT
#pragma once

/// How methods tracked a recording, as one HTML file: scores, charts, and silhouettes to look through.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/io/detail/text.hpp>
#include <decant/io/recording_truth.hpp>
#include <decant/io/report.hpp>
#include <decant/io/table.hpp>

#include "overlay_pictures.hpp"
#include "tracking_run.hpp"

namespace example {

struct NamedResult {
  std::string name;
  TrackingResult result;
};

namespace detail {

/// The liquid that really was in each body, frame by frame [ml], for the bodies of which a recording's maker says it.
inline std::vector<std::vector<double>> true_volumes(const decant::Recording& recording) {
  std::vector<std::vector<double>> volumes(recording.bodies.size());
  const std::optional<std::string> text = decant::read_truth(recording.folder);
  const nlohmann::json truth = text ? nlohmann::json::parse(*text) : nlohmann::json::object();
  const nlohmann::json all = truth.is_object() ? truth.value("volume_ml", nlohmann::json::object()) : nlohmann::json();
  for (std::size_t k = 0; k < volumes.size(); ++k) {
    const auto found = all.is_object() ? all.find(recording.bodies[k].name) : all.end();
    if (found == all.end() || !found->is_array() || found->size() != recording.frames) {
      continue;
    }
    for (const nlohmann::json& value : *found) {
      volumes[k].push_back(value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN());
    }
  }
  return volumes;
}

inline std::string overlay_note(const TrackingResult& result, std::size_t frame) {
  if (frame >= result.overlays.size()) {
    return result.status;
  }
  if (!result.overlays[frame].has_mask) {
    return "no mask";
  }
  return result.overlays[frame].counts ? "IoU " + figure(result.iou[frame], 3) : "little liquid";
}

inline std::vector<FilmSource> film_sources(const std::vector<NamedResult>& results) {
  std::vector<FilmSource> sources;
  for (const NamedResult& named : results) {
    sources.push_back({named.name, &named.result.overlays,
                       [&result = named.result](std::size_t frame) { return overlay_note(result, frame); }});
  }
  return sources;
}

inline double frames_per_second(const TrackingResult& result) {
  const double milliseconds = result.physics_ms + result.drawing_ms + result.correction_ms + result.relaxation_ms;
  return 1e3 * static_cast<double>(result.frames) / milliseconds;
}

/// A column of scores; the highest is set bold.
struct ScoreColumn {
  std::string name;
  int digits;
  std::vector<double> values;
  bool higher_is_better;
};

inline void add_scores(decant::HtmlReport& report, const decant::Recording& recording, const TrackingOptions& options,
                       const std::vector<NamedResult>& results, const std::vector<std::vector<double>>& truth) {
  std::vector<ScoreColumn> columns;
  const auto add = [&](const std::string& name, int digits, bool higher_is_better, auto&& value) {
    columns.push_back({name, digits, {}, higher_is_better});
    for (const NamedResult& named : results) {
      columns.back().values.push_back(value(named.result));
    }
  };
  using Result = const TrackingResult&;
  add("mean", 3, true, [](Result r) { return r.posterior.mean_over_frames(); });
  add("pooled", 3, true, [](Result r) { return r.posterior.pooled_over_pixels(); });
  add("prior", 3, true, [](Result r) { return r.prior.mean_over_frames(); });
  for (std::size_t k = 0; k < options.forecasts.size(); ++k) {
    const double ahead = options.forecasts[k];
    const int digits = std::abs(ahead - std::round(ahead)) < 1e-9             ? 0
                       : std::abs(10 * ahead - std::round(10 * ahead)) < 1e-9 ? 1
                                                                              : 2;
    add("+" + figure(ahead, digits) + "\u00a0s", 3, true, [k](Result r) { return r.forecasts[k].mean_over_frames(); });
  }
  const std::size_t overlaps = columns.size();
  // only differences between methods that saw the same masks mean anything
  double best_likelihood = -std::numeric_limits<double>::infinity();
  for (const NamedResult& named : results) {
    if (named.result.status == "ok") {
      best_likelihood = std::max(best_likelihood, named.result.log_likelihood);
    }
  }
  add("log-likelihood [nat]", 2, true, [best_likelihood](Result r) {
    return r.status == "ok" ? r.log_likelihood - best_likelihood : std::numeric_limits<double>::quiet_NaN();
  });
  std::vector<std::size_t> bodies;  // whose liquid was watched
  for (std::size_t k = 0; k < recording.bodies.size(); ++k) {
    if (std::any_of(results.begin(), results.end(), [&](const auto& n) { return !n.result.volume_ml[k].empty(); })) {
      bodies.push_back(k);
      add(recording.bodies[k].name, 1, false, [k](Result r) {
        return r.volume_ml[k].empty() ? std::numeric_limits<double>::quiet_NaN() : r.volume_ml[k].back();
      });
    }
  }
  add("relocated", 1, false, [](Result r) { return r.relocated_ml; });
  add("frames/s", 1, false, [](Result r) { return frames_per_second(r); });

  std::vector<std::string> header{"method"};
  for (const ScoreColumn& column : columns) {
    header.push_back(column.name);
  }
  header.emplace_back("status");
  decant::Table table(std::move(header));
  for (std::size_t row = 0; row < results.size(); ++row) {
    std::vector<std::string> cells{results[row].name};
    for (const ScoreColumn& column : columns) {
      cells.push_back(figure(column.values[row], column.digits));
    }
    cells.push_back(results[row].result.status);
    table.add(std::move(cells));
  }
  if (std::any_of(bodies.begin(), bodies.end(), [&](std::size_t k) { return !truth[k].empty(); })) {
    std::vector<std::string> cells{"truth"};
    cells.resize(2 + overlaps);
    for (const std::size_t k : bodies) {
      cells.push_back(truth[k].empty() ? "" : figure(truth[k].back(), 1));
    }
    table.add(std::move(cells));
  }

  decant::HtmlReport::TableLook look;
  look.groups = {
      {"", 1}, {"intersection over union", overlaps}, {"", 1}, {"liquid at the end [ml]", bodies.size() + 1}, {"", 2}};
  for (std::size_t column = 0; column < columns.size() && results.size() > 1; ++column) {
    const auto& [name, digits, values, higher_is_better] = columns[column];
    double best = -std::numeric_limits<double>::infinity();
    for (const double value : values) {
      best = std::isfinite(value) ? std::max(best, value) : best;
    }
    for (std::size_t row = 0; row < values.size() && higher_is_better; ++row) {
      if (figure(values[row], digits) == figure(best, digits)) {  // what reads the same is as good
        look.bold.emplace_back(row + 1, column + 1);
      }
    }
  }
  report.table(table, look);
  report.paragraph(
      std::string("Intersection over union of the observed and the predicted silhouette: mean over frames and pooled "
                  "over pixels, after the correction; prior: mean before it") +
      (options.forecasts.empty() ? "" : "; then the means of forecasts that the model made by itself") +
      ". 1 is perfect" + (results.size() > 1 ? ", the best of each column is bold" : "") +
      ". The log-likelihood of all masks is given as its difference from the best method's, " +
      figure(best_likelihood, 1) +
      " nat. Relocated is the liquid that a corrector took from place to place, all frames together.");
}

/// What methods found out beside the silhouettes, where they did.
inline void add_estimates(decant::HtmlReport& report, const std::vector<NamedResult>& results) {
  decant::Table table({"method", "estimate", "value", "90 % interval"});
  bool beyond = false;
  for (const auto& [name, result] : results) {
    if (const auto& amount = result.initial_ml) {
      beyond = beyond || amount->at_end;
      table.add({name, "liquid at first [ml]", figure(amount->mean, 0),
                 figure(amount->low, 0) + " to " + figure(amount->high, 0) + (amount->at_end ? " *" : "")});
    }
    for (const auto& [parameter, value] : result.parameters) {
      table.add({name, parameter, figure(value, 3), figure(std::nan(""), 0)});
    }
  }
  if (table.rows().size() == 1) {  // the header
    return;
  }
  report.heading("Estimates");
  report.table(table);
  if (beyond) {
    report.paragraph("* Or beyond the amounts that were asked about: the masks do not show it.");
  }
}

inline void add_overlap_chart(decant::HtmlReport& report, const decant::Recording& recording,
                              const std::vector<NamedResult>& results, bool prior) {
  decant::LineChart chart;
  chart.title = prior ? "Before the correction: what the model foretold of each frame"
                      : "After the correction: how well the simulation fits each frame";
  chart.x_label = "time [s]";
  chart.y_label = "intersection over union";
  chart.x_within = {0, recording.timestamps.back() - recording.timestamps.front()};
  chart.y_within = {0, 1};
  for (const auto& [name, result] : results) {
    decant::LineChart::Line line{name, times_from_start(recording, result.iou.size()), {}, false};
    for (std::size_t frame = 0; frame < result.iou.size(); ++frame) {
      const bool counts = frame >= result.overlays.size() ||
                          (prior ? result.overlays[frame].prior_counts : result.overlays[frame].counts);
      line.y.push_back(!counts ? std::numeric_limits<double>::quiet_NaN()
                               : (prior ? result.prior_iou : result.iou)[frame]);
    }
    chart.lines.push_back(std::move(line));
  }
  report.chart(chart);
}

inline void add_volume_charts(decant::HtmlReport& report, const decant::Recording& recording,
                              const std::vector<NamedResult>& results, const std::vector<std::vector<double>>& truth) {
  for (std::size_t k = 0; k < recording.bodies.size(); ++k) {
    decant::LineChart chart{"Liquid in the " + recording.bodies[k].name, "time [s]", "volume [ml]", {}, {}, {0}};
    for (const auto& [name, result] : results) {
      if (!result.volume_ml[k].empty()) {
        chart.lines.push_back(
            {name, times_from_start(recording, result.volume_ml[k].size()), result.volume_ml[k], false});
      }
    }
    if (chart.lines.empty()) {
      continue;
    }
    if (!truth[k].empty()) {
      chart.lines.push_back({"truth", times_from_start(recording, truth[k].size()), truth[k], true});
    }
    report.chart(chart);
  }
}

}  // namespace detail

/// Throws std::runtime_error where the file cannot be written. The results must have been run with keep_overlays.
inline void write_tracking_report(const std::filesystem::path& path, const decant::Recording& recording,
                                  const TrackingOptions& options, const std::vector<NamedResult>& results) {
  const std::vector<std::vector<double>> truth = detail::true_volumes(recording);
  decant::HtmlReport report("Tracking " + recording.name);
  std::string particles;
  for (const NamedResult& named : results) {
    particles = std::to_string(named.result.particles);
  }
  report.paragraph(std::to_string(recording.frames) + " frames in " +
                   detail::figure(recording.timestamps.back() - recording.timestamps.front(), 2) + " s, " +
                   std::to_string(recording.width) + " \u00d7 " + std::to_string(recording.height) + " px, " +
                   std::to_string(recording.cameras.size()) +
                   (recording.cameras.size() == 1 ? " camera; " : " cameras; ") + particles + " particles of " +
                   detail::figure(1e3 * options.spacing, 1) + " mm.");
  report.heading("Scores");
  detail::add_scores(report, recording, options, results, truth);
  detail::add_estimates(report, results);
  // with the rest of the page the file stays below 8 MB
  const std::vector<detail::FilmSource> sources = detail::film_sources(results);
  const detail::Overlays overlays = detail::draw_overlays(recording, {options.threads}, sources, 6'500'000);
  const std::vector<std::size_t> chosen =
      overlays.films.empty() ? std::vector<std::size_t>() : detail::telling_pictures(overlays, sources);
  if (!chosen.empty()) {
    report.heading("Observed against predicted");
    detail::add_overlays(report, recording, "Silhouettes after the correction", overlays, chosen);
  }
  report.heading("Over time");
  detail::add_overlap_chart(report, recording, results, false);
  detail::add_overlap_chart(report, recording, results, true);
  report.paragraph("Lines break where a frame has less than " +
                   std::to_string(decant::OverlapScoreSettings{}.least_union_px) +
                   " pixels of liquid, of which the mean takes no account either, and where no mask was there.");
  detail::add_volume_charts(report, recording, results, truth);
  if (!chosen.empty()) {
    report.heading("At chosen frames");
    detail::add_chosen_frames(report, overlays, sources, chosen);
  }
  report.write(path);
}

}  // namespace example
