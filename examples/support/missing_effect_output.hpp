// SPDX-License-Identifier: MIT
#pragma once

/// What the workflow for missing effects found, for scripts and for people.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/discovery/disagreement.hpp>
#include <decant/discovery/disagreement_place.hpp>
#include <decant/discovery/liquid_effects.hpp>
#include <decant/discovery/missing_effect.hpp>
#include <decant/discovery/next_interaction.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/report.hpp>
#include <decant/io/table.hpp>

#include "json_result.hpp"
#include "three_digits.hpp"

namespace example {

inline std::string to_string(decant::Verdict verdict) {
  using decant::Verdict;
  return verdict == Verdict::Nothing ? "nothing"
         : verdict == Verdict::Named ? "named"
         : verdict == Verdict::OneOf ? "one_of"
                                     : "unexplained";
}

namespace detail {

using Effects = std::vector<decant::Effect>;

/// One number as it is, several as a list.
inline nlohmann::json components_json(const Eigen::VectorXd& values) {
  nlohmann::json json = nlohmann::json::array();
  for (const double value : values) {
    json.push_back(number_json(value));
  }
  return json.size() == 1 ? json.front() : json;
}

template <class Vector>
std::string components_text(const Vector& values) {
  std::string text;
  for (const double value : values) {
    text += text.empty() ? "" : ", ";
    text += three_digits(value);
  }
  return text;
}

inline nlohmann::json effect_json(const Effects& effects, const decant::RefinedEffect& found,
                                  const decant::Vector3<double>& gravity) {
  const decant::Effect& effect = effects.at(found.judged);
  nlohmann::json json = {{"effect", effect.name},
                         {"where", effect.where},
                         {"strength", components_json(found.strength)},
                         {"unit", effect.unit},
                         {"share", number_json(found.share)},
                         {"grown", number_json(found.grown)},
                         {"distance", number_json(found.distance)},
                         {"probability", number_json(found.probability)}};
  for (std::size_t k = 0; k < effect.components.size(); ++k) {
    const auto [low, high] = found.interval_90(k);
    json["interval_90"].push_back({number_json(low), number_json(high)});
  }
  if (effect.components.size() == 1) {
    json["interval_90"] = json["interval_90"].front();
  }
  if (found.place) {
    json["place"] = {found.place->x(), found.place->y(), found.place->z()};
  }
  if (found.window) {
    json["window_s"] = {number_json(found.window->from), number_json(found.window->until)};
  }
  if (found.speed) {
    json["speed_m_s"] = number_json(*found.speed);
  }
  if (effect.name == "lateral_force" && found.strength.norm() > 0) {
    const auto level = decant::level_directions(gravity);
    const decant::Vector3<double> way = (found.strength[0] * level[0] + found.strength[1] * level[1]).normalized();
    json["direction_w"] = {way.x(), way.y(), way.z()};
  }
  return json;
}

/// In words, such as "viscosity 9e-4 m^2/s".
inline std::string effect_words(const Effects& effects, const decant::RefinedEffect& found) {
  const decant::Effect& effect = effects.at(found.judged);
  std::string text = effect.words() + " " + components_text(found.strength);
  text += effect.unit.empty() ? "" : " ";
  text += effect.unit;
  if (found.window && !effect.beats.empty()) {
    text += " in beats of ";
    text += decant::detail::fixed_text(found.window->until - found.window->from, 2);
    text += " s";
    return text;
  }
  if (found.window && std::isfinite(found.window->from)) {
    text += " from ";
    text += decant::detail::fixed_text(found.window->from, 2);
    text += " s on";
  }
  if (found.window && std::isfinite(found.window->until)) {
    text += " until ";
    text += decant::detail::fixed_text(found.window->until, 2);
    text += " s";
  }
  if (found.speed) {
    text += " at ";
    text += decant::detail::fixed_text(*found.speed, 2);
    text += " m/s";
  }
  return text;
}

/// The effect's C++ with its strengths, place, times and speed.
inline std::string effect_code(const Effects& effects, const decant::RefinedEffect& found) {
  const decant::Effect& effect = effects.at(found.judged);
  std::string code;
  const decant::TimeWindow window = found.window.value_or(effect.window.value_or(decant::TimeWindow{}));
  Eigen::Index k = 0;
  bool begun = false;
  for (const char c : effect.code) {
    if (c == '@') {
      code += three_digits(found.strength[k++ % found.strength.size()]);
    } else if (c == '#') {
      const decant::Vector3<double> place =
          found.place.value_or(effect.place.value_or(decant::Vector3<double>::Zero()));
      code += components_text(place);
    } else if (c == '~') {
      const double end = begun ? window.until : window.from;
      code += std::isfinite(end) ? three_digits(end) : end < 0 ? "-INFINITY" : "INFINITY";
      begun = true;
    } else if (c == '^') {
      code += three_digits(found.speed.value_or(effect.speed));
    } else {
      code += c;
    }
  }
  return code;
}

}  // namespace detail

/// The answer in one sentence.
inline std::string missing_effect_sentence(const std::vector<decant::Effect>& effects,
                                           const decant::MissingEffect& result) {
  using decant::Verdict;
  if (result.verdict == Verdict::Nothing) {
    return "No gap between simulation and recordings beyond what is tolerated.";
  }
  if (result.verdict == Verdict::Unexplained) {
    std::string text = "There is a gap that no effect of the catalogue explains";
    if (const decant::RefinedEffect* nearest = result.nearest()) {
      text += "; nearest is ";
      text += detail::effect_words(effects, *nearest);
      text += ", which explains ";
      text += decant::detail::fixed_text(100 * nearest->share, 0);
      text += " % of what is reducible";
      if (const double grown = 100 * nearest->grown; grown >= 1) {
        text += ", but at some times makes the gap grow, by " + decant::detail::fixed_text(grown, 0) + " %";
      }
    }
    return text + ".";
  }
  if (result.verdict == Verdict::OneOf) {
    std::string text = "Missing is one of";
    for (std::size_t k = 0; k < result.one_of.size(); ++k) {
      text += k > 0 ? ", " : " ";
      text += effects.at(result.one_of[k]).words();
    }
    return text + ", which these recordings do not tell apart.";
  }
  std::string text = "Missing:";
  for (std::size_t k = 0; k < result.found.size(); ++k) {
    text += k > 0 ? ", and " : " ";
    text += detail::effect_words(effects, result.found[k]);
  }
  text += ": with it the gap falls by ";
  text += decant::detail::fixed_text(100 * result.learn.share(), 0);
  text += " % of what is reducible.";
  const double largest = result.judgement.chance.largest_distance;
  if (largest > 0 && result.learn.after > largest) {
    text += " What is left is ";
    text += decant::detail::fixed_text(result.learn.after / largest, 1);
    text += " times the most that is left where nothing is missing.";
  }
  if (result.told_apart_by_others) {
    text += " What was learnt from does not tell it from others; the recordings held out do.";
  }
  return text;
}

/// What was taken to be there, though nobody said so; empty if nothing was.
inline std::string surroundings_sentence(const std::vector<decant::Effect>& effects,
                                         const decant::MissingEffect& result) {
  std::string text;
  for (const decant::AppliedEffect& each : result.surroundings) {
    text += text.empty() ? "It is taken that " : ", and that ";
    text += effects.at(each.effect).meaning;
  }
  return text.empty() ? text : text + ": by that, what may be missing explains more.";
}

/// What the answer owes to references.
inline std::string references_sentence(std::size_t references, const decant::MissingEffect& result) {
  if (references == 0) {
    return "There are no references: how far reality is from the model where nothing is missing is not known, and "
           "taken to be little more than how far its own runs are from each other.";
  }
  const std::string count = std::to_string(references) + (references == 1 ? " reference" : " references");
  if (result.taught_by > 0) {
    return std::to_string(result.taught_by) + " of " + count +
           " look like the recordings: what they are off from the model by was taken off first.";
  }
  return count +
         ": how far they are from the model is no gap. None looks enough like the recordings to take off what "
         "it is off by" +
         (result.lessons > 0 ? "; what effects would have to be there for that was taken off first." : ".");
}

namespace detail {

/// Of all recordings the first, or that of the heaviest disagreement if there are single squares alone. Nothing if
/// there is none.
inline std::optional<decant::Onset> first_onset(const std::vector<std::vector<decant::Disagreement>>& where) {
  std::optional<decant::Onset> first;
  const decant::Disagreement* heaviest = nullptr;
  for (const auto& recording : where) {
    const std::optional<decant::Onset> one = decant::onset(recording);
    if (one && (!first || one->begin < first->begin)) {
      first = one;
    }
    if (!recording.empty() && (heaviest == nullptr || recording.front().weight > heaviest->weight)) {
      heaviest = &recording.front();
    }
  }
  if (!first && heaviest != nullptr) {
    first = decant::Onset{heaviest->camera, heaviest->begin, heaviest->onset_u, heaviest->onset_v};
  }
  return first;
}

}  // namespace detail

/// @param gravity of the recordings [m/s^2].
inline nlohmann::json missing_effect_json(const std::vector<decant::Effect>& effects,
                                          const decant::MissingEffect& result, const decant::Vector3<double>& gravity) {
  using decant::Confirmation;
  using decant::Verdict;
  nlohmann::json json;
  json["verdict"] = to_string(result.verdict);
  json["effect"] = nlohmann::json::array();
  if (result.verdict == Verdict::OneOf) {
    for (const std::size_t which : result.one_of) {
      json["effect"].push_back(effects.at(which).name);
    }
  } else {
    for (const decant::RefinedEffect& each : result.found) {
      json["effect"].push_back(effects.at(each.judged).name);
    }
  }
  for (const decant::RefinedEffect& each : result.found) {
    json["found"].push_back(detail::effect_json(effects, each, gravity));
  }
  if (!result.found.empty()) {
    const nlohmann::json first = json["found"].front();
    for (const char* key : {"strength", "unit", "interval_90", "place", "direction_w"}) {
      json[key] = first.value(key, nlohmann::json());
    }
  }
  for (const decant::RefinedEffect& each : result.refined) {
    json["refined"].push_back(detail::effect_json(effects, each, gravity));
  }
  for (const decant::EffectStanding& each : result.judgement.standings) {
    json["candidates"].push_back({{"effect", effects.at(each.effect).name},
                                  {"where", effects.at(each.effect).where},
                                  {"strength", detail::components_json(each.strength)},
                                  {"distance", number_json(each.distance)},
                                  {"share", result.judgement.has_gap() ? number_json(each.share) : nlohmann::json()},
                                  {"vote", number_json(each.vote)}});
  }
  for (const decant::SmallestSeen& each : result.smallest_seen) {
    const decant::Effect& effect = effects.at(each.effect);
    json["smallest_seen"].push_back({{"effect", effect.name},
                                     {"where", effect.where},
                                     {"component", effect.components[each.component].name},
                                     {"unit", effect.unit},
                                     {"below", number_json(each.below)},
                                     {"above", number_json(each.above)}});
  }
  const std::optional<decant::Onset> onset = detail::first_onset(result.where);
  double first_read = std::numeric_limits<double>::infinity();
  for (const auto& recording : result.where_read) {
    for (const decant::ReadingDisagreement& each : recording) {
      first_read = std::min(first_read, each.begin);
    }
  }
  const decant::RefinedEffect* timed =
      !result.found.empty() && result.found.front().window ? &result.found.front() : nullptr;
  json["onset_s"] = timed != nullptr ? number_json(timed->window->from)
                    : onset          ? nlohmann::json(std::min(onset->begin, first_read))
                                     : number_json(first_read);
  json["onset_px"] = onset ? nlohmann::json({onset->u, onset->v}) : nlohmann::json();
  json["gap"] = {{"before", number_json(result.learn.before)},
                 {"after", number_json(result.learn.after)},
                 {"noise", number_json(result.learn.noise)},
                 {"largest_by_chance", number_json(result.judgement.chance.largest_distance)},
                 {"fall_by_chance", number_json(result.judgement.chance.fall)},
                 {"held_out_before", number_json(result.held_out.before)},
                 {"held_out_after", number_json(result.held_out.after)},
                 {"held_out_noise", number_json(result.held_out.noise)},
                 {"best_rival_held_out", number_json(result.held_out.best_rival)}};
  json["confirmed"] = result.confirmation == Confirmation::Confirmed     ? nlohmann::json(true)
                      : result.confirmation == Confirmation::Refuted     ? nlohmann::json(false)
                      : result.confirmation == Confirmation::NotTestable ? nlohmann::json("not_testable")
                                                                         : nlohmann::json();
  const decant::RefinedEffect* nearest = result.verdict == Verdict::Unexplained ? result.nearest() : nullptr;
  json["nearest"] = nearest != nullptr ? nlohmann::json(effects.at(nearest->judged).name) : nlohmann::json();
  json["told_apart_by_held_out"] = result.told_apart_by_others;
  json["taught_by"] = result.taught_by;
  json["lessons"] = result.lessons;
  json["surroundings"] = nlohmann::json::array();
  for (const decant::AppliedEffect& each : result.surroundings) {
    json["surroundings"].push_back(effects.at(each.effect).name);
  }
  json["runs"] = result.runs;
  return json;
}

/// Every candidate, the best first.
inline decant::Table candidates_table(const std::vector<decant::Effect>& effects, const decant::MissingEffect& result) {
  using decant::detail::fixed_text;
  decant::Table table({"effect", "unit", "strength", "gap left", "of what is reducible [%]", "vote", "refined",
                       "gap left then", "of what is reducible then [%]", "probability"});
  for (const decant::EffectStanding& each : result.judgement.standings) {
    const decant::Effect& effect = effects.at(each.effect);
    std::vector<std::string> row{effect.words(),
                                 effect.unit,
                                 detail::components_text(each.strength),
                                 fixed_text(each.distance, 2),
                                 result.judgement.has_gap() ? fixed_text(100 * each.share, 0) : "",
                                 fixed_text(each.vote, 2)};
    const auto refined = std::find_if(result.refined.begin(), result.refined.end(),
                                      [&](const auto& other) { return other.judged == each.effect; });
    const bool is = refined != result.refined.end();
    row.push_back(is ? detail::components_text(refined->strength) : "");
    row.push_back(is ? fixed_text(refined->distance, 2) : "");
    row.push_back(is ? fixed_text(100 * refined->share, 0) : "");
    row.push_back(is ? fixed_text(refined->probability, 3) : "");
    table.add(row);
  }
  return table;
}

/// What is no gap: so far off the model may be in everything at once.
inline decant::Table tolerated_table(const std::vector<decant::Effect>& effects) {
  decant::Table table({"effect", "unit", "assumed", "tolerated to each side"});
  for (const decant::Effect& effect : effects) {
    for (const decant::EffectComponent& component : effect.components) {
      if (component.tolerance > 0) {
        table.add({effect.words() + (component.name.empty() ? "" : ": ") + component.name, effect.unit,
                   three_digits(component.base), three_digits(component.tolerance)});
      }
    }
  }
  return table;
}

/// How strong effects have to be for these recordings to tell.
inline decant::Table smallest_seen_table(const std::vector<decant::Effect>& effects,
                                         const decant::MissingEffect& result) {
  decant::Table table({"effect", "unit", "assumed", "less than", "more than"});
  const auto text = [](double strength) { return std::isfinite(strength) ? three_digits(strength) : std::string(); };
  for (const decant::SmallestSeen& each : result.smallest_seen) {
    const decant::Effect& effect = effects.at(each.effect);
    const decant::EffectComponent& component = effect.components[each.component];
    table.add({effect.words() + (component.name.empty() ? "" : ": ") + component.name, effect.unit,
               three_digits(component.base), text(each.below), text(each.above)});
  }
  return table;
}

inline decant::Table gap_table(const decant::MissingEffect& result) {
  using decant::detail::fixed_text;
  decant::Table table({"recordings", "gap before", "after", "where nothing is missing", "best rival's"});
  const auto add = [&](const char* name, const decant::GapChange& gap) {
    if (std::isfinite(gap.before)) {
      table.add({name, fixed_text(gap.before, 2), fixed_text(gap.after, 2), fixed_text(gap.noise, 2),
                 std::isfinite(gap.best_rival) ? fixed_text(gap.best_rival, 2) : ""});
    }
  };
  add("learnt from", result.learn);
  add("held out", result.held_out);
  return table;
}

/// What sensors read too much or too little of, the heaviest first.
/// @param sensors their names, by recording.
inline decant::Table where_read_table(const std::vector<std::string>& recordings,
                                      const std::vector<std::vector<std::string>>& sensors,
                                      const decant::MissingEffect& result) {
  using decant::detail::fixed_text;
  decant::Table table({"recording", "sensor", "reads", "from [s]", "to [s]", "largest, in what chance does"});
  for (std::size_t which = 0; which < result.where_read.size(); ++which) {
    for (std::size_t k = 0; k < std::min<std::size_t>(8, result.where_read[which].size()); ++k) {
      const decant::ReadingDisagreement& each = result.where_read[which][k];
      table.add({recordings.at(which), sensors.at(which).at(each.sensor), each.more ? "too much" : "too little",
                 fixed_text(each.begin, 2), fixed_text(each.end, 2), fixed_text(each.largest, 1)});
    }
  }
  return table;
}

/// Where in the world a disagreement begins.
struct NamedPlace {
  decant::SeenPlace seen;
  std::string body;  ///< the nearest one's name
};
/// By recording and disagreement; as many of either as are known.
using NamedPlaces = std::vector<std::vector<std::optional<NamedPlace>>>;

namespace detail {

inline const NamedPlace* place_at(const NamedPlaces& places, std::size_t recording, std::size_t which) {
  const bool known = recording < places.size() && which < places[recording].size() && places[recording][which];
  return known ? &*places[recording][which] : nullptr;
}

}  // namespace detail

/// Disagreements, the heaviest first.
inline decant::Table where_table(const std::vector<std::string>& recordings, const decant::MissingEffect& result,
                                 const NamedPlaces& places) {
  using decant::detail::fixed_text;
  decant::Table table({"recording", "camera", "liquid", "from [s]", "to [s]", "begins at u, v [px]", "x, y, z [mm]",
                       "near", "u [px]", "v [px]", "largest, in what chance does"});
  for (std::size_t which = 0; which < result.where.size(); ++which) {
    for (std::size_t k = 0; k < std::min<std::size_t>(8, result.where[which].size()); ++k) {
      const decant::Disagreement& each = result.where[which][k];
      std::string at = "-", near = "-";
      if (const NamedPlace* place = detail::place_at(places, which, k)) {
        const decant::Vector3<double> mm = 1e3 * place->seen.place;
        at = fixed_text(mm.x(), 0) + ", " + fixed_text(mm.y(), 0) + ", " + fixed_text(mm.z(), 0);
        near = fixed_text(1e3 * place->seen.distance, 0) + " mm from the " + place->body;
      }
      table.add({recordings.at(which), std::to_string(each.camera), each.unexpected ? "unexpected" : "missing",
                 fixed_text(each.begin, 2), fixed_text(each.end, 2),
                 fixed_text(each.onset_u, 0) + ", " + fixed_text(each.onset_v, 0), at, near,
                 std::to_string(each.box.u_begin) + " .. " + std::to_string(each.box.u_end),
                 std::to_string(each.box.v_begin) + " .. " + std::to_string(each.box.v_end),
                 fixed_text(each.largest, 1)});
    }
  }
  return table;
}

/// All of them.
inline nlohmann::json where_json(const std::vector<std::string>& recordings, const decant::MissingEffect& result,
                                 const NamedPlaces& places) {
  nlohmann::json json = nlohmann::json::array();
  for (std::size_t which = 0; which < result.where.size(); ++which) {
    for (std::size_t k = 0; k < result.where[which].size(); ++k) {
      const decant::Disagreement& each = result.where[which][k];
      json.push_back({{"recording", recordings.at(which)},
                      {"camera", each.camera},
                      {"liquid", each.unexpected ? "unexpected" : "missing"},
                      {"from_s", each.begin},
                      {"to_s", each.end},
                      {"onset_px", {each.onset_u, each.onset_v}},
                      {"box_px", {each.box.u_begin, each.box.v_begin, each.box.u_end, each.box.v_end}},
                      {"weight", number_json(each.weight)},
                      {"largest", number_json(each.largest)}});
      if (const NamedPlace* place = detail::place_at(places, which, k)) {
        const decant::Vector3<double>& x = place->seen.place;
        json.back()["place"] = {x.x(), x.y(), x.z()};
        json.back()["near"] = place->body;
        json.back()["distance_m"] = place->seen.distance;
      }
    }
  }
  return json;
}

/// Whether there is a gap that is nowhere in particular.
inline bool is_diffuse(const decant::MissingEffect& result) {
  const auto empty = [](const auto& of) {
    return std::all_of(of.begin(), of.end(), [](const auto& each) { return each.empty(); });
  };
  return result.judgement.has_gap() && empty(result.where) && empty(result.where_read);
}

/// Throws std::runtime_error where a proposed interaction has another catalogue than what was learnt from: numbers of
/// effects would mean something else there.
inline void expect_same_effects(const std::vector<decant::Effect>& effects, const std::vector<decant::Effect>& proposed,
                                const std::string& name) {
  const bool same = std::equal(effects.begin(), effects.end(), proposed.begin(), proposed.end(),
                               [](const auto& a, const auto& b) { return a.name == b.name; });
  if (!same) {
    throw std::runtime_error(
        "--propose: " + name +
        ": expected bodies of the same number, roles and kinds as in the recordings to learn from");
  }
}

/// Which of some interactions to record next, the most telling one first.
inline decant::Table advice_table(const std::vector<std::string>& proposed,
                                  const std::vector<decant::InteractionAdvice>& advice) {
  using decant::detail::fixed_text;
  decant::Table table({"to record next", "is expected to tell [bit]", "+-", "and to settle it in [%]"});
  for (const decant::InteractionAdvice& each : advice) {
    table.add({proposed.at(each.which), fixed_text(each.gain, 2), fixed_text(each.deviation, 2),
               fixed_text(100 * each.settles, 0)});
  }
  return table;
}

inline nlohmann::json advice_json(const std::vector<std::string>& proposed,
                                  const std::vector<decant::InteractionAdvice>& advice) {
  nlohmann::json json = nlohmann::json::array();
  for (const decant::InteractionAdvice& each : advice) {
    json.push_back({{"recording", proposed.at(each.which)},
                    {"gain_bit", number_json(each.gain)},
                    {"deviation_bit", number_json(each.deviation)},
                    {"settles", number_json(each.settles)}});
  }
  return json;
}

}  // namespace example
