// SPDX-License-Identifier: MIT
#pragma once

/// What blocks a pipe, wholly or in part.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <decant/boundary/pipe_section.hpp>
#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// A closed mesh that fills a pipe at a section but for a hole in its middle, of the section's own form. It reaches a
/// twentieth of the pipe's radius into the wall, so that nothing passes between.
/// How much passes depends on the hole's edges as well as on its area: a sharp-edged hole contracts the jet to 0.6 of
/// its area, one with rounded mouths lets nearly all of it pass (Batchelor 1967, "An Introduction to Fluid Dynamics",
/// section 6.3).
/// @param section in the frame of the pipe's mesh. @param opening area of the hole over that of the section, in [0, 1);
/// 0: no hole. @param length along the pipe, the section in its middle [m], > 0. @param flare how far the hole widens
/// toward both ends, over their outer quarters, as a share of the way to the pipe's bore, 0 .. 1.
/// Throws std::invalid_argument for numbers out of range and for a section without an outline.
inline TriangleMesh pipe_blockage(const PipeSection& section, double opening, double length, double flare = 0) {
  expects(opening >= 0 && opening < 1, "pipe_blockage: opening", "in [0, 1)", opening);
  expects(length > 0 && std::isfinite(length), "pipe_blockage: length [m]", "> 0 and finite", length);
  expects(flare >= 0 && flare <= 1, "pipe_blockage: flare", "0 .. 1", flare);
  expects(section.outline.size() >= 3, "pipe_blockage: points of the section's outline", "at least 3",
          section.outline.size());
  TriangleMesh mesh;
  const auto count = static_cast<std::uint32_t>(section.outline.size());
  const auto add_ring = [&](double scale, double along) {
    for (const Vector3<double>& point : section.outline) {
      mesh.vertices.push_back(section.center + scale * (point - section.center) + along * section.direction);
    }
  };
  constexpr double into_wall = 1.05;
  add_ring(into_wall, -length / 2);
  add_ring(into_wall, length / 2);
  const auto quads = [&](std::uint32_t from, std::uint32_t to) {  // between two rings, by their numbers
    for (std::uint32_t k = 0; k < count; ++k) {
      const std::uint32_t next = (k + 1) % count;
      const std::uint32_t a = from * count + k, b = from * count + next, c = to * count + next, d = to * count + k;
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({a, c, d});
    }
  };
  quads(0, 1);
  if (opening > 0) {
    const double hole = std::sqrt(opening), mouth = hole + flare * (1 - hole);
    add_ring(mouth, length / 2);
    if (flare > 0) {
      add_ring(hole, length / 4);
      add_ring(hole, -length / 4);
    }
    add_ring(mouth, -length / 2);
    const std::uint32_t rings = flare > 0 ? 6 : 4;
    for (std::uint32_t ring = 1; ring < rings; ++ring) {
      quads(ring, (ring + 1) % rings);
    }
  } else {
    mesh.vertices.push_back(section.center - length / 2 * section.direction);
    mesh.vertices.push_back(section.center + length / 2 * section.direction);
    for (std::uint32_t k = 0; k < count; ++k) {
      const std::uint32_t next = (k + 1) % count;
      mesh.triangles.push_back({2 * count, next, k});
      mesh.triangles.push_back({2 * count + 1, count + k, count + next});
    }
  }
  return mesh;
}

}  // namespace decant::inline DECANT_TARGET
