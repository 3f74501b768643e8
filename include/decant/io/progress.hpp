// SPDX-License-Identifier: MIT
#pragma once

/// Progress of a long run on a terminal: one line that is written over, with the time left.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>

#if defined(_WIN32)
#include <io.h>
#else
#include <unistd.h>
#endif

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// Shows how far a run from 0 to `total` has come, at most ten times a second. Silent where the stream is not a
/// terminal.
class Progress {
 public:
  /// `stream` must live as long as this object, which does not own it.
  Progress(std::string label, double total, std::FILE* stream = stderr)
      : Progress(std::move(label), total, stream, is_terminal(stream)) {}

  /// Shown or not, whatever the stream is.
  Progress(std::string label, double total, std::FILE* stream, bool shown)
      : label_(std::move(label)), total_(total), stream_(stream), shown_(shown), start_(Clock::now()) {}

  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  ~Progress() { finish(); }

  /// Writes the line anew; `done` is in the unit of `total`, `note` stands at its end.
  void update(double done, const std::string& note = {}) {
    const auto now = Clock::now();
    if (!shown_ || (written_ > 0 && now - last_ < std::chrono::milliseconds(100))) {
      return;
    }
    last_ = now;
    const double fraction = total_ > 0 ? std::clamp(done / total_, 0.0, 1.0) : 1.0;
    const double seconds = std::chrono::duration<double>(now - start_).count();
    std::string line = label_ + " " + std::to_string(static_cast<int>(100 * fraction)) + " %";
    if (fraction > 0.01) {
      line += ", " + duration(seconds * (1 - fraction) / fraction) + " left";
    }
    line += note.empty() ? "" : ", " + note;
    const std::size_t length = line.size();
    line += std::string(written_ > length ? written_ - length : 0, ' ');  // covers the rest of a longer line
    written_ = length;
    std::fprintf(stream_, "\r%s", line.c_str());
    std::fflush(stream_);
  }

  /// Clears the line; what is printed next starts on an empty one.
  void finish() {
    if (written_ > 0) {
      std::fprintf(stream_, "\r%s\r", std::string(written_, ' ').c_str());
      std::fflush(stream_);
      written_ = 0;
    }
  }

 private:
  using Clock = std::chrono::steady_clock;

  static bool is_terminal(std::FILE* stream) {
#if defined(_WIN32)
    return _isatty(_fileno(stream)) != 0;
#else
    return isatty(fileno(stream)) != 0;
#endif
  }

  static std::string duration(double seconds) {
    const int whole = static_cast<int>(std::min(std::ceil(seconds), 359999.0));
    const std::string two_digits = (whole % 60 < 10 ? "0" : "") + std::to_string(whole % 60);
    return std::to_string(whole / 60) + ":" + two_digits + " min";
  }

  std::string label_;
  double total_;
  std::FILE* stream_;
  bool shown_;
  Clock::time_point start_;
  Clock::time_point last_{};
  std::size_t written_ = 0;
};

}  // namespace decant::inline DECANT_TARGET
