// SPDX-License-Identifier: MIT
#pragma once

/// Files that belong to one folder and must not lead out of it.

#include <cstddef>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>

#include <decant/core/target.hpp>
#include <decant/io/detail/text.hpp>

namespace decant::inline DECANT_TARGET::detail {

/// Where `relative` leads inside `folder`, links resolved; nothing where there is no such entry. Throws
/// std::runtime_error where it leads out of the folder or nowhere.
inline std::optional<std::filesystem::path> find_inside(const std::filesystem::path& folder,
                                                        const std::filesystem::path& relative) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path root = fs::canonical(folder.empty() ? fs::path(".") : folder, error);
  if (error || !fs::exists(fs::symlink_status(root / relative, error))) {
    return std::nullopt;
  }
  const fs::path path = fs::canonical(root / relative, error);
  // a link whose target is gone must not pass for a file that was never there
  const fs::path back = error ? fs::path() : path.lexically_relative(root);
  if (back.empty() || *back.begin() == "..") {
    refuse_file((folder / relative).string(), "a path that stays inside its folder, also behind links",
                error ? "a link to nothing" : "a link that leads out");
  }
  return path;
}

/// find_inside of a file that has to be there.
inline std::filesystem::path file_inside(const std::filesystem::path& folder, const std::filesystem::path& relative) {
  const auto path = find_inside(folder, relative);
  std::error_code error;
  if (!path || !std::filesystem::is_regular_file(*path, error)) {
    throw std::runtime_error((folder / relative).string() + ": no such file");
  }
  return *path;
}

/// Makes a folder, and those above it, where it is not there yet. Throws std::runtime_error where it cannot.
inline void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    throw std::runtime_error(folder.string() + ": cannot be made: " + error.message());
  }
}

/// A number as file names carry it: zero-padded to six digits.
inline std::string six_digits(std::size_t number) {
  const std::string digits = std::to_string(number);
  return digits.size() < 6 ? std::string(6 - digits.size(), '0') + digits : digits;
}

}  // namespace decant::inline DECANT_TARGET::detail
