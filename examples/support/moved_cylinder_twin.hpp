// SPDX-License-Identifier: MIT
#pragma once

/// A twin of a cylinder of water that a robot moves, in which one effect is hidden that the model lacks, or an error of
/// the measurement: how high the water's highest point is over the floor is all that is recorded.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <numbers>
#include <optional>
#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/boundary/shapes.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/discovery/reading_series.hpp>
#include <decant/io/recording_writer.hpp>
#include <decant/pressure/dfsph.hpp>
#include <decant/simulation/fill.hpp>
#include <decant/simulation/gauges.hpp>
#include <decant/simulation/simulator.hpp>

#include "cylinder_scenarios.hpp"
#include "effect_cases.hpp"
#include "effect_twin.hpp"
#include "twin.hpp"

namespace example {

/// Open, and deep enough that nothing spills.
inline decant::CylinderInside moved_cylinder(const CylinderScenario& scenario) {
  return {scenario.radius, scenario.depth + 2.5 * scenario.radius, 0.003, decant::Face::PositiveZ};
}

/// As a recording tells it [m^3].
inline double recorded_volume(const CylinderScenario& scenario) {
  return std::numbers::pi * scenario.radius * scenario.radius * scenario.depth;
}

/// What really happens on one path of a case.
class MovedCylinder {
 public:
  using Model = decant::Simulator<EffectRealityParts<decant::Dfsph<float>>>;

  /// @param effects those of the case, or none.
  MovedCylinder(const EffectCase& hidden, const std::vector<HiddenEffect>& effects, std::size_t which, double spacing)
      : scenario_(cylinder_scenarios().at(hidden.scenario)),
        errors_(tolerated_errors(hidden, which)),
        model_(effect_reality_settings(effects, errors_, spacing)) {
    using namespace decant;
    const CylinderPath path = scenario_.path(which);
    body_ = model_.add_body("cylinder", moved_cylinder(scenario_), PoseTrack(path.at(0)));
    set_lasting_forces(effects, model_);
    const double amount = (1 + errors_.fill) * (1 + strength_of(effects, "fill"));
    initial_volume_ = fill(model_, body_, FillAmount::volume(amount * recorded_volume(scenario_))).volume;
    model_.set_motion(body_, true_motion(path, errors_.latency + strength_of(effects, "latency")));
    for (const HiddenEffect& each : effects) {
      nlohmann::json& description = descriptions_.emplace_back(nlohmann::json::object());
      if (each.is("lateral_force")) {
        const Vector3<double> direction = each.level_direction();
        description["direction"] = {direction.x(), direction.y(), direction.z()};
        if (each.variant == "window") {
          pull_sideways(each, model_);
          description["onset_s"] = each.onset;
          description["until_s"] = each.until;
        }
      }
    }
  }

  const Model& model() const { return model_; }
  const ToleratedErrors& errors() const { return errors_; }
  double initial_volume() const { return initial_volume_; }  ///< [m^3]
  const std::vector<nlohmann::json>& descriptions() const { return descriptions_; }

  /// Goes on to a time [s]. Throws std::runtime_error where it cannot.
  void advance(double time) { step_reality(model_, time, time); }

  /// Of the highest point over the floor [m].
  double height() {
    decant::Gauges<float> gauges(model_.spacing());
    gauges.observe(model_.fluid(), {1});
    const auto& body = model_.bodies()[body_];
    return gauges.top(body.motion.at(model_.time()), body.bounds).value_or(0.0);
  }

 private:
  // what is recorded at t happened at t - late
  static decant::PoseTrack true_motion(const CylinderPath& path, double late) {
    constexpr double samples_per_second = 200;
    std::vector<decant::PoseTrack::Sample> samples;
    for (int k = 0; k <= static_cast<int>(std::ceil(path.duration() * samples_per_second)); ++k) {
      const double time = k / samples_per_second;
      samples.push_back({time, path.at(time + late)});
    }
    return decant::PoseTrack(std::move(samples));
  }

  CylinderScenario scenario_;
  ToleratedErrors errors_;
  Model model_;
  decant::BodyId body_ = 0;
  double initial_volume_ = 0;
  std::vector<nlohmann::json> descriptions_{};
};

inline constexpr double cylinder_frames_per_second = 60;

inline int cylinder_frames(const EffectCase& of, std::size_t which, const EffectRecordingSettings& settings) {
  const double seconds = std::min(cylinder_scenarios().at(of.scenario).path(which).duration(), settings.longest);
  return std::max(1, static_cast<int>(std::lround(seconds * cylinder_frames_per_second)));
}

/// Records one path of a case in a new folder, with noise of 0.3 mm and errors of 0.5 mm that last for 0.3 s.
/// @param which 0: a, to learn from; 1: b, to be predicted. @param progress is told how far it is, 0 .. 1.
/// Throws std::invalid_argument and std::runtime_error.
inline void record_moved_cylinder(
    const EffectCase& hidden, std::size_t which, const std::filesystem::path& folder,
    const EffectRecordingSettings& settings = {}, const std::function<void(double)>& progress = [](double) {}) {
  using namespace decant;
  if (settings.solver != RealitySolver::DivergenceFree) {
    throw std::invalid_argument("record_moved_cylinder: solver: expected divergence_free");
  }
  const CylinderScenario& scenario = cylinder_scenarios().at(hidden.scenario);
  const CylinderPath path = scenario.path(which);
  const std::vector<HiddenEffect> effects = settings.with_effect ? hidden.effects() : std::vector<HiddenEffect>{};
  MovedCylinder reality(hidden, effects, which, settings.spacing);

  Recording header;
  header.name = "cylinder" + std::to_string(hidden.scenario) + "_" + interaction_letter(which);
  header.frames_per_second = cylinder_frames_per_second;
  header.bodies.push_back({1, "cylinder", std::nullopt, {}, moved_cylinder(scenario).mesh(), {}});
  header.liquid.initial = recording::Initial{0, std::nullopt, recorded_volume(scenario)};
  // of a camera that sees nothing: poses are stored in a camera's frame
  RecordingWriter writer(folder, with_camera(header, PinholeCamera(500, 500, 319.5, 239.5, 640, 480), Pose{}));

  recording::Measurements measurements;
  measurements.channels.push_back({"height_mm@cylinder"});
  const std::uint32_t noise_seed = detail::mixed_seed({hidden.seed, 99U, static_cast<std::uint32_t>(which)});
  std::mt19937 tremble(noise_seed);
  std::normal_distribution<double> millimetres(0, 0.3);
  ReadingSeries read("height [m]", {5e-4, 0.3});
  const int frames = cylinder_frames(hidden, which, settings);
  for (int number = 0; number < frames; ++number) {
    const double time = number / cylinder_frames_per_second;
    reality.advance(time);
    read.add(time, reality.height());
    writer.add_frame({{}, {path.at(time)}, {}});
    progress(static_cast<double>(number + 1) / frames);
  }
  const ReadingSeries wrong = read.with_errors(noise_seed + 1);
  for (std::size_t k = 0; k < read.size(); ++k) {
    measurements.times.push_back(read.time(k));
    measurements.channels.front().values.push_back(1e3 * wrong.value(k) + millimetres(tremble));
  }
  writer.set_measurements(std::move(measurements));
  nlohmann::json truth = effect_truth(hidden, effects, which, reality, settings.solver);
  truth["recorded_ml"] = 1e6 * recorded_volume(scenario);
  truth["volume_ml"] = {
      {"cylinder", std::vector<double>(static_cast<std::size_t>(frames), 1e6 * reality.initial_volume())}};
  writer.set_truth(truth.dump());
  writer.finish();
}

}  // namespace example
