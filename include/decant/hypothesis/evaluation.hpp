// SPDX-License-Identifier: MIT
#pragma once

/// A model that was run with some values of its parameters, and how searches ask for such runs.

#include <concepts>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <decant/core/target.hpp>
#include <decant/hypothesis/executor.hpp>

namespace decant::inline DECANT_TARGET {

/// Values of parameters, one for each ParameterAxis of a search, and what came of them.
struct Evaluation {
  std::vector<double> point{};
  JobResult result{};  ///< the misfit first; whatever else is of interest after it

  /// How far the model was from what was measured, >= 0; infinity where it failed: no number, or one that is none.
  double misfit() const noexcept {
    return !result.empty() && result.front() >= 0 ? result.front() : std::numeric_limits<double>::infinity();
  }
};

/// What searches evaluate points with: evaluate(points) gives a result for each of the points, in their order. Which
/// points a search asks for, and in which order, follows from its settings and from the results it was given; so where
/// evaluate looks results up that it knows (a journal of a run that was killed), the search goes on where it was.
/// Law: a result depends on its point alone.
template <class E>
concept PointEvaluator = requires(E& evaluate, const std::vector<std::vector<double>>& points) {
  { evaluate(points) } -> std::same_as<std::vector<JobResult>>;
};

/// A PointEvaluator that runs work(point), which gives a JobResult, on an Executor. It refers to the executor, which
/// must live as long. @param done as of Executor::run, with the number of the point in its batch.
template <Executor ExecutorType, class Work, class Done = decltype(tell_nobody)>
auto evaluate_on(ExecutorType& executor, Work work, Done done = tell_nobody) {
  return [&executor, work = std::move(work), done = std::move(done)](const std::vector<std::vector<double>>& points) {
    return executor.run(
        points.size(), [&](std::size_t k) { return JobResult(work(points[k])); }, done);
  };
}

/// Why a search ended.
enum class SearchEnd {
  Found,        ///< what it looks for
  Budget,       ///< as many evaluations as it was allowed
  NothingWorks  ///< no evaluation, or too few of them, gave a misfit
};

namespace detail {

/// The lowest misfit; of equals the first. 0 if there is none.
inline std::size_t best_of(const std::vector<Evaluation>& evaluations) noexcept {
  std::size_t best = 0;
  for (std::size_t k = 1; k < evaluations.size(); ++k) {
    if (evaluations[k].misfit() < evaluations[best].misfit()) {
      best = k;
    }
  }
  return best;
}

/// Evaluates points and adds them.
template <class Evaluate>
void add_evaluations(const std::vector<std::vector<double>>& points, Evaluate& evaluate,
                     std::vector<Evaluation>& evaluations) {
  std::vector<JobResult> results = evaluate(points);
  for (std::size_t k = 0; k < points.size(); ++k) {
    evaluations.push_back({points[k], std::move(results.at(k))});
  }
}

}  // namespace detail

}  // namespace decant::inline DECANT_TARGET
