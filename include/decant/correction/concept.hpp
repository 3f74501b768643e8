// SPDX-License-Identifier: MIT
#pragma once

/// What a corrector has to provide.

#include <concepts>

#include <decant/core/fluid_state.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// What a correction did.
struct CorrectionReport {
  Index moved = 0;        ///< particles whose place changed
  double mean_shift = 0;  ///< over those [m]
  Index relocated = 0;    ///< of them, those that were taken from one place to another: moves of mass, see Tracker
};

/// Moves the liquid toward what was seen; called from one thread once per frame, after the physics of that frame, or as
/// many times as a member `int passes() const noexcept` says. correct(fluid, seen, dt): fluid has N particles, position
/// 3xN [m] and velocity 3xN [m/s] in the world frame; it may change both but not N. seen is the frame's measurement, of
/// any type; for what cameras saw it is Silhouettes (correction/silhouettes.hpp), which also tells the pass. dt [s] > 0
/// is the time since the last frame. Paths into walls need not be looked after: the Tracker cuts them short. Returns
/// how many particles moved and how far [m]. reset() forgets earlier frames. Neither may throw; memory grows only while
/// the number of particles or of pixels grows.
/// Laws (decant/testing/corrector.hpp): equal input gives equal output; where nothing was seen nothing moves; and, but
/// for the two correctors of the paper, a perfect observation moves nothing.
template <class C>
concept Corrector = requires(C& corrector, FluidState<typename C::Scalar>& fluid,
                             const typename C::Observation& seen, typename C::Scalar dt) {
  { corrector.correct(fluid, seen, dt) } noexcept -> std::same_as<CorrectionReport>;
  { corrector.reset() } noexcept;
};

}  // namespace decant::inline DECANT_TARGET
