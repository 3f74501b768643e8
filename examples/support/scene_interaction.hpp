// SPDX-License-Identifier: MIT
#pragma once

/// A scene of which something was measured, as the workflow for missing effects takes it: a folder with scene.json and
/// measurements.csv, for what begins otherwise than with a container that is filled.

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <decant/core/types.hpp>
#include <decant/io/recording_reader.hpp>
#include <decant/io/scene.hpp>

#include "recorded_interaction.hpp"
#include "scene_simulator.hpp"

namespace example {

/// A scene, and what was measured of it as a recording without cameras.
struct MeasuredScene {
  decant::Scene scene;
  decant::Recording recording;
};

namespace detail {

/// A container that is filled is a source where there is another container, and that a target.
inline std::vector<decant::recording::Body> recorded_bodies(const decant::Scene& scene) {
  using namespace decant;
  const auto is_filled = [&](std::size_t body) {
    return std::any_of(scene.fluid.begin(), scene.fluid.end(), [&](const scene::Fluid& each) {
      const auto* fill = std::get_if<scene::Fill>(&each);
      return fill != nullptr && fill->body == body;
    });
  };
  std::size_t containers = 0, filled = 0;
  for (std::size_t body = 0; body < scene.bodies.size(); ++body) {
    containers += scene.bodies[body].container() ? 1 : 0;
    filled += is_filled(body) ? 1 : 0;
  }
  std::vector<recording::Body> bodies;
  for (std::size_t body = 0; body < scene.bodies.size(); ++body) {
    const scene::Body& of = scene.bodies[body];
    recording::Body& one = bodies.emplace_back();
    one.object_id = static_cast<int>(body) + 1;
    one.name = of.name;
    one.mesh = shape_of(of, scene.spacing).mesh;
    one.motion = of.motion;
    if (containers > 1 && filled > 0 && of.container()) {
      one.role = is_filled(body) ? recording::Role::Source : recording::Role::Target;
    }
  }
  return bodies;
}

/// Channels that are named as one of the scene's gauges are where that is, in metres.
inline void place_channels(const decant::Scene& scene, std::vector<decant::recording::Channel>& channels) {
  for (decant::recording::Channel& channel : channels) {
    for (const decant::scene::Gauge& gauge : scene.gauges) {
      if (gauge.name != channel.name) {
        continue;
      }
      if (const auto* level = std::get_if<decant::scene::LevelGauge>(&gauge.kind)) {
        channel.place = {level->x, level->y, 0};
      } else if (const auto* pressure = std::get_if<decant::scene::PressureGauge>(&gauge.kind)) {
        channel.place = pressure->point;
      }
    }
  }
}

}  // namespace detail

/// Measurements are on the scene's clock; those from before it begins or after it ends do not count. Places in the
/// names of channels are in metres where a gauge of the scene has that name, else in millimetres, as recordings have
/// them. Throws std::runtime_error, one line, for files that are not as the formats have them, another composition than
/// the default one, and where nothing was measured while the scene lasts.
inline MeasuredScene read_measured_scene(const std::filesystem::path& folder) {
  using namespace decant;
  const auto refuse = [&](const std::string& what) { throw std::runtime_error(folder.string() + "/" + what); };
  MeasuredScene read{read_scene(folder / "scene.json"), {}};
  const Scene& scene = read.scene;
  if (scene.composition != scene::Composition::Default) {
    refuse("scene.json: composition: expected default, which effects can be added to");
  }
  Recording& recording = read.recording;
  recording.folder = folder;
  const auto last = folder.has_filename() ? folder.filename() : folder.parent_path().filename();
  recording.name = last.empty() || last == "." ? scene.name : last.string();
  recording.gravity = scene.gravity;
  recording.liquid.density = scene.liquid.density;
  recording.liquid.viscosity = scene.liquid.viscosity;
  recording.liquid.surface_tension = scene.liquid.surface_tension;
  recording.bodies = detail::recorded_bodies(scene);
  const std::filesystem::path file = folder / "measurements.csv";
  recording.measurements = parse_measurements(detail::text_of_file(file), file.string());
  detail::place_channels(scene, recording.measurements.channels);
  recording.timestamps = {0};  // whether or not anything was measured then
  for (const double time : recording.measurements.times) {
    if (time > 1e-9 && time < scene.end + 1e-9) {
      recording.timestamps.push_back(time);
    }
  }
  if (recording.timestamps.size() < 2) {
    refuse("measurements.csv: expected times while the scene lasts, from 0 to " +
           decant::detail::number_text(scene.end) + " s");
  }
  recording.frames = recording.timestamps.size();
  recording.frames_per_second = static_cast<double>(recording.frames - 1) / recording.timestamps.back();
  return read;
}

/// With particles of options.model.spacing, and the solver's settings of a tracked model in place of the scene's.
/// Throws std::invalid_argument and std::runtime_error for scenes that cannot be set up, or of which nothing was
/// measured that a simulation could read, and for tolerances of effects that there are not.
inline RecordedInteraction scene_interaction(MeasuredScene measured, const InteractionOptions& options) {
  using namespace decant;
  std::vector<std::string> sources{detail::text_of_file(measured.recording.folder / "scene.json")};
  for (const scene::Body& body : measured.scene.bodies) {
    if (const auto* mesh = std::get_if<scene::Mesh>(&body.shape)) {
      sources.push_back(detail::text_of_file(mesh->file));
    }
    for (const PoseTrack::Sample& sample : body.motion.samples()) {
      sources.push_back(decant::detail::number_text(sample.time));
      for (const double x : sample.pose.translation) {
        sources.push_back(decant::detail::number_text(x));
      }
      for (const double x : sample.pose.rotation.coeffs()) {
        sources.push_back(decant::detail::number_text(x));
      }
    }
  }
  const auto start_of = std::make_shared<Scene>(std::move(measured.scene));
  start_of->solver = {};
  std::vector<BodyId> watched;
  for (std::size_t body = 0; body < measured.recording.bodies.size(); ++body) {
    if (measured.recording.bodies[body].role) {
      watched.push_back(static_cast<BodyId>(body));
    }
  }
  auto start = [start_of, watched](SimulatorSettings solver, double fill) {
    solver.liquid = {start_of->liquid.density, start_of->liquid.viscosity, 0};
    solver.gravity = start_of->gravity;
    solver.threads = {1};
    Simulator<EffectParts<float>> model = set_up_scene<EffectParts<float>>(*start_of, solver, fill).simulator;
    for (const BodyId body : watched) {
      model.watch_contents(body);
    }
    return model;
  };
  return detail::interaction_of(std::move(measured.recording), options, std::move(start), 1.25, sources);
}

/// What a folder holds that a model can be compared with.
using InteractionSource = std::variant<decant::Recording, MeasuredScene>;

/// A recording, or a scene where there is scene.json and no recording.json. Throws std::runtime_error.
inline InteractionSource read_interaction_source(const std::filesystem::path& folder) {
  const auto has = [&](const char* file) { return std::filesystem::exists(folder / file); };
  if (has("scene.json") && !has("recording.json")) {
    return read_measured_scene(folder);
  }
  return decant::read_recording(folder);
}

inline const decant::Recording& recording_of(const InteractionSource& source) {
  const auto* measured = std::get_if<MeasuredScene>(&source);
  return measured != nullptr ? measured->recording : std::get<decant::Recording>(source);
}

/// See recorded_interaction and scene_interaction.
inline RecordedInteraction interaction_of(const InteractionSource& source, const InteractionOptions& options) {
  const auto* measured = std::get_if<MeasuredScene>(&source);
  return measured != nullptr ? scene_interaction(*measured, options)
                             : recorded_interaction(std::get<decant::Recording>(source), options);
}

}  // namespace example
