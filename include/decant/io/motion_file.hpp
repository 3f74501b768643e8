// SPDX-License-Identifier: MIT
#pragma once

/// Reads the motion of a rigid body from a CSV file.

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/io/detail/text.hpp>

namespace decant::inline DECANT_TARGET {

/// A motion from text, in one of two forms:
/// - header `t_s,x_m,y_m,z_m,qw,qx,qy,qz`, then one row per pose, separated by commas;
/// - no header, rows `time;x;y;z;qx;qy;qz;qw`, separated by semicolons (what robot controllers export; the order of
///   the quaternion differs).
/// Times [s] increase strictly in uneven steps if need be; quaternions have a norm within 1e-3 of 1. Empty lines and
/// lines that start with # are passed over. Throws std::runtime_error naming `name`, the line and what was expected.
inline PoseTrack parse_motion(std::string_view text, const std::string& name) {
  constexpr std::string_view header = "t_s,x_m,y_m,z_m,qw,qx,qy,qz";
  std::vector<PoseTrack::Sample> samples;
  bool first = true;
  bool with_header = false;
  std::size_t number = 0;
  while (const auto raw = detail::next_line(text)) {
    ++number;
    const std::string_view line = detail::trimmed(*raw);
    if (line.empty() || line.front() == '#') {
      continue;
    }
    const auto where = [&] { return name + ": line " + std::to_string(number); };
    if (first) {
      first = false;
      with_header = line == header;
      if (with_header) {
        continue;
      }
      if (line.find(';') == std::string_view::npos) {
        detail::refuse_file(where(), "the header " + std::string(header) + " or a row time;x;y;z;qx;qy;qz;qw",
                            detail::visible_text(line));
      }
    }
    const std::vector<std::string_view> cells = detail::split(line, with_header ? ',' : ';');
    if (cells.size() != 8) {
      detail::refuse_file(where(), "8 cells", std::to_string(cells.size()));
    }
    double value[8];
    for (std::size_t k = 0; k < 8; ++k) {
      const auto parsed = detail::parse_number(cells[k]);
      if (!parsed || std::abs(*parsed) > 1e9) {
        detail::refuse_file(where() + ", cell " + std::to_string(k + 1), "a finite number of at most 1e9",
                            detail::visible_text(cells[k]));
      }
      value[k] = *parsed;
    }
    if (!samples.empty() && !(value[0] > samples.back().time)) {
      detail::refuse_file(where() + ", time [s]", "later than the row before", std::string(cells[0]));
    }
    PoseTrack::Sample sample;
    sample.time = value[0];
    sample.pose.translation = {value[1], value[2], value[3]};
    sample.pose.rotation = with_header ? Eigen::Quaterniond(value[4], value[5], value[6], value[7])
                                       : Eigen::Quaterniond(value[7], value[4], value[5], value[6]);
    const double norm = sample.pose.rotation.norm();
    if (!(std::abs(norm - 1) < 1e-3)) {
      detail::refuse_file(where() + ", norm of the quaternion", "within 1e-3 of 1", detail::number_text(norm));
    }
    samples.push_back(sample);
  }
  if (samples.empty()) {
    throw std::runtime_error(name + ": must hold at least one pose");
  }
  return PoseTrack(std::move(samples));
}

/// parse_motion of a file of at most 256 MiB. Throws std::runtime_error.
inline PoseTrack read_motion(const std::filesystem::path& path) {
  return parse_motion(detail::read_text_file(path, std::uintmax_t{1} << 28), path.string());
}

}  // namespace decant::inline DECANT_TARGET
