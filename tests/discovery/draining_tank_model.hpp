// SPDX-License-Identifier: MIT
#pragma once

/// A forward model without cameras: a tank that drains through a hole into a pan on a scale, with a level probe in it.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include <decant/discovery/effect.hpp>
#include <decant/discovery/forward_model.hpp>
#include <decant/discovery/reading_series.hpp>

namespace decant_test {

/// What decides how a tank drains.
struct Tank {
  double discharge = 0.62;  ///< of the hole
  double level = 0.2;       ///< at the beginning [m]
  double leak = 0;          ///< past the pan, whatever the level [m^3/s]
  double late = 0;          ///< when the hole is opened [s]
  double evaporated = 0;    ///< out of the pan [1/s] of what is in it
  double taken = 0;         ///< out of the pan after a minute [kg]
  double taper = 0;         ///< area at 0.2 m over that at the floor, less 1
  double step = 0.2;        ///< of the integration [s]
};

inline constexpr double tank_area = 0.01, hole_area = 8e-6;  // [m^2]

/// Level [m] and mass in the pan [kg], twice a second for two minutes, without errors.
inline std::vector<decant::ReadingSeries> readings_of(const Tank& tank) {
  decant::ReadingSeries level("level [m]", {0.002, 3}), mass("in the pan [kg]", {0.003, 0});
  double height = tank.level, in_pan = 0, now = 0;
  for (int k = 0; k <= 240; ++k) {
    const double time = 0.5 * k;
    while (now < time - 1e-9) {
      const double step = std::min(tank.step, time - now);
      const double through =
          now + 1e-9 < 5 + tank.late ? 0 : tank.discharge * hole_area * std::sqrt(2 * 9.81 * std::max(0.0, height));
      const double lost = height > 0 ? tank.leak : 0;
      const double area = tank_area * (1 + tank.taper * (height / 0.2 - 0.5));
      height = std::max(0.0, height - step * (through + lost) / area);
      in_pan += step * (998 * through - tank.evaporated * in_pan);
      now += step;
    }
    level.add(time, height);
    mass.add(time, in_pan - (time < 60 ? 0 : tank.taken));
  }
  return {level, mass};
}

/// Of a tank that differs from the model's a little, too: it is wider at its top, and integrated in other steps.
inline decant::Observation read_from(Tank tank, std::uint32_t seed) {
  tank.taper = 0.004;
  tank.step = 0.07;
  return decant::Observation(readings_of(tank)).with_errors(seed);
}

/// Knows of another discharge coefficient, a leak, another level at the beginning (which is tolerated within a
/// millimetre) and a hole that is opened late (within 0.1 s).
class TankModel {
 public:
  explicit TankModel(double level = 0.2) : level_(level) {
    const auto add = [&](const char* name, const char* unit, const decant::EffectComponent& component,
                         decant::EffectKind kind) {
      effects_.push_back(decant::plain_effect(name, "", unit, "", component));
      effects_.back().kind = kind;
    };
    add("discharge", "", {"", 0.62, 0.4, 0.9}, decant::EffectKind::Physics);
    add("leak", "m^3/s", {"", 0, 0, 4e-6}, decant::EffectKind::Physics);
    add("level", "m", {"", level, level - 0.03, level + 0.03, 0.001}, decant::EffectKind::Physics);
    add("late", "s", {"", 0, -4, 10, 0.1}, decant::EffectKind::Measurement);
  }

  const std::vector<decant::Effect>& effects() const noexcept { return effects_; }

  std::vector<decant::ReadingSeries> predict(const decant::ModelRun& run) const {
    std::mt19937 random(run.seed);
    std::vector<double> strength;
    for (const decant::AppliedEffect& each : decant::effects_of_run(effects_, run, random)) {
      strength.push_back(each.strength[0]);
    }
    return readings_of({strength[0], strength[2], strength[1], strength[3]});
  }

 private:
  double level_;
  std::vector<decant::Effect> effects_{};
};
static_assert(decant::ForwardModel<TankModel>);

}  // namespace decant_test
