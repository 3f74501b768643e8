// SPDX-License-Identifier: MIT
/// Whole sub-steps: a cube of n^3 particles of water collapses in a closed box. Workloads W1, W2 and W3 have 20, 40 and
/// 80 particles per edge, spacing 5 mm; solvers are Dfsph (mean density error at most 0.1 %), PositionBased, and
/// StateEquation with p = 50000 ((rho / rho_0)^7 - 1) Pa and sub-steps of 0.2 ms. Each run is a process of its own, so
/// that its peak of memory is its own; runs with different numbers of threads take turns. How dense the liquid is comes
/// from snapshots, from sums over all pairs in double precision that owe the solver nothing.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <decant/boundary/shapes.hpp>
#include <decant/kernel/cubic_spline.hpp>
#include <decant/kernel/lattice.hpp>
#include <decant/neighbor/cell_grid.hpp>
#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator.hpp>

#include "child_process.hpp"
#include "common.hpp"

namespace {

using namespace decant_benchmark;
using decant::Index;
using decant::PointArray;
using decant::Simulator;
using decant::SimulatorSettings;
using decant::StepReport;
using decant::StepTimes;

constexpr double spacing = 0.005;      // [m]
constexpr double rest_density = 1000;  // [kg/m^3]

// ---- workloads ------------------------------------------------------------------------------------------------------

/// How long is simulated and how often it is looked at.
struct Workload {
  std::string name;
  int per_edge;
  double duration, frame;                    ///< [s]
  double duration_explicit, frame_explicit;  ///< the same for StateEquation [s]
};

/// W1, W2, W3, or one of so many particles per edge. Throws std::invalid_argument if it is neither.
Workload workload_of(const std::string& name) {
  const int per_edge = name == "W1" ? 20 : name == "W2" ? 40 : name == "W3" ? 80 : std::atoi(name.c_str());
  if (per_edge < 4 || per_edge > 400) {
    throw std::invalid_argument("--workloads must be W1, W2, W3 or 4 to 400 particles per edge, got '" + name + "'");
  }
  const std::string title = name.front() == 'W' ? name : name + " per edge";
  if (per_edge <= 20) {
    return {title, per_edge, 2.0, 0.02, 0.15, 0.01};
  }
  return per_edge <= 40 ? Workload{title, per_edge, 0.1, 0.01, 0.01, 0.002}
                        : Workload{title, per_edge, 0.05, 0.01, 0.004, 0.001};
}

SimulatorSettings settings_for(int threads, double fixed_step) {
  SimulatorSettings settings;
  settings.spacing = spacing;
  settings.liquid = {rest_density, 1e-3, 0};
  settings.gravity = {0, -9.81, 0};
  settings.fixed_step = fixed_step;
  settings.threads = {threads};
  return settings;
}

/// Of the pressure solver. Those of peers: means of at most 0.1 % each, whatever single particles do.
enum class Tolerances { Own, Peers };

/// The empty box: frictionless, closed.
template <class Parts>
Simulator<Parts> box(int per_edge, const SimulatorSettings& settings, Tolerances tolerances) {
  Simulator<Parts> simulator(settings);
  if constexpr (requires { simulator.pressure_solver().divergence_tolerance; }) {
    if (tolerances == Tolerances::Peers) {
      auto& solver = simulator.pressure_solver();
      solver.density_tolerance = solver.divergence_tolerance = 1e-3F;
      solver.largest_tolerance = 0.1F;
    }
  }
  if constexpr (requires { simulator.pressure_solver().stiffness; }) {
    simulator.pressure_solver().stiffness = 50000;  // [Pa]
    simulator.pressure_solver().exponent = 7;
  }
  const double n = per_edge;
  simulator.add_body("box",
                     decant::BoxInside{{0, 0, 0}, spacing * decant::Vector3<double>(3 * n, 2 * n, n + 1), 0.01, {}});
  return simulator;
}

template <class Parts>
void fill(int n, Simulator<Parts>& simulator) {
  PointArray<float> position(3, n * n * n);
  for (int i = 0; i < n * n * n; ++i) {
    position.col(i) = (spacing * decant::Vector3<double>(i / n / n + 1, i / n % n + 1, i % n + 1)).cast<float>();
  }
  simulator.add_particles(position, PointArray<float>::Zero(3, position.cols()), 0);
}

// ---- snapshots ------------------------------------------------------------------------------------------------------

/// Positions of all particles at the ends of frames, in a file without a name: a child process writes them and its
/// parent reads them, so that neither time nor memory of looking at them counts.
class Snapshots {
 public:
  Snapshots() : file_(std::tmpfile(), &std::fclose) {
    if (!file_) {
      throw std::runtime_error("cannot make a temporary file");
    }
  }
  template <class Points>
  void write(const Points& position) {
    const auto values = static_cast<std::size_t>(position.size());
    if (std::fwrite(position.data(), sizeof(float), values, file_.get()) != values || std::fflush(file_.get()) != 0) {
      throw std::runtime_error("cannot write a snapshot");
    }
  }
  void rewind() { std::rewind(file_.get()); }
  /// False at the end.
  bool read(PointArray<float>& position) {
    const auto values = static_cast<std::size_t>(position.size());
    return std::fread(position.data(), sizeof(float), values, file_.get()) == values;
  }

 private:
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
};

/// Mean of (density - rest density)+ over rest density [-].
double mean_compression(const PointArray<float>& position_float, const decant::RigidBodies<float>& bodies) {
  const PointArray<double> position = position_float.cast<double>();
  const double mass = rest_density * spacing * spacing * spacing, h = spacing;
  decant::CellGrid<double> grid;
  grid.rebuild(position, 2 * h, {1});
  decant::WallState<float> walls;
  bodies.sample(position_float, spacing, {1}, walls);
  const double own = decant::own_value<decant::CubicSpline<double>>(h, spacing);
  double total = 0;
  for (Index i = 0; i < position.cols(); ++i) {
    double density = mass * own + rest_density * static_cast<double>(walls.share[i]);
    grid.for_each(i, [&](Index, double r_squared) {
      density += mass * decant::CubicSpline<double>::value(std::sqrt(r_squared), h);
    });
    total += std::max(density / rest_density - 1, 0.0);
  }
  return total / static_cast<double>(position.cols());
}

/// Of each frame.
struct Compressions {
  std::array<double, 256> of_frame{};
  std::size_t frames = 0;
};

Compressions compressions_in(Snapshots& snapshots, int particles, const decant::RigidBodies<float>& bodies) {
  Compressions result;
  PointArray<float> position(3, particles);
  snapshots.rewind();
  while (result.frames < result.of_frame.size() && snapshots.read(position)) {
    result.of_frame[result.frames++] = mean_compression(position, bodies);
  }
  return result;
}

// ---- runs -----------------------------------------------------------------------------------------------------------

constexpr std::size_t stage_count = 6;
constexpr std::array<const char*, stage_count> stage_names{
    "sorting and lists", "walls", "densities and gradients", "forces", "pressure", "moving"};

/// What a run took, as a child process hands it over.
struct Run {
  double wall = 0;           ///< [s]
  Spread ms_per_sub_step{};  ///< over frames
  double sub_steps = 0, density_iterations = 0, divergence_iterations = 0;
  /// Per sub-step of the first 50 ms: the liquid falls by half a spacing and all of it meets the floor.
  double early_density_iterations = 0, early_divergence_iterations = 0;
  double most_density_iterations = 0, most_divergence_iterations = 0;  ///< per sub-step, in any frame
  double density_error = 0, divergence_error = 0;                      ///< largest, as the solver reports them
  std::array<double, stage_count> stage_ms{};
  double not_converged = 0;  ///< frames
};

template <class Parts>
Run simulate(Simulator<Parts> simulator, double duration, double frame, Snapshots& snapshots) {
  Run run;
  std::vector<double> ms_per_sub_step;
  while (simulator.time() < duration - 1e-9) {
    StepReport report;
    const double took = seconds_of([&] { report = simulator.step(std::min(frame, duration - simulator.time())); });
    if (!report.advanced()) {
      throw std::runtime_error("the simulation stopped: " + std::string(to_string(report.status)));
    }
    run.wall += took;
    ms_per_sub_step.push_back(1e3 * took / report.sub_steps);
    run.sub_steps += report.sub_steps;
    run.density_iterations += report.density_iterations;
    run.divergence_iterations += report.divergence_iterations;
    run.not_converged += report.status == decant::StepStatus::NotConverged ? 1 : 0;
    if (simulator.time() < 0.05 + 1e-9) {
      run.early_density_iterations = run.density_iterations / run.sub_steps;
      run.early_divergence_iterations = run.divergence_iterations / run.sub_steps;
    }
    const double sub_steps = report.sub_steps;
    run.most_density_iterations = std::max(run.most_density_iterations, report.density_iterations / sub_steps);
    run.most_divergence_iterations = std::max(run.most_divergence_iterations, report.divergence_iterations / sub_steps);
    run.density_error = std::max(run.density_error, report.density_error);
    run.divergence_error = std::max(run.divergence_error, report.divergence_error);
    const StepTimes& t = report.times;
    const double stages[stage_count] = {t.sorting_ms, t.walls_ms, t.sums_ms, t.forces_ms, t.pressure_ms, t.moving_ms};
    for (std::size_t k = 0; k < stage_count; ++k) {
      run.stage_ms[k] += stages[k];
    }
    snapshots.write(simulator.fluid().position);
  }
  run.ms_per_sub_step = Spread(std::move(ms_per_sub_step));
  return run;
}

/// Runs with one number of threads.
struct Runs {
  int threads;
  std::vector<ChildResult<Run>> runs{};
  Compressions compressions{};  ///< of the last run, by its snapshots

  Spread over(const std::function<double(const Run&)>& figure) const {
    std::vector<double> samples;
    for (const auto& run : runs) {
      samples.push_back(figure(run.value));
    }
    return Spread(std::move(samples));
  }
};

void report_runs(Report& report, const std::string& title, long particles, double duration, const Runs& of,
                 const Runs& reference) {
  report.heading(title, particles, of.threads);
  const auto add = [&](const std::string& name, const Spread& value, const std::string& unit, std::string note = "") {
    report.add(title, {.name = name,
                       .size = particles,
                       .threads = of.threads,
                       .value = value,
                       .unit = unit,
                       .note = std::move(note)});
  };
  Result wall{.name = "wall time per simulated second", .size = particles, .threads = of.threads, .unit = "s/s"};
  wall.value = of.over([&](const Run& run) { return run.wall / duration; });
  if (&of != &reference) {
    std::vector<double> ratios;
    for (std::size_t k = 0; k < of.runs.size(); ++k) {
      ratios.push_back(of.runs[k].value.wall / reference.runs[k].value.wall);
    }
    wall.ratio = Spread(std::move(ratios));
    wall.reference = wall.name + ", threads: " + std::to_string(reference.threads);
    char gain[64];
    std::snprintf(gain, sizeof gain, "%d threads are %.2f times as fast as %d", of.threads, 1 / wall.ratio->median,
                  reference.threads);
    wall.note = gain;
  }
  report.add(title, wall);
  const Run& last = of.runs.back().value;
  const double sub_steps = last.sub_steps;
  add("time per sub-step, over frames", last.ms_per_sub_step, "ms",
      std::to_string(static_cast<int>(sub_steps)) + " sub-steps");
  add("particle-steps per second",
      of.over([&](const Run& run) { return 1e-6 * static_cast<double>(particles) * run.sub_steps / run.wall; }), "M/s");
  add("density iterations per sub-step", last.density_iterations / sub_steps, "");
  add("divergence iterations per sub-step", last.divergence_iterations / sub_steps, "");
  add("density iterations, first 50 ms", last.early_density_iterations, "");
  add("divergence iterations, first 50 ms", last.early_divergence_iterations, "");
  add("density iterations, worst frame", last.most_density_iterations, "");
  add("divergence iterations, worst frame", last.most_divergence_iterations, "");
  for (std::size_t k = 0; k < stage_count; ++k) {
    add(std::string("share of ") + stage_names[k],
        of.over([&](const Run& run) { return 1e-3 * 100 * run.stage_ms[k] / run.wall; }), "%");
  }
  std::vector<double> peaks;
  for (const auto& run : of.runs) {
    peaks.push_back(run.peak_mb);
  }
  add("peak memory of the process", Spread(std::move(peaks)), "MB");
  const auto first = of.compressions.of_frame.begin();
  const Spread compression(std::vector<double>{first, first + static_cast<std::ptrdiff_t>(of.compressions.frames)});
  const double worst = *std::max_element(first, first + static_cast<std::ptrdiff_t>(of.compressions.frames));
  add("mean compression, over frames", 100 * compression, "%", "recomputed from snapshots");
  add("mean compression, worst frame", 100 * worst, "%", "recomputed from snapshots");
  add("largest density error reported", 100 * last.density_error, "%");
  add("largest divergence error reported", 100 * last.divergence_error, "%",
      last.not_converged > 0 ? "not converged in " + std::to_string(static_cast<int>(last.not_converged)) + " frames"
                             : "");
}

template <class Parts>
void measure(const Options& options, Report& report, const std::string& solver, const Workload& workload,
             double fixed_step, Tolerances tolerances = Tolerances::Own) {
  const std::string title = workload.name + ", " + solver;
  if (!report.wants(title)) {
    return;
  }
  const double shorter = options.is_on("quick") ? 0.1 : 1;
  const double duration = shorter * (fixed_step > 0 ? workload.duration_explicit : workload.duration);
  const double frame = std::min(duration, fixed_step > 0 ? workload.frame_explicit : workload.frame);
  const int n = workload.per_edge;

  std::vector<Runs> all;
  for (const int threads : options.numbers("threads")) {
    all.push_back({threads});
  }
  const auto empty = box<Parts>(n, settings_for(1, fixed_step), tolerances);
  const int repetitions = options.numbers("repetitions").front();
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    for (Runs& of : all) {
      Snapshots snapshots;
      of.runs.push_back(in_child_process([&] {
        auto simulator = box<Parts>(n, settings_for(of.threads, fixed_step), tolerances);
        fill(n, simulator);
        return simulate(std::move(simulator), duration, frame, snapshots);
      }));
      if (repetition + 1 == repetitions) {  // in a child as well, so that later ones inherit no memory
        const auto compressions =
            in_child_process([&] { return compressions_in(snapshots, n * n * n, empty.bodies()); });
        of.compressions = compressions.value;
      }
    }
  }
  for (const Runs& of : all) {
    report_runs(report, title, n * n * n, duration, of, all.front());
  }
}

}  // namespace

int main(int argc, char** argv) {
  Options options("bench_whole_step", "whole sub-steps of a cube of water that collapses");
  options.add_threads()
      .add("workloads", "W1,W2,W3", "of W1, W2 and W3 (8,000, 64,000 and 512,000 particles), or particles per edge")
      .add("solvers", "dfsph,dfsph_peers,pbf,wcsph",
           "of dfsph, dfsph_peers (its tolerances: means of 0.1 %), pbf (up to W1 only) and wcsph")
      .add("repetitions", "1", "runs of each kind")
      .add("quick", "no", "a tenth of the simulated times, for a first look");
  return benchmark_main(argc, argv, options, [](const Options& given, Report& report) {
    const std::vector<std::string> wanted = given.words("workloads"), solvers = given.words("solvers");
    for (const std::string& name : solvers) {
      if (name != "dfsph" && name != "dfsph_peers" && name != "pbf" && name != "wcsph") {
        throw std::invalid_argument("--solvers must be of dfsph, dfsph_peers, pbf and wcsph, got '" + name + "'");
      }
    }
    for (const std::string& name : wanted) {
      const Workload workload = workload_of(name);
      for (const std::string& solver : solvers) {
        if (solver == "dfsph") {
          measure<decant::DefaultParts<>>(given, report, "Dfsph", workload, 0);
        } else if (solver == "dfsph_peers") {
          measure<decant::DefaultParts<>>(given, report, "Dfsph, tolerances of peers", workload, 0, Tolerances::Peers);
        } else if (solver == "wcsph") {
          measure<decant::StateEquationParts<>>(given, report, "StateEquation", workload, 2e-4);
        } else if (workload.per_edge <= 20) {
          measure<decant::PositionBasedParts<>>(given, report, "PositionBased", workload, 0);
        }
      }
    }
  });
}
