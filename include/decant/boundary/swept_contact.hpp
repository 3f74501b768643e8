// SPDX-License-Identifier: MIT
#pragma once

/// The last guard of a container: no particle's path may cross a wall, however thin the wall and however fast it moves.

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// What a path needed in order to stay on its side.
enum class SweptResult {
  Free,     ///< nothing: the path met no wall
  Slid,     ///< the end was moved, and the new path crosses no wall
  Stopped,  ///< no free end was found nearby: the particle stays where it was, relative to the body
};

/// Moves `end` so that the straight path from `start` to it, both in the body's frame, does not cross the surface, and
/// so that it ends at least `clearance` [m] away from it where there is room. Both frames' motion is in the two points:
/// for a moving body, `start` is taken with the pose before the step and `end` with the pose after it. By induction a
/// particle that started on one side of a closed surface stays there: whatever is returned has been tested against the
/// surface, and the last resort is `start` itself.
inline SweptResult keep_on_side(const BoundingVolumeHierarchy& surface, const Vector3<double>& start,
                                Vector3<double>& end, double clearance) noexcept {
  constexpr int most_slides = 4;  // a corner of three walls takes three
  SweptResult result = SweptResult::Free;
  bool crosses = false;
  for (int slide = 0; slide <= most_slides; ++slide) {
    const auto hit = surface.first_hit(start, end);
    crosses = hit.has_value();
    if (!crosses || slide == most_slides) {
      break;
    }
    const Vector3<double> normal = (start - end).dot(hit->normal) >= 0 ? hit->normal : Vector3<double>(-hit->normal);
    end += normal * (clearance - (end - hit->point).dot(normal));
    result = SweptResult::Slid;
  }
  if (crosses) {
    end = start;
    return SweptResult::Stopped;
  }
  if (const auto near = surface.closest_point(end, clearance); near && near->distance > 0) {
    const Vector3<double> farther = near->point + (end - near->point) * (clearance / near->distance);
    if (!surface.any_hit(start, farther)) {
      end = farther;
      result = SweptResult::Slid;
    }
  }
  return result;
}

}  // namespace decant::inline DECANT_TARGET
