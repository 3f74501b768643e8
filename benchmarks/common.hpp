// SPDX-License-Identifier: MIT
#pragma once

/// How all benchmarks measure: cases are compared with a reference that runs beside them, in turns. Test liquids and
/// meshes are in inputs.hpp.
///
/// Why not Google Benchmark: it runs one case after the other. Clock rates and neighbours on the same processor drift
/// by more than most differences of interest, and only what runs in turns sees the same drift.

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <deque>
#include <exception>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>

#include "command_line.hpp"
#include "report.hpp"

namespace decant_benchmark {

/// Keeps a result from being optimised away.
template <class Value>
void keep(const Value& value) {
  asm volatile("" : : "g"(&value) : "memory");
}

/// Wall time of f() [s].
template <class Function>
double seconds_of(Function&& f) {
  const auto start = std::chrono::steady_clock::now();
  f();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// What times are reported in.
struct Unit {
  const char* name;
  double per_second;
};
inline constexpr Unit milliseconds{"ms", 1e3};

/// Cases that do the same thing in different ways, or parts of one thing, measured in turns: A B C, C B A, ... A sample
/// is a batch of calls of at least 2 ms.
class Comparison {
 public:
  /// run(turn) is what is timed. Calls of one sample count `turn` up, and samples of one round begin alike: a case with
  /// inputs takes inputs[turn % inputs.size()], with 16 inputs or more, since a processor learns the branches of one.
  using Call = std::function<void(std::size_t turn)>;

  struct Case {
    std::string name;
    Call run{};
    Call prepare{};    ///< called before each sample, not timed; then all calls of a sample have one input
    double scale = 1;  ///< the time of a call times this is what is reported
    std::string note{};
    int calls = 1;                                 ///< per sample
    std::vector<double> seconds{};                 ///< per call, scaled: one for each round
    std::function<double()> measured_elsewhere{};  ///< a sample by another program, in place of run [s]
  };

  Comparison(Report& report, std::string title, long size, int threads, Unit unit = milliseconds)
      : report_(report), title_(std::move(title)), size_(size), threads_(threads), unit_(unit) {}

  /// The case returned may be completed until run(). The first one added is the reference.
  Case& add(std::string name, Call run, std::string note = "") {
    Case& added = cases_.emplace_back(Case{std::move(name), std::move(run)});
    added.note = std::move(note);
    return added;
  }

  /// A case that another program measures; called once in each round [s].
  Case& add_from_elsewhere(std::string name, std::function<double()> sample) {
    Case& added = add(std::move(name), {});
    added.measured_elsewhere = std::move(sample);
    return added;
  }

  /// (time of `more` - time of `less`) / parts, round by round: what one of several equal parts takes.
  Case& add_difference(std::string name, const std::string& more, const std::string& less, double parts) {
    differences_.push_back({name, more, less, parts});
    return add(std::move(name), {});
  }

  /// Measures all cases and reports them.
  void run() {
    if (cases_.empty() || !report_.wants(title_)) {
      return;
    }
    measure();
    for (const Difference& difference : differences_) {
      const std::vector<double>&more = find(difference.more).seconds, &less = find(difference.less).seconds;
      for (std::size_t round = 0; round < more.size(); ++round) {
        find(difference.name).seconds.push_back((more[round] - less[round]) / difference.parts);
      }
    }
    report_.heading(title_, size_, threads_);
    const Case& reference = cases_.front();
    for (const Case& c : cases_) {
      std::vector<double> ratios;
      for (std::size_t round = 0; round < c.seconds.size(); ++round) {
        ratios.push_back(c.seconds[round] / reference.seconds[round]);
      }
      report_.add(title_, {c.name, size_, threads_, unit_.per_second * Spread(c.seconds), unit_.name, Spread(ratios),
                           reference.name, c.note});
    }
  }

 private:
  struct Difference {
    std::string name, more, less;
    double parts;
  };

  Case& find(const std::string& name) {
    const auto at = std::find_if(cases_.begin(), cases_.end(), [&](const Case& c) { return c.name == name; });
    decant::expects(at != cases_.end(), "Comparison: case", "one that was added", name);
    return *at;
  }

  static double sample(Case& c, std::size_t turn, int calls) {
    if (c.measured_elsewhere) {
      return c.measured_elsewhere();
    }
    if (c.prepare) {
      c.prepare(turn);
    }
    const double seconds = seconds_of([&] {
      for (int k = 0; k < calls; ++k) {
        c.run(turn + static_cast<std::size_t>(k));
      }
    });
    return c.scale * seconds / calls;
  }

  void measure() {
    std::vector<Case*> timed;
    for (Case& c : cases_) {
      if (c.run) {
        sample(c, 0, 1);  // to warm up: buffers grow, pages are touched
        c.calls = static_cast<int>(std::clamp(2e-3 * c.scale / std::max(sample(c, 1, 1), 1e-9), 0.0, 1e6)) + 1;
      }
      if (c.run || c.measured_elsewhere) {
        timed.push_back(&c);
      }
    }
    const double budget = report_.seconds() * static_cast<double>(timed.size());
    double spent = 0;
    for (std::size_t round = 0; round < 7 || (spent < budget && round < 1000); ++round) {
      spent += seconds_of([&] {
        for (Case* const c : timed) {
          c->seconds.push_back(sample(*c, round, c->calls));
        }
      });
      std::reverse(timed.begin(), timed.end());  // so that a drift within a round favours nobody
    }
  }

  Report& report_;
  std::string title_;
  long size_;
  int threads_;
  Unit unit_;
  std::deque<Case> cases_{};  // references to cases stay valid
  std::vector<Difference> differences_{};
};

/// The body of a main(): parses the command line, calls body(options, report), and turns what is thrown into one line.
template <class Body>
int benchmark_main(int count, char** arguments, Options options, Body&& body) {
  try {
    if (options.parse(count, arguments)) {
      Report report(options);
      body(static_cast<const Options&>(options), report);
      if (report.empty()) {
        throw std::invalid_argument("nothing to measure: no title contains '" + options.text("only") + "'");
      }
    }
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", options.program().c_str(), error.what());
    return 2;
  }
}

}  // namespace decant_benchmark
