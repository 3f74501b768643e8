// SPDX-License-Identifier: MIT
#pragma once

/// What every reader of text files needs: a file as a string with a bound on its size, lines, cells, strict numbers,
/// and refusals that stay on one line whatever the file holds.

#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET::detail {

/// At most `limit` bytes of text, with control characters and quotes made visible: safe inside a one-line message.
inline std::string visible_text(std::string_view text, std::size_t limit = 60) {
  std::string out = "\"";
  for (std::size_t k = 0; k < text.size() && k < limit; ++k) {
    const char c = text[k];
    const bool plain = c >= ' ' && c <= '~' && c != '"' && c != '\\';
    if (plain) {
      out += c;
    } else {
      constexpr char digits[] = "0123456789abcdef";
      const auto byte = static_cast<unsigned char>(c);
      out += "\\x";
      out += digits[byte >> 4];
      out += digits[byte & 15U];
    }
  }
  out += text.size() > limit ? "...\"" : "\"";
  return out;
}

/// Throws std::runtime_error "where must be expected, got what" in one line.
[[noreturn]] inline void refuse_file(std::string_view where, std::string_view expected, std::string_view got) {
  std::string line(where);
  line.append(" must be ").append(expected).append(", got ").append(got);
  throw std::runtime_error(line);
}

/// The whole file. Throws std::runtime_error where it cannot be read or holds more than `byte_limit` bytes.
inline std::string read_text_file(const std::filesystem::path& path, std::uintmax_t byte_limit) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    throw std::runtime_error(path.string() + ": no such file");
  }
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error || size > byte_limit) {
    refuse_file(path.string() + ": size [bytes]", "at most " + std::to_string(byte_limit),
                error ? error.message() : std::to_string(size));
  }
  std::ifstream file(path, std::ios::binary);
  std::string text(static_cast<std::size_t>(size), '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (!file) {
    throw std::runtime_error(path.string() + ": cannot be read");
  }
  return text;
}

/// Writes the text, or throws std::runtime_error that names the file.
inline void write_text_file(const std::filesystem::path& path, std::string_view text) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(text.data(), static_cast<std::streamsize>(text.size()));
  file.close();
  if (!file) {
    throw std::runtime_error(path.string() + ": cannot be written");
  }
}

inline std::string_view trimmed(std::string_view text) {
  constexpr std::string_view blank = " \t\r\n";
  const std::size_t begin = text.find_first_not_of(blank);
  if (begin == std::string_view::npos) {
    return {};
  }
  return text.substr(begin, text.find_last_not_of(blank) - begin + 1);
}

/// The next line without its end (LF or CR LF), which is cut off `rest`; nothing where `rest` is used up.
inline std::optional<std::string_view> next_line(std::string_view& rest) {
  if (rest.empty()) {
    return std::nullopt;
  }
  const std::size_t end = rest.find('\n');
  std::string_view line = rest.substr(0, end);
  rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
  if (!line.empty() && line.back() == '\r') {
    line.remove_suffix(1);
  }
  return line;
}

/// Cells between separators, trimmed.
inline std::vector<std::string_view> split(std::string_view line, char separator) {
  std::vector<std::string_view> cells;
  for (;;) {
    const std::size_t end = line.find(separator);
    cells.push_back(trimmed(line.substr(0, end)));
    if (end == std::string_view::npos) {
      return cells;
    }
    line.remove_prefix(end + 1);
  }
}

/// The whole of `text` as a finite number (decimal point, whatever the locale), or nothing.
inline std::optional<double> parse_number(std::string_view text) {
  if (!text.empty() && text.front() == '+') {  // from_chars takes no plus sign; numbers in files may carry one
    text.remove_prefix(1);
    if (!text.empty() && text.front() == '-') {
      return std::nullopt;
    }
  }
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

/// Shortest text that reads back as the same number.
inline std::string number_text(double value) {
  char buffer[32];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value);
  return error == std::errc() ? std::string(buffer, end) : std::string("nan");
}

/// Fixed digits after the point, for people.
inline std::string fixed_text(double value, int digits) {
  char buffer[352];  // the largest double has 309 digits before the point
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::fixed, digits);
  return error == std::errc() ? std::string(buffer, end) : std::string("nan");
}

}  // namespace decant::inline DECANT_TARGET::detail
