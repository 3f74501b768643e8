// SPDX-License-Identifier: MIT
#pragma once

/// A tracker that learns, while it runs, a few parameters of its model from what it has seen in the last seconds, so
/// that forecasts, which nothing corrects, get better.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/tracking/silhouette_cells.hpp>
#include <decant/tracking/tracker.hpp>

namespace decant::inline DECANT_TARGET {

/// Something of a model that is not known exactly. What is expected is zero, give or take a deviation.
template <class Model>
struct UncertainParameter {
  std::string name;
  double deviation = 1;                         ///< standard deviation of what is expected, in its unit; > 0
  std::function<void(Model&, double)> apply{};  ///< makes the model have this value; must not throw
};

/// Settings of FixedLagTracker.
struct FixedLagSettings {
  int lag = 90;                   ///< frames, >= 2: as far back simulations begin that parameters are judged by
  int interval = 10;              ///< frames, 1 .. lag: as often parameters are adapted
  int cell_px = 20;               ///< see SilhouetteCells, >= 1
  double cell_deviation = 0.2;    ///< of a cell's share of liquid, > 0; with more, thin jets teach less
  double largest_residual = 0.5;  ///< a cell that is off by more counts as if by this, > 0
  double probe = 0.7;             ///< how far parameters are moved for their effect to be seen [deviations], > 0
  double largest_step = 1.5;      ///< of a parameter at a time [deviations], > 0
  double largest_value = 2.5;     ///< of a parameter [deviations], > 0
  /// As much has a parameter to change [deviations] for the frames of the lag to be run through and corrected once
  /// more, since what it spoiled before it was known may still be there; >= 0.
  double retrack_after = 0.5;
  double least_gain = 1;          ///< a step is taken if it lowers the misfit by as much [nat], >= 0
  double delay_deviation = 0.05;  ///< how late poses may be [s]; 0: they are taken as they come
  Threads threads{};              ///< over which simulations are shared out
};

/// Every `interval` frames it goes back to where things were `lag` frames ago, or at the beginning, and runs on from
/// there without correction: as things are, and with each parameter moved a little. What moves the predicted
/// silhouettes of these frames towards the observed ones is a linear least-squares problem (a step of Gauss and Newton,
/// with the parameters' expected deviations as prior). The step is taken if it is seen to fit better; if it is a large
/// one, the frames are run through once more with it, and corrected. One of the parameters is how late bodies' poses
/// are behind the masks: then poses of the last moments are continued as they moved.
///
/// The lag is long because a wrong parameter adds up: a tilt that is seen late shows when the jet begins. In the next
/// third of a second it is hardly told from friction of the air, and corrections have hidden most of it.
///
/// It costs about (parameters + 3) * lag / interval simulations beside the tracker's own, and allocates. These need no
/// fine particles: hand it a scout of 1.5 times the spacing, which takes a fifth of the time.
template <class TrackerType>
class FixedLagTracker {
 public:
  using Tracker = TrackerType;
  using Model = typename Tracker::Model;
  using Settings = FixedLagSettings;
  using Parameter = UncertainParameter<Model>;

  /// Parameters are judged by runs of the tracker itself. Throws std::invalid_argument if a setting is out of range.
  FixedLagTracker(Tracker tracker, std::vector<Parameter> parameters, const Settings& settings = {})
      : FixedLagTracker(tracker, tracker, std::move(parameters), settings) {}

  /// @param scout the same scene, at the same time, with the same cameras; its particles may be fewer. Parameters are
  ///   judged by runs of it.
  FixedLagTracker(Tracker tracker, Tracker scout, std::vector<Parameter> parameters, const Settings& settings = {})
      : tracker_(std::move(tracker)),
        past_(tracker_),
        scout_(std::move(scout)),
        parameters_(std::move(parameters)),
        settings_(settings),
        cells_(settings.cell_px) {
    expects(scout_.cameras() == tracker_.cameras(), "FixedLagTracker: cameras of the scout",
            std::to_string(tracker_.cameras()) + ", as of the tracker", scout_.cameras());
    const auto positive = [](double value, const char* name) {
      expects(value > 0 && std::isfinite(value), name, "> 0", value);
    };
    expects(settings.lag >= 2, "FixedLagTracker: lag [frames]", ">= 2", settings.lag);
    positive(settings.cell_deviation, "FixedLagTracker: cell_deviation");
    positive(settings.largest_residual, "FixedLagTracker: largest_residual");
    positive(settings.probe, "FixedLagTracker: probe");
    positive(settings.largest_step, "FixedLagTracker: largest_step");
    positive(settings.largest_value, "FixedLagTracker: largest_value");
    expects(settings.interval >= 1 && settings.interval <= settings.lag, "FixedLagTracker: interval [frames]",
            ">= 1 and <= lag", settings.interval);
    expects(settings.retrack_after >= 0, "FixedLagTracker: retrack_after [deviations]", ">= 0", settings.retrack_after);
    expects(settings.least_gain >= 0, "FixedLagTracker: least_gain [nat]", ">= 0", settings.least_gain);
    expects(settings.delay_deviation >= 0 && settings.delay_deviation <= 1, "FixedLagTracker: delay_deviation [s]",
            "0 .. 1", settings.delay_deviation);
    for (const Parameter& parameter : parameters_) {
      positive(parameter.deviation, "FixedLagTracker: deviation of a parameter");
      expects(static_cast<bool>(parameter.apply), "FixedLagTracker: parameter '" + parameter.name + "'",
              "one that can be applied", "no function");
    }
    state_.setZero(static_cast<Index>(parameters_.size()) + (settings.delay_deviation > 0 ? 1 : 0));
    expected_ = tracked_ = state_;
  }

  /// As Tracker::track; a frame with which an interval ends takes as long as all simulations of it.
  [[nodiscard]] FrameReport track(const TrackerFrame& frame) noexcept {
    if (tracker_.check(frame) != FrameStatus::Ok) {
      return tracker_.track(frame);
    }
    Seen seen{frame.time, {frame.poses.begin(), frame.poses.end()}, {frame.cameras.begin(), frame.cameras.end()}, {}};
    for (const CameraMask& mask : frame.masks) {
      seen.masks.push_back({mask.camera, Mask(mask.mask), {}});
    }
    seen_.push_back(std::move(seen));
    const FrameReport report = show(tracker_, seen_.back(), state_, true);
    if (!report.advanced()) {
      seen_.pop_back();
      return report;
    }
    for (SeenMask& mask : seen_.back().masks) {
      if (tracker_.believes(mask.camera)) {
        mask.shares = blurred(cells_.shares(tracker_.observed(mask.camera)));
      }
    }
    if (++since_adapted_ == settings_.interval) {
      since_adapted_ = 0;
      adapt();
    }
    if (seen_.size() - first_ > static_cast<std::size_t>(settings_.lag)) {
      leave_behind();
    }
    return report;
  }

  Tracker& tracker() noexcept { return tracker_; }
  const std::vector<Parameter>& parameters() const noexcept { return parameters_; }
  /// Of a parameter, as estimated, in its unit.
  double value(std::size_t parameter) const {
    return state_[static_cast<Index>(parameter)] * parameters_.at(parameter).deviation;
  }
  /// How late poses are behind the masks, as estimated [s]. Negative: early.
  double pose_delay() const noexcept { return delay(state_); }

 private:
  struct SeenMask {
    std::size_t camera;
    Mask mask;
    SilhouetteCells::Shares shares;  ///< of liquid, cleaned and blurred; empty if the mask was not believed
  };
  struct Seen {
    double time;
    std::vector<TrackedPose> poses;
    std::vector<CameraPose> cameras;
    std::vector<SeenMask> masks;
  };
  static constexpr std::size_t kept_frames = 15, frames_for_speed = 6;

  double delay(const Eigen::VectorXd& state) const noexcept {
    return settings_.delay_deviation > 0 ? state[state.size() - 1] * settings_.delay_deviation : 0;
  }

  /// Where a body is, seen or continued from how it moved last.
  Pose pose_at(BodyId body, double time) const noexcept {
    const auto find = [&](const Seen& seen) {
      return std::find_if(seen.poses.begin(), seen.poses.end(),
                          [&](const TrackedPose& pose) { return pose.body == body; });
    };
    std::vector<PoseTrack::Sample> samples;
    for (const Seen& seen : seen_) {
      if (const auto pose = find(seen); pose != seen.poses.end()) {
        samples.push_back({seen.time, pose->world_from_body});
      }
    }
    const PoseTrack::Sample& last = samples.back();
    if (time <= last.time || samples.size() < 2) {
      return PoseTrack(std::move(samples)).at(time);
    }
    const PoseTrack::Sample& before = samples[samples.size() - std::min(samples.size(), frames_for_speed + 1)];
    const double ahead = (time - last.time) / (last.time - before.time);
    const RigidVelocity moved = velocity_between(before.pose, last.pose, 1);
    const double angle = ahead * moved.angular.norm();
    const Eigen::Quaterniond turn(
        Eigen::AngleAxisd(angle, angle > 0 ? moved.angular.normalized() : Vector3<double>::UnitX()));
    return {turn * last.pose.rotation, last.pose.translation + ahead * moved.linear};
  }

  void apply(Tracker& tracker, const Eigen::VectorXd& state) const noexcept {
    for (std::size_t k = 0; k < parameters_.size(); ++k) {
      parameters_[k].apply(tracker.model(), state[static_cast<Index>(k)] * parameters_[k].deviation);
    }
  }

  FrameReport show(Tracker& tracker, const Seen& seen, const Eigen::VectorXd& state, bool correcting) const noexcept {
    apply(tracker, state);
    std::vector<TrackedPose> poses = seen.poses;
    if (const double late = delay(state); late != 0) {
      for (TrackedPose& pose : poses) {
        pose.world_from_body = pose_at(pose.body, seen.time + late);
      }
    }
    std::vector<CameraMask> masks;
    for (const SeenMask& mask : seen.masks) {
      if (correcting) {
        masks.push_back({mask.camera, mask.mask});
      }
    }
    return tracker.track({seen.time, poses, masks, seen.cameras});
  }

  /// Differences of shares of liquid, observed minus predicted, of all frames since the past state, uncorrected.
  Eigen::VectorXd residual(const Eigen::VectorXd& state) const noexcept {
    Tracker tracker = scout_;
    std::vector<double> all;
    for (std::size_t k = first_; k < seen_.size(); ++k) {
      if (!show(tracker, seen_[k], state, false).advanced()) {
        return {};
      }
      for (const SeenMask& mask : seen_[k].masks) {
        if (mask.shares.size() > 0) {
          const SilhouetteCells::Shares off = mask.shares - blurred(cells_.shares(tracker.predicted(mask.camera)));
          all.insert(all.end(), off.data(), off.data() + off.size());
        }
      }
    }
    return Eigen::Map<Eigen::VectorXd>(all.data(), static_cast<Index>(all.size()));
  }

  /// With (1 2 1) / 4 along both sides, so that what is off by a cell is still seen to be near.
  static SilhouetteCells::Shares blurred(const SilhouetteCells::Shares& shares) {
    const Index rows = shares.rows(), columns = shares.cols();
    SilhouetteCells::Shares across = shares, both;
    for (Index c = 0; c < columns; ++c) {
      across.col(c) = 0.25 * (shares.col(std::max<Index>(c - 1, 0)) + shares.col(std::min(c + 1, columns - 1))) +
                      0.5 * shares.col(c);
    }
    both = across;
    for (Index r = 0; r < rows; ++r) {
      both.row(r) =
          0.25 * (across.row(std::max<Index>(r - 1, 0)) + across.row(std::min(r + 1, rows - 1))) + 0.5 * across.row(r);
    }
    return both;
  }

  double misfit(const Eigen::VectorXd& residual, const Eigen::VectorXd& state) const noexcept {
    const double limit = settings_.largest_residual, variance = settings_.cell_deviation * settings_.cell_deviation;
    return 0.5 * residual.cwiseMax(-limit).cwiseMin(limit).squaredNorm() / variance +
           0.5 * (state - expected_).squaredNorm();
  }

  /// The past moves on by a frame. What was learned while it was in sight is what is expected from then on.
  void leave_behind() noexcept {
    if (show(past_, seen_[first_], state_, true).advanced() && show(scout_, seen_[first_], state_, true).advanced()) {
      seen_[first_].masks.clear();  // of what is past only poses are still asked for, of delayed bodies
      ++first_;
    } else {  // from where the tracker is: what it has seen until now teaches nothing more
      past_ = tracker_;
      scout_ = tracker_;
      first_ = seen_.size();
    }
    expected_ = state_;
    if (first_ > kept_frames) {
      seen_.erase(seen_.begin(), seen_.begin() + static_cast<std::ptrdiff_t>(first_ - kept_frames));
      first_ = kept_frames;
    }
  }

  /// What is in sight is run through and corrected once more, with what has been learned since the last time.
  void retrack() noexcept {
    if ((state_ - tracked_).cwiseAbs().maxCoeff() < settings_.retrack_after) {
      return;
    }
    Tracker again = past_;
    for (std::size_t k = first_; k < seen_.size(); ++k) {
      if (!show(again, seen_[k], state_, true).advanced()) {
        return;
      }
    }
    tracker_ = std::move(again);
    tracked_ = state_;
  }

  void adapt() noexcept {
    const auto informs = [](const SeenMask& mask) { return mask.shares.size() > 0; };
    const Index count = state_.size();
    if (count == 0 ||
        std::none_of(seen_.begin() + static_cast<std::ptrdiff_t>(first_), seen_.end(),
                     [&](const Seen& seen) { return std::any_of(seen.masks.begin(), seen.masks.end(), informs); })) {
      return;
    }
    const Eigen::VectorXd now = residual(state_);
    if (now.size() == 0 || now.isZero(0)) {  // such as before anything is poured
      return;
    }
    std::vector<Eigen::VectorXd> outcome(static_cast<std::size_t>(count));
    parallel_ranges(count, settings_.threads, 1, [&](Index k, Index) {
      Eigen::VectorXd probe = state_;
      // towards the inside, so that a probe is never beyond what a parameter may be
      probe[k] += probe[k] > 0 ? -settings_.probe : settings_.probe;
      outcome[static_cast<std::size_t>(k)] = residual(probe);
    });
    Eigen::MatrixXd effect = Eigen::MatrixXd::Zero(now.size(), count);
    for (Index k = 0; k < count; ++k) {
      const Eigen::VectorXd& moved = outcome[static_cast<std::size_t>(k)];
      if (moved.size() == now.size()) {
        effect.col(k) = (now - moved) / (state_[k] > 0 ? -settings_.probe : settings_.probe);
      }
    }
    const double limit = settings_.largest_residual, variance = settings_.cell_deviation * settings_.cell_deviation;
    Eigen::MatrixXd normal = effect.transpose() * effect / variance;
    normal.diagonal().array() += 1;
    const Eigen::VectorXd downhill =
        effect.transpose() * now.cwiseMax(-limit).cwiseMin(limit) / variance - (state_ - expected_);
    const Eigen::VectorXd step = normal.ldlt().solve(downhill);
    if (!step.allFinite()) {
      return;
    }
    // the effects are those of a small change in something chaotic: where the whole step leads astray, half may not
    for (const double share : {1.0, 0.5}) {
      const Eigen::VectorXd trial =
          (state_ + share * step.cwiseMax(-settings_.largest_step).cwiseMin(settings_.largest_step))
              .cwiseMax(-settings_.largest_value)
              .cwiseMin(settings_.largest_value);
      const Eigen::VectorXd tried = residual(trial);
      if (tried.size() == now.size() && misfit(tried, trial) < misfit(now, state_) - settings_.least_gain) {
        state_ = trial;
        apply(tracker_, state_);
        retrack();
        return;
      }
    }
  }

  Tracker tracker_, past_, scout_;  ///< the last two as things were before seen_[first_]
  std::vector<Parameter> parameters_;
  Settings settings_;
  SilhouetteCells cells_;
  Eigen::VectorXd state_{}, expected_{}, tracked_{};  ///< parameters in deviations, then the delay if it is one of them
  std::vector<Seen> seen_{};
  std::size_t first_ = 0;  ///< of seen_, what came after past_
  int since_adapted_ = 0;  ///< frames
};

}  // namespace decant::inline DECANT_TARGET
