// SPDX-License-Identifier: MIT
#pragma once

/// Results of benchmarks, as a table and as a CSV file.

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <decant/core/batch.hpp>
#include <decant/core/expects.hpp>

#include "command_line.hpp"

namespace decant_benchmark {

/// What several samples of one figure come to.
struct Spread {
  double median = 0, low = 0, high = 0;  ///< low and high: the 10th and the 90th percentile

  Spread() = default;
  Spread(double single) : median(single), low(single), high(single) {}
  /// Throws std::invalid_argument if there are no samples.
  explicit Spread(std::vector<double> samples) {
    decant::expects(!samples.empty(), "Spread: number of samples", "at least 1", 0);
    std::sort(samples.begin(), samples.end());
    const auto quantile = [&samples](double share) {
      const double place = share * static_cast<double>(samples.size() - 1);
      const auto below = static_cast<std::size_t>(place);
      const double above = samples[std::min(below + 1, samples.size() - 1)];
      return samples[below] + (place - static_cast<double>(below)) * (above - samples[below]);
    };
    median = quantile(0.5);
    low = quantile(0.1);
    high = quantile(0.9);
  }

  friend Spread operator*(double factor, Spread spread) {
    spread.median *= factor;
    spread.low *= factor;
    spread.high *= factor;
    return spread;
  }
};

/// That built this program.
inline std::string compiler() {
#if defined(__clang__)
  return "clang " + std::to_string(__clang_major__) + "." + std::to_string(__clang_minor__);
#else
  return "gcc " + std::to_string(__GNUC__) + "." + std::to_string(__GNUC_MINOR__);
#endif
}

/// What it may assume of the processor, as far as decant cares.
inline std::string flags() {
  using decant::detail::vector_unit;
  using decant::detail::VectorUnit;
  std::string text = vector_unit == VectorUnit::Avx512 ? "AVX-512"
                     : vector_unit == VectorUnit::Avx2 ? "AVX2"
                                                       : "baseline";
#if !defined(__OPTIMIZE__)
  text += " not optimised";
#endif
#if !defined(_OPENMP)
  text += " no OpenMP";
#endif
  return text;
}

/// Of this machine.
inline std::string processor() {
  std::ifstream info("/proc/cpuinfo");
  std::string line;
  while (std::getline(info, line)) {
    if (line.starts_with("model name") && line.find(": ") != std::string::npos) {
      return line.substr(line.find(": ") + 2);
    }
  }
  return "unknown";
}

/// One measured figure.
struct Result {
  std::string name;  ///< the case
  long size = 0;     ///< of the problem: particles, points, pixels
  int threads = 1;
  Spread value{};
  std::string unit = "ms";
  std::optional<Spread> ratio{};  ///< to the reference
  std::string reference{};        ///< the case that the ratio is to
  std::string note{};
};

/// Prints results as a table and writes them to the file of --csv.
class Report {
 public:
  /// Throws std::runtime_error if the file cannot be written.
  explicit Report(const Options& options)
      : benchmark_(options.program()), only_(options.text("only")), seconds_(options.number("seconds")) {
    if (const std::string& file = options.text("csv"); !file.empty()) {
      csv_.open(file);
      csv_ << "benchmark,case,size,threads,median,low,high,unit,ratio,reference,compiler,flags,cpu,note\n";
      if (!csv_) {
        throw std::runtime_error("cannot write " + file);
      }
    }
  }

  double seconds() const { return seconds_; }  ///< for each case
  bool wants(const std::string& title) const { return title.find(only_) != std::string::npos; }

  bool empty() const { return !started_; }  ///< whether nothing was reported

  void heading(const std::string& title, long size, int threads) {
    if (!started_) {
      std::printf("%s; %s, %s, %s\n", benchmark_.c_str(), compiler().c_str(), flags().c_str(), processor().c_str());
      std::printf("median [10th .. 90th percentile], and the median of paired ratios to the case marked *\n");
      started_ = true;
    }
    std::printf("\n%s (size %ld, %d thread%s)\n", title.c_str(), size, threads, threads == 1 ? "" : "s");
  }

  /// @param title of the comparison that the result belongs to.
  void add(const std::string& title, const Result& result) {
    const bool is_reference = result.reference == result.name;
    std::printf("  %s %-44s %10.4g", is_reference ? "*" : " ", result.name.c_str(), result.value.median);
    if (result.value.low < result.value.high) {
      std::printf(" [%.4g .. %.4g]", result.value.low, result.value.high);
    }
    std::printf(" %s", result.unit.c_str());
    if (result.ratio && !is_reference) {
      std::printf("  x %.3g", result.ratio->median);
      if (result.ratio->low < result.ratio->high) {
        std::printf(" [%.3g .. %.3g]", result.ratio->low, result.ratio->high);
      }
    }
    std::printf("%s%s\n", result.note.empty() ? "" : "  # ", result.note.c_str());
    std::fflush(stdout);
    if (!csv_.is_open()) {
      return;
    }
    csv_ << benchmark_ << ',' << quoted(title + ": " + result.name) << ',' << result.size << ',' << result.threads
         << ',' << result.value.median << ',' << result.value.low << ',' << result.value.high << ',' << result.unit
         << ',';
    if (result.ratio) {
      csv_ << result.ratio->median;
    }
    csv_ << ',' << quoted(result.reference.empty() ? "" : title + ": " + result.reference) << ',' << compiler() << ','
         << flags() << ',' << quoted(processor()) << ',' << quoted(result.note) << std::endl;
  }

 private:
  static std::string quoted(std::string text) {
    for (std::size_t at = 0; (at = text.find('"', at)) != std::string::npos; at += 2) {
      text.insert(at, 1, '"');
    }
    return text.find_first_of(",\"") == std::string::npos ? text : '"' + text + '"';
  }

  std::string benchmark_, only_;
  double seconds_;
  std::ofstream csv_{};
  bool started_ = false;
};

}  // namespace decant_benchmark
