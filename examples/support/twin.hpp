// SPDX-License-Identifier: MIT
#pragma once

/// What twins share: a "reality" that is not the model which follows it, with another pressure solver, kernel, spacing
/// and time step and with physics that the model lacks, and a recorder with ragged masks, dropped frames and noisy
/// poses.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <numbers>
#include <random>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/camera/pinhole_camera.hpp>
#include <decant/camera/posed_camera.hpp>
#include <decant/camera/ray_occlusion.hpp>
#include <decant/force/linear_drag.hpp>
#include <decant/io/png.hpp>
#include <decant/io/recording_writer.hpp>
#include <decant/kernel/wendland_c2.hpp>
#include <decant/projector/silhouette.hpp>
#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator.hpp>

namespace example {

/// Physics of the reality that the model does not have.
struct HiddenPhysics {
  decant::Vector3<double> pull{0, 0, 0};  ///< sideways acceleration [m/s^2]: a table that is not level, an air stream
  double drag = 0;                        ///< slows all motion [1/s]: a model of what breaks up a jet
  bool sticky_walls = false;              ///< liquid does not slip along the container
  double kinematic_viscosity = 1e-6;      ///< [m^2/s]
  double surface_tension = 0;             ///< [N/m]
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
    if (surface_tension > 0)
      say("surface tension");
    if (latency > 0)
      say("late poses");
    return text.empty() ? "nothing" : text;
  }

  nlohmann::json json() const {
    nlohmann::json json = {{"hidden", words()},
                           {"pull_m_s2", {pull.x(), pull.y(), pull.z()}},
                           {"drag_1_s", drag},
                           {"sticky_walls", sticky_walls},
                           {"kinematic_viscosity_m2_s", kinematic_viscosity},
                           {"latency_s", latency}};
    if (surface_tension > 0) {
      json["surface_tension_n_m"] = surface_tension;
    }
    return json;
  }
};

template <class PressureSolverType>
struct RealityParts : decant::DefaultParts<float> {
  using Kernel = decant::WendlandC2<float>;
  using Forces = std::tuple<decant::Gravity<float>, decant::Viscosity<float>, decant::ResidualViscosity<float>,
                            decant::LinearDrag<float>>;
  using PressureSolver = PressureSolverType;
};

/// The same with surface tension.
template <class PressureSolverType>
struct CapillaryRealityParts : RealityParts<PressureSolverType> {
  using Forces = std::tuple<decant::Gravity<float>, decant::Viscosity<float>, decant::ResidualViscosity<float>,
                            decant::LinearDrag<float>, decant::SurfaceTension<float>>;
};

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

/// Takes a reality to a time on its clock. @param recorded the same on the recording's, for what is thrown:
/// std::runtime_error where it cannot go on. [s]
template <class Model>
decant::StepReport step_reality(Model& reality, double time, double recorded) {
  const decant::StepReport report = reality.step(std::max(0.0, time - reality.time()));
  if (!report.advanced()) {
    throw std::runtime_error("the reality stopped at " + std::to_string(recorded) +
                             " s: " + std::string(to_string(report.status)));
  }
  return report;
}

/// What a camera would see of a reality: its liquid's clean silhouette, behind its bodies.
class TwinSight {
 public:
  /// @param reality has its bodies already. @param focus about where liquid will be [m].
  template <class Model>
  TwinSight(const decant::PinholeCamera& camera, const decant::Pose& camera_from_world,
            const decant::Vector3<double>& focus, const Model& reality)
      : camera_(camera),
        camera_from_world_(camera_from_world),
        threads_(reality.settings().threads),
        sight_(decant::PosedCamera<decant::PinholeCamera>(camera, camera_from_world)),
        // a film is wet between the particles that stand for it
        drawing_(decant::DiscSplat<float>(static_cast<float>(0.62 * reality.spacing())),
                 decant::GapClosing(static_cast<int>(
                     std::lround(1.25 * camera.fx() * reality.spacing() / (camera_from_world * focus).z())))),
        clean_(camera.height(), camera.width()) {
    sight_.add_bodies(reality.bodies(), 0);
  }

  /// As the reality is now. Valid until the next look.
  template <class Model>
  const decant::Mask& look(const Model& reality) {
    sight_.follow(reality.bodies(), reality.time());
    unseen_.resize(static_cast<std::size_t>(reality.fluid().size()));
    decant::find_hidden(sight_, reality.fluid().position, threads_, unseen_);
    drawing_.render(reality.fluid().position, unseen_, camera_, camera_from_world_, clean_, threads_);
    return clean_;
  }

 private:
  decant::PinholeCamera camera_;
  decant::Pose camera_from_world_;
  decant::Threads threads_;
  decant::RayOcclusion<decant::PinholeCamera> sight_;
  decant::Silhouette<decant::DiscSplat<float>> drawing_;
  decant::Mask clean_;
  std::vector<std::uint8_t> unseen_{};
};

/// The header with a camera that does not move, and its size of images.
inline decant::Recording with_camera(decant::Recording header, const decant::PinholeCamera& camera,
                                     const decant::Pose& camera_from_world) {
  header.width = camera.width();
  header.height = camera.height();
  decant::recording::View view;
  view.fx = camera.fx();
  view.fy = camera.fy();
  view.cx = camera.cx();
  view.cy = camera.cy();
  view.camera_from_world = camera_from_world;
  header.cameras.push_back({{view}});
  return header;
}

/// How a recording goes wrong.
struct RecordingErrors {
  bool poses = true, masks = true;
  std::uint32_t seed = 1;
};

/// Writes what a robot would have of a reality: masks of what its camera sees, and poses from a tracker. The clean
/// silhouettes go beside them (truth_mask/, for scoring alone).
class TwinRecorder {
 public:
  /// A body that is recorded: where it really is, and how wrong its tracked pose is, as a share of 2 mm and 1 degree.
  struct TrackedBody {
    decant::Pose pose;
    double error = 1;
  };

  /// @param header without cameras and size of images. @param reality has its bodies already. @param focus about where
  /// liquid will be [m].
  template <class Model>
  TwinRecorder(const std::filesystem::path& folder, decant::Recording header, const decant::PinholeCamera& camera,
               const decant::Pose& camera_from_world, const decant::Vector3<double>& focus,
               const RecordingErrors& errors, const Model& reality)
      : folder_(folder),
        errors_(errors),
        writer_(folder, with_camera(std::move(header), camera, camera_from_world)),
        sight_(camera, camera_from_world, focus, reality),
        noise_(errors.seed),
        random_(101 * errors.seed + 3),
        offset_seed_(static_cast<std::uint32_t>(random_())) {
    std::filesystem::create_directories(folder / "truth_mask");
  }

  /// The next frame, as the reality is now.
  template <class Model>
  void add_frame(Model& reality, const std::vector<TrackedBody>& bodies) {
    using namespace decant;
    const Mask& clean = sight_.look(reality);
    write_png(folder_ / "truth_mask" / (decant::detail::six_digits(frame_) + ".png"), clean);

    recording::Frame recorded;
    for (std::size_t body = 0; body < bodies.size(); ++body) {
      recorded.bodies.push_back(tracked(bodies[body], static_cast<std::uint32_t>(body)));
    }
    recording::Shot shot;
    const bool dropped = errors_.masks && frame_ > 0 && random_() % 40 == 0;
    if (!dropped) {
      shot.mask = errors_.masks ? noise_.apply(clean) : clean;
    }
    recorded.shots.push_back(std::move(shot));
    writer_.add_frame(recorded);
    ++frame_;
  }

  /// @param truth for scoring alone, JSON.
  void finish(const std::string& truth) {
    writer_.set_truth(truth);
    writer_.finish();
  }

 private:
  // a tracker's error: an offset that lasts, and a little that comes and goes
  decant::Pose tracked(const TrackedBody& body, std::uint32_t which) {
    if (!errors_.poses) {
      return body.pose;
    }
    std::mt19937 lasting(offset_seed_ + which);
    return off_by(off_by(body.pose, 2 * body.error, 1 * body.error, lasting), 0.4 * body.error, 0.2 * body.error,
                  random_);
  }

  std::filesystem::path folder_;
  RecordingErrors errors_;
  decant::RecordingWriter writer_;
  TwinSight sight_;
  MaskNoise noise_;
  std::mt19937 random_;
  std::uint32_t offset_seed_;
  std::size_t frame_ = 0;
};

/// Camera from world for a camera at `eye` that looks at `target`, upright. [m]
inline decant::Pose looking_at(const decant::Vector3<double>& eye, const decant::Vector3<double>& target) {
  const decant::Vector3<double> ahead = (target - eye).normalized();
  const decant::Vector3<double> right = ahead.cross(decant::Vector3<double>::UnitZ()).normalized();
  decant::Matrix3<double> camera_axes;
  camera_axes.row(0) = right;
  camera_axes.row(1) = ahead.cross(right);
  camera_axes.row(2) = ahead;
  return {Eigen::Quaterniond(camera_axes), -(camera_axes * eye)};
}

}  // namespace example
