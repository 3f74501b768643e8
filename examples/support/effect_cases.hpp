// SPDX-License-Identifier: MIT
#pragma once

/// Which effect is hidden in which recording, how strong it is and where: all of it from the number of a case.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/types.hpp>

#include "cylinder_scenarios.hpp"
#include "effect_scenarios.hpp"
#include "junction_scenarios.hpp"

namespace example {

/// Cases of the two ranges have no scenario and no seed in common.
enum class CaseRange {
  Develop,  ///< to choose and tune a method
  Report    ///< to say how good it is
};

enum class CaseKind {
  Moderate,     ///< an effect that a method may know of, as strong as it is easily seen
  Weak,         ///< the same, half as strong
  Nothing,      ///< only what is tolerated
  Outside,      ///< something that no method is told of
  Measurement,  ///< the liquid is as the model has it, the measurement is not
  Cylinder,     ///< an effect in a cylinder that a robot moves, or an error of the measurement; heights alone are read
  Two,          ///< two effects at once, each as strong as in Moderate
  CylinderTwo,  ///< two of a cylinder's at once
  Junction      ///< an effect in a pipe junction
};

/// A kind of effect, and how strong it is where it is moderate.
struct EffectEntry {
  const char* name;
  const char* family;  ///< effects of a family are hard to tell apart, and need not be
  const char* unit;
  double least = 0, most = 0;
  bool either_sign = false;
  bool thins_in_turn = false;  ///< every other one is shear_thinning
};

inline const std::vector<EffectEntry>& hidden_effects() {
  static const std::vector<EffectEntry> entries{
      {"drag_quadratic", "drag", "1/m", 0.9, 1.5},
      {"viscosity", "viscosity", "m^2/s", 5e-4, 1.2e-3, false, true},  // over that of water
      {"surface_tension", "surface_tension", "N/m", 0.15, 0.30},
      {"wall_friction", "wall_friction", "1/s", 20, 50},   // at a spacing of 5 mm
      {"wall_adhesion", "wall_adhesion", "m/s^2", 8, 18},  // at a spacing of 5 mm
      {"lateral_force", "lateral_force", "m/s^2", 0.5, 0.8},
      {"suction", "suction", "m/s^2", 6, 12},             // at 5 cm
      {"gravity", "gravity", "share", 0.12, 0.14, true},  // added, of 9.81 m/s^2
      {"leak", "leak", "ml/s", 20, 30},                   // out of the container
      {"loss", "loss", "ml/s", 20, 35},                   // soaked up in the pan
      {"inflow", "inflow", "ml/s", 15, 30},
      {"obstacle", "obstacle", "mm", 15, 25},
      {"back_pressure", "back_pressure", "m/s^2", 6, 10},
      {"drag_linear", "drag", "1/s", 1.2, 2},
  };
  return entries;
}

/// Every other liquid that is thicker than assumed is so only where it is hardly sheared: at rest by this much over
/// water, and at the 100 to 200 1/s of a jet's edge and of walls by a third to a quarter of it.
inline constexpr EffectEntry shear_thinning{"shear_thinning", "viscosity", "m^2/s", 2e-3, 4e-3};

inline const std::vector<EffectEntry>& measurement_errors() {
  static const std::vector<EffectEntry> entries{
      {"fill", "fill", "share", 0.12, 0.14, true},      // more than recorded, of what was recorded
      {"latency", "latency", "s", 0.050, 0.070, true},  // poses are recorded so late
      {"body_pose", "body_pose", "mm", 5, 15},
      {"camera_shift", "camera", "px or deg", 0, 0},  // as its variant has it
      {"mask_bias", "mask_bias", "px", 1, 2, true},   // fatter by so much
  };
  return entries;
}

inline const std::vector<EffectEntry>& outside_effects() {
  static const std::vector<EffectEntry> entries{
      {"stirrer", "outside", "m/s", 0.5, 0.8},       // in the pan
      {"sticky_patch", "outside", "1/s", 150, 300},  // on one side of the container; at a spacing of 5 mm
      {"bump", "outside", "mm", 18, 25},             // in the pan, so high
      {"puff", "outside", "m/s^2", 25, 38},
      {"shaking_table", "outside", "m/s^2", 2, 3},
      {"sliding_pan", "outside", "mm", 20, 30},
  };
  return entries;
}

/// What the highest point of moved water may tell.
inline const std::vector<EffectEntry>& cylinder_effects() {
  static const std::vector<EffectEntry> entries{
      {"lateral_force", "lateral_force", "m/s^2", 0.5, 0.8},  // a table that leans by 3 to 5 degrees
      {"viscosity", "viscosity", "m^2/s", 5e-4, 1.2e-3},
      {"wall_friction", "wall_friction", "1/s", 20, 50},  // at a spacing of 5 mm
      {"fill", "fill", "share", 0.12, 0.14, true},
      {"latency", "latency", "s", 0.050, 0.070, true},
  };
  return entries;
}

/// What a pipe junction may do.
inline const std::vector<EffectEntry>& junction_effects() {
  static const std::vector<EffectEntry> entries{
      {"obstacle", "obstacle", "share", 0.55, 0.8},       // of a leg's bore, closed
      {"leak", "leak", "ml/s", 25, 45},                   // out of a leg's underside
      {"viscosity", "viscosity", "m^2/s", 5e-4, 1.2e-3},  // over that of water
      {"inlet_flow", "inlet_flow", "share", 0.15, 0.30},  // less than recorded
  };
  return entries;
}

/// What is hidden in both pours of a case. Random numbers are drawn for all effects alike and used by those that have
/// such a thing.
struct HiddenEffect {
  std::string name = "nothing", family = "nothing", unit{};
  std::string variant{};                          ///< of what may be in several ways: where it is, or what it does
  double strength = 0;                            ///< with its sign
  double angle = 0;                               ///< a direction on the table, from +x toward +y [rad]
  decant::Vector3<double> direction{0, 0, 1};     ///< any, unit length
  decant::Vector3<double> displacement{0, 0, 0};  ///< of a place, each -1 .. 1
  int side = 1;                                   ///< 1 or -1
  double onset = 0, until = 0;                    ///< where it is not there all the time [s]
  double frequency = 0;                           ///< of what comes and goes [Hz]

  bool is(const char* other) const { return name == other; }
  bool is(const char* other, const char* its_variant) const { return name == other && variant == its_variant; }
  decant::Vector3<double> level_direction() const { return {std::cos(angle), std::sin(angle), 0}; }
};

/// How strong effects of a name are together, and of one of their variants where that is given.
inline double strength_of(const std::vector<HiddenEffect>& effects, const char* name, const char* variant = nullptr) {
  double strength = 0;
  for (const HiddenEffect& each : effects) {
    strength += each.is(name) && (variant == nullptr || each.variant == variant) ? each.strength : 0;
  }
  return strength;
}

/// Of a wall's friction and adhesion as they are said in a case [m]. The same wall acts on a layer of particles the
/// stronger the thinner that is: by 1 / spacing (WallFriction) and 1 / spacing^2 (WallAdhesion).
inline constexpr double spacing_of_strengths = 0.005;

/// Errors that any recording has, within what is declared as tolerated. Of one pour.
struct ToleratedErrors {
  static constexpr double most_latency = 0.006;  ///< either sign [s]
  static constexpr double most_offset = 0.001;   ///< of pan and container [m]
  static constexpr double most_turn_deg = 0.3;   ///< of the container
  static constexpr double most_fill = 0.01;      ///< of the amount
  static constexpr double most_pull = 0.02;      ///< sideways [m/s^2]

  double latency = 0, fill = 0;
  decant::Vector3<double> pan_offset{0, 0, 0};
  decant::Pose container_error{};
  decant::Vector3<double> pull{0, 0, 0};
};

struct EffectCase {
  std::string range, kind;  ///< as the command line has them
  int number = 0;
  std::size_t scenario = 0;
  std::uint32_t seed = 1;
  HiddenEffect effect{};
  HiddenEffect second{};  ///< of CaseKind::Two and CylinderTwo

  /// What is hidden: none, one or two.
  std::vector<HiddenEffect> effects() const {
    std::vector<HiddenEffect> hidden;
    for (const HiddenEffect& each : {effect, second}) {
      if (!each.is("nothing")) {
        hidden.push_back(each);
      }
    }
    return hidden;
  }
};

/// "develop_moderate_007"
inline std::string case_name(const EffectCase& of) {
  std::string number = std::to_string(of.number);
  number.insert(0, number.size() < 3 ? 3 - number.size() : 0, '0');
  return of.range + "_" + of.kind + "_" + number;
}

inline const char* word(CaseRange range) { return range == CaseRange::Develop ? "develop" : "report"; }
inline const char* word(CaseKind kind) {
  switch (kind) {
    case CaseKind::Moderate:
      return "moderate";
    case CaseKind::Weak:
      return "weak";
    case CaseKind::Nothing:
      return "nothing";
    case CaseKind::Outside:
      return "outside";
    case CaseKind::Two:
      return "two";
    case CaseKind::Cylinder:
      return "cylinder";
    case CaseKind::CylinderTwo:
      return "cylinder_two";
    case CaseKind::Junction:
      return "junction";
    default:
      return "measurement";
  }
}

/// The effects that a kind takes in turn; for CaseKind::Nothing there are none.
inline const std::vector<EffectEntry>& entries_of(CaseKind kind) {
  static const std::vector<EffectEntry> none;
  switch (kind) {
    case CaseKind::Moderate:
    case CaseKind::Weak:
    case CaseKind::Two:
      return hidden_effects();
    case CaseKind::Outside:
      return outside_effects();
    case CaseKind::Measurement:
      return measurement_errors();
    case CaseKind::Cylinder:
    case CaseKind::CylinderTwo:
      return cylinder_effects();
    case CaseKind::Junction:
      return junction_effects();
    default:
      return none;
  }
}

inline bool has_two(CaseKind kind) { return kind == CaseKind::Two || kind == CaseKind::CylinderTwo; }
inline bool is_of_cylinder(CaseKind kind) { return kind == CaseKind::Cylinder || kind == CaseKind::CylinderTwo; }
inline bool is_of_pours(CaseKind kind) { return !is_of_cylinder(kind) && kind != CaseKind::Junction; }

/// The scenarios of a range, in turn: numbers of effect_scenarios(), cylinder_scenarios() or junction_scenarios().
inline std::vector<std::size_t> scenarios_of(CaseRange range, CaseKind kind) {
  std::vector<std::size_t> scenarios;
  const bool moved = is_of_cylinder(kind), pipes = kind == CaseKind::Junction;
  const std::size_t all = moved   ? cylinder_scenarios().size()
                          : pipes ? junction_scenarios().size()
                                  : effect_scenarios().size();
  const std::size_t developed = moved   ? cylinder_scenarios_to_develop
                                : pipes ? junction_scenarios_to_develop
                                        : scenarios_to_develop;
  const std::size_t end = range == CaseRange::Develop ? developed : all;
  for (std::size_t k = range == CaseRange::Develop ? 0 : developed; k < end; ++k) {
    scenarios.push_back(k);
  }
  return scenarios;
}

namespace detail {

inline std::uint32_t mixed_seed(std::initializer_list<std::uint32_t> words) {
  std::seed_seq mixer(words);
  std::uint32_t seed = 0;
  mixer.generate(&seed, &seed + 1);
  return seed;
}

/// @param turn how often the effect has come up before.
inline HiddenEffect draw_effect(const EffectEntry& of, double factor, int turn, std::uint32_t seed) {
  const bool thins = of.thins_in_turn && turn % 2 == 1;
  const EffectEntry& entry = thins ? shear_thinning : of;
  std::mt19937 random(seed);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  HiddenEffect effect;
  effect.name = entry.name;
  effect.family = entry.family;
  effect.unit = entry.unit;
  const double share = between(0, 1);
  const int sign = random() % 2 == 0 ? 1 : -1;
  effect.side = random() % 2 == 0 ? 1 : -1;
  effect.angle = between(-std::numbers::pi, std::numbers::pi);
  effect.onset = between(0.6, 1.1);
  effect.until = effect.onset + between(1.0, 1.5);
  effect.frequency = between(2.5, 4.5);
  for (decant::Index axis = 0; axis < 3; ++axis) {
    effect.displacement[axis] = between(-1, 1);
  }
  std::normal_distribution<double> normal(0, 1);
  effect.direction = {normal(random), normal(random), normal(random)};
  effect.direction.normalize();
  double least = entry.least, most = entry.most;
  const auto take_turns = [&](std::initializer_list<const char*> variants) {
    effect.variant = variants.begin()[turn % static_cast<int>(variants.size())];
  };
  if (effect.is("lateral_force")) {
    take_turns({"steady", "window"});
  } else if (effect.is("obstacle") && effect.unit == "mm") {
    take_turns({"mouth", "mouth", "pan"});
  } else if (effect.is("inflow")) {
    take_turns({"above the pan", "in the pan"});
  } else if (effect.is("body_pose")) {
    take_turns({"pan", "container"});
  } else if (effect.is("camera_shift")) {
    take_turns({"shift", "roll"});
    const bool shift = effect.variant == "shift";
    effect.unit = shift ? "px" : "deg";
    least = shift ? 2 : 0.5;
    most = shift ? 6 : 1;
  } else if (effect.is("puff") || effect.is("sliding_pan")) {
    effect.onset += 0.6;  // when there is liquid to see it by
    effect.until = effect.onset + (effect.is("puff") ? 0.9 : 0.6);
  }
  effect.strength =
      factor * std::lerp(least, most, share) * (entry.either_sign || effect.is("camera_shift") ? sign : 1);
  if (effect.is("mask_bias")) {
    effect.strength = 0.5 * std::round(2 * effect.strength);  // what discs of pixels can stand for
  }
  return effect;
}

}  // namespace detail

/// Case `number` >= 0 of a kind. Effects come in turn, and each effect comes in the range's scenarios in turn
/// (back_pressure in those with a neck); a second effect is one of the others, in turn as well, and of another family.
/// All else is drawn from a seed that no other case has.
inline EffectCase effect_case(CaseRange range, CaseKind kind, int number) {
  decant::expects(number >= 0, "effect_case: number", ">= 0", number);
  EffectCase hidden;
  hidden.range = word(range);
  hidden.kind = word(kind);
  hidden.number = number;
  hidden.seed = detail::mixed_seed({range == CaseRange::Develop ? 11U : 9007U, static_cast<std::uint32_t>(kind),
                                    static_cast<std::uint32_t>(number)});
  std::vector<std::size_t> scenarios = scenarios_of(range, kind);
  const std::vector<EffectEntry>& entries = entries_of(kind);
  auto place = static_cast<std::size_t>(number);
  if (!entries.empty()) {
    const std::size_t which = place % entries.size(), turn = place / entries.size();
    const EffectEntry& entry = entries[which];
    hidden.effect = detail::draw_effect(entry, kind == CaseKind::Weak ? 0.5 : 1.0, static_cast<int>(turn), hidden.seed);
    if (has_two(kind)) {
      std::size_t other = which + 1 + turn % (entries.size() - 1);
      while (std::string(entries[other % entries.size()].family) == entry.family) {
        ++other;
      }
      hidden.second = detail::draw_effect(entries[other % entries.size()], 1, static_cast<int>(turn),
                                          detail::mixed_seed({hidden.seed, 2U}));
    }
    if (hidden.effect.is("back_pressure") || hidden.second.is("back_pressure")) {
      std::erase_if(scenarios, [](std::size_t scenario) {
        return !effect_container(effect_scenarios()[scenario].pours[0].container).neck;
      });
    }
    place = which + turn;
  }
  hidden.scenario = scenarios[place % scenarios.size()];
  return hidden;
}

/// How many cases of a kind there are to look at: each effect in each of the range's scenarios, and enough of all to
/// count right answers and false alarms by.
inline int usual_cases(CaseRange range, CaseKind kind) {
  const auto scenarios = static_cast<int>(scenarios_of(range, kind).size());
  const auto effects = static_cast<int>(entries_of(kind).size());
  const bool report = range == CaseRange::Report;
  if (kind == CaseKind::Nothing) {
    return (report ? 16 : 4) * scenarios;
  }
  const bool twice =
      kind == CaseKind::Junction || (report && (kind == CaseKind::Moderate || kind == CaseKind::Measurement));
  return (twice ? 2 : 1) * effects * scenarios;
}

/// By the words of a command line.
inline const std::map<std::string, CaseRange>& case_ranges() {
  static const std::map<std::string, CaseRange> ranges{{"develop", CaseRange::Develop}, {"report", CaseRange::Report}};
  return ranges;
}
inline const std::map<std::string, CaseKind>& case_kinds() {
  static const std::map<std::string, CaseKind> kinds{{"moderate", CaseKind::Moderate},
                                                     {"weak", CaseKind::Weak},
                                                     {"nothing", CaseKind::Nothing},
                                                     {"outside", CaseKind::Outside},
                                                     {"measurement", CaseKind::Measurement},
                                                     {"cylinder", CaseKind::Cylinder},
                                                     {"two", CaseKind::Two},
                                                     {"cylinder_two", CaseKind::CylinderTwo},
                                                     {"junction", CaseKind::Junction}};
  return kinds;
}

/// A recording in which nothing is hidden, for reference: of any scenario, with a seed of its own kind.
inline EffectCase reference_case(std::size_t scenario, std::uint32_t seed) {
  decant::expects(scenario < effect_scenarios().size(), "reference_case: scenario", "below the number of scenarios",
                  scenario);
  EffectCase plain;
  plain.range = scenario < scenarios_to_develop ? word(CaseRange::Develop) : word(CaseRange::Report);
  plain.kind = "reference";
  plain.number = static_cast<int>(seed);
  plain.scenario = scenario;
  plain.seed = detail::mixed_seed({555U, static_cast<std::uint32_t>(scenario), seed});
  return plain;
}

/// @param which of the case's pours.
inline ToleratedErrors tolerated_errors(const EffectCase& hidden, std::size_t which) {
  std::mt19937 random(detail::mixed_seed({hidden.seed, 77U, static_cast<std::uint32_t>(which)}));
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto level = [&](double most) {
    const double size = between(0, most), angle = between(-std::numbers::pi, std::numbers::pi);
    return decant::Vector3<double>(size * std::cos(angle), size * std::sin(angle), 0);
  };
  ToleratedErrors errors;
  errors.latency = between(-errors.most_latency, errors.most_latency);
  errors.fill = between(-errors.most_fill, errors.most_fill);
  errors.pan_offset = level(errors.most_offset);
  errors.pull = level(errors.most_pull);
  const double millimetres = 1e3 * between(0, errors.most_offset), degrees = between(0, errors.most_turn_deg);
  errors.container_error = off_by(decant::Pose{}, millimetres, degrees, random);
  return errors;
}

}  // namespace example
