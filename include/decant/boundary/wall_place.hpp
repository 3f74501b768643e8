// SPDX-License-Identifier: MIT
#pragma once

/// Places of a body's wall: what is on its other side, and which of them is seen.

#include <algorithm>
#include <cmath>
#include <optional>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// A place of a wall. All in the body's frame.
struct WallPlace {
  Vector3<double> point = Vector3<double>::Zero();  ///< on its inside [m]
  Vector3<double> out = Vector3<double>::UnitX();   ///< square to it, away from the liquid
  double thickness = 0;                             ///< [m]; 0 where it has none, as a sheet, or is thicker than 3 cm
};

/// Where a body's wall is that is seen from a point of the inside in the direction of another one; at that one if there
/// is no wall. @param from, toward [m], body's frame, not the same.
inline WallPlace wall_place(const BoundingVolumeHierarchy& body, const Vector3<double>& from,
                            const Vector3<double>& toward) {
  const Vector3<double> direction = (toward - from).normalized();
  WallPlace place{toward, direction};
  if (const auto hit = body.first_hit_along(from, toward - from, 2)) {
    place.point = hit->point;
    place.out = hit->normal.dot(direction) > 0 ? hit->normal : Vector3<double>(-hit->normal);
    constexpr double thickest = 0.03, beyond = 1e-5;  // [m]
    if (const auto outside = body.first_hit_along(hit->point + beyond * place.out, place.out, thickest)) {
      place.thickness = outside->fraction * thickest + beyond;
    }
  }
  return place;
}

/// A place of a surface that a ray meets, or passes by.
struct PlaceByRay {
  Vector3<double> point = Vector3<double>::Zero();  ///< [m]
  double distance = 0;                              ///< of the ray from it [m]; 0 where the ray meets it
};

/// Where a ray meets a surface first or, if it does not, comes nearest to it, to a hundredth of its size.
/// @param origin [m]. @param direction of any length but 0. Nothing where the surface is behind it, or they are not
/// finite.
inline std::optional<PlaceByRay> place_by_ray(const BoundingVolumeHierarchy& surface, const Vector3<double>& origin,
                                              const Vector3<double>& direction) {
  const Vector3<double> along = direction.normalized();
  const double size = surface.bounds().diagonal().norm();
  const double middle = along.dot(surface.bounds().center() - origin);
  if (!std::isfinite(middle) || middle + size <= 0) {
    return std::nullopt;
  }
  if (const auto hit = surface.first_hit_along(origin, along, middle + size)) {
    return PlaceByRay{hit->point, 0};
  }
  std::optional<PlaceByRay> nearest;
  constexpr int samples = 100;
  for (int k = 0; k <= samples; ++k) {
    const double depth = std::max(0.0, middle + size * (2.0 * k / samples - 1));
    const double farthest = (surface.bounds().center() - origin - depth * along).norm() + size;
    const auto closest = surface.closest_point(origin + depth * along, farthest);
    if (closest && (!nearest || closest->distance < nearest->distance)) {
      nearest = PlaceByRay{closest->point, closest->distance};
    }
  }
  return nearest;
}

}  // namespace decant::inline DECANT_TARGET
