// SPDX-License-Identifier: MIT
#pragma once

/// A twin of a robot's pour, for experiments that need the truth: a "reality" that is not the model which tracks it.
/// It has another pressure solver, kernel, spacing and time step, physics that the model lacks, a shaking hand, and a
/// recorder with ragged masks, dropped frames and noisy poses.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <numbers>
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
#include <decant/camera/ray_occlusion.hpp>
#include <decant/force/linear_drag.hpp>
#include <decant/io/png.hpp>
#include <decant/io/recording_writer.hpp>
#include <decant/kernel/wendland_c2.hpp>
#include <decant/projector/silhouette.hpp>
#include <decant/pressure/dfsph.hpp>
#include <decant/pressure/position_based.hpp>
#include <decant/pressure/state_equation.hpp>
#include <decant/simulation/fill.hpp>
#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator.hpp>

namespace example {

/// What is poured, and how the recording of it goes wrong.
struct PourTwin {
  std::string container = "cup";  ///< or "bottle"
  double fill_fraction = 0.6;     ///< 0 .. 1
  std::uint32_t seed = 1;
  bool hidden_physics = true;  ///< false: the reality is the model itself, at another spacing
  bool noisy_poses = true;
  bool noisy_masks = true;
  double spacing = 0.003;  ///< of the reality's particles [m]: 2.4 times as many as the tracking model's
  double duration = 4;     ///< [s]
  double frames_per_second = 30;
  int threads = 0;  ///< 0: all; the recording does not depend on it
};

/// Physics of the reality that the model does not have. Two of these are drawn for each recording.
struct HiddenPhysics {
  decant::Vector3<double> pull{0, 0, 0};  ///< sideways acceleration [m/s^2]: a table that is not level, an air stream
  double drag = 0;                        ///< slows all motion [1/s]: a model of what breaks up a jet
  bool sticky_walls = false;              ///< liquid does not slip along the container
  double kinematic_viscosity = 1e-6;      ///< [m^2/s]
  double latency = 0;                     ///< poses were recorded so late [s]

  std::string words() const {
    std::string text;
    const auto say = [&](const std::string& what) { text += (text.empty() ? "" : ", ") + what; };
    if (pull.norm() > 0)
      say("sideways pull");
    if (drag > 0)
      say("drag");
    if (sticky_walls)
      say("sticky walls");
    if (kinematic_viscosity > 1e-6)
      say("thick liquid");
    if (latency > 0)
      say("late poses");
    return text.empty() ? "nothing" : text;
  }
};

inline HiddenPhysics draw_hidden_physics(const PourTwin& twin) {
  HiddenPhysics hidden;
  if (!twin.hidden_physics) {
    return hidden;
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

template <class PressureSolverType>
struct RealityParts : decant::DefaultParts<float> {
  using Kernel = decant::WendlandC2<float>;
  using Forces = std::tuple<decant::Gravity<float>, decant::Viscosity<float>, decant::ResidualViscosity<float>,
                            decant::LinearDrag<float>>;
  using PressureSolver = PressureSolverType;
};

/// The same liquid at rest is settled by a third solver: these two start badly from liquid that was packed.
using SettledParts = RealityParts<decant::Dfsph<float>>;

/// The container's mesh with its lip, in the container's frame.
struct PourContainer {
  decant::TriangleMesh mesh;
  decant::Vector3<double> lip;  ///< where liquid leaves when the container is turned about y [m]
};

inline PourContainer pour_container(const std::string& name) {
  if (name == "bottle") {
    const double wall = 0.003;
    // inner outline from the floor to the mouth, then back outside
    const std::vector<Eigen::Vector2d> inner{{0, 0},         {0.031, 0},     {0.033, 0.004}, {0.033, 0.085},
                                             {0.030, 0.098}, {0.021, 0.112}, {0.018, 0.120}, {0.018, 0.140}};
    std::vector<Eigen::Vector2d> profile;
    profile.emplace_back(0, -wall);
    for (std::size_t k = 1; k < inner.size(); ++k) {
      profile.emplace_back(inner[k].x() + wall, inner[k].y() - (k == 1 ? wall : 0.0));
    }
    for (std::size_t k = inner.size(); k-- > 0;) {
      profile.push_back(inner[k]);
    }
    return {decant::Revolved{profile}.mesh(), {0.018, 0, 0.140}};
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
inline decant::Pose pour_camera_from_world() {
  const decant::Vector3<double> eye(0.21, -0.44, 0.32), target(0.0, 0, 0.09);
  const decant::Vector3<double> ahead = (target - eye).normalized();
  const decant::Vector3<double> right = ahead.cross(decant::Vector3<double>::UnitZ()).normalized();
  decant::Matrix3<double> camera_axes;
  camera_axes.row(0) = right;
  camera_axes.row(1) = ahead.cross(right);
  camera_axes.row(2) = ahead;
  return {Eigen::Quaterniond(camera_axes), -(camera_axes * eye)};
}

/// What a segmentation network makes of a silhouette: shifted by a pixel at most, frayed along its edge, with specks.
class MaskNoise {
 public:
  explicit MaskNoise(std::uint32_t seed) : random_(31 * seed + 5) {
    const auto between = [&](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random_);
    };
    flips_ = between(0.2, 0.4);
    salt_ = between(0.004, 0.018);
    shift_x_ = static_cast<int>(random_() % 3) - 1;
    shift_y_ = static_cast<int>(random_() % 3) - 1;
  }

  decant::Mask apply(const decant::Mask& clean) {
    decant::Mask noisy(clean.rows(), clean.cols());
    std::uniform_real_distribution<double> share(0, 1);
    const auto at = [&](decant::Index row, decant::Index column) {
      row = std::clamp<decant::Index>(row - shift_y_, 0, clean.rows() - 1);
      column = std::clamp<decant::Index>(column - shift_x_, 0, clean.cols() - 1);
      return decant::is_liquid(clean(row, column));
    };
    for (decant::Index row = 0; row < clean.rows(); ++row) {
      for (decant::Index column = 0; column < clean.cols(); ++column) {
        bool liquid = at(row, column);
        const bool edge = at(row - 1, column) != liquid || at(row + 1, column) != liquid ||
                          at(row, column - 1) != liquid || at(row, column + 1) != liquid;
        if (share(random_) < (edge ? flips_ : salt_)) {
          liquid = !liquid;
        }
        noisy(row, column) = liquid ? decant::mask_liquid : std::uint8_t(0);
      }
    }
    return noisy;
  }

 private:
  std::mt19937 random_;
  double flips_ = 0, salt_ = 0;
  int shift_x_ = 0, shift_y_ = 0;
};

/// A pose that is off by `millimetres` and `degrees`, in a direction that the generator draws.
inline decant::Pose off_by(const decant::Pose& pose, double millimetres, double degrees, std::mt19937& random) {
  std::normal_distribution<double> normal(0, 1);
  const decant::Vector3<double> step =
      decant::Vector3<double>(normal(random), normal(random), normal(random)).normalized();
  const decant::Vector3<double> axis =
      decant::Vector3<double>(normal(random), normal(random), normal(random)).normalized();
  return {Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis) * pose.rotation,
          pose.translation + 1e-3 * millimetres * step};
}

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

  std::mt19937 random(101 * twin.seed + 3);
  const PinholeCamera camera = pour_camera();
  const Pose camera_from_world = pour_camera_from_world();
  Recording header;
  header.name = folder.filename().string();
  header.frames_per_second = twin.frames_per_second;
  header.width = camera.width();
  header.height = camera.height();
  const Pose pan_pose;
  header.bodies.push_back({1, twin.container, recording::Role::Source, {}, container.mesh, {}});
  header.bodies.push_back({2, "pan", recording::Role::Target, {}, pour_pan().mesh, {}});
  header.liquid.initial = recording::Initial{0, twin.fill_fraction, std::nullopt};
  recording::View view;
  view.fx = camera.fx();
  view.fy = camera.fy();
  view.cx = camera.cx();
  view.cy = camera.cy();
  view.camera_from_world = camera_from_world;
  header.cameras.push_back({{view}});
  RecordingWriter writer(folder, header);

  // a tracker's error: an offset that lasts, and a little that comes and goes
  const auto offset_seed = static_cast<std::uint32_t>(random());
  const auto seen_pose = [&](const Pose& pose, double share, std::uint32_t which) {
    if (!twin.noisy_poses) {
      return pose;
    }
    std::mt19937 lasting(offset_seed + which);
    return off_by(off_by(pose, 2 * share, 1 * share, lasting), 0.4 * share, 0.2 * share, random);
  };

  RayOcclusion<PinholeCamera> sight(PosedCamera<PinholeCamera>(camera, camera_from_world));
  sight.add_bodies(reality.bodies(), 0);
  // a film is wet between the particles that stand for it
  const double depth = (camera_from_world * Vector3<double>::Zero()).z();
  const int film_px = static_cast<int>(std::lround(1.25 * camera.fx() * twin.spacing / depth));
  Silhouette<DiscSplat<float>> drawing(DiscSplat<float>(0.62 * twin.spacing), GapClosing(film_px));
  MaskNoise noise(twin.seed);
  Mask clean(camera.height(), camera.width());
  std::vector<std::uint8_t> unseen;
  nlohmann::json container_ml = nlohmann::json::array(), pan_ml = nlohmann::json::array();
  const int frames = static_cast<int>(std::lround(twin.duration * twin.frames_per_second));
  std::filesystem::create_directories(folder / "truth_mask");
  for (int frame = 0; frame < frames; ++frame) {
    const double time = frame / twin.frames_per_second;
    StepReport report = reality.step(std::max(0.0, start + time - reality.time()));
    if (!report.advanced()) {
      throw std::runtime_error("the reality stopped at " + std::to_string(time) +
                               " s: " + std::string(to_string(report.status)));
    }
    container_ml.push_back(1e6 * report.contents[0].volume);
    pan_ml.push_back(1e6 * report.contents[1].volume);
    sight.follow(reality.bodies(), reality.time());
    unseen.resize(static_cast<std::size_t>(reality.fluid().size()));
    find_hidden(sight, reality.fluid().position, settings.threads, unseen);
    drawing.render(reality.fluid().position, unseen, camera, camera_from_world, clean, settings.threads);
    write_png(folder / "truth_mask" / (decant::detail::six_digits(static_cast<std::size_t>(frame)) + ".png"), clean);

    recording::Frame recorded;
    recorded.bodies = {seen_pose(motion.at(std::max(0.0, time - hidden.latency)), 1, 0), seen_pose(pan_pose, 0.5, 1)};
    recording::Shot shot;
    const bool dropped = twin.noisy_masks && frame > 0 && random() % 40 == 0;
    if (!dropped) {
      shot.mask = twin.noisy_masks ? noise.apply(clean) : clean;
    }
    recorded.shots.push_back(std::move(shot));
    writer.add_frame(recorded);
    progress(static_cast<double>(frame + 1) / frames);
  }
  nlohmann::json truth;
  truth["hidden"] = hidden.words();
  truth["pull_m_s2"] = {hidden.pull.x(), hidden.pull.y(), hidden.pull.z()};
  truth["drag_1_s"] = hidden.drag;
  truth["sticky_walls"] = hidden.sticky_walls;
  truth["kinematic_viscosity_m2_s"] = hidden.kinematic_viscosity;
  truth["latency_s"] = hidden.latency;
  truth["solver"] = solver_name;
  truth["seed"] = twin.seed;
  truth["spacing_mm"] = 1e3 * twin.spacing;
  truth["initial_ml"] = 1e6 * filled.volume;
  truth["volume_ml"] = {{twin.container, container_ml}, {"pan", pan_ml}};
  writer.set_truth(truth.dump());
  writer.finish();
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
  } else if (position_based) {
    detail::record_pour<RealityParts<PositionBased<float>>>(twin, hidden, "position-based", folder, progress);
  } else {
    detail::record_pour<RealityParts<StateEquation<float>>>(twin, hidden, "state equation", folder, progress);
  }
}

}  // namespace example
