// SPDX-License-Identifier: MIT
#pragma once

/// Wall integrals of bodies that are put together from simple solids, in closed form.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <variant>
#include <vector>

#include <decant/boundary/wall_function.hpp>
#include <decant/boundary/wall_sample.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// The surface point of a solid that is closest to a given point.
struct SurfacePoint {
  double distance = 0;                                ///< [m], negative inside of the solid
  Vector3<double> normal = Vector3<double>::UnitZ();  ///< unit length, out of the solid at that point
  Vector3<double> point = Vector3<double>::Zero();    ///< [m]
};

/// Axis-aligned box.
struct SolidBox {
  Vector3<double> min, max;  ///< [m]

  /// Whether the solid is within `reach` [m] of x: what costs next to nothing to know, for most points are far away.
  bool is_near(const Vector3<double>& x, double reach) const noexcept {
    return (x - x.cwiseMax(min).cwiseMin(max)).squaredNorm() < reach * reach;
  }

  SurfacePoint closest(const Vector3<double>& x) const noexcept {
    SurfacePoint result;
    result.point = x.cwiseMax(min).cwiseMin(max);
    const Vector3<double> away = x - result.point;
    const double squared = away.squaredNorm();
    if (squared > 0) {
      result.distance = std::sqrt(squared);
      result.normal = away / result.distance;
      return result;
    }
    result.distance = -std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
      for (const bool upper : {false, true}) {
        const double depth = upper ? x[axis] - max[axis] : min[axis] - x[axis];
        if (depth > result.distance) {
          result.distance = depth;
          result.normal = (upper ? 1.0 : -1.0) * Vector3<double>::Unit(axis);
          result.point = x - depth * result.normal;
        }
      }
    }
    return result;
  }
};

/// Ring about the z axis between two radii, inner_radius 0 for a full cylinder.
struct SolidRing {
  double inner_radius, outer_radius;  ///< [m]
  double bottom, top;                 ///< [m]

  /// As SolidBox::is_near; also true of some points a little farther away, past an edge.
  bool is_near(const Vector3<double>& x, double reach) const noexcept {
    const double squared = x[0] * x[0] + x[1] * x[1];
    const double outer = outer_radius + reach, inner = std::max(inner_radius - reach, 0.0);
    return x[2] > bottom - reach && x[2] < top + reach && squared < outer * outer && squared >= inner * inner;
  }

  SurfacePoint closest(const Vector3<double>& x) const noexcept {
    // the cross-section is a rectangle in (radius, height)
    const double radius = std::hypot(x[0], x[1]);
    const Vector3<double> outward =
        radius > 0 ? Vector3<double>(x[0] / radius, x[1] / radius, 0) : Vector3<double>(1, 0, 0);
    const double nearest_radius = std::clamp(radius, inner_radius, outer_radius);
    const double nearest_height = std::clamp(x[2], bottom, top);
    const double dr = radius - nearest_radius, dz = x[2] - nearest_height;
    SurfacePoint result;
    const double squared = dr * dr + dz * dz;
    if (squared > 0) {
      result.distance = std::sqrt(squared);
      result.normal = (outward * dr + Vector3<double>(0, 0, dz)) / result.distance;
    } else {
      const std::array<std::pair<double, Vector3<double>>, 4> faces{{
          {radius - outer_radius, outward},
          {inner_radius > 0 ? inner_radius - radius : -std::numeric_limits<double>::infinity(), -outward},
          {bottom - x[2], -Vector3<double>::UnitZ()},
          {x[2] - top, Vector3<double>::UnitZ()},
      }};
      const auto face =
          std::max_element(faces.begin(), faces.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
      result.distance = face->first;
      result.normal = face->second;
    }
    result.point = x - result.distance * result.normal;
    return result;
  }
};

struct SolidSphere {
  Vector3<double> center;
  double radius;  ///< [m]

  /// As SolidBox::is_near.
  bool is_near(const Vector3<double>& x, double reach) const noexcept {
    return (x - center).squaredNorm() < (radius + reach) * (radius + reach);
  }

  SurfacePoint closest(const Vector3<double>& x) const noexcept {
    const Vector3<double> away = x - center;
    const double length = away.norm();
    SurfacePoint result;
    result.normal = length > 0 ? Vector3<double>(away / length) : Vector3<double>(Vector3<double>::UnitZ());
    result.distance = length - radius;
    result.point = center + radius * result.normal;
    return result;
  }
};

using SolidPart = std::variant<SolidBox, SolidRing, SolidSphere>;

/// A body made of solids that may touch but not overlap much: slabs around a box, a floor and a ring around a cylinder.
/// Each part counts as the half-space behind its tangent plane at the closest point, and the shares add up.
class SolidParts {
 public:
  SolidParts() = default;

  /// At most max_parts parts.
  template <class Kernel>
  static SolidParts of(std::vector<SolidPart> parts, double smoothing_length, double spacing) {
    expects(!parts.empty() && parts.size() <= max_parts, "SolidParts: number of parts", "1..16", parts.size());
    SolidParts wall;
    wall.plane_ = WallFunction::of<Kernel>(smoothing_length, spacing);
    wall.parts_ = std::move(parts);
    wall.blend_ = 0.1 * spacing;
    return wall;
  }

  /// Distance from which the walls are not felt [m].
  double reach() const noexcept { return plane_.reach(); }

  /// False where no part is within the support of x (in the body's frame).
  bool sample(const Vector3<double>& x, WallSample& result) const noexcept {
    std::array<SurfacePoint, max_parts> near;
    std::size_t count = 0;
    for (const SolidPart& part : parts_) {
      if (!std::visit([&](const auto& solid) { return solid.is_near(x, reach()); }, part)) {
        continue;
      }
      const SurfacePoint candidate = std::visit([&x](const auto& solid) { return solid.closest(x); }, part);
      if (candidate.distance < reach()) {
        std::size_t place = count++;
        for (; place > 0 && candidate.distance < near[place - 1].distance; --place) {
          near[place] = near[place - 1];
        }
        near[place] = candidate;
      }
    }
    if (count == 0) {
      return false;
    }
    result.share = 0;
    result.gradient.setZero();
    result.moment.setZero();
    for (std::size_t k = 0; k < count; ++k) {
      // a part that does not stand out of a nearer part's plane is hidden behind it, or continues it
      double weight = 1;
      for (std::size_t nearer = 0; nearer < k && weight > 0; ++nearer) {
        const double ahead = (near[k].point - near[nearer].point).dot(near[nearer].normal);
        weight *= std::clamp(ahead / blend_, 0.0, 1.0);
      }
      const WallFunction::ShareAndSlope plane = plane_.share_and_slope(near[k].distance);
      result.share += weight * plane.share;
      const double slope = weight * plane.slope;
      result.gradient -= slope * near[k].normal;
      result.moment += slope * std::max(near[k].distance, 0.0) * near[k].normal * near[k].normal.transpose();
    }
    result.distance = std::max(near[0].distance, 0.0);
    return true;
  }

 private:
  static constexpr std::size_t max_parts = 16;

  std::vector<SolidPart> parts_{};
  WallFunction plane_{};
  double blend_ = 0;  ///< how far a part must stand out of another's plane to count in full [m]
};

}  // namespace decant::inline DECANT_TARGET
