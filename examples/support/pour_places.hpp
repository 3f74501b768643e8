// SPDX-License-Identifier: MIT
#pragma once

/// Where things are in a recorded pour: the insides of its containers, the lip that is poured over, the jet.

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/cavity.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/types.hpp>
#include <decant/io/recording.hpp>

namespace example::detail {

/// A container's inside, in its own frame.
struct Inside {
  decant::Vector3<double> up = decant::Vector3<double>::UnitZ();     ///< out of its opening
  decant::Vector3<double> middle = decant::Vector3<double>::Zero();  ///< of the body's box [m]
  decant::Vector3<double> floor = decant::Vector3<double>::Zero();   ///< the lowest place inside, below the middle [m]
  double volume = 0;                                                 ///< [m^3]
  double rim = 0;                                                    ///< height along `up` [m]
  double rim_area = 0, widest_area = 0;                              ///< of level sections [m^2]

  double rim_radius() const { return std::sqrt(rim_area / std::numbers::pi); }
  /// Air gets in past the liquid only with difficulty.
  bool has_neck() const { return rim_area < 0.45 * widest_area; }
  decant::Vector3<double> mouth() const { return middle + (rim - middle.dot(up)) * up; }
};

/// A body's inside, see upright_cavity: recordings may begin with a container that is tilted already. Nothing if it
/// holds nothing.
inline std::optional<Inside> inside_of(const decant::recording::Body& body,
                                       const decant::Vector3<double>& up_at_first) {
  using namespace decant;
  const auto surface = std::make_shared<const BoundingVolumeHierarchy>(body.mesh);
  const Cavity cavity = upright_cavity(surface, up_at_first);
  if (cavity.empty()) {
    return std::nullopt;
  }
  Inside inside;
  inside.up = cavity.up();
  inside.volume = cavity.volume();
  inside.middle = surface->bounds().center();
  inside.floor = inside.middle + (cavity.bottom_height() - inside.middle.dot(inside.up)) * inside.up;
  inside.rim = cavity.rim_height();
  constexpr int slices = 20;
  const double thick = (inside.rim - cavity.bottom_height()) / slices;
  for (int k = 0; k < slices && thick > 0; ++k) {
    const double top = inside.rim - k * thick;
    const double area = (cavity.volume_below(top) - cavity.volume_below(top - thick)) / thick;
    inside.rim_area = k == 0 ? area : inside.rim_area;
    inside.widest_area = std::max(inside.widest_area, area);
  }
  return inside;
}

/// The point of a container's rim that gets lowest, in its own frame and in the world as it then is.
inline std::pair<decant::Vector3<double>, decant::Vector3<double>> lip_of(const decant::recording::Body& body,
                                                                          const Inside& inside,
                                                                          const decant::Vector3<double>& up) {
  using namespace decant;
  double steepest = 2;
  Pose tilted{};
  for (const PoseTrack::Sample& sample : body.motion.samples()) {
    const double upright = up.dot(sample.pose.rotation * inside.up);
    if (upright < steepest) {
      steepest = upright;
      tilted = sample.pose;
    }
  }
  double lowest = 1e300;
  Vector3<double> lip = inside.mouth();
  for (const auto& vertex : body.mesh.vertices) {
    if (inside.up.dot(vertex) > inside.rim - 0.01 && up.dot(tilted * vertex) < lowest) {
      lowest = up.dot(tilted * vertex);
      lip = vertex;
    }
  }
  return {lip, tilted * lip};
}

/// Whether a body stays where it is, as well as cameras tell poses.
inline bool stands(const decant::recording::Body& body) {
  const decant::Pose first = body.motion.at(0);
  constexpr double shift = 0.003, turn = 0.02;  // [m], [rad]
  return std::all_of(body.motion.samples().begin(), body.motion.samples().end(), [&](const auto& sample) {
    return (sample.pose.translation - first.translation).norm() <= shift &&
           sample.pose.rotation.angularDistance(first.rotation) <= turn;
  });
}

/// What a body stands on: below its middle, as low as it gets [m], world frame.
inline decant::Vector3<double> foot_of(const decant::recording::Body& body, double time,
                                       const decant::Vector3<double>& up) {
  const decant::Pose pose = body.motion.at(time);
  const decant::Vector3<double> middle = pose * decant::BoundingVolumeHierarchy(body.mesh).bounds().center();
  double lowest = 0;
  for (const auto& vertex : body.mesh.vertices) {
    lowest = std::min(lowest, up.dot(pose * vertex - middle));
  }
  return middle + lowest * up;
}

/// The containers of a pour, and about where it goes.
struct PourPlaces {
  std::vector<std::optional<Inside>> inside{};                    ///< by body
  decant::Vector3<double> lip = decant::Vector3<double>::Zero();  ///< of the first source, in its frame [m]
  /// Half-way from there to the target [m], or the one of them that there is.
  std::optional<decant::Vector3<double>> jet{};
};

inline PourPlaces pour_places(const decant::Recording& recording) {
  using namespace decant;
  const Vector3<double> up = -recording.gravity.normalized();
  const double begin = recording.timestamps.front();
  PourPlaces places;
  std::optional<Vector3<double>> lip, target;
  for (const recording::Body& body : recording.bodies) {
    const Pose first = body.motion.at(begin);
    places.inside.push_back(inside_of(body, first.rotation.conjugate() * up));
    const std::optional<Inside>& inside = places.inside.back();
    if (body.role == recording::Role::Source && !lip && inside) {
      std::tie(places.lip, lip.emplace()) = lip_of(body, *inside, up);
    }
    if (body.role == recording::Role::Target && !target) {
      target = first * BoundingVolumeHierarchy(body.mesh).bounds().center();
    }
  }
  places.jet = lip && target ? Vector3<double>(0.5 * (*lip + *target)) : lip ? lip : target;
  return places;
}

}  // namespace example::detail
