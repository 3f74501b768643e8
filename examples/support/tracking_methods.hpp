// SPDX-License-Identifier: MIT
#pragma once

/// The methods that track a recording, by the names that scripts use, and what each comes to as JSON.

#include <algorithm>
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

using TrackingModel = decant::LiquidSimulator;

/// A corrector, tried on a recording from beginning to end; see track_recording.
using TrackingMethod =
    std::function<TrackingResult(const decant::Recording&, const TrackingModel&, const TrackingOptions&,
                                 const std::filesystem::path&, const std::function<void(std::size_t)>&)>;

template <class CorrectorType>
TrackingMethod method_of() {
  return [](const decant::Recording& recording, const TrackingModel& model, const TrackingOptions& options,
            const std::filesystem::path& truth_masks, const std::function<void(std::size_t)>& progress) {
    return track_recording(recording, model, CorrectorType(), options, truth_masks, progress);
  };
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
  json["particles"] = result.particles;
  json["status"] = result.status;
  return json;
}

}  // namespace example
