// SPDX-License-Identifier: MIT
#pragma once

/// Several trackers that believe different things, and what the masks say of each: which amount of liquid there was at
/// the beginning, which leg of a pipe is blocked.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/hypothesis/posterior.hpp>
#include <decant/tracking/silhouette_cells.hpp>
#include <decant/tracking/tracker.hpp>

namespace decant::inline DECANT_TARGET {

/// Settings of HypothesisFilter.
struct HypothesisFilterSettings {
  int cell_px = 20;  ///< see SilhouetteCells, >= 1; misfits are counted in cells
  PosteriorSettings posterior{};
  double least_probability = 1e-6;  ///< hypotheses below this share of the best one's are given up, in [0, 1); 0: none
  Threads threads{};                ///< over which hypotheses are shared out
};

/// Runs a tracker for each hypothesis on the same frames and keeps their posterior probabilities. The evidence is in
/// what a tracker predicted before it was corrected by the frame, the sum over cells of the squared difference between
/// the predicted and the observed share of liquid: a strong corrector makes any hypothesis fit the mask that it has
/// just seen. What such sums are worth is Posterior's to say. Frames in which no mask was believed say nothing. Works
/// with any corrector, OpenLoop among them (Schenck and Fox 2017, section V-B, has both).
template <class TrackerType>
class HypothesisFilter {
 public:
  using Tracker = TrackerType;
  using Settings = HypothesisFilterSettings;

  /// Throws std::invalid_argument if a setting is out of range.
  explicit HypothesisFilter(const Settings& settings = {})
      : settings_(settings), cells_(settings.cell_px), posterior_(settings.posterior) {
    expects(settings.least_probability >= 0 && settings.least_probability < 1, "HypothesisFilter: least_probability",
            "in [0, 1)", settings.least_probability);
  }

  /// Adds a source of evidence beside the masks, such as a scale (see series_misfit.hpp); before hypotheses. Throws as
  /// Posterior::add_source does. @return its number, for observe().
  std::size_t add_source(const EvidenceSettings& settings) { return posterior_.add_source(settings); }
  /// See Posterior::set_source.
  void set_source(std::size_t source, const EvidenceSettings& settings) { posterior_.set_source(source, settings); }

  /// Adds a hypothesis. All trackers have the same cameras and bodies by number, and one time.
  /// @param log_prior logarithm of how probable it is before anything is seen, up to a constant that all share.
  /// @return its number, counting from 0.
  std::size_t add(Tracker tracker, double log_prior = 0) {
    const std::size_t number = posterior_.add(log_prior);
    hypotheses_.push_back({std::move(tracker), {}, {}, 0});
    return number;
  }

  /// Takes all hypotheses to the frame's time. A hypothesis whose model fails is given up, as long as another one
  /// stands; then one that has become too improbable. Never throws; allocates where a tracker does.
  /// @return how the frame went under the hypothesis that was the most probable before it, or, if that one's model
  /// failed, under the one that is now.
  [[nodiscard]] FrameReport track(const TrackerFrame& frame) noexcept {
    if (hypotheses_.empty()) {
      FrameReport nothing;
      nothing.status = FrameStatus::BadInput;
      return nothing;
    }
    const std::size_t before = best();
    parallel_ranges(static_cast<Index>(hypotheses_.size()), settings_.threads, 1, [&](Index begin, Index) {
      Hypothesis& hypothesis = hypotheses_[static_cast<std::size_t>(begin)];
      if (hypothesis.tracker) {
        hypothesis.report = hypothesis.tracker->track(frame);
        hypothesis.misfit = misfit_of(frame, hypothesis);
      }
    });
    for (std::size_t k = 0; k < hypotheses_.size(); ++k) {
      if (hypotheses_[k].tracker) {
        posterior_.observe(k, hypotheses_[k].misfit);
      }
    }
    give_up();
    return hypotheses_[given_up(before) && !hypotheses_[before].report.advanced() ? best() : before].report;
  }

  /// Adds what another source says of a hypothesis, whose tracker's model has what it predicts; for one that was given
  /// up nothing. It counts from the next frame on when hypotheses are given up.
  void observe(std::size_t hypothesis, const Misfit& misfit, std::size_t source) noexcept {
    if (hypotheses_[hypothesis].tracker) {
      posterior_.observe(hypothesis, misfit, source);
    }
  }

  std::size_t size() const noexcept { return hypotheses_.size(); }
  std::size_t running() const noexcept {
    return static_cast<std::size_t>(std::count_if(hypotheses_.begin(), hypotheses_.end(),
                                                  [](const Hypothesis& each) { return each.tracker.has_value(); }));
  }
  /// How its last frame went.
  const FrameReport& report(std::size_t hypothesis) const { return hypotheses_.at(hypothesis).report; }
  bool given_up(std::size_t hypothesis) const { return !hypotheses_.at(hypothesis).tracker.has_value(); }

  /// Prior and evidence [nat], up to a constant that all share. One that was given up stays as far below the most
  /// probable one as it was then, which is at most what more frames would have left it; -infinity if its model failed.
  double log_posterior(std::size_t hypothesis) const {
    return given_up(hypothesis) ? posterior_.log_posterior(best()) - hypotheses_[hypothesis].behind
                                : posterior_.log_posterior(hypothesis);
  }

  /// Among all hypotheses and "none of these"; those given up have none.
  double probability(std::size_t hypothesis) const { return posterior_.probability(hypothesis); }
  double probability_of_none() const noexcept { return posterior_.probability_of_none(); }

  /// The most probable one; of equals the first. "None of these" does not count.
  std::size_t best() const noexcept { return posterior_.best(); }

  /// Misfits so far, and what they are worth.
  const Posterior& posterior() const noexcept { return posterior_; }

  /// Throws std::invalid_argument for one that was given up.
  Tracker& tracker(std::size_t hypothesis) {
    expects(!given_up(hypothesis), "HypothesisFilter: hypothesis", "one that was not given up", hypothesis);
    return *hypotheses_[hypothesis].tracker;
  }

 private:
  struct Hypothesis {
    std::optional<Tracker> tracker;
    FrameReport report;
    Misfit misfit;  ///< of the last frame
    double behind;  ///< the most probable one, when this one was given up [nat]
  };

  Misfit misfit_of(const TrackerFrame& frame, const Hypothesis& hypothesis) const noexcept {
    Misfit misfit;
    if (!hypothesis.report.advanced()) {
      return misfit;
    }
    for (const CameraMask& mask : frame.masks) {
      if (hypothesis.tracker->believes(mask.camera)) {
        const auto observed = cells_.shares(hypothesis.tracker->observed(mask.camera));
        const auto predicted = cells_.shares(hypothesis.tracker->predicted_before(mask.camera));
        misfit += {(predicted - observed).square().sum(), observed.square().sum()};
      }
    }
    return misfit;
  }

  void give_up() noexcept {
    const auto failed = [](const Hypothesis& each) { return each.report.status == FrameStatus::ModelFailed; };
    const bool one_stands = std::any_of(hypotheses_.begin(), hypotheses_.end(),
                                        [&](const Hypothesis& each) { return each.tracker && !failed(each); });
    if (!one_stands) {
      return;
    }
    const auto drop = [&](std::size_t k, double behind) {
      hypotheses_[k].tracker.reset();
      hypotheses_[k].behind = behind;
      posterior_.exclude(k);
    };
    for (std::size_t k = 0; k < hypotheses_.size(); ++k) {
      if (hypotheses_[k].tracker && failed(hypotheses_[k])) {
        drop(k, std::numeric_limits<double>::infinity());
      }
    }
    const double highest = posterior_.log_posterior(best());
    for (std::size_t k = 0; k < hypotheses_.size(); ++k) {
      const double behind = highest - posterior_.log_posterior(k);
      if (hypotheses_[k].tracker && std::exp(-behind) < settings_.least_probability) {
        drop(k, behind);
      }
    }
  }

  Settings settings_;
  SilhouetteCells cells_;
  Posterior posterior_;
  std::vector<Hypothesis> hypotheses_{};
};

}  // namespace decant::inline DECANT_TARGET
