// SPDX-License-Identifier: MIT
#pragma once

/// Which triangles of a mesh share which edges, where the surface has holes, and how to span one.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET::detail {

/// One side of one triangle.
struct MeshEdge {
  std::uint32_t low, high;  // vertices in order of number
  std::uint32_t triangle;
  bool forward;  // the triangle runs from low to high

  bool same_place(const MeshEdge& other) const noexcept { return low == other.low && high == other.high; }
};

/// All sides of all triangles, those at the same two vertices side by side. Triangles with two corners at one vertex
/// are left out: their two remaining sides would only seem to be shared.
inline std::vector<MeshEdge> sorted_edges(const std::vector<TriangleMesh::Triangle>& triangles) {
  std::vector<MeshEdge> edges;
  edges.reserve(3 * triangles.size());
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    const auto& [first, second, third] = triangles[t];
    if (first == second || second == third || third == first) {
      continue;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = triangles[t][k];
      const std::uint32_t b = triangles[t][(k + 1) % 3];
      edges.push_back({std::min(a, b), std::max(a, b), t, a < b});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const MeshEdge& a, const MeshEdge& b) {
    if (a.low != b.low) {
      return a.low < b.low;
    }
    return a.high != b.high ? a.high < b.high : a.triangle < b.triangle;
  });
  return edges;
}

/// Calls f(first, last) for each run of sides at the same two vertices.
template <class Function>
void for_each_shared_edge(const std::vector<MeshEdge>& edges, Function&& f) {
  for (auto first = edges.begin(); first != edges.end();) {
    auto last = first + 1;
    while (last != edges.end() && last->same_place(*first)) {
      ++last;
    }
    f(first, last);
    first = last;
  }
}

/// Chains edges (pairs of vertices) into closed loops that pass no vertex twice. Edges that are part of none stay out.
/// A loop runs along the direction in which its first edge is given.
inline std::vector<std::vector<std::uint32_t>> closed_loops(const std::vector<std::array<std::uint32_t, 2>>& edges) {
  struct End {
    std::uint32_t vertex, edge;
  };
  std::vector<End> ends;
  ends.reserve(2 * edges.size());
  for (std::uint32_t e = 0; e < edges.size(); ++e) {
    ends.push_back({edges[e][0], e});
    ends.push_back({edges[e][1], e});
  }
  std::sort(ends.begin(), ends.end(),
            [](const End& a, const End& b) { return a.vertex != b.vertex ? a.vertex < b.vertex : a.edge < b.edge; });
  const auto from = [&](std::uint32_t vertex) {
    return std::lower_bound(ends.begin(), ends.end(), vertex,
                            [](const End& a, std::uint32_t v) { return a.vertex < v; });
  };
  std::vector<bool> used(edges.size(), false);
  std::vector<std::vector<std::uint32_t>> loops;
  std::vector<std::uint32_t> path;
  constexpr auto off_path = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> place_on_path(ends.empty() ? 0 : ends.back().vertex + std::size_t{1}, off_path);
  const auto leave = [&](std::size_t length) {
    for (std::size_t k = length; k < path.size(); ++k) {
      place_on_path[path[k]] = off_path;
    }
    path.resize(length);
  };
  for (std::uint32_t start = 0; start < edges.size(); ++start) {
    if (used[start]) {
      continue;
    }
    path.assign(1, edges[start][0]);
    place_on_path[path.front()] = 0;
    while (!path.empty()) {
      std::uint32_t next = off_path;
      for (auto end = from(path.back()); end != ends.end() && end->vertex == path.back(); ++end) {
        // the first step is along the first edge, in its direction
        if (!used[end->edge] && (path.size() > 1 || end->edge == start)) {
          used[end->edge] = true;
          const auto& edge = edges[end->edge];
          next = edge[0] == path.back() ? edge[1] : edge[0];
          break;
        }
      }
      if (next == off_path) {
        leave(path.size() - 1);  // a dead end
      } else if (const std::uint32_t place = place_on_path[next]; place != off_path) {
        // back at a vertex of the path: what lies between is a loop of its own
        if (path.size() - place >= 3) {
          loops.emplace_back(path.begin() + place, path.end());
        }
        leave(place + std::size_t{1});
      } else {
        place_on_path[next] = static_cast<std::uint32_t>(path.size());
        path.push_back(next);
      }
    }
  }
  return loops;
}

/// Triangles that span a loop of vertices, of the least total area: dynamic programming over sub-chains (G. Barequet
/// and M. Sharir, "Filling gaps in the boundary of a polyhedron", 1995). They run along the loop. For loops of more
/// than 800 vertices, whose cost would be minutes, the smallest corner is cut off again and again instead.
inline std::vector<TriangleMesh::Triangle> span_loop(const std::vector<Vector3<double>>& vertices,
                                                     const std::vector<std::uint32_t>& loop) {
  const std::size_t n = loop.size();
  std::vector<TriangleMesh::Triangle> triangles;
  if (n < 3) {
    return triangles;
  }
  const auto area = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    return (vertices[b] - vertices[a]).cross(vertices[c] - vertices[a]).norm();
  };
  if (n > 800) {
    std::vector<std::size_t> before(n);
    std::vector<std::size_t> after(n);
    for (std::size_t k = 0; k < n; ++k) {
      before[k] = (k + n - 1) % n;
      after[k] = (k + 1) % n;
    }
    struct Corner {
      double size;
      std::size_t before, at, after;
      bool operator<(const Corner& other) const { return size != other.size ? size > other.size : at > other.at; }
    };
    std::priority_queue<Corner> corners;
    const auto offer = [&](std::size_t k) {
      const double size = (vertices[loop[after[k]]] - vertices[loop[before[k]]]).squaredNorm();
      corners.push({size, before[k], k, after[k]});
    };
    for (std::size_t k = 0; k < n; ++k) {
      offer(k);
    }
    while (triangles.size() < n - 2) {
      const Corner corner = corners.top();
      corners.pop();
      if (before[corner.at] != corner.before || after[corner.at] != corner.after) {
        continue;  // a neighbour went meanwhile
      }
      triangles.push_back({loop[corner.before], loop[corner.at], loop[corner.after]});
      after[corner.before] = corner.after;
      before[corner.after] = corner.before;
      before[corner.at] = after[corner.at] = n;
      offer(corner.before);
      offer(corner.after);
    }
    return triangles;
  }
  // least[i * n + j]: twice the area that spans the chain from i to j with its chord
  std::vector<double> least(n * n, 0.0);
  std::vector<std::uint32_t> choice(n * n, 0);
  for (std::size_t length = 2; length < n; ++length) {
    for (std::size_t i = 0; i + length < n; ++i) {
      const std::size_t j = i + length;
      double best = std::numeric_limits<double>::infinity();
      for (std::size_t k = i + 1; k < j; ++k) {
        const double parts = least[i * n + k] + least[k * n + j];
        if (parts < best) {
          const double whole = parts + area(loop[i], loop[k], loop[j]);
          if (whole < best) {
            best = whole;
            choice[i * n + j] = static_cast<std::uint32_t>(k);
          }
        }
      }
      least[i * n + j] = best;
    }
  }
  std::vector<std::pair<std::size_t, std::size_t>> open{{0, n - 1}};
  while (!open.empty()) {
    const auto [i, j] = open.back();
    open.pop_back();
    if (j - i < 2) {
      continue;
    }
    const std::size_t k = choice[i * n + j];
    triangles.push_back({loop[i], loop[k], loop[j]});
    open.emplace_back(i, k);
    open.emplace_back(k, j);
  }
  return triangles;
}

/// Diameter of the largest ball that fits through a spanned loop, about: twice the largest distance from the rim that a
/// point of the span has [m]. Points are a few per triangle.
inline double span_width(const std::vector<Vector3<double>>& vertices, const std::vector<std::uint32_t>& loop,
                         const std::vector<TriangleMesh::Triangle>& span) {
  const auto from_rim = [&](const Vector3<double>& x) {
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < loop.size(); ++k) {
      const Vector3<double>& a = vertices[loop[k]];
      const Vector3<double> along = vertices[loop[(k + 1) % loop.size()]] - a;
      const double squared = along.squaredNorm();
      const double t = squared > 0 ? std::clamp((x - a).dot(along) / squared, 0.0, 1.0) : 0.0;
      nearest = std::min(nearest, (x - a - t * along).squaredNorm());
    }
    return nearest;
  };
  // Thousands of points against thousands of edges would take seconds; the largest triangles reach farthest.
  const std::size_t most = std::min(span.size(), 1 + 1000000 / loop.size());
  std::vector<std::pair<double, std::size_t>> by_area;
  for (std::size_t t = 0; t < span.size(); ++t) {
    const Vector3<double>& a = vertices[span[t][0]];
    by_area.emplace_back(-(vertices[span[t][1]] - a).cross(vertices[span[t][2]] - a).norm(), t);
  }
  std::partial_sort(by_area.begin(), by_area.begin() + static_cast<std::ptrdiff_t>(most), by_area.end());
  double largest = 0;
  for (std::size_t k = 0; k < most; ++k) {
    const std::size_t t = by_area[k].second;
    const Vector3<double>& a = vertices[span[t][0]];
    const Vector3<double>& b = vertices[span[t][1]];
    const Vector3<double>& c = vertices[span[t][2]];
    constexpr int steps = 6;  // a multiple of three has the middle of the triangle among its points
    for (int i = 0; i <= steps; ++i) {
      for (int j = 0; i + j <= steps; ++j) {
        largest = std::max(largest, from_rim(a + (b - a) * (double(i) / steps) + (c - a) * (double(j) / steps)));
      }
    }
  }
  return 2 * std::sqrt(largest);
}

}  // namespace decant::inline DECANT_TARGET::detail
