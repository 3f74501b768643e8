// SPDX-License-Identifier: MIT
#pragma once

/// A twin of a robot's pour, for experiments that need the truth.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <numbers>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/boundary/shapes.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/force/linear_drag.hpp>
#include <decant/pressure/dfsph.hpp>
#include <decant/pressure/position_based.hpp>
#include <decant/pressure/state_equation.hpp>
#include <decant/io/recording.hpp>
#include <decant/simulation/fill.hpp>
#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator.hpp>

#include "twin.hpp"

namespace example {

/// What is poured, and how the recording of it goes wrong.
struct PourTwin {
  std::string container = "cup";  ///< or "bottle"
  double fill_fraction = 0.6;     ///< 0 .. 1
  std::uint32_t seed = 1;
  bool hidden_physics = true;  ///< false: the reality is the model itself, at another spacing
  /// What is hidden, where hidden_physics is true; without it the seed draws two effects.
  std::optional<HiddenPhysics> chosen_physics{};
  bool noisy_poses = true;
  bool noisy_masks = true;
  double spacing = 0.003;  ///< of the reality's particles [m]: 2.4 times as many as the tracking model's
  double duration = 4;     ///< [s]
  double frames_per_second = 30;
  int threads = 0;  ///< 0: all; the recording does not depend on it
};

inline HiddenPhysics draw_hidden_physics(const PourTwin& twin) {
  HiddenPhysics hidden;
  if (!twin.hidden_physics) {
    return hidden;
  }
  if (twin.chosen_physics) {
    return *twin.chosen_physics;
  }
  std::mt19937 random(7919 * twin.seed + 13);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  std::vector<int> kinds{0, 1, 2, 3, 4};
  std::shuffle(kinds.begin(), kinds.end(), random);
  for (int k = 0; k < 2; ++k) {
    switch (kinds[static_cast<std::size_t>(k)]) {
      case 0: {
        const double size = between(0.4, 0.8);
        const double angle = between(0, 2 * std::numbers::pi);
        hidden.pull = {size * std::cos(angle), size * std::sin(angle), 0};
        break;
      }
      case 1:
        hidden.drag = between(0.5, 1);
        break;
      case 2:  // what a boundary layer does that is thinner than a particle
        hidden.sticky_walls = true;
        hidden.kinematic_viscosity = std::max(hidden.kinematic_viscosity, 5e-5);
        break;
      case 3:
        hidden.kinematic_viscosity = std::max(hidden.kinematic_viscosity, std::pow(10.0, between(-4.3, -3.7)));
        break;
      case 4:
        hidden.latency = between(0.04, 0.07);
        break;
      default:
        break;
    }
  }
  return hidden;
}

/// The same liquid at rest is settled by a third solver: these two start badly from liquid that was packed.
using SettledParts = RealityParts<decant::Dfsph<float>>;

/// The container's mesh with its lip, in the container's frame.
struct PourContainer {
  decant::TriangleMesh mesh;
  decant::Vector3<double> lip;  ///< where liquid leaves when the container is turned about y [m]
};

/// A container turned on a lathe. @param inner outline of its inside, (distance from the axis, height) [m], from the
/// middle of the floor up to the rim. @param wall thickness, measured level; below, of the floor [m].
inline decant::Revolved turned_container(const std::vector<Eigen::Vector2d>& inner, double wall) {
  std::vector<Eigen::Vector2d> profile;
  profile.emplace_back(0, -wall);
  for (std::size_t k = 1; k < inner.size(); ++k) {
    profile.emplace_back(inner[k].x() + wall, inner[k].y() - (k == 1 ? wall : 0.0));
  }
  for (std::size_t k = inner.size(); k-- > 0;) {
    profile.push_back(inner[k]);
  }
  return {profile};
}

/// Of the bottle's inside, as turned_container takes it.
inline const std::vector<Eigen::Vector2d>& bottle_outline() {
  static const std::vector<Eigen::Vector2d> inner{{0, 0},         {0.031, 0},     {0.033, 0.004}, {0.033, 0.085},
                                                  {0.030, 0.098}, {0.021, 0.112}, {0.018, 0.120}, {0.018, 0.140}};
  return inner;
}

inline PourContainer pour_container(const std::string& name) {
  if (name == "bottle") {
    return {turned_container(bottle_outline(), 0.003).mesh(), {0.018, 0, 0.140}};
  }
  decant::expects(name == "cup", "PourTwin: container", "cup or bottle", name);
  const decant::Cup cup{0.032, 0.041, 0.09, 0.003};
  return {cup.mesh(), {cup.rim_radius, 0, cup.height}};
}

inline decant::BodyShape pour_pan() { return decant::CylinderInside{0.13, 0.045, 0.003, decant::Face::PositiveZ}; }

/// How the container really moves: its lip stays near one place above the pan while it turns over and back, in a hand
/// that shakes.
inline decant::PoseTrack pour_motion(const PourTwin& twin, const decant::Vector3<double>& lip) {
  std::mt19937 random(twin.seed);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  struct Wave {
    double size, frequency, phase;
  };
  std::vector<std::vector<Wave>> shaking(6);  // x, y, z [m], then turns about x, y, z [rad]
  for (std::size_t axis = 0; axis < shaking.size(); ++axis) {
    for (int k = 0; k < 3; ++k) {
      const double frequency = between(0.5, 6);
      const double size = (axis < 3 ? 0.0015 : 0.012) / std::sqrt(frequency) * between(0.5, 1);
      shaking[axis].push_back({size, frequency, between(0, 2 * std::numbers::pi)});
    }
  }
  const double most_tilt = between(105, 118) * std::numbers::pi / 180;
  const double begin = 0.25, turning = between(2.4, 3.0), back = begin + turning + between(0.5, 0.8);
  const decant::Vector3<double> place(between(-0.045, -0.02), between(-0.01, 0.01),
                                      std::max(0.09, lip.z()) + between(0.04, 0.06));  // clear of the pan
  const auto smooth = [](double u) {
    u = std::clamp(u, 0.0, 1.0);
    return u * u * (3 - 2 * u);
  };
  std::vector<decant::PoseTrack::Sample> samples;
  for (int k = 0; k <= static_cast<int>(std::ceil((twin.duration + 0.5) * 100)); ++k) {
    const double t = 0.01 * k;
    const double tilt = most_tilt * (smooth((t - begin) / turning) - 0.9 * smooth((t - back) / 1.2));
    const double calm = smooth(t / 0.5);  // liquid starts at rest
    const auto shake = [&](std::size_t axis) {
      double sum = 0;
      for (const Wave& wave : shaking[axis]) {
        sum += wave.size * std::sin(2 * std::numbers::pi * wave.frequency * t + wave.phase);
      }
      return calm * sum;
    };
    const Eigen::Quaterniond turn = Eigen::AngleAxisd(shake(5), Eigen::Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(tilt + shake(4), Eigen::Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(shake(3), Eigen::Vector3d::UnitX());
    const decant::Vector3<double> wobble(shake(0), shake(1), shake(2));
    samples.push_back({t, {turn, place + wobble - turn * lip}});
  }
  return decant::PoseTrack(samples);
}

/// The camera, 640 x 480: from the side the liquid does not come from, a little above, looking at the pan and the jet.
inline decant::PinholeCamera pour_camera() { return {600, 600, 319.5, 239.5, 640, 480}; }
inline decant::Pose pour_camera_from_world() { return looking_at({0.21, -0.44, 0.32}, {0.0, 0, 0.09}); }

namespace detail {

inline constexpr double calming = 0.1;  ///< before the recording begins [s]

/// Runs the reality and writes the recording. For any composition with the bodies in this order: container, pan.
/// @param solver_name for the truth.
template <class Parts>
void record_pour(const PourTwin& twin, const HiddenPhysics& hidden, const std::string& solver_name,
                 const std::filesystem::path& folder, const std::function<void(double)>& progress) {
  using namespace decant;
  const PourContainer container = pour_container(twin.container);
  const PoseTrack motion = pour_motion(twin, container.lip);
  SimulatorSettings settings;
  settings.spacing = twin.spacing;
  settings.threads = {twin.threads};
  settings.gravity += hidden.pull;
  settings.liquid.dynamic_viscosity = hidden.kinematic_viscosity * settings.liquid.density;
  if (hidden.surface_tension > 0) {
    settings.liquid.surface_tension = hidden.surface_tension;
  }
  Simulator<Parts> reality(settings);
  const Slip slip = hidden.sticky_walls ? Slip::None : Slip::Free;
  const BodyId cup = reality.add_body(twin.container, container.mesh, PoseTrack(motion.at(0)), slip);
  const BodyId pan = reality.add_body("pan", pour_pan());
  constexpr bool foreign = !std::is_same_v<Parts, DefaultParts<float>>;
  if constexpr (foreign) {
    reality.template force<LinearDrag<float>>().rate = static_cast<float>(hidden.drag);
  }
  if constexpr (std::is_same_v<Parts, RealityParts<StateEquation<float>>>) {
    StateEquation<float>& solver = reality.pressure_solver();
    solver.set_sound_speed(14, static_cast<float>(settings.liquid.density));  // six times as fast as the jet
    // until it has calmed down
    solver.artificial_viscosity = 1;
  }
  using Filling = std::conditional_t<foreign, SettledParts, Parts>;
  Simulator<Filling> filling(settings);
  filling.add_body(twin.container, container.mesh, PoseTrack(motion.at(0)));
  const FillReport filled = decant::fill(filling, cup, FillAmount::fraction(twin.fill_fraction));
  reality.add_particles(filling.fluid().position, filling.fluid().velocity, cup);
  reality.watch_contents(cup);
  reality.watch_contents(pan);
  if constexpr (foreign) {  // what one solver takes for settled is not at rest for another
    const StepReport calmed = reality.step(calming);
    if (!calmed.advanced() || calmed.contents[0].volume < 0.99 * filled.volume) {
      throw std::runtime_error("the reality does not calm down, or leaves its container before that is moved");
    }
  }
  if constexpr (std::is_same_v<Parts, RealityParts<StateEquation<float>>>) {
    reality.pressure_solver().artificial_viscosity = 0.03F;
  }
  const double start = reality.time();
  std::vector<PoseTrack::Sample> moving = motion.samples();
  for (PoseTrack::Sample& sample : moving) {
    sample.time += start;
  }
  reality.set_motion(cup, PoseTrack(std::move(moving)));

  Recording header;
  header.name = folder.filename().string();
  header.frames_per_second = twin.frames_per_second;
  header.bodies.push_back({1, twin.container, recording::Role::Source, {}, container.mesh, {}});
  header.bodies.push_back({2, "pan", recording::Role::Target, {}, pour_pan().mesh, {}});
  header.liquid.initial = recording::Initial{0, twin.fill_fraction, std::nullopt};
  TwinRecorder recorder(folder, header, pour_camera(), pour_camera_from_world(), {0, 0, 0},
                        {twin.noisy_poses, twin.noisy_masks, twin.seed}, reality);
  nlohmann::json container_ml = nlohmann::json::array(), pan_ml = nlohmann::json::array();
  const int frames = static_cast<int>(std::lround(twin.duration * twin.frames_per_second));
  for (int frame = 0; frame < frames; ++frame) {
    const double time = frame / twin.frames_per_second;
    const StepReport report = step_reality(reality, start + time, time);
    container_ml.push_back(1e6 * report.contents[0].volume);
    pan_ml.push_back(1e6 * report.contents[1].volume);
    recorder.add_frame(reality, {{motion.at(std::max(0.0, time - hidden.latency)), 1}, {Pose{}, 0.5}});
    progress(static_cast<double>(frame + 1) / frames);
  }
  nlohmann::json truth = hidden.json();
  truth["solver"] = solver_name;
  truth["seed"] = twin.seed;
  truth["spacing_mm"] = 1e3 * twin.spacing;
  truth["initial_ml"] = 1e6 * filled.volume;
  truth["volume_ml"] = {{twin.container, container_ml}, {"pan", pan_ml}};
  recorder.finish(truth.dump());
}

}  // namespace detail

/// Makes the recording in a new folder, with the clean silhouettes beside it (truth_mask/, for scoring alone).
/// @param progress is told how far it is, 0 .. 1. Throws std::invalid_argument and std::runtime_error.
inline void record_pour(
    const PourTwin& twin, const std::filesystem::path& folder,
    const std::function<void(double)>& progress = [](double) {}) {
  using namespace decant;
  expects(twin.fill_fraction >= 0 && twin.fill_fraction <= 1, "PourTwin: fill_fraction", "in [0, 1]",
          twin.fill_fraction);
  const HiddenPhysics hidden = draw_hidden_physics(twin);
  // position-based liquid as deep as in a bottle throws itself out of it
  const bool position_based = twin.seed % 2 == 1 && twin.container == "cup";
  if (!twin.hidden_physics) {
    detail::record_pour<DefaultParts<>>(twin, hidden, "divergence-free", folder, progress);
  } else if (hidden.surface_tension > 0) {
    detail::record_pour<CapillaryRealityParts<PositionBased<float>>>(twin, hidden, "position-based", folder, progress);
  } else if (position_based) {
    detail::record_pour<RealityParts<PositionBased<float>>>(twin, hidden, "position-based", folder, progress);
  } else {
    detail::record_pour<RealityParts<StateEquation<float>>>(twin, hidden, "state equation", folder, progress);
  }
}

}  // namespace example
