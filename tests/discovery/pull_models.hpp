// SPDX-License-Identifier: MIT
#pragma once

/// Forward models of thrown balls in which a pull has a time: a while in which it acts, or beats.

#include <cstddef>
#include <random>
#include <vector>

#include <decant/discovery/effect.hpp>
#include <decant/discovery/forward_model.hpp>
#include <decant/discovery/silhouette_series.hpp>

#include "jet_model.hpp"

namespace decant_test {

/// Knows of a pull that lasts, of one that passes, usually early, and of a nozzle that is faster than assumed.
class PullModel {
 public:
  static constexpr std::size_t passing = 1;

  PullModel() {
    const auto add = [&](const char* name, const decant::EffectComponent& component) {
      decant::Effect& effect = effects_.emplace_back();
      effect.name = name;
      effect.unit = "m/s^2";
      effect.components = {component};
      return &effect;
    };
    add("pull", {"", 0, -1.5, 1.5, 0.05});
    decant::Effect& gust = *add("pull", {"", 0, -1.5, 1.5});
    gust.where = "for a while";
    gust.window = decant::TimeWindow{0.15, 0.55};
    gust.window_tolerance = 0.4;
    add("speed", {"", 1, 0.85, 1.15, 0.01});
  }

  const std::vector<decant::Effect>& effects() const noexcept { return effects_; }

  std::vector<decant::SilhouetteSeries> predict(const decant::ModelRun& run) const {
    Jet jet;
    std::mt19937 random(run.seed + 77);
    for (std::size_t k = 0; k < effects_.size(); ++k) {
      const double share = static_cast<double>(random()) / 2147483648.0 - 1;
      set(jet, k, effects_[k].components[0].base + (run.tolerated ? share * effects_[k].components[0].tolerance : 0));
    }
    for (const decant::AppliedEffect& applied : run.effects) {
      set(jet, applied.effect, applied.strength[0]);
      if (applied.effect == passing) {
        const decant::TimeWindow window = applied.window.value_or(*effects_[passing].window);
        jet.gust_from = window.from;
        jet.gust_until = window.until;
      }
    }
    return film_of(jet, run.seed);
  }

 private:
  static void set(Jet& jet, std::size_t effect, double strength) {
    (effect == 0 ? jet.pull : effect == passing ? jet.gust : jet.speed) = strength;
  }

  std::vector<decant::Effect> effects_{};
};
static_assert(decant::ForwardModel<PullModel>);

/// Knows of drag, a pull that is steady or comes in beats, and a nozzle that is faster than assumed.
class BeatModel : public JetModel {
 public:
  static constexpr std::size_t pull = 1;

  BeatModel() {
    effects_.erase(effects_.begin() + 3, effects_.end());
    effects_[pull].window = decant::TimeWindow{};
    effects_[pull].window_tolerance = 0.1;
    effects_[pull].beats = decant::beats_to_try(0.3, 0.4, 4);
  }
  const std::vector<decant::Effect>& effects() const noexcept { return effects_; }

 private:
  std::vector<decant::Effect> effects_{JetModel::effects()};
};
static_assert(decant::ForwardModel<BeatModel>);

}  // namespace decant_test
