// SPDX-License-Identifier: MIT
#pragma once

/// Fits properties of a liquid to recordings of pours, by the best-first search of Schenck and Fox (2017) and by a
/// search for which each run counts, and scores them on recordings that were not used.

#include <algorithm>
#include <cstddef>
#include <functional>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/core/expects.hpp>
#include <decant/hypothesis/best_first_search.hpp>
#include <decant/hypothesis/evaluation.hpp>
#include <decant/hypothesis/parameter_axis.hpp>
#include <decant/hypothesis/parameter_estimate.hpp>
#include <decant/hypothesis/surrogate_search.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/journal.hpp>

#include "liquid_run.hpp"
#include "result_file.hpp"
#include "sweep_executor.hpp"
#include "three_digits.hpp"

namespace example {

/// Runs of one set of recordings; none is made twice.
class LiquidRuns {
 public:
  using Point = std::vector<double>;

  /// @param executor must live as long, and so must journal, where there is one: it has what ran before.
  /// @param told is told each run as it ends, in the first process.
  LiquidRuns(std::vector<LiquidRecording> recordings, std::vector<decant::ParameterAxis> axes, SweepExecutor& executor,
             decant::Journal* journal, std::function<void()> told)
      : recordings_(std::move(recordings)),
        axes_(std::move(axes)),
        executor_(&executor),
        journal_(journal),
        told_(std::move(told)) {}

  std::size_t size() const noexcept { return recordings_.size(); }
  const LiquidRecording& recording(std::size_t number) const { return recordings_.at(number); }

  /// For searches: the misfits of all recordings together, then the numbers of each (see LiquidScore). Infinite where
  /// one of them could not be followed to its end.
  std::vector<decant::JobResult> operator()(const std::vector<Point>& points) {
    std::vector<Point> missing;
    for (const Point& point : points) {
      if (!known_.contains(point) && std::find(missing.begin(), missing.end(), point) == missing.end()) {
        missing.push_back(point);
      }
    }
    std::vector<std::string> keys;
    for (const Point& point : missing) {
      for (const LiquidRecording& recording : recordings_) {
        keys.push_back(key(recording, point));
      }
    }
    const std::vector<decant::JobResult> scores = run(
        keys, [&](std::size_t job) { return recordings_[job % size()].run(axes_, missing[job / size()]).numbers(); });
    for (std::size_t k = 0; k < missing.size(); ++k) {
      decant::JobResult total{0};
      for (std::size_t which = 0; which < size(); ++which) {
        const decant::JobResult& one = scores[k * size() + which];
        total.front() += one.front();
        total.insert(total.end(), one.begin(), one.end());
      }
      known_[missing[k]] = std::move(total);
    }
    std::vector<decant::JobResult> results;
    for (const Point& point : points) {
      results.push_back(known_.at(point));
    }
    return results;
  }

  /// Each recording under these values.
  std::vector<LiquidScore> scores(const Point& point) {
    const decant::JobResult numbers = (*this)({point}).front();
    std::vector<LiquidScore> result;
    for (auto begin = numbers.begin() + 1; begin != numbers.end(); begin += LiquidScore::count) {
      result.push_back(LiquidScore::from({begin, begin + LiquidScore::count}));
    }
    return result;
  }

 private:
  template <class Work>
  std::vector<decant::JobResult> run(const std::vector<std::string>& keys, const Work& work) {
    const auto done = [&](std::size_t, const decant::JobResult&) { told_(); };
    return journal_ != nullptr ? decant::run_journaled(*executor_, *journal_, keys, work, done)
                               : executor_->run(keys.size(), work, done);
  }

  // What a run depends on, beside the program and what is in the recording's files.
  std::string key(const LiquidRecording& recording, const Point& point) const {
    std::string text = recording.recording().folder.string() + " " +
                       decant::detail::number_text(1e3 * recording.options().spacing) + "mm";
    for (std::size_t axis = 0; axis < axes_.size(); ++axis) {
      text += " " + axes_[axis].name + "=" + decant::detail::bit_exact_text(point[axis]);
    }
    return text;
  }

  std::vector<LiquidRecording> recordings_;
  std::vector<decant::ParameterAxis> axes_;
  SweepExecutor* executor_;
  decant::Journal* journal_;
  std::function<void()> told_;
  std::map<Point, decant::JobResult> known_{};
};

struct LiquidFitOptions {
  std::vector<std::string> parameters{"viscosity"};  ///< of liquid_parameters, each once
  bool best_first = false, surrogate = true;         ///< which searches are made; both: the surrogate's fit counts
  int most_evaluations = 40;                         ///< of each search
  decant::ParameterEstimateSettings estimate{};
};

/// A search, and what is known after it.
struct LiquidSearch {
  std::string name;
  std::vector<decant::Evaluation> evaluations{};
  std::size_t best = 0;
  decant::SearchEnd end = decant::SearchEnd::NothingWorks;
  std::vector<decant::ParameterEstimate> parameters{};  ///< none if nothing works
};

/// Mean intersection over union of predictions, and misfits together, with two liquids.
struct LiquidGain {
  std::vector<std::string> recordings{};
  std::vector<LiquidScore> before{}, after{};

  static double mean_iou(const std::vector<LiquidScore>& scores) {
    double total = 0;
    for (const LiquidScore& score : scores) {
      total += score.iou;
    }
    return scores.empty() ? std::numeric_limits<double>::quiet_NaN() : total / static_cast<double>(scores.size());
  }
  static double misfit(const std::vector<LiquidScore>& scores) {
    double total = 0;
    for (const LiquidScore& score : scores) {
      total += score.misfit.squared;
    }
    return total;
  }
};

struct LiquidFit {
  std::vector<decant::ParameterAxis> axes{};
  std::vector<LiquidSearch> searches{};  ///< the last one's fit counts
  std::vector<double> assumed{};         ///< what the first recording says
  std::vector<double> fitted{};          ///< empty if nothing works
  LiquidGain learn{}, held_out{};

  const LiquidSearch& search() const { return searches.back(); }
  bool works() const { return !fitted.empty(); }
};

/// Axes of the parameters by name, as LiquidRuns wants them. Throws std::invalid_argument for one that there is not, or
/// that is named twice.
inline std::vector<decant::ParameterAxis> axes_of(const std::vector<std::string>& parameters) {
  std::vector<decant::ParameterAxis> axes;
  for (const std::string& name : parameters) {
    const bool twice =
        std::any_of(axes.begin(), axes.end(), [&](const decant::ParameterAxis& other) { return other.name == name; });
    decant::expects(!twice, "fit_liquid: parameter", "named once", name);
    axes.push_back(liquid_parameter(name));
  }
  return axes;
}

/// @param learn recordings that the liquid is fitted to, at least one. @param held_out others, for scoring alone.
inline LiquidFit fit_liquid(LiquidRuns& learn, LiquidRuns& held_out, const LiquidFitOptions& options) {
  LiquidFit fit;
  fit.axes = axes_of(options.parameters);
  decant::expects(learn.size() > 0, "fit_liquid: recordings to learn from", "at least one", learn.size());
  for (const decant::ParameterAxis& axis : fit.axes) {
    fit.assumed.push_back(learn.recording(0).assumed(axis.name));
  }
  if (options.best_first) {
    decant::BestFirstSettings settings;
    settings.most_evaluations = options.most_evaluations;
    auto found = decant::best_first_search(fit.axes, fit.assumed, learn, settings);
    LiquidSearch& search = fit.searches.emplace_back(LiquidSearch{"best_first"});
    search.parameters = decant::estimate_parameters(fit.axes, found.evaluations, options.estimate);
    search.evaluations = std::move(found.evaluations);
    search.best = found.best;
    search.end = found.end;
  }
  if (options.surrogate) {
    decant::SurrogateSearchSettings settings;
    settings.estimate = options.estimate;
    settings.most_evaluations = options.most_evaluations;
    auto found = decant::surrogate_search(fit.axes, learn, settings);
    fit.searches.push_back(
        {"surrogate", std::move(found.evaluations), found.best, found.end, std::move(found.parameters)});
  }
  decant::expects(!fit.searches.empty(), "fit_liquid: searches", "at least one", "none");
  const LiquidSearch& search = fit.search();
  if (search.end == decant::SearchEnd::NothingWorks) {
    return fit;
  }
  // The best of single runs is as much the luckiest one: what all runs together say is better where there is enough.
  fit.fitted = search.evaluations[search.best].point;
  for (std::size_t axis = 0; axis < search.parameters.size(); ++axis) {
    fit.fitted[axis] = search.parameters[axis].value;
  }
  const auto gain = [&](LiquidRuns& runs, LiquidGain& result) {
    for (std::size_t k = 0; k < runs.size(); ++k) {
      result.recordings.push_back(runs.recording(k).recording().name);
    }
    if (runs.size() > 0) {
      result.before = runs.scores(fit.assumed);
      result.after = runs.scores(fit.fitted);
    }
  };
  gain(learn, fit.learn);
  gain(held_out, fit.held_out);
  return fit;
}

inline std::string to_string(decant::SearchEnd end) {
  return end == decant::SearchEnd::Found ? "found" : end == decant::SearchEnd::Budget ? "budget" : "nothing works";
}

/// What is known of a parameter, in words.
inline std::string sentence(const decant::ParameterAxis& axis, const decant::ParameterEstimate& estimate) {
  const auto text = three_digits;
  const std::string range = text(axis.low) + " .. " + text(axis.high) + " " + axis.unit;
  if (estimate.at_low && estimate.at_high) {
    return axis.name + ": cannot be told from these recordings; anything within " + range + " fits as well";
  }
  if (estimate.at_low || estimate.at_high) {
    return axis.name + ": " + (estimate.at_low ? "at most " + text(estimate.high) : "at least " + text(estimate.low)) +
           " " + axis.unit + " (90 %); values " + (estimate.at_low ? "below" : "above") + " are not told apart";
  }
  return axis.name + ": " + text(estimate.value) + " " + axis.unit + " (90 %: " + text(estimate.low) + " .. " +
         text(estimate.high) + ")";
}

namespace detail {

inline nlohmann::json gain_json(const LiquidGain& gain) {
  nlohmann::json json = {{"before", number_json(LiquidGain::mean_iou(gain.before))},
                         {"after", number_json(LiquidGain::mean_iou(gain.after))},
                         {"misfit_before", number_json(LiquidGain::misfit(gain.before))},
                         {"misfit_after", number_json(LiquidGain::misfit(gain.after))}};
  for (std::size_t k = 0; k < gain.before.size(); ++k) {
    json["recordings"].push_back({{"recording", gain.recordings[k]},
                                  {"before", number_json(gain.before[k].iou)},
                                  {"after", number_json(gain.after[k].iou)}});
  }
  return json;
}

inline nlohmann::json parameters_json(const LiquidFit& fit, const LiquidSearch& search) {
  nlohmann::json json;
  for (std::size_t axis = 0; axis < search.parameters.size(); ++axis) {
    const decant::ParameterEstimate& estimate = search.parameters[axis];
    json[fit.axes[axis].name] = {{"value", estimate.value},       {"interval_90", {estimate.low, estimate.high}},
                                 {"unit", fit.axes[axis].unit},   {"told", estimate.told()},
                                 {"at_low_end", estimate.at_low}, {"at_high_end", estimate.at_high},
                                 {"assumed", fit.assumed[axis]}};
  }
  return json;
}

}  // namespace detail

inline nlohmann::json liquid_fit_json(const LiquidFit& fit) {
  nlohmann::json json;
  json["status"] = fit.works() ? "ok" : "no run could be followed to its end";
  json["method"] = fit.search().name;
  json["parameters"] = detail::parameters_json(fit, fit.search());
  for (const LiquidSearch& search : fit.searches) {
    json["evaluations"][search.name] = search.evaluations.size();
    nlohmann::json& details = json["searches"][search.name];
    details["end"] = to_string(search.end);
    details["parameters"] = detail::parameters_json(fit, search);
    for (std::size_t axis = 0; axis < fit.axes.size(); ++axis) {
      details["best"][fit.axes[axis].name] = search.evaluations[search.best].point[axis];
    }
    for (const decant::Evaluation& one : search.evaluations) {
      nlohmann::json entry = {{"misfit", number_json(one.misfit())}};
      for (std::size_t axis = 0; axis < fit.axes.size(); ++axis) {
        entry[fit.axes[axis].name] = one.point[axis];
      }
      details["evaluations"].push_back(std::move(entry));
    }
  }
  json["learn"] = detail::gain_json(fit.learn);
  json["held_out"] = detail::gain_json(fit.held_out);
  return json;
}

}  // namespace example
