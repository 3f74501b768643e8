// SPDX-License-Identifier: MIT
#pragma once

/// Tables of numbers in CSV files that have a header of their own and no time.

#include <cstddef>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <decant/io/detail/text.hpp>
#include <decant/io/series_file.hpp>

namespace example {

/// Rows below the header, each with the same number of finite numbers. Throws std::runtime_error, one line that names
/// the file, the line and what was expected.
inline std::vector<std::vector<double>> read_numbers(const std::filesystem::path& path, std::size_t columns) {
  const std::string content = decant::detail::read_text_file(path, std::uintmax_t{1} << 28);
  std::string_view text = content;
  std::vector<std::vector<double>> rows;
  std::size_t number = 0;
  while (const auto line = decant::detail::next_line(text)) {
    if (++number == 1 || decant::detail::trimmed(*line).empty()) {
      continue;
    }
    const std::string where = path.string() + ": line " + std::to_string(number);
    const std::vector<std::string> cells = decant::detail::csv_cells(*line, where);
    auto& row = rows.emplace_back();
    for (const std::string& cell : cells) {
      const auto value = decant::detail::parse_number(cell);
      if (!value || cells.size() != columns) {
        decant::detail::refuse_file(where, std::to_string(columns) + " finite numbers",
                                    decant::detail::visible_text(*line));
      }
      row.push_back(*value);
    }
  }
  return rows;
}

}  // namespace example
