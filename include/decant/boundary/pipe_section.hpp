// SPDX-License-Identifier: MIT
#pragma once

/// Cuts across a pipe, found from the inside: where the middle is, which way the pipe runs, how wide it is.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// A plane cut across the inside of a pipe. Any cross-section that can be looked over from its middle: round, oval,
/// square, with facets. In the frame of the mesh.
struct PipeSection {
  Vector3<double> center = Vector3<double>::Zero();      ///< of the area [m]
  Vector3<double> direction = Vector3<double>::UnitZ();  ///< along the pipe, toward the opening; unit length
  double area = 0;                                       ///< inside of the wall [m^2]
  double distance = 0;                                   ///< from the opening along the pipe's middle [m]
  /// Points of the wall all round, at equal angles about the middle, counter-clockwise for who looks into the opening.
  /// The first stays on one side from section to section along a pipe. [m]
  std::vector<Vector3<double>> outline{};

  /// Of the circle with that area [m].
  double radius() const { return std::sqrt(area / std::numbers::pi); }
};

namespace detail {

/// Points of an outline: those of a circle enclose 0.04 % less than the circle.
inline constexpr std::size_t section_points = 128;
/// Share of the outline that has to be wall. Less than all of it, so that cracks in a scan and drilled holes are
/// passed.
inline constexpr double section_closed = 0.95;

/// What rays from the middle of a section met.
struct SectionView {
  PipeSection section;
  Matrix3<double> spread = Matrix3<double>::Zero();  ///< covariance of the wall's normals, not divided by their number
};

/// One look from `x` across a pipe. Nothing unless there is wall all round within `reach` [m].
/// @param direction unit length. @param across where the outline begins, not along direction.
inline std::optional<SectionView> look_across(const BoundingVolumeHierarchy& surface, const Vector3<double>& x,
                                              const Vector3<double>& direction, const Vector3<double>& across,
                                              double reach) {
  const Vector3<double> first = (across - across.dot(direction) * direction).normalized();
  const Vector3<double> second = direction.cross(first);
  if (!first.allFinite()) {
    return std::nullopt;
  }
  std::array<double, section_points> distance;
  std::array<Vector3<double>, section_points> ray;
  SectionView view;
  Vector3<double> mean = Vector3<double>::Zero();
  std::size_t met = 0;
  for (std::size_t k = 0; k < section_points; ++k) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(k) / section_points;
    ray[k] = std::cos(angle) * first + std::sin(angle) * second;
    const auto hit = surface.first_hit_along(x, ray[k], reach);
    distance[k] = hit ? hit->fraction * reach : -1;
    if (hit) {
      ++met;
      mean += hit->normal;
      view.spread += hit->normal * hit->normal.transpose();
    }
  }
  if (static_cast<double>(met) < section_closed * section_points) {
    return std::nullopt;
  }
  view.spread -= mean * mean.transpose() / static_cast<double>(met);
  // gaps are bridged from both sides
  for (std::size_t k = 0; k < section_points; ++k) {
    if (distance[k] >= 0) {
      continue;
    }
    std::size_t before = 1, after = 1;
    while (distance[(k + section_points - before) % section_points] < 0) {
      ++before;
    }
    while (distance[(k + after) % section_points] < 0) {
      ++after;
    }
    // bridged ones keep their sign until all are done
    const double from = distance[(k + section_points - before) % section_points];
    const double to = distance[(k + after) % section_points];
    distance[k] = -(from + (to - from) * static_cast<double>(before) / static_cast<double>(before + after));
  }
  PipeSection& section = view.section;
  section.direction = direction;
  section.outline.reserve(section_points);
  Vector3<double> moment = Vector3<double>::Zero();
  for (std::size_t k = 0; k < section_points; ++k) {
    section.outline.push_back(x + std::abs(distance[k]) * ray[k]);
  }
  for (std::size_t k = 0; k < section_points; ++k) {
    const Vector3<double> a = section.outline[k] - x, b = section.outline[(k + 1) % section_points] - x;
    const double area = 0.5 * a.cross(b).dot(direction);
    section.area += area;
    moment += area * (a + b) / 3;
  }
  if (!(section.area > 0)) {
    return std::nullopt;
  }
  section.center = x + moment / section.area;
  return view;
}

/// The direction that the walls run along, by the covariance of their normals: those of a straight pipe, whatever its
/// cross-section, lie in a plane, and so do those of a cone, beside the origin.
inline Vector3<double> direction_of_walls(const Matrix3<double>& spread, const Vector3<double>& toward) {
  const Eigen::SelfAdjointEigenSolver<Matrix3<double>> solver(spread);
  const Vector3<double> along = solver.eigenvectors().col(0);
  // walls that are a ball's, or two plates only, do not say where they run: the guess stays
  if (!(solver.eigenvalues()[1] > 1e-6 * solver.eigenvalues()[2]) || !(std::abs(along.dot(toward)) > 0.5)) {
    return toward;
  }
  return along.dot(toward) < 0 ? Vector3<double>(-along) : along;
}

/// Looks again from the middle of what was seen until that stays where it is.
inline std::optional<SectionView> look_across_from_middle(const BoundingVolumeHierarchy& surface, Vector3<double> x,
                                                          const Vector3<double>& direction,
                                                          const Vector3<double>& across, double reach) {
  std::optional<SectionView> view;
  for (int round = 0; round < 6; ++round) {
    view = look_across(surface, x, direction, across, reach);
    if (!view) {
      return view;
    }
    const double shift = (view->section.center - x).norm();
    x = view->section.center;
    if (shift < 1e-3 * view->section.radius()) {
      break;
    }
  }
  return view;
}

}  // namespace detail

/// The cut across a pipe near a point inside of it. Looks for the middle and for the direction in which the walls run.
/// @param x [m], inside of the pipe. @param direction about along the pipe, toward its opening, any length but 0.
/// @param reach walls farther away do not count [m], > 0. Nothing where the pipe is not closed all round.
inline std::optional<PipeSection> pipe_section(const BoundingVolumeHierarchy& surface, const Vector3<double>& x,
                                               const Vector3<double>& direction, double reach) {
  expects(x.allFinite() && direction.allFinite() && direction.norm() > 0, "pipe_section: place and direction",
          "finite, direction other than zero", direction.transpose());
  expects(reach > 0 && std::isfinite(reach), "pipe_section: reach [m]", "> 0 and finite", reach);
  Vector3<double> along = direction.normalized(), middle = x;
  const Vector3<double> across = along.unitOrthogonal();
  std::optional<detail::SectionView> view;
  for (int round = 0; round < 4; ++round) {
    view = detail::look_across_from_middle(surface, middle, along, across, reach);
    if (!view) {
      return std::nullopt;
    }
    middle = view->section.center;
    const Vector3<double> better = detail::direction_of_walls(view->spread, along);
    if ((better - along).norm() < 1e-6) {
      break;
    }
    along = better;
  }
  return std::move(view->section);
}

/// The section that lies `distance` [m] > 0 farther in along the middle of the pipe, through bends too. Nothing where
/// the pipe ends before, branches, opens into something wider or turns a sharp corner.
inline std::optional<PipeSection> follow_pipe(const BoundingVolumeHierarchy& surface, const PipeSection& from,
                                              double distance) {
  expects(distance > 0 && std::isfinite(distance), "follow_pipe: distance [m]", "> 0 and finite", distance);
  expects(from.area > 0 && !from.outline.empty(), "follow_pipe: section", "one that was found", from.area);
  PipeSection section = from;
  const double reach = 4 * from.radius();
  const double steps = std::ceil(distance / (0.125 * from.radius()));
  if (!(steps < 1e5)) {
    return std::nullopt;
  }
  const double step = distance / steps;
  for (int k = 0; k < static_cast<int>(steps); ++k) {
    const Vector3<double> across = section.outline.front() - section.center;
    Vector3<double> along = section.direction;
    std::optional<detail::SectionView> next;
    // at the new place the pipe may run another way: a step along the mean of both follows a circle to second order
    for (int round = 0; round < 2; ++round) {
      const Vector3<double> way = (section.direction + along).normalized();
      next = detail::look_across_from_middle(surface, section.center - step * way, along, across, reach);
      if (!next) {
        return std::nullopt;
      }
      along = detail::direction_of_walls(next->spread, along);
    }
    const double growth = next->section.area / section.area;
    // the direction of walls that end, or begin, is theirs and not the pipe's
    if (!(growth < 1.3) || !(growth > 1 / 1.3) || !(along.dot(section.direction) > 0.9)) {
      return std::nullopt;
    }
    const double walked = (next->section.center - section.center).norm();
    if (!(walked > 0.5 * step)) {
      return std::nullopt;
    }
    const double so_far = section.distance + step;
    section = std::move(next->section);
    section.distance = so_far;
  }
  return section;
}

/// The section behind a sharp corner that is next to the section `from`, where the pipe goes on in one direction and
/// no other; it lies two radii behind the corner, and its distance is counted through the corner's middle. Nothing
/// where there is no corner, the pipe branches, or it ends.
inline std::optional<PipeSection> behind_corner(const BoundingVolumeHierarchy& surface, const PipeSection& from) {
  expects(from.area > 0 && !from.outline.empty(), "behind_corner: section", "one that was found", from.area);
  const double radius = from.radius(), reach = 8 * radius;
  // a corner's own room ends within two radii of its middle
  const double goes_on = 3.5 * radius;
  constexpr double other_way = 0.6;  // cosine between directions that are not the same way
  constexpr int directions = 512;
  const auto free_path = [&](const Vector3<double>& x, const Vector3<double>& direction) {
    const auto hit = surface.first_hit_along(x, direction, reach);
    return hit ? hit->fraction * reach : reach;
  };
  struct Way {
    Vector3<double> from, direction;
    double length = 0;
  };
  // even over the sphere (Vogel's spiral)
  const auto direction_of = [&](int k) {
    const double z = 1 - (2 * k + 1.0) / directions, turn = k * std::numbers::pi * (3 - std::sqrt(5.0));
    const double r = std::sqrt(1 - z * z);
    return Vector3<double>(r * std::cos(turn), r * std::sin(turn), z);
  };
  const double ahead = free_path(from.center, -from.direction);
  Way best;
  for (double depth = 0.25 * radius; depth < std::min(ahead, 3 * radius); depth += 0.25 * radius) {
    const Vector3<double> x = from.center - depth * from.direction;
    for (int k = 0; k < directions; ++k) {
      const Vector3<double> direction = direction_of(k);
      const double length = direction.dot(from.direction) < other_way ? free_path(x, direction) : 0;
      if (length > best.length) {
        best = {x, direction, length};
      }
    }
  }
  if (best.length < goes_on) {
    return std::nullopt;
  }
  for (int k = 0; k < directions; ++k) {
    const Vector3<double> direction = direction_of(k);
    if (direction.dot(from.direction) < other_way && direction.dot(best.direction) < other_way &&
        free_path(best.from, direction) > goes_on) {
      return std::nullopt;
    }
  }
  auto section = pipe_section(surface, best.from + 2 * radius * best.direction, -best.direction, 4 * radius);
  if (!section || !(section->area < 1.5 * from.area) || !(section->area > from.area / 1.5)) {
    return std::nullopt;
  }
  // through where the middles of both pipes come closest to each other
  const Vector3<double> between = from.center - section->center;
  section->distance =
      from.distance + between.dot(from.direction + section->direction) / (1 + section->direction.dot(from.direction));
  return section;
}

/// Sections along the middle of a pipe from `from` inward, `step` [m] apart, through bends and sharp corners, for as
/// long as the pipe goes on without branching and at most `length` [m]; `from` itself is the first.
inline std::vector<PipeSection> center_line(const BoundingVolumeHierarchy& surface, const PipeSection& from,
                                            double length, double step) {
  expects(step > 0 && std::isfinite(step), "center_line: step [m]", "> 0 and finite", step);
  expects(length >= 0 && length / step < 1e5, "center_line: length [m]", ">= 0 and below 100,000 steps", length);
  std::vector<PipeSection> line{from};
  while (line.back().distance + step <= from.distance + length * (1 + 1e-9)) {
    auto next = follow_pipe(surface, line.back(), step);
    if (!next) {
      next = behind_corner(surface, line.back());
    }
    if (!next || next->distance > from.distance + length * (1 + 1e-9)) {
      break;
    }
    line.push_back(std::move(*next));
  }
  return line;
}

}  // namespace decant::inline DECANT_TARGET
