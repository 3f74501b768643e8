// SPDX-License-Identifier: MIT
// A recording, tracked from beginning to end: frames per second of wall time for each corrector, what a frame's parts
// take, and how long the worst frame took. Model and tracker are those of `track`; masks are read beforehand. Usage:
// bench_loop_tracker RECORDING [spacing in mm = 3] [threads = 2] [most frames]

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <optional>
#include <string>
#include <vector>

#include <decant/decant.hpp>
#include <decant/io/recording_reader.hpp>

#include "common.hpp"
#include "support/tracking_run.hpp"

namespace {

using namespace decant;

/// What a camera saw, in memory.
struct Film {
  Recording recording;
  std::vector<std::optional<Mask>> masks;
};

template <class CorrectorType>
void measure(const char* name, const Film& film, const example::TrackingModel& model,
             const example::TrackingOptions& options) {
  const Recording& recording = film.recording;
  auto tracker = example::tracker_for(recording, model, CorrectorType(), options);
  const double start = recording.timestamps.front() - model.time();
  std::vector<TrackedPose> poses(recording.bodies.size());
  std::vector<double> frame_ms;
  FrameReport total;
  StepReport steps;
  double iou = 0;
  int compared = 0;
  for (std::size_t frame = 0; frame < film.masks.size(); ++frame) {
    const double time = recording.timestamps[frame];
    for (std::size_t body = 0; body < poses.size(); ++body) {
      poses[body] = {static_cast<BodyId>(body), recording.bodies[body].motion.at(time)};
    }
    std::vector<CameraMask> masks;
    if (film.masks[frame]) {
      masks.push_back({0, *film.masks[frame]});
    }
    const auto before = std::chrono::steady_clock::now();
    const FrameReport report = tracker.track({time - start, poses, masks, {}});
    frame_ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - before).count());
    if (!report.advanced()) {
      std::fprintf(stderr, "%s stopped in frame %zu: %s\n", name, frame, to_string(report.status).data());
      return;
    }
    total.physics_ms += report.physics_ms;
    total.drawing_ms += report.drawing_ms;
    total.correction_ms += report.correction_ms;
    total.relaxation_ms += report.relaxation_ms;
    steps.sub_steps += tracker.step_report().sub_steps;
    steps.density_iterations += tracker.step_report().density_iterations;
    steps.divergence_iterations += tracker.step_report().divergence_iterations;
    if (report.posterior.compared_px > 0 && report.posterior.union_px() >= OverlapScoreSettings{}.least_union_px) {
      iou += report.posterior.iou();
      ++compared;
    }
  }
  const auto frames = static_cast<double>(frame_ms.size());
  double sum = 0;
  for (const double ms : frame_ms) {
    sum += ms;
  }
  std::sort(frame_ms.begin(), frame_ms.end());
  const double sub_steps = std::max(steps.sub_steps, 1);
  std::printf("%s,%d,%ld,%zu,%.1f,%.1f,%.1f,%.1f,%.1f,%.2f,%.2f,%.2f,%.1f,%.2f,%.1f,%.1f,%.3f,%s,%s,%s\n", name,
              options.threads, static_cast<long>(tracker.model().fluid().size()), frame_ms.size(), 1e3 * frames / sum,
              frame_ms[frame_ms.size() / 2], frame_ms[frame_ms.size() * 9 / 10], frame_ms.back(),
              total.physics_ms / frames, total.drawing_ms / frames, total.correction_ms / frames,
              total.relaxation_ms / frames, sub_steps / frames, total.physics_ms / sub_steps,
              steps.density_iterations / sub_steps, steps.divergence_iterations / sub_steps,
              compared > 0 ? iou / compared : 0, decant_benchmark::compiler().c_str(),
              decant_benchmark::flags().c_str(), decant_benchmark::processor().c_str());
  std::fflush(stdout);
}

}  // namespace

int main(int count, char** arguments) {
  if (count < 2) {
    std::fprintf(stderr, "bench_loop_tracker RECORDING [spacing in mm = 3] [threads = 2] [most frames]\n");
    return 2;
  }
  example::TrackingOptions options;
  options.spacing = count > 2 ? 1e-3 * std::atof(arguments[2]) : 0.003;
  options.threads = count > 3 ? std::atoi(arguments[3]) : 2;
  const auto most = static_cast<std::size_t>(count > 4 ? std::max(1, std::atoi(arguments[4])) : 1000000);
  try {
    Film film{read_recording(arguments[1]), {}};
    expects(!film.recording.cameras.empty(), "bench_loop_tracker: cameras of the recording", "one or more", 0);
    for (std::size_t frame = 0; frame < std::min(film.recording.frames, most); ++frame) {
      film.masks.push_back(film.recording.liquid_mask(frame, 0));
    }
    const auto model = example::model_of<example::TrackingParts>(film.recording, options);
    std::printf(
        "corrector,threads,particles,frames,frames_per_second,median_ms,ninth_decile_ms,worst_ms,physics_ms,"
        "drawing_ms,correction_ms,relaxation_ms,sub_steps,ms_per_sub_step,density_iterations,divergence_iterations,"
        "iou_mean,compiler,flags,cpu\n");
    measure<OpenLoop<>>("open_loop", film, model, options);
    measure<SilhouetteCorrector<>>("default", film, model, options);
    measure<MapFilter<>>("map_filter_mended", film, model, options);
    measure<MapFilterSchenck2017<>>("map_filter", film, model, options);
    measure<WarpFieldSchenck2017<>>("warp_field", film, model, options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
