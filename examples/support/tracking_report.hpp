// SPDX-License-Identifier: MIT
#pragma once

/// How methods tracked a recording, as one HTML file: scores, charts, and silhouettes to look through.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/camera/depth_buffer.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/camera/posed_camera.hpp>
#include <decant/core/image.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/png.hpp>
#include <decant/io/recording_truth.hpp>
#include <decant/io/report.hpp>
#include <decant/io/table.hpp>

#include "tracking_run.hpp"

namespace example {

struct NamedResult {
  std::string name;
  TrackingResult result;
};

namespace detail {

/// Colours of overlays, by their index in the pictures. Liquid that both have is dark; what they differ in is told
/// apart by brightness, too, for those who see few colours and for printers.
enum OverlayColour : std::uint8_t { background, body, body_edge, both, observed_only, predicted_only };
inline const std::vector<std::array<std::uint8_t, 3>>& overlay_colours() {
  static const std::vector<std::array<std::uint8_t, 3>> colours{{255, 255, 255}, {233, 237, 241}, {178, 187, 197},
                                                                {58, 69, 82},    {245, 158, 11},  {38, 132, 222}};
  return colours;
}

/// A part of an image [px].
struct Region {
  decant::Index top = 0, left = 0, height = 0, width = 0;
};

/// What of the image has liquid in any frame of any method, with some of what is around it; all of it if nothing has.
inline Region region_of_liquid(const std::vector<NamedResult>& results, decant::Index height, decant::Index width) {
  decant::Index top = height, bottom = 0, left = width, right = 0;
  for (const NamedResult& named : results) {
    for (const Overlay& overlay : named.result.overlays) {
      if (overlay.label.size() > 0) {
        top = std::min(top, overlay.top);
        bottom = std::max(bottom, overlay.top + overlay.label.rows());
        left = std::min(left, overlay.left);
        right = std::max(right, overlay.left + overlay.label.cols());
      }
    }
  }
  if (bottom <= top) {
    return {0, 0, height, width};
  }
  const decant::Index margin = 8 + std::max(bottom - top, right - left) / 12;
  top = std::max<decant::Index>(0, top - margin);
  left = std::max<decant::Index>(0, left - margin);
  bottom = std::min(height, bottom + margin);
  right = std::min(width, right + margin);
  return {top, left, bottom - top, right - left};
}

/// Where the bodies are in the picture: flat, with an edge where something far lies beside something near.
inline decant::Image<std::uint8_t> bodies_from_depth(const decant::Image<float>& depth, const Region& region) {
  constexpr float edge = 0.012F;  // [m]: more than a wall seen at a slant changes from pixel to pixel
  decant::Image<std::uint8_t> picture(region.height, region.width);
  for (decant::Index row = 0; row < region.height; ++row) {
    for (decant::Index column = 0; column < region.width; ++column) {
      const decant::Index v = row + region.top, u = column + region.left;
      const float here = depth(v, u);
      bool beside_far = false;
      for (const auto& [dv, du] : {std::pair(-1, 0), std::pair(1, 0), std::pair(0, -1), std::pair(0, 1)}) {
        const decant::Index y = v + dv, x = u + du;
        beside_far =
            beside_far || (y >= 0 && y < depth.rows() && x >= 0 && x < depth.cols() && depth(y, x) > here + edge);
      }
      picture(row, column) = !std::isfinite(here) ? background : beside_far ? body_edge : body;
    }
  }
  return picture;
}

/// The bodies as the first camera sees them, frame after frame.
template <class Camera>
std::vector<decant::Image<std::uint8_t>> draw_bodies(const decant::Recording& recording, const Camera& camera,
                                                     const std::vector<std::size_t>& frames, const Region& region,
                                                     decant::Threads threads) {
  std::vector<decant::BoundingVolumeHierarchy> surfaces;
  for (const auto& each : recording.bodies) {
    surfaces.emplace_back(each.mesh);
  }
  decant::DepthBuffer<Camera> buffer{decant::PosedCamera<Camera>(camera)};
  std::vector<decant::Image<std::uint8_t>> pictures;
  for (const std::size_t frame : frames) {
    buffer.set_camera_pose(recording.cameras.front().view(frame).camera_from_world);
    buffer.clear();
    for (std::size_t k = 0; k < surfaces.size(); ++k) {
      buffer.draw(surfaces[k], recording.bodies[k].motion.at(recording.timestamps[frame]), threads);
    }
    pictures.push_back(bodies_from_depth(buffer.depth(), region));
  }
  return pictures;
}

inline std::vector<decant::Image<std::uint8_t>> draw_bodies(const decant::Recording& recording,
                                                            const std::vector<std::size_t>& frames,
                                                            const Region& region, decant::Threads threads) {
  const auto& view = recording.cameras.front().view(0);
  const auto camera = camera_of(view, recording.width, recording.height);
  return view.distorted() ? draw_bodies(recording, camera, frames, region, threads)
                          : draw_bodies(recording, camera.pinhole(), frames, region, threads);
}

/// The bodies' picture with the liquid on top.
inline decant::PalettePicture overlay_picture(decant::Image<std::uint8_t> bodies, const Overlay& overlay,
                                              const Region& region) {
  constexpr std::array<std::uint8_t, 4> colour{background, observed_only, predicted_only, both};
  for (decant::Index row = 0; row < overlay.label.rows(); ++row) {
    for (decant::Index column = 0; column < overlay.label.cols(); ++column) {
      if (const std::uint8_t label = overlay.label(row, column); label != 0) {
        bodies(row + overlay.top - region.top, column + overlay.left - region.left) = colour[label];
      }
    }
  }
  return {std::move(bodies), overlay_colours()};
}

/// At most `count` of the frames, spread evenly over those in which the camera saw liquid. Where it saw none, over all.
inline std::vector<std::size_t> telling_frames(const std::vector<Overlay>& overlays, std::size_t count) {
  std::vector<std::size_t> candidates, all;
  for (std::size_t frame = 0; frame < overlays.size(); ++frame) {
    const auto& label = overlays[frame].label;
    const auto observed = (label.unaryExpr([](std::uint8_t l) { return std::uint8_t(l & Overlay::observed); }) != 0);
    all.push_back(frame);
    if (observed.count() >= decant::OverlapScoreSettings{}.least_union_px) {
      candidates.push_back(frame);
    }
  }
  candidates = candidates.empty() ? all : candidates;
  std::vector<std::size_t> chosen;
  for (std::size_t k = 0; k < count && !candidates.empty(); ++k) {
    const std::size_t frame = candidates[count < 2 ? 0 : k * (candidates.size() - 1) / (count - 1)];
    if (chosen.empty() || chosen.back() != frame) {
      chosen.push_back(frame);
    }
  }
  return chosen;
}

/// A dash for what is not known; long numbers in groups of three digits.
inline std::string figure(double value, int digits) {
  if (!std::isfinite(value)) {
    return "\u2013";
  }
  std::string text = decant::detail::fixed_text(std::abs(value), digits);
  const bool zero = text.find_first_of("123456789") == std::string::npos;  // after rounding
  const std::size_t whole = std::min(text.find('.'), text.size());
  for (std::size_t k = whole; whole > 4 && k > 3; k -= 3) {
    text.insert(k - 3, "\u202f");
  }
  return (value < 0 && !zero ? "\u2212" : "") + text;
}

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

inline std::vector<double> times_from_start(const decant::Recording& recording, std::size_t count) {
  std::vector<double> times;
  for (std::size_t frame = 0; frame < count; ++frame) {
    times.push_back(recording.timestamps[frame] - recording.timestamps.front());
  }
  return times;
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

/// Every method's overlays, drawn and packed.
struct Overlays {
  std::vector<std::size_t> frames{};  ///< those that are drawn
  std::vector<decant::HtmlReport::Film> films{};
};

inline std::string overlay_note(const TrackingResult& result, std::size_t frame) {
  if (frame >= result.overlays.size()) {
    return result.status;
  }
  if (!result.overlays[frame].has_mask) {
    return "no mask";
  }
  return result.overlays[frame].counts ? "IoU " + figure(result.iou[frame], 3) : "little liquid";
}

/// @param byte_limit of all pictures as text; where every frame would take more, only every second, third ... is kept.
inline Overlays draw_overlays(const decant::Recording& recording, const TrackingOptions& options,
                              const std::vector<NamedResult>& results, std::size_t byte_limit) {
  Overlays out;
  std::size_t count = 0;
  for (const NamedResult& named : results) {
    count = std::max(count, named.result.overlays.size());
  }
  for (std::size_t frame = 0; frame < count; ++frame) {
    out.frames.push_back(frame);
  }
  if (count == 0) {
    return out;
  }
  const Region region = region_of_liquid(results, recording.height, recording.width);
  const auto bodies = draw_bodies(recording, out.frames, region, {options.threads});
  const std::vector<double> times = times_from_start(recording, count);
  std::size_t bytes = 0;
  for (const auto& [name, result] : results) {
    decant::HtmlReport::Film film{name, {}};
    for (std::size_t frame = 0; frame < count; ++frame) {
      // a method that stopped early leaves the bodies alone
      const Overlay overlay = frame < result.overlays.size() ? result.overlays[frame] : Overlay();
      film.frames.push_back({times[frame], decant::png_bytes(overlay_picture(bodies[frame], overlay, region)),
                             "frame " + std::to_string(frame) + " \u00b7 " + overlay_note(result, frame)});
      bytes += (film.frames.back().png.size() + 2) / 3 * 4;
    }
    out.films.push_back(std::move(film));
  }
  if (const std::size_t step = (bytes + byte_limit - 1) / byte_limit; step > 1) {
    const auto thin = [step](auto& list) {
      std::size_t kept = 0;
      for (std::size_t k = 0; k < list.size(); k += step) {
        std::swap(list[kept++], list[k]);
      }
      list.resize(kept);
    };
    thin(out.frames);
    for (auto& film : out.films) {
      thin(film.frames);
    }
  }
  return out;
}

/// The pictures of the films that tell most, by their places in them.
inline std::vector<std::size_t> telling_pictures(const Overlays& overlays, const std::vector<NamedResult>& results) {
  const TrackingResult* longest = &results.front().result;
  for (const NamedResult& named : results) {
    longest = named.result.overlays.size() > longest->overlays.size() ? &named.result : longest;
  }
  std::vector<Overlay> shown;
  for (const std::size_t frame : overlays.frames) {
    shown.push_back(longest->overlays[frame]);
  }
  return telling_frames(shown, 6);
}

inline void add_overlays(decant::HtmlReport& report, const decant::Recording& recording, const Overlays& overlays,
                         const std::vector<std::size_t>& chosen) {
  const auto& colours = overlay_colours();
  report.legend({{"liquid in both", colours[both]},
                 {"observed, not predicted", colours[observed_only]},
                 {"predicted, not observed", colours[predicted_only]},
                 {"bodies", colours[body]}});
  const std::size_t step = overlays.frames.size() > 1 ? overlays.frames[1] : 1;
  report.films(overlays.films,
               std::string("Silhouettes after the correction") +
                   (recording.cameras.size() > 1 ? ", first camera" : "") +
                   (step > 1 ? ", one frame in " + std::to_string(step) : "") +
                   ". The arrow keys go from frame to frame; the dotted line in the charts marks the time, and a click "
                   "on a chart goes there.",
               chosen[chosen.size() / 2]);
}

inline void add_chosen_frames(decant::HtmlReport& report, const Overlays& overlays,
                              const std::vector<NamedResult>& results, const std::vector<std::size_t>& chosen) {
  std::vector<std::string> columns;
  for (const std::size_t k : chosen) {
    columns.push_back(figure(overlays.films.front().frames[k].time, 2) + " s");
  }
  std::vector<decant::HtmlReport::GridRow> rows;
  for (std::size_t method = 0; method < results.size(); ++method) {
    decant::HtmlReport::GridRow row{results[method].name, {}};
    for (const std::size_t k : chosen) {
      row.cells.push_back({overlays.films[method].frames[k].png,
                           overlay_note(results[method].result, overlays.frames[k]),
                           decant::HtmlReport::film_link(method, k)});
    }
    rows.push_back(std::move(row));
  }
  report.grid(columns, rows, "Frames spread over those in which liquid was seen; a click takes the film there.");
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
  const detail::Overlays overlays = detail::draw_overlays(recording, options, results, 6'500'000);
  const std::vector<std::size_t> chosen =
      overlays.films.empty() ? std::vector<std::size_t>() : detail::telling_pictures(overlays, results);
  if (!chosen.empty()) {
    report.heading("Observed against predicted");
    detail::add_overlays(report, recording, overlays, chosen);
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
    detail::add_chosen_frames(report, overlays, results, chosen);
  }
  report.write(path);
}

}  // namespace example
