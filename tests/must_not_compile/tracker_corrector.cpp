// SPDX-License-Identifier: MIT
// A corrector without reset.
// expect: Tracker: Corrector must model decant::Corrector, see <decant/correction/concept.hpp>
// expect: reset()
#include <decant/simulation/parts.hpp>
#include <decant/simulation/simulator.hpp>
#include <decant/tracking/tracker.hpp>

struct Nudge {
  using Scalar = float;
  using Observation = decant::Silhouettes<decant::DistortedPinholeCamera>;
  decant::CorrectionReport correct(decant::FluidState<float>&, const Observation&, float) noexcept { return {}; }
#ifdef DECANT_TWIN
  void reset() noexcept {}
#endif
};

static_assert(sizeof(decant::Tracker<decant::LiquidSimulator, Nudge>) > 0);
