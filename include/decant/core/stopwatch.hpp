// SPDX-License-Identifier: MIT
#pragma once

/// Wall time of what a scope does.

#include <chrono>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// Adds the time from its construction to its end to a total [ms]. Reading the clock twice takes some 50 ns.
class Stopwatch {
 public:
  explicit Stopwatch(double& total_ms) noexcept : total_ms_(total_ms), start_(Clock::now()) {}
  ~Stopwatch() { total_ms_ += std::chrono::duration<double, std::milli>(Clock::now() - start_).count(); }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  using Clock = std::chrono::steady_clock;

  double& total_ms_;
  Clock::time_point start_;
};

}  // namespace decant::inline DECANT_TARGET
