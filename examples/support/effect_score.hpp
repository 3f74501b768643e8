// SPDX-License-Identifier: MIT
#pragma once

/// How an answer to what is hidden is scored: whether it is right, and how near strengths are.

#include <algorithm>
#include <cstddef>
#include <limits>
#include <map>
#include <set>
#include <string>

#include <nlohmann/json.hpp>

#include <decant/discovery/effect_judgement.hpp>

#include "effect_cases.hpp"
#include "experiment_report.hpp"

namespace example {

/// How an answer is to be taken.
enum class AnswerScore {
  Right,    ///< what is hidden is named, or rightly nothing; an error of measurement may be taken account of unnamed
  Wrong,    ///< something is named that is not there
  Half,     ///< one of two that are hidden is named, and nothing else
  OneOf,    ///< what is hidden is among those that are not told apart
  Missed,   ///< nothing is said to be missing
  Abstains  ///< there is a gap that nothing explains: right where something outside of the catalogue is hidden
};

namespace detail {

/// Effects that count as one name.
inline std::string family_of(const std::string& name) {
  static const std::map<std::string, std::string> families{{"drag_linear", "drag"},
                                                           {"drag_quadratic", "drag"},
                                                           {"shear_thinning", "viscosity"},
                                                           {"camera_shift", "camera"},
                                                           {"camera_roll", "camera"}};
  const auto found = families.find(name);
  return found == families.end() ? name : found->second;
}

inline bool is_measurement(const std::string& family) {
  static const std::set<std::string> errors{"fill", "latency", "body_pose", "camera", "mask_bias"};
  return errors.contains(family);
}

}  // namespace detail

/// What came of a case, and how it is scored against the truth. What it points to outlives it.
struct EffectScore {
  std::string name, kind;  ///< of the case
  std::size_t scenario = 0;
  const nlohmann::json* result = nullptr;    ///< as EffectExperiment::result
  const nlohmann::json* followed = nullptr;  ///< as EffectExperiment::followed

  std::string verdict() const { return result->at("verdict"); }
  /// Families of what is hidden, "nothing" among them.
  std::set<std::string> truths() const {
    const nlohmann::json& truth = result->at("truth");
    std::set<std::string> names{truth.at("family")};
    if (truth.contains("second")) {
      names.insert(truth.at("second").at("family"));
    }
    return names;
  }
  std::string truth() const { return joined(truths(), " + "); }
  std::string role() const { return result->at("truth").at("role"); }
  /// Families of what is answered, each once.
  std::set<std::string> families() const {
    std::set<std::string> names;
    for (const auto& effect : result->at("effect")) {
      names.insert(detail::family_of(effect));
    }
    return names;
  }
  /// In one word or several.
  std::string answer() const {
    if (verdict() == "nothing" || verdict() == "unexplained") {
      return verdict();
    }
    return joined(families(), verdict() == "one_of" ? " or " : " + ");
  }
  /// Whether physics is blamed: something is named that is no error of measurement.
  bool blames_physics() const {
    const auto names = families();
    return (verdict() == "named" || verdict() == "one_of") &&
           std::any_of(names.begin(), names.end(), [](const auto& family) { return !detail::is_measurement(family); });
  }

  AnswerScore score() const {
    const std::set<std::string> names = families();
    if (verdict() == "unexplained") {
      return role() == "outside" ? AnswerScore::Right : AnswerScore::Abstains;
    }
    if (verdict() == "nothing") {
      return role() == "nothing" || role() == "measurement" ? AnswerScore::Right : AnswerScore::Missed;
    }
    const std::set<std::string> hidden = truths();
    if (verdict() == "one_of") {
      const bool among =
          std::any_of(hidden.begin(), hidden.end(), [&](const auto& each) { return names.contains(each); });
      return among ? AnswerScore::OneOf : AnswerScore::Wrong;
    }
    return names == hidden                                                           ? AnswerScore::Right
           : std::includes(hidden.begin(), hidden.end(), names.begin(), names.end()) ? AnswerScore::Half
                                                                                     : AnswerScore::Wrong;
  }
  /// Whether more is left than where nothing is missing.
  bool leaves_a_gap() const { return gap("after") > gap("largest_by_chance"); }

  /// The strength that is found over the hidden one, where the very effect is named and has one number; else NaN.
  double strength_ratio() const {
    return comparable() ? detail::number_at(*result, "/strength") / strength_in_model()
                        : std::numeric_limits<double>::quiet_NaN();
  }
  bool interval_holds() const {
    const double strength = strength_in_model();
    return detail::number_at(*result, "/interval_90/0") <= strength &&
           strength <= detail::number_at(*result, "/interval_90/1");
  }
  bool comparable() const {
    const std::string hidden = result->at("truth").at("effect");
    return verdict() == "named" && result->at("effect").size() == 1 && result->at("effect").front() == hidden &&
           hidden != "shear_thinning" &&  // that of the catalogue thins otherwise
           result->at("strength").is_number();
  }
  double gap(const char* key) const { return detail::number_at(*result, std::string("/gap/") + key); }
  /// Of what is reducible of the gap of the pour that was not used.
  double held_out_share() const {
    return decant::share_of_reducible(gap("held_out_before"), gap("held_out_after"), gap("held_out_noise"),
                                      gap("held_out_after"));
  }

 private:
  static std::string joined(const std::set<std::string>& names, const char* between) {
    std::string text;
    for (const std::string& each : names) {
      text += text.empty() ? "" : between;
      text += each;
    }
    return text;
  }

  /// In the catalogue's unit and from its zero, as what is hidden is said in a case's own. A wall acts on a layer of
  /// particles the stronger the thinner that is, see spacing_of_strengths.
  double strength_in_model() const {
    const nlohmann::json& truth = result->at("truth");
    const double strength = detail::number_at(truth, "/strength");
    const double layers = 1e3 * spacing_of_strengths / detail::number_at(*result, "/settings/model_spacing_mm");
    const std::string effect = truth.at("effect");
    return effect == "gravity"         ? 9.81 * (1 + strength)
           : effect == "fill"          ? 1 + strength
           : effect == "wall_friction" ? layers * strength
           : effect == "wall_adhesion" ? layers * layers * strength
           : effect == "inlet_flow"    ? 1 - strength
           : effect == "back_pressure" ? 0.5 * strength  // the mean of beats that are as strong at most
           : effect == "obstacle"      ? (truth.at("unit") == "mm" ? 1e-3 : 1.0) * strength
                                       : strength;
  }
};

}  // namespace example
