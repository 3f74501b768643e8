// SPDX-License-Identifier: MIT
#pragma once

/// The ways out of a recorded pipe junction.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/pipe_openings.hpp>
#include <decant/boundary/pipe_section.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/types.hpp>
#include <decant/io/recording.hpp>

namespace example {

/// A way out of the junction.
struct JunctionLeg {
  std::string name;                         ///< left, right; leg_1, leg_2 .. if there are more than two
  decant::PipeSection section;              ///< where a blockage is tried, in the body's frame
  std::vector<decant::PipeSection> line{};  ///< its middle from the opening to where it branches, in the body's frame
};

/// Sections of a leg at which it has an underside, no more than `apart` [m] from one to the next and half of that to
/// where such a part of the leg ends. @param down in the body's frame, unit length.
inline std::vector<decant::PipeSection> sections_with_underside(const JunctionLeg& leg,
                                                                const decant::Vector3<double>& down, double apart) {
  std::vector<decant::PipeSection> chosen;
  const auto level = [&](const decant::PipeSection& section) { return std::abs(section.direction.dot(down)) < 0.7; };
  for (auto from = leg.line.begin(); from != leg.line.end();) {
    from = std::find_if(from, leg.line.end(), level);
    const auto end = std::find_if_not(from, leg.line.end(), level);
    if (from == end) {
      break;
    }
    const double length = std::prev(end)->distance - from->distance;
    const int parts = std::max(1, static_cast<int>(std::ceil(length / apart)));
    for (int k = 0; k < parts; ++k) {
      const double middle = from->distance + (k + 0.5) / parts * length;
      chosen.push_back(*std::find_if(from, std::prev(end), [&](const auto& each) { return each.distance >= middle; }));
    }
    from = end;
  }
  return chosen;
}

/// The junction that is meant: the first body of that role. Throws std::runtime_error if there is none.
inline std::size_t junction_of(const decant::Recording& recording) {
  for (std::size_t body = 0; body < recording.bodies.size(); ++body) {
    if (recording.bodies[body].role == decant::recording::Role::Junction) {
      return body;
    }
  }
  throw std::runtime_error(recording.name + ": no junction: expected a body of the role 'junction'");
}

/// The ways out of a junction: all openings but the highest. Sorted from left to right as the first camera sees them
/// at first, without a camera by x in the world. None where they are not two at least.
inline std::vector<JunctionLeg> junction_legs(const decant::Recording& recording, std::size_t body) {
  using namespace decant;
  const recording::Body& junction = recording.bodies[body];
  const Pose pose = junction.motion.at(recording.timestamps.front());
  const BoundingVolumeHierarchy surface(junction.mesh);
  std::vector<PipeOpening> openings = find_pipe_openings(surface);
  std::erase_if(openings, [](const PipeOpening& opening) { return opening.passage != 0; });
  if (openings.size() < 3) {
    return {};
  }
  const Vector3<double> up = -recording.gravity.normalized();
  const auto height = [&](const PipeOpening& opening) { return up.dot(pose * opening.rim.center); };
  openings.erase(std::max_element(openings.begin(), openings.end(),
                                  [&](const auto& a, const auto& b) { return height(a) < height(b); }));
  const auto place = [&](const PipeOpening& opening) {
    const Vector3<double> x = pose * opening.rim.center;
    if (recording.cameras.empty()) {
      return x.x();
    }
    const Vector3<double> seen = recording.cameras.front().view(0).camera_from_world * x;
    return seen.x() / std::max(seen.z(), 1e-9);
  };
  std::stable_sort(openings.begin(), openings.end(), [&](const auto& a, const auto& b) { return place(a) < place(b); });
  std::vector<JunctionLeg> legs;
  for (const PipeOpening& opening : openings) {
    const double radius = opening.rim.radius();
    // Half-way to where the leg branches, through its corners: how much passes depends on where a leg is blocked, most
    // of all on whether there is pipe behind it, and that is so along most of its way.
    const std::vector<PipeSection> line = center_line(surface, opening.rim, 100 * radius, 0.25 * radius);
    const auto half_way = std::find_if(line.begin(), line.end(), [&](const PipeSection& section) {
      return section.distance >= 0.5 * line.back().distance;
    });
    JunctionLeg leg{"leg_" + std::to_string(legs.size() + 1), *half_way, line};
    if (openings.size() == 2) {
      leg.name = legs.empty() ? "left" : "right";
    }
    legs.push_back(std::move(leg));
  }
  return legs;
}

}  // namespace example
