// SPDX-License-Identifier: MIT
#pragma once

/// What a projector draws.

#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/types.hpp>

namespace decant_test {

/// The image of particles in the camera's own frame, nothing in the way.
template <class Projector, class Camera>
decant::Image<float> drawn(Projector projector, const decant::PointArray<double>& position, const Camera& camera,
                           int threads = 1) {
  decant::Image<float> image(camera.height(), camera.width());
  projector.render(position, {}, camera, {}, image, decant::Threads{threads});
  return image;
}

}  // namespace decant_test
