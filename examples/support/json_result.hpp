// SPDX-License-Identifier: MIT
#pragma once

/// Figures as JSON, which the tools write for scripts.

#include <cmath>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/io/detail/text.hpp>

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

inline void write_result(const std::filesystem::path& path, const nlohmann::json& json) {
  decant::detail::write_text_file(path, json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
}

}  // namespace example
