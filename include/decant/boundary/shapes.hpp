// SPDX-License-Identifier: MIT
#pragma once

/// Bodies that a few numbers describe: solids, containers by their inner size, and anything turned on a lathe. Each
/// gives a closed mesh whose triangles look out of the material, and most give the exact distance to the material as
/// well. Round walls become polygons that stay on the material's side: a solid's mesh lies within the solid, a
/// container's cavity within its mesh, so that a mesh never reaches into where the formula says liquid.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// A side of a box; of a cylinder along z, only the last two.
enum class Face { NegativeX, PositiveX, NegativeY, PositiveY, NegativeZ, PositiveZ };

namespace detail {

inline constexpr double pi = 3.14159265358979323846;

// Sides of the polygon for a circle. Polygon and circle are at most 0.03 mm apart up to a radius of 1.5 m, and never
// more than 2e-5 of the radius beyond; areas differ by less than 0.1 %. A multiple of four, so that the polygon has the
// circle's extent along x and y.
inline int circle_segments(double radius) {
  const double wanted = pi * std::sqrt(radius / (2 * 0.03e-3));
  return 4 * static_cast<int>(std::ceil(std::clamp(wanted, 64.0, 512.0) / 4));
}

// Radius of the corners of a polygon around a circle over that of the circle.
inline double circumscribed(int segments) { return 1 / std::cos(pi / segments); }

inline void expect_length(double length, std::string_view what) {
  expects(length > 0 && length <= 1e6, what, "> 0 and within 1e6", length);
}

inline void expect_box(const Vector3<double>& min, const Vector3<double>& max, std::string_view what) {
  for (Index axis = 0; axis < 3; ++axis) {
    expects(std::abs(min[axis]) <= 1e6 && std::abs(max[axis]) <= 1e6 && max[axis] > min[axis], what,
            "> 0 along every axis, with corners within 1e6 of the origin", max[axis] - min[axis]);
  }
}

// Signed distance to an axis-aligned box of any dimension, negative inside.
template <int Dimension>
double box_distance(const Eigen::Matrix<double, Dimension, 1>& x, const Eigen::Matrix<double, Dimension, 1>& min,
                    const Eigen::Matrix<double, Dimension, 1>& max) noexcept {
  const Eigen::Matrix<double, Dimension, 1> beyond = (min - x).cwiseMax(x - max);
  const double largest = beyond.maxCoeff();
  return largest > 0 ? beyond.cwiseMax(0.0).norm() : largest;
}

// Corner k of a box: bit 0, 1, 2 of k chooses max along x, y, z.
inline Vector3<double> box_corner(const Vector3<double>& min, const Vector3<double>& max, std::size_t k) {
  return {(k & 1) ? max[0] : min[0], (k & 2) ? max[1] : min[1], (k & 4) ? max[2] : min[2]};
}

// Corners of each face, counter-clockwise from outside, in the order of Face.
inline constexpr std::array<std::array<std::uint32_t, 4>, 6> box_faces{
    {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}}};

inline void add_quad(TriangleMesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
  mesh.triangles.push_back({a, b, c});
  mesh.triangles.push_back({a, c, d});
}

// Turns a closed profile of (radius, height) about the z axis; `stretch` multiplies the radii.
inline TriangleMesh revolve(const std::vector<Eigen::Vector2d>& profile, int segments, double stretch) {
  double twice_area = 0;
  for (std::size_t i = 0; i < profile.size(); ++i) {
    const Eigen::Vector2d& a = profile[i];
    const Eigen::Vector2d& b = profile[(i + 1) % profile.size()];
    twice_area += a[0] * b[1] - b[0] * a[1];
  }
  TriangleMesh mesh;
  std::vector<std::uint32_t> first(profile.size());  // vertex at angle 0 of each profile point
  const auto count = static_cast<std::uint32_t>(segments);
  for (std::size_t i = 0; i < profile.size(); ++i) {
    first[i] = static_cast<std::uint32_t>(mesh.vertices.size());
    if (profile[i][0] == 0) {
      mesh.vertices.emplace_back(0, 0, profile[i][1]);
      continue;
    }
    for (int k = 0; k < segments; ++k) {
      const double angle = 2 * pi * k / segments;
      const double radius = stretch * profile[i][0];
      mesh.vertices.emplace_back(radius * std::cos(angle), radius * std::sin(angle), profile[i][1]);
    }
  }
  for (std::size_t i = 0; i < profile.size(); ++i) {
    std::size_t from = i;
    std::size_t to = (i + 1) % profile.size();
    if (twice_area < 0) {
      std::swap(from, to);  // material on the left of the profile's way
    }
    const bool from_axis = profile[from][0] == 0;
    const bool to_axis = profile[to][0] == 0;
    for (std::uint32_t k = 0; k < count; ++k) {
      const std::uint32_t next = (k + 1) % count;
      const auto at = [&](std::size_t point, std::uint32_t step) {
        return profile[point][0] == 0 ? first[point] : first[point] + step;
      };
      if (!from_axis) {
        mesh.triangles.push_back({at(from, k), at(from, next), at(to, k)});
      }
      if (!to_axis) {
        mesh.triangles.push_back({at(from, next), at(to, next), at(to, k)});
      }
    }
  }
  return mesh;
}

}  // namespace detail

/// A solid box with faces along the axes.
struct Box {
  Vector3<double> min = Vector3<double>::Zero();  ///< [m]
  Vector3<double> max = Vector3<double>::Ones();  ///< [m]

  /// Distance to the surface [m], negative inside of the material.
  double distance(const Vector3<double>& x) const noexcept { return detail::box_distance<3>(x, min, max); }

  /// Throws std::invalid_argument unless max > min along every axis.
  TriangleMesh mesh() const {
    detail::expect_box(min, max, "Box: size [m]");
    TriangleMesh result;
    for (std::size_t k = 0; k < 8; ++k) {
      result.vertices.push_back(detail::box_corner(min, max, k));
    }
    for (const auto& face : detail::box_faces) {
      detail::add_quad(result, face[0], face[1], face[2], face[3]);
    }
    return result;
  }
};

/// A solid ball.
struct Sphere {
  Vector3<double> center = Vector3<double>::Zero();  ///< [m]
  double radius = 1;                                 ///< [m]

  /// Distance to the surface [m], negative inside of the material.
  double distance(const Vector3<double>& x) const noexcept { return (x - center).norm() - radius; }

  /// Corners lie on the sphere.
  TriangleMesh mesh() const {
    detail::expect_length(radius, "Sphere: radius [m]");
    expects(center.cwiseAbs().maxCoeff() <= 1e6, "Sphere: coordinate [m] of the center", "finite and within 1e6",
            center.cwiseAbs().maxCoeff());
    const int segments = detail::circle_segments(radius);
    const int rings = segments / 2;
    std::vector<Eigen::Vector2d> profile;
    for (int k = 0; k <= rings; ++k) {
      const double angle = detail::pi * k / rings;
      const bool pole = k == 0 || k == rings;
      profile.emplace_back(pole ? 0 : radius * std::sin(angle), -radius * std::cos(angle));
    }
    TriangleMesh result = detail::revolve(profile, segments, 1);
    for (Vector3<double>& vertex : result.vertices) {
      vertex += center;
    }
    return result;
  }
};

/// A solid cylinder along z; the origin is in the centre of its lower face.
struct Cylinder {
  double radius = 1;  ///< [m]
  double height = 1;  ///< [m]

  /// Distance to the surface [m], negative inside of the material.
  double distance(const Vector3<double>& x) const noexcept {
    const double from_axis = std::hypot(x[0], x[1]);
    return detail::box_distance<2>({from_axis, x[2]}, {-radius, 0}, {radius, height});
  }

  /// Corners lie on the cylinder.
  TriangleMesh mesh() const {
    detail::expect_length(radius, "Cylinder: radius [m]");
    detail::expect_length(height, "Cylinder: height [m]");
    return detail::revolve({{0, 0}, {radius, 0}, {radius, height}, {0, height}}, detail::circle_segments(radius), 1);
  }
};

/// A container with the inner space of a box and walls around it; at the open face, if there is one, the walls end
/// level with the inner space.
struct BoxInside {
  Vector3<double> min = Vector3<double>::Zero();  ///< of the inner space [m]
  Vector3<double> max = Vector3<double>::Ones();  ///< of the inner space [m]
  double wall = 0.002;                            ///< thickness [m]
  std::optional<Face> open{};                     ///< none: a closed vessel

  /// Distance to the surface of the walls [m], negative inside of their material, positive in the inner space.
  double distance(const Vector3<double>& x) const noexcept {
    const auto [outer_min, outer_max] = outer();
    // The inner space with what lies before the open face: there the way out of the material is free.
    Vector3<double> free_min = min;
    Vector3<double> free_max = max;
    if (open) {
      const auto [axis, upper] = axis_of(*open);
      (upper ? free_max : free_min)[axis] = (upper ? 1 : -1) * std::numeric_limits<double>::max();
    }
    const double from_free = detail::box_distance<3>(x, free_min, free_max);
    const double from_outside = -detail::box_distance<3>(x, outer_min, outer_max);
    if (from_free > 0 && from_outside > 0) {
      return -std::min(from_free, from_outside);
    }
    double nearest = std::numeric_limits<double>::infinity();
    for (Index axis = 0; axis < 3; ++axis) {
      for (const bool upper : {false, true}) {
        if (open && axis_of(*open) == std::pair(axis, upper)) {
          continue;
        }
        Vector3<double> slab_min = outer_min;
        Vector3<double> slab_max = outer_max;
        (upper ? slab_min : slab_max)[axis] = (upper ? max : min)[axis];
        nearest = std::min(nearest, detail::box_distance<3>(x, slab_min, slab_max));
      }
    }
    return std::max(nearest, 0.0);
  }

  /// Throws std::invalid_argument unless max > min along every axis and wall > 0.
  TriangleMesh mesh() const {
    detail::expect_box(min, max, "BoxInside: inner size [m]");
    detail::expect_length(wall, "BoxInside: wall thickness [m]");
    const auto [outer_min, outer_max] = outer();
    TriangleMesh result;
    for (std::size_t k = 0; k < 8; ++k) {
      result.vertices.push_back(detail::box_corner(min, max, k));
    }
    for (std::size_t k = 0; k < 8; ++k) {
      result.vertices.push_back(detail::box_corner(outer_min, outer_max, k));
    }
    for (std::size_t side = 0; side < 6; ++side) {
      const auto& face = detail::box_faces[side];
      if (open && static_cast<std::size_t>(*open) == side) {
        for (std::size_t k = 0; k < 4; ++k) {
          const std::uint32_t a = face[k];
          const std::uint32_t b = face[(k + 1) % 4];
          detail::add_quad(result, 8 + a, 8 + b, b, a);  // the rim
        }
      } else {
        detail::add_quad(result, 8 + face[0], 8 + face[1], 8 + face[2], 8 + face[3]);
        detail::add_quad(result, face[3], face[2], face[1], face[0]);
      }
    }
    return result;
  }

 private:
  static std::pair<Index, bool> axis_of(Face face) noexcept {
    const auto side = static_cast<Index>(face);
    return {side / 2, side % 2 == 1};
  }

  std::pair<Vector3<double>, Vector3<double>> outer() const noexcept {
    Vector3<double> outer_min = min.array() - wall;
    Vector3<double> outer_max = max.array() + wall;
    if (open) {
      const auto [axis, upper] = axis_of(*open);
      (upper ? outer_max : outer_min)[axis] = (upper ? max : min)[axis];
    }
    return {outer_min, outer_max};
  }
};

/// A container with the inner space of a cylinder along z; the origin is in the centre of the floor's inner face.
struct CylinderInside {
  double radius = 1;           ///< of the inner space [m]
  double height = 1;           ///< of the inner space [m]
  double wall = 0.002;         ///< thickness [m]
  std::optional<Face> open{};  ///< NegativeZ or PositiveZ; none: a closed vessel

  /// Distance to the surface of the walls [m], negative inside of their material, positive in the inner space.
  double distance(const Vector3<double>& x) const noexcept {
    using Point = Eigen::Vector2d;  // distance from the axis, height
    const Point place(std::hypot(x[0], x[1]), x[2]);
    const double bottom = open == Face::NegativeZ ? 0 : -wall;
    const double top = open == Face::PositiveZ ? height : height + wall;
    const double far = std::numeric_limits<double>::max();
    const Point free_min(-radius, open == Face::NegativeZ ? -far : 0);
    const Point free_max(radius, open == Face::PositiveZ ? far : height);
    const double from_free = detail::box_distance<2>(place, free_min, free_max);
    const double from_outside = -detail::box_distance<2>(place, {-radius - wall, bottom}, {radius + wall, top});
    if (from_free > 0 && from_outside > 0) {
      return -std::min(from_free, from_outside);
    }
    double nearest = detail::box_distance<2>(place, {radius, bottom}, {radius + wall, top});
    if (open != Face::NegativeZ) {
      nearest = std::min(nearest, detail::box_distance<2>(place, {0, bottom}, {radius + wall, 0}));
    }
    if (open != Face::PositiveZ) {
      nearest = std::min(nearest, detail::box_distance<2>(place, {0, height}, {radius + wall, top}));
    }
    return std::max(nearest, 0.0);
  }

  /// The cylinder lies within the mesh's cavity, and touches the middle of each side; walls have their thickness there.
  TriangleMesh mesh() const {
    detail::expect_length(radius, "CylinderInside: inner radius [m]");
    detail::expect_length(height, "CylinderInside: inner height [m]");
    detail::expect_length(wall, "CylinderInside: wall thickness [m]");
    expects(!open || *open == Face::NegativeZ || *open == Face::PositiveZ, "CylinderInside: open face",
            "NegativeZ or PositiveZ", open ? static_cast<int>(*open) : 0);
    const int segments = detail::circle_segments(radius);
    const double stretch = detail::circumscribed(segments);
    const double outer = radius + wall;
    if (open == Face::PositiveZ) {
      return detail::revolve({{0, -wall}, {outer, -wall}, {outer, height}, {radius, height}, {radius, 0}, {0, 0}},
                             segments, stretch);
    }
    if (open == Face::NegativeZ) {
      return detail::revolve(
          {{0, height + wall}, {outer, height + wall}, {outer, 0}, {radius, 0}, {radius, height}, {0, height}},
          segments, stretch);
    }
    TriangleMesh result =
        detail::revolve({{0, -wall}, {outer, -wall}, {outer, height + wall}, {0, height + wall}}, segments, stretch);
    TriangleMesh hollow = detail::revolve({{0, 0}, {radius, 0}, {radius, height}, {0, height}}, segments, stretch);
    for (TriangleMesh::Triangle& triangle : hollow.triangles) {
      std::swap(triangle[1], triangle[2]);  // looks into the hollow
    }
    return joined(std::move(result), hollow);
  }
};

/// A body turned about the z axis, such as a cup, a bottle or a vase: the closed outline of its material on one side of
/// the axis. Mesh only.
struct Revolved {
  std::vector<Eigen::Vector2d> profile{};  ///< (distance from the axis, height) [m], in either sense of rotation

  /// Circles become polygons around them (as for CylinderInside). Throws std::invalid_argument unless there are three
  /// points or more, all finite, none beyond the axis, that enclose an area. The outline must not cross itself, which
  /// is not checked.
  TriangleMesh mesh() const {
    expects(profile.size() >= 3, "Revolved: number of points of the profile", ">= 3", profile.size());
    double largest = 0;
    double twice_area = 0;
    for (std::size_t i = 0; i < profile.size(); ++i) {
      const Eigen::Vector2d& a = profile[i];
      const Eigen::Vector2d& b = profile[(i + 1) % profile.size()];
      expects(a[0] >= 0 && a[0] <= 1e6, "Revolved: distance [m] of a point from the axis", ">= 0 and within 1e6", a[0]);
      expects(std::abs(a[1]) <= 1e6, "Revolved: height [m] of a point", "finite and within 1e6", a[1]);
      largest = std::max(largest, a[0]);
      twice_area += a[0] * b[1] - b[0] * a[1];
    }
    expects(std::abs(twice_area) > 0, "Revolved: area [m^2] inside of the profile", "> 0", std::abs(twice_area) / 2);
    const int segments = detail::circle_segments(largest);
    return detail::revolve(profile, segments, detail::circumscribed(segments));
  }
};

/// A cup whose radius grows or shrinks evenly from floor to rim; the origin is in the centre of the floor's inner face.
struct Cup {
  double floor_radius = 0.03;  ///< inner [m]
  double rim_radius = 0.04;    ///< inner [m]
  double height = 0.09;        ///< inner [m]
  double wall = 0.002;         ///< thickness, measured level in the side wall [m]

  /// Volume up to the rim [m^3].
  double volume() const noexcept {
    return detail::pi * height / 3 *
           (floor_radius * floor_radius + floor_radius * rim_radius + rim_radius * rim_radius);
  }

  TriangleMesh mesh() const {
    detail::expect_length(floor_radius, "Cup: inner radius [m] of the floor");
    detail::expect_length(rim_radius, "Cup: inner radius [m] of the rim");
    detail::expect_length(height, "Cup: inner height [m]");
    detail::expect_length(wall, "Cup: wall thickness [m]");
    return Revolved{{{0, -wall},
                     {floor_radius + wall, -wall},
                     {floor_radius + wall, 0},
                     {rim_radius + wall, height},
                     {rim_radius, height},
                     {floor_radius, 0},
                     {0, 0}}}
        .mesh();
  }
};

/// A bowl cut from a spherical shell; the origin is the lowest point of its inner face.
struct Bowl {
  double rim_radius = 0.08;  ///< inner [m]
  double depth = 0.05;       ///< inner, at most rim_radius [m]
  double wall = 0.002;       ///< thickness [m]

  /// Volume up to the rim [m^3].
  double volume() const noexcept { return detail::pi * depth / 6 * (3 * rim_radius * rim_radius + depth * depth); }

  TriangleMesh mesh() const {
    detail::expect_length(rim_radius, "Bowl: inner radius [m] of the rim");
    detail::expect_length(depth, "Bowl: inner depth [m]");
    expects(depth <= rim_radius, "Bowl: inner depth [m]", "at most the rim's radius", depth);
    detail::expect_length(wall, "Bowl: wall thickness [m]");
    const double radius = (rim_radius * rim_radius + depth * depth) / (2 * depth);  // of the sphere
    const double angle = std::atan2(rim_radius, radius - depth);
    constexpr int steps = 48;
    std::vector<Eigen::Vector2d> profile;
    // The inner arc is replaced by chords around it: the sphere stays within the cavity. The rim is level.
    const double stretch = 1 / std::cos(angle / (2 * steps));
    for (int k = 0; k <= steps; ++k) {
      const double outer_angle = std::acos((radius - depth) / (radius + wall));
      const double turn = outer_angle * k / steps;
      profile.emplace_back((radius + wall) * stretch * std::sin(turn),
                           k == steps ? depth : radius - (radius + wall) * stretch * std::cos(turn));
    }
    // the last chord ends below the rim: straight up from there
    const double arc_end = radius - radius * stretch * std::cos(angle);
    if (depth - arc_end > 1e-9 * radius) {
      profile.emplace_back(radius * stretch * std::sin(angle), depth);
    }
    for (int k = steps; k >= 0; --k) {
      const double turn = angle * k / steps;
      profile.emplace_back(radius * stretch * std::sin(turn), radius - radius * stretch * std::cos(turn));
    }
    return Revolved{std::move(profile)}.mesh();
  }
};

}  // namespace decant::inline DECANT_TARGET
