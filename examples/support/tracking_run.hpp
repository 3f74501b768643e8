// SPDX-License-Identifier: MIT
#pragma once

/// Runs a tracker over a recording and scores it: on the frame just assimilated, before its correction, and ahead.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <decant/boundary/cavity.hpp>
#include <decant/camera/distorted_pinhole_camera.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/force/linear_drag.hpp>
#include <decant/hypothesis/hypothesis_filter.hpp>
#include <decant/hypothesis/value_estimate.hpp>
#include <decant/io/recording_reader.hpp>
#include <decant/simulation/contents.hpp>
#include <decant/simulation/fill.hpp>
#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator.hpp>
#include <decant/tracking/fixed_lag_tracker.hpp>
#include <decant/tracking/overlap_score.hpp>
#include <decant/tracking/tracker.hpp>

namespace example {

struct TrackingOptions {
  double spacing = 0.004;           ///< of the model's particles [m]
  std::vector<double> forecasts{};  ///< how far ahead [s]
  int frames_between_forecasts = 10;
  int threads = 0;
  bool keep_overlays = false;                     ///< for reports; takes some MB of memory per hundred frames
  double initial_amount_factor = 1;               ///< the model starts with so much of what the recording says, >= 0
  decant::Slip source_slip = decant::Slip::Free;  ///< how liquid goes along what it is poured from
  /// Its spacing, liquid, gravity and threads are not used.
  decant::SimulatorSettings solver = decant::for_tracking({});
  /// What the tracker gets to see of a frame and camera instead of the recording's masks, which forecasts are scored
  /// against in any case.
  std::function<std::optional<decant::Mask>(const decant::Recording&, std::size_t frame, std::size_t camera)> masks{};
};

/// Observed against predicted silhouette of the first camera in one frame: the part of the image that has any liquid.
struct Overlay {
  static constexpr std::uint8_t observed = 1, predicted = 2;  ///< bits of a label; both: 3

  decant::Image<std::uint8_t> label{};
  decant::Index top = 0, left = 0;            ///< of the label in the image [px]
  bool has_mask = false;                      ///< false: nothing was seen in this frame
  bool counts = false, prior_counts = false;  ///< whether the frame has enough liquid for OverlapScore's mean
};

/// One method on one recording.
struct TrackingResult {
  std::vector<double> iou, prior_iou;  ///< per frame, NaN where there was no mask
  decant::OverlapScore posterior, prior;
  std::vector<decant::OverlapScore> forecasts;  ///< for each of the options'
  /// Of the first camera, against masks without noise, where there are any: every frame, also those without a mask.
  decant::OverlapScore against_truth, prior_against_truth;
  double log_likelihood = 0;
  std::vector<std::vector<double>> volume_ml;  ///< per body and frame
  double relocated_ml = 0;
  double physics_ms = 0, drawing_ms = 0, correction_ms = 0, relaxation_ms = 0;  ///< all frames together
  std::vector<Overlay> overlays;  ///< per frame, where the options ask for them and there is a camera
  std::vector<std::pair<std::string, double>> parameters;  ///< of the model, where a method adapts them
  std::optional<decant::ValueEstimate> initial_ml;         ///< where a method estimates it
  /// Then also what it asked about: amounts [ml], the smallest first, with their log posteriors [nat].
  std::vector<std::pair<double, double>> initial_ml_hypotheses;
  std::size_t frames = 0;
  decant::Index particles = 0;
  std::string status = "ok";
};

/// @param seen nothing where the camera saw nothing in this frame.
inline Overlay overlay_of(const decant::Mask& predicted, const decant::Mask* seen) {
  decant::Image<std::uint8_t> label =
      predicted.unaryExpr([](std::uint8_t p) { return decant::is_liquid(p) ? Overlay::predicted : std::uint8_t{0}; });
  if (seen != nullptr) {
    label += seen->unaryExpr([](std::uint8_t o) { return decant::is_liquid(o) ? Overlay::observed : std::uint8_t{0}; });
  }
  decant::Index top = label.rows(), bottom = 0, left = label.cols(), right = 0;
  for (decant::Index row = 0; row < label.rows(); ++row) {
    for (decant::Index column = 0; column < label.cols(); ++column) {
      if (label(row, column) != 0) {
        top = std::min(top, row);
        bottom = row + 1;
        left = std::min(left, column);
        right = std::max(right, column + 1);
      }
    }
  }
  Overlay overlay;
  overlay.has_mask = seen != nullptr;
  if (bottom > top) {
    overlay.label = label.block(top, left, bottom - top, right - left);
    overlay.top = top;
    overlay.left = left;
  }
  return overlay;
}

inline decant::DistortedPinholeCamera camera_of(const decant::recording::View& view, int width, int height) {
  const auto& d = view.distortion;
  return {decant::PinholeCamera(view.fx, view.fy, view.cx, view.cy, width, height), {d[0], d[1], d[2], d[3], d[4]}};
}

/// What is tracked with: the default simulator, and a friction that is nothing unless it is adapted.
struct TrackingParts : decant::DefaultParts<float> {
  using Forces = std::tuple<decant::Gravity<float>, decant::Viscosity<float>, decant::ResidualViscosity<float>,
                            decant::LinearDrag<float>>;
};
using TrackingModel = decant::Simulator<TrackingParts>;

/// The initial amount of liquid that a recording says, times a factor, at most what the container holds as it stands.
/// Throws std::invalid_argument if the recording does not know it, or says a volume that is more than that.
template <class Model>
void fill_as_recorded(const decant::Recording& recording, double factor, Model& model) {
  if (!recording.liquid.initial) {
    return;
  }
  const auto& initial = *recording.liquid.initial;
  decant::expects(initial.known(), "track: initial amount of liquid", "given in the recording", "none");
  const auto body = static_cast<decant::BodyId>(initial.body);
  const auto& container = model.bodies()[body];
  const decant::Vector3<double> up = -(container.motion.at(model.time()).rotation.conjugate() * recording.gravity);
  // A fraction is of what it holds upright, wherever the recording begins. What does not fit as it stands has run out
  // before; a volume that is told is there, or else refused.
  const double told = initial.fill_fraction
                          ? *initial.fill_fraction * decant::upright_cavity(container.surface, up).volume()
                          : *initial.volume;
  double volume = factor * told;
  if (initial.fill_fraction || factor > 1) {
    const double holds = decant::Cavity(container.surface, up).volume();
    volume = std::min(volume, initial.fill_fraction ? holds : std::max(told, holds));
  }
  if (volume > 0) {
    decant::fill(model, body, decant::FillAmount::volume(volume));
  }
}

/// The model as a recording says that it starts. Throws std::invalid_argument if the amount of liquid is not known.
template <class Parts>
decant::Simulator<Parts> model_of(const decant::Recording& recording, const TrackingOptions& options) {
  using namespace decant;
  SimulatorSettings settings = options.solver;
  settings.spacing = options.spacing;
  settings.gravity = recording.gravity;
  settings.liquid = {recording.liquid.density, recording.liquid.viscosity, recording.liquid.surface_tension};
  settings.threads = {options.threads};
  Simulator<Parts> model(settings);
  for (const recording::Body& body : recording.bodies) {
    const Slip slip = body.role == recording::Role::Source ? options.source_slip : Slip::Free;
    const BodyId id =
        model.add_body(body.name, body.mesh, PoseTrack(body.motion.at(recording.timestamps.front())), slip);
    if (body.role == recording::Role::Source || body.role == recording::Role::Target) {
      model.watch_contents(id);
    }
  }
  fill_as_recorded(recording, options.initial_amount_factor, model);
  if (recording.liquid.inlet) {
    model.add_inlet(*recording.liquid.inlet, static_cast<Origin>(recording.bodies.size()));
  }
  return model;
}

/// A recorded motion on the model's clock, beginning where the model's body is now.
template <class Model>
decant::PoseTrack shifted(const decant::PoseTrack& motion, double by, const Model& model, decant::BodyId body) {
  std::vector<decant::PoseTrack::Sample> samples{{model.time(), model.bodies()[body].motion.at(model.time())}};
  for (const auto& sample : motion.samples()) {
    if (sample.time + by > model.time() + 1e-9) {
      samples.push_back({sample.time + by, sample.pose});
    }
  }
  return decant::PoseTrack(std::move(samples));
}

/// What follows a recording, as forecasts and scores see it: a tracker, by itself or the one that is in use.
template <class Model, class CorrectorType>
decant::Tracker<Model, CorrectorType>& tracker_of(decant::Tracker<Model, CorrectorType>& tracker) {
  return tracker;
}
template <class TrackerType>
TrackerType& tracker_of(decant::FixedLagTracker<TrackerType>& follower) {
  return follower.tracker();
}
template <class TrackerType>
TrackerType& tracker_of(decant::HypothesisFilter<TrackerType>& follower) {
  return follower.tracker(follower.best());
}

/// How late the recorded poses are, as far as the follower knows [s].
template <class Follower>
double pose_delay_of(const Follower& follower) {
  if constexpr (requires { follower.pose_delay(); }) {
    return follower.pose_delay();
  } else {
    return 0;
  }
}

/// Amounts of liquid that a follower starts with [ml]: one, or that of each hypothesis.
template <class Follower>
std::vector<double> initial_ml_of(Follower& follower) {
  const auto volume = [](auto& model) {
    return 1e6 * static_cast<double>(model.fluid().size()) * std::pow(model.spacing(), 3);
  };
  if constexpr (requires { follower.log_posterior(0); }) {
    std::vector<double> all;
    for (std::size_t k = 0; k < follower.size(); ++k) {
      all.push_back(volume(follower.tracker(k).model()));
    }
    return all;
  } else {
    return {volume(tracker_of(follower).model())};
  }
}

/// Liquid in each watched container now [m^3], by body; expected, where there are several hypotheses.
template <class Follower>
std::map<decant::BodyId, double> contents_of(Follower& follower) {
  std::map<decant::BodyId, double> volume;
  for (const auto& contained : tracker_of(follower).model().step(0).contents) {
    volume[contained.body] = contained.volume;
  }
  return volume;
}
template <class TrackerType>
std::map<decant::BodyId, double> contents_of(decant::HypothesisFilter<TrackerType>& follower) {
  std::map<decant::BodyId, double> expected;
  for (std::size_t k = 0; k < follower.size(); ++k) {
    if (!follower.given_up(k)) {
      for (const auto& [body, volume] : contents_of(follower.tracker(k))) {
        expected[body] += follower.probability(k) * volume;
      }
    }
  }
  return expected;
}

template <class TrackerType>
void say_estimates(const TrackerType&, const std::vector<double>&, TrackingResult&) {}
template <class TrackerType>
void say_estimates(const decant::FixedLagTracker<TrackerType>& follower, const std::vector<double>&,
                   TrackingResult& result) {
  for (std::size_t k = 0; k < follower.parameters().size(); ++k) {
    result.parameters.emplace_back(follower.parameters()[k].name, follower.value(k));
  }
  result.parameters.emplace_back("pose_delay_s", follower.pose_delay());
}
/// Hypotheses of the initial amount, in any order.
template <class TrackerType>
void say_estimates(const decant::HypothesisFilter<TrackerType>& follower, const std::vector<double>& initial_ml,
                   TrackingResult& result) {
  auto& by_amount = result.initial_ml_hypotheses;
  for (std::size_t k = 0; k < follower.size(); ++k) {
    by_amount.emplace_back(initial_ml[k], follower.log_posterior(k));
  }
  std::sort(by_amount.begin(), by_amount.end());
  std::vector<double> amount, log_density;
  for (const auto& [ml, log_posterior] : by_amount) {
    if (amount.empty() || ml > amount.back()) {
      amount.push_back(ml);
      log_density.push_back(log_posterior);
    }
  }
  result.initial_ml = decant::estimate_value(amount, log_density);
}

/// Scores a copy of the model that runs ahead of a frame, uncorrected, with the bodies moving as recorded.
/// @param start recorded times minus those of the model [s].
template <class Follower>
void add_forecasts(const decant::Recording& recording, std::size_t frame, double start, const TrackingOptions& options,
                   Follower& follower, TrackingResult& result) {
  using namespace decant;
  auto& tracker = tracker_of(follower);
  std::vector<std::size_t> nearest_first(options.forecasts.size());
  std::iota(nearest_first.begin(), nearest_first.end(), std::size_t{0});
  std::sort(nearest_first.begin(), nearest_first.end(),
            [&](std::size_t a, std::size_t b) { return options.forecasts[a] < options.forecasts[b]; });
  auto future = tracker.model();
  for (std::size_t body = 0; body < recording.bodies.size(); ++body) {
    const auto id = static_cast<BodyId>(body);
    future.set_motion(id, shifted(recording.bodies[body].motion, -start - pose_delay_of(follower), future, id));
  }
  Mask seen(recording.height, recording.width), forecast;
  for (const std::size_t k : nearest_first) {
    const auto target = static_cast<std::size_t>(
        std::lround(static_cast<double>(frame) + options.forecasts[k] * recording.frames_per_second));
    const std::optional<Mask> mask = target < recording.frames ? recording.liquid_mask(target, 0) : std::nullopt;
    if (!mask) {
      continue;
    }
    if (!future.step(recording.timestamps[target] - start - future.time()).advanced()) {
      return;
    }
    const TrackerSettings& settings = tracker.settings();
    MaskCleaning(settings.cleaning_window_px, settings.smallest_region_px).apply(*mask, seen);
    tracker.predict(future, 0, recording.cameras.front().view(target).camera_from_world, forecast);
    result.forecasts[k].add(overlap(forecast, seen));
  }
}

/// A tracker with the recording's cameras. Throws std::invalid_argument if one of them zooms or is cropped on the way.
template <class CorrectorType, class Model>
decant::Tracker<Model, CorrectorType> tracker_for(const decant::Recording& recording, const Model& model,
                                                  CorrectorType corrector, const TrackingOptions& options) {
  decant::TrackerSettings settings;
  settings.gravity = recording.gravity;
  settings.threads = {options.threads};
  decant::Tracker<Model, CorrectorType> tracker(model, std::move(corrector), settings);
  for (const decant::recording::Camera& camera : recording.cameras) {
    const decant::recording::View& view = camera.view(0);
    for (const decant::recording::View& other : camera.views) {
      decant::expects(other.same_lens(view), "track: focal lengths, centre and distortion of a camera",
                      "the same in every frame", "others in some");
    }
    tracker.add_camera(camera_of(view, recording.width, recording.height), view.camera_from_world);
  }
  return tracker;
}

/// A frame of a recording, with what a tracker's frame only points to.
struct RecordedFrame {
  std::vector<decant::TrackedPose> poses{};
  std::vector<decant::CameraPose> cameras{};
  std::vector<decant::Mask> seen{};
  std::vector<decant::CameraMask> masks{};

  /// @param time on the model's clock [s].
  decant::TrackerFrame at(double time) const { return {time, poses, masks, cameras}; }
};

inline RecordedFrame frame_of(const decant::Recording& recording, std::size_t frame, const TrackingOptions& options) {
  RecordedFrame result;
  for (std::size_t body = 0; body < recording.bodies.size(); ++body) {
    result.poses.push_back(
        {static_cast<decant::BodyId>(body), recording.bodies[body].motion.at(recording.timestamps[frame])});
  }
  result.seen.reserve(recording.cameras.size());  // masks point into it
  for (std::size_t camera = 0; camera < recording.cameras.size(); ++camera) {
    result.cameras.push_back({camera, recording.cameras[camera].view(frame).camera_from_world});
    if (std::optional<decant::Mask> mask =
            options.masks ? options.masks(recording, frame, camera) : recording.liquid_mask(frame, camera)) {
      result.seen.push_back(std::move(*mask));
      result.masks.push_back({camera, result.seen.back()});
    }
  }
  return result;
}

/// Tracks the recording from beginning to end. @param follower a Tracker, or what has trackers within. @param
/// truth_masks folder with masks that are free of noise, for scoring.
template <class Follower>
TrackingResult track_recording(
    const decant::Recording& recording, Follower follower, const TrackingOptions& options,
    const std::filesystem::path& truth_masks = {},
    const std::function<void(std::size_t)>& progress = [](std::size_t) {}) {
  using namespace decant;
  TrackingResult result;
  result.forecasts.resize(options.forecasts.size());
  result.volume_ml.resize(recording.bodies.size());
  const std::vector<double> initial_ml = initial_ml_of(follower);
  const double start = recording.timestamps.front() - tracker_of(follower).model().time();
  for (std::size_t frame = 0; frame < recording.frames; ++frame) {
    const RecordedFrame recorded = frame_of(recording, frame, options);
    const std::vector<CameraMask>& masks = recorded.masks;
    const FrameReport report = follower.track(recorded.at(recording.timestamps[frame] - start));
    if (!report.advanced()) {
      result.status = std::string(to_string(report.status)) + " in frame " + std::to_string(frame);
      break;
    }
    auto& tracker = tracker_of(follower);
    ++result.frames;
    result.iou.push_back(report.posterior.iou());
    result.prior_iou.push_back(report.prior.iou());
    result.posterior.add(report.posterior);
    result.prior.add(report.prior);
    if (report.posterior.compared_px > 0) {
      result.log_likelihood += report.log_likelihood;
    }
    if (options.keep_overlays && !recording.cameras.empty()) {
      const bool has_mask = !masks.empty() && masks.front().camera == 0;
      Overlay overlay = overlay_of(tracker.predicted(0), has_mask ? &tracker.observed(0) : nullptr);
      const auto least = OverlapScoreSettings{}.least_union_px;
      overlay.counts = report.posterior.compared_px > 0 && report.posterior.union_px() >= least;
      overlay.prior_counts = report.prior.compared_px > 0 && report.prior.union_px() >= least;
      result.overlays.push_back(std::move(overlay));
    }
    result.relocated_ml += 1e6 * report.relocated_volume;
    result.physics_ms += report.physics_ms;
    result.drawing_ms += report.drawing_ms;
    result.correction_ms += report.correction_ms;
    result.relaxation_ms += report.relaxation_ms;
    if (!truth_masks.empty()) {
      const auto file = truth_masks / (decant::detail::six_digits(frame) + ".png");
      const Mask truth = read_png_grey8(file);
      result.prior_against_truth.add(overlap(tracker.predicted_before(0), truth));
      result.against_truth.add(overlap(tracker.predicted(0), truth));
    }
    if (frame % static_cast<std::size_t>(options.frames_between_forecasts) == 0) {
      add_forecasts(recording, frame, start, options, follower, result);
    }
    for (const auto& [body, volume] : contents_of(follower)) {
      result.volume_ml[body].push_back(1e6 * volume);
    }
    progress(frame + 1);
  }
  say_estimates(follower, initial_ml, result);
  result.particles = tracker_of(follower).model().fluid().size();
  return result;
}

}  // namespace example
