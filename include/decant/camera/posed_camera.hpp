// SPDX-License-Identifier: MIT
#pragma once

/// A camera together with where it stands.

#include <cmath>
#include <utility>

#include <decant/camera/concept.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// A camera in the world: answers a camera's questions for points in world coordinates. A value, as the camera is; all
/// const functions may be called from any thread, and none but the constructor throws or allocates.
template <class CameraType>
class PosedCamera {
  static_assert(CameraModel<CameraType>,
                "PosedCamera: Camera must model decant::CameraModel, see <decant/camera/concept.hpp>");

 public:
  using Camera = CameraType;

  /// Throws std::invalid_argument if the pose is not finite or its quaternion's norm is not near 1.
  explicit PosedCamera(Camera camera, const Pose& camera_from_world = {}) : camera_(std::move(camera)) {
    expects(camera_from_world.finite(), "PosedCamera: camera_from_world", "finite", "NaN or infinity");
    const double norm = camera_from_world.rotation.norm();
    expects(norm > 0.5 && norm < 2, "PosedCamera: norm of camera_from_world's quaternion", "near 1", norm);
    set_pose(camera_from_world);
  }

  /// Moves the camera; the rotation is normalised. With a pose that is not finite the camera sees nothing.
  void set_pose(const Pose& camera_from_world) noexcept {
    camera_from_world_ = {camera_from_world.rotation.normalized(), camera_from_world.translation};
    rotation_ = camera_from_world_.rotation.toRotationMatrix();
  }

  Vector3<double> to_camera(const Vector3<double>& x_in_world) const noexcept {
    return rotation_ * x_in_world + camera_from_world_.translation;
  }
  Vector3<double> to_world(const Vector3<double>& x_in_camera) const noexcept {
    return rotation_.transpose() * (x_in_camera - camera_from_world_.translation);
  }

  Projection project(const Vector3<double>& x_in_world) const noexcept {
    return camera_.project(to_camera(x_in_world));
  }

  /// The point of the world at that depth [m] along the optical axis that falls on that pixel.
  Vector3<double> unproject(const Eigen::Vector2d& pixel, double depth) const noexcept {
    return to_world(camera_.unproject(pixel, depth));
  }

  /// The pixel's derivative by the point in world coordinates [px/m].
  Eigen::Matrix<double, 2, 3> jacobian(const Vector3<double>& x_in_world) const noexcept {
    return camera_.jacobian(to_camera(x_in_world)) * rotation_;
  }

  /// The origin of the camera's frame in the world [m]: the centre of projection of a central camera.
  Vector3<double> position() const noexcept { return to_world(Vector3<double>::Zero()); }

  /// The optical axis in the world, unit length.
  Vector3<double> viewing_direction() const noexcept { return rotation_.row(2).transpose(); }

  const Camera& camera() const noexcept { return camera_; }
  const Pose& camera_from_world() const noexcept { return camera_from_world_; }
  Pose world_from_camera() const noexcept { return camera_from_world_.inverse(); }
  int width() const noexcept { return camera_.width(); }
  int height() const noexcept { return camera_.height(); }

 private:
  Camera camera_;
  Pose camera_from_world_;
  Matrix3<double> rotation_ = Matrix3<double>::Identity();  // of camera_from_world_, ready for many points
};

}  // namespace decant::inline DECANT_TARGET
