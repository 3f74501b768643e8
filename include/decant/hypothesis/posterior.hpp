// SPDX-License-Identifier: MIT
#pragma once

/// How probable each of several hypotheses is, by how far what it predicted was from what was measured, and how
/// probable it is that none of them is so.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/log_sum.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// How far a prediction was from what was measured, of one frame or added up over many: of cells of masks, of levels,
/// of anything that has one unit.
struct Misfit {
  double squared = 0;   ///< sum of squared differences
  double measured = 0;  ///< sum of squares of what was measured: what predicting nothing at all is off by

  Misfit& operator+=(const Misfit& other) noexcept {
    squared += other.squared;
    measured += other.measured;
    return *this;
  }
};

/// What the misfits of one source of evidence are worth: of the masks of all cameras, of the readings of a scale.
struct EvidenceSettings {
  double independent_errors = 20;  ///< see PosteriorSettings, > 0
  double least_squared = 5;        ///< see PosteriorSettings, > 0
  double hopeless_share = 0.6;     ///< see PosteriorSettings, in (0, 1]
};

/// The defaults are for masks, whose misfits are counted in cells (HypothesisFilter).
struct PosteriorSettings {
  /// How many independent errors a model makes in all, > 0. Differences in neighbouring cells and successive frames
  /// come from the same few errors (a pose, a delay, friction), so this is far below the number of cells, and does not
  /// grow with it.
  double independent_errors = 20;
  /// What a right prediction may be off by where next to nothing has been seen, in the unit of Misfit::squared, > 0.
  double least_squared = 5;
  /// A prediction that is off by more than this share of the liquid in play is worse than "none of these", in (0, 1].
  double hopeless_share = 0.6;
  /// Of "none of these" before anything is seen, in [0, 1); 0: one of the hypotheses is right.
  double none_prior = 0.05;
};

/// Hypotheses and their probabilities. How large errors of a right model are is not known beforehand (the model is
/// never right), so it is marginalised: with an inverse-gamma prior the likelihood of differences with the sum of
/// squares D is
///   log p = -(n / 2) log(1 + D / D_0),
/// which makes ratios of D count and not their sizes (Student's t; Gelman et al., Bayesian Data Analysis, 2013, section
/// 3.2), and cannot underflow however many frames there are. Where even the best prediction is far off, differences
/// between them say little.
///
/// Evidence may come from several sources, each with a unit and errors of its own: masks, a scale, a level probe. What
/// they say is multiplied, so that a source by which all predictions are far off says little, and takes nothing from
/// what the others say.
class Posterior {
 public:
  using Settings = PosteriorSettings;

  /// Throws std::invalid_argument if a setting is out of range.
  explicit Posterior(const Settings& settings = {}) : settings_(settings) {
    expects(settings.none_prior >= 0 && settings.none_prior < 1, "Posterior: none_prior", "in [0, 1)",
            settings.none_prior);
    add_source({settings.independent_errors, settings.least_squared, settings.hopeless_share});
  }

  /// Adds a source of evidence to the one, 0, that the settings are about; before hypotheses. Throws
  /// std::invalid_argument if a setting is out of range, or if there are hypotheses.
  /// @return its number.
  std::size_t add_source(const EvidenceSettings& settings) {
    expects(hypotheses_.empty(), "Posterior: hypotheses before a source is added", "none", hypotheses_.size());
    sources_.emplace_back();
    set_source(sources_.size() - 1, settings);
    return sources_.size() - 1;
  }
  /// What all misfits of a source are worth from now on, those that are in included: readings that come one by one are
  /// worth more the more there are (SeriesMisfit::evidence). Throws as add_source does.
  void set_source(std::size_t source, const EvidenceSettings& settings) {
    expects(settings.independent_errors > 0 && std::isfinite(settings.independent_errors),
            "Posterior: independent_errors", "> 0", settings.independent_errors);
    expects(settings.least_squared > 0 && std::isfinite(settings.least_squared), "Posterior: least_squared", "> 0",
            settings.least_squared);
    expects(settings.hopeless_share > 0 && settings.hopeless_share <= 1, "Posterior: hopeless_share", "in (0, 1]",
            settings.hopeless_share);
    sources_.at(source) = settings;
  }

  /// @param log_prior logarithm of how probable it is before anything is seen, up to a constant that all share.
  /// @return its number, counting from 0.
  std::size_t add(double log_prior = 0) {
    expects(std::isfinite(log_prior), "Posterior: log_prior", "finite", log_prior);
    hypotheses_.push_back({log_prior, std::vector<Misfit>(sources_.size()), false});
    return hypotheses_.size() - 1;
  }

  /// Adds what one more frame or reading says. What is not finite excludes the hypothesis.
  void observe(std::size_t hypothesis, const Misfit& misfit, std::size_t source = 0) noexcept {
    Hypothesis& one = hypotheses_[hypothesis];
    Misfit& sum = one.misfits[source];
    sum += misfit;
    one.excluded = one.excluded || !std::isfinite(sum.squared) || !std::isfinite(sum.measured);
  }
  /// Gives a hypothesis no probability from now on.
  void exclude(std::size_t hypothesis) noexcept { hypotheses_[hypothesis].excluded = true; }

  std::size_t size() const noexcept { return hypotheses_.size(); }
  std::size_t sources() const noexcept { return sources_.size(); }
  /// What its misfits are worth.
  const EvidenceSettings& source(std::size_t number) const { return sources_.at(number); }
  bool excluded(std::size_t hypothesis) const { return hypotheses_.at(hypothesis).excluded; }
  const Misfit& misfit(std::size_t hypothesis, std::size_t source = 0) const {
    return hypotheses_.at(hypothesis).misfits.at(source);
  }

  /// Log likelihood of a source's sum of squared differences [nat], 0 for none.
  double log_likelihood(double squared, std::size_t source = 0) const noexcept {
    const EvidenceSettings& of = sources_[source];
    return -0.5 * of.independent_errors * std::log1p(squared / of.least_squared);
  }

  /// Prior and likelihood [nat], up to a constant that all share; -infinity for one that is excluded.
  double log_posterior(std::size_t hypothesis) const {
    const Hypothesis& one = hypotheses_.at(hypothesis);
    if (one.excluded) {
      return -std::numeric_limits<double>::infinity();
    }
    double sum = one.log_prior;
    for (std::size_t source = 0; source < sources_.size(); ++source) {
      sum += log_likelihood(one.misfits[source].squared, source);
    }
    return sum;
  }
  /// The same for "none of these": something else is so, which shows in one or more of the sources. By such a source it
  /// is taken to be off by hopeless_share of the liquid in play: of what was measured or, where hypotheses are off by
  /// more than all of that, of what they are off by on average (an empty container, beside one hypothesis that says so
  /// and others that predicted liquid). In the sources in which it does not show it predicts what one of the hypotheses
  /// does. Which sources it shows in is not known: all sets of them are as probable. -infinity if it has no prior.
  double log_posterior_of_none() const noexcept {
    if (settings_.none_prior == 0) {
      return -std::numeric_limits<double>::infinity();
    }
    constexpr double nothing = -std::numeric_limits<double>::infinity();
    std::vector<std::pair<std::size_t, double>> hopeless;  // sources that have measured something, what they then say
    for (std::size_t source = 0; source < sources_.size(); ++source) {
      if (const double of = in_play(source); of > 0) {
        hopeless.emplace_back(source, log_likelihood(sources_[source].hopeless_share * of, source));
      }
    }
    double sum = nothing;
    for (const Hypothesis& one : hypotheses_) {
      // over the sources so far: it shows in none of them, or in some
      double hidden = one.log_prior, shown = nothing;
      for (const auto& [source, here] : hopeless) {
        const double not_here = one.excluded ? nothing : log_likelihood(one.misfits[source].squared, source);
        shown = log_sum(shown + log_sum(here, not_here), hidden + here);
        hidden += not_here;
      }
      sum = log_sum(sum, hopeless.empty() ? hidden : shown);
    }
    if (!hopeless.empty()) {
      sum -= std::log(std::exp2(static_cast<double>(hopeless.size())) - 1);  // all sets of sources but the empty one
    }
    return std::log(settings_.none_prior / (1 - settings_.none_prior)) + sum;
  }

  double probability(std::size_t hypothesis) const {
    const double own = log_posterior(hypothesis);
    return std::isfinite(own) ? std::exp(own - log_of_all()) : 0;
  }
  /// 1 if all hypotheses are excluded, and "none of these" was allowed at all.
  double probability_of_none() const noexcept {
    const double own = log_posterior_of_none();
    return std::isfinite(own) ? std::exp(own - log_of_all()) : 0;
  }

  /// The most probable one; of equals the first. "None of these" does not count.
  std::size_t best() const noexcept {
    std::size_t best = 0;
    for (std::size_t k = 1; k < hypotheses_.size(); ++k) {
      if (log_posterior(k) > log_posterior(best)) {
        best = k;
      }
    }
    return best;
  }

  const Settings& settings() const noexcept { return settings_; }

 private:
  struct Hypothesis {
    double log_prior;
    std::vector<Misfit> misfits;  ///< by source
    bool excluded;
  };

  // One that was excluded has what it had until then, so that giving up hypotheses does not help "none of these".
  double in_play(std::size_t source) const noexcept {
    double measured = 0, total = 0;
    std::size_t count = 0;
    for (const Hypothesis& one : hypotheses_) {
      const Misfit& misfit = one.misfits[source];
      measured = std::max(measured, std::isfinite(misfit.measured) ? misfit.measured : 0.0);
    }
    for (const Hypothesis& one : hypotheses_) {
      const Misfit& misfit = one.misfits[source];
      if (std::isfinite(misfit.squared)) {
        total += std::max(measured, misfit.squared);
        ++count;
      }
    }
    return count > 0 ? total / static_cast<double>(count) : measured;
  }
  double log_of_all() const noexcept {
    double sum = log_posterior_of_none();
    for (std::size_t k = 0; k < hypotheses_.size(); ++k) {
      sum = log_sum(sum, log_posterior(k));
    }
    return sum;
  }

  Settings settings_;
  std::vector<EvidenceSettings> sources_{};
  std::vector<Hypothesis> hypotheses_{};
};

}  // namespace decant::inline DECANT_TARGET
