// SPDX-License-Identifier: MIT
#pragma once

/// What all benchmarks share: a clock, medians, test liquids, a test cup, and rows of CSV that name the circumstances.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/batch.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/types.hpp>

namespace decant_benchmark {

using decant::Index;

/// Seconds per call of f: median, and half the distance between the quartiles.
struct Timing {
  int repetitions = 0;
  double median = 0;
  double spread = 0;
  double fastest = 0;
};

/// Calls f once to warm up, then in batches of at least 2 ms until `seconds` are over, and at least 7 times.
template <class Function>
Timing time_of(Function&& f, double seconds = 0.6) {
  using Clock = std::chrono::steady_clock;
  const auto since = [](Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
  };
  f();
  const Clock::time_point first = Clock::now();
  f();
  const int calls = std::clamp(static_cast<int>(2e-3 / std::max(since(first), 1e-9)), 1, 1000000);
  std::vector<double> times;
  const Clock::time_point begin = Clock::now();
  while (times.size() < 7 || (since(begin) < seconds && times.size() < 1000)) {
    const Clock::time_point start = Clock::now();
    for (int k = 0; k < calls; ++k) {
      f();
    }
    times.push_back(since(start) / calls);
  }
  std::sort(times.begin(), times.end());
  const std::size_t n = times.size();
  return {static_cast<int>(n) * calls, times[n / 2], (times[n - 1 - n / 4] - times[n / 4]) / 2, times[0]};
}

/// Keeps a result from being optimised away.
template <class Value>
void keep(const Value& value) {
  asm volatile("" : : "g"(&value) : "memory");
}

inline std::string compiler() {
#if defined(__clang__)
  return "clang " + std::to_string(__clang_major__) + "." + std::to_string(__clang_minor__);
#else
  return "gcc " + std::to_string(__GNUC__) + "." + std::to_string(__GNUC_MINOR__);
#endif
}

/// What the compiler may assume of the processor, as far as decant cares.
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

inline std::string processor() {
  std::ifstream info("/proc/cpuinfo");
  std::string line;
  while (std::getline(info, line)) {
    if (line.rfind("model name", 0) == 0 && line.find(": ") != std::string::npos) {
      std::string name = line.substr(line.find(": ") + 2);
      std::replace(name.begin(), name.end(), ',', ' ');
      return name;
    }
  }
  return "unknown";
}

/// Prints the header once, then one row per result.
class Csv {
 public:
  void row(const std::string& name, int threads, Index particles, double neighbors, const Timing& timing,
           const std::string& note = "") {
    if (!started_) {
      std::printf(
          "name,compiler,flags,cpu,threads,particles,neighbors,repetitions,median_ms,spread_ms,fastest_ms,note\n");
      started_ = true;
    }
    std::printf("%s,%s,%s,%s,%d,%ld,%.1f,%d,%.6g,%.2g,%.6g,%s\n", name.c_str(), compiler().c_str(), flags().c_str(),
                processor_.c_str(), threads, static_cast<long>(particles), neighbors, timing.repetitions,
                1e3 * timing.median, 1e3 * timing.spread, 1e3 * timing.fastest, note.c_str());
    std::fflush(stdout);
  }

 private:
  bool started_ = false;
  std::string processor_ = processor();
};

/// per_edge^3 particles of a liquid at rest, in general position: a lattice, jittered by a tenth of the spacing [m],
/// turned against the axes, in random order. A lattice along the axes would flatter cell grids by a fifth.
template <class Scalar>
decant::PointArray<Scalar> resting_liquid(Index per_edge, double spacing) {
  using decant::Vector3;
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> jitter(-0.1, 0.1);
  const decant::Matrix3<double> turn =
      (Eigen::AngleAxisd(0.9, Vector3<double>::UnitZ()) * Eigen::AngleAxisd(0.5, Vector3<double>::UnitX()) *
       Eigen::AngleAxisd(0.3, Vector3<double>::UnitY()))
          .toRotationMatrix();
  decant::PointArray<Scalar> position(3, per_edge * per_edge * per_edge);
  for (Index i = 0; i < position.cols(); ++i) {
    const Vector3<double> corner(static_cast<double>(i % per_edge), static_cast<double>(i / per_edge % per_edge),
                                 static_cast<double>(i / per_edge / per_edge));
    const Vector3<double> shift(jitter(generator), jitter(generator), jitter(generator));
    position.col(i) = (turn * (corner + shift) * spacing).template cast<Scalar>();
  }
  for (Index i = position.cols() - 1; i > 0; --i) {
    position.col(i).swap(position.col(static_cast<Index>(generator() % static_cast<unsigned>(i + 1))));
  }
  return position;
}

/// A cup with 3 mm walls, 0.09 m high, whose outline has `steps` pieces and is turned in as many: 2 steps^2 triangles.
inline decant::TriangleMesh cup(std::uint32_t steps) {
  const std::vector<Eigen::Vector2d> outline{{0.001, -0.003}, {0.033, -0.003}, {0.043, 0.09},
                                             {0.040, 0.09},   {0.030, 0},      {0.001, 0}};
  double length = 0;
  for (std::size_t k = 0; k < outline.size(); ++k) {
    length += (outline[(k + 1) % outline.size()] - outline[k]).norm();
  }
  decant::TriangleMesh mesh;
  for (std::uint32_t i = 0; i < steps; ++i) {
    double way = length * i / steps;
    std::size_t piece = 0;
    const auto size = [&] { return (outline[(piece + 1) % outline.size()] - outline[piece]).norm(); };
    while (way > size()) {
      way -= size();
      ++piece;
    }
    const Eigen::Vector2d at = outline[piece] + way / size() * (outline[(piece + 1) % outline.size()] - outline[piece]);
    for (std::uint32_t j = 0; j < steps; ++j) {
      const double turn = 2 * 3.14159265358979 * j / steps;
      mesh.vertices.emplace_back(at.x() * std::cos(turn), at.x() * std::sin(turn), at.y());
      const std::uint32_t next_i = (i + 1) % steps;
      const std::uint32_t next_j = (j + 1) % steps;
      mesh.triangles.push_back({i * steps + j, i * steps + next_j, next_i * steps + j});
      mesh.triangles.push_back({i * steps + next_j, next_i * steps + next_j, next_i * steps + j});
    }
  }
  return mesh;
}

}  // namespace decant_benchmark
