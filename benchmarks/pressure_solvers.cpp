// SPDX-License-Identifier: MIT
/// Times pressure solvers by themselves, through what the concept PressureSolver asks for: setting up, one iteration, a
/// whole solve. A cube of liquid in general position and without walls, spacing 5 mm, support 10 mm, that contracts by
/// 0.15 % per sub-step of 1 ms. In the same run, over the same pairs: one sweep that reads a number of each neighbour.
/// The note says how many such sweeps a time is. Usage: bench_micro_pressure_solver [threads, default 1 and 2]
/// [particles per edge, default 20 and 40; 80 takes minutes]

#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <decant/kernel/cubic_spline.hpp>
#include <decant/neighbor/cell_grid.hpp>
#include <decant/pressure/dfsph.hpp>
#include <decant/pressure/position_based.hpp>
#include <decant/pressure/state_equation.hpp>
#include <decant/testing/force.hpp>

#include "common.hpp"

namespace {

using namespace decant_benchmark;
using decant::PointArray;
using decant::PressureReport;
using decant::Threads;

using Scalar = float;
using Liquid = decant::testing::LooseLiquid<decant::CubicSpline<Scalar>>;
constexpr double spacing = 0.005;

// In the order in which a simulator keeps its particles.
PointArray<Scalar> sorted_liquid(Index per_edge) {
  const PointArray<Scalar> shuffled = resting_liquid<Scalar>(per_edge, spacing);
  decant::CellGrid<Scalar> grid;
  grid.rebuild(shuffled, static_cast<Scalar>(2 * spacing), Threads{1});
  PointArray<Scalar> sorted(3, shuffled.cols());
  for (Index k = 0; k < shuffled.cols(); ++k) {
    sorted.col(k) = shuffled.col(grid.order()[static_cast<std::size_t>(k)]);
  }
  return sorted;
}

// One number of each neighbour, added up: the least that any step of an iteration has to do.
Timing streaming_sweep(const Liquid& liquid) {
  using B = decant::Batch<Scalar>;
  const Index count = liquid.fluid.size();
  std::vector<Scalar> term(static_cast<std::size_t>(count)), result(term.size());
  for (std::size_t i = 0; i < term.size(); ++i) {
    term[i] = static_cast<Scalar>(1 + i % 7);
  }
  const Timing timing = time_of([&] {
    decant::parallel_for(count, liquid.threads, [&](Index i) {
      B total(0);
      const std::size_t end = liquid.neighbors.padded_end(i);
      for (std::size_t k = liquid.neighbors.first(i); k < end; k += B::width) {
        total += decant::gather(term.data(), liquid.neighbors.index() + k);
      }
      result[static_cast<std::size_t>(i)] = sum(total);
    });
  });
  keep(result);
  return timing;
}

std::string in_sweeps(double seconds, const Timing& sweep) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f sweeps", seconds / sweep.median);
  return text;
}

int iterations(const PressureReport& report) { return report.density_iterations + report.divergence_iterations; }

std::string iterations_of(const PressureReport& report) {
  return "; iterations: " + std::to_string(iterations(report));
}

template <class Solver>
void run(Csv& csv, const std::string& name, const PointArray<Scalar>& position, Threads threads) {
  Liquid liquid;
  liquid.threads = threads;
  liquid.place<decant::CellGrid<Scalar>>(position);
  liquid.update<decant::CellGrid<Scalar>>(static_cast<double>(Solver::search_margin));
  const Index count = liquid.fluid.size();
  const double neighbors = static_cast<double>(liquid.neighbors.pairs()) / static_cast<double>(count);
  const auto step = liquid.view();
  const Scalar contraction = Scalar(0.0015) / (3 * liquid.time_step);  // [1/s]
  PointArray<Scalar> start = -contraction * position;

  const Timing sweep = streaming_sweep(liquid);
  csv.row(name + ": reference sweep", threads.count, count, neighbors, sweep);
  const auto row = [&](const std::string& what, const Timing& timing, const std::string& note = "") {
    csv.row(name + ": " + what, threads.count, count, neighbors, timing, in_sweeps(timing.median, sweep) + note);
  };
  // every call solves the same problem; to put the velocities back costs a thousandth of it
  const auto solve = [&](Solver& solver, bool warm) {
    PressureReport report;
    liquid.fluid.velocity = start;
    liquid.shift.setZero();
    if (!warm) {
      solver.memory().clear();
    }
    solver.begin_step(step, report);
    solver.solve(step, report);
    return report;
  };

  Solver solver;
  {
    PressureReport report;
    liquid.fluid.velocity = start;
    const Timing timing = time_of([&] { solver.begin_step(step, report); });
    if (timing.median > 1e-7) {  // not all have something to set up
      row("begin_step", timing);
    }
  }
  PressureReport report = solve(solver, false);
  if (!liquid.fluid.velocity.allFinite() || !(liquid.fluid.pressure.maxCoeff() > 0)) {
    throw std::runtime_error(name + " left no pressure, or velocities that are not finite");
  }
  const Timing forgetful = time_of([&] { report = solve(solver, false); });
  row("begin_step and solve", forgetful, iterations_of(report));
  if constexpr (!std::is_empty_v<typename Solver::Memory>) {
    const Timing from_solution = time_of([&] { report = solve(solver, true); });
    row("begin_step and solve from the solution", from_solution, iterations_of(report));
  }

  // The difference between many iterations and few, so that what a solve does once drops out.
  if constexpr (requires { solver.most_iterations; }) {
    const auto with_iterations = [&](int most) {
      Solver limited;
      limited.most_iterations = most;
      if constexpr (requires { limited.density_tolerance; }) {
        limited.density_tolerance = 0;
      }
      if constexpr (requires { limited.divergence_tolerance; }) {
        limited.divergence_tolerance = 0;
      }
      const int taken = iterations(solve(limited, false));
      return std::pair(taken, time_of([&] { solve(limited, false); }));
    };
    const auto [few, short_time] = with_iterations(5);
    const auto [many, long_time] = with_iterations(25);
    if (many > few) {
      Timing each = long_time;
      each.median = (long_time.median - short_time.median) / (many - few);
      each.fastest = (long_time.fastest - short_time.fastest) / (many - few);
      each.spread = (long_time.spread + short_time.spread) / (many - few);
      row("one iteration", each, "; from " + std::to_string(many) + " and " + std::to_string(few));
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  Csv csv;
  const std::vector<int> thread_counts = argc > 1 ? std::vector<int>{std::atoi(argv[1])} : std::vector<int>{1, 2};
  const std::vector<int> edges = argc > 2 ? std::vector<int>{std::atoi(argv[2])} : std::vector<int>{20, 40};
  for (const int per_edge : edges) {
    const PointArray<Scalar> position = sorted_liquid(per_edge);
    for (const int threads : thread_counts) {
      run<decant::Dfsph<Scalar>>(csv, "Dfsph", position, Threads{threads});
      run<decant::PositionBased<Scalar>>(csv, "PositionBased", position, Threads{threads});
      run<decant::StateEquation<Scalar>>(csv, "StateEquation", position, Threads{threads});
    }
  }
}
