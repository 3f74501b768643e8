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
#include <decant/tracking/silhouette_cells.hpp>
#include <decant/tracking/tracker.hpp>

namespace decant::inline DECANT_TARGET {

/// Settings of HypothesisFilter.
struct HypothesisFilterSettings {
  int cell_px = 20;  ///< see SilhouetteCells, >= 1
  /// Standard deviation of a cell's share of liquid, if the hypothesis is right, > 0. By itself a cell in a frame is
  /// off by 0.1 to 0.2; but a jet that is a little off is so for some ten frames and across some cells, which count as
  /// one. With 1, amounts estimated in eight pours of twins were off by 1.3 times the deviation that was stated, and
  /// eight are few.
  double cell_deviation = 1.4;
  double least_probability = 1e-6;  ///< hypotheses below are given up, in [0, 1); 0: none
  Threads threads{};                ///< over which hypotheses are shared out
};

/// Runs a tracker for each hypothesis on the same frames and keeps their posterior probabilities. The evidence is in
/// what a tracker predicted before it was corrected by the frame,
///   log p = -sum over cells of (predicted - observed share)^2 / (2 deviation^2):
/// a strong corrector makes any hypothesis fit the mask that it has just seen. Frames in which no mask was believed say
/// nothing. Works with any corrector, OpenLoop among them, which is the paper's way (Schenck and Fox 2017, section
/// V-B).
template <class TrackerType>
class HypothesisFilter {
 public:
  using Tracker = TrackerType;
  using Settings = HypothesisFilterSettings;

  /// Throws std::invalid_argument if a setting is out of range.
  explicit HypothesisFilter(const Settings& settings = {}) : settings_(settings), cells_(settings.cell_px) {
    expects(settings.cell_deviation > 0 && std::isfinite(settings.cell_deviation), "HypothesisFilter: cell_deviation",
            "> 0", settings.cell_deviation);
    expects(settings.least_probability >= 0 && settings.least_probability < 1, "HypothesisFilter: least_probability",
            "in [0, 1)", settings.least_probability);
  }

  /// Adds a hypothesis. All trackers have the same cameras and bodies by number, and one time.
  /// @param log_prior logarithm of how probable it is before anything is seen, up to a constant that all share.
  /// @return its number, counting from 0.
  std::size_t add(Tracker tracker, double log_prior = 0) {
    expects(std::isfinite(log_prior), "HypothesisFilter: log_prior", "finite", log_prior);
    hypotheses_.push_back({std::move(tracker), {}, log_prior, 0, 0});
    return hypotheses_.size() - 1;
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
        hypothesis.log_evidence += log_evidence_of(frame, hypothesis);
      }
    });
    give_up();
    return hypotheses_[given_up(before) && !hypotheses_[before].report.advanced() ? best() : before].report;
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
    const Hypothesis& one = hypotheses_.at(hypothesis);
    return one.tracker ? one.log_posterior() : hypotheses_[best()].log_posterior() - one.behind;
  }

  /// Among all hypotheses, those given up having none.
  double probability(std::size_t hypothesis) const {
    if (given_up(hypothesis)) {
      return 0;
    }
    double total = 0;
    for (const Hypothesis& other : hypotheses_) {
      if (other.tracker) {
        total += std::exp(other.log_posterior() - hypotheses_[hypothesis].log_posterior());
      }
    }
    return 1 / total;
  }

  /// The most probable one; of equals the first.
  std::size_t best() const noexcept {
    std::size_t best = 0;
    for (std::size_t k = 1; k < hypotheses_.size(); ++k) {
      const Hypothesis &a = hypotheses_[k], &b = hypotheses_[best];
      if (a.tracker && (!b.tracker || a.log_posterior() > b.log_posterior())) {
        best = k;
      }
    }
    return best;
  }

  /// Throws std::invalid_argument for one that was given up.
  Tracker& tracker(std::size_t hypothesis) {
    expects(!given_up(hypothesis), "HypothesisFilter: hypothesis", "one that was not given up", hypothesis);
    return *hypotheses_[hypothesis].tracker;
  }

 private:
  struct Hypothesis {
    std::optional<Tracker> tracker;
    FrameReport report;
    double log_prior, log_evidence;
    double behind;  ///< the most probable one, when this one was given up [nat]

    double log_posterior() const noexcept { return log_prior + log_evidence; }
  };

  double log_evidence_of(const TrackerFrame& frame, const Hypothesis& hypothesis) const noexcept {
    if (!hypothesis.report.advanced()) {
      return 0;
    }
    double difference = 0;
    for (const CameraMask& mask : frame.masks) {
      if (hypothesis.tracker->believes(mask.camera)) {
        difference += cells_.squared_difference(hypothesis.tracker->predicted_before(mask.camera),
                                                hypothesis.tracker->observed(mask.camera));
      }
    }
    return -0.5 * difference / (settings_.cell_deviation * settings_.cell_deviation);
  }

  void give_up() noexcept {
    const auto failed = [](const Hypothesis& each) { return each.report.status == FrameStatus::ModelFailed; };
    const bool one_stands = std::any_of(hypotheses_.begin(), hypotheses_.end(),
                                        [&](const Hypothesis& each) { return each.tracker && !failed(each); });
    if (!one_stands) {
      return;
    }
    for (Hypothesis& each : hypotheses_) {
      if (each.tracker && failed(each)) {
        each.tracker.reset();
        each.behind = std::numeric_limits<double>::infinity();
      }
    }
    const double highest = hypotheses_[best()].log_posterior();
    for (Hypothesis& each : hypotheses_) {
      if (each.tracker && std::exp(each.log_posterior() - highest) < settings_.least_probability) {
        each.tracker.reset();
        each.behind = highest - each.log_posterior();
      }
    }
  }

  Settings settings_;
  SilhouetteCells cells_;
  std::vector<Hypothesis> hypotheses_{};
};

}  // namespace decant::inline DECANT_TARGET
