// SPDX-License-Identifier: MIT
#pragma once

/// Mends what can be mended in a mesh that is to hold liquid: seams, holes narrower than a particle, orientation.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/detail/mesh_topology.hpp>
#include <decant/boundary/mesh_report.hpp>
#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// What repair did.
struct RepairReport {
  std::size_t merged_vertices = 0;    ///< at places that another vertex has, or without a triangle
  std::size_t dropped_triangles = 0;  ///< with two corners at one place, or twice in the mesh
  std::size_t closed_holes = 0;
  std::size_t added_triangles = 0;   ///< across holes
  std::size_t turned_triangles = 0;  ///< that looked the wrong way
  std::vector<std::string> lines{};  ///< the same in words, one line each; empty if there was nothing to do
};

namespace detail {

// Triangles with two corners at one place are lines. Of several triangles on the same corners one stays if their edges
// would lack it, and none if the surface is complete without: such pairs enclose nothing.
inline std::size_t drop_needless(TriangleMesh& mesh) {
  const std::size_t before = mesh.triangles.size();
  std::vector<bool> drop(before, false);
  for (std::size_t t = 0; t < before; ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    drop[t] = a == b || b == c || c == a;
  }
  const auto corners = sorted_corners(mesh);
  auto edges = sorted_edges(mesh.triangles);
  const auto users_of = [&](std::uint32_t low, std::uint32_t high, std::size_t besides) {
    const auto [first, last] = std::equal_range(
        edges.begin(), edges.end(), MeshEdge{low, high, 0, true},
        [](const MeshEdge& a, const MeshEdge& b) { return a.low != b.low ? a.low < b.low : a.high < b.high; });
    const auto users = std::count_if(first, last, [&](const MeshEdge& edge) { return !drop[edge.triangle]; });
    return static_cast<std::size_t>(users) - besides;
  };
  for (std::size_t first = 0; first < corners.size();) {
    std::size_t last = first + 1;
    while (last < corners.size() && corners[last].first == corners[first].first) {
      ++last;
    }
    const auto& [a, b, c] = corners[first].first;  // in order of number
    if (last - first > 1 && a != b && b != c) {
      int lacking = 0;
      for (const auto& [low, high] : {std::pair(a, b), std::pair(b, c), std::pair(a, c)}) {
        lacking += users_of(low, high, last - first) % 2 == 1 ? 1 : 0;
      }
      for (std::size_t k = first + (lacking >= 2 ? 1 : 0); k < last; ++k) {
        drop[corners[k].second] = true;
      }
    }
    first = last;
  }
  std::size_t kept = 0;
  for (std::size_t t = 0; t < before; ++t) {
    if (!drop[t]) {
      mesh.triangles[kept++] = mesh.triangles[t];
    }
  }
  mesh.triangles.resize(kept);
  return before - kept;
}

// Number of the connected piece of surface that each triangle belongs to, after turning triangles so that neighbours
// within a piece look the same way; `turned` is kept up. Edges of more than two triangles do not connect: which pair
// belongs together there cannot be told.
inline std::vector<std::uint32_t> orient_alike(TriangleMesh& mesh, std::vector<bool>& turned) {
  std::vector<bool> turn(mesh.triangles.size(), false);
  struct Link {
    std::uint32_t from, to;
    bool opposed;
  };
  std::vector<Link> links;
  for_each_shared_edge(sorted_edges(mesh.triangles), [&](auto first, auto last) {
    if (last - first == 2) {
      const bool opposed = first->forward == (first + 1)->forward;
      links.push_back({first->triangle, (first + 1)->triangle, opposed});
      links.push_back({(first + 1)->triangle, first->triangle, opposed});
    }
  });
  std::sort(links.begin(), links.end(),
            [](const Link& a, const Link& b) { return a.from != b.from ? a.from < b.from : a.to < b.to; });
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  std::vector<std::uint32_t> piece(count, count);
  std::uint32_t pieces = 0;
  std::vector<std::uint32_t> members;
  for (std::uint32_t start = 0; start < count; ++start) {
    if (piece[start] != count) {
      continue;
    }
    members.assign(1, start);
    piece[start] = pieces;
    std::size_t turned_here = 0;
    for (std::size_t next = 0; next < members.size(); ++next) {
      const std::uint32_t from = members[next];
      auto link =
          std::lower_bound(links.begin(), links.end(), from, [](const Link& a, std::uint32_t t) { return a.from < t; });
      for (; link != links.end() && link->from == from; ++link) {
        if (piece[link->to] == count) {
          piece[link->to] = pieces;
          turn[link->to] = turn[from] != link->opposed;
          members.push_back(link->to);
        }
      }
    }
    // what most triangles do is taken for right until the piece as a whole is looked at
    for (const std::uint32_t t : members) {
      turned_here += turn[t] ? 1 : 0;
    }
    const bool all_other = 2 * turned_here > members.size();
    for (const std::uint32_t t : members) {
      if (turn[t] != all_other) {
        turned[t] = !turned[t];
        std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
      }
    }
    ++pieces;
  }
  return piece;
}

// Turns pieces whose front has material before it: a ray from there crosses the surface an odd number of times. This
// turns nested pieces (the hollow of a hollow body) the other way round than a signed volume would.
inline void orient_outward(TriangleMesh& mesh, const std::vector<std::uint32_t>& piece, std::vector<bool>& turned) {
  const BoundingVolumeHierarchy surface(mesh);
  const double reach = surface.bounds().diagonal().norm();
  std::vector<std::pair<double, std::uint32_t>> by_area;  // largest first: their fronts are clearest
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    by_area.emplace_back(-mesh.area_normal(t).norm(), t);
  }
  std::sort(by_area.begin(), by_area.end());
  constexpr int votes_per_piece = 15;
  std::vector<int> votes(mesh.triangles.size(), 0);
  std::vector<int> balance(mesh.triangles.size(), 0);  // per piece: > 0 for outward
  const std::array<Vector3<double>, 3> directions{Vector3<double>(0.5257, 0.3819, 0.7601),
                                                  Vector3<double>(-0.6653, 0.7112, -0.2272),
                                                  Vector3<double>(0.1931, -0.8714, 0.4510)};
  for (const auto& [minus_area, t] : by_area) {
    const std::uint32_t p = piece[t];
    if (votes[p] >= votes_per_piece || !has_area(mesh, t)) {
      continue;
    }
    const Vector3<double> normal = mesh.area_normal(t).normalized();
    const Vector3<double> middle = (mesh.corner(t, 0) + mesh.corner(t, 1) + mesh.corner(t, 2)) / 3;
    const Vector3<double> from = middle + 1e-7 * reach * normal;
    Vector3<double> direction = directions[static_cast<std::size_t>(votes[p]) % 3];
    // away from the triangle itself, which a ray at a low angle would graze
    direction = (direction.dot(normal) < 0 ? Vector3<double>(-direction) : direction) + 0.5 * normal;
    ++votes[p];
    if (const auto count = surface.crossing_count(from, from + 2 * reach * direction)) {
      balance[p] += *count % 2 == 0 ? 1 : -1;
    }
  }
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (balance[piece[t]] < 0) {
      std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
      turned[t] = !turned[t];
    }
  }
}

}  // namespace detail

/// A mesh of the same body with vertices at one place merged, needless triangles dropped, holes narrower than one
/// particle spacing spanned by triangles of least area, and all triangles of closed surfaces looking out of the
/// material. Wider holes stay, and so does the look of surfaces that are open. @param spacing [m], > 0.
/// Throws std::invalid_argument as inspect does.
inline TriangleMesh repaired(const TriangleMesh& mesh, double spacing, RepairReport& report) {
  expects(spacing > 0 && std::isfinite(spacing), "repaired: particle spacing [m]", "> 0 and finite", spacing);
  validate(mesh);
  report = {};
  TriangleMesh result = welded(mesh);
  report.merged_vertices = mesh.vertices.size() - result.vertices.size();
  report.dropped_triangles = detail::drop_needless(result);
  expects(!result.triangles.empty(), "repaired: number of triangles with three different corners", ">= 1",
          result.triangles.size());
  std::vector<bool> turned(result.triangles.size(), false);
  detail::orient_alike(result, turned);

  std::vector<std::array<std::uint32_t, 2>> open;
  detail::for_each_shared_edge(detail::sorted_edges(result.triangles), [&](auto first, auto last) {
    if (last - first == 1) {
      open.push_back(first->forward ? std::array{first->high, first->low} : std::array{first->low, first->high});
    }
  });
  std::size_t open_left = open.size();
  for (const auto& loop : detail::closed_loops(open)) {
    const auto span = detail::span_loop(result.vertices, loop);
    if (detail::span_width(result.vertices, loop, span) < spacing) {
      result.triangles.insert(result.triangles.end(), span.begin(), span.end());
      report.added_triangles += span.size();
      ++report.closed_holes;
      open_left -= loop.size();
    }
  }
  turned.resize(result.triangles.size(), false);
  const auto piece = detail::orient_alike(result, turned);
  if (open_left == 0) {
    detail::orient_outward(result, piece, turned);
  }
  const std::size_t original = result.triangles.size() - report.added_triangles;
  report.turned_triangles = static_cast<std::size_t>(
      std::count(turned.begin(), turned.begin() + static_cast<std::ptrdiff_t>(original), true));

  using detail::counted;
  if (report.dropped_triangles > 0) {
    report.lines.push_back("dropped " + counted(report.dropped_triangles, "triangle") + " without use");
  }
  if (report.closed_holes > 0) {
    report.lines.push_back("closed " + counted(report.closed_holes, "hole") + " narrower than " +
                           detail::length_text(spacing) + " with " + counted(report.added_triangles, "triangle"));
  }
  if (report.turned_triangles > 0) {
    report.lines.push_back("turned " + counted(report.turned_triangles, "triangle") + " to look out of the material");
  }
  return result;
}

inline TriangleMesh repaired(const TriangleMesh& mesh, double spacing) {
  RepairReport report;
  return repaired(mesh, spacing, report);
}

}  // namespace decant::inline DECANT_TARGET
