// SPDX-License-Identifier: MIT
#pragma once

/// What really happened in a recording, for scoring alone. It has a header of its own, so that an estimator that looks
/// at it says so in its includes.

#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include <decant/core/target.hpp>
#include <decant/io/detail/json.hpp>
#include <decant/io/recording_reader.hpp>

namespace decant::inline DECANT_TARGET {

/// The text of the JSON value `truth` in a folder's recording.json, or nothing where there is none. For scoring alone:
/// no estimator may call this. Throws std::runtime_error where recording.json cannot be read or is none.
inline std::optional<std::string> read_truth(const std::filesystem::path& folder) {
  const detail::RecordingFolder files(folder);
  const std::string text = files.text("recording.json"), name = files.name("recording.json");
  parse_recording(text, name);
  const nlohmann::json document = detail::parse_json(text, name);
  const auto truth = document.find("truth");
  return truth == document.end() ? std::nullopt : std::optional<std::string>(truth->dump());
}

}  // namespace decant::inline DECANT_TARGET
