// SPDX-License-Identifier: MIT
#pragma once

/// The command line that all benchmarks share.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace decant_benchmark {

/// Options `--name value`, each with a default; those with the default "no" are switches and take no value. All
/// benchmarks have --csv, --only and --seconds, and those that can use threads --threads.
class Options {
 public:
  Options(std::string program, std::string what) : program_(std::move(program)), what_(std::move(what)) {
    add("seconds", "0.5", "time for each case [s]; at least 7 rounds are run");
    add("only", "", "measure comparisons whose title contains this text");
    add("csv", "", "also write the results to this file");
  }

  /// @param value the default. Adding an option once more replaces its default and meaning.
  Options& add(const std::string& name, const std::string& value, const std::string& meaning) {
    const auto at = std::find_if(all_.begin(), all_.end(), [&](const Option& o) { return o.name == name; });
    (at == all_.end() ? all_.emplace_back() : *at) = {name, value, meaning, value == "no"};
    return *this;
  }
  Options& add_threads() { return add("threads", "1,2", "numbers of threads to measure with"); }

  /// Allows one argument without a name, asked for as text("argument").
  Options& argument(const std::string& value, const std::string& meaning) {
    takes_argument_ = true;
    return add("argument", value, meaning);
  }

  /// False if help was asked for, and printed. Throws std::invalid_argument, one line, for what it does not know.
  bool parse(int count, char** arguments) {
    for (int k = 1; k < count; ++k) {
      const std::string_view word = arguments[k];
      if (word == "--help" || word == "-h") {
        print_help();
        return false;
      }
      const bool named = word.starts_with("--");
      Option* const option = named ? find(word.substr(2)) : takes_argument_ ? find("argument") : nullptr;
      if (option == nullptr || (named && option->name == "argument")) {
        throw std::invalid_argument("unknown argument " + std::string(word) + ", see --help");
      }
      if (named && !option->is_switch && ++k == count) {
        throw std::invalid_argument(std::string(word) + " needs a value: " + option->meaning);
      }
      option->value = option->is_switch ? "yes" : std::string(arguments[k]);
    }
    return true;
  }

  const std::string& program() const { return program_; }
  const std::string& text(std::string_view name) const { return const_cast<Options*>(this)->find(name)->value; }
  bool is_on(std::string_view name) const { return text(name) == "yes"; }

  /// Throws std::invalid_argument unless it is a number above zero.
  double number(std::string_view name) const { return number(name, text(name)); }

  /// Words between commas.
  std::vector<std::string> words(std::string_view name) const {
    std::vector<std::string> result{""};
    for (const char letter : text(name)) {
      if (letter == ',') {
        result.emplace_back();
      } else {
        result.back().push_back(letter);
      }
    }
    return result;
  }
  /// Whole numbers above zero between commas; throws std::invalid_argument if they are something else.
  std::vector<int> numbers(std::string_view name) const {
    std::vector<int> result;
    for (const std::string& word : words(name)) {
      const double value = number(name, word);
      if (value != std::floor(value) || value > 1e6) {
        throw std::invalid_argument("--" + std::string(name) + " must be whole numbers up to 1e6, got " + word);
      }
      result.push_back(static_cast<int>(value));
    }
    return result;
  }

 private:
  struct Option {
    std::string name, value, meaning;
    bool is_switch = false;
  };

  Option* find(std::string_view name) {
    const auto at = std::find_if(all_.begin(), all_.end(), [&](const Option& o) { return o.name == name; });
    return at == all_.end() ? nullptr : &*at;
  }
  static double number(std::string_view name, const std::string& word) {
    char* end = nullptr;
    const double value = std::strtod(word.c_str(), &end);
    if (word.empty() || *end != '\0' || !(value > 0) || !std::isfinite(value)) {
      throw std::invalid_argument("--" + std::string(name) + " must be a number > 0, got '" + word + "'");
    }
    return value;
  }
  void print_help() const {
    std::printf("%s: %s\n", program_.c_str(), what_.c_str());
    for (const Option& o : all_) {
      const std::string left = (o.name == "argument" ? "[" : "--") + o.name + (o.name == "argument" ? "]" : "");
      const std::string standard = o.value.empty() || o.is_switch ? "" : " (" + o.value + ")";
      std::printf("  %-14s %s%s\n", left.c_str(), o.meaning.c_str(), standard.c_str());
    }
  }

  std::string program_, what_;
  std::vector<Option> all_{};
  bool takes_argument_ = false;
};

}  // namespace decant_benchmark
