// SPDX-License-Identifier: MIT
#pragma once

/// Aligned tables of text for terminals.

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// Rows of cells under a header; the first column is flush left, the others flush right.
class Table {
 public:
  explicit Table(std::vector<std::string> header) : rows_{std::move(header)} {}

  /// Cells beyond the header's are dropped, missing ones are empty.
  void add(std::vector<std::string> row) {
    row.resize(rows_.front().size());
    rows_.push_back(std::move(row));
  }

  const std::vector<std::vector<std::string>>& rows() const { return rows_; }  ///< the header is the first

  /// Lines with their ends; a rule below the header.
  std::string text() const {
    std::vector<std::size_t> width(rows_.front().size(), 0);
    for (const auto& row : rows_) {
      for (std::size_t k = 0; k < row.size(); ++k) {
        width[k] = std::max(width[k], columns(row[k]));
      }
    }
    std::string out;
    for (std::size_t r = 0; r < rows_.size(); ++r) {
      std::string line;
      for (std::size_t k = 0; k < width.size(); ++k) {
        const std::string& cell = rows_[r][k];
        const std::string blank(width[k] - columns(cell), ' ');
        line += k > 0 ? "  " : "";
        line += k > 0 ? blank + cell : cell + blank;
      }
      out += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
      if (r == 0) {
        std::size_t total = 2 * (width.empty() ? 0 : width.size() - 1);
        for (const std::size_t w : width) {
          total += w;
        }
        out += std::string(total, '-') + "\n";
      }
    }
    return out;
  }

 private:
  // Characters of UTF-8 text: every byte but those that continue one.
  static std::size_t columns(const std::string& text) {
    return static_cast<std::size_t>(std::count_if(
        text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }));
  }

  std::vector<std::vector<std::string>> rows_;
};

}  // namespace decant::inline DECANT_TARGET
