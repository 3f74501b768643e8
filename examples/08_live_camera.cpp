// SPDX-License-Identifier: MIT
// A tracker in a robot's callbacks. Poses of a cup arrive at 100 Hz and masks of a camera at 30 Hz, each with its own
// stamp. Some masks never come, one comes after its successor, one twice, one is cropped, and a clock is set: each
// is answered by a status, nothing throws, and the liquid stays in step with a fan in the room that it knows nothing
// of.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include <decant/decant.hpp>

using namespace decant;

/// What a robot would keep: a tracker, and the last second of what it was told about the cup.
template <class CorrectorType>
class LiquidWatcher {
 public:
  LiquidWatcher(const LiquidSimulator& model, BodyId cup, const PinholeCamera& camera, const Pose& camera_from_world)
      : tracker_(model), cup_(cup) {
    tracker_.add_camera({camera, {}}, camera_from_world);
  }

  void on_pose(double stamp, const Pose& world_from_cup) {
    if (poses_.empty() || stamp > poses_.back().time) {  // a pose that is overtaken by a later one is of no use
      poses_.push_back({stamp, world_from_cup});
      poses_.erase(poses_.begin(), std::find_if(poses_.begin(), poses_.end(),
                                                [&](const auto& pose) { return pose.time >= stamp - 1; }));
    }
  }

  FrameReport on_mask(double stamp, ConstMaskView mask) { return track(stamp, {{0, mask}}); }

  /// When no mask has come for some time: the robot's poses alone keep the liquid where it is.
  FrameReport on_silence(double now) { return track(now, {}); }

 private:
  FrameReport track(double stamp, const std::vector<CameraMask>& masks) {
    std::vector<TrackedPose> poses;
    if (!poses_.empty()) {
      poses.push_back({cup_, PoseTrack(poses_).at(stamp)});  // where the cup was when the picture was taken
    }
    return tracker_.track({stamp, poses, masks, {}});
  }

  Tracker<LiquidSimulator, CorrectorType> tracker_;
  BodyId cup_;
  std::vector<PoseTrack::Sample> poses_;
};

Pose pouring(double time) {  // the lip stays in its place while the cup turns over
  const Vector3<double> lip(0.041, 0, 0.09);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(1.9 * std::clamp(time / 1.5, 0.0, 1.0), Vector3<double>::UnitY()));
  return {turn, Vector3<double>(-0.03, 0, 0.14) - turn * lip};
}

LiquidSimulator half_full_cup(double spacing, double fan) {
  SimulatorSettings settings;
  settings.spacing = spacing;
  settings.gravity.y() = fan;
  settings.threads = {1};
  LiquidSimulator simulator(for_tracking(settings));
  const BodyId cup = simulator.add_body("cup", Cup{0.032, 0.041, 0.09, 0.003}.mesh(), PoseTrack(pouring(0)));
  simulator.add_body("pan", CylinderInside{0.13, 0.045, 0.003, Face::PositiveZ});
  fill(simulator, cup, FillAmount::fraction(0.5));
  return simulator;
}

int main() {
  const PinholeCamera camera(300, 300, 159.5, 119.5, 320, 240);
  // from the side: it sees what the fan does
  Matrix3<double> side;
  side << 0, 1, 0, 0, 0, -1, -1, 0, 0;
  const Pose side_from_world{Eigen::Quaterniond(side), {0, 0.1, 0.5}};

  LiquidSimulator reality = half_full_cup(0.0055, 1.5);
  std::vector<PoseTrack::Sample> motion;
  for (int k = 0; k <= 300; ++k) {
    motion.push_back({0.01 * k, pouring(0.01 * k)});
  }
  reality.set_motion(0, PoseTrack(motion));
  const LiquidSimulator model = half_full_cup(0.007, 0);
  LiquidWatcher<SilhouetteCorrector<>> watcher(model, 0, camera, side_from_world);
  LiquidWatcher<OpenLoop<>> blind(model, 0, camera, side_from_world);

  RayOcclusion<PinholeCamera> sight(PosedCamera<PinholeCamera>(camera, side_from_world));
  sight.add_bodies(reality.bodies(), 0);
  Silhouette<> drawing(DiscSplat<float>(0.66 * 0.0055), GapClosing(4));
  std::vector<std::uint8_t> hidden;
  std::vector<Mask> film;  // as the camera's driver keeps it
  std::map<std::string, int> answers;
  const auto count = [&](const FrameReport& report) { ++answers[std::string(to_string(report.status))]; };
  double closed = 0, open = 0;
  int compared = 0, pose_number = 0;
  for (int frame = 0; frame < 60; ++frame) {
    const double time = frame / 30.0;
    if (!reality.step(time - reality.time()).advanced())
      return 1;
    sight.follow(reality.bodies(), time);
    hidden.resize(static_cast<std::size_t>(reality.fluid().size()));
    find_hidden(sight, reality.fluid().position, Threads{1}, hidden);
    film.emplace_back(camera.height(), camera.width());
    drawing.render(reality.fluid().position, hidden, camera, side_from_world, film.back());

    for (; 0.01 * pose_number <= time + 0.01; ++pose_number) {
      watcher.on_pose(0.01 * pose_number, pouring(0.01 * pose_number));
      blind.on_pose(0.01 * pose_number, pouring(0.01 * pose_number));
    }
    if (frame == 20 || frame == 40) {  // the segmentation was too slow
      count(watcher.on_silence(time));
      blind.on_silence(time);
      continue;
    }
    const FrameReport report = watcher.on_mask(time, film.back());
    count(report);
    const FrameReport without = blind.on_mask(time, film.back());
    if (report.posterior.union_px() > 150) {
      closed += report.posterior.iou();
      open += without.posterior.iou();
      ++compared;
    }
    if (frame == 41)  // what was awaited at frame 40 comes after all
      count(watcher.on_mask(40 / 30.0, film[40]));
    if (frame == 45)  // the network sends a message twice
      count(watcher.on_mask(time, film.back()));
    if (frame == 50)  // somebody has changed the driver's settings
      count(watcher.on_mask(time + 0.01, film.back().topRows(120)));
    if (frame == 55)  // a clock is set
      count(watcher.on_mask(time + 3600, film.back()));
  }
  closed /= std::max(compared, 1);
  open /= std::max(compared, 1);
  for (const auto& [status, times] : answers)
    std::printf("%-12s %d\n", status.c_str(), times);
  std::printf("overlap of what is simulated with what is seen: %.2f, without correction %.2f\n", closed, open);
  const bool answered = answers["uncorrected"] == 2 && answers["late"] == 2 && answers["bad_input"] == 1 &&
                        answers["gap"] == 1 && answers["ok"] == 58;
  return answered && closed > open + 0.1 ? 0 : 1;
}
