// SPDX-License-Identifier: MIT
#pragma once

/// What a run of a scene comes to, as JSON.

#include <cstddef>
#include <string>

#include <nlohmann/json.hpp>

#include <decant/io/series_file.hpp>

#include "json_result.hpp"
#include "scene_run.hpp"

namespace example {

/// Everything that a run of a scene reports.
inline nlohmann::json result_json(const RunResult& result, int threads) {
  nlohmann::json json;
  for (std::size_t k = 0; k < result.series.names.size(); ++k) {
    json["series"][result.series.names[k]] = column_json(result.series.columns[k]);
  }
  json["particles"] = result.particles;
  json["lost"] = result.lost;
  json["spilled"] = result.spilled;
  json["sub_steps"] = result.sub_steps;
  json["iterations"] = result.iterations;
  json["unconverged_frames"] = result.unconverged_frames;
  json["density_error_max"] = result.density_error_max;
  json["volume_ml"] = 1e6 * result.volume;
  json["peak_rss_mb"] = detail::peak_memory_mb();
  json["wall_s"] = result.step_seconds;
  json["set_up_s"] = result.set_up_seconds;
  json["threads"] = threads;
  json["status"] = result.status;
  return json;
}

}  // namespace example
