// SPDX-License-Identifier: MIT
#pragma once

/// What the workflow for missing effects found, as a page for a browser: the recording against the model as it is and
/// against the mended one.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/core/parallel.hpp>
#include <decant/discovery/disagreement_place.hpp>
#include <decant/discovery/missing_effect.hpp>
#include <decant/io/report.hpp>
#include <decant/io/table.hpp>
#include <decant/tracking/overlap.hpp>
#include <decant/tracking/overlap_score.hpp>

#include "missing_effect_output.hpp"
#include "overlay_pictures.hpp"
#include "recorded_interaction.hpp"
#include "where_map.hpp"

namespace example {

/// A run of a recording's model beside what was read and what its first camera saw, if there is one.
struct ModelView {
  decant::OverlapScore overlap{};
  std::vector<double> iou{};                  ///< by frame that is compared; NaN where nothing was seen
  std::vector<std::vector<double>> volume{};  ///< by body and frame [ml]; empty for bodies that hold nothing
  std::vector<std::vector<double>> read{};    ///< by sensor and frame
  std::vector<Overlay> overlays{};            ///< by frame
};

inline ModelView view_of_run(const RecordedInteraction& of, const decant::ModelRun& run) {
  ModelView view;
  view.volume.resize(of.recording.bodies.size());
  view.read.resize(of.seen.readings.size());
  const auto seen = of.cameras.empty() ? std::vector<std::optional<decant::Mask>>()
                                       : detail::believed_masks(of.recording, of.cameras.front(), of.frames);
  const auto compare = [&](std::size_t frame, EffectModel& model, std::span<const decant::Mask> predicted,
                           std::span<const double> read) {
    for (std::size_t sensor = 0; sensor < read.size(); ++sensor) {
      view.read[sensor].push_back(read[sensor]);
    }
    for (const auto& contained : model.step(0).contents) {
      view.volume[contained.body].push_back(1e6 * contained.volume);
    }
    if (seen.empty()) {
      return;
    }
    const decant::Mask* mask = seen[frame] ? &*seen[frame] : nullptr;
    const decant::Overlap overlap =
        mask != nullptr ? decant::overlap(predicted.front(), *mask) : decant::Overlap();  // of nothing
    view.overlap.add(overlap);
    view.iou.push_back(overlap.iou());
    Overlay overlay = overlay_of(predicted.front(), mask);
    overlay.counts = mask != nullptr && overlap.union_px() >= decant::OverlapScoreSettings{}.least_union_px;
    view.overlays.push_back(std::move(overlay));
  };
  of.model.watch(run, compare);
  return view;
}

/// A model to be compared with recordings, and how it does with each.
struct ComparedModel {
  std::string name;
  std::vector<decant::AppliedEffect> effects{};
  std::vector<ModelView> views{};  ///< by recording
};

/// Runs the model as it is, and with what was found or, where nothing explains the gap, with what comes nearest, on all
/// cores.
inline std::vector<ComparedModel> compared_models(const std::vector<const RecordedInteraction*>& interactions,
                                                  const decant::MissingEffect& result) {
  std::vector<ComparedModel> models{{"the model as it is"}};
  std::vector<decant::RefinedEffect> added = result.found;
  if (added.empty() && result.nearest() != nullptr) {
    added.push_back(*result.nearest());
  }
  if (!added.empty()) {
    ComparedModel& with = models.emplace_back();
    with.effects = result.surroundings;
    for (const decant::RefinedEffect& each : added) {
      with.name += with.name.empty() ? "with " : " and ";
      with.name += detail::effect_words(result.judged, each);
      with.effects.push_back(each.applied());
    }
  }
  for (ComparedModel& model : models) {
    model.views.resize(interactions.size());
  }
  const auto runs = static_cast<decant::Index>(models.size() * interactions.size());
  decant::parallel_jobs(runs, {0}, [&](decant::Index number) {
    const auto model = static_cast<std::size_t>(number) / interactions.size();
    const auto which = static_cast<std::size_t>(number) % interactions.size();
    models[model].views[which] = view_of_run(*interactions[which], {models[model].effects, 1, false});
  });
  return models;
}

/// Where disagreements of the recordings that were learnt from are, by a run of each one's model, on all cores.
/// @param interactions those that were learnt from first.
inline NamedPlaces named_places(const std::vector<const RecordedInteraction*>& interactions,
                                const decant::MissingEffect& result) {
  NamedPlaces places(result.where.size());
  decant::parallel_jobs(static_cast<decant::Index>(places.size()), {0}, [&](decant::Index number) {
    const auto which = static_cast<std::size_t>(number);
    for (const auto& seen : decant::places_of(result.where[which], interactions[which]->model)) {
      places[which].emplace_back();
      if (seen && seen->body < interactions[which]->recording.bodies.size()) {
        places[which].back() = NamedPlace{*seen, interactions[which]->recording.bodies[seen->body].name};
      }
    }
  });
  return places;
}

/// Root mean square of what a model reads too much or too little of; NaN where the recording has no reading.
inline double reading_error(const decant::ReadingSeries& recorded, const std::vector<double>& read) {
  double sum = 0;
  int count = 0;
  for (std::size_t k = 0; k < std::min(recorded.size(), read.size()); ++k) {
    if (recorded.seen(k)) {
      sum += (read[k] - recorded.value(k)) * (read[k] - recorded.value(k));
      ++count;
    }
  }
  return count > 0 ? std::sqrt(sum / count) : std::numeric_limits<double>::quiet_NaN();
}

/// How far models are from what sensors read.
inline decant::Table readings_table(const std::vector<ComparedModel>& models,
                                    const std::vector<const RecordedInteraction*>& interactions) {
  decant::Table table({"recording", "sensor", "model", "off by, root mean square, in SI units"});
  for (std::size_t k = 0; k < interactions.size(); ++k) {
    for (std::size_t sensor = 0; sensor < interactions[k]->seen.readings.size(); ++sensor) {
      const decant::ReadingSeries& recorded = interactions[k]->seen.readings[sensor];
      for (const ComparedModel& model : models) {
        table.add({interactions[k]->recording.name, recorded.name(), model.name,
                   three_digits(reading_error(recorded, model.views[k].read[sensor]))});
      }
    }
  }
  return table;
}

/// The same for scripts: before is the model as it is, after the one with what was found.
inline nlohmann::json readings_json(const std::vector<ComparedModel>& models,
                                    const std::vector<const RecordedInteraction*>& interactions) {
  nlohmann::json json = nlohmann::json::array();
  for (std::size_t k = 0; !models.empty() && k < interactions.size(); ++k) {
    for (std::size_t sensor = 0; sensor < interactions[k]->seen.readings.size(); ++sensor) {
      const decant::ReadingSeries& recorded = interactions[k]->seen.readings[sensor];
      const auto error = [&](const ComparedModel& model) {
        return number_json(reading_error(recorded, model.views[k].read[sensor]));
      };
      json.push_back({{"recording", interactions[k]->recording.name},
                      {"sensor", recorded.name()},
                      {"before", error(models.front())},
                      {"after", error(models.back())}});
    }
  }
  return json;
}

namespace detail {

/// Of recordings with a camera.
inline decant::Table overlap_table(const std::vector<ComparedModel>& models,
                                   const std::vector<const RecordedInteraction*>& interactions) {
  using decant::detail::fixed_text;
  decant::Table table({"recording", "model", "IoU, mean over frames", "IoU, pooled", "at the end [ml]"});
  for (std::size_t k = 0; k < interactions.size(); ++k) {
    if (interactions[k]->cameras.empty()) {
      continue;
    }
    for (const ComparedModel& model : models) {
      const ModelView& view = model.views[k];
      std::string contents;
      for (std::size_t body = 0; body < view.volume.size(); ++body) {
        if (!view.volume[body].empty()) {
          contents += contents.empty() ? "" : ", ";
          contents += interactions[k]->recording.bodies[body].name;
          contents += ' ';
          contents += fixed_text(view.volume[body].back(), 0);
        }
      }
      table.add({interactions[k]->recording.name, model.name, fixed_text(view.overlap.mean_over_frames(), 3),
                 fixed_text(view.overlap.pooled_over_pixels(), 3), contents});
    }
  }
  return table;
}

inline decant::BarChart candidates_chart(const Effects& effects, const decant::MissingEffect& result) {
  decant::BarChart chart{"What of the gap each effect explains", "", "of what is reducible [%]", {}, {{"", {}}}, {100}};
  for (const decant::EffectStanding& each : result.judgement.standings) {
    if (chart.groups.size() < 8) {
      const auto refined = std::find_if(result.refined.begin(), result.refined.end(),
                                        [&](const auto& other) { return other.judged == each.effect; });
      chart.groups.push_back(effects.at(each.effect).name);
      chart.bars.front().heights.push_back(
          100 * std::max(0.0, refined != result.refined.end() ? refined->share : each.share));
    }
  }
  return chart;
}

/// What a sensor read, and what the models read of the first recording.
inline decant::LineChart sensor_chart(const RecordedInteraction& first, std::size_t sensor,
                                      const std::vector<double>& times, const std::vector<ComparedModel>& models) {
  decant::LineChart chart{"Read by a sensor", "time [s]", first.seen.readings[sensor].name() + ", in SI units", {}};
  chart.lines.push_back({"recorded", times, first.seen.readings[sensor].values()});
  for (const ComparedModel& model : models) {
    const std::vector<double>& read = model.views.front().read[sensor];
    chart.lines.push_back(
        {model.name, {times.begin(), times.begin() + static_cast<std::ptrdiff_t>(read.size())}, read});
  }
  return chart;
}

/// Where the first camera's picture is off, over all times, among the bodies as they are when the heaviest disagreement
/// begins. Nothing is added where it is off nowhere.
inline void add_where_map(decant::HtmlReport& report, const RecordedInteraction& of,
                          const std::vector<decant::Disagreement>& where) {
  const WhereMap map = where_map(where, of.recording.width, of.recording.height);
  if (!map.begin) {
    return;
  }
  std::size_t frame = 0;
  for (const std::size_t each : of.frames) {
    frame = of.recording.timestamps[each] <= *map.begin + 1e-9 ? each : frame;
  }
  const Region all{0, 0, of.recording.height, of.recording.width};
  report.picture(where_picture(draw_bodies(of.recording, {frame}, all, {1}, of.cameras.front()).front(), map),
                 of.recording.name +
                     ": amber is liquid that the model does not have, blue is where it has too much; "
                     "the stronger, the farther beyond chance, all times together. The bodies are as "
                     "they are at " +
                     decant::detail::fixed_text(of.recording.timestamps[frame], 2) +
                     " s, when the heaviest begins: where the ring is.");
}

/// Films and charts of the first recording.
inline void add_first_recording(decant::HtmlReport& report, const RecordedInteraction& first,
                                const std::vector<ComparedModel>& models) {
  std::vector<double> times;
  for (const std::size_t frame : first.frames) {
    times.push_back(first.recording.timestamps[frame] - first.recording.timestamps.front());
  }
  report.heading("Seen and predicted: " + first.recording.name);
  for (std::size_t sensor = 0; sensor < first.seen.readings.size(); ++sensor) {
    report.chart(sensor_chart(first, sensor, times, models));
  }
  if (first.cameras.empty()) {
    return;
  }
  std::vector<FilmSource> sources;
  decant::LineChart overlap{"Overlap with what was seen", "time [s]", "IoU", {}};
  overlap.y_within = {0, 1};
  decant::LineChart contents{"Liquid in each body", "time [s]", "ml", {}};
  for (const ComparedModel& model : models) {
    const ModelView& view = model.views.front();
    sources.push_back({model.name, &view.overlays, [&view](std::size_t frame) {
                         return view.overlays[frame].counts ? "IoU " + figure(view.iou[frame], 3)
                                                            : std::string("nothing seen, or little");
                       }});
    overlap.lines.push_back(
        {model.name, {times.begin(), times.begin() + static_cast<std::ptrdiff_t>(view.iou.size())}, view.iou});
    for (std::size_t body = 0; body < view.volume.size(); ++body) {
      if (!view.volume[body].empty()) {
        contents.lines.push_back({first.recording.bodies[body].name + ", " + model.name,
                                  {times.begin(), times.begin() + static_cast<std::ptrdiff_t>(view.iou.size())},
                                  view.volume[body]});
      }
    }
  }
  const Overlays overlays = draw_overlays(first.recording, {1}, sources, 6'500'000, first.frames);
  if (!overlays.films.empty()) {
    const std::vector<std::size_t> chosen = telling_pictures(overlays, sources);
    add_overlays(report, first.recording, "Seen against predicted from the start on, without looking", overlays,
                 chosen);
    report.chart(overlap);
    report.chart(contents);
    add_chosen_frames(report, overlays, sources, chosen);
  }
}

}  // namespace detail

/// @param interactions those that were learnt from, the first one's films are shown, then those held out.
/// @param learnt how many of them were learnt from. @param models of compared_models. @param references how many
/// recordings there were in which nothing is missing. @param places of named_places.
inline void write_missing_effect_report(const std::string& file,
                                        const std::vector<const RecordedInteraction*>& interactions, std::size_t learnt,
                                        const std::vector<ComparedModel>& models, const decant::MissingEffect& result,
                                        std::size_t references, const NamedPlaces& places) {
  const std::vector<decant::Effect>& effects = result.judged;
  decant::HtmlReport report("What the model lacks");
  report.paragraph(missing_effect_sentence(effects, result));
  for (const decant::RefinedEffect& each : result.found) {
    const std::string code = detail::effect_code(effects, each);
    report.paragraph(effects[each.judged].words() + ": " + effects[each.judged].meaning + "." +
                     (code.empty() ? "" : " In the model: " + code));
  }
  if (!result.surroundings.empty()) {
    report.paragraph(surroundings_sentence(effects, result));
  }
  report.heading("The gap");
  report.table(gap_table(result));
  const auto any = [&](auto&& have) { return std::any_of(interactions.begin(), interactions.end(), have); };
  if (any([](const RecordedInteraction* each) { return !each->cameras.empty(); })) {
    report.paragraph(
        "Runs from the start on, which no picture corrects: their overlap with what was seen is that of a "
        "forecast.");
    report.table(detail::overlap_table(models, interactions));
  }
  if (any([](const RecordedInteraction* each) { return !each->seen.readings.empty(); })) {
    report.paragraph("What sensors read, and what a run from the start on has them read.");
    report.table(readings_table(models, interactions));
  }
  if (result.judgement.has_gap()) {
    report.bar_chart(detail::candidates_chart(effects, result));
  }
  detail::add_first_recording(report, *interactions.front(), models);
  report.heading("Where");
  std::vector<std::string> names;
  for (std::size_t k = 0; k < learnt; ++k) {
    names.push_back(interactions[k]->recording.name);
    detail::add_where_map(report, *interactions[k], result.where[k]);
  }
  const bool somewhere =
      std::any_of(result.where.begin(), result.where.end(), [](const auto& each) { return !each.empty(); });
  if (somewhere) {
    report.paragraph(
        "How far off something is one camera does not say: places are as far off as the model's liquid is that is "
        "seen nearest to them.");
    report.table(where_table(names, result, places));
  } else if (is_diffuse(result)) {
    report.paragraph("The gap is diffuse: nothing is off by much anywhere, but much together.");
  } else if (!interactions.front()->cameras.empty()) {
    report.paragraph("Nowhere in particular: no part of the picture is off by much.");
  }
  std::vector<std::vector<std::string>> sensors;
  for (std::size_t k = 0; k < learnt; ++k) {
    sensors.push_back(interactions[k]->sensors());
  }
  if (std::any_of(result.where_read.begin(), result.where_read.end(), [](const auto& each) { return !each.empty(); })) {
    report.table(where_read_table(names, sensors, result));
  }
  report.heading("Candidates");
  report.table(candidates_table(effects, result));
  report.heading("What is tolerated");
  report.paragraph(references_sentence(references, result));
  report.table(tolerated_table(effects));
  report.heading("What would have been seen");
  report.paragraph(
      "Strengths beyond which an effect would have been told from chance in about nine of ten recordings "
      "such as these; none where even the strongest that were simulated would not.");
  report.table(smallest_seen_table(effects, result));
  report.write(file);
}

}  // namespace example
