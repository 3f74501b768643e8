// SPDX-License-Identifier: MIT
#pragma once

/// Where tests find files: those of this repository, and measurements that are too large for it.

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

#include "catch.hpp"

namespace decant_test {

/// A file or folder of this repository, e.g. repository("examples/data").
inline std::filesystem::path repository(const std::string& inside) {
  return std::filesystem::path(DECANT_SOURCE_DIR) / inside;
}

/// A file or folder of the measurements, or nothing, with a line in the test's output, where they are not at hand. The
/// folder is the environment variable DECANT_SHARED_DATA_DIR, or else the CMake variable of that name.
inline std::optional<std::filesystem::path> measurements(const std::string& inside) {
  const char* from_environment = std::getenv("DECANT_SHARED_DATA_DIR");
  const std::string folder = from_environment != nullptr ? from_environment : DECANT_SHARED_DATA_DIR;
  const std::filesystem::path path = std::filesystem::path(folder) / inside;
  if (folder.empty() || !std::filesystem::exists(path)) {
    WARN("skipped: no " << inside << " in DECANT_SHARED_DATA_DIR ('" << folder << "')");
    return std::nullopt;
  }
  return path;
}

}  // namespace decant_test
