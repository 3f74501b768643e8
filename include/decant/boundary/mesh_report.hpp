// SPDX-License-Identifier: MIT
#pragma once

/// What is wrong with a mesh that is to hold liquid, in numbers and in words.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/cavity.hpp>
#include <decant/boundary/detail/mesh_topology.hpp>
#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Findings about a mesh. Edges are counted after vertices at equal places were merged.
struct MeshReport {
  /// A closed line of open edges: the rim of a hole, or the border of a sheet.
  struct Loop {
    std::size_t edges = 0;
    double length = 0;                                 ///< along the edges [m]
    double width = 0;                                  ///< diameter of the largest ball that fits through, about [m]
    Vector3<double> center = Vector3<double>::Zero();  ///< mean of its corners [m]
  };

  std::size_t vertices = 0;  ///< at different places
  std::size_t triangles = 0;
  Vector3<double> size = Vector3<double>::Zero();  ///< of the bounds [m]
  double material_volume = 0;                      ///< enclosed, signed [m^3]; means little if not closed
  std::size_t degenerate_triangles = 0;            ///< without area
  std::size_t duplicate_triangles = 0;             ///< on the same three corners as an earlier one
  std::size_t open_edges = 0;                      ///< with one triangle only
  std::vector<Loop> loops{};                       ///< of open edges, widest first
  std::size_t non_manifold_edges = 0;              ///< with more than two triangles
  std::size_t flipped_edges = 0;                   ///< whose two triangles face opposite ways
  bool inside_out = false;                         ///< closed, but triangles face into the material
  double thinnest_wall =
      std::numeric_limits<double>::infinity();  ///< 99 % of the surface have a thicker one; 0 of a sheet [m]

  /// What fits below the rim [m^3]; NaN where it was not asked for.
  double cavity_volume = std::numeric_limits<double>::quiet_NaN();

  /// No edge is open: the surface separates inside from outside, though perhaps not with one orientation.
  bool closed() const noexcept { return open_edges == 0; }
  /// Closed, facing outward throughout.
  bool sound() const noexcept { return closed() && flipped_edges == 0 && !inside_out; }

  std::vector<std::string> warnings{};  ///< one line each: what repair can mend, or what the user should know
  std::vector<std::string> refusals{};  ///< one line each: reasons not to simulate with this mesh at this spacing
};

namespace detail {

inline bool has_area(const TriangleMesh& mesh, std::size_t triangle) {
  const Vector3<double>& a = mesh.corner(triangle, 0);
  const Vector3<double>& b = mesh.corner(triangle, 1);
  const Vector3<double>& c = mesh.corner(triangle, 2);
  const double longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return mesh.area_normal(triangle).norm() > 8 * std::numeric_limits<double>::epsilon() * longest;
}

// All triangles, those on the same corners side by side.
inline std::vector<std::pair<TriangleMesh::Triangle, std::uint32_t>> sorted_corners(const TriangleMesh& mesh) {
  std::vector<std::pair<TriangleMesh::Triangle, std::uint32_t>> result;
  result.reserve(mesh.triangles.size());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    TriangleMesh::Triangle corners = mesh.triangles[t];
    std::sort(corners.begin(), corners.end());
    result.emplace_back(corners, t);
  }
  std::sort(result.begin(), result.end());
  return result;
}

// How thick the material is behind its surface: from the middle of triangles inward to the next triangle that looks
// about the other way, so that a sharp edge does not count as a thin wall.
inline double thinnest_wall(const TriangleMesh& mesh, const BoundingVolumeHierarchy& surface) {
  std::vector<std::pair<double, double>> walls;  // thickness, area
  const double reach = surface.bounds().diagonal().norm();
  const std::size_t stride = 1 + mesh.triangles.size() / 20000;
  double total = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += stride) {
    if (!has_area(mesh, t)) {
      continue;
    }
    const Vector3<double> area_normal = mesh.area_normal(t);
    const double area = area_normal.norm();
    const Vector3<double> normal = area_normal / area;
    const Vector3<double> middle = (mesh.corner(t, 0) + mesh.corner(t, 1) + mesh.corner(t, 2)) / 3;
    total += area;
    const auto hit = surface.first_hit_along(middle - 1e-7 * reach * normal, -normal, reach);
    if (hit && hit->normal.dot(normal) < -0.5) {
      walls.emplace_back((hit->point - middle).norm(), area);
    }
  }
  std::sort(walls.begin(), walls.end());
  double thinner = 0;
  for (const auto& [thickness, area] : walls) {
    thinner += area;
    if (thinner >= 0.01 * total) {
      return thickness;
    }
  }
  return std::numeric_limits<double>::infinity();
}

// "3 noun" or "1 noun", with an s where it belongs.
inline std::string counted(std::size_t count, const std::string& noun) {
  return std::to_string(count) + " " + noun + (count == 1 ? "" : "s");
}

// "3.5 mm" or "106 m".
inline std::string length_text(double length) {
  std::ostringstream text;
  text.precision(3);
  if (length < 1) {
    text << 1000 * length << " mm";
  } else {
    text << length << " m";
  }
  return text.str();
}

}  // namespace detail

/// Looks a mesh over. @param spacing particle spacing [m], > 0: what is small or narrow is judged by it. Takes well
/// under a second for 100,000 triangles. Throws std::invalid_argument if the mesh does not validate or has no area at
/// all.
inline MeshReport inspect(const TriangleMesh& mesh, double spacing) {
  expects(spacing > 0 && std::isfinite(spacing), "MeshReport: particle spacing [m]", "> 0 and finite", spacing);
  validate(mesh);
  const BoundingVolumeHierarchy surface(mesh);
  const TriangleMesh merged = welded(mesh);
  MeshReport report;
  report.vertices = merged.vertices.size();
  report.triangles = merged.triangles.size();
  report.size = surface.bounds().sizes();
  report.material_volume = signed_volume(merged);
  for (std::size_t t = 0; t < merged.triangles.size(); ++t) {
    report.degenerate_triangles += detail::has_area(merged, t) ? 0 : 1;
  }
  const auto corners = detail::sorted_corners(merged);
  for (std::size_t k = 1; k < corners.size(); ++k) {
    report.duplicate_triangles += corners[k].first == corners[k - 1].first ? 1 : 0;
  }
  const auto edges = detail::sorted_edges(merged.triangles);
  std::vector<std::array<std::uint32_t, 2>> open;
  detail::for_each_shared_edge(edges, [&](auto first, auto last) {
    const auto count = last - first;
    if (count == 1) {
      // against the triangle's own sense, so that a patch along the loop continues its surface
      open.push_back(first->forward ? std::array{first->high, first->low} : std::array{first->low, first->high});
    } else if (count == 2) {
      report.flipped_edges += first->forward == (first + 1)->forward ? 1 : 0;
    } else {
      ++report.non_manifold_edges;
    }
  });
  report.open_edges = open.size();
  for (const auto& loop : detail::closed_loops(open)) {
    MeshReport::Loop found;
    found.edges = loop.size();
    for (std::size_t k = 0; k < loop.size(); ++k) {
      found.length += (merged.vertices[loop[(k + 1) % loop.size()]] - merged.vertices[loop[k]]).norm();
      found.center += merged.vertices[loop[k]] / static_cast<double>(loop.size());
    }
    found.width = detail::span_width(merged.vertices, loop, detail::span_loop(merged.vertices, loop));
    report.loops.push_back(found);
  }
  std::stable_sort(report.loops.begin(), report.loops.end(),
                   [](const MeshReport::Loop& a, const MeshReport::Loop& b) { return a.width > b.width; });
  report.inside_out = report.closed() && report.flipped_edges == 0 && report.material_volume < 0;
  const bool sheet = !report.loops.empty() && report.loops.front().width >= spacing;
  report.thinnest_wall = sheet ? 0 : detail::thinnest_wall(merged, surface);

  using detail::counted;
  using detail::length_text;
  if (report.open_edges > 0) {
    const double widest = report.loops.empty() ? 0 : report.loops.front().width;
    std::string line = "surface is open: " + counted(report.open_edges, "open edge") + " in " +
                       counted(report.loops.size(), "loop") + ", the widest " + length_text(widest) + " across";
    line += widest < spacing ? " (narrower than a particle: can be closed by repair)"
                             : " (wider than a particle: liquid may pass, and the body is taken for a thin sheet)";
    report.warnings.push_back(std::move(line));
  }
  if (report.flipped_edges > 0) {
    report.warnings.push_back("orientation changes at " + counted(report.flipped_edges, "edge") +
                              ": some triangles look the wrong way");
  }
  if (report.inside_out) {
    report.warnings.push_back("triangles look into the material: the body is inside out");
  }
  if (report.non_manifold_edges > 0) {
    report.warnings.push_back(counted(report.non_manifold_edges, "edge") + " with more than two triangles");
  }
  if (report.degenerate_triangles > 0) {
    report.warnings.push_back(counted(report.degenerate_triangles, "triangle") + " without area");
  }
  if (report.duplicate_triangles > 0) {
    report.warnings.push_back(counted(report.duplicate_triangles, "triangle") + " twice in the mesh");
  }
  if (!sheet && report.thinnest_wall < 0.05 * spacing) {
    // a scan's defect rather than a wall; swept contact holds it, but pictures and counts of material will not
    report.warnings.push_back("thinnest wall is " + length_text(report.thinnest_wall) +
                              ", a twentieth of the particle " + "spacing of " + length_text(spacing) + " or less");
  }
  const double largest = report.size.maxCoeff();
  if (largest > 5000 * spacing) {
    report.refusals.push_back("body is " + length_text(largest) + " large, more than 5000 particles of " +
                              length_text(spacing) + ": is the file in millimetres (scale 0.001)?");
  }
  if (largest < spacing) {
    report.refusals.push_back("body is " + length_text(largest) + " large, less than one particle of " +
                              length_text(spacing) + ": is its scale right?");
  }
  return report;
}

/// Looks over a mesh that is to stand with `up` (its own frame, any length but 0) up: also what it holds. Takes some
/// tenths of a second longer.
inline MeshReport inspect(const TriangleMesh& mesh, double spacing, const Vector3<double>& up) {
  MeshReport report = inspect(mesh, spacing);
  const Cavity cavity(mesh, up);
  report.cavity_volume = cavity.volume();
  std::ostringstream text;
  text.precision(3);
  // Rims hold liquid back by about a particle: of a hollow less than four across they would rule a large part.
  const double particles = cavity.volume() / (spacing * spacing * spacing);
  if (particles > 0 && particles < 64) {
    text << "holds " << 1e6 * cavity.volume() << " ml below its rim this way up, no more than " << std::ceil(particles)
         << " particles of " << detail::length_text(spacing);
  } else if (cavity.empty() && !report.closed()) {
    text << "holds no liquid this way up: its opening looks down, or there is a hole low in its wall";
  }
  if (!text.str().empty()) {
    report.warnings.push_back(text.str());
  }
  return report;
}

}  // namespace decant::inline DECANT_TARGET
