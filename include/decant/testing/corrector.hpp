// SPDX-License-Identifier: MIT
#pragma once

/// The laws of correctors (correction/concept.hpp), for shipped ones and for a user's own. Free of any test framework.

#include <vector>

#include <decant/core/fluid_state.hpp>
#include <decant/core/target.hpp>
#include <decant/correction/concept.hpp>
#include <decant/testing/law.hpp>

namespace decant::inline DECANT_TARGET::testing {

/// Tries the laws of a corrector on copies of it and of a liquid, each with one call.
/// @param nothing an observation of nothing (no camera had a mask). @param perfect one that is just what the liquid
/// looks like. @param other one of liquid elsewhere. @param dt [s]. @param still how far the perfect observation may
/// move a particle at most [m]; infinity for correctors that make no such promise.
template <class CorrectorType>
std::vector<Law> corrector_laws(const CorrectorType& corrector,
                                const FluidState<typename CorrectorType::Scalar>& liquid,
                                const typename CorrectorType::Observation& nothing,
                                const typename CorrectorType::Observation& perfect,
                                const typename CorrectorType::Observation& other, typename CorrectorType::Scalar dt,
                                double still) {
  static_assert(Corrector<CorrectorType>,
                "corrector_laws: the corrector must model decant::Corrector, see <decant/correction/concept.hpp>");
  using Fluid = FluidState<typename CorrectorType::Scalar>;
  const auto after = [&](const typename CorrectorType::Observation& seen) {
    CorrectorType copy = corrector;
    Fluid fluid = liquid;
    copy.reset();
    copy.correct(fluid, seen, dt);
    return fluid;
  };
  const auto farthest = [&](const Fluid& fluid) {
    return liquid.size() == 0 ? 0.0
                              : static_cast<double>((fluid.position - liquid.position).colwise().norm().maxCoeff());
  };
  const auto differ = [](const Fluid& a, const Fluid& b) {
    return a.position == b.position && a.velocity == b.velocity ? 0.0 : 1.0;
  };
  const Fluid unseen = after(nothing), once = after(other), twice = after(other), same = after(perfect);
  return {
      {"nothing seen: particles that changed (1 if any)", differ(unseen, liquid), 0},
      {"equal input, equal output (1 if not)", differ(once, twice), 0},
      {"number of particles that came or went", static_cast<double>(once.size() != liquid.size()), 0},
      {"result is finite (1 if not)", once.position.allFinite() && once.velocity.allFinite() ? 0.0 : 1.0, 0},
      {"perfect observation: farthest move [m]", farthest(same), still},
  };
}

}  // namespace decant::inline DECANT_TARGET::testing
