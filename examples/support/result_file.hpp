// SPDX-License-Identifier: MIT
#pragma once

/// What the tools write for scripts: series and figures as JSON.

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include <nlohmann/json.hpp>

#include <decant/io/detail/text.hpp>
#include <decant/io/series_file.hpp>

#include "scene_run.hpp"

namespace example {

/// Throws std::runtime_error unless the file can be written: better before a long run than after it.
inline void expect_writable(const std::filesystem::path& path) {
  if (!std::ofstream(path, std::ios::app)) {
    throw std::runtime_error(path.string() + ": cannot be written");
  }
}

/// NaN becomes null.
inline nlohmann::json number_json(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json();
}

inline nlohmann::json column_json(const std::vector<double>& values) {
  nlohmann::json column = nlohmann::json::array();
  for (const double value : values) {
    column.push_back(number_json(value));
  }
  return column;
}

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

inline void write_result(const std::filesystem::path& path, const nlohmann::json& json) {
  decant::detail::write_text_file(path, json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
}

}  // namespace example
