// SPDX-License-Identifier: MIT
#pragma once

/// Where in the world cameras' disagreements begin, and which body is near.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <decant/camera/concept.hpp>
#include <decant/core/image.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/discovery/disagreement.hpp>
#include <decant/discovery/simulated_interaction.hpp>

namespace decant::inline DECANT_TARGET {

/// Where something is that a camera saw, as far as one camera tells.
struct SeenPlace {
  Vector3<double> place{0, 0, 0};  ///< [m], world frame
  std::size_t body = 0;            ///< the nearest one's number in the model
  double distance = 0;             ///< of the place from its surface [m]
};

/// The place that a pixel shows, if it shows liquid: on its ray, as far off as the model's liquid is that a camera sees
/// there or, where it sees none, as that which is nearest to the ray by its angle. One camera does not say how far off
/// something is; but what is missing is where the model has it, and what is too much comes from what the model has.
/// @param model as it is at the time of the picture. @param pixel (u, v) [px].
/// Nothing where the model has no liquid in front of the camera, or no body, or the pixel is not finite.
template <class Model, CameraModel Camera>
std::optional<SeenPlace> place_of_liquid(const Model& model, const Camera& camera, const Pose& camera_from_world,
                                         const Eigen::Vector2d& pixel) {
  if (!pixel.allFinite()) {
    return std::nullopt;
  }
  const Pose world_from_camera = camera_from_world.inverse();
  const Vector3<double> begin = world_from_camera * camera.unproject(pixel, 0);
  const Vector3<double> along = (world_from_camera * camera.unproject(pixel, 1) - begin).normalized();
  const auto& fluid = model.fluid();
  constexpr double none = std::numeric_limits<double>::infinity();
  double front = none, beside = none, least_angle = none;  // of the liquid on the ray, and of that beside it
  for (Index i = 0; i < fluid.size(); ++i) {
    const Vector3<double> off = fluid.position.col(i).template cast<double>() - begin;
    const double depth = off.dot(along), aside = (off - depth * along).norm();
    if (!(depth > 0)) {
      continue;
    }
    if (aside <= model.spacing()) {
      front = std::min(front, depth);
    } else if (aside / depth < least_angle) {
      least_angle = aside / depth;
      beside = depth;
    }
  }
  const double reach = std::isfinite(front) ? front : beside;
  if (!std::isfinite(reach)) {
    return std::nullopt;
  }
  SeenPlace seen{begin + reach * along, 0, none};
  const auto& bodies = model.bodies();
  for (std::size_t body = 0; body < bodies.size(); ++body) {
    const auto& each = bodies[static_cast<BodyId>(body)];
    const auto nearest =
        each.surface->closest_point(each.motion.at(model.time()).inverse() * seen.place, seen.distance);
    if (nearest && nearest->distance < seen.distance) {
      seen.body = body;
      seen.distance = nearest->distance;
    }
  }
  return std::isfinite(seen.distance) ? std::optional(seen) : std::nullopt;
}

/// Where disagreements begin, by the model as it is: it runs once. @param of of the interaction's recording.
/// @return by disagreement; nothing where the model has no liquid then, or fails before.
template <class Model, class CameraType>
std::vector<std::optional<SeenPlace>> places_of(const std::vector<Disagreement>& of,
                                                const SimulatedInteraction<Model, CameraType>& interaction) {
  std::vector<std::optional<SeenPlace>> places(of.size());
  if (of.empty()) {
    return places;
  }
  const auto& scene = interaction.scene();
  const auto see = [&](std::size_t frame, const Model& model, std::span<const Mask>, std::span<const double>) {
    const double time = scene.times[frame], before = frame > 0 ? scene.times[frame - 1] : time - 1;
    for (std::size_t k = 0; k < of.size(); ++k) {
      if (of[k].begin > before + 1e-9 && of[k].begin <= time + 1e-9 && of[k].camera < scene.cameras.size()) {
        const auto& camera = scene.cameras[of[k].camera];
        places[k] =
            place_of_liquid(model, camera.camera, camera.camera_from_world[frame], {of[k].onset_u, of[k].onset_v});
      }
    }
  };
  interaction.watch({}, see);
  return places;
}

}  // namespace decant::inline DECANT_TARGET
