// SPDX-License-Identifier: MIT
#pragma once

/// For scenes in which nothing stands before the liquid, or in which all of it is transparent.

#include <decant/camera/occlusion_concept.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Nothing is hidden.
struct NoOcclusion {
  bool hidden(const Vector3<double>&) const noexcept { return false; }
};
static_assert(Occlusion<NoOcclusion>);

}  // namespace decant::inline DECANT_TARGET
