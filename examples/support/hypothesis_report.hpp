// SPDX-License-Identifier: MIT
#pragma once

/// What became of hypotheses over a recording, as charts and films of a report.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <decant/hypothesis/value_estimate.hpp>
#include <decant/io/report.hpp>

#include "hypothesis_run.hpp"
#include "overlay_pictures.hpp"

namespace example {

/// [s] from the first frame on, as films count.
inline std::vector<double> times_of(const PosteriorCourse& course) {
  std::vector<double> times;
  for (const double time : course.time) {
    times.push_back(time - course.time.front());
  }
  return times;
}

/// The posterior over time, as in the figures of Schenck and Fox (2017). @param unit of names, such as " % full".
/// @param shown which hypotheses are; beside "none of these".
inline decant::LineChart course_chart(
    const std::string& title, const PosteriorCourse& course, const std::string& unit = {},
    const std::function<bool(std::size_t)>& shown = [](std::size_t) { return true; }) {
  decant::LineChart chart{title, "time [s]", "probability", {}, {}, {0, 1}};
  const std::vector<std::vector<double>> probability = course.probability();
  for (std::size_t k = 0; k < course.names.size(); ++k) {
    if (shown(k)) {
      chart.lines.push_back({course.names[k] + unit, times_of(course), probability[k]});
    }
  }
  chart.lines.push_back({"none of these", times_of(course), probability.back(), true});
  return chart;
}

/// How many hypotheses were worth following.
inline decant::LineChart followed_chart(const std::vector<std::pair<std::string, const PosteriorCourse*>>& courses) {
  decant::LineChart chart{"Hypotheses that are still followed", "time [s]", "number", {}, {}, {0}};
  for (const auto& [name, course] : courses) {
    chart.lines.push_back({name, times_of(*course), course->followed});
  }
  return chart;
}

/// A quantity with its density at some time.
struct NamedDensity {
  std::string name;
  decant::ValueDensity density;
};

/// Densities over [from, to], in a unit of which the values have `per_value`; their medians and intervals are in
/// tables.
inline decant::LineChart density_chart(const std::string& title, const std::string& x_label, const std::string& y_label,
                                       const std::vector<NamedDensity>& densities, double from, double to,
                                       double per_value = 1) {
  constexpr int points = 400;
  decant::LineChart chart{title, x_label, y_label, {}, {per_value * from, per_value * to}, {0}, false};
  for (const NamedDensity& each : densities) {
    decant::LineChart::Line line{each.name, {}, {}};
    for (int k = 0; k <= points; ++k) {
      const double value = std::lerp(from, to, static_cast<double>(k) / points);
      line.x.push_back(per_value * value);
      line.y.push_back(each.density.density(value) / per_value);
    }
    chart.lines.push_back(std::move(line));
  }
  return chart;
}

/// Adds median and interval over time of a quantity. @param density_at of a frame; nothing where nothing is known.
inline void add_estimate_lines(decant::LineChart& chart, const std::string& name, const PosteriorCourse& course,
                               const std::function<std::optional<decant::ValueDensity>(std::size_t)>& density_at,
                               double confidence, double per_value = 1) {
  decant::LineChart::Line median{name, times_of(course), {}},
      bounds{name + ", " + std::to_string(std::lround(100 * confidence)) + " % interval",
             {},
             {},
             true,
             static_cast<int>(chart.lines.size())};
  std::vector<double> low, high;
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t frame = 0; frame < course.time.size(); ++frame) {
    const std::optional<decant::ValueDensity> density = density_at(frame);
    const auto interval = density ? density->interval(confidence) : std::pair(nothing, nothing);
    median.y.push_back(density ? per_value * density->quantile(0.5) : nothing);
    low.push_back(per_value * interval.first);
    high.push_back(per_value * interval.second);
  }
  bounds.x = median.x;
  bounds.y = low;
  bounds.x.push_back(nothing);  // the line breaks between its two parts
  bounds.y.push_back(nothing);
  bounds.x.insert(bounds.x.end(), median.x.begin(), median.x.end());
  bounds.y.insert(bounds.y.end(), high.begin(), high.end());
  chart.lines.push_back(std::move(median));
  chart.lines.push_back(std::move(bounds));
}

/// Films of the most probable hypothesis of each course, with some of their frames below. Nothing where overlays were
/// not asked for.
inline void add_best_overlays(decant::HtmlReport& report, const decant::Recording& recording,
                              const std::vector<std::pair<std::string, const PosteriorCourse*>>& courses,
                              const std::string& unit, decant::Threads threads) {
  std::vector<detail::FilmSource> sources;
  for (const auto& [name, course] : courses) {
    if (course->overlays.empty()) {
      continue;
    }
    sources.push_back({name, &course->overlays, [course = course, unit](std::size_t frame) {
                         if (frame >= course->time.size()) {
                           return course->status;
                         }
                         const std::vector<double> log_posterior = course->log_posterior_at(frame);
                         const auto best = std::max_element(log_posterior.begin(), log_posterior.end());
                         return course->names[static_cast<std::size_t>(std::distance(log_posterior.begin(), best))] +
                                unit;
                       }});
  }
  // with the rest of the page the file stays below 8 MB
  const detail::Overlays overlays = detail::draw_overlays(recording, threads, sources, 6'500'000);
  if (overlays.films.empty()) {
    return;
  }
  report.heading("Observed against predicted");
  const std::vector<std::size_t> chosen = detail::telling_pictures(overlays, sources);
  detail::add_overlays(report, recording,
                       "Silhouettes of the hypothesis that was the most probable at the time, as it was predicted "
                       "before the frame's correction, which is what hypotheses are judged by",
                       overlays, chosen);
  detail::add_chosen_frames(report, overlays, sources, chosen);
}

}  // namespace example
