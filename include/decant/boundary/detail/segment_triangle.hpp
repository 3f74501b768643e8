// SPDX-License-Identifier: MIT
#pragma once

/// One triangle against one segment or point, with bounds of its own rounding error: what all questions to a surface
/// come down to.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET::detail {

/// A triangle of a surface, as a BoundingVolumeHierarchy keeps it.
struct TreeTriangle {
  Vector3<double> a, b, c;  ///< corners [m]
  std::uint32_t index;      ///< into the mesh's triangles

  /// Toward the front, from which a, b, c run counter-clockwise.
  Vector3<double> unit_normal() const noexcept { return (b - a).cross(c - a).normalized(); }
};

/// Where and how a segment meets a triangle.
struct TriangleCrossing {
  bool hit = false;
  bool grazing = false;        ///< too close to an edge or to the plane for a count of crossings
  double fraction = 0;         ///< of the segment
  double u = 0, v = 0, w = 0;  ///< barycentric weights of a, b, c, not normalised
  double side = 0;             ///< > 0: from front to back
};

/// Bound of the relative rounding error of a volume: about 24 products of two roundings each, with room.
inline constexpr double volume_rounding = 256 * std::numeric_limits<double>::epsilon();

// Nearest point of a triangle by the region that x projects into (C. Ericson, Real-Time Collision Detection, 2005,
// section 5.1.5).
inline Vector3<double> closest_on(const TreeTriangle& triangle, const Vector3<double>& x) noexcept {
  const Vector3<double> ab = triangle.b - triangle.a;
  const Vector3<double> ac = triangle.c - triangle.a;
  const Vector3<double> ax = x - triangle.a;
  const double d1 = ab.dot(ax);
  const double d2 = ac.dot(ax);
  if (d1 <= 0 && d2 <= 0) {
    return triangle.a;
  }
  const Vector3<double> bx = x - triangle.b;
  const double d3 = ab.dot(bx);
  const double d4 = ac.dot(bx);
  if (d3 >= 0 && d4 <= d3) {
    return triangle.b;
  }
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    return triangle.a + d1 / (d1 - d3) * ab;
  }
  const Vector3<double> cx = x - triangle.c;
  const double d5 = ab.dot(cx);
  const double d6 = ac.dot(cx);
  if (d6 >= 0 && d5 <= d6) {
    return triangle.c;
  }
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    return triangle.a + d2 / (d2 - d6) * ac;
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    return triangle.b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (triangle.c - triangle.b);
  }
  const double scale = 1 / (va + vb + vc);
  return triangle.a + vb * scale * ab + vc * scale * ac;
}

// `nearby`: the segment has been cut down to the triangle's box already.
inline TriangleCrossing cross(const TreeTriangle& triangle, const Vector3<double>& from, const Vector3<double>& to,
                              bool nearby = false) noexcept;

// Corners are relative to the segment's origin. Cuts the segment by the three edges within the triangle's plane.
inline TriangleCrossing cross_in_plane(const Vector3<double>& a, const Vector3<double>& b, const Vector3<double>& c,
                                       const Vector3<double>& normal, const Vector3<double>& d,
                                       double tolerance) noexcept {
  double enter = 0;
  double leave = 1;
  const std::array<const Vector3<double>*, 3> corner{&a, &b, &c};
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector3<double>& p = *corner[k];
    const Vector3<double> inward = normal.cross(*corner[(k + 1) % 3] - p);
    const double slack = tolerance * inward.norm();
    const double start = -inward.dot(p) + slack;  // >= 0: the origin is on the inner side of this edge
    const double rate = inward.dot(d);
    const double end = start + rate;
    if (start < 0 && end < 0) {
      return {};
    }
    if (start < 0) {
      enter = std::max(enter, -start / rate);
    } else if (end < 0) {
      leave = std::min(leave, -start / rate);
    }
  }
  if (enter > leave) {
    return {};
  }
  TriangleCrossing crossing;
  crossing.hit = true;
  crossing.grazing = true;
  crossing.fraction = enter;
  const Vector3<double> p = enter * d;
  crossing.u = std::max(0.0, normal.dot((b - p).cross(c - p)));
  crossing.v = std::max(0.0, normal.dot((c - p).cross(a - p)));
  crossing.w = std::max(0.0, normal.dot((a - p).cross(b - p)));
  return crossing;
}

// A triangle that is tiny or narrow against the segment drowns in the bounds of rounding. Near the triangle all lengths
// are of its size, and the bounds with them, so the segment is cut down to the triangle's box first.
inline TriangleCrossing cross_nearby(const TreeTriangle& triangle, const Vector3<double>& from,
                                     const Vector3<double>& to, double slack) noexcept {
  const Vector3<double> low = triangle.a.cwiseMin(triangle.b).cwiseMin(triangle.c) - from;
  const Vector3<double> high = triangle.a.cwiseMax(triangle.b).cwiseMax(triangle.c) - from;
  const Vector3<double> d = to - from;
  double enter = 0;
  double leave = 1;
  for (Index axis = 0; axis < 3; ++axis) {
    const double below = low[axis] - slack;
    const double above = high[axis] + slack;
    if (std::abs(d[axis]) <= slack) {
      if (below > slack || above < -slack) {
        return {};
      }
      continue;
    }
    enter = std::max(enter, (d[axis] > 0 ? below : above) / d[axis]);
    leave = std::min(leave, (d[axis] > 0 ? above : below) / d[axis]);
  }
  if (enter > leave) {
    return {};
  }
  TriangleCrossing crossing = cross(triangle, from + enter * d, from + leave * d, true);
  crossing.fraction = enter + crossing.fraction * (leave - enter);
  crossing.grazing = true;
  return crossing;
}

// Signs of tetrahedron volumes. In exact arithmetic a segment that leaves a closed surface has a triangle whose plane
// it crosses and whose three edges it passes on the same side (or on the edge); each sign is taken with a bound of its
// rounding error, about 24 products of two roundings each, so that this triangle is found in floating point as well.
inline TriangleCrossing cross(const TreeTriangle& triangle, const Vector3<double>& from, const Vector3<double>& to,
                              bool nearby) noexcept {
  constexpr double rounding = volume_rounding;
  const Vector3<double> a = triangle.a - from;
  const Vector3<double> b = triangle.b - from;
  const Vector3<double> c = triangle.c - from;
  const Vector3<double> d = to - from;
  const Vector3<double> normal = (b - a).cross(c - a);
  const Vector3<double> largest = a.cwiseAbs().cwiseMax(b.cwiseAbs()).cwiseMax(c.cwiseAbs());
  const double length = d.cwiseAbs().maxCoeff();
  const double size = largest.maxCoeff() + length;
  const double plane_error = rounding * size * size * size;
  const double before = -normal.dot(a);  // of the origin, > 0 on the front
  const double after = normal.dot(d) + before;
  if ((before > plane_error && after > plane_error) || (before < -plane_error && after < -plane_error)) {
    return {};
  }
  // The edges' volumes share the length of the segment as a factor, hence their own, smaller bound.
  const double edge_error = rounding * size * size * length;
  const Vector3<double> db = d.cross(b);
  const double u = -db.dot(c);
  const double v = -d.cross(c).dot(a);
  const double w = db.dot(a);
  const bool front = u >= -edge_error && v >= -edge_error && w >= -edge_error;
  const bool back = u <= edge_error && v <= edge_error && w <= edge_error;
  if (!front && !back) {
    return {};
  }
  const double sum = u + v + w;
  if (std::abs(sum) <= 8 * edge_error) {
    if (!nearby) {
      return cross_nearby(triangle, from, to, rounding * size);
    }
    if (std::abs(before) > 16 * plane_error && std::abs(after) > 16 * plane_error) {
      return {};  // parallel, at a distance
    }
    return cross_in_plane(a, b, c, normal, d, rounding * size);
  }
  TriangleCrossing crossing;
  crossing.hit = true;
  crossing.side = before - after;
  const double sign = sum > 0 ? 1 : -1;
  crossing.u = std::max(0.0, sign * u);
  crossing.v = std::max(0.0, sign * v);
  crossing.w = std::max(0.0, sign * w);
  crossing.grazing = std::min({sign * u, sign * v, sign * w}) <= edge_error || std::abs(before) <= plane_error ||
                     std::abs(after) <= plane_error;
  const double scale = 1 / (crossing.u + crossing.v + crossing.w);
  const Vector3<double> point = scale * (crossing.u * a + crossing.v * b + crossing.w * c);
  crossing.fraction = std::clamp(point.dot(d) / d.squaredNorm(), 0.0, 1.0);
  return crossing;
}

}  // namespace decant::inline DECANT_TARGET::detail
