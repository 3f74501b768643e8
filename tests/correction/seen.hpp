// SPDX-License-Identifier: MIT
#pragma once

/// A block of liquid before one or two cameras, and silhouettes of it from other places: what correctors are tried on.

#include <cstdint>
#include <span>
#include <vector>

#include <decant/camera/distorted_pinhole_camera.hpp>
#include <decant/camera/ray_occlusion.hpp>
#include <decant/core/fluid_state.hpp>
#include <decant/correction/silhouettes.hpp>
#include <decant/projector/silhouette.hpp>

namespace decant_test {

inline constexpr double block_spacing = 0.005, block_radius = 0.66 * block_spacing;

/// What a corrector is told of the views, for particles of these tests.
inline decant::Silhouettes<decant::DistortedPinholeCamera> observation(
    std::span<const decant::SilhouetteView<decant::DistortedPinholeCamera>> views, int pass = 0,
    decant::Threads threads = {1}) {
  return {views, pass, block_spacing, block_radius, {0, 0, -9.81}, threads};
}

/// 8 x `deep` x 8 particles around `center` [m], at rest.
template <class Scalar>
decant::FluidState<Scalar> liquid_block(const decant::Vector3<double>& center, int deep = 8) {
  decant::FluidState<Scalar> fluid;
  fluid.resize(64 * deep);
  for (decant::Index i = 0; i < fluid.size(); ++i) {
    const decant::Vector3<double> place(static_cast<double>(i % 8) - 3.5,
                                        static_cast<double>(i / 8 % deep) - 0.5 * (deep - 1),
                                        static_cast<double>(i / (8 * deep)) - 3.5);
    fluid.position.col(i) = (center + block_spacing * place).template cast<Scalar>();
    fluid.id[i] = static_cast<std::uint32_t>(i);
    fluid.mass[i] = Scalar(1e-4);
  }
  return fluid;
}

inline decant::DistortedPinholeCamera seeing_camera() {
  return {decant::PinholeCamera(500, 500, 99.5, 79.5, 200, 160), {}};
}
/// Half a metre before the origin, looking along the world's y; the image's right is the world's x, its down minus z.
inline decant::Pose before_the_block() {
  decant::Matrix3<double> axes;
  axes << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  return {Eigen::Quaterniond(axes), {0, 0, 0.5}};
}
/// Half a metre beside it, looking along minus x; the image's right is the world's y.
inline decant::Pose beside_the_block() {
  decant::Matrix3<double> axes;
  axes << 0, 1, 0, 0, 0, -1, -1, 0, 0;
  return {Eigen::Quaterniond(axes), {0, 0, 0.5}};
}

/// One camera's part in an observation; renders what a liquid looks like.
template <class Scalar>
struct Eye {
  using Camera = decant::DistortedPinholeCamera;

  decant::RayOcclusion<Camera> sight;
  decant::Silhouette<decant::DiscSplat<Scalar>> drawing{decant::DiscSplat<Scalar>(block_radius)};
  decant::Mask observed, predicted;
  std::vector<std::uint8_t> hidden{};

  explicit Eye(const decant::Pose& camera_from_world)
      : sight(decant::PosedCamera<Camera>(seeing_camera(), camera_from_world)),
        observed(decant::Mask::Zero(160, 200)),
        predicted(observed) {}

  void observe(const decant::FluidState<Scalar>& fluid) { draw(fluid, observed); }
  decant::SilhouetteView<Camera> predict(const decant::FluidState<Scalar>& fluid) {
    draw(fluid, predicted);
    return {&sight, &observed, &predicted, &drawing.coverage(), hidden};
  }

 private:
  void draw(const decant::FluidState<Scalar>& fluid, decant::Mask& mask) {
    hidden.resize(static_cast<std::size_t>(fluid.size()));
    decant::find_hidden(sight, fluid.position, decant::Threads{1}, hidden);
    drawing.render(fluid.position, hidden, sight.camera().camera(), sight.camera().camera_from_world(), mask);
  }
};

}  // namespace decant_test
