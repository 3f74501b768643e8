// SPDX-License-Identifier: MIT
#pragma once

/// Weighs hypotheses about a recording against each other, frame by frame: what posterior probabilities come to over
/// time, and as JSON.

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

#include <decant/core/expects.hpp>
#include <decant/correction/map_filter_schenck2017.hpp>
#include <decant/correction/open_loop.hpp>
#include <decant/correction/silhouette_corrector.hpp>
#include <decant/correction/warp_field_schenck2017.hpp>
#include <decant/hypothesis/hypothesis_filter.hpp>
#include <decant/io/recording_reader.hpp>
#include <decant/tracking/image_likelihood.hpp>

#include "result_file.hpp"
#include "tracking_run.hpp"

namespace example {

/// Something that may be so, and the model as it starts if it is.
struct NamedModel {
  std::string name;
  TrackingModel model;
  double log_prior = 0;  ///< see HypothesisFilter
};

/// What may speak for or against a hypothesis, over all frames that it was followed for.
struct Evidence {
  std::size_t frames = 0;
  decant::Misfit before;           ///< of what was predicted before each frame's correction: what decides
  double differing_before_px = 0;  ///< the same by pixels, as the paper's likelihood takes it
  double differing_after_px = 0;   ///< after the correction
  double moved_ml_m = 0;           ///< how much liquid was moved times how far
  double relocated_ml = 0;         ///< taken from one place to another
};

/// What the frames of a recording said of hypotheses.
struct PosteriorCourse {
  static constexpr const char* none_name = "none_of_these";

  std::vector<std::string> names;                  ///< of the hypotheses
  std::vector<double> time;                        ///< of the frames [s]
  std::vector<std::vector<double>> log_posterior;  ///< by hypothesis and frame, see HypothesisFilter [nat]
  std::vector<double> log_none;                    ///< of "none of these", by frame
  std::vector<Evidence> evidence;                  ///< by hypothesis
  /// Of the one that was best in each frame, as it was predicted before that frame's correction, where options ask for
  /// them.
  std::vector<Overlay> overlays;
  std::vector<double> followed;        ///< how many hypotheses are, by frame
  std::size_t frames_run = 0;          ///< of all hypotheses together: those given up save theirs
  std::size_t scouted_frames_run = 0;  ///< in coarse particles, beforehand
  std::string status = "ok";

  /// Of a hypothesis by frame; of "none of these" after the last hypothesis.
  std::vector<std::vector<double>> probability() const {
    std::vector<std::vector<double>> result(names.size() + 1);
    for (std::size_t frame = 0; frame < time.size(); ++frame) {
      double largest = log_none[frame];
      for (const auto& of : log_posterior) {
        largest = std::max(largest, of[frame]);
      }
      double total = std::exp(log_none[frame] - largest);
      for (const auto& of : log_posterior) {
        total += std::exp(of[frame] - largest);
      }
      for (std::size_t k = 0; k <= names.size(); ++k) {
        const double own = k < names.size() ? log_posterior[k][frame] : log_none[frame];
        result[k].push_back(std::exp(own - largest) / total);
      }
    }
    return result;
  }

  /// After the last frame; of "none of these" after the last hypothesis.
  std::vector<double> last() const {
    std::vector<double> result;
    for (const auto& of : probability()) {
      result.push_back(of.empty() ? 0 : of.back());
    }
    return result;
  }

  std::vector<double> last_log_posterior() const {
    std::vector<double> result;
    for (const auto& of : log_posterior) {
      result.push_back(of.empty() ? 0 : of.back());
    }
    return result;
  }

  std::size_t best() const {
    const std::vector<double> of = last_log_posterior();
    return static_cast<std::size_t>(std::distance(of.begin(), std::max_element(of.begin(), of.end())));
  }

  /// After a frame, by hypothesis.
  std::vector<double> log_posterior_at(std::size_t frame) const {
    std::vector<double> result;
    for (const auto& of : log_posterior) {
      result.push_back(of[frame]);
    }
    return result;
  }
};

/// What the likelihood as printed makes of the pixels that differed from what was predicted (Schenck and Fox 2017:
/// every pixel counts by itself, with delta = 0.50001), by hypothesis; "none of these" is not asked about. One that was
/// given up has no probability.
inline std::vector<double> probability_schenck2017(const PosteriorCourse& course) {
  const double nats_per_pixel = decant::ImageLikelihood({.agreement = decant::agreement_schenck2017}).nats_per_pixel();
  std::vector<double> probability;
  double least = std::numeric_limits<double>::infinity(), total = 0;
  for (const Evidence& of : course.evidence) {
    least = of.frames == course.time.size() ? std::min(least, of.differing_before_px) : least;
  }
  for (const Evidence& of : course.evidence) {
    const bool to_the_end = of.frames == course.time.size();
    probability.push_back(to_the_end ? std::exp(nats_per_pixel * (least - of.differing_before_px)) : 0.0);
    total += probability.back();
  }
  for (double& each : probability) {
    each /= total;
  }
  return probability;
}

/// What it says of hypotheses how much liquid the corrector had to take from one place to another: a right one needs
/// little of that, whereas liquid that comes out where no hypothesis lets it has to be taken there again and again.
/// Shares are of all liquid that there is.
struct RelocationEvidence {
  double independent_errors = 20;  ///< in all, see decant::PosteriorSettings; fewer while little was seen
  double usual_share = 0.02;       ///< right hypotheses need no more: 0.3 to 1.8 % where a pipe branches
  double hopeless_share = 0.04;    ///< twice that: beyond it "none of these" is more probable
};

struct WeighingSettings {
  decant::HypothesisFilterSettings filter{};
  std::optional<RelocationEvidence> relocation{};  ///< nothing: only silhouettes count
};

/// @param progress is told the share that is done, 0 .. 1.
template <class CorrectorType>
PosteriorCourse weigh(const decant::Recording& recording, const std::vector<NamedModel>& hypotheses,
                      const TrackingOptions& options, const WeighingSettings& settings,
                      const std::function<void(double)>& progress) {
  using namespace decant;
  PosteriorCourse course;
  TrackingOptions each = options;
  each.threads = 1;  // simulations run side by side
  HypothesisFilter<Tracker<TrackingModel, CorrectorType>> filter(settings.filter, ThreadExecutor{{options.threads}});
  const std::size_t relocation = settings.relocation ? filter.add_source({}) : 0;
  std::vector<double> volume(hypotheses.size(), 0.0);  // of liquid [m^3]
  for (const NamedModel& hypothesis : hypotheses) {
    course.names.push_back(hypothesis.name);
    filter.add(tracker_for(recording, hypothesis.model, CorrectorType(), each), hypothesis.log_prior);
  }
  course.log_posterior.resize(hypotheses.size());
  course.evidence.resize(hypotheses.size());
  const double start = recording.timestamps.front() - (hypotheses.empty() ? 0 : hypotheses.front().model.time());
  for (std::size_t frame = 0; frame < recording.frames; ++frame) {
    const RecordedFrame recorded = frame_of(recording, frame, options);
    course.frames_run += filter.running();
    const FrameReport report = filter.track(recorded.at(recording.timestamps[frame] - start));
    if (!report.advanced()) {
      course.status = std::string(to_string(report.status)) + " in frame " + std::to_string(frame);
      break;
    }
    course.time.push_back(recording.timestamps[frame]);
    for (std::size_t k = 0; k < hypotheses.size(); ++k) {
      if (!filter.given_up(k)) {
        const FrameReport& own = filter.report(k);
        Evidence& evidence = course.evidence[k];
        ++evidence.frames;
        evidence.before = filter.posterior().misfit(k);
        evidence.differing_before_px += static_cast<double>(own.prior.differing_px());
        evidence.differing_after_px += static_cast<double>(own.posterior.differing_px());
        const double particle_ml = 1e6 * std::pow(filter.tracker(k).model().spacing(), 3);
        evidence.moved_ml_m += particle_ml * static_cast<double>(own.correction.moved) * own.correction.mean_shift;
        evidence.relocated_ml += 1e6 * own.relocated_volume;
        if (settings.relocation) {
          const double now = 1e-6 * particle_ml * static_cast<double>(filter.tracker(k).model().fluid().size());
          filter.observe(k, {own.relocated_volume, now - std::exchange(volume[k], now)}, relocation);
        }
      }
    }
    const double most = hypotheses.empty() ? 0 : *std::max_element(volume.begin(), volume.end());
    if (settings.relocation && most > 0) {
      const double share_shown =
          settings.filter.errors_after(filter.seen_seconds()) / settings.filter.posterior.independent_errors;
      filter.set_source(relocation, {settings.relocation->independent_errors * share_shown,
                                     settings.relocation->usual_share * most, settings.relocation->hopeless_share});
    }
    for (std::size_t k = 0; k < hypotheses.size(); ++k) {
      course.log_posterior[k].push_back(filter.log_posterior(k));
    }
    course.followed.push_back(static_cast<double>(filter.running()));
    course.log_none.push_back(filter.posterior().log_posterior_of_none());
    if (options.keep_overlays && !recording.cameras.empty()) {
      const auto& tracker = filter.tracker(filter.best());
      const bool has_mask = !recorded.masks.empty() && recorded.masks.front().camera == 0;
      course.overlays.push_back(overlay_of(tracker.predicted_before(0), has_mask ? &tracker.observed(0) : nullptr));
    }
    progress(static_cast<double>(frame + 1) / static_cast<double>(recording.frames));
  }
  return course;
}

/// The one by which questions are answered unless another is asked for.
inline const std::string default_method = "default";

/// How hypotheses may follow a recording, by the names that scripts use; those of the paper are as printed.
inline const std::vector<std::string>& weighing_methods() {
  static const std::vector<std::string> names{"open_loop", "map_filter", "warp_field", default_method};
  return names;
}

/// The same by name. Throws std::invalid_argument for another name.
inline PosteriorCourse weigh_by(const std::string& method, const decant::Recording& recording,
                                const std::vector<NamedModel>& hypotheses, const TrackingOptions& options,
                                const WeighingSettings& settings, const std::function<void(double)>& progress) {
  using namespace decant;
  if (method == "open_loop") {
    return weigh<OpenLoop<>>(recording, hypotheses, options, settings, progress);
  }
  if (method == "map_filter") {
    return weigh<MapFilterSchenck2017<>>(recording, hypotheses, options, settings, progress);
  }
  if (method == "warp_field") {
    return weigh<WarpFieldSchenck2017<>>(recording, hypotheses, options, settings, progress);
  }
  expects(method == default_method, "weigh_by: method", "open_loop, map_filter, warp_field or default", method);
  return weigh<SilhouetteCorrector<>>(recording, hypotheses, options, settings, progress);
}

/// The last frame's probabilities, by name.
inline nlohmann::json posterior_json(const PosteriorCourse& course) {
  nlohmann::json json;
  const std::vector<double> last = course.last();
  for (std::size_t k = 0; k < course.names.size(); ++k) {
    json[course.names[k]] = number_json(last[k]);
  }
  json[PosteriorCourse::none_name] = number_json(last.back());
  return json;
}

inline nlohmann::json evidence_json(const PosteriorCourse& course) {
  nlohmann::json json;
  for (std::size_t k = 0; k < course.names.size(); ++k) {
    const Evidence& of = course.evidence[k];
    json[course.names[k]] = {
        {"squared_before", number_json(of.before.squared)}, {"measured", number_json(of.before.measured)},
        {"differing_before_px", of.differing_before_px},    {"differing_after_px", of.differing_after_px},
        {"moved_ml_m", number_json(of.moved_ml_m)},         {"relocated_ml", number_json(of.relocated_ml)}};
  }
  return json;
}

inline nlohmann::json course_json(const PosteriorCourse& course) {
  nlohmann::json json;
  json["time_s"] = column_json(course.time);
  const std::vector<std::vector<double>> probability = course.probability();
  for (std::size_t k = 0; k < course.names.size(); ++k) {
    json[course.names[k]] = column_json(probability[k]);
  }
  json[PosteriorCourse::none_name] = column_json(probability.back());
  return json;
}

}  // namespace example
