// SPDX-License-Identifier: MIT
#pragma once

/// What a frame's cameras saw of the liquid, beside what the simulation says they should have seen.

#include <cstddef>
#include <cstdint>
#include <span>

#include <decant/camera/posed_camera.hpp>
#include <decant/camera/ray_occlusion.hpp>
#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// One camera in one frame. Owns nothing; images are the camera's height x width.
template <class CameraType>
struct SilhouetteView {
  const RayOcclusion<CameraType>* sight = nullptr;  ///< the camera where it is, among the bodies where they are
  const Mask* observed = nullptr;                   ///< liquid by the segmentation, cleaned of specks
  const Mask* predicted = nullptr;                  ///< liquid by the simulation as it is now
  const Image<float>* coverage = nullptr;           ///< how many particles cover each pixel
  std::span<const std::uint8_t> hidden{};           ///< N, 1 for particles that a body hides from this camera
  std::size_t number = 0;                           ///< of the camera, the same in every frame

  const PosedCamera<CameraType>& camera() const noexcept { return sight->camera(); }
};

/// The observation of correctors that go by silhouettes. Views are those of the cameras that have something to say in
/// this frame: no mask, or one that is not to be believed (MaskTrust), no view.
template <class CameraType>
struct Silhouettes {
  using Camera = CameraType;

  std::span<const SilhouetteView<Camera>> views{};
  int pass = 0;                          ///< 0 .. passes - 1: which of the corrector's passes this is
  double spacing = 0;                    ///< of particles [m]
  double radius = 0;                     ///< with which particles are drawn [m]
  Vector3<double> gravity{0, 0, -9.81};  ///< [m/s^2]
  Threads threads{};
};

}  // namespace decant::inline DECANT_TARGET
