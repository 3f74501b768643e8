// SPDX-License-Identifier: MIT
#pragma once

/// What predicts an interaction as cameras would see it and sensors read it, with effects that the model may lack: a
/// liquid simulator, or anything else.

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/observation.hpp>

namespace decant::inline DECANT_TARGET {

/// An effect of a model at some strength.
struct AppliedEffect {
  std::size_t effect = 0;                  ///< its number in ForwardModel::effects()
  Eigen::VectorXd strength{};              ///< by component
  std::optional<Vector3<double>> place{};  ///< [m], where it is not the effect's own
  std::optional<TimeWindow> window{};      ///< likewise
};

/// One run of a model.
struct ModelRun {
  std::vector<AppliedEffect> effects{};  ///< all others are as the model has them
  std::uint32_t seed = 0;                ///< of what chaos decides: runs of different seeds differ as two pours do
  bool tolerated = false;                ///< the seed draws all that is tolerated, too: see EffectComponent
};

/// Something that a camera saw.
struct Sighting {
  std::size_t camera = 0;
  Eigen::Vector2d pixel{0, 0};  ///< (u, v) [px]
  double time = 0;              ///< on the recording's clock [s]
};

/// Predicts one interaction, with the bodies moving as they were recorded to.
/// effects(): what it can be given. predict(run): what each camera would have seen, in the recording's frames, and each
/// sensor would have read, without its errors, at the recording's times; empty where the model failed, and a reading
/// that it cannot predict not finite, which is no better. A pure function, called from several threads at once; it may
/// take seconds. Throws std::invalid_argument for an effect that there is not, or another number of components.
template <class M>
concept ForwardModel = requires(const M& model, const ModelRun& run) {
  { model.effects() } -> std::convertible_to<const std::vector<Effect>&>;
  { model.predict(run) } -> std::convertible_to<Observation>;
};

/// One that can tell where an effect would act of which something was seen: place_of(effect, sighting), in the model's
/// own frame for it [m]; nothing where it cannot be.
template <class M>
concept LocatingModel = ForwardModel<M> && requires(const M& model, std::size_t effect, const Sighting& sighting) {
  { model.place_of(effect, sighting) } -> std::same_as<std::optional<Vector3<double>>>;
};

}  // namespace decant::inline DECANT_TARGET
