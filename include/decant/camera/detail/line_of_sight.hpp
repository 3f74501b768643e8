// SPDX-License-Identifier: MIT
#pragma once

/// Rays of a camera against a body's surface, in the body's frame.

#include <algorithm>
#include <limits>
#include <optional>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET::detail {

inline Eigen::Isometry3d isometry_of(const Pose& pose) noexcept {
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  result.linear() = pose.rotation.normalized().toRotationMatrix();
  result.translation() = pose.translation;
  return result;
}

// Depth behind which nothing of a body is [m], with some room; negative if all of it is behind the camera, and for a
// body whose pose is not finite.
inline double deepest(const BoundingVolumeHierarchy& surface, const Eigen::Isometry3d& body_from_camera) noexcept {
  const Eigen::Isometry3d camera_from_body = body_from_camera.inverse();
  double depth = -std::numeric_limits<double>::infinity();
  for (int corner = 0; corner < 8; ++corner) {
    const auto which = static_cast<Eigen::AlignedBox3d::CornerType>(corner);
    const Vector3<double> x = camera_from_body * surface.bounds().corner(which);
    depth = std::max(depth, x.z());
  }
  return depth > 0 ? depth * (1 + 1e-9) : -1;
}

// Depth [m] at which a ray of the camera first meets a surface before `limit` [m]. The ray is begin + depth * way, in
// the camera's frame.
inline std::optional<double> first_depth(const BoundingVolumeHierarchy& surface,
                                         const Eigen::Isometry3d& body_from_camera, const Vector3<double>& begin,
                                         const Vector3<double>& way, double limit) noexcept {
  const auto hit = surface.first_hit(body_from_camera * begin, body_from_camera * Vector3<double>(begin + limit * way));
  return hit ? std::optional<double>(hit->fraction * limit) : std::nullopt;
}

}  // namespace decant::inline DECANT_TARGET::detail
