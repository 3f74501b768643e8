// SPDX-License-Identifier: MIT
#pragma once

/// Time series in CSV files: a header with one name per column, then one row per instant.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include <decant/core/target.hpp>
#include <decant/io/detail/text.hpp>

namespace decant::inline DECANT_TARGET {

/// Named columns of equal length; a missing value is NaN. The first column is the time `t_s` [s].
struct Series {
  std::vector<std::string> names;
  std::vector<std::vector<double>> columns;

  std::size_t rows() const { return columns.empty() ? 0 : columns.front().size(); }

  /// The column of that name, or nullptr.
  const std::vector<double>* find(std::string_view name) const {
    for (std::size_t k = 0; k < names.size(); ++k) {
      if (names[k] == name) {
        return &columns[k];
      }
    }
    return nullptr;
  }
};

namespace detail {

// Cells of one CSV row; a cell in double quotes may hold commas, and a doubled quote inside it is a quote.
inline std::vector<std::string> csv_cells(std::string_view line, const std::string& where) {
  std::vector<std::string> cells;
  std::size_t at = 0;
  for (;;) {
    std::string cell;
    const std::size_t begin = line.find_first_not_of(" \t", at);
    if (begin != std::string_view::npos && line[begin] == '"') {
      at = begin + 1;
      for (;; ++at) {
        if (at >= line.size()) {
          refuse_file(where, "closed by a quote where one was opened", visible_text(line));
        }
        if (line[at] != '"') {
          cell += line[at];
        } else if (at + 1 < line.size() && line[at + 1] == '"') {
          cell += line[++at];
        } else {
          break;
        }
      }
      at = line.find_first_not_of(" \t", at + 1);
      if (at != std::string_view::npos && line[at] != ',') {
        refuse_file(where, "a comma after a quoted cell", visible_text(line));
      }
    } else {
      const std::size_t end = line.find(',', at);
      cell = trimmed(line.substr(at, end == std::string_view::npos ? end : end - at));
      at = end;
    }
    cells.push_back(std::move(cell));
    if (at == std::string_view::npos) {
      return cells;
    }
    ++at;
  }
}

}  // namespace detail

/// A series from text. The first column has to be `t_s` and to increase strictly; an empty cell is a missing value,
/// NaN. Channel names with a place, `level_mm@2.66,0.5`, may stand in quotes or bare: a bare header cell that is a
/// number belongs to the name before it. Throws std::runtime_error naming `name`, the line and what was expected.
inline Series parse_series(std::string_view text, const std::string& name) {
  Series series;
  std::size_t number = 0;
  while (const auto raw = detail::next_line(text)) {
    ++number;
    const std::string_view line = detail::trimmed(*raw);
    if (line.empty() || line.front() == '#') {
      continue;
    }
    const std::string where = name + ": line " + std::to_string(number);
    const std::vector<std::string> cells = detail::csv_cells(line, where);
    if (series.names.empty()) {
      for (const std::string& cell : cells) {
        if (!series.names.empty() && detail::parse_number(cell)) {
          series.names.back() += "," + cell;
          continue;
        }
        series.names.push_back(cell);
      }
      if (series.names.front() != "t_s") {
        detail::refuse_file(where + ", first column", "t_s", detail::visible_text(series.names.front()));
      }
      for (std::size_t k = 0; k < series.names.size(); ++k) {
        const auto end = series.names.begin() + static_cast<std::ptrdiff_t>(k);
        if (series.names[k].empty() || std::find(series.names.begin(), end, series.names[k]) != end) {
          detail::refuse_file(where + ", column " + std::to_string(k + 1), "a name that no other column has",
                              detail::visible_text(series.names[k]));
        }
        series.columns.emplace_back();
      }
      continue;
    }
    if (cells.size() != series.names.size()) {
      detail::refuse_file(where, std::to_string(series.names.size()) + " cells", std::to_string(cells.size()));
    }
    for (std::size_t k = 0; k < cells.size(); ++k) {
      const auto value = detail::parse_number(cells[k]);
      if (!value && !(cells[k].empty() && k > 0)) {
        detail::refuse_file(where + ", " + detail::visible_text(series.names[k]),
                            k > 0 ? "a finite number or empty" : "a finite number", detail::visible_text(cells[k]));
      }
      if (k == 0 && !series.columns[0].empty() && !(*value > series.columns[0].back())) {
        detail::refuse_file(where + ", t_s", "later than the row before", cells[0]);
      }
      series.columns[k].push_back(value ? *value : std::numeric_limits<double>::quiet_NaN());
    }
  }
  if (series.names.empty()) {
    throw std::runtime_error(name + ": must start with a header, got an empty file");
  }
  return series;
}

/// parse_series of a file of at most 256 MiB. Throws std::runtime_error.
inline Series read_series(const std::filesystem::path& path) {
  return parse_series(detail::read_text_file(path, std::uintmax_t{1} << 28), path.string());
}

/// The series as CSV that read_series takes back to the same bits; NaN becomes an empty cell.
inline std::string series_text(const Series& series) {
  std::string text;
  for (std::size_t k = 0; k < series.names.size(); ++k) {
    const std::string& name = series.names[k];
    text += k > 0 ? "," : "";
    if (name.find_first_of(",\"") == std::string::npos) {
      text += name;
      continue;
    }
    text += '"';
    for (const char c : name) {
      text += c;
      text += c == '"' ? "\"" : "";
    }
    text += '"';
  }
  text += '\n';
  for (std::size_t row = 0; row < series.rows(); ++row) {
    for (std::size_t k = 0; k < series.columns.size(); ++k) {
      const double value = series.columns[k][row];
      text += k > 0 ? "," : "";
      text += std::isfinite(value) ? detail::number_text(value) : "";
    }
    text += '\n';
  }
  return text;
}

inline void write_series(const std::filesystem::path& path, const Series& series) {
  detail::write_text_file(path, series_text(series));
}

}  // namespace decant::inline DECANT_TARGET
