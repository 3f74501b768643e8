// SPDX-License-Identifier: MIT
#pragma once

/// A twin of a pipe junction in which one effect is hidden that the model lacks: a leg that is blocked in part, a leak,
/// a thicker liquid, less that comes in. A camera sees what runs out; the pipes are not transparent.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/camera/pinhole_camera.hpp>
#include <decant/io/recording_writer.hpp>
#include <decant/pressure/dfsph.hpp>
#include <decant/simulation/outlet.hpp>
#include <decant/simulation/simulator.hpp>

#include "effect_cases.hpp"
#include "effect_twin.hpp"
#include "junction_scenarios.hpp"
#include "twin.hpp"

namespace example {

/// What really happens in one pour of a case.
class EffectJunction {
 public:
  using Model = decant::Simulator<EffectRealityParts<decant::Dfsph<float>>>;

  /// @param effects those of the case, or none.
  EffectJunction(const EffectCase& hidden, const std::vector<HiddenEffect>& effects, std::size_t which, double spacing)
      : errors_(tolerated_errors(hidden, which)), model_(effect_reality_settings(effects, errors_, spacing)) {
    using namespace decant;
    const JunctionScenario& scenario = junction_scenarios().at(hidden.scenario);
    LegOpenings open;
    for (const HiddenEffect& each : effects) {
      if (each.is("obstacle")) {
        (each.side < 0 ? open.left : open.right) = 1 - each.strength;
        open.place = 0.55 + 0.1 * each.displacement.x();
      }
    }
    const BodyId junction = model_.add_body("junction", scenario.pipes(open).mesh(),
                                            PoseTrack(Pose{Eigen::Quaterniond::Identity(), errors_.pan_offset}));
    const auto poses = scenario.bowl_poses();
    for (const Pose& pose : poses) {
      model_.watch_contents(model_.add_body("bowl", scenario.bowl().mesh(), PoseTrack(pose)));
    }
    set_lasting_forces(effects, model_);
    model_.add_inlet(scenario.inlet(which, (1 + errors_.fill) * (1 - strength_of(effects, "inlet_flow")),
                                    std::max(0.0, errors_.latency)),
                     Origin{3});
    for (const HiddenEffect& each : effects) {
      nlohmann::json& description = descriptions_.emplace_back(nlohmann::json::object());
      if (each.is("leak")) {
        add_leak(scenario, each, junction, description);
      } else if (each.is("obstacle")) {
        description["leg"] = each.side < 0 ? "left" : "right";
      }
    }
  }

  Model& model() { return model_; }
  const Model& model() const { return model_; }
  const ToleratedErrors& errors() const { return errors_; }
  double initial_volume() const { return 0; }  ///< [m^3]
  const std::vector<nlohmann::json>& descriptions() const { return descriptions_; }

 private:
  // a hole in a leg's underside
  void add_leak(const JunctionScenario& scenario, const HiddenEffect& effect, decant::BodyId junction,
                nlohmann::json& description) {
    using namespace decant;
    const double share = 0.5 + 0.1 * effect.displacement.x();
    const Vector3<double> middle(effect.side * share * scenario.reach, 0, 0.18 - share * scenario.fall);
    OutletSettings hole;
    hole.body = junction;
    hole.position = middle - Vector3<double>(0, 0, scenario.leg_radius - 0.003);
    hole.radius = 0.012;
    hole.exit = middle - Vector3<double>(0, 0, scenario.leg_radius + 0.015);
    hole.flow = {{0, 1e-6 * effect.strength}, {60, 1e-6 * effect.strength}};
    model_.add_outlet(hole);
    description["leg"] = effect.side < 0 ? "left" : "right";
    description["place"] = "junction";
    description["position_m"] = {hole.position.x(), hole.position.y(), hole.position.z()};
  }

  ToleratedErrors errors_;
  Model model_;
  std::vector<nlohmann::json> descriptions_{};
};

inline int junction_frames(const EffectCase& of, std::size_t which, const EffectRecordingSettings& settings) {
  const double seconds = std::min(junction_scenarios().at(of.scenario).duration(which), settings.longest);
  return std::max(1, static_cast<int>(std::lround(seconds * settings.frames_per_second)));
}

/// Records one pour of a case in a new folder. @param which 0: a, to learn from; 1: b, to be predicted. @param progress
/// is told how far it is, 0 .. 1. Throws std::invalid_argument and std::runtime_error.
inline void record_effect_junction(
    const EffectCase& hidden, std::size_t which, const std::filesystem::path& folder,
    const EffectRecordingSettings& settings = {}, const std::function<void(double)>& progress = [](double) {}) {
  using namespace decant;
  if (settings.solver != RealitySolver::DivergenceFree) {
    throw std::invalid_argument("record_effect_junction: solver: expected divergence_free");
  }
  const JunctionScenario& scenario = junction_scenarios().at(hidden.scenario);
  const std::vector<HiddenEffect> effects = settings.with_effect ? hidden.effects() : std::vector<HiddenEffect>{};
  EffectJunction reality(hidden, effects, which, settings.spacing);
  const auto poses = scenario.bowl_poses();

  Recording header;
  header.name = "junction" + std::to_string(hidden.scenario) + "_" + interaction_letter(which);
  header.frames_per_second = settings.frames_per_second;
  header.bodies.push_back({1, "junction", recording::Role::Junction, {}, scenario.pipes().mesh(), {}});
  header.bodies.push_back({2, "left bowl", recording::Role::Target, {}, scenario.bowl().mesh(), {}});
  header.bodies.push_back({3, "right bowl", recording::Role::Target, {}, scenario.bowl().mesh(), {}});
  header.liquid.inlet = scenario.inlet(which);
  const PinholeCamera camera(560, 560, 319.5, 239.5, 640, 480);
  const Pose camera_from_world = looking_at({0, -0.42, 0.62}, {0, 0, 0.08});
  RecordingWriter writer(folder, with_camera(header, camera, camera_from_world));
  TwinSight sight(camera, camera_from_world, {0, 0, 0.1}, reality.model());
  const std::uint32_t noise_seed = detail::mixed_seed({hidden.seed, 99U, static_cast<std::uint32_t>(which)});
  MaskNoise noise(noise_seed);
  std::mt19937 drops(noise_seed);

  nlohmann::json left_ml = nlohmann::json::array(), right_ml = nlohmann::json::array();
  double removed = 0;
  const int frames = junction_frames(hidden, which, settings);
  for (int number = 0; number < frames; ++number) {
    const double time = number / settings.frames_per_second;
    const StepReport report = step_reality(reality.model(), time, time);
    removed = report.drained;
    left_ml.push_back(1e6 * report.contents[0].volume);
    right_ml.push_back(1e6 * report.contents[1].volume);
    recording::Frame frame;
    frame.bodies = {Pose{}, poses[0], poses[1]};
    frame.shots.emplace_back();
    const Mask noisy = noise.apply(sight.look(reality.model()));
    if (number == 0 || drops() % 40 != 0) {  // else a dropped frame
      frame.shots.front().mask = noisy;
    }
    writer.add_frame(frame);
    progress(static_cast<double>(number + 1) / frames);
  }
  nlohmann::json truth = effect_truth(hidden, effects, which, reality, settings.solver);
  truth["removed_ml"] = 1e6 * removed;
  truth["volume_ml"] = {{"left bowl", left_ml}, {"right bowl", right_ml}};
  writer.set_truth(truth.dump());
  writer.finish();
}

}  // namespace example
