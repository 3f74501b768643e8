// SPDX-License-Identifier: MIT
/// Pressure solvers by themselves, through what the concept PressureSolver asks for: setting up, one iteration, a whole
/// solve. A cube of liquid in general position and without walls, spacing 5 mm, support 10 mm, that contracts by 0.15 %
/// per sub-step of 1 ms. The reference is one sweep over the same pairs that reads a number of each neighbour, so that
/// ratios say how many such sweeps a part is worth; an iteration is also set beside step_limit's, where it is there.

#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include <decant/kernel/cubic_spline.hpp>
#include <decant/neighbor/cell_grid.hpp>
#include <decant/pressure/dfsph.hpp>
#include <decant/pressure/position_based.hpp>
#include <decant/pressure/state_equation.hpp>
#include <decant/pressure/state_equation_schenck2017.hpp>
#include <decant/testing/force.hpp>

#include "common.hpp"
#include "inputs.hpp"
#include "step_limit.hpp"

namespace {

using namespace decant_benchmark;
using decant::PointArray;
using decant::PressureReport;

using Scalar = float;
using Liquid = decant::testing::LooseLiquid<decant::CubicSpline<Scalar>>;
using Positions = std::vector<PointArray<Scalar>>;
constexpr double spacing = 0.005;

/// A contracting liquid and a solver at work on it.
template <class Solver>
class Problem {
 public:
  Problem(const Positions& positions, int threads) : positions_(positions) {
    liquid_.threads = {threads};
    take(0);
  }

  /// Lists are written anew, so that they are in the caches as in a simulation, where they are just as fresh.
  void take(std::size_t input) {
    const PointArray<Scalar>& position = positions_[input % positions_.size()];
    liquid_.template place<decant::CellGrid<Scalar>>(position);
    liquid_.template update<decant::CellGrid<Scalar>>(static_cast<double>(Solver::search_margin));
    start_ = -Scalar(0.0015) / (3 * liquid_.time_step) * position;
    liquid_.fluid.velocity = start_;
    term_.assign(static_cast<std::size_t>(position.cols()), Scalar(1));
    result_ = term_;
  }

  void sweep() {
    using B = decant::Batch<Scalar>;
    decant::parallel_for(liquid_.fluid.size(), liquid_.threads, [&](Index i) {
      B total(0);
      const std::size_t end = liquid_.neighbors.padded_end(i);
      for (std::size_t k = liquid_.neighbors.first(i); k < end; k += B::width) {
        total += decant::gather(term_.data(), liquid_.neighbors.index() + k);
      }
      result_[static_cast<std::size_t>(i)] = sum(total);
    });
    keep(result_);
  }

  void begin(Solver& solver) {
    PressureReport report;
    solver.begin_step(liquid_.view(), report);
  }

  /// The same every time; to put the velocities back costs a thousandth of it. @param whole with what some solvers do
  /// when velocities are final.
  PressureReport solve(Solver& solver, bool from_nothing, bool whole = false) {
    PressureReport report;
    liquid_.fluid.velocity = start_;
    liquid_.shift.setZero();
    if (from_nothing) {
      solver.memory().clear();
    }
    const auto step = liquid_.view();
    solver.begin_step(step, report);
    solver.solve(step, report);
    if constexpr (requires { solver.correct_places(step, report); }) {
      if (whole) {
        solver.correct_places(step, report);
      }
    }
    return report;
  }

  Liquid& liquid() { return liquid_; }

 private:
  const Positions& positions_;
  Liquid liquid_{};
  PointArray<Scalar> start_{};
  std::vector<Scalar> term_{}, result_{};
};

int iterations(const PressureReport& report) { return report.density_iterations + report.divergence_iterations; }

std::string in_words(const PressureReport& report) { return std::to_string(iterations(report)) + " iterations"; }

/// One that takes that many iterations, whatever the error.
template <class Solver>
Solver limited_to(int most_iterations) {
  Solver solver;
  solver.most_iterations = most_iterations;
  if constexpr (requires { solver.density_tolerance; }) {
    solver.density_tolerance = 0;
  }
  if constexpr (requires { solver.divergence_tolerance; }) {
    solver.divergence_tolerance = 0;
  }
  return solver;
}

template <class Solver>
void measure(Report& report, const std::string& name, const Positions& positions, int threads) {
  const std::string beside_limit = name + ", one iteration beside step_limit";
  if (!report.wants(name) && !report.wants(beside_limit)) {
    return;
  }
  Problem<Solver> problem(positions, threads);
  const long size = positions[0].cols();
  Comparison parts(report, name, size, threads);
  const auto add = [&](Comparison & to, const std::string& what, const std::string& note, auto&& run) -> auto& {
    Comparison::Case& added = to.add(what, [run](std::size_t) mutable { run(); });
    added.prepare = [&problem](std::size_t turn) { problem.take(turn); };
    added.note = note;
    return added;
  };

  add(parts, "sweep that reads one number", "", [&] { problem.sweep(); });
  Solver solver, warm;
  if (seconds_of([&] { problem.begin(solver); }) > 1e-6) {  // not all have something to set up
    add(parts, "begin_step", "", [&] { problem.begin(solver); });
  }
  const PressureReport done = problem.solve(solver, true);
  if (!problem.liquid().fluid.velocity.allFinite() || !(problem.liquid().fluid.pressure.maxCoeff() > 0)) {
    throw std::runtime_error(name + " left no pressure, or velocities that are not finite");
  }
  add(parts, "begin_step and solve", in_words(done), [&] { problem.solve(solver, true); });
  if constexpr (requires(PressureReport & r) { solver.correct_places(problem.liquid().view(), r); }) {
    const PressureReport all = problem.solve(solver, true, true);
    add(parts, "all of a sub-step", in_words(all), [&] { problem.solve(solver, true, true); });
  }
  if constexpr (!std::is_empty_v<typename Solver::Memory>) {
    problem.solve(warm, false);
    const PressureReport again = problem.solve(warm, false);
    Comparison::Case& from_solution =
        add(parts, "begin_step and solve from the solution", in_words(again), [&] { problem.solve(warm, false); });
    from_solution.prepare = [&](std::size_t turn) {
      problem.take(turn);
      warm.memory().clear();
      problem.solve(warm, false);
    };
  }

  if constexpr (requires { solver.most_iterations; }) {
    // The difference between many iterations and few, so that what a solve does once drops out.
    Solver few = limited_to<Solver>(5), many = limited_to<Solver>(25);
    const int difference = iterations(problem.solve(many, true)) - iterations(problem.solve(few, true));
    if (difference > 0) {
      const std::string of_many = "solve with 25 iterations", of_few = "solve with 5 iterations";
      add(parts, of_many, "", [&] { problem.solve(many, true); });
      add(parts, of_few, "", [&] { problem.solve(few, true); });
      parts.add_difference("one iteration", of_many, of_few, difference);
      parts.run();

      if (!step_limit_program().empty()) {
        const int per_edge = static_cast<int>(std::lround(std::cbrt(static_cast<double>(size))));
        Comparison beside(report, beside_limit, size, threads);
        beside.add_from_elsewhere("step_limit: DFSPH iteration, gradients stored",
                                  [=] { return step_limit_figure("DFSPH iter stored f16 AoS", per_edge, threads); });
        add(beside, of_many, "", [&] { problem.solve(many, true); });
        add(beside, of_few, "", [&] { problem.solve(few, true); });
        beside.add_difference("one iteration", of_many, of_few, difference);
        beside.run();
      }
      return;
    }
  }
  parts.run();
}

}  // namespace

int main(int argc, char** argv) {
  Options options("bench_pressure_solvers", "pressure solvers: setting up, one iteration, a solve");
  options.add_threads().add("sizes", "20,40", "particles per edge of a cube of liquid; 80 takes minutes");
  return benchmark_main(argc, argv, options, [](const Options& given, Report& report) {
    const std::vector<int> threads = given.numbers("threads");
    for (const int per_edge : given.numbers("sizes")) {
      const Positions positions = sorted_liquids<Scalar>(per_edge, spacing, inputs_for(per_edge));
      for (const int count : threads) {
        measure<decant::Dfsph<Scalar>>(report, "Dfsph", positions, count);
        measure<decant::PositionBased<Scalar>>(report, "PositionBased", positions, count);
        measure<decant::StateEquation<Scalar>>(report, "StateEquation", positions, count);
        measure<decant::StateEquationSchenck2017<Scalar>>(report, "StateEquationSchenck2017", positions, count);
      }
    }
  });
}
