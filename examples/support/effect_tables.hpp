// SPDX-License-Identifier: MIT
#pragma once

/// The scores of the experiment with hidden effects, for terminals, scripts and browsers.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/io/detail/text.hpp>

#include "effect_score.hpp"
#include "experiment_report.hpp"
#include "json_result.hpp"
#include "three_digits.hpp"

namespace example {

namespace detail {

/// Of a share, at 95 % (Wilson 1927), in per cent.
inline std::string share_interval(std::size_t count, std::size_t of) {
  const double z = 1.96, n = static_cast<double>(of), p = static_cast<double>(count) / n;
  const double middle = (p + z * z / (2 * n)) / (1 + z * z / n);
  const double half = z / (1 + z * z / n) * std::sqrt(p * (1 - p) / n + z * z / (4 * n * n));
  return decant::detail::fixed_text(100 * std::max(0.0, middle - half), 0) + " .. " +
         decant::detail::fixed_text(100 * std::min(1.0, middle + half), 0);
}

inline ExperimentSection answers_by_kind(const std::vector<EffectScore>& scores) {
  ExperimentSection section{
      "Answers", decant::Table({"hidden", "cases", "right", "right [%]", "95 % of that [%]", "wrong", "one of two",
                                "one of", "missed", "unexplained", "physics blamed"})};
  std::vector<std::string> kinds;
  for (const EffectScore& each : scores) {
    if (std::find(kinds.begin(), kinds.end(), each.kind) == kinds.end()) {
      kinds.push_back(each.kind);
    }
  }
  const std::vector<std::pair<std::string, AnswerScore>> shown{
      {"right", AnswerScore::Right},          {"one of two", AnswerScore::Half}, {"one of several", AnswerScore::OneOf},
      {"unexplained", AnswerScore::Abstains}, {"missed", AnswerScore::Missed},   {"wrong", AnswerScore::Wrong}};
  section.bars = decant::BarChart{"Answers by what is hidden", "", "of the cases [%]", kinds, {}, {100}};
  for (const auto& [name, score] : shown) {
    section.bars->bars.push_back({name, {}});
  }
  for (const std::string& kind : kinds) {
    std::map<AnswerScore, std::size_t> count;
    std::size_t all = 0, physics = 0;
    for (const EffectScore& each : scores) {
      if (each.kind == kind) {
        ++all;
        ++count[each.score()];
        physics += each.blames_physics() ? 1 : 0;
      }
    }
    for (std::size_t k = 0; k < shown.size(); ++k) {
      section.bars->bars[k].heights.push_back(100.0 * static_cast<double>(count[shown[k].second]) /
                                              static_cast<double>(all));
    }
    const auto text = [&](AnswerScore score) { return std::to_string(count[score]); };
    section.table.add({kind, std::to_string(all), text(AnswerScore::Right),
                       percent_text(static_cast<double>(count[AnswerScore::Right]) / static_cast<double>(all), 0),
                       share_interval(count[AnswerScore::Right], all), text(AnswerScore::Wrong),
                       text(AnswerScore::Half), text(AnswerScore::OneOf), text(AnswerScore::Missed),
                       text(AnswerScore::Abstains), std::to_string(physics)});
    section.json[kind] = {{"cases", all},
                          {"right", count[AnswerScore::Right]},
                          {"wrong", count[AnswerScore::Wrong]},
                          {"one_of_two", count[AnswerScore::Half]},
                          {"one_of", count[AnswerScore::OneOf]},
                          {"missed", count[AnswerScore::Missed]},
                          {"unexplained", count[AnswerScore::Abstains]},
                          {"physics_blamed", physics}};
  }
  return section;
}

/// What is hidden by what is answered.
inline ExperimentSection confusion(const std::vector<EffectScore>& scores) {
  std::map<std::string, std::map<std::string, int>> count;
  std::set<std::string> answers;
  for (const EffectScore& each : scores) {
    ++count[each.role() == "outside" ? "outside: " + each.result->at("truth").at("effect").get<std::string>()
                                     : each.truth()][each.answer()];
    answers.insert(each.answer());
  }
  std::vector<std::string> header{"hidden \\ answered"};
  header.insert(header.end(), answers.begin(), answers.end());
  ExperimentSection section{"What is answered, by what is hidden", decant::Table(header)};
  for (const auto& [hidden, by_answer] : count) {
    std::vector<std::string> row{hidden};
    for (const std::string& answer : answers) {
      const auto found = by_answer.find(answer);
      row.push_back(found == by_answer.end() ? "" : std::to_string(found->second));
    }
    section.table.add(row);
  }
  return section;
}

inline ExperimentSection strengths_and_held_out(const std::vector<EffectScore>& scores) {
  ExperimentSection section{"Strengths, and the pour that was not used",
                            decant::Table({"figure", "value", "of cases"})};
  std::vector<double> off, share;
  std::size_t held = 0, confirmed = 0, refuted = 0, not_testable = 0, right = 0, better = 0, rivals = 0, wrong = 0,
              caught = 0;
  for (const EffectScore& each : scores) {
    if (std::isfinite(each.strength_ratio())) {
      off.push_back(std::abs(each.strength_ratio() - 1));
      held += each.interval_holds() ? 1 : 0;
    }
    const nlohmann::json& confirmation = each.result->at("confirmed");
    if (each.score() == AnswerScore::Right && each.verdict() == "named") {
      ++right;
      confirmed += confirmation == true ? 1 : 0;
      refuted += confirmation == false ? 1 : 0;
      not_testable += confirmation == "not_testable" ? 1 : 0;
      if (confirmation.is_boolean()) {
        share.push_back(each.held_out_share());
        if (std::isfinite(each.gap("best_rival_held_out"))) {
          ++rivals;
          better += each.gap("held_out_after") < each.gap("best_rival_held_out") ? 1 : 0;
        }
      }
    }
    if (each.score() == AnswerScore::Wrong) {
      ++wrong;
      caught += confirmation == true ? 0 : 1;
    }
  }
  const auto add = [&](const char* figure, const std::string& value, std::size_t of) {
    section.table.add({figure, value, std::to_string(of)});
  };
  add("strength off by, median [%]", percent_text(median_of(off), 0), off.size());
  add("90 % interval holds the strength", std::to_string(held), off.size());
  add("rightly named: confirmed", std::to_string(confirmed), right);
  add("... not testable on the other pour", std::to_string(not_testable), right);
  add("... refuted", std::to_string(refuted), right);
  add("... gap of the other pour shrinks by, median [% of what is reducible]", percent_text(median_of(share), 0),
      share.size());
  add("... better than the best rival there", std::to_string(better), rivals);
  add("wrongly named: not confirmed", std::to_string(caught), wrong);
  section.json = {{"strengths", off.size()}, {"strength_off_by_median", number_json(median_of(off))},
                  {"interval_holds", held},  {"rightly_named", right},
                  {"confirmed", confirmed},  {"not_testable", not_testable},
                  {"refuted", refuted},      {"held_out_share_median", number_json(median_of(share))},
                  {"rivals", rivals},        {"better_than_rival", better},
                  {"wrongly_named", wrong},  {"caught", caught}};
  return section;
}

/// Of cases in which two effects are hidden, what becomes of the second one.
inline ExperimentSection two_at_once(const std::vector<EffectScore>& scores) {
  ExperimentSection section{"Two effects at once", decant::Table({"answer", "cases", "of them"})};
  std::size_t all = 0, both = 0, told = 0, silent = 0, unexplained = 0;
  for (const EffectScore& each : scores) {
    if (each.role() == "two") {
      ++all;
      both += each.score() == AnswerScore::Right ? 1 : 0;
      told += each.score() == AnswerScore::Half && each.leaves_a_gap() ? 1 : 0;
      silent += each.score() == AnswerScore::Half && !each.leaves_a_gap() ? 1 : 0;
      unexplained += each.score() == AnswerScore::Abstains ? 1 : 0;
    }
  }
  const auto add = [&](const char* answer, std::size_t count) {
    section.table.add({answer, std::to_string(count), std::to_string(all)});
  };
  add("both named", both);
  add("one named, and that more is left than where nothing is missing", told);
  add("one named, and what is left taken for noise", silent);
  add("unexplained", unexplained);
  section.json = {
      {"cases", all}, {"both", both}, {"one_and_rest_told", told}, {"one", silent}, {"unexplained", unexplained}};
  return section;
}

/// Where what no catalogue has begins to be seen, and where it is said to. What is everywhere at once begins nowhere.
inline ExperimentSection beginnings(const std::vector<EffectScore>& scores) {
  using decant::detail::fixed_text;
  ExperimentSection section{
      "Where what is outside the catalogue begins",
      decant::Table({"case", "hidden", "is seen from [s]", "at [px]", "said [s]", "at [px]", "off by [s]", "[px]"})};
  std::size_t cases = 0, near = 0;
  for (const EffectScore& each : scores) {
    const nlohmann::json& result = *each.result;
    const nlohmann::json& truth = result.at("truth");
    if (each.role() != "outside" || truth.value("place", "world") == "world" || !truth.contains("seen_first_s")) {
      continue;
    }
    const auto pixel = [](const nlohmann::json& json) {
      return json.is_array() ? fixed_text(json[0], 0) + ", " + fixed_text(json[1], 0) : std::string("-");
    };
    const double late = number_at(result, "/onset_s") - number_at(truth, "/seen_first_s");
    const double off = std::hypot(number_at(result, "/onset_px/0") - number_at(truth, "/seen_first_px/0"),
                                  number_at(result, "/onset_px/1") - number_at(truth, "/seen_first_px/1"));
    ++cases;
    near += std::abs(late) <= 0.3 && off <= 60 ? 1 : 0;
    section.table.add({each.name, truth.at("effect"), fixed_text(number_at(truth, "/seen_first_s"), 2),
                       pixel(truth.at("seen_first_px")), fixed_text(number_at(result, "/onset_s"), 2),
                       pixel(result.at("onset_px")), fixed_text(late, 2), fixed_text(off, 0)});
  }
  section.note = "Within 0.3 s and 60 pixels: " + std::to_string(near) + " of " + std::to_string(cases) +
                 ". Seen from: where clean masks of the same reality with and without it differ.";
  section.json = {{"cases", cases}, {"within_0.3_s_and_60_px", near}};
  return section;
}

/// Whether effects that answers name or leave open are hidden as often as they are said to be. Effects of a family are
/// one; an answer that nothing is missing or that a gap is unexplained says nothing of this kind.
inline ExperimentSection calibration(const std::vector<EffectScore>& scores) {
  constexpr std::array<double, 6> edges{0, 0.1, 0.5, 0.75, 0.9, 1};
  constexpr std::size_t bins = edges.size() - 1;
  std::array<double, bins> stated{}, true_ones{}, count{};
  double statements = 0;
  for (const EffectScore& each : scores) {
    if ((each.verdict() != "named" && each.verdict() != "one_of") || !each.result->contains("refined")) {
      continue;
    }
    std::map<std::string, double> said;
    for (const nlohmann::json& found : each.result->at("refined")) {
      // it is the answer's: each effect of one, and each place of one, has the same
      double& probability = said[family_of(found.at("effect"))];
      probability = std::max(probability, number_at(found, "/probability"));
    }
    for (const auto& [family, probability] : said) {
      if (!(probability > 0.01)) {
        continue;  // as good as certain, and as many as one likes
      }
      const auto above = std::upper_bound(edges.begin() + 1, edges.end() - 1, probability);
      const auto bin = static_cast<std::size_t>(above - edges.begin()) - 1;
      stated[bin] += probability;
      true_ones[bin] += each.truths().contains(family) ? 1 : 0;
      ++count[bin];
      ++statements;
    }
  }
  ExperimentSection section{"Stated probabilities that an effect is the hidden one",
                            decant::Table({"stated [%]", "statements", "mean of stated [%]", "true [%]"})};
  double off = 0;
  for (std::size_t bin = 0; bin < bins; ++bin) {
    off += std::abs(stated[bin] - true_ones[bin]);
    section.table.add({percent_text(edges[bin], 0) + " .. " + percent_text(edges[bin + 1], 0),
                       decant::detail::fixed_text(count[bin], 0), percent_text(stated[bin] / count[bin]),
                       percent_text(true_ones[bin] / count[bin])});
    section.json["bins"].push_back({{"from", edges[bin]},
                                    {"statements", count[bin]},
                                    {"stated", number_json(stated[bin] / count[bin])},
                                    {"true", number_json(true_ones[bin] / count[bin])}});
  }
  section.json["expected_calibration_error"] = number_json(off / statements);
  section.note = "Expected calibration error: " + percent_text(off / statements) + " % (Naeini et al. 2015).";
  return section;
}

/// What a further interaction leaves of several effects.
inline ExperimentSection advised(const std::vector<EffectScore>& scores) {
  using decant::detail::fixed_text;
  ExperimentSection section{"One more interaction where several effects are left",
                            decant::Table({"case", "hidden", "left", "advised", "expected [bit]", "answer then",
                                           "drawn by chance", "expected [bit]", "answer then"})};
  std::map<std::string, std::size_t> settled{{"after_advised", 0}, {"after_drawn", 0}}, misled = settled;
  std::size_t asked = 0;
  for (const EffectScore& each : scores) {
    const nlohmann::json* followed = each.followed;
    if (followed == nullptr || !followed->contains("after_advised")) {
      continue;
    }
    ++asked;
    std::string left;
    for (const auto& name : followed->at("left")) {
      left += (left.empty() ? "" : ", ") + name.get<std::string>();
    }
    std::vector<std::string> row{each.name, followed->at("after_advised").at("truth").at("effect"), left};
    for (const char* key : {"after_advised", "after_drawn"}) {
      const nlohmann::json& after = followed->at(key);
      const EffectScore score{each.name, each.kind, each.scenario, &after};
      settled[key] += score.verdict() == "named" && score.score() == AnswerScore::Right ? 1 : 0;
      misled[key] += score.verdict() == "named" && score.score() == AnswerScore::Wrong ? 1 : 0;
      row.insert(row.end(), {after.at("interaction"), fixed_text(number_at(after, "/gain_bit"), 2), score.answer()});
    }
    section.table.add(row);
  }
  const auto of = [&](const char* key) {
    return std::to_string(settled[key]) + " of " + std::to_string(asked) + " (a wrong one " +
           std::to_string(misled[key]) + " times)";
  };
  section.note = "One effect is left, the right one: " + of("after_advised") + " where advice was followed, " +
                 of("after_drawn") + " where chance chose.";
  section.json = {{"cases", asked},
                  {"settled_by_advice", settled["after_advised"]},
                  {"settled_by_chance", settled["after_drawn"]},
                  {"misled_by_advice", misled["after_advised"]},
                  {"misled_by_chance", misled["after_drawn"]}};
  return section;
}

inline ExperimentSection all_cases(const std::vector<EffectScore>& scores) {
  using decant::detail::fixed_text;
  ExperimentSection section{
      "Cases", decant::Table({"case", "scenario", "hidden", "strength", "answer", "strength found", "90 %", "gap",
                              "noise", "largest by chance", "after", "other pour", "after", "confirmed"})};
  for (const EffectScore& each : scores) {
    const nlohmann::json& result = *each.result;
    const nlohmann::json& truth = result.at("truth");
    std::string hidden = truth.at("effect");
    if (truth.contains("variant")) {
      hidden += ", ";
      hidden += truth.at("variant").get<std::string>();
    }
    if (truth.contains("second")) {
      hidden += " + ";
      hidden += truth.at("second").at("effect").get<std::string>();
    }
    std::string found = result.contains("strength") ? result.at("strength").dump() : "";
    std::string interval = result.contains("interval_90") ? result.at("interval_90").dump() : "";
    const nlohmann::json& confirmed = result.at("confirmed");
    section.table.add({each.name, std::to_string(each.scenario), hidden,
                       truth.contains("strength") ? three_digits(truth.at("strength").get<double>()) : "",
                       each.answer(), found, interval, fixed_text(each.gap("before"), 2),
                       fixed_text(each.gap("noise"), 2), fixed_text(each.gap("largest_by_chance"), 2),
                       fixed_text(each.gap("after"), 2), fixed_text(each.gap("held_out_before"), 2),
                       fixed_text(each.gap("held_out_after"), 2), confirmed.is_null() ? "" : confirmed.dump()});
  }
  return section;
}

}  // namespace detail

/// All of them, of one experiment's cases.
inline std::vector<ExperimentSection> effect_tables(const std::vector<EffectScore>& scores) {
  std::vector<ExperimentSection> sections{detail::answers_by_kind(scores), detail::confusion(scores),
                                          detail::strengths_and_held_out(scores)};
  const auto any = [&](auto is) { return std::any_of(scores.begin(), scores.end(), is); };
  if (any([](const EffectScore& each) { return each.role() == "outside"; })) {
    sections.push_back(detail::beginnings(scores));
  }
  if (any([](const EffectScore& each) { return each.role() == "two"; })) {
    sections.push_back(detail::two_at_once(scores));
  }
  if (any([](const EffectScore& each) { return each.followed != nullptr; })) {
    sections.push_back(detail::advised(scores));
  }
  sections.push_back(detail::calibration(scores));
  sections.push_back(detail::all_cases(scores));
  return sections;
}

}  // namespace example
