// SPDX-License-Identifier: MIT
#pragma once

/// Recordings with the models that predict them, and runs of these on an executor.

#include <algorithm>
#include <cstddef>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/effect_dictionary.hpp>
#include <decant/discovery/forward_model.hpp>
#include <decant/discovery/observation.hpp>
#include <decant/hypothesis/executor.hpp>

namespace decant::inline DECANT_TARGET {

/// A recording and the model that predicts it.
template <ForwardModel Model>
struct Interaction {
  std::string name{};
  const Model* model = nullptr;  ///< has to outlive the workflow
  Observation recording{};
  std::string
      of_model{};  ///< all that the model's predictions depend on, for RunJobs' keys; the name where it is empty
  EffectNumbers numbers{};  ///< of a search's effects in the model
};

/// Runs jobs: work(k) for each key, results in the order of the keys. A key says all that a result depends on beside
/// the model, so that a journal can look results up.
using RunJobs = std::function<std::vector<JobResult>(const std::vector<std::string>& keys,
                                                     const std::function<JobResult(std::size_t)>& work)>;

/// @param executor has to outlive what is returned.
template <Executor ExecutorType, class Done = decltype(tell_nobody)>
RunJobs run_jobs_on(ExecutorType& executor, Done done = tell_nobody) {
  return [&executor, done](const std::vector<std::string>& keys, const std::function<JobResult(std::size_t)>& work) {
    return executor.run(keys.size(), work, done);
  };
}

/// Runs models side by side, as numbers that a journal can keep.
template <ForwardModel Model>
class InteractionRuns {
 public:
  using Run = std::pair<const Interaction<Model>*, ModelRun>;

  explicit InteractionRuns(RunJobs run_jobs) : run_jobs_(std::move(run_jobs)) {}

  /// From now on all runs have an effect, if their model knows of it, that are not asked to have it at some strength.
  /// @param effect which one, by its words.
  void surround(const Effect& effect, AppliedEffect as) { always_.emplace_back(effect.words(), std::move(as)); }

  /// Runs of several interactions, in their order; those that failed are empty. Where all that is tolerated is drawn,
  /// what sensors err by is, too.
  std::vector<Observation> operator()(const std::vector<Run>& runs) {
    std::vector<std::string> keys;
    std::vector<ModelRun> own;
    std::vector<std::size_t> job_of, first;  // equal runs are made once
    std::map<std::string, std::size_t> number;
    for (std::size_t k = 0; k < runs.size(); ++k) {
      const Interaction<Model>& of = *runs[k].first;
      std::string key = of.of_model.empty() ? of.name : of.of_model;
      own.push_back(surrounded(of, runs[k].second));
      key += ": " + run_key(of.model->effects(), own.back());
      const auto [place, is_new] = number.try_emplace(key, keys.size());
      if (is_new) {
        keys.push_back(std::move(key));
        first.push_back(k);
      }
      job_of.push_back(place->second);
    }
    const std::vector<JobResult> results = run_jobs_(keys, [&](std::size_t job) {
      return Observation(runs[first[job]].first->model->predict(own[first[job]])).numbers();
    });
    made_ += keys.size();
    std::vector<Observation> seen;
    for (std::size_t k = 0; k < runs.size(); ++k) {
      const auto& [interaction, run] = runs[k];
      Observation predicted = interaction->recording.with_numbers(results.at(job_of[k]));
      if (!predicted.covers(interaction->recording)) {
        predicted = {};
      }
      seen.push_back(run.tolerated ? predicted.with_errors(run.seed) : std::move(predicted));
    }
    return seen;
  }

  std::size_t made() const noexcept { return made_; }  ///< of different runs, in all calls together

 private:
  /// A run as its model is asked for it.
  ModelRun surrounded(const Interaction<Model>& of, const ModelRun& run) const {
    ModelRun own = of.numbers.in_model(run);
    const std::vector<Effect>& effects = of.model->effects();
    for (const auto& [words, as] : always_) {
      const auto known = std::find_if(effects.begin(), effects.end(),
                                      [&words = words](const Effect& each) { return each.words() == words; });
      const auto number = static_cast<std::size_t>(known - effects.begin());
      const bool is_asked_for = std::any_of(own.effects.begin(), own.effects.end(),
                                            [&](const AppliedEffect& each) { return each.effect == number; });
      if (known != effects.end() && !is_asked_for) {
        own.effects.push_back(as);
        own.effects.back().effect = number;
      }
    }
    return own;
  }

  RunJobs run_jobs_;
  std::vector<std::pair<std::string, AppliedEffect>> always_{};
  std::size_t made_ = 0;
};

}  // namespace decant::inline DECANT_TARGET
