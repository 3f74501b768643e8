// SPDX-License-Identifier: MIT
#pragma once

/// What predicts an interaction as cameras would see it and sensors read it, with effects that the model may lack: a
/// liquid simulator, or anything else.

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
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
  std::optional<double> speed{};           ///< [m/s], likewise
};

/// One run of a model.
struct ModelRun {
  std::vector<AppliedEffect> effects{};  ///< all others are as the model has them
  std::uint32_t seed = 0;                ///< of what chaos decides: runs of different seeds differ as two pours do
  bool tolerated = false;                ///< the seed draws all that is tolerated, too: see EffectComponent
};

namespace detail {

/// 0 .. 1, evenly.
inline double unit_draw(std::mt19937& random) { return static_cast<double>(random()) / 4294967295.0; }

}  // namespace detail

/// What a model has to do in a run, for those who write one: all effects in the order of the model's, each as the run
/// asks for it, or else as the model has it; where all that is tolerated is drawn, evenly within its tolerance.
/// Throws std::invalid_argument for an effect that there is not, or another number of components.
/// @param random begun with the run's seed.
inline std::vector<AppliedEffect> effects_of_run(const std::vector<Effect>& effects, const ModelRun& run,
                                                 std::mt19937& random) {
  std::vector<AppliedEffect> as;
  for (const Effect& effect : effects) {
    as.push_back({as.size(), effect.base(), effect.place, effect.window, effect.speed});
    for (std::size_t component = 0; component < effect.components.size(); ++component) {
      const EffectComponent& of = effect.components[component];
      if (run.tolerated && of.tolerance > 0 && effect.kind != EffectKind::Nuisance) {
        as.back().strength[static_cast<Eigen::Index>(component)] =
            std::clamp(of.base + (2 * detail::unit_draw(random) - 1) * of.tolerance, of.low, of.high);
      }
    }
  }
  for (const AppliedEffect& applied : run.effects) {
    expects(applied.effect < effects.size(), "ModelRun: effect", "one of the model's", applied.effect);
    const Effect& effect = effects[applied.effect];
    expects(
        applied.strength.size() == static_cast<Eigen::Index>(effect.components.size()) && applied.strength.allFinite(),
        "ModelRun: strength of '" + effect.name + "'", "a finite number for each component", applied.strength.size());
    AppliedEffect& own = as[applied.effect];
    own.strength = applied.strength;
    own.place = applied.place ? applied.place : own.place;
    own.window = applied.window ? applied.window : own.window;
    own.speed = applied.speed ? applied.speed : own.speed;
  }
  return as;
}

/// Which effects of a model are those that something else numbers, by their words. What a model does not know of does
/// nothing in it, as air that is held up does where there is no neck.
class EffectNumbers {
 public:
  /// They are the model's own.
  EffectNumbers() noexcept {}  // not defaulted: GCC 12 fails on that in an aggregate of a template
  EffectNumbers(const std::vector<Effect>& effects, const std::vector<Effect>& of_model)
      : same_(std::equal(effects.begin(), effects.end(), of_model.begin(), of_model.end(),
                         [](const Effect& a, const Effect& b) { return a.words() == b.words(); })) {
    for (std::size_t k = 0; k < effects.size() && !same_; ++k) {
      const auto known = std::find_if(of_model.begin(), of_model.end(),
                                      [&](const Effect& each) { return each.words() == effects[k].words(); });
      if (known != of_model.end()) {
        in_model_[k] = static_cast<std::size_t>(known - of_model.begin());
      }
    }
  }

  /// Whether they are the model's own, in its order.
  bool same() const noexcept { return same_; }
  /// Whether the model knows of none of them.
  bool none() const noexcept { return !same_ && in_model_.empty(); }

  ModelRun in_model(ModelRun run) const {
    if (!same_) {
      std::erase_if(run.effects, [this](const AppliedEffect& each) { return !in_model_.contains(each.effect); });
      for (AppliedEffect& each : run.effects) {
        each.effect = in_model_.at(each.effect);
      }
    }
    return run;
  }

 private:
  bool same_ = true;
  std::map<std::size_t, std::size_t> in_model_{};
};

/// Something that a camera saw.
struct Sighting {
  std::size_t camera = 0;
  Eigen::Vector2d pixel{0, 0};  ///< (u, v) [px]
  double time = 0;              ///< on the recording's clock [s]
  /// Middles of all squares of the picture that it was seen in [px]; none where that is not known.
  std::vector<Eigen::Vector2d> squares{};
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

/// One in which effects act at certain places only, such as those of a wall: placed(effect, place), the one of these
/// that a place stands for [m], in the model's own frame for the effect.
template <class M>
concept PlacingModel = ForwardModel<M> && requires(const M& model, std::size_t effect, const Vector3<double>& place) {
  { model.placed(effect, place) } -> std::same_as<Vector3<double>>;
};

}  // namespace decant::inline DECANT_TARGET
