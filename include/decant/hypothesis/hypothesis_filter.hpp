// SPDX-License-Identifier: MIT
#pragma once

/// Several trackers that believe different things, and what the masks say of each: which amount of liquid there was at
/// the beginning, which leg of a pipe is blocked.

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/pixel_box.hpp>
#include <decant/core/subnormal.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/hypothesis/executor.hpp>
#include <decant/hypothesis/posterior.hpp>
#include <decant/hypothesis/thread_executor.hpp>
#include <decant/tracking/silhouette_cells.hpp>
#include <decant/tracking/tracker.hpp>

namespace decant::inline DECANT_TARGET {

/// Settings of HypothesisFilter.
struct HypothesisFilterSettings {
  int cell_px = 20;  ///< see SilhouetteCells, >= 1; misfits are counted in cells
  PosteriorSettings posterior{};
  /// For how long an error of the model stays one and the same [s], >= 0: a stream that hits the pan too late does so
  /// in the next frame too. What has been seen for a time t says as much as 1 + t / error_correlation_time independent
  /// errors, and no more than posterior.independent_errors, since some errors never end. 0: as much as these from the
  /// first frame on, which makes the posterior too sure while little has been seen.
  double error_correlation_time = 0.05;
  double least_probability = 1e-6;  ///< hypotheses below this share of the best one's are given up, in [0, 1); 0: none

  /// How many independent errors a model has made in the time for which there was liquid to see or to predict.
  double errors_after(double seen_seconds) const noexcept {
    const double most = posterior.independent_errors;
    return error_correlation_time > 0 ? std::min(most, 1 + seen_seconds / error_correlation_time) : most;
  }
  /// And what the masks' misfits are worth then.
  EvidenceSettings evidence_after(double seen_seconds) const noexcept {
    return {errors_after(seen_seconds), posterior.least_squared, posterior.hopeless_share};
  }
};

namespace detail {

/// What the other processes need to know of a tracker's frame.
struct HypothesisFrame {
  FrameReport report{};
  Misfit misfit{};
};

/// Calls f with each number of a frame, in one order: for those that write them down and those that read them back.
template <class Frame, class Function>
void for_each_number(Frame& frame, Function&& f) {
  f(frame.misfit.squared);
  f(frame.misfit.measured);
  auto& report = frame.report;
  f(report.status);
  f(report.time);
  for (auto* each : {&report.prior, &report.posterior}) {
    f(each->compared_px);
    f(each->predicted_px);
    f(each->observed_px);
    f(each->both_px);
    f(each->comparable);
  }
  f(report.log_likelihood);
  f(report.correction.moved);
  f(report.correction.mean_shift);
  f(report.correction.relocated);
  f(report.relocated_volume);
  f(report.physics_ms);
  f(report.drawing_ms);
  f(report.correction_ms);
  f(report.relaxation_ms);
}

/// As numbers, and back: counts and states are whole numbers below 2^53, which a double holds.
inline JobResult numbers_of(const HypothesisFrame& frame) {
  JobResult numbers;
  numbers.reserve(24);
  for_each_number(frame, [&](const auto& value) { numbers.push_back(static_cast<double>(value)); });
  return numbers;
}

inline HypothesisFrame frame_of(const JobResult& numbers) noexcept {
  HypothesisFrame frame;
  auto next = numbers.begin();
  for_each_number(frame, [&](auto& value) { value = static_cast<std::remove_reference_t<decltype(value)>>(*next++); });
  return frame;
}

}  // namespace detail

/// Runs a tracker for each hypothesis on the same frames and keeps their posterior probabilities. The evidence is in
/// what a tracker predicted before it was corrected by the frame, the sum over cells of the squared difference between
/// the predicted and the observed share of liquid: a strong corrector makes any hypothesis fit the mask that it has
/// just seen. What such sums are worth is Posterior's to say. Frames in which no mask was believed say nothing. Works
/// with any corrector, OpenLoop among them (Schenck and Fox 2017, section V-B, has both).
///
/// With an executor of several processes all of them make the same calls with the same frames, and each keeps the
/// trackers of hypotheses k with k % processes() == process(). Reports, probabilities and what was given up are the
/// same in each of them, to the bit; the trackers themselves are only where has_tracker(k) says so.
template <class TrackerType, class ExecutorType = ThreadExecutor>
class HypothesisFilter {
  static_assert(Executor<ExecutorType>,
                "HypothesisFilter: Executor must model decant::Executor, see <decant/hypothesis/executor.hpp>");

 public:
  using Tracker = TrackerType;
  using Settings = HypothesisFilterSettings;

  /// @param executor over which hypotheses are shared out.
  /// Throws std::invalid_argument if a setting is out of range.
  explicit HypothesisFilter(const Settings& settings = {}, ExecutorType executor = {})
      : settings_(settings), cells_(settings.cell_px), posterior_(settings.posterior), executor_(std::move(executor)) {
    expects(settings.least_probability >= 0 && settings.least_probability < 1, "HypothesisFilter: least_probability",
            "in [0, 1)", settings.least_probability);
    expects(settings.error_correlation_time >= 0 && std::isfinite(settings.error_correlation_time),
            "HypothesisFilter: error_correlation_time", ">= 0", settings.error_correlation_time);
    posterior_.set_source(0, settings_.evidence_after(0));
  }

  /// Adds a source of evidence beside the masks, such as a scale (see series_misfit.hpp); before hypotheses. Throws as
  /// Posterior::add_source does. @return its number, for observe().
  std::size_t add_source(const EvidenceSettings& settings) { return posterior_.add_source(settings); }
  /// See Posterior::set_source. Of the masks, 0, independent_errors is what they come to in all.
  void set_source(std::size_t source, const EvidenceSettings& settings) {
    posterior_.set_source(source, settings);
    if (source == 0) {
      settings_.posterior.independent_errors = settings.independent_errors;
      settings_.posterior.least_squared = settings.least_squared;
      settings_.posterior.hopeless_share = settings.hopeless_share;
      posterior_.set_source(0, settings_.evidence_after(seen_seconds_));
    }
  }

  /// Adds a hypothesis. All trackers have the same cameras and bodies by number, and one time.
  /// @param log_prior logarithm of how probable it is before anything is seen, up to a constant that all share.
  /// @param region by camera, the part of its picture that this hypothesis is about: elsewhere its tracker sees no
  /// liquid, and no misfits are counted; cells begin at its corner. Without, all of every picture.
  /// @return its number, counting from 0.
  std::size_t add(Tracker tracker, double log_prior = 0, std::vector<PixelBox> region = {}) {
    return add([&] { return std::move(tracker); }, log_prior, std::move(region));
  }
  /// The same, for a tracker that make() gives, which is called only where the hypothesis is kept.
  template <std::invocable Make>
  std::size_t add(Make&& make, double log_prior = 0, std::vector<PixelBox> region = {}) {
    Hypothesis hypothesis;
    if (hypotheses_.size() % executor_.processes() == executor_.process()) {
      hypothesis.tracker.emplace(make());
      expects(region.empty() || region.size() == hypothesis.tracker->cameras(),
              "HypothesisFilter: cameras of the region", "as many as the tracker has", region.size());
    }
    hypothesis.region = std::move(region);
    const std::size_t number = posterior_.add(log_prior);
    hypotheses_.push_back(std::move(hypothesis));
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
    const std::vector<JobResult> frames = executor_.run(
        hypotheses_.size(),
        [&](std::size_t k) {
          Hypothesis& hypothesis = hypotheses_[k];
          if (hypothesis.given_up) {
            return JobResult{};
          }
          const SubnormalsAsZero quick;
          hypothesis.last.report = follow(frame, hypothesis);
          return detail::numbers_of({hypothesis.last.report, misfit_of(frame, hypothesis)});
        },
        tell_nobody);
    bool advanced = false, seen = false;
    for (std::size_t k = 0; k < hypotheses_.size(); ++k) {
      if (!hypotheses_[k].given_up) {
        hypotheses_[k].last = detail::frame_of(frames[k]);
        const Misfit& misfit = hypotheses_[k].last.misfit;
        posterior_.observe(k, misfit);
        advanced = advanced || hypotheses_[k].last.report.advanced();
        seen = seen || misfit.measured > 0 || misfit.squared > 0;
      }
    }
    if (advanced) {
      seen_seconds_ += seen ? frame.time - last_time_.value_or(frame.time) : 0.0;
      last_time_ = frame.time;
      posterior_.set_source(0, settings_.evidence_after(seen_seconds_));
    }
    give_up();
    return hypotheses_[given_up(before) && !hypotheses_[before].last.report.advanced() ? best() : before].last.report;
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
    return static_cast<std::size_t>(
        std::count_if(hypotheses_.begin(), hypotheses_.end(), [](const Hypothesis& each) { return !each.given_up; }));
  }
  /// How its last frame went.
  const FrameReport& report(std::size_t hypothesis) const { return hypotheses_.at(hypothesis).last.report; }
  bool given_up(std::size_t hypothesis) const { return hypotheses_.at(hypothesis).given_up; }

  /// Prior and evidence [nat], up to a constant that all share. One that was given up stays as far below the most
  /// probable one as it was then, which is at most what more frames would have left it; -infinity if its model failed.
  double log_posterior(std::size_t hypothesis) const {
    return given_up(hypothesis) ? posterior_.log_posterior(best()) - hypotheses_[hypothesis].behind
                                : posterior_.log_posterior(hypothesis);
  }

  /// Follows a hypothesis no further, as one that has become too improbable.
  void give_up(std::size_t hypothesis) {
    if (!given_up(hypothesis)) {
      drop(hypothesis, posterior_.log_posterior(best()) - posterior_.log_posterior(hypothesis));
    }
  }

  /// Among all hypotheses and "none of these"; those given up have none.
  double probability(std::size_t hypothesis) const { return posterior_.probability(hypothesis); }
  double probability_of_none() const noexcept { return posterior_.probability_of_none(); }

  /// The most probable one; of equals the first. "None of these" does not count.
  std::size_t best() const noexcept { return posterior_.best(); }

  /// For how long there was liquid to see, or some hypothesis predicted some [s].
  double seen_seconds() const noexcept { return seen_seconds_; }
  /// Misfits so far, and what they are worth.
  const Posterior& posterior() const noexcept { return posterior_; }

  /// Whether its tracker is in this process: it is of those that are kept here, and was not given up.
  bool has_tracker(std::size_t hypothesis) const { return hypotheses_.at(hypothesis).tracker.has_value(); }
  /// Throws std::invalid_argument for one that was given up or is kept in another process.
  Tracker& tracker(std::size_t hypothesis) {
    expects(!given_up(hypothesis), "HypothesisFilter: hypothesis", "one that was not given up", hypothesis);
    expects(has_tracker(hypothesis), "HypothesisFilter: hypothesis", "one that this process keeps", hypothesis);
    return *hypotheses_[hypothesis].tracker;
  }

 private:
  struct Hypothesis {
    std::optional<Tracker> tracker{};  ///< where it is kept, until it is given up
    detail::HypothesisFrame last{};
    bool given_up = false;
    double behind = 0;  ///< the most probable one, when this one was given up [nat]
    std::vector<PixelBox> region{};
    std::vector<Mask> cropped{};  ///< the frame's masks, without what is outside of the region
  };

  static PixelBox region_of(const Hypothesis& hypothesis, std::size_t camera, const PixelBox& image) noexcept {
    return hypothesis.region.empty() ? image : hypothesis.region[camera].intersection(image);
  }

  static FrameReport follow(const TrackerFrame& frame, Hypothesis& hypothesis) noexcept {
    if (hypothesis.region.empty()) {
      return hypothesis.tracker->track(frame);
    }
    std::vector<CameraMask> masks;
    masks.reserve(frame.masks.size());
    hypothesis.cropped.resize(std::max(hypothesis.cropped.size(), frame.masks.size()));
    for (std::size_t k = 0; k < frame.masks.size(); ++k) {
      const ConstMaskView& whole = frame.masks[k].mask;
      Mask& cropped = hypothesis.cropped[k];
      cropped.setZero(whole.rows(), whole.cols());
      if (frame.masks[k].camera < hypothesis.region.size()) {
        const PixelBox box = region_of(hypothesis, frame.masks[k].camera, PixelBox::of(whole));
        part_of(cropped, box) = part_of(whole, box);
      }
      masks.push_back({frame.masks[k].camera, cropped});
    }
    return hypothesis.tracker->track({frame.time, frame.poses, masks, frame.cameras});
  }

  template <class Picture>
  static auto part_of(Picture& picture, const PixelBox& box) noexcept {
    return box.empty() ? picture.block(0, 0, 0, 0) : picture.block(box.v_begin, box.u_begin, box.height(), box.width());
  }

  Misfit misfit_of(const TrackerFrame& frame, const Hypothesis& hypothesis) const noexcept {
    Misfit misfit;
    if (!hypothesis.last.report.advanced()) {
      return misfit;
    }
    for (const CameraMask& mask : frame.masks) {
      if (hypothesis.tracker->believes(mask.camera)) {
        const Mask& seen = hypothesis.tracker->observed(mask.camera);
        const PixelBox box = region_of(hypothesis, mask.camera, PixelBox::of(seen));
        const auto observed = cells_.shares(part_of(seen, box));
        const auto predicted = cells_.shares(part_of(hypothesis.tracker->predicted_before(mask.camera), box));
        misfit += {(predicted - observed).square().sum(), observed.square().sum()};
      }
    }
    return misfit;
  }

  void drop(std::size_t k, double behind) noexcept {
    hypotheses_[k].tracker.reset();
    hypotheses_[k].given_up = true;
    hypotheses_[k].behind = behind;
    posterior_.exclude(k);
  }

  void give_up() noexcept {
    const auto failed = [](const Hypothesis& each) { return each.last.report.status == FrameStatus::ModelFailed; };
    const bool one_stands = std::any_of(hypotheses_.begin(), hypotheses_.end(),
                                        [&](const Hypothesis& each) { return !each.given_up && !failed(each); });
    if (!one_stands) {
      return;
    }
    for (std::size_t k = 0; k < hypotheses_.size(); ++k) {
      if (!hypotheses_[k].given_up && failed(hypotheses_[k])) {
        drop(k, std::numeric_limits<double>::infinity());
      }
    }
    const double highest = posterior_.log_posterior(best());
    for (std::size_t k = 0; k < hypotheses_.size(); ++k) {
      const double behind = highest - posterior_.log_posterior(k);
      if (!hypotheses_[k].given_up && std::exp(-behind) < settings_.least_probability) {
        drop(k, behind);
      }
    }
  }

  Settings settings_;
  SilhouetteCells cells_;
  Posterior posterior_;
  ExecutorType executor_;
  std::vector<Hypothesis> hypotheses_{};
  std::optional<double> last_time_{};
  double seen_seconds_ = 0;
};

}  // namespace decant::inline DECANT_TARGET
