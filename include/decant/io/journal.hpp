// SPDX-License-Identifier: MIT
#pragma once

/// Results of long sweeps, kept in a file as they come, so that a run that was killed goes on where it was.

#include <algorithm>
#include <bit>
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
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/hypothesis/executor.hpp>
#include <decant/io/detail/text.hpp>

namespace decant::inline DECANT_TARGET {

namespace detail {

/// A finite number as the shortest text that reads back to the same bits, any other by its bits: NaN may carry a load.
inline std::string bit_exact_text(double value) {
  if (std::isfinite(value)) {
    return number_text(value);
  }
  char buffer[17] = "#";
  const auto end = std::to_chars(buffer + 1, buffer + sizeof buffer, std::bit_cast<std::uint64_t>(value), 16).ptr;
  return std::string(buffer, end);
}

/// The whole of `text` as such a number, or nothing.
inline std::optional<double> parse_bit_exact(std::string_view text) {
  if (text.empty() || text.front() != '#') {
    return parse_number(text);
  }
  std::uint64_t bits = 0;
  const auto [end, error] = std::from_chars(text.data() + 1, text.data() + text.size(), bits, 16);
  if (error != std::errc() || end != text.data() + text.size()) {
    return std::nullopt;
  }
  return std::bit_cast<double>(bits);
}

/// Text without tabs and ends of lines, from which the same text can be made again.
inline std::string on_one_line(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '\t':
        out += "\\t";
        break;
      case '\n':
        out += "\\n";
        break;
      case '\r':
        out += "\\r";
        break;
      case '\\':
        out += "\\\\";
        break;
      default:
        out += c;
    }
  }
  return out;
}

inline bool equal_bits(const JobResult& a, const JobResult& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](double x, double y) {
    return std::bit_cast<std::uint64_t>(x) == std::bit_cast<std::uint64_t>(y);
  });
}

}  // namespace detail

/// Results by key, in a text file: a line that says what results depend on, then one line per result,
///   key <tab> how many numbers <tab> number <tab> number ...
/// with numbers that come back to the bit. Lines are appended and handed to the system at once, so that a process may
/// be killed at any time: a last line that is not whole is dropped. One process at a time may have the file open.
class Journal {
 public:
  /// Opens the file, or begins it. Its folder has to exist.
  /// @param fingerprint whatever results depend on beside their key: settings as JSON, a version, a recording's name.
  /// Throws std::runtime_error, naming the file, if it is of another fingerprint, if it is no journal, or if a line of
  /// it is damaged or says something else of a key than an earlier one; such a file is left as it is.
  Journal(std::filesystem::path path, std::string_view fingerprint) { open(std::move(path), fingerprint); }

  /// The same where an executor has several processes, all of which call this: process 0 has the file, and the journals
  /// of the others know nothing. What is thrown is thrown in all of them, in the others as Executor says.
  template <Executor ExecutorType>
  Journal(ExecutorType& executor, const std::filesystem::path& path, std::string_view fingerprint) {
    const auto open_here = [&](std::size_t) {
      open(path, fingerprint);
      return JobResult{};
    };
    static_cast<void>(executor.run(1, open_here, tell_nobody));
  }

  std::size_t size() const noexcept { return results_.size(); }
  /// The result of a key, or nullptr.
  const JobResult* find(const std::string& key) const {
    const auto found = results_.find(key);
    return found == results_.end() ? nullptr : &found->second;
  }

  /// Takes one more result. Throws std::invalid_argument for a key that has one, and std::runtime_error, naming the
  /// file, if it cannot be written, now and from then on.
  void add(const std::string& key, const JobResult& result) {
    expects(find(key) == nullptr, "Journal: key", "one that has no result yet", key);
    if (!file_.is_open()) {
      throw std::runtime_error("Journal: only process 0 has the file");
    }
    std::string line = detail::on_one_line(key) + '\t' + std::to_string(result.size());
    for (const double number : result) {
      line += '\t';
      line += detail::bit_exact_text(number);
    }
    write(line + '\n');
    results_.emplace(key, result);
  }

 private:
  static constexpr std::string_view first_words = "decant journal 1";

  void open(std::filesystem::path path, std::string_view fingerprint) {
    path_ = std::move(path);
    const std::string header = std::string(first_words) + '\t' + detail::on_one_line(fingerprint) + '\n';
    std::error_code ignored;
    const bool there = std::filesystem::exists(path_, ignored);
    const std::size_t whole = there ? read(header) : 0;
    if (there && whole < std::filesystem::file_size(path_)) {
      std::filesystem::resize_file(path_, whole);
    }
    file_.open(path_, std::ios::binary | std::ios::app);
    write(whole == 0 ? header : "");
  }

  /// @return up to which byte lines are whole.
  std::size_t read(const std::string& header) {
    const std::string text = detail::read_text_file(path_, std::uintmax_t{1} << 32);
    const std::string name = path_.string();
    const std::size_t header_end = text.find('\n');
    if (header_end == std::string::npos) {
      // killed while it wrote its first line: anything else is somebody else's file
      if (!header.starts_with(text)) {
        detail::refuse_file(name + ": line 1", "the beginning of a journal", detail::visible_text(text));
      }
      return 0;
    }
    const std::string_view first = std::string_view(text).substr(0, header_end + 1);
    if (!first.starts_with(std::string(first_words) + '\t')) {
      detail::refuse_file(name + ": line 1", detail::visible_text(first_words), detail::visible_text(first));
    }
    if (first != header) {
      refuse_fingerprint(first.substr(0, header_end), std::string_view(header).substr(0, header.size() - 1));
    }
    std::size_t begin = header_end + 1;
    for (std::size_t line = 2, end = 0; (end = text.find('\n', begin)) != std::string::npos; ++line) {
      read_line(std::string_view(text).substr(begin, end - begin), name + ": line " + std::to_string(line));
      begin = end + 1;
    }
    return begin;
  }

  [[noreturn]] void refuse_fingerprint(std::string_view found, std::string_view expected) const {
    const auto differ = std::mismatch(found.begin(), found.end(), expected.begin(), expected.end());
    // long settings are alike at first: show where they are not
    const auto place = static_cast<std::size_t>(differ.first - found.begin());
    const std::size_t begin = std::max(first_words.size() + 1, place > 40 ? place - 40 : 0);
    detail::refuse_file(path_.string() + ": fingerprint", detail::visible_text(expected.substr(begin), 120),
                        detail::visible_text(found.substr(begin), 120) + ": results of something else");
  }

  void read_line(std::string_view line, const std::string& where) {
    const std::size_t key_end = std::min(line.find('\t'), line.size());
    const std::optional<std::string> key = key_of(line.substr(0, key_end));
    std::optional<std::size_t> count;
    JobResult result;
    bool whole = key && key_end < line.size();
    for (std::size_t at = key_end; whole && at < line.size();) {
      const std::size_t begin = at + 1, end = std::min(line.find('\t', begin), line.size());
      const std::string_view cell = line.substr(begin, end - begin);
      at = end;
      if (!count) {
        std::size_t number = 0;
        const auto [stop, error] = std::from_chars(cell.data(), cell.data() + cell.size(), number);
        whole = error == std::errc() && stop == cell.data() + cell.size();
        count = number;
      } else if (const std::optional<double> value = detail::parse_bit_exact(cell)) {
        result.push_back(*value);
      } else {
        whole = false;
      }
    }
    if (!whole || count != result.size()) {
      detail::refuse_file(where, "a key, a count, and as many numbers", detail::visible_text(line));
    }
    const auto [known, is_new] = results_.try_emplace(*key, result);
    if (!is_new && !detail::equal_bits(known->second, result)) {
      detail::refuse_file(where, "of a new key, or what was there before", detail::visible_text(line));
    }
  }

  static std::optional<std::string> key_of(std::string_view text) {
    std::string key;
    for (std::size_t k = 0; k < text.size(); ++k) {
      if (text[k] != '\\') {
        key += text[k];
        continue;
      }
      const char next = ++k < text.size() ? text[k] : '\0';
      if (next != 't' && next != 'n' && next != 'r' && next != '\\') {
        return std::nullopt;
      }
      key += next == 't' ? '\t' : next == 'n' ? '\n' : next == 'r' ? '\r' : '\\';
    }
    return key;
  }

  void write(std::string_view text) {
    file_.write(text.data(), static_cast<std::streamsize>(text.size()));
    file_.flush();
    if (!file_) {
      throw std::runtime_error(path_.string() + ": cannot be written");
    }
  }

  std::filesystem::path path_{};
  std::ofstream file_{};
  std::unordered_map<std::string, JobResult> results_{};
};

/// Runs, on any Executor, only those jobs whose keys the journal does not have, and writes down each as it ends. With
/// several processes all of them call this with the same keys; what process 0 read is what all of them know.
/// @param keys of the jobs, all different. @param work work(k) for keys[k]; it may run in any process, since which jobs
/// are left depends on the journal. @param done done(k, result), as Executor says, of jobs that ran now.
/// @return all results in the order of the keys. Throws what Executor::run throws, with the results so far in the file.
template <Executor ExecutorType, class Work, class Done>
std::vector<JobResult> run_journaled(ExecutorType& executor, Journal& journal, const std::vector<std::string>& keys,
                                     Work&& work, Done&& done) {
  std::unordered_set<std::string_view> different;
  for (const std::string& key : keys) {
    expects(different.insert(key).second, "run_journaled: keys", "all different", key);
  }
  // for each key how many numbers are known, plus one, then the numbers; 0 for a key that is not known
  const std::vector<JobResult> known = executor.run(
      1,
      [&](std::size_t) {
        JobResult all;
        for (const std::string& key : keys) {
          const JobResult* result = journal.find(key);
          all.push_back(result != nullptr ? static_cast<double>(result->size() + 1) : 0);
          if (result != nullptr) {
            all.insert(all.end(), result->begin(), result->end());
          }
        }
        return all;
      },
      tell_nobody);
  std::vector<JobResult> results(keys.size());
  std::vector<std::size_t> missing;
  auto next = known.front().begin();
  for (std::size_t k = 0; k < keys.size(); ++k) {
    const double there = *next++;
    if (there == 0) {
      missing.push_back(k);
      continue;
    }
    const auto end = next + static_cast<std::ptrdiff_t>(there - 1);
    results[k].assign(next, end);
    next = end;
  }
  std::vector<JobResult> computed = executor.run(
      missing.size(), [&](std::size_t m) { return work(missing[m]); },
      [&](std::size_t m, const JobResult& result) {
        journal.add(keys[missing[m]], result);
        done(missing[m], result);
      });
  for (std::size_t m = 0; m < missing.size(); ++m) {
    results[missing[m]] = std::move(computed[m]);
  }
  return results;
}

}  // namespace decant::inline DECANT_TARGET
