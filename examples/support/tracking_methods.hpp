// SPDX-License-Identifier: MIT
#pragma once

/// The methods that track a recording, by the names that scripts use, and what each comes to as JSON.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/core/expects.hpp>
#include <decant/correction/map_filter.hpp>
#include <decant/correction/map_filter_schenck2017.hpp>
#include <decant/correction/open_loop.hpp>
#include <decant/correction/silhouette_corrector.hpp>
#include <decant/correction/transport_corrector.hpp>
#include <decant/correction/warp_field_schenck2017.hpp>
#include <decant/io/recording.hpp>
#include <decant/simulation/parts.hpp>

#include "result_file.hpp"
#include "tracking_run.hpp"

namespace example {

/// A method, tried on a recording from beginning to end; see track_recording. The model is filled as the recording and
/// the options say.
using TrackingMethod =
    std::function<TrackingResult(const decant::Recording&, const TrackingModel&, const TrackingOptions&,
                                 const std::filesystem::path&, const std::function<void(std::size_t)>&)>;

template <class CorrectorType>
TrackingMethod method_of() {
  return [](const decant::Recording& recording, const TrackingModel& model, const TrackingOptions& options,
            const std::filesystem::path& truth_masks, const std::function<void(std::size_t)>& progress) {
    return track_recording(recording, tracker_for(recording, model, CorrectorType(), options), options, truth_masks,
                           progress);
  };
}

/// What may be wrong with the model of a pour: a table that is not level or an air stream, friction of the air, a
/// thicker liquid; and poses that come late, which FixedLagTracker knows by itself.
inline std::vector<decant::UncertainParameter<TrackingModel>> uncertain_parameters(const decant::Recording& recording) {
  const decant::Vector3<float> gravity = recording.gravity.cast<float>();
  const auto nu = static_cast<float>(recording.liquid.viscosity / recording.liquid.density);
  // an axis across gravity, and the other one
  decant::Vector3<float> x = decant::Vector3<float>::UnitX();
  if (gravity.norm() > 0) {
    x = (x - x.dot(gravity) / gravity.squaredNorm() * gravity).normalized();
  }
  const decant::Vector3<float> y = gravity.norm() > 0 ? decant::Vector3<float>(x.cross(gravity).normalized())
                                                      : decant::Vector3<float>(decant::Vector3<float>::UnitY());
  using Gravity = decant::Gravity<float>;
  // the first parameter starts from what the recording says, the second one adds to it
  return {
      {"pull_x_m_s2", 0.5,
       [=](TrackingModel& model, double pull) {
         model.force<Gravity>().acceleration = gravity + static_cast<float>(pull) * x;
       }},
      {"pull_y_m_s2", 0.5,
       [=](TrackingModel& model, double pull) { model.force<Gravity>().acceleration += static_cast<float>(pull) * y; }},
      {"drag_1_s", 1.2,
       [](TrackingModel& model, double drag) {
         model.force<decant::LinearDrag<float>>().rate = static_cast<float>(std::max(0.0, drag));
       }},
      {"viscosity_decades", 1, [=](TrackingModel& model, double decades) {
         // from 1e-5 m^2/s on: liquid of particles of some millimetres does not feel less
         const double thickened = 1e-5 * (std::pow(10.0, std::max(0.0, decades)) - 1);
         model.force<decant::Viscosity<float>>().kinematic_viscosity = nu + static_cast<float>(thickened);
       }}};
}

/// The default corrector, with parameters adapted as it runs.
inline TrackingResult track_adapting(const decant::Recording& recording, const TrackingModel& model,
                                     const TrackingOptions& options, const std::filesystem::path& truth_masks,
                                     const std::function<void(std::size_t)>& progress) {
  decant::FixedLagSettings settings;
  settings.threads = {options.threads};
  TrackingOptions coarse = options;
  coarse.spacing = 1.5 * options.spacing;
  const decant::SilhouetteCorrector<> corrector;
  return track_recording(
      recording,
      decant::FixedLagTracker(tracker_for(recording, model, corrector, options),
                              tracker_for(recording, model_of<TrackingParts>(recording, coarse), corrector, coarse),
                              uncertain_parameters(recording), settings),
      options, truth_masks, progress);
}

/// The default corrector from each of several initial amounts, around what the recording says; the most probable one
/// is followed.
inline TrackingResult track_amounts(const decant::Recording& recording, const TrackingModel& model,
                                    const TrackingOptions& options, const std::filesystem::path& truth_masks,
                                    const std::function<void(std::size_t)>& progress) {
  const double told = options.initial_amount_factor, ratio = 1.13, deviation = 0.3;  // of the amount's logarithm
  decant::HypothesisFilter<decant::Tracker<TrackingModel, decant::SilhouetteCorrector<>>> filter(
      {}, decant::ThreadExecutor{{options.threads}});
  TrackingModel empty = model;  // bodies are slow to add, and can be shared
  empty.remove_particles_if([](decant::Index) { return true; });
  for (int k = -4; k <= 4; ++k) {
    TrackingModel other = k == 0 ? model : empty;
    if (k != 0) {
      fill_as_recorded(recording, told * std::pow(ratio, k), other);
    }
    const double off = k * std::log(ratio) / deviation;
    filter.add(tracker_for(recording, other, decant::SilhouetteCorrector<>(), options), -0.5 * off * off);
  }
  return track_recording(recording, std::move(filter), options, truth_masks, progress);
}

/// By the names that scripts use. The two of the paper are as printed.
inline const std::vector<std::pair<std::string, TrackingMethod>>& tracking_methods() {
  static const std::vector<std::pair<std::string, TrackingMethod>> all{
      {"open_loop", method_of<decant::OpenLoop<>>()},
      {"map_filter", method_of<decant::MapFilterSchenck2017<>>()},
      {"map_filter_mended", method_of<decant::MapFilter<>>()},
      {"warp_field", method_of<decant::WarpFieldSchenck2017<>>()},
      {"transport", method_of<decant::TransportCorrector<>>()},
      {"default", method_of<decant::SilhouetteCorrector<>>()},
      {"default_adapting", track_adapting},
      {"default_amounts", track_amounts},
  };
  return all;
}

inline std::vector<std::string> tracking_method_names() {
  std::vector<std::string> names;
  for (const auto& [name, run] : tracking_methods()) {
    names.push_back(name);
  }
  return names;
}

/// @param name one of tracking_method_names().
inline const TrackingMethod& tracking_method(const std::string& name) {
  const auto& all = tracking_methods();
  const auto found = std::find_if(all.begin(), all.end(), [&](const auto& entry) { return entry.first == name; });
  decant::expects(found != all.end(), "track: method", "one of the known names", name);
  return found->second;
}

/// What a result holds for scripts. @param forecasts those of the options that it was run with [s].
inline nlohmann::json tracking_json(const TrackingResult& result, const decant::Recording& recording,
                                    const std::vector<double>& forecasts) {
  nlohmann::json json;
  json["iou_mean"] = number_json(result.posterior.mean_over_frames());
  json["iou_pooled"] = number_json(result.posterior.pooled_over_pixels());
  json["iou"] = column_json(result.iou);
  json["prior_iou"] = number_json(result.prior.mean_over_frames());
  for (std::size_t k = 0; k < forecasts.size(); ++k) {
    char name[32];
    std::snprintf(name, sizeof(name), "%g", forecasts[k]);
    json["forecast_iou"][name] = number_json(result.forecasts[k].mean_over_frames());
  }
  json["log_likelihood"] = number_json(result.log_likelihood);
  for (std::size_t body = 0; body < recording.bodies.size(); ++body) {
    if (!result.volume_ml[body].empty()) {
      json["volume_ml"][recording.bodies[body].name] = column_json(result.volume_ml[body]);
    }
  }
  const double seconds = 1e-3 * (result.physics_ms + result.drawing_ms + result.correction_ms + result.relaxation_ms);
  json["frames_per_second"] = number_json(static_cast<double>(result.frames) / seconds);
  json["relocated_ml"] = result.relocated_ml;
  for (const auto& [name, value] : result.parameters) {
    json["parameters"][name] = number_json(value);
  }
  if (result.initial_ml) {
    json["initial_ml"] = {{"mean", result.initial_ml->mean},
                          {"low_90", result.initial_ml->low},
                          {"high_90", result.initial_ml->high},
                          {"at_end", result.initial_ml->at_end}};
    for (const auto& [ml, log_posterior] : result.initial_ml_hypotheses) {
      json["initial_ml"]["hypotheses"].push_back({{"ml", ml}, {"log_posterior", number_json(log_posterior)}});
    }
  }
  json["particles"] = result.particles;
  json["status"] = result.status;
  return json;
}

}  // namespace example
