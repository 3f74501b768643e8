// SPDX-License-Identifier: MIT
#pragma once

/// A twin of the pipe junction of Schenck and Fox (2017), their third experiment: an inverted T whose legs bend down
/// over two bowls, into which a litre pours as from a container that is tilted steadily. What blocks a leg is inside,
/// where no camera sees.
///
/// Only where legs are what limits the flow does it say how much of one is open. So legs are slim (each takes about as
/// much as comes to it, at the few centimetres of head that two open ones leave in the stem), the stem is wide and so
/// high that it does not run over when one leg has to take all, and the inlet is just above the legs: a jet that falls
/// from the top of the stem would have speed enough for any leg.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <numbers>
#include <random>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/boundary/pipe_network.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/force/linear_drag.hpp>
#include <decant/io/recording.hpp>
#include <decant/pressure/dfsph.hpp>
#include <decant/simulation/inlet.hpp>
#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator.hpp>

#include "twin.hpp"

namespace example {

/// What is in the pipes, and how the recording of it goes wrong.
struct JunctionTwin {
  double left_opening = 1, right_opening = 1;  ///< of each leg's cross-section, 0 .. 1
  double leak = 0;                             ///< area of a hole in the left leg's underside over the leg's, 0 .. 0.5
  std::uint32_t seed = 1;
  bool hidden_physics = true;  ///< false: the reality is the model itself, at another spacing
  bool noisy_poses = true;
  bool noisy_masks = true;
  double spacing = 0.0035;  ///< of the reality's particles [m]
  double duration = 3.2;    ///< [s]
  double frames_per_second = 30;
  int threads = 0;  ///< 0: all; the recording does not depend on it
};

/// Physics of the reality that the model does not have, and what it is told wrongly.
struct JunctionErrors {
  HiddenPhysics physics;
  double flow_factor = 1;  ///< true flow over the recorded one
  double flow_delay = 0;   ///< it comes so much later than recorded [s]
};

inline JunctionErrors draw_junction_errors(const JunctionTwin& twin) {
  JunctionErrors errors;
  if (!twin.hidden_physics) {
    return errors;
  }
  std::mt19937 random(7919 * twin.seed + 29);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  errors.flow_factor = between(0.93, 1.07);
  errors.flow_delay = between(0, 0.07);
  std::vector<int> kinds{0, 1, 2};
  std::shuffle(kinds.begin(), kinds.end(), random);
  for (int k = 0; k < 2; ++k) {
    switch (kinds[static_cast<std::size_t>(k)]) {
      case 0: {  // a table that is not level: up to 3 degrees
        const double size = between(0.2, 0.5), angle = between(0, 2 * std::numbers::pi);
        errors.physics.pull = {size * std::cos(angle), size * std::sin(angle), 0};
        break;
      }
      case 1:
        errors.physics.drag = between(0.3, 0.7);
        break;
      default:
        errors.physics.kinematic_viscosity = std::pow(10.0, between(-5, -4.3));
        break;
    }
  }
  return errors;
}

/// Radius of a leg's bore [m].
inline constexpr double junction_leg_radius = 0.0105;

/// A leg that is blocked has a bore that narrows and widens again at once, about a place that the seed draws.
inline decant::PipeNetwork junction_pipes(const JunctionTwin& twin) {
  std::mt19937 random(389 * twin.seed + 7);
  decant::PipeNetwork pipes;
  pipes.radius = 0.018;  // of the stem
  pipes.places = {{0, 0.46}, {-0.13, 0.175}, {0.13, 0.175}, {0, 0.18}, {-0.13, 0.155}, {0.13, 0.155}};
  pipes.pipes = {{0, 3}, {3, 1}, {3, 2}, {1, 4}, {2, 5}};
  const double slim = junction_leg_radius / pipes.radius;
  for (const std::size_t leg : {std::size_t{1}, std::size_t{2}}) {
    const double opening = leg == 1 ? twin.left_opening : twin.right_opening;
    const double place = std::uniform_real_distribution<double>(0.4, 0.75)(random);
    auto& bore = pipes.pipes[leg].bore;
    bore = {{0, 1}, {0.2, slim}};
    if (opening < 1) {
      // a bore that is nothing would have walls of no thickness: less than any particle passes
      const double narrow = slim * std::max(std::sqrt(opening), 0.02);
      bore.insert(bore.end(),
                  {{place - 0.06, slim}, {place - 0.05, narrow}, {place + 0.05, narrow}, {place + 0.06, slim}});
    }
    bore.emplace_back(1, slim);
    pipes.pipes[leg + 2].bore = {{0, slim}, {1, slim}};
  }
  if (twin.leak > 0) {
    // a window below: length times width
    const double area = twin.leak * std::numbers::pi * junction_leg_radius * junction_leg_radius, width = 0.012;
    const double share = area / width / std::hypot(0.13, 0.005);
    pipes.holes = {{1, 0.5 - share / 2, 0.5 + share / 2, std::numbers::pi / 2, width / junction_leg_radius}};
  }
  return pipes;
}

/// As the recording has it: nothing blocks it.
inline decant::TriangleMesh junction_as_known() { return junction_pipes({}).mesh(); }

inline decant::TriangleMesh junction_bowl() { return decant::Bowl{0.1, 0.08, 0.003}.mesh(); }
inline std::array<decant::Pose, 2> junction_bowl_poses() {
  return {decant::Pose{Eigen::Quaterniond::Identity(), {-0.14, 0, 0.02}},
          decant::Pose{Eigen::Quaterniond::Identity(), {0.14, 0, 0.02}}};
}

/// A cube of a litre that is tilted steadily about its lip, full to the brim at first, empty when it lies on its side.
inline std::vector<std::pair<double, double>> litre_from_tilted_cube(double begin, double end) {
  const double litre = 1e-3, rate = 0.5 * std::numbers::pi / (end - begin);  // [rad/s]
  std::vector<std::pair<double, double>> flow{{begin - 0.05, 0.0}};
  constexpr int steps = 40;
  for (int k = 0; k <= steps; ++k) {
    const double tilt = 0.5 * std::numbers::pi * k / steps, steeper = std::max(tilt, 0.25 * std::numbers::pi);
    const double side = tilt < steeper ? std::cos(tilt) : std::sin(tilt);
    flow.emplace_back(begin + tilt / rate, 0.5 * litre * rate / (side * side));
  }
  flow.emplace_back(end + 0.05, 0.0);
  return flow;
}

/// @param errors those of the reality; none for what the recording says.
inline decant::InletSettings junction_inlet(const JunctionErrors& errors) {
  decant::InletSettings inlet;
  inlet.position = {0, 0, 0.207};
  inlet.radius = 0.015;
  inlet.flow = litre_from_tilted_cube(0.3, 2.3);
  for (auto& [time, flow] : inlet.flow) {
    time += errors.flow_delay;
    flow *= errors.flow_factor;
  }
  return inlet;
}

inline decant::PinholeCamera junction_camera() { return {560, 560, 319.5, 239.5, 640, 480}; }

namespace detail {

template <class Parts>
void record_junction(const JunctionTwin& twin, const JunctionErrors& errors, const std::string& solver_name,
                     const std::filesystem::path& folder, const std::function<void(double)>& progress) {
  using namespace decant;
  SimulatorSettings settings;
  settings.spacing = twin.spacing;
  settings.threads = {twin.threads};
  settings.gravity += errors.physics.pull;
  settings.liquid.dynamic_viscosity = errors.physics.kinematic_viscosity * settings.liquid.density;
  Simulator<Parts> reality(settings);
  const auto bowl_poses = junction_bowl_poses();
  reality.add_body("junction", junction_pipes(twin).mesh());
  const BodyId left = reality.add_body("left bowl", junction_bowl(), PoseTrack(bowl_poses[0]));
  const BodyId right = reality.add_body("right bowl", junction_bowl(), PoseTrack(bowl_poses[1]));
  reality.add_inlet(junction_inlet(errors), Origin{3});
  reality.watch_contents(left);
  reality.watch_contents(right);
  if constexpr (!std::is_same_v<Parts, DefaultParts<>>) {
    reality.template force<LinearDrag<float>>().rate = static_cast<float>(errors.physics.drag);
  }

  Recording header;
  header.name = folder.filename().string();
  header.frames_per_second = twin.frames_per_second;
  header.bodies.push_back({1, "junction", recording::Role::Junction, {}, junction_as_known(), {}});
  header.bodies.push_back({2, "left bowl", recording::Role::Target, {}, junction_bowl(), {}});
  header.bodies.push_back({3, "right bowl", recording::Role::Target, {}, junction_bowl(), {}});
  header.liquid.inlet = junction_inlet({});
  TwinRecorder recorder(folder, header, junction_camera(), looking_at({0, -0.42, 0.62}, {0, 0, 0.08}), {0, 0, 0},
                        {twin.noisy_poses, twin.noisy_masks, twin.seed}, reality);
  nlohmann::json left_ml = nlohmann::json::array(), right_ml = nlohmann::json::array();
  const int frames = static_cast<int>(std::lround(twin.duration * twin.frames_per_second));
  for (int frame = 0; frame < frames; ++frame) {
    const double time = frame / twin.frames_per_second;
    const StepReport report = step_reality(reality, time, time);
    left_ml.push_back(1e6 * report.contents[0].volume);
    right_ml.push_back(1e6 * report.contents[1].volume);
    recorder.add_frame(reality, {{Pose{}, 0.5}, {bowl_poses[0], 0.5}, {bowl_poses[1], 0.5}});
    progress(static_cast<double>(frame + 1) / frames);
  }
  nlohmann::json truth = errors.physics.json();
  truth["left_opening"] = twin.left_opening;
  truth["right_opening"] = twin.right_opening;
  truth["leak"] = twin.leak;
  truth["flow_factor"] = errors.flow_factor;
  truth["flow_delay_s"] = errors.flow_delay;
  truth["solver"] = solver_name;
  truth["seed"] = twin.seed;
  truth["spacing_mm"] = 1e3 * twin.spacing;
  truth["volume_ml"] = {{"left bowl", left_ml}, {"right bowl", right_ml}};
  recorder.finish(truth.dump());
}

}  // namespace detail

/// Makes the recording in a new folder, with the clean silhouettes beside it (truth_mask/, for scoring alone).
/// @param progress is told how far it is, 0 .. 1. Throws std::invalid_argument and std::runtime_error.
inline void record_junction(
    const JunctionTwin& twin, const std::filesystem::path& folder,
    const std::function<void(double)>& progress = [](double) {}) {
  using namespace decant;
  for (const double opening : {twin.left_opening, twin.right_opening}) {
    expects(opening >= 0 && opening <= 1, "JunctionTwin: opening of a leg", "in [0, 1]", opening);
  }
  expects(twin.leak >= 0 && twin.leak <= 0.5, "JunctionTwin: leak", "in [0, 0.5]", twin.leak);
  const JunctionErrors errors = draw_junction_errors(twin);
  if (!twin.hidden_physics) {
    detail::record_junction<DefaultParts<>>(twin, errors, "divergence-free", folder, progress);
  } else {
    // Not PositionBased, which throttles narrow places as no liquid does: some 30 % less passes than here. Nor
    // StateEquation, which throws liquid about where an inlet is below the surface, as this one is when a leg is
    // blocked.
    detail::record_junction<RealityParts<Dfsph<float>>>(twin, errors, "divergence-free, another kernel", folder,
                                                        progress);
  }
}

}  // namespace example
