// SPDX-License-Identifier: MIT
// Workloads W1 to W3: a cube of n^3 particles of water collapses in a closed box, with the default simulator. Prints
// one row of CSV per size and number of threads: the whole run, and median and quartiles over its frames of what a
// sub-step took; errors are recomputed by brute force from a snapshot of each frame. Usage:
// bench_sweep_column_collapse [largest n = 100] [seconds of W1 = 2]

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include <decant/decant.hpp>

#include "common.hpp"

namespace {

using namespace decant;

LiquidSimulator column(int n, int threads) {
  const double d = 0.005;
  SimulatorSettings settings;
  settings.spacing = d;
  settings.liquid = {1000, 1e-3, 0};
  settings.gravity = {0, -9.81, 0};
  settings.threads = {threads};
  LiquidSimulator simulator(settings);
  simulator.add_body("box", BoxInside{{0, 0, 0}, {3 * n * d, 2 * n * d, (n + 1) * d}, 0.01, {}});
  PointArray<float> position(3, n * n * n);
  Index next = 0;
  for (int i = 1; i <= n; ++i) {
    for (int j = 1; j <= n; ++j) {
      for (int k = 1; k <= n; ++k) {
        position.col(next++) = (d * Vector3<double>(i, j, k)).cast<float>();
      }
    }
  }
  simulator.add_particles(position, PointArray<float>::Zero(3, position.cols()), 0);
  return simulator;
}

// Mean of (density - rest density)+ over rest density, summed in double precision over all pairs that are near.
double mean_compression(const LiquidSimulator& simulator) {
  const auto& fluid = simulator.fluid();
  const PointArray<double> position = fluid.position.cast<double>();
  const double h = simulator.smoothing_length();
  CellGrid<double> grid;
  grid.rebuild(position, 2 * h);
  double total = 0;
  WallState<float> walls;
  simulator.bodies().sample(fluid.position, simulator.settings().spacing, {}, walls);
  for (Index i = 0; i < fluid.size(); ++i) {
    const double m = static_cast<double>(fluid.mass[i]);
    double density = m * CubicSpline<double>::value(0.0, h) + 1000 * static_cast<double>(walls.share[i]);
    grid.for_each(i,
                  [&](Index, double r_squared) { density += m * CubicSpline<double>::value(std::sqrt(r_squared), h); });
    total += std::max(density / 1000 - 1, 0.0);
  }
  return total / static_cast<double>(fluid.size());
}

}  // namespace

int main(int count, char** arguments) {
  const int largest = count > 1 ? std::atoi(arguments[1]) : 100;
  const double w1_seconds = count > 2 ? std::atof(arguments[2]) : 2;
  std::printf(
      "n,particles,threads,simulated_s,wall_s,wall_per_simulated,sub_steps,density_iterations,"
      "divergence_iterations,ms_per_sub_step_median,ms_lower_quartile,ms_upper_quartile,us_per_particle_step,"
      "mean_compression,compiler,flags,cpu\n");
  for (const int n : {10, 20, 40, 80, 100}) {
    for (const int threads : {1, 2}) {
      if (n > largest) {
        continue;
      }
      LiquidSimulator simulator = column(n, threads);
      const double duration = n <= 20 ? w1_seconds : n <= 40 ? 0.1 : 0.05, frame = n <= 20 ? 0.02 : 0.01;
      int sub_steps = 0, density = 0, divergence = 0;
      double worst = 0, wall = 0;
      std::vector<double> ms_per_sub_step;  // of each frame
      while (simulator.time() < duration - 1e-9) {
        const auto start = std::chrono::steady_clock::now();
        const StepReport report = simulator.step(std::min(frame, duration - simulator.time()));
        const double took = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        if (!report.advanced()) {
          std::fprintf(stderr, "stopped: %s\n", to_string(report.status).data());
          return 1;
        }
        wall += took;
        ms_per_sub_step.push_back(1e3 * took / report.sub_steps);
        sub_steps += report.sub_steps;
        density += report.density_iterations;
        divergence += report.divergence_iterations;
        worst = std::max(worst, mean_compression(simulator));
      }
      std::sort(ms_per_sub_step.begin(), ms_per_sub_step.end());
      const auto quantile = [&](double share) {
        return ms_per_sub_step[static_cast<std::size_t>(share * static_cast<double>(ms_per_sub_step.size() - 1) + 0.5)];
      };
      std::printf("%d,%ld,%d,%g,%.3f,%.3f,%d,%.2f,%.2f,%.3f,%.3f,%.3f,%.3f,%.2g,%s,%s,%s\n", n,
                  static_cast<long>(simulator.fluid().size()), threads, duration, wall, wall / duration, sub_steps,
                  static_cast<double>(density) / sub_steps, static_cast<double>(divergence) / sub_steps, quantile(0.5),
                  quantile(0.25), quantile(0.75), 1e3 * quantile(0.5) / static_cast<double>(simulator.fluid().size()),
                  worst, decant_benchmark::compiler().c_str(), decant_benchmark::flags().c_str(),
                  decant_benchmark::processor().c_str());
      std::fflush(stdout);
    }
  }
}
