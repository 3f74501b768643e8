// SPDX-License-Identifier: MIT
// Replays a measured motion of a cylinder of water and compares simulated with measured sloshing:
//   replay_motion --poses FILE.csv --heights FILE.csv --radius-mm 49 --depth-mm 78 --json OUT.json --report OUT.html
// With --recording FOLDER what was measured becomes a recording, for find_missing_effect.
// Exit status 0: done; 1: the run failed on the way; 2: a file or an argument is wrong.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include <decant/boundary/shapes.hpp>
#include <decant/core/parallel.hpp>
#include <decant/io/motion_file.hpp>
#include <decant/io/recording.hpp>
#include <decant/io/recording_writer.hpp>
#include <decant/io/report.hpp>
#include <decant/io/scene.hpp>
#include <decant/io/series_file.hpp>
#include <decant/io/table.hpp>
#include <decant/simulation/parts.hpp>

#include "support/result_file.hpp"
#include "support/scene_run.hpp"
#include "support/slosh_analysis.hpp"

namespace {

constexpr double recording_rate = 60;  ///< that of the cameras, frames per second

struct Arguments {
  std::string poses, heights, json, report, vtk, recording;
  double radius_mm = 49, depth_mm = 78, spacing_mm = 4, decay_s = 4;
  int threads = 0;
};

/// Open, and deep enough that nothing spills.
decant::CylinderInside cylinder_of(const Arguments& arguments) {
  const double radius = 1e-3 * arguments.radius_mm;
  return {radius, 1e-3 * arguments.depth_mm + 3 * radius, 0.003, decant::Face::PositiveZ};
}

/// What the measured container holds [m^3].
double volume_of(const Arguments& arguments) {
  return 1e-9 * std::numbers::pi * arguments.radius_mm * arguments.radius_mm * arguments.depth_mm;
}

/// A cylinder that is filled and moves as the poses say.
decant::Scene scene_of(const Arguments& arguments, const decant::PoseTrack& poses) {
  decant::Scene scene;
  scene.name = "replay_motion";
  scene.spacing = 1e-3 * arguments.spacing_mm;
  scene.end = poses.end_time() + arguments.decay_s;
  scene.record_rate = 120;  // twice the cameras' rate, so that peaks are not cut
  scene.liquid = {998.0, 0.001, 0.0728};
  const decant::CylinderInside cylinder = cylinder_of(arguments);
  scene.bodies.push_back(
      {"cylinder",
       decant::scene::CylinderInside{cylinder.radius, cylinder.height, cylinder.wall, decant::scene::Face::PositiveZ},
       poses, true, decant::scene::Slip::Free});
  scene.fluid.push_back(decant::scene::Fill{0, decant::scene::Fill::Amount::Volume, volume_of(arguments)});
  scene.gauges.push_back({"top_mm@cylinder", decant::scene::TopGauge{0}});
  return scene;
}

struct Comparison {
  double peak = 0, measured_peak = 0;  ///< [mm]
  example::Alignment alignment;
  example::Decay decay, measured_decay;
  double motion_begin = 0, motion_end = 0;  ///< when the poses start and stop to change [s]
  example::Record simulated, measured;      ///< heights [mm], each on its own clock; measured above its rest level
};

/// When a track moves: from the last pose at which nothing has changed yet to the first after which nothing changes.
std::pair<double, double> moving_time(const decant::PoseTrack& track) {
  const auto& samples = track.samples();
  const auto differ = [](const decant::Pose& a, const decant::Pose& b) {
    return (a.translation - b.translation).norm() > 1e-5 || a.rotation.angularDistance(b.rotation) > 1e-4;
  };
  std::size_t first = 0, last = samples.size() - 1;
  while (first + 1 < samples.size() && !differ(samples[first + 1].pose, samples.front().pose)) {
    ++first;
  }
  while (last > first && !differ(samples[last - 1].pose, samples.back().pose)) {
    --last;
  }
  return {samples[first].time, samples[last].time};
}

Comparison compare(const Arguments& arguments, const decant::PoseTrack& poses, const decant::Series& heights,
                   const example::RunResult& result) {
  Comparison out;
  const std::vector<double>& time = result.series.columns[0];
  const double run_end = time.back();
  std::tie(out.motion_begin, out.motion_end) = moving_time(poses);
  out.simulated = {time, *result.series.find("top_mm@cylinder")};
  out.measured = {heights.columns[0], *heights.find("height_mm")};

  const double window_end = std::min(poses.end_time(), run_end);
  out.alignment = example::align(out.simulated, out.measured, 0, window_end);
  const double shift = out.alignment.shift;
  const bool aligned = out.alignment.correlation > -1;
  // the first picture alone is the zero of the recording: take the mean of the time at rest instead
  const double rest_end = aligned ? shift + out.motion_begin - 0.2 : heights.columns[0].front() + 3;
  const double rest = example::mean_between(out.measured, heights.columns[0].front(), rest_end);
  for (double& height : out.measured.value) {
    height -= rest;
  }

  out.peak = example::peak_between(out.simulated, 0, run_end);
  out.measured_peak = example::peak_between(out.measured, -1e9, 1e9);
  const double expected = example::cylinder_slosh_frequency(1e-3 * arguments.radius_mm, 1e-3 * arguments.depth_mm);
  const double low = 0.75 * expected, high = 1.25 * expected;
  // the first tenths of a second still hold what the stop stirred up besides the lowest mode
  const double decay_begin = out.motion_end + 0.3;
  out.decay =
      example::fit_decay({{time, *result.series.find("center_x_mm")}, {time, *result.series.find("center_y_mm")}},
                         decay_begin, run_end, low, high);
  if (aligned) {
    out.measured_decay = example::fit_decay({out.measured}, shift + decay_begin, shift + out.motion_end + 8, low, high);
  }
  return out;
}

/// A recording of the motion, still without frames.
decant::RecordingWriter begin_recording(const Arguments& arguments, const decant::PoseTrack& poses) {
  using namespace decant;
  Recording recording;
  recording.name = std::filesystem::path(arguments.recording).filename().string();
  recording.frames_per_second = recording_rate;
  recording.width = 640;  // of a camera that saw nothing: poses are stored in a camera's frame
  recording.height = 480;
  recording.cameras.push_back({{{500, 500, 319.5, 239.5}}});
  recording::Body body;
  body.object_id = 1;
  body.name = "cylinder";
  body.mesh = cylinder_of(arguments).mesh();
  body.motion = poses;
  recording.bodies.push_back(body);
  recording.liquid.initial = recording::Initial{0, std::nullopt, volume_of(arguments)};
  return {arguments.recording, recording};
}

/// Completes it with what was measured, on the poses' clock, to the end of the decay.
void finish_recording(decant::RecordingWriter& writer, double end, const Comparison& c) {
  if (!(c.alignment.correlation > -1)) {
    throw std::runtime_error("the heights do not cover the motion: expected a recording of all of it");
  }
  decant::recording::Measurements measurements;
  decant::recording::Channel top;
  top.name = "top_mm@cylinder";
  for (int frame = 0; frame < end * recording_rate; ++frame) {
    measurements.times.push_back(frame / recording_rate);
    top.values.push_back(example::value_at(c.measured, measurements.times.back() + c.alignment.shift));
    writer.add_frame({});
  }
  measurements.channels.push_back(std::move(top));
  writer.set_measurements(std::move(measurements));
  writer.finish();
}

std::string text(double value, int digits) {
  return std::isfinite(value) ? decant::detail::fixed_text(value, digits) : "-";
}

decant::Table summary(const Comparison& c, const example::RunResult& result, double wall_seconds) {
  decant::Table table({"", "simulated", "measured"});
  table.add({"peak height [mm]", text(c.peak, 1), text(c.measured_peak, 1)});
  table.add({"correlation during the motion", text(c.alignment.correlation, 3), ""});
  table.add({"motion starts in the recording at [s]", "", text(c.alignment.shift, 2)});
  table.add({"free decay: frequency [Hz]", text(c.decay.frequency, 3), text(c.measured_decay.frequency, 3)});
  table.add({"free decay: damping ratio", text(c.decay.damping_ratio, 4), text(c.measured_decay.damping_ratio, 4)});
  table.add({"particles", std::to_string(result.particles), ""});
  table.add({"lost through walls", std::to_string(result.lost), ""});
  table.add({"left over the rim", std::to_string(result.spilled), ""});
  table.add({"sub-steps", std::to_string(result.sub_steps), ""});
  table.add({"largest density error [%]", text(100 * result.density_error_max, 3), ""});
  table.add({"time to run [s]", text(wall_seconds, 0), ""});
  return table;
}

nlohmann::json to_json(const Comparison& c, const example::RunResult& result, double wall_seconds, int threads) {
  nlohmann::json json = example::result_json(result, threads);
  json.erase("series");
  json["peak_mm"] = example::number_json(c.peak);
  json["measured_peak_mm"] = example::number_json(c.measured_peak);
  json["correlation"] = example::number_json(c.alignment.correlation);
  json["time_shift_s"] = example::number_json(c.alignment.shift);
  json["decay_frequency_hz"] = example::number_json(c.decay.frequency);
  json["measured_frequency_hz"] = example::number_json(c.measured_decay.frequency);
  json["damping_ratio"] = example::number_json(c.decay.damping_ratio);
  json["measured_damping_ratio"] = example::number_json(c.measured_decay.damping_ratio);
  json["wall_s"] = wall_seconds;
  json["steps_wall_s"] = result.step_seconds;
  const std::vector<double>& time = c.simulated.time;
  std::vector<double> measured;
  for (const double t : time) {
    measured.push_back(example::value_at(c.measured, t + c.alignment.shift));
  }
  json["series"]["t_s"] = example::column_json(time);
  json["series"]["height_mm"] = example::column_json(c.simulated.value);
  json["series"]["measured_height_mm"] = example::column_json(measured);
  for (const char* name : {"center_x_mm", "center_y_mm"}) {
    json["series"][name] = example::column_json(*result.series.find(name));
  }
  return json;
}

void write_report(const Arguments& arguments, const Comparison& c, const example::RunResult& result,
                  double wall_seconds) {
  decant::HtmlReport report("Sloshing in a cylinder that a robot moves");
  report.paragraph("Motion: " + arguments.poses + "; heights: " + arguments.heights + ". Cylinder of radius " +
                   text(arguments.radius_mm, 1) + " mm, filled to " + text(arguments.depth_mm, 1) +
                   " mm; particles every " + text(arguments.spacing_mm, 2) + " mm.");
  report.table(summary(c, result, wall_seconds));
  report.film(result.pictures,
              "The liquid as a camera that travels with the container sees it; lighter where it moves "
              "faster against the container. The dotted line in the charts marks the picture's time.");
  decant::LineChart::Line measured{"measured", {}, {}, false};
  for (std::size_t k = 0; k < c.measured.time.size(); ++k) {
    const double t = c.measured.time[k] - c.alignment.shift;
    if (t >= 0 && t <= c.simulated.time.back()) {
      measured.x.push_back(t);
      measured.y.push_back(c.measured.value[k]);
    }
  }
  report.chart({"Highest point above the rest level, in the container's frame",
                "time [s]",
                "height [mm]",
                {{"simulated", c.simulated.time, c.simulated.value, false}, measured}});
  report.chart({"Centre of mass beside the container's axis",
                "time [s]",
                "offset [mm]",
                {{"x", c.simulated.time, *result.series.find("center_x_mm"), false},
                 {"y", c.simulated.time, *result.series.find("center_y_mm"), false}}});
  report.paragraph(
      "Peaks are taken over the whole record. The correlation is Pearson's over the poses' time, after the one time "
      "shift "
      "that makes it highest. Frequency and damping are those of a decaying oscillation fitted from 0.3 s after the "
      "motion "
      "on: to the offset of the centre of mass in the simulation, since the highest point of a whole surface rises "
      "twice a "
      "period; to the height itself in the measurement, whose cameras see part of the surface and so the single "
      "period.");
  report.write(arguments.report);
}

int run(const Arguments& arguments) {
  const auto begin = std::chrono::steady_clock::now();
  const decant::PoseTrack poses = decant::read_motion(arguments.poses);
  const decant::Series heights = decant::read_series(arguments.heights);
  if (heights.find("height_mm") == nullptr || heights.rows() < 2) {
    throw std::runtime_error(arguments.heights + ": must have a column height_mm and at least two rows");
  }
  if (!(poses.begin_time() >= 0)) {
    throw std::runtime_error(arguments.poses + ": times [s] must start at 0 or later");
  }
  example::expect_writable(arguments.json);
  std::optional<decant::RecordingWriter> recording;
  if (!arguments.recording.empty()) {
    recording.emplace(begin_recording(arguments, poses));
  }

  example::RunOptions options;
  options.threads = arguments.threads;
  options.center_in = 0;
  options.pictures = !arguments.report.empty();
  options.pictures_follow = 0;
  if (!arguments.vtk.empty()) {
    options.vtk_folder = arguments.vtk;
  }
  const example::RunResult result = example::run_scene<decant::DefaultParts<>>(scene_of(arguments, poses), options);
  const Comparison comparison = compare(arguments, poses, heights, result);
  const double wall_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();

  example::write_result(arguments.json,
                        to_json(comparison, result, wall_seconds, decant::Threads{arguments.threads}.resolved()));
  std::fputs(summary(comparison, result, wall_seconds).text().c_str(), stdout);
  if (result.status != "ok") {
    std::printf("status: %s\n", result.status.c_str());
  }
  std::printf("figures: %s\n", arguments.json.c_str());
  if (recording) {
    finish_recording(*recording, poses.end_time() + arguments.decay_s, comparison);
    std::printf("recording: %s\n", arguments.recording.c_str());
  }
  if (!arguments.report.empty()) {
    write_report(arguments, comparison, result, wall_seconds);
    std::printf("report:  %s\n", arguments.report.c_str());
  }
  if (!arguments.vtk.empty()) {
    std::printf("VTK:     %s/all.pvd (ParaView)\n", arguments.vtk.c_str());
  }
  return result.status == "ok" ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Replays a measured motion of a cylinder of water and compares the sloshing.");
  Arguments arguments;
  app.add_option("--poses", arguments.poses, "Poses of the centre of the container's base, CSV")->required();
  app.add_option("--heights", arguments.heights, "Measured heights, CSV: t_s,height_mm")->required();
  app.add_option("--radius-mm", arguments.radius_mm, "Inner radius")->check(CLI::Range(1.0, 10000.0));
  app.add_option("--depth-mm", arguments.depth_mm, "Depth of the water at rest")->check(CLI::Range(1.0, 10000.0));
  app.add_option("--spacing-mm", arguments.spacing_mm, "Particle spacing")->check(CLI::Range(0.1, 1000.0));
  app.add_option("--decay-s", arguments.decay_s, "How long to simulate after the last pose")
      ->check(CLI::Range(0.0, 600.0));
  app.add_option("--json", arguments.json, "Where figures and series go")->required();
  app.add_option("--report", arguments.report, "HTML report with charts and pictures");
  app.add_option("--recording", arguments.recording,
                 "Folder to write what was measured to as a recording, with its clock as that of the poses");
  app.add_option("--vtk", arguments.vtk, "Folder for VTK files; open its all.pvd in ParaView");
  app.add_option("--threads", arguments.threads, "Number of threads, 0 for all")->check(CLI::Range(0, 1024));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    return run(arguments);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "replay_motion: %s\n", error.what());
    return 2;
  }
}
