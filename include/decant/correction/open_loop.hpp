// SPDX-License-Identifier: MIT
#pragma once

/// The corrector that leaves the simulation alone: what all others are compared with.

#include <decant/camera/distorted_pinhole_camera.hpp>
#include <decant/core/target.hpp>
#include <decant/correction/concept.hpp>
#include <decant/correction/silhouettes.hpp>

namespace decant::inline DECANT_TARGET {

template <class ScalarType = float, class CameraType = DistortedPinholeCamera>
struct OpenLoop {
  using Scalar = ScalarType;
  using Observation = Silhouettes<CameraType>;

  void reset() noexcept {}
  CorrectionReport correct(FluidState<Scalar>&, const Observation&, Scalar) noexcept { return {}; }
};
static_assert(Corrector<OpenLoop<>>);

}  // namespace decant::inline DECANT_TARGET
