// SPDX-License-Identifier: MIT
#pragma once

/// A forward model without liquid: balls that a nozzle throws through the picture, one after another, each on its own.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/image.hpp>
#include <decant/core/types.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/forward_model.hpp>
#include <decant/discovery/silhouette_series.hpp>

namespace decant_test {

/// What decides how balls fly.
struct Jet {
  double drag = 0, pull = 0, speed = 1, late = 0;  ///< [1/s], [m/s^2], over what is assumed, [s]
  double gust = 0;                                 ///< [m/s^2], for a while only
  int fatter = 0;                                  ///< of what is drawn [px]
  double tap = 0, tap_x = 0, tap_y = 0;            ///< more balls, that drop from there: how many a second; [m]
  double gust_from = 0.4, gust_until = 0.6;        ///< [s]
  double beat_from = 0, beat_until = 0;            ///< one of the pull's, if it has any [s]
  double shelf = -1;                               ///< how high a shelf below the nozzle is, if there is one [m]
};

/// @param seed of where each ball leaves the nozzle, and how fast. @param angle of the nozzle [rad].
inline std::vector<decant::SilhouetteSeries> film_of(const Jet& jet, std::uint32_t seed, double angle = 0.9) {
  std::mt19937 random(seed);
  const auto noise = [&] { return static_cast<double>(random()) / 2147483648.0 - 1; };
  struct Ball {
    double born, x, y, u, v;
  };
  // no two films are alike: the nozzle itself is not quite the same
  const double pressure = 1 + 0.006 * noise(), aim = angle + 0.008 * noise();
  std::vector<Ball> balls;
  for (int k = 0; k < 120; ++k) {
    const double speed = 2.2 * jet.speed * pressure * (1 + 0.05 * noise());
    const double own = aim + 0.05 * noise();
    balls.push_back({0.008 * k + jet.late, 0.1 + 0.004 * noise(), 0.3 + 0.004 * noise(), speed * std::cos(own),
                     speed * std::sin(own)});
  }
  for (int k = 0; k < static_cast<int>(std::lround(jet.tap)); ++k) {
    balls.push_back({k / jet.tap, jet.tap_x + 0.004 * noise(), jet.tap_y + 0.004 * noise(), 0, 0});
  }
  decant::SilhouetteSeries film(160, 120, 10);
  const double step = 1.0 / 300;
  double now = 0;
  for (int frame = 0; frame < 16; ++frame) {
    const double time = frame / 15.0;
    for (; now < time - 1e-9; now += step) {
      const double gust = now > jet.gust_from && now < jet.gust_until ? jet.gust : 0;
      const double period = jet.beat_until - jet.beat_from;
      const double beat = period > 0 ? 1 - std::cos(2 * std::numbers::pi * (now - jet.beat_from) / period) : 1;
      for (Ball& ball : balls) {
        if (now >= ball.born) {
          ball.u += step * (beat * jet.pull + gust - jet.drag * ball.u);
          ball.v += step * (-9.81 - jet.drag * ball.v);
          ball.x += step * ball.u;
          ball.y += step * ball.v;
          if (ball.y < jet.shelf && ball.x < 0.25) {
            ball = {ball.born, ball.x, jet.shelf, ball.x < jet.tap_x ? -0.15 : 0.15, 0};  // along it, both ways
          }
        }
      }
    }
    decant::Mask mask = decant::Mask::Zero(120, 160);
    const int radius = 5 + jet.fatter;
    for (const Ball& ball : balls) {
      const int u = static_cast<int>(std::lround(160 * ball.x)), v = 119 - static_cast<int>(std::lround(160 * ball.y));
      for (int dv = -radius; now >= ball.born && dv <= radius; ++dv) {
        for (int du = -radius; du <= radius; ++du) {
          if (du * du + dv * dv <= radius * radius && u + du >= 0 && u + du < 160 && v + dv >= 0 && v + dv < 120) {
            mask(v + dv, u + du) = decant::mask_liquid;
          }
        }
      }
    }
    film.add(time, mask);
  }
  return {film};
}

/// Knows of drag, a pull, the speed (which is tolerated within 1 %), poses that are late, fat masks and, if it is told
/// where it usually is, a tap. A window of an effect is one of the pull's beats.
class JetModel {
 public:
  explicit JetModel(double angle = 0.9, const std::optional<decant::Vector3<double>>& tap = {}) : angle_(angle) {
    const auto add = [&](const char* name, const decant::EffectComponent& component, decant::EffectKind kind) {
      decant::Effect effect;
      effect.name = name;
      effect.unit = "unit of " + effect.name;
      effect.components = {component};
      effect.kind = kind;
      effects_.push_back(effect);
    };
    add("drag", {"", 0, 0, 1.5}, decant::EffectKind::Physics);
    add("pull", {"", 0, -1.5, 1.5, 0.05}, decant::EffectKind::Physics);
    add("speed", {"", 1, 0.85, 1.15, 0.01}, decant::EffectKind::Physics);
    add("late", {"", 0, -0.1, 0.1, 0.004}, decant::EffectKind::Measurement);
    add("fat", {"", 0, 0, 2, 1}, decant::EffectKind::Nuisance);
    if (tap) {
      add("tap", {"", 0, 0, 40}, decant::EffectKind::Physics);
      effects_.back().place = tap;
      effects_.back().place_tolerance = 0.1;
      effects_.back().seen_first = decant::SeenFirst::Liquid;
    }
  }

  const std::vector<decant::Effect>& effects() const noexcept { return effects_; }

  std::vector<decant::SilhouetteSeries> predict(const decant::ModelRun& run) const {
    std::vector<double> strength;
    std::mt19937 random(run.seed + 77);
    for (const decant::Effect& effect : effects_) {
      strength.push_back(effect.components[0].base);
      const double share = static_cast<double>(random()) / 2147483648.0 - 1;
      if (run.tolerated && effect.kind != decant::EffectKind::Nuisance) {
        strength.back() += share * effect.components[0].tolerance;
      }
    }
    decant::Vector3<double> tap = decant::Vector3<double>::Zero();
    decant::TimeWindow beat{0, 0};
    for (const decant::AppliedEffect& applied : run.effects) {
      strength.at(applied.effect) = applied.strength[0];
      beat = applied.window.value_or(beat);
      if (effects_[applied.effect].place) {
        tap = applied.place.value_or(*effects_[applied.effect].place);
      }
    }
    if (strength[0] > broken_above) {
      return {};
    }
    strength.resize(6, 0);
    return film_of({.drag = strength[0],
                    .pull = strength[1],
                    .speed = strength[2],
                    .late = strength[3],
                    .fatter = static_cast<int>(strength[4]),
                    .tap = strength[5],
                    .tap_x = tap.x(),
                    .tap_y = tap.y(),
                    .beat_from = beat.from,
                    .beat_until = beat.until,
                    .shelf = shelf},
                   run.seed, angle_);
  }

  double broken_above = 1e9;  ///< of drag: runs fail
  double shelf = -1;          ///< see Jet

 private:
  double angle_;
  std::vector<decant::Effect> effects_{};
};
static_assert(decant::ForwardModel<JetModel> && !decant::LocatingModel<JetModel>);

/// Tells where a tap would be that is seen somewhere.
class LocatingJetModel : public JetModel {
 public:
  using JetModel::JetModel;
  std::optional<decant::Vector3<double>> place_of(std::size_t /*effect*/, const decant::Sighting& seen) const {
    return decant::Vector3<double>(seen.pixel.x() / 160, (119 - seen.pixel.y()) / 160, 0);
  }
};
static_assert(decant::LocatingModel<LocatingJetModel>);

}  // namespace decant_test
