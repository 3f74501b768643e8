// SPDX-License-Identifier: MIT
#pragma once

/// A surface made of triangles, as plain data, and the few questions that need nothing but the arrays: valid or not,
/// how large, which volume it encloses, which vertices are the same point.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Triangles over shared vertices, in the frame of the body they belong to. A triangle's front is where its corners
/// run counter-clockwise; on the surface of a solid the front looks out of the material.
struct TriangleMesh {
  using Triangle = std::array<std::uint32_t, 3>;

  std::vector<Vector3<double>> vertices;  ///< [m]
  std::vector<Triangle> triangles;        ///< indices into vertices

  /// Corner 0, 1 or 2 of a triangle [m].
  const Vector3<double>& corner(std::size_t triangle, std::size_t k) const { return vertices[triangles[triangle][k]]; }

  /// Normal of a triangle times twice its area [m^2], toward its front.
  Vector3<double> area_normal(std::size_t triangle) const {
    const Vector3<double>& a = corner(triangle, 0);
    return (corner(triangle, 1) - a).cross(corner(triangle, 2) - a);
  }
};

/// Throws std::invalid_argument, one line, unless there is at least one triangle, every index has its vertex and every
/// coordinate is finite and below 1e9 m (beyond which areas and volumes could overflow on the way).
inline void validate(const TriangleMesh& mesh) {
  expects(!mesh.triangles.empty(), "TriangleMesh: number of triangles", ">= 1", mesh.triangles.size());
  expects(mesh.vertices.size() <= std::numeric_limits<std::uint32_t>::max(), "TriangleMesh: number of vertices",
          "below 2^32", mesh.vertices.size());
  for (const Vector3<double>& vertex : mesh.vertices) {
    for (Index axis = 0; axis < 3; ++axis) {
      expects(std::abs(vertex[axis]) <= 1e9, "TriangleMesh: coordinate [m] of a vertex", "finite and within 1e9",
              vertex[axis]);
    }
  }
  for (const TriangleMesh::Triangle& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) {
      if (!(vertex < mesh.vertices.size())) [[unlikely]] {
        detail::refuse("TriangleMesh: vertex index of a triangle", "below " + std::to_string(mesh.vertices.size()),
                       vertex);
      }
    }
  }
}

/// Smallest axis-aligned box around all corners of triangles [m]; empty if there are none.
inline Eigen::AlignedBox3d bounds(const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const TriangleMesh::Triangle& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) {
      box.extend(mesh.vertices[vertex]);
    }
  }
  return box;
}

/// Volume enclosed by a closed surface [m^3], negative if its triangles look inward: the sum of signed tetrahedra over
/// the triangles, from the middle of the bounds so that a place far from the origin costs no digits.
inline double signed_volume(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) {
    return 0;
  }
  const Vector3<double> center = bounds(mesh).center();
  double six_volumes = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    six_volumes += (mesh.corner(t, 0) - center).dot((mesh.corner(t, 1) - center).cross(mesh.corner(t, 2) - center));
  }
  return six_volumes / 6;
}

/// [m^2]
inline double surface_area(const TriangleMesh& mesh) {
  double twice_area = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    twice_area += mesh.area_normal(t).norm();
  }
  return twice_area / 2;
}

/// The mesh with every vertex multiplied by `factor` > 0, as for files in millimetres.
inline TriangleMesh scaled(TriangleMesh mesh, double factor) {
  expects(factor > 0 && std::isfinite(factor), "TriangleMesh: scale factor [-]", "> 0 and finite", factor);
  for (Vector3<double>& vertex : mesh.vertices) {
    vertex *= factor;
  }
  return mesh;
}

/// Both meshes in one, without any change to their triangles.
inline TriangleMesh joined(TriangleMesh a, const TriangleMesh& b) {
  const auto offset = static_cast<std::uint32_t>(a.vertices.size());
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (TriangleMesh::Triangle triangle : b.triangles) {
    for (std::uint32_t& vertex : triangle) {
      vertex += offset;
    }
    a.triangles.push_back(triangle);
  }
  return a;
}

/// Merges vertices at exactly equal coordinates and leaves out those that no triangle uses. Triangles keep their order
/// and number, also where two corners become one. Needs a mesh that validates.
inline TriangleMesh welded(const TriangleMesh& mesh) {
  struct Hash {
    std::size_t operator()(const std::array<double, 3>& point) const noexcept {
      std::size_t seed = 0;
      for (const double x : point) {
        seed = (seed ^ std::hash<double>{}(x)) * 0x9E3779B97F4A7C15ULL;
        seed ^= seed >> 32;
      }
      return seed;
    }
  };
  TriangleMesh result;
  result.triangles.reserve(mesh.triangles.size());
  std::unordered_map<std::array<double, 3>, std::uint32_t, Hash> seen;
  seen.reserve(mesh.vertices.size());
  for (TriangleMesh::Triangle triangle : mesh.triangles) {
    for (std::uint32_t& vertex : triangle) {
      const Vector3<double>& point = mesh.vertices[vertex];
      // + 0.0 turns -0 into 0, which compare equal but may hash apart
      const std::array<double, 3> key{point[0] + 0.0, point[1] + 0.0, point[2] + 0.0};
      const auto [entry, fresh] = seen.try_emplace(key, static_cast<std::uint32_t>(result.vertices.size()));
      if (fresh) {
        result.vertices.push_back(point);
      }
      vertex = entry->second;
    }
    result.triangles.push_back(triangle);
  }
  return result;
}

}  // namespace decant::inline DECANT_TARGET
