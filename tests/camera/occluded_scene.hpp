// SPDX-License-Identifier: MIT
#pragma once

/// Cameras, bodies and a search through every triangle that tests of occlusion share.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <decant/boundary/triangle_mesh.hpp>
#include <decant/camera/affine_registered_camera.hpp>
#include <decant/camera/distorted_pinhole_camera.hpp>
#include <decant/camera/orthographic_camera.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/core/pose.hpp>

#include "boundary/mesh_samples.hpp"

namespace decant_test {

using Point = decant::Vector3<double>;

inline decant::Pose pose_of(double angle, const Point& axis, const Point& translation) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis.normalized())), translation};
}

struct PosedMesh {
  decant::TriangleMesh mesh;
  decant::Pose world_from_body;
};

/// Three bodies within 0.5 m about the origin: a ball with bumps, a smaller one, and loose triangles.
inline std::vector<PosedMesh> bodies_before_camera() {
  return {{decant::scaled(bumpy_ball(12, 0.1, 1), 0.15), pose_of(0.7, Point(1, 2, 3), Point(0.1, -0.05, 0.02))},
          {decant::scaled(bumpy_ball(8, 0.05, 2), 0.06), pose_of(-1.9, Point(0, 1, -1), Point(-0.15, 0.1, -0.2))},
          {decant::scaled(random_triangles(40, 0.3, 3), 0.3), pose_of(2.5, Point(3, -1, 0), Point(0, 0, 0.1))}};
}

/// A camera that looks at the origin from 1 m away.
inline decant::Pose camera_from_world() { return pose_of(0.4, Point(1, -1, 0.3), Point(0.02, -0.01, 1)); }

inline const decant::PinholeCamera pinhole(130, 128, 79.2, 60.7, 160, 120);
inline const decant::DistortedPinholeCamera lens(pinhole, {-0.2, 0.05, 2e-3, -1e-3, 0.01});
inline const decant::OrthographicCamera orthographic(125, 80.3, 59.6, 160, 120);

template <class Camera>
decant::AffineRegisteredCamera<Camera> registered(const Camera& first) {
  Eigen::Matrix<double, 2, 3> first_from_second;
  first_from_second << 1.25, 0.05, 3, -0.04, 1.3, 6;
  return {first, first_from_second, 120, 90};
}

/// Share of the way from `from` to `to` at which any triangle is met first, by T. Moeller and B. Trumbore, "Fast,
/// minimum storage ray/triangle intersection", 1997, over all triangles in world coordinates.
inline std::optional<double> first_meeting(const std::vector<PosedMesh>& bodies, const Point& from, const Point& to) {
  const Point d = to - from;
  std::optional<double> first;
  for (const PosedMesh& body : bodies) {
    for (std::size_t t = 0; t < body.mesh.triangles.size(); ++t) {
      const Point a = body.world_from_body * body.mesh.corner(t, 0);
      const Point ab = body.world_from_body * body.mesh.corner(t, 1) - a;
      const Point ac = body.world_from_body * body.mesh.corner(t, 2) - a;
      const Point p = d.cross(ac);
      const double det = ab.dot(p);
      const double u = (from - a).dot(p) / det;
      const Point q = (from - a).cross(ab);
      const double v = d.dot(q) / det;
      const double s = ac.dot(q) / det;
      if (u >= 0 && v >= 0 && u + v <= 1 && s >= 0 && s <= 1 && (!first || s < *first)) {
        first = s;
      }
    }
  }
  return first;
}

}  // namespace decant_test
