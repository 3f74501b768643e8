// SPDX-License-Identifier: MIT
/// A recording, tracked from beginning to end by each corrector: how long a frame takes, what its parts take, and how
/// well the liquid is followed. Correctors take turns frame by frame; the reference is the open loop. Model and tracker
/// are those of the example `track`; masks are read beforehand.

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <decant/decant.hpp>
#include <decant/io/recording_reader.hpp>

#include "common.hpp"
#include "support/tracking_run.hpp"

namespace {

using namespace decant_benchmark;
using namespace decant;

/// What a camera saw, in memory.
struct Film {
  Recording recording;
  std::vector<std::optional<Mask>> masks{};

  Film(const std::string& folder, std::size_t most_frames) : recording(read_recording(folder)) {
    expects(!recording.cameras.empty(), "bench_tracker: cameras of the recording", "one or more", 0);
    for (std::size_t frame = 0; frame < std::min(recording.frames, most_frames); ++frame) {
      masks.push_back(recording.liquid_mask(frame, 0));
    }
    expects(!masks.empty(), "bench_tracker: frames of the recording", "one or more", 0);
  }
};

constexpr std::array<const char*, 4> part_names{"physics", "drawing", "correction", "relaxation"};

/// A tracker on its way through the film, and what its frames took.
struct Contestant {
  std::string name;
  std::function<void(std::size_t frame)> track;  ///< throws std::runtime_error where the tracker stops
  std::vector<double> ms{}, part_ms[part_names.size()]{};
  StepReport steps{};  ///< sums over the frames
  double iou = 0;
  int compared = 0;
  Index particles = 0;
};

template <class CorrectorType>
std::unique_ptr<Contestant> contestant(std::string name, const Film& film, const example::TrackingModel& model,
                                       const example::TrackingOptions& options) {
  auto result = std::make_unique<Contestant>();
  result->name = std::move(name);
  auto tracker = std::make_shared<Tracker<example::TrackingModel, CorrectorType>>(
      example::tracker_for(film.recording, model, CorrectorType(), options));
  const double start = film.recording.timestamps.front() - model.time();
  result->track = [tracker, start, &film, own = result.get()](std::size_t frame) {
    const Recording& recording = film.recording;
    const double time = recording.timestamps[frame];
    std::vector<TrackedPose> poses;
    for (std::size_t body = 0; body < recording.bodies.size(); ++body) {
      poses.push_back({static_cast<BodyId>(body), recording.bodies[body].motion.at(time)});
    }
    std::vector<CameraMask> masks;
    if (film.masks[frame]) {
      masks.push_back({0, *film.masks[frame]});
    }
    FrameReport report;
    own->ms.push_back(1e3 * seconds_of([&] { report = tracker->track({time - start, poses, masks, {}}); }));
    if (!report.advanced()) {
      throw std::runtime_error(own->name + " stopped in frame " + std::to_string(frame) + ": " +
                               std::string(to_string(report.status)));
    }
    const double parts[] = {report.physics_ms, report.drawing_ms, report.correction_ms, report.relaxation_ms};
    for (std::size_t k = 0; k < part_names.size(); ++k) {
      own->part_ms[k].push_back(parts[k]);
    }
    own->steps.sub_steps += tracker->step_report().sub_steps;
    own->steps.density_iterations += tracker->step_report().density_iterations;
    own->steps.divergence_iterations += tracker->step_report().divergence_iterations;
    own->particles = tracker->model().fluid().size();
    if (report.posterior.compared_px > 0 && report.posterior.union_px() >= OverlapScoreSettings{}.least_union_px) {
      own->iou += report.posterior.iou();
      ++own->compared;
    }
  };
  return result;
}

double sum_of(const std::vector<double>& values) { return std::accumulate(values.begin(), values.end(), 0.0); }

void report_contestant(Report& report, const Contestant& of, const Contestant& reference, int threads) {
  const std::string title = "corrector " + of.name;
  if (!report.wants(title)) {
    return;
  }
  report.heading(title, of.particles, threads);
  const auto add = [&](const std::string& name, const Spread& value, const std::string& unit, std::string note = "") {
    report.add(title, {.name = name,
                       .size = of.particles,
                       .threads = threads,
                       .value = value,
                       .unit = unit,
                       .note = std::move(note)});
  };
  std::vector<double> ratios;
  for (std::size_t frame = 0; frame < of.ms.size(); ++frame) {
    ratios.push_back(of.ms[frame] / reference.ms[frame]);
  }
  const double frames = static_cast<double>(of.ms.size()), sub_steps = std::max(of.steps.sub_steps, 1);
  report.add(title, {.name = "a frame",
                     .size = of.particles,
                     .threads = threads,
                     .value = Spread(of.ms),
                     .unit = "ms",
                     .ratio = Spread(ratios),
                     .reference = &of == &reference ? "a frame" : "a frame of " + reference.name});
  add("worst frame", *std::max_element(of.ms.begin(), of.ms.end()), "ms");
  add("frames per second", 1e3 * frames / sum_of(of.ms), "1/s", "of all frames together");
  for (std::size_t k = 0; k < part_names.size(); ++k) {
    add(part_names[k], Spread(of.part_ms[k]), "ms",
        "mean " + std::to_string(sum_of(of.part_ms[k]) / frames).substr(0, 5));
  }
  add("sub-steps per frame", sub_steps / frames, "");
  add("a sub-step", sum_of(of.part_ms[0]) / sub_steps, "ms");
  add("density iterations per sub-step", of.steps.density_iterations / sub_steps, "");
  add("divergence iterations per sub-step", of.steps.divergence_iterations / sub_steps, "");
  if (of.compared > 0) {
    add("intersection over union", 100 * of.iou / of.compared, "%", "mean over frames");
  }
}

}  // namespace

int main(int argc, char** argv) {
  Options options("bench_tracker", "a recording, tracked by each corrector");
  options.add("threads", "2", "of each tracker")
      .add("spacing", "3", "of particles [mm]")
      .add("frames", "1000000", "how many are tracked at most")
      .argument("examples/data/pour_cup", "the recording's folder");
  return benchmark_main(argc, argv, options, [](const Options& given, Report& report) {
    const Film film(given.text("argument"), static_cast<std::size_t>(given.numbers("frames").front()));
    example::TrackingOptions settings;
    settings.spacing = 1e-3 * given.number("spacing");
    for (const int threads : given.numbers("threads")) {
      settings.threads = threads;
      const auto model = example::model_of<example::TrackingParts>(film.recording, settings);
      std::vector<std::unique_ptr<Contestant>> all;
      all.push_back(contestant<OpenLoop<>>("open_loop", film, model, settings));
      all.push_back(contestant<SilhouetteCorrector<>>("default", film, model, settings));
      all.push_back(contestant<MapFilter<>>("map_filter_mended", film, model, settings));
      all.push_back(contestant<MapFilterSchenck2017<>>("map_filter", film, model, settings));
      all.push_back(contestant<WarpFieldSchenck2017<>>("warp_field", film, model, settings));
      for (std::size_t frame = 0; frame < film.masks.size(); ++frame) {
        for (const auto& one : all) {
          one->track(frame);
        }
      }
      for (const auto& one : all) {
        report_contestant(report, *one, *all.front(), threads);
      }
    }
  });
}
