// SPDX-License-Identifier: MIT
/// Simulations side by side, as for hypotheses: K of them, each on a thread of its own, over K/2 times what one takes
/// on two threads. A cup, 60 % full, that is tilted by 60 degrees within a second. All simulations
/// share the cup's mesh, hierarchy and wall grid, which is checked. Also what memory each further one takes. Runs are
/// processes of their own and take turns.

#include <algorithm>
#include <cstddef>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <decant/boundary/shapes.hpp>
#include <decant/simulation/fill.hpp>
#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator.hpp>

#include "child_process.hpp"
#include "common.hpp"
#include "cup_simulations.hpp"

namespace {

using namespace decant_benchmark;
using decant::Index;
using Model = decant::LiquidSimulator;

constexpr double frame = 1.0 / 30;  // [s]

/// The cup with its liquid at rest, just before it is tilted.
Model filled_cup(double spacing) {
  Model model(tracking_settings(spacing, 1));  // on one thread, as child processes follow
  const decant::Pose upright, tilted{Eigen::Quaterniond(Eigen::AngleAxisd(1.047, Eigen::Vector3d::UnitX())), {0, 0, 0}};
  const decant::BodyId body = model.add_body("cup", decant::Cup{}, decant::PoseTrack({{0, upright}, {1, tilted}}));
  decant::fill(model, body, decant::FillAmount::fraction(0.6));
  return model;
}

/// One more simulation. @param number differs from copy to copy, as do the particles' velocities by a millimetre
/// per second: simulations that are equal to the last bit would predict each other's branches.
Model another(const Model& first, const Model::Snapshot& state, int threads, unsigned number) {
  Model model = decant_benchmark::another(first, state, threads);
  std::mt19937 generator(number);
  std::uniform_real_distribution<float> nudge(-1e-3f, 1e-3f);
  for (Index i = 0; i < model.fluid().size(); ++i) {
    model.fluid().velocity(0, i) += nudge(generator);
  }
  return model;
}

void advance(Model& model, double duration) {
  for (const double end = model.time() + duration; model.time() < end - 1e-9;) {
    if (!model.step(std::min(frame, end - model.time())).advanced()) {
      throw std::runtime_error("a simulation stopped");
    }
  }
}

/// Wall time of all models together [s], each on a thread of its own, from their second frame on: buffers have grown
/// in the first.
double advance_side_by_side(std::vector<Model>& models, double duration) {
  const auto in_threads = [&models](double by) {
    std::vector<std::thread> threads;
    for (Model& model : models) {
      threads.emplace_back([&model, by] { advance(model, by); });
    }
    for (std::thread& thread : threads) {
      thread.join();
    }
  };
  in_threads(frame);
  return seconds_of([&] { in_threads(duration); });
}

ChildResult<double> run(const Model& first, const Model::Snapshot& state, int count, int threads_each,
                        double duration) {
  return in_child_process([&] {
    std::vector<Model> models;
    for (int k = 0; k < count; ++k) {
      models.push_back(another(first, state, threads_each, static_cast<unsigned>(k + 1)));
    }
    return advance_side_by_side(models, duration);
  });
}

/// Peak memory of a process in which one simulation runs and then is copied as a whole, scratch memory and all [MB].
double peak_with_copies(const Model& first, const Model::Snapshot& state, int copies) {
  return in_child_process([&] {
           Model model = another(first, state, 1, 1);
           advance(model, 2 * frame);
           const std::vector<Model> all(static_cast<std::size_t>(copies), model);
           keep(all);
           return 0;
         })
      .peak_mb;
}

void measure(const Options& options, Report& report) {
  const double duration = options.number("simulated");
  const int repetitions = options.numbers("repetitions").front(), cores = options.numbers("threads").front();
  const Model first = filled_cup(1e-3 * options.number("spacing"));
  const Model::Snapshot state = first.snapshot();
  const long particles = first.fluid().size();
  const std::vector<int> counts = options.numbers("simulations");

  struct Runs {
    std::vector<double> wall{}, over_one{}, peak_mb{};
  };
  Runs one;
  std::vector<Runs> several(counts.size());
  std::vector<double> peak_of_one;
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    const auto alone = run(first, state, 1, cores, duration);
    one.wall.push_back(alone.value);
    peak_of_one.push_back(run(first, state, 1, 1, frame).peak_mb);
    for (std::size_t k = 0; k < counts.size(); ++k) {
      const auto together = run(first, state, counts[k], 1, duration);
      several[k].wall.push_back(together.value);
      several[k].over_one.push_back(together.value / alone.value);
      several[k].peak_mb.push_back((together.peak_mb - peak_of_one.back()) / std::max(counts[k] - 1, 1));
    }
  }

  const std::string title = "simulations side by side", reference = "one simulation, on all threads";
  report.heading(title, particles, cores);
  const auto add = [&](const std::string& name, Spread value, const std::string& unit, std::string note = "") {
    report.add(
        title,
        {.name = name, .size = particles, .threads = cores, .value = value, .unit = unit, .note = std::move(note)});
  };
  report.add(title, {.name = reference,
                     .size = particles,
                     .threads = cores,
                     .value = Spread(one.wall),
                     .unit = "s",
                     .ratio = Spread(1),
                     .reference = reference});
  for (std::size_t k = 0; k < counts.size(); ++k) {
    const std::string name = std::to_string(counts[k]) + " simulations, a thread each";
    report.add(title, {.name = name,
                       .size = particles,
                       .threads = cores,
                       .value = Spread(several[k].wall),
                       .unit = "s",
                       .ratio = Spread(several[k].over_one),
                       .reference = reference});
    const double fair_share = static_cast<double>(counts[k]) / cores;
    add(name + ", over fair", (1 / fair_share) * Spread(several[k].over_one), "x",
        "time over " + std::to_string(fair_share).substr(0, 3) + " times that of one");
  }
  add("memory with one simulation", Spread(peak_of_one), "MB");
  for (std::size_t k = 0; k < counts.size(); ++k) {
    if (counts[k] > 1) {
      add("memory of each further one, " + std::to_string(counts[k]) + " in all", Spread(several[k].peak_mb), "MB");
    }
  }
  const double without = peak_with_copies(first, state, 0), with = peak_with_copies(first, state, 4);
  add("memory of a copy that includes scratch memory", (with - without) / 4, "MB");
}

}  // namespace

int main(int argc, char** argv) {
  Options options("bench_independent_simulations", "simulations side by side against one on several threads");
  options.add("threads", "2", "of the one simulation; the number of cores")
      .add("simulations", "2,4,8", "how many run side by side")
      .add("spacing", "3", "of particles [mm]; 3 makes 7,600 particles")
      .add("simulated", "0.5", "time that is simulated [s]")
      .add("repetitions", "3", "runs of each kind");
  return benchmark_main(argc, argv, options, measure);
}
