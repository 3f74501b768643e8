// SPDX-License-Identifier: MIT
#pragma once

/// What predicts scalar measurements: a simulation with gauges, or a formula and no particles at all.

#include <concepts>
#include <span>
#include <vector>

#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// Turns a hypothesis into what sensors would read.
/// predict(parameters, times): parameters are the hypothesis, a number for each thing that is not known (an amount, a
/// discharge coefficient, the strength of an effect), in units and an order that are the model's to say; times [s] are
/// those of the readings and increase. Returns one series for each channel, in an order of its own, with one number for
/// each time. A pure function, called from several threads at once; it may take as long as a simulation does. What is
/// predicted in no way (the model failed) is NaN. Throws std::invalid_argument for another number of parameters.
template <class M>
concept SeriesModel = requires(const M& model, std::span<const double> parameters, std::span<const double> times) {
  { model.predict(parameters, times) } -> std::same_as<std::vector<std::vector<double>>>;
};

}  // namespace decant::inline DECANT_TARGET
