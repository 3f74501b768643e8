// SPDX-License-Identifier: MIT
#pragma once

/// What a model may lack, or what may be wrong with a measurement, told to people and to programs.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// A number that says how strong an effect is: a drag has one, a sideways pull one for each direction.
struct EffectComponent {
  std::string name{};    ///< such as "x"; empty where there is one component only
  double base = 0;       ///< what the model has
  double low = 0;        ///< the range that is looked through, low <= base <= high, not both equal
  double high = 1;       ///<
  double tolerance = 0;  ///< up to so much off the base nothing is missing, >= 0: it is drawn with all else that is
                         ///< tolerated; 0: the model is sure of it

  /// What a closer look may come to, lowest and highest: half as far off again as what is looked through at first.
  std::pair<double, double> limits() const noexcept { return {base + 1.5 * (low - base), base + 1.5 * (high - base)}; }
};

/// What an effect is about.
enum class EffectKind {
  Physics,      ///< of the liquid, its surroundings or its amount
  Measurement,  ///< late poses, a camera that was moved: the world is as the model has it
  Nuisance,   ///< a measurement's too, but only ever taken account of, not named: what it explains nothing else has to
  Tolerated,  ///< known not to be missing: drawn within its tolerance, and never looked for
  Surroundings  ///< there or not, such as a table: taken to be there where what seems to be missing explains more with
                ///< it, not named; of one component, from none of it to all
};

/// What a camera sees first of an effect that acts at a place, there.
enum class SeenFirst {
  Nothing,  ///< it is seen elsewhere, or everywhere
  Liquid,   ///< where none is expected
  Falling,  ///< the same below its place: liquid that comes from there
  Either    ///< liquid where none is expected, or none where there should be some
};

/// When an effect acts, on the recording's clock [s]. Ends that are not finite are none.
struct TimeWindow {
  double from = -std::numeric_limits<double>::infinity();
  double until = +std::numeric_limits<double>::infinity();
};

/// Beats to try, for Effect::beats: of some periods, a fifth apart, each at four phases. @param shortest of the periods
/// [s]. @param first about when beats are counted from [s].
inline std::vector<TimeWindow> beats_to_try(double shortest, double first, int periods = 6) {
  std::vector<TimeWindow> beats;
  double period = shortest;
  for (int k = 0; k < periods; ++k, period *= 1.2) {
    for (int quarter = 0; quarter < 4; ++quarter) {
      const double from = first + 0.25 * quarter * period;
      beats.push_back({from, from + period});
    }
  }
  return beats;
}

/// An effect that a model can be given at any strength.
struct Effect {
  std::string name{};    ///< as scripts have it, such as "drag_linear"; several may have one name in different places
  std::string family{};  ///< those of one family look alike in a single pour and count as one answer; the name if empty
  std::string unit{};    ///< of all components
  std::string meaning{};  ///< what it is, for people: "air slows the liquid in proportion to its speed"
  std::vector<EffectComponent> components{1};  ///< one to three
  EffectKind kind = EffectKind::Physics;
  std::string where{};                        ///< the place in words, "floor of the cup"; empty if it has none
  std::optional<Vector3<double>> place{};     ///< where it acts [m], in the model's own frame for it
  double place_tolerance = 0;                 ///< how far from there it may be as well [m]; 0: no other place is tried
  SeenFirst seen_first = SeenFirst::Nothing;  ///< where recordings begin to disagree with a model it may be, if so
  std::optional<TimeWindow> window{};         ///< when it acts, if it does not all the time
  double window_tolerance = 0;  ///< how much earlier or later finite ends of it may be [s]; 0: no others are tried
  /// Of what comes again and again: beats that are tried when it is looked at closely, the best one further, since no
  /// step leads there from another one. Its window is one beat then, and without ends the mean over many.
  std::vector<TimeWindow> beats{};
  double speed = 0;    ///< with which its liquid comes out of a wall [m/s], 0 .. fastest
  double fastest = 0;  ///< up to which speeds are tried as well [m/s]; 0: no other is
  std::string code{};  ///< C++ that adds it to a simulator: @ stands for the strength, one after another of its
                       ///< components, # for the place, ~ for the window's ends, one after another, and ^ for the
                       ///< speed; empty where there is none

  /// The family, or the name where there is none.
  const std::string& answer() const noexcept { return family.empty() ? name : family; }
  /// For tables: the name and the place.
  std::string words() const { return where.empty() ? name : name + ", " + where; }
  Eigen::VectorXd base() const {
    Eigen::VectorXd result(static_cast<Eigen::Index>(components.size()));
    for (std::size_t k = 0; k < components.size(); ++k) {
      result[static_cast<Eigen::Index>(k)] = components[k].base;
    }
    return result;
  }
};

/// One whose strength is one number, and which is in no particular place.
inline Effect plain_effect(std::string name, std::string family, std::string unit, std::string meaning,
                           const EffectComponent& component, std::string code = {}) {
  Effect effect;
  effect.name = std::move(name);
  effect.family = std::move(family);
  effect.unit = std::move(unit);
  effect.meaning = std::move(meaning);
  effect.components = {component};
  effect.code = std::move(code);
  return effect;
}

/// Throws std::invalid_argument if something is missing or out of range.
inline void validate(const Effect& effect) {
  const std::string of = "Effect '" + effect.name + "': ";
  expects(!effect.name.empty(), "Effect: name", "one", "none");
  expects(!effect.components.empty() && effect.components.size() <= 3, of + "components", "1 .. 3",
          effect.components.size());
  expects(effect.place_tolerance >= 0 && std::isfinite(effect.place_tolerance), of + "place_tolerance [m]", ">= 0",
          effect.place_tolerance);
  expects(!effect.place || effect.place->allFinite(), of + "place [m]", "finite", "others");
  expects(effect.window_tolerance >= 0 && std::isfinite(effect.window_tolerance), of + "window_tolerance [s]", ">= 0",
          effect.window_tolerance);
  expects(!effect.window || effect.window->from < effect.window->until, of + "window", "its beginning before its end",
          effect.window ? effect.window->from : 0);
  expects(effect.speed >= 0 && effect.speed <= std::max(0.0, effect.fastest) && std::isfinite(effect.fastest),
          of + "speed [m/s]", "0 .. the fastest, which is finite", effect.speed);
  for (const TimeWindow& beat : effect.beats) {
    expects(effect.window && beat.from < beat.until, of + "beats",
            "a window to stand for, their beginning before their end", beat.from);
  }
  for (const EffectComponent& each : effect.components) {
    expects(std::isfinite(each.low) && std::isfinite(each.high) && each.low <= each.base && each.base <= each.high &&
                each.low < each.high,
            of + "range", "finite, around the base", each.low);
    expects(each.tolerance >= 0 && std::isfinite(each.tolerance), of + "tolerance", ">= 0", each.tolerance);
  }
}

}  // namespace decant::inline DECANT_TARGET
