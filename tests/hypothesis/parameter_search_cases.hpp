// SPDX-License-Identifier: MIT
#pragma once

/// Misfits whose minimum is known, for the tests of searches.

#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <decant/core/parallel.hpp>
#include <decant/hypothesis/evaluation.hpp>
#include <decant/hypothesis/parameter_axis.hpp>
#include <decant/hypothesis/thread_executor.hpp>

namespace search_cases {

using Point = std::vector<double>;
using Function = std::function<double(const Point&)>;

inline std::vector<decant::ParameterAxis> unit_axes(std::size_t count, int grid_values = 11) {
  std::vector<decant::ParameterAxis> axes;
  for (std::size_t k = 0; k < count; ++k) {
    axes.push_back({"p" + std::to_string(k), "", 0, 1, decant::AxisScale::Linear, grid_values});
  }
  return axes;
}

/// Evaluates a function, and counts.
struct Counted {
  Function misfit;
  std::size_t evaluations = 0, batches = 0;
  std::vector<std::size_t> sizes{};

  std::vector<decant::JobResult> operator()(const std::vector<Point>& points) {
    ++batches;
    sizes.push_back(points.size());
    std::vector<decant::JobResult> results;
    for (const Point& point : points) {
      ++evaluations;
      results.push_back({misfit(point)});
    }
    return results;
  }
};

/// A value in (0, 1) that depends on a point and a seed in no simple way: what chaos does to a simulation.
inline double scatter(const Point& point, std::uint32_t seed) {
  std::vector<std::uint32_t> words{seed};
  for (const double x : point) {
    words.push_back(static_cast<std::uint32_t>(std::llround(x * 1e6)));
  }
  std::seed_seq sequence(words.begin(), words.end());
  std::mt19937 random(sequence);
  return (static_cast<double>(random()) + 0.5) / 4294967296.0;
}

/// The same, of a standard normal distribution (Box and Muller 1958).
inline double normal_scatter(const Point& point, std::uint32_t seed) {
  return std::sqrt(-2 * std::log(scatter(point, seed))) * std::cos(6.283185307179586 * scatter(point, seed + 1000003));
}

}  // namespace search_cases
