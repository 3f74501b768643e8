// SPDX-License-Identifier: MIT
#pragma once

/// Meshes and random points that tests of boundaries share.

#include <cmath>
#include <cstdint>
#include <map>
#include <random>
#include <utility>

#include <decant/boundary/triangle_mesh.hpp>

namespace decant_test {

inline constexpr double spacing = 0.005;  ///< of the particles at walls [m]

/// Uniform in a cube of half size `reach` about a center.
inline decant::Vector3<double> random_point(std::mt19937& random, const decant::Vector3<double>& center, double reach) {
  std::uniform_real_distribution<double> place(-reach, reach);
  const double x = place(random);
  const double y = place(random);
  const double z = place(random);
  return center + decant::Vector3<double>(x, y, z);
}

/// A closed ball of radius about 1 with a bumpy surface, 2 * rings meridians.
inline decant::TriangleMesh bumpy_ball(std::uint32_t rings, double bumps, unsigned seed) {
  decant::TriangleMesh mesh;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> bump(-bumps, bumps);
  const double pi = std::acos(-1.0);
  const std::uint32_t around = 2 * rings;
  mesh.vertices.emplace_back(0, 0, 1);
  for (std::uint32_t i = 1; i < rings; ++i) {
    for (std::uint32_t j = 0; j < around; ++j) {
      const double polar = pi * i / rings;
      const double turn = 2 * pi * j / around;
      mesh.vertices.push_back((1 + bump(random)) * decant::Vector3<double>(std::sin(polar) * std::cos(turn),
                                                                           std::sin(polar) * std::sin(turn),
                                                                           std::cos(polar)));
    }
  }
  mesh.vertices.emplace_back(0, 0, -1);
  const auto at = [&](std::uint32_t i, std::uint32_t j) {
    if (i == 0) {
      return std::uint32_t{0};
    }
    return i == rings ? static_cast<std::uint32_t>(mesh.vertices.size() - 1) : 1 + (i - 1) * around + j % around;
  };
  for (std::uint32_t i = 0; i < rings; ++i) {
    for (std::uint32_t j = 0; j < around; ++j) {
      if (i > 0) {
        mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
      }
      if (i + 1 < rings) {
        mesh.triangles.push_back({at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)});
      }
    }
  }
  return mesh;
}

/// Triangles that have nothing to do with each other, within a cube of half size 1 or so.
inline decant::TriangleMesh random_triangles(int count, double size, unsigned seed) {
  decant::TriangleMesh mesh;
  std::mt19937 random(seed);
  for (int t = 0; t < count; ++t) {
    const decant::Vector3<double> middle = random_point(random, decant::Vector3<double>::Zero(), 1);
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (int k = 0; k < 3; ++k) {
      mesh.vertices.push_back(random_point(random, middle, size));
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

/// Whether every edge of every triangle is met by exactly one other triangle, running the other way.
inline bool closed_and_oriented(const decant::TriangleMesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> count;
  for (const auto& triangle : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      ++count[{triangle[k], triangle[(k + 1) % 3]}];
    }
  }
  for (const auto& [edge, uses] : count) {
    const auto other = count.find({edge.second, edge.first});
    if (uses != 1 || other == count.end() || other->second != 1) {
      return false;
    }
  }
  return true;
}

/// Triangles turned over with a probability of one third.
inline decant::TriangleMesh some_turned(decant::TriangleMesh mesh, unsigned seed) {
  std::mt19937 random(seed);
  for (auto& triangle : mesh.triangles) {
    if (random() % 3 == 0) {
      std::swap(triangle[0], triangle[1]);
    }
  }
  return mesh;
}

/// The unit cube.
inline decant::TriangleMesh cube() {
  decant::TriangleMesh mesh;
  for (int k = 0; k < 8; ++k) {
    mesh.vertices.emplace_back(k & 1, (k >> 1) & 1, k >> 2);
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

}  // namespace decant_test
