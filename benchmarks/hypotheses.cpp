// SPDX-License-Identifier: MIT
/// What it costs to ask several hypotheses instead of one. K of them on two cores, over K/2 times what one takes on one
/// thread, which is all that there is to gain; also beside one on both threads. And what giving up hopeless ones saves:
/// recordings of a pipe junction (of the example `record_junction`), judged with and without (and without trying all in
/// coarse particles first), and whether any answer differs. Runs take turns.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <ctime>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <decant/correction/silhouette_corrector.hpp>
#include <decant/hypothesis/hypothesis_filter.hpp>
#include <decant/io/recording_reader.hpp>

#include "common.hpp"
#include "support/blockage.hpp"
#include "support/tracking_run.hpp"

namespace {

using namespace decant_benchmark;
using namespace decant;
using Model = example::TrackingModel;

/// A pour, in memory.
struct Pour {
  Recording recording;
  std::vector<example::RecordedFrame> frames{};

  Pour(const std::string& folder, std::size_t most_frames) : recording(read_recording(folder)) {
    for (std::size_t frame = 0; frame < std::min(recording.frames, most_frames); ++frame) {
      frames.push_back(example::frame_of(recording, frame, {}));
    }
    expects(frames.size() > 1, "bench_hypotheses: frames of the recording", "two or more", frames.size());
  }
};

/// The same model, but for a millimetre per second in each particle: simulations that are equal to the last bit would
/// predict each other's branches.
Model nudged(Model model, unsigned number) {
  std::mt19937 generator(number);
  std::uniform_real_distribution<float> nudge(-1e-3F, 1e-3F);
  for (Index i = 0; i < model.fluid().size(); ++i) {
    model.fluid().velocity(0, i) += nudge(generator);
  }
  return model;
}

/// Wall time of all frames but the first [s], in which buffers grow.
double seconds_for(const Pour& pour, const Model& model, int count, int threads, int threads_each = 1) {
  HypothesisFilterSettings settings;
  settings.least_probability = 0;
  example::TrackingOptions options;
  options.threads = threads_each;
  HypothesisFilter<Tracker<Model, SilhouetteCorrector<>>> filter(settings, ThreadExecutor{{threads}});
  for (int k = 0; k < count; ++k) {
    const Model own = nudged(model, static_cast<unsigned>(k + 1));
    filter.add(example::tracker_for(pour.recording, own, SilhouetteCorrector<>(), options));
  }
  const double start = pour.recording.timestamps.front() - model.time();
  const auto track = [&](std::size_t frame) {
    if (!filter.track(pour.frames[frame].at(pour.recording.timestamps[frame] - start)).advanced()) {
      throw std::runtime_error("a tracker stopped in frame " + std::to_string(frame));
    }
  };
  track(0);
  return seconds_of([&] {
    for (std::size_t frame = 1; frame < pour.frames.size(); ++frame) {
      track(frame);
    }
  });
}

void side_by_side(const Options& options, Report& report) {
  const std::string title = "hypotheses side by side";
  if (!report.wants(title)) {
    return;
  }
  const Pour pour(options.text("argument"), static_cast<std::size_t>(options.numbers("frames").front()));
  example::TrackingOptions tracking;
  tracking.spacing = 1e-3 * options.number("spacing");
  const int cores = options.numbers("threads").front(), repetitions = options.numbers("repetitions").front();
  tracking.threads = 1;
  const Model model = example::model_of<example::TrackingParts>(pour.recording, tracking);
  tracking.threads = cores;
  const Model on_all = example::model_of<example::TrackingParts>(pour.recording, tracking);
  const long particles = model.fluid().size();
  const std::vector<int> counts = options.numbers("hypotheses");

  std::vector<double> one, one_on_all, one_on_all_over_one;
  struct Several {
    std::vector<double> seconds{}, over_one{}, over_one_on_all{};
  };
  std::vector<Several> several(counts.size());
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    one.push_back(seconds_for(pour, model, 1, 1));
    one_on_all.push_back(seconds_for(pour, on_all, 1, 1, cores));
    one_on_all_over_one.push_back(one_on_all.back() / one.back());
    for (std::size_t k = 0; k < counts.size(); ++k) {
      const double seconds = seconds_for(pour, model, counts[k], cores);
      several[k].seconds.push_back(seconds);
      several[k].over_one.push_back(seconds / one.back());
      several[k].over_one_on_all.push_back(seconds / one_on_all.back());
    }
  }

  report.heading(title, particles, cores);
  const std::string reference = "one hypothesis, on one thread";
  const auto add = [&](const std::string& name, int threads, const std::vector<double>& seconds,
                       const std::vector<double>& ratio) {
    report.add(title, {.name = name,
                       .size = particles,
                       .threads = threads,
                       .value = Spread(seconds),
                       .unit = "s",
                       .ratio = Spread(ratio),
                       .reference = reference});
  };
  add(reference, 1, one, std::vector<double>(one.size(), 1.0));
  add("one hypothesis, on all threads", cores, one_on_all, one_on_all_over_one);
  for (std::size_t k = 0; k < counts.size(); ++k) {
    const std::string name = std::to_string(counts[k]) + " hypotheses";
    add(name, cores, several[k].seconds, several[k].over_one);
    const double fair = std::ceil(static_cast<double>(counts[k]) / cores);
    const auto over = [&](const std::string& what, double factor, const std::vector<double>& ratio) {
      report.add(title, {.name = name + what,
                         .size = particles,
                         .threads = cores,
                         .value = factor * Spread(ratio),
                         .unit = "x",
                         .note = "time over " + std::to_string(static_cast<int>(1 / factor + 0.5)) + " of one's"});
    };
    over(", over fair", 1 / fair, several[k].over_one);
    over(", over one by one on all threads", 1.0 / counts[k], several[k].over_one_on_all);
  }
}

void giving_up(const Options& options, Report& report) {
  for (const std::string& folder : options.words("junctions")) {
    const std::string title = "giving up hypotheses: " + folder;
    if (folder.empty() || !report.wants(title)) {
      continue;
    }
    const Recording recording = read_recording(folder);
    const int cores = options.numbers("threads").front();
    example::BlockageOptions all, pruned;
    all.tracking.spacing = pruned.tracking.spacing = 1e-3 * options.number("junction-spacing");
    all.tracking.threads = pruned.tracking.threads = cores;
    all.method = pruned.method = options.text("method");
    all.least_probability = 0;
    example::BlockageResult of_all, of_pruned;
    // of all threads together, so that it does not matter what else the machine does
    const auto processor_seconds_of = [](auto&& f) {
      const std::clock_t start = std::clock();
      f();
      return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    };
    const double seconds_pruned =
        processor_seconds_of([&] { of_pruned = example::find_blockage(recording, pruned, [](double) {}); });
    const double seconds_all =
        processor_seconds_of([&] { of_all = example::find_blockage(recording, all, [](double) {}); });

    report.heading(title, static_cast<long>(of_all.course.names.size()), cores);
    const auto add = [&](const std::string& what, double of_none_given_up, double with, const std::string& unit) {
      const auto row = [&](const std::string& name, double value) {
        report.add(title, {.name = name,
                           .size = static_cast<long>(of_all.course.names.size()),
                           .threads = cores,
                           .value = value,
                           .unit = unit,
                           .ratio = Spread(value / of_none_given_up),
                           .reference = what + ", all to the end"});
      };
      row(what + ", all to the end", of_none_given_up);
      row(what + ", hopeless ones given up", with);
    };
    add("frames simulated", static_cast<double>(of_all.course.frames_run),
        static_cast<double>(of_pruned.course.frames_run), "");
    report.add(title, {.name = "frames simulated in coarse particles, hopeless ones given up",
                       .value = static_cast<double>(of_pruned.course.scouted_frames_run),
                       .unit = ""});
    add("processor time", seconds_all, seconds_pruned, "s");
    const std::string answer = example::blockage_answer(of_all), other = example::blockage_answer(of_pruned);
    const auto certainty = [](const example::BlockageResult& result, const std::string& of) {
      for (const auto& [name, course] : result.configurations) {
        if (name == of && !course.empty()) {
          return 100 * course.back();
        }
      }
      return 0.0;
    };
    report.add(
        title,
        {.name = "probability of '" + answer + "', all to the end", .value = certainty(of_all, answer), .unit = "%"});
    report.add(title, {.name = "probability of '" + other + "', hopeless ones given up",
                       .value = certainty(of_pruned, other),
                       .unit = "%",
                       .note = answer == other ? "the same answer" : "ANOTHER ANSWER"});
    for (std::size_t leg = 0; leg < of_all.legs.size(); ++leg) {
      if (of_all.leg_opening[leg] && of_pruned.leg_opening[leg]) {
        const auto &one = *of_all.leg_opening[leg], &two = *of_pruned.leg_opening[leg];
        report.add(title, {.name = "opening of leg " + of_all.legs[leg].name + ", all to the end",
                           .value = 100 * one.median,
                           .unit = "%"});
        report.add(title, {.name = "opening of leg " + of_all.legs[leg].name + ", hopeless ones given up",
                           .value = 100 * two.median,
                           .unit = "%"});
      }
    }
  }
}

void measure(const Options& options, Report& report) {
  side_by_side(options, report);
  giving_up(options, report);
}

}  // namespace

int main(int argc, char** argv) {
  Options options("bench_hypotheses", "several hypotheses against one, and with hopeless ones given up");
  options.add("threads", "2", "over which hypotheses are shared out; the number of cores")
      .add("hypotheses", "2,4,8", "how many are followed")
      .add("spacing", "4", "of particles [mm]")
      .add("frames", "40", "how many are tracked at most")
      .add("repetitions", "3", "runs of each kind")
      .add("junctions", "", "folders of recordings of a pipe junction, to measure what giving up saves")
      .add("junction-spacing", "4.2", "of their particles [mm]; 4.2 makes five across a leg")
      .add("method", example::default_method, "by which those are followed")
      .argument("examples/data/pour_cup", "folder of the pour that hypotheses are about");
  return benchmark_main(argc, argv, options, measure);
}
