// SPDX-License-Identifier: MIT
#pragma once

/// The way of an effect's strength, place and time to where it explains most: which point comes next.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/target.hpp>
#include <decant/discovery/effect_judgement.hpp>
#include <decant/discovery/effect_refinement.hpp>
#include <decant/discovery/nuisance_space.hpp>

namespace decant::inline DECANT_TARGET {

/// Steps of Gauss and Newton (refinement) by what runs around each point say, half of which are taken back where they
/// lead away. Whoever has such a path makes the runs at its point, and hands them in.
class RefinementPath {
 public:
  explicit RefinementPath(EffectPoint begin) : point_(std::move(begin)) {}

  /// Where runs are needed next.
  const EffectPoint& point() const noexcept { return point_; }
  /// Of the last step, by recording; empty before the first one, and where runs failed.
  const std::vector<RefinementView>& views() const noexcept { return views_; }
  /// Distance at the point, by the linear model that led there; infinite where runs failed.
  double expected() const noexcept { return expected_; }
  /// Whether there is no other step: the last one was no gain that could be told from chance.
  bool is_settled() const noexcept { return settled_; }
  /// The point that was nearest to what was recorded by its own runs, and how near.
  const EffectPoint& nearest() const noexcept { return nearest_.point; }
  double least_distance() const noexcept { return nearest_.distance; }

  void settle() noexcept { settled_ = true; }
  /// Runs are needed at another point that stands for the same run.
  void stand_at(EffectPoint point) { point_ = point.rounded(); }
  /// Runs at the point fail.
  void fail() {
    views_.clear();
    expected_ = std::numeric_limits<double>::infinity();
    settled_ = true;
  }

  /// @param views around the point, by recording. @param recorded features of each.
  void step(std::vector<RefinementView> views, const std::vector<Eigen::VectorXd>& recorded,
            const ChanceLevel& chance) {
    views_ = std::move(views);
    const auto mean_distance = [&](const auto& predicted) {
      double sum = 0;
      for (std::size_t k = 0; k < views_.size(); ++k) {
        const NuisanceSpace& space = *views_[k].space;
        const Eigen::VectorXd off = recorded[k] - predicted(views_[k]);
        sum += space.distance(space.standardised_difference(off));
      }
      return sum / static_cast<double>(views_.size());
    };
    const double distance = mean_distance([](const auto& view) -> Eigen::VectorXd { return view.middle; });
    if (led_away(distance, chance)) {
      go_half_way_back();
      return;
    }
    if (distance < nearest_.distance) {
      nearest_ = {point_, views_, distance};
    }
    const Eigen::VectorXd move = refinement(point_, views_, recorded);
    expected_ = mean_distance([&](const auto& view) -> Eigen::VectorXd { return view.middle + view.slope * move; });
    for (const RefinementView& view : views_) {  // what slopes have of chaos
      expected_ -= view.chaos.dot(move.cwiseAbs2()) / static_cast<double>(views_.size());
    }
    expected_ = std::max(expected_, 0.0);
    EffectPoint next = point_;
    for (Eigen::Index k = 0; k < next.size(); ++k) {
      next = next.with(k, point_.value()[k] + move[k]);
    }
    // where what an effect does is bent, a point that was tried may be nearer than what slopes promise
    double more = 0;
    for (const RefinementView& view : views_) {
      more += view.side_chaos / static_cast<double>(views_.size());
    }
    for (Eigen::Index number = 0; number < next.size(); ++number) {
      if (point_.is_held(number)) {
        continue;
      }
      for (const int side : {-1, 1}) {
        const double there = mean_distance([&](const auto& view) -> Eigen::VectorXd {
                               return (side < 0 ? view.below : view.above).col(number);
                             }) -
                             more;
        if (there > 0 && relative_fall(expected_, there) > chance.fall) {
          expected_ = there;
          next = point_.with(number, point_.value()[number] + side * point_.step(number));
        }
      }
    }
    const bool is_finer = set_steps(next);
    settled_ = !is_finer && relative_fall(distance, expected_) < 0.5 * chance.fall;
    point_ = next.rounded();
  }

 private:
  struct Nearest {
    EffectPoint point{};
    std::vector<RefinementView> views{};
    double distance = std::numeric_limits<double>::infinity();
  };

  /// Whether the last step came to less than a quarter of what its slopes promised, or to a loss, and by more than what
  /// chance makes of distances. @param distance where it led to.
  bool led_away(double distance, const ChanceLevel& chance) const noexcept {
    if (!std::isfinite(nearest_.distance) || distance <= chance.largest_distance) {
      return false;
    }
    const double promised = nearest_.distance - expected_, gain = nearest_.distance - distance;
    const double by_chance = chance.fall * nearest_.distance;
    return gain < -by_chance || (promised > by_chance && gain < 0.25 * promised);
  }

  /// Where what an effect does is bent, as that of a strength and the time for which it lasts is, which act by their
  /// product, slopes may promise too much (a line search: Nocedal and Wright, Numerical Optimization, 2006, chapter 3).
  void go_half_way_back() {
    EffectPoint half_way = point_;
    bool is_near = true;
    for (Eigen::Index k = 0; k < half_way.size(); ++k) {
      const double off = 0.5 * (half_way.value()[k] - nearest_.point.value()[k]);
      half_way = half_way.with(k, nearest_.point.value()[k] + off);
      is_near = is_near && std::abs(off) <= 0.1 * half_way.step(k);
    }
    point_ = is_near ? nearest_.point : half_way.rounded();
    views_ = nearest_.views;
    // of a parabola whose end the step was to be
    expected_ = is_near ? nearest_.distance : nearest_.distance - 0.75 * (nearest_.distance - expected_);
    settled_ = is_near;
  }

  /// Of places, times and speeds. What changes no more than chaos does is held, unless strengths are still on their
  /// way, since a weak effect's time does not tell: one camera may not tell how far off something is. A step of what
  /// hardly moves any more is halved, as long as half of it tells four times as much as chaos does: a jet that is moved
  /// by more than its width says nothing of which way to go.
  /// @return whether any was halved.
  bool set_steps(EffectPoint& next) const {
    constexpr double halvable = 4 * 4 + 1;  // of a whole step, which chaos is part of
    const auto moves = [&](Eigen::Index k) {
      return std::abs(next.value()[k] - point_.value()[k]) >= 0.5 * point_.step(k);
    };
    bool strength_moves = false, is_finer = false;
    for (Eigen::Index k = 0; k < next.size(); ++k) {
      strength_moves = strength_moves || (!next.is_where_or_when(k) && moves(k));
    }
    for (Eigen::Index k = 0; k < next.size(); ++k) {
      if (!next.is_where_or_when(k) || next.is_held(k)) {
        continue;
      }
      if (!tells(views_, k)) {
        if (!strength_moves) {
          next.hold(k);
        }
      } else if (!moves(k) && tells(views_, k, halvable)) {
        next.refine(k);
        is_finer = true;
      }
    }
    return is_finer;
  }

  EffectPoint point_;
  std::vector<RefinementView> views_{};
  double expected_ = 0;
  bool settled_ = false;
  Nearest nearest_{};
};

}  // namespace decant::inline DECANT_TARGET
