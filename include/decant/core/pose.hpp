// SPDX-License-Identifier: MIT
#pragma once

/// Where a rigid body is and how it moves: poses, pose tracks with interpolation, and the velocity that follows.

#include <algorithm>
#include <cmath>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Takes points of the body's frame to the world: x_in_world = rotation * x_in_body + translation.
struct Pose {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Vector3<double> translation = Vector3<double>::Zero();  ///< [m]

  Vector3<double> operator*(const Vector3<double>& x_in_body) const { return rotation * x_in_body + translation; }

  Pose operator*(const Pose& inner) const { return {rotation * inner.rotation, *this * inner.translation}; }

  Pose inverse() const {
    const Eigen::Quaterniond back = rotation.conjugate();
    return {back, back * -translation};
  }

  bool finite() const { return rotation.coeffs().allFinite() && translation.allFinite(); }
};

/// A rigid body's velocity field: v(x) = linear + angular x (x - center).
struct RigidVelocity {
  Vector3<double> linear = Vector3<double>::Zero();   ///< [m/s], of the body frame's origin
  Vector3<double> angular = Vector3<double>::Zero();  ///< [rad/s], world frame
  Vector3<double> center = Vector3<double>::Zero();   ///< [m], the body frame's origin in the world

  Vector3<double> at(const Vector3<double>& x_in_world) const { return linear + angular.cross(x_in_world - center); }
};

/// Pose between two others: translation linear, rotation by SLERP along the shorter arc. fraction 0 gives a, 1 gives b.
inline Pose interpolate(const Pose& a, const Pose& b, double fraction) {
  return {a.rotation.slerp(fraction, b.rotation), a.translation + fraction * (b.translation - a.translation)};
}

/// The constant velocity that takes `before` to `after` within `time_step` > 0 [s].
inline RigidVelocity velocity_between(const Pose& before, const Pose& after, double time_step) {
  Eigen::Quaterniond turn = after.rotation * before.rotation.conjugate();
  if (turn.w() < 0) {
    turn.coeffs() = -turn.coeffs();
  }
  const double sine = turn.vec().norm();
  const double angle = 2 * std::atan2(sine, turn.w());
  RigidVelocity velocity;
  velocity.linear = (after.translation - before.translation) / time_step;
  // for tiny turns sin(a/2)/a tends to 1/2; the quotient below would be 0/0
  velocity.angular =
      (sine > 1e-12 ? Vector3<double>(turn.vec() * (angle / sine)) : Vector3<double>(2 * turn.vec())) / time_step;
  velocity.center = before.translation;
  return velocity;
}

/// A body's pose over time: stamped poses with interpolation between them. Before the first and after the last stamp
/// the body holds still. An empty track stands at the identity.
class PoseTrack {
 public:
  struct Sample {
    double time = 0;  ///< [s]
    Pose pose;
  };

  PoseTrack() = default;

  /// A body that stands still.
  explicit PoseTrack(const Pose& fixed) : PoseTrack(std::vector<Sample>{{0.0, fixed}}) {}

  /// Stamps must increase strictly and everything must be finite; rotations are normalised.
  explicit PoseTrack(std::vector<Sample> samples) : samples_(std::move(samples)) {
    for (std::size_t k = 0; k < samples_.size(); ++k) {
      Sample& sample = samples_[k];
      expects(std::isfinite(sample.time), "PoseTrack: time [s]", "finite", sample.time);
      expects(k == 0 || sample.time > samples_[k - 1].time, "PoseTrack: time [s] of a sample",
              "later than the one before", sample.time);
      expects(sample.pose.finite(), "PoseTrack: pose", "finite at every sample, sample number", k);
      const double norm = sample.pose.rotation.norm();
      expects(norm > 0.5 && norm < 2, "PoseTrack: norm of a quaternion", "near 1", norm);
      sample.pose.rotation.normalize();
    }
  }

  const std::vector<Sample>& samples() const { return samples_; }
  double begin_time() const { return samples_.empty() ? 0.0 : samples_.front().time; }
  double end_time() const { return samples_.empty() ? 0.0 : samples_.back().time; }

  Pose at(double time) const {
    if (samples_.empty()) {
      return {};
    }
    const auto after = std::upper_bound(samples_.begin(), samples_.end(), time,
                                        [](double t, const Sample& sample) { return t < sample.time; });
    if (after == samples_.begin()) {
      return samples_.front().pose;
    }
    const Sample& a = *(after - 1);
    if (after == samples_.end()) {
      return a.pose;
    }
    return interpolate(a.pose, after->pose, (time - a.time) / (after->time - a.time));
  }

  /// Mean velocity over [time, time + time_step]: what moves the body's points to where they will be.
  RigidVelocity velocity(double time, double time_step) const {
    return velocity_between(at(time), at(time + time_step), time_step);
  }

 private:
  std::vector<Sample> samples_;
};

}  // namespace decant::inline DECANT_TARGET
