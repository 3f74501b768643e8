// SPDX-License-Identifier: MIT
#pragma once

/// Hypotheses about several containers at once, of which those that do not share liquid are simulated one by one: n of
/// one and m of another take n + m simulations, and still every one of the n x m combinations has its probability (the
/// question that Schenck and Fox 2017, section VII, leave open).

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/log_sum.hpp>
#include <decant/core/target.hpp>
#include <decant/coverage/mask_cleaning.hpp>
#include <decant/hypothesis/hypothesis_filter.hpp>
#include <decant/hypothesis/hypothesis_groups.hpp>
#include <decant/hypothesis/posterior.hpp>
#include <decant/hypothesis/thread_executor.hpp>
#include <decant/tracking/mask_trust.hpp>
#include <decant/tracking/silhouette_cells.hpp>
#include <decant/tracking/tracker.hpp>

namespace decant::inline DECANT_TARGET {

/// The posterior over combinations of hypotheses, one of each source, from simulations of each HypothesisGroup by
/// itself. A group's trackers see the group's pixels only, and their misfits are counted there. What Posterior makes of
/// misfits is not a product over groups, since how large errors are is not known and taken to be alike in all of the
/// picture; but misfits are sums over cells, so that those of a combination are its groups' and what was seen outside
/// of all groups, and of these sums Posterior makes what it makes of any. "None of these" is meant of a combination.
/// Where errors are not alike (one container is modelled far worse), a HypothesisFilter for each group, whose
/// probabilities then multiply, keeps the worse one from blunting the other.
///
/// The posterior is that of a HypothesisFilter over simulations of all combinations, to rounding, as far as
/// - liquid of one group takes the same places with and without the other groups' liquid. Simulations of one process
///   share their sub-steps and a solver's tolerance among all their liquid, so this holds within these tolerances;
/// - correctors do not take what one group lacks from another. OpenLoop does nothing; those that balance liquid over
///   the whole picture do so within a group here, which is what is wanted;
/// - masks are believed (MaskTrust) as a whole and in each group alike, nothing is liquid where a group's pixels end
///   (MaskCleaning looks beyond them), and gaps between particles look as wide in one group as in the other.
template <class TrackerType, class ExecutorType = ThreadExecutor>
class FactoredFilter {
 public:
  using Tracker = TrackerType;
  using Settings = HypothesisFilterSettings;
  using Choice = std::vector<std::size_t>;  ///< by source, which of its hypotheses

  /// @param groups as hypothesis_groups makes them, with settings.cell_px; each source is in one of them.
  /// @param log_prior by source and hypothesis, as many as there are; up to a constant that those of a source share.
  /// @param make is called with a std::span<const std::optional<std::size_t>>, which says of each source by which of
  /// its hypotheses it is filled, and makes a Tracker; sources of other groups have nothing there, and no liquid. It
  /// has all bodies, also those of other groups: they may hide liquid from a camera.
  /// @param executor over which simulations are shared out, see HypothesisFilter.
  /// Throws std::invalid_argument if groups and sources do not fit, or there are more than a million combinations.
  template <class Make>
  FactoredFilter(std::vector<HypothesisGroup> groups, std::vector<std::vector<double>> log_prior, Make&& make,
                 const Settings& settings = {}, ExecutorType executor = {})
      : groups_(std::move(groups)),
        log_prior_(std::move(log_prior)),
        settings_(settings),
        cells_(settings.cell_px),
        filter_(without_pruning(settings), std::move(executor)),
        joint_(settings.posterior) {
    check();
    std::vector<std::optional<std::size_t>> chosen(log_prior_.size());
    for (const HypothesisGroup& group : groups_) {
      first_.push_back(filter_.size());
      Choice of_group(group.sources.size(), 0);
      do {
        double prior = 0;
        for (std::size_t place = 0; place < of_group.size(); ++place) {
          chosen[group.sources[place]] = of_group[place];
          prior += log_prior_[group.sources[place]][of_group[place]];
        }
        Tracker tracker = make(std::span<const std::optional<std::size_t>>(chosen));
        expects(tracker.cameras() == group.pixels.size(), "FactoredFilter: cameras of a tracker",
                "as many as of the groups", tracker.cameras());
        if (filter_.size() == 0) {
          cleaning_ = MaskCleaning(tracker.settings().cleaning_window_px, tracker.settings().smallest_region_px);
          trust_.assign(tracker.cameras(), MaskTrust(tracker.settings().least_pixels));
        }
        filter_.add(std::move(tracker), prior, group.pixels);
      } while (next(of_group, [&](std::size_t place) { return log_prior_[group.sources[place]].size(); }));
      std::fill(chosen.begin(), chosen.end(), std::nullopt);
    }
    behind_.assign(combinations_, std::numeric_limits<double>::infinity());
    judge();
  }

  /// Takes all simulations to the frame's time. A simulation whose model fails is given up, as long as another one
  /// stands; then one that is in no combination that is probable enough. Never throws; allocates where a tracker does.
  /// @return Ok if a mask was believed in some group; ModelFailed if no simulation of some group stands.
  [[nodiscard]] FrameStatus track(const TrackerFrame& frame) noexcept {
    const double before = something();
    const FrameReport report = filter_.track(frame);
    if (!report.advanced()) {
      return report.status;  // all trackers refuse a frame alike
    }
    look_outside(frame);
    seen_seconds_ += something() > before ? frame.time - last_time_.value_or(frame.time) : 0.0;
    last_time_ = frame.time;
    judge();
    prune();
    bool seen = false;
    for (std::size_t group = 0; group < groups_.size(); ++group) {
      bool stands = false;
      for (std::size_t k = first_[group]; k < end_of(group); ++k) {
        const bool goes_on = !filter_.given_up(k) && filter_.report(k).advanced();
        stands = stands || goes_on;
        seen = seen || (goes_on && filter_.report(k).status == FrameStatus::Ok);
      }
      if (!stands) {
        return FrameStatus::ModelFailed;
      }
    }
    return seen ? FrameStatus::Ok : FrameStatus::Uncorrected;
  }

  std::size_t sources() const noexcept { return log_prior_.size(); }
  std::size_t combinations() const noexcept { return combinations_; }
  const std::vector<HypothesisGroup>& groups() const noexcept { return groups_; }

  /// Among all combinations and "none of these"; those given up have none. Throws std::invalid_argument for a choice
  /// that is none.
  double probability(const Choice& choice) const { return joint_.probability(number_of(choice)); }
  double probability_of_none() const noexcept { return joint_.probability_of_none(); }
  /// See HypothesisFilter: a combination that was given up stays as far behind as it was [nat].
  double log_posterior(const Choice& choice) const { return log_posterior_of(number_of(choice)); }
  double log_posterior_of_none() const noexcept { return joint_.log_posterior_of_none(); }

  /// Of one source's hypothesis, whatever is so of the other sources.
  double probability(std::size_t source, std::size_t hypothesis) const {
    const double own = log_marginal(source, hypothesis, [this](std::size_t c) { return joint_.log_posterior(c); });
    double all = joint_.log_posterior_of_none();
    for (std::size_t c = 0; c < combinations_; ++c) {
      all = log_sum(all, joint_.log_posterior(c));
    }
    return std::isfinite(own) ? std::exp(own - all) : 0;
  }
  /// The same as a logarithm up to a constant that all share, also of hypotheses that were given up: for ValueDensity.
  double log_posterior(std::size_t source, std::size_t hypothesis) const {
    return log_marginal(source, hypothesis, [this](std::size_t c) { return log_posterior_of(c); });
  }

  /// The most probable combination; of equals the first. "None of these" does not count.
  Choice best() const { return choice_of(joint_.best()); }

  /// All simulations, those of the first group first.
  const HypothesisFilter<Tracker, ExecutorType>& simulations() const noexcept { return filter_; }
  /// The number, among these, of that of a group in a combination.
  std::size_t simulation(std::size_t group, const Choice& choice) const {
    expects(group < groups_.size(), "FactoredFilter: group", "one of its groups", group);
    number_of(choice);
    return simulation_of(group, choice);
  }
  /// Throws std::invalid_argument for a simulation that was given up, or is kept in another process.
  Tracker& tracker(std::size_t simulation) { return filter_.tracker(simulation); }

 private:
  static Settings without_pruning(Settings settings) {
    expects(settings.least_probability >= 0 && settings.least_probability < 1, "FactoredFilter: least_probability",
            "in [0, 1)", settings.least_probability);
    settings.least_probability = 0;  // of a simulation by itself nothing is known of its combinations
    return settings;
  }

  void check() {
    std::vector<int> groups_of(log_prior_.size(), 0);
    for (const HypothesisGroup& group : groups_) {
      for (const std::size_t source : group.sources) {
        expects(source < log_prior_.size(), "FactoredFilter: source of a group", "one that has hypotheses", source);
        ++groups_of[source];
      }
    }
    for (std::size_t source = 0; source < log_prior_.size(); ++source) {
      expects(groups_of[source] == 1, "FactoredFilter: groups of each source", "one", groups_of[source]);
      expects(!log_prior_[source].empty(), "FactoredFilter: hypotheses of each source", "at least one", 0);
      combinations_ *= log_prior_[source].size();
      expects(combinations_ <= 1'000'000, "FactoredFilter: combinations", "at most a million", combinations_);
      for (const double each : log_prior_[source]) {
        expects(std::isfinite(each), "FactoredFilter: log_prior", "finite", each);
      }
    }
  }

  /// Counts up, the last place first. @return false after the last of all.
  template <class Count>
  static bool next(Choice& choice, Count&& count) {
    for (std::size_t place = choice.size(); place-- > 0;) {
      if (++choice[place] < count(place)) {
        return true;
      }
      choice[place] = 0;
    }
    return false;
  }

  std::size_t number_of(const Choice& choice) const {
    expects(choice.size() == log_prior_.size(), "FactoredFilter: length of a choice", "the number of sources",
            choice.size());
    std::size_t number = 0;
    for (std::size_t source = 0; source < choice.size(); ++source) {
      expects(choice[source] < log_prior_[source].size(), "FactoredFilter: hypothesis", "one of the source's",
              choice[source]);
      number = number * log_prior_[source].size() + choice[source];
    }
    return number;
  }
  Choice choice_of(std::size_t combination) const {
    Choice choice(log_prior_.size());
    for (std::size_t source = choice.size(); source-- > 0;) {
      choice[source] = combination % log_prior_[source].size();
      combination /= log_prior_[source].size();
    }
    return choice;
  }
  std::size_t simulation_of(std::size_t group, const Choice& choice) const noexcept {
    std::size_t number = 0;
    for (const std::size_t source : groups_[group].sources) {
      number = number * log_prior_[source].size() + choice[source];
    }
    return first_[group] + number;
  }
  std::size_t end_of(std::size_t group) const noexcept {
    return group + 1 < first_.size() ? first_[group + 1] : filter_.size();
  }

  /// f(combination, choice) for all of them in order.
  template <class Function>
  void for_each_combination(Function&& f) const {
    Choice choice(log_prior_.size(), 0);
    for (std::size_t c = 0; c < combinations_; ++c) {
      f(c, static_cast<const Choice&>(choice));
      next(choice, [&](std::size_t source) { return log_prior_[source].size(); });
    }
  }

  double log_posterior_of(std::size_t combination) const {
    return joint_.excluded(combination) ? joint_.log_posterior(joint_.best()) - behind_[combination]
                                        : joint_.log_posterior(combination);
  }

  template <class LogOf>
  double log_marginal(std::size_t source, std::size_t hypothesis, LogOf&& log_of) const {
    expects(source < log_prior_.size(), "FactoredFilter: source", "one that has hypotheses", source);
    expects(hypothesis < log_prior_[source].size(), "FactoredFilter: hypothesis", "one of the source's", hypothesis);
    double sum = -std::numeric_limits<double>::infinity();
    for_each_combination([&](std::size_t c, const Choice& choice) {
      if (choice[source] == hypothesis) {
        sum = log_sum(sum, log_of(c));
      }
    });
    return sum;
  }

  // What is seen where no group's liquid can be is off by all of it in every combination.
  void look_outside(const TrackerFrame& frame) noexcept {
    for (const CameraMask& mask : frame.masks) {
      clean_.resize(mask.mask.rows(), mask.mask.cols());
      cleaning_.apply(mask.mask, clean_, {1});
      if (!trust_[mask.camera].believes(clean_)) {
        continue;
      }
      SilhouetteCells::Shares shares = cells_.shares(clean_);
      for (const HypothesisGroup& group : groups_) {
        const PixelBox box = group.pixels[mask.camera].intersection(PixelBox::of(clean_));
        const auto cell = [&](int pixel) { return (pixel + settings_.cell_px - 1) / settings_.cell_px; };
        if (!box.empty()) {
          shares.block(cell(box.v_begin), cell(box.u_begin), cell(box.v_end) - cell(box.v_begin),
                       cell(box.u_end) - cell(box.u_begin)) = 0;
        }
      }
      const double off = shares.square().sum();
      outside_ += {off, off};
    }
  }

  // What grows with each frame in which there was liquid to see or to predict, in a group or outside of all.
  double something() const noexcept {
    double sum = outside_.measured;
    for (std::size_t k = 0; k < filter_.size(); ++k) {
      const Misfit& misfit = filter_.posterior().misfit(k);
      const double here = misfit.squared + misfit.measured;
      sum += std::isfinite(here) ? here : 0.0;
    }
    return sum;
  }

  void judge() {
    joint_ = Posterior(settings_.posterior);
    joint_.set_source(0, settings_.evidence_after(seen_seconds_));
    for_each_combination([&](std::size_t c, const Choice& choice) {
      double prior = 0;
      for (std::size_t source = 0; source < choice.size(); ++source) {
        prior += log_prior_[source][choice[source]];
      }
      joint_.add(prior);
      Misfit misfit = outside_;
      bool excluded = false;
      for (std::size_t group = 0; group < groups_.size(); ++group) {
        const std::size_t k = simulation_of(group, choice);
        misfit += filter_.posterior().misfit(k);
        excluded = excluded || filter_.posterior().excluded(k);
      }
      joint_.observe(c, misfit);
      if (excluded) {
        joint_.exclude(c);
      }
    });
  }

  void prune() {
    const double highest = joint_.log_posterior(joint_.best());
    if (!std::isfinite(highest)) {
      return;
    }
    std::vector<double> best_of(filter_.size(), -std::numeric_limits<double>::infinity());
    for_each_combination([&](std::size_t c, const Choice& choice) {
      for (std::size_t group = 0; group < groups_.size(); ++group) {
        double& best = best_of[simulation_of(group, choice)];
        best = std::max(best, joint_.log_posterior(c));
      }
    });
    bool dropped = false;
    for (std::size_t k = 0; k < filter_.size(); ++k) {
      if (!filter_.given_up(k) && std::exp(best_of[k] - highest) < settings_.least_probability) {
        filter_.give_up(k);
        dropped = true;
      }
    }
    if (dropped) {
      const Posterior before = joint_;
      judge();
      for (std::size_t c = 0; c < combinations_; ++c) {
        if (joint_.excluded(c) && !before.excluded(c)) {
          behind_[c] = highest - before.log_posterior(c);
        }
      }
    }
  }

  std::vector<HypothesisGroup> groups_;
  std::vector<std::vector<double>> log_prior_;
  Settings settings_;
  SilhouetteCells cells_;
  HypothesisFilter<Tracker, ExecutorType> filter_;
  Posterior joint_;
  std::size_t combinations_ = 1;
  std::vector<std::size_t> first_{};  // simulation of each group
  std::vector<double> behind_{};      // by combination, the best one when this one was given up [nat]
  MaskCleaning cleaning_{};
  std::vector<MaskTrust> trust_{};  // by camera, of the whole mask
  Mask clean_{};
  Misfit outside_{};
  std::optional<double> last_time_{};
  double seen_seconds_ = 0;
};

}  // namespace decant::inline DECANT_TARGET
