// SPDX-License-Identifier: MIT
#pragma once

/// What decant asks of a projector, which turns particles into an image.

#include <concepts>
#include <cstdint>
#include <span>

#include <decant/camera/concept.hpp>
#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/pixel_box.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Draws particles as a camera sees them. A plain value; one of them serves one caller at a time.
/// render(position, hidden, camera, camera_from_world, coverage, threads): position is 3xN [m], world frame. hidden is
/// empty, or has N entries, and a particle whose entry is not zero is left out, as something stands before it. coverage
/// has camera.height() rows and camera.width() columns; render overwrites all of it with the number of particles that
/// cover each pixel (Phi in Schenck & Fox 2017; 0 where there is none, fractions are welcome, nothing is negative).
/// Returns a rectangle outside of which coverage is zero, so that others can save work: PixelBox::of(coverage) is
/// always right. Particles that are behind the camera, outside the image or not finite are no error; they are not
/// drawn. Must not throw, and allocates only when N or the image is larger than ever before. Equal input gives equal
/// output, for any number of threads. Laws: decant/testing/projector.hpp.
template <class P, class Camera>
concept Projector = CameraModel<Camera> && std::copyable<P> && std::floating_point<typename P::Scalar> &&
    requires(P& projector, const ConstPointsView<typename P::Scalar>& position, std::span<const std::uint8_t> hidden,
             const Camera& camera, const Pose& camera_from_world, ImageView<float> (&coverage)() noexcept,
             Threads threads) {
  // coverage() stands for a view handed over by value: copying an Eigen::Ref is not declared noexcept
  { projector.render(position, hidden, camera, camera_from_world, coverage(), threads) }
  noexcept->std::same_as<PixelBox>;
};

}  // namespace decant::inline DECANT_TARGET
