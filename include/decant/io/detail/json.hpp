// SPDX-License-Identifier: MIT
#pragma once

/// A strict view of JSON documents for readers that refuse with one line: file, key, expected, got. Bounds on depth,
/// no key twice, no unknown keys, finite numbers in a stated range.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/io/detail/text.hpp>

namespace decant::inline DECANT_TARGET::detail {

/// A value inside a document with its path, as messages name it. Does not own the document.
class JsonNode {
 public:
  JsonNode(const nlohmann::json& value, std::string file, std::string path = {})
      : value_(&value), file_(std::move(file)), path_(std::move(path)) {}

  const nlohmann::json& value() const { return *value_; }
  const std::string& path() const { return path_; }

  /// "file: path" for messages.
  std::string where() const { return path_.empty() ? file_ : file_ + ": " + path_; }

  [[noreturn]] void refuse(std::string_view expected) const {
    using nlohmann::json;
    std::string got = value_->dump(-1, ' ', true, json::error_handler_t::replace);
    if (got.size() > 60) {
      got.resize(57);
      got += "...";
    }
    refuse_file(where(), expected, got);
  }

  /// Refuses what is not an object, and any key that is not among `known`.
  void expect_keys(std::initializer_list<std::string_view> known) const {
    if (!value_->is_object()) {
      refuse("an object");
    }
    for (const auto& item : value_->items()) {
      bool found = false;
      std::string list;
      for (const std::string_view key : known) {
        found = found || item.key() == key;
        list.append(list.empty() ? "" : ", ").append(key);
      }
      if (!found) {
        refuse_file((path_.empty() ? file_ : where()) + ": a key", "one of " + list, visible_text(item.key()));
      }
    }
  }

  std::optional<JsonNode> find(const std::string& key) const {
    const auto item = value_->find(key);
    if (item == value_->end()) {
      return std::nullopt;
    }
    return JsonNode(*item, file_, path_.empty() ? key : path_ + "." + key);
  }

  JsonNode at(const std::string& key) const {
    auto found = find(key);
    if (!found) {
      throw std::runtime_error(file_ + ": " + (path_.empty() ? key : path_ + "." + key) + " is missing");
    }
    return *found;
  }

  std::vector<JsonNode> elements(std::size_t limit) const {
    if (!value_->is_array() || value_->size() > limit) {
      refuse("an array of at most " + std::to_string(limit) + " elements");
    }
    std::vector<JsonNode> nodes;
    for (std::size_t k = 0; k < value_->size(); ++k) {
      nodes.emplace_back((*value_)[k], file_, path_ + "[" + std::to_string(k) + "]");
    }
    return nodes;
  }

  /// A finite number in [low, high]; `expected` says so in words.
  double number(double low, double high, std::string_view expected) const {
    if (!value_->is_number()) {
      refuse(expected);
    }
    const double number = value_->get<double>();
    if (!(number >= low && number <= high)) {
      refuse(expected);
    }
    return number;
  }

  std::string text(std::size_t limit = 200) const {
    if (!value_->is_string()) {
      refuse("a string");
    }
    const std::string text = value_->get<std::string>();
    bool plain = !text.empty() && text.size() <= limit;
    for (const char c : text) {
      plain = plain && static_cast<unsigned char>(c) >= ' ' && c != '\x7f';
    }
    if (!plain) {
      refuse("a string of 1 to " + std::to_string(limit) + " characters without control characters");
    }
    return text;
  }

  Vector3<double> vector(double bound, std::string_view expected) const {
    if (!value_->is_array() || value_->size() != 3) {
      refuse(expected);
    }
    Vector3<double> out;
    const std::vector<JsonNode> entries = elements(3);
    for (std::size_t k = 0; k < 3; ++k) {
      out[static_cast<Index>(k)] = entries[k].number(-bound, bound, expected);
    }
    return out;
  }

  /// A whole number in [low, high], also where it is written as 3.0; `expected` says so in words.
  std::int64_t whole_number(std::int64_t low, std::int64_t high, std::string_view expected) const {
    const double value = number(static_cast<double>(low), static_cast<double>(high), expected);
    if (value != std::floor(value)) {
      refuse(expected);
    }
    return static_cast<std::int64_t>(value);
  }

  /// A path that does not leave the folder that it is relative to, as far as its text tells.
  std::filesystem::path relative_path() const {
    std::filesystem::path relative = text(4096);
    bool inside = relative.is_relative();
    for (const std::filesystem::path& part : relative) {
      inside = inside && part != "..";
    }
    if (!inside) {
      refuse("a path that stays inside the file's folder");
    }
    return relative;
  }

  /// The file that this string names, which has to exist inside `folder`, links resolved.
  std::filesystem::path file_inside(const std::filesystem::path& folder) const {
    namespace fs = std::filesystem;
    const fs::path relative = relative_path();
    std::error_code error;
    const fs::path root = fs::canonical(folder.empty() ? fs::path(".") : folder, error);
    if (error) {
      refuse("a file in an existing folder");
    }
    const fs::path path = fs::canonical(root / relative, error);
    if (error || !fs::is_regular_file(path, error)) {
      refuse("an existing file");
    }
    const fs::path back = path.lexically_relative(root);
    if (back.empty() || *back.begin() == "..") {
      refuse("a path that stays inside the file's folder, also behind links");
    }
    return path;
  }

 private:
  const nlohmann::json* value_;
  std::string file_;
  std::string path_;
};

/// The document in `text`. Throws std::runtime_error naming `file` where it does not parse, nests deeper than
/// `depth_limit` or says a key twice.
inline nlohmann::json parse_json(std::string_view text, const std::string& file, int depth_limit = 16) {
  using nlohmann::json;
  std::vector<std::set<std::string>> keys;  // of the objects that are open
  const auto look = [&](int depth, json::parse_event_t event, json& parsed) {
    if (depth > depth_limit) {
      refuse_file(file + ": nesting", "at most " + std::to_string(depth_limit) + " levels deep", "more");
    }
    if (event == json::parse_event_t::object_start) {
      keys.emplace_back();
    } else if (event == json::parse_event_t::object_end) {
      keys.pop_back();
    } else if (event == json::parse_event_t::key) {
      const std::string key = parsed.get<std::string>();
      if (!keys.back().insert(key).second) {
        refuse_file(file + ": key " + visible_text(key), "given once in its object", "it twice");
      }
    }
    return true;
  };
  try {
    return json::parse(text.begin(), text.end(), look);
  } catch (const json::exception& error) {
    std::string reason = error.what();
    for (char& c : reason) {
      c = c >= ' ' && c <= '~' ? c : '?';
    }
    throw std::runtime_error(file + ": must be JSON: " + reason.substr(0, 300));
  }
}

}  // namespace decant::inline DECANT_TARGET::detail
