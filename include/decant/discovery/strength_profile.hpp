// SPDX-License-Identifier: MIT
#pragma once

/// How far predictions are from what was measured, by the strength of an effect.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// How features answer one component of an effect as its strength s grows from what the model has, u = (s - base) /
/// scale: c_1 u / (|u| + growth (1 - |u|)) + c_2 bend. The first term is a straight line for a growth of 1, answers
/// less and less below (friction at walls) and more and more above (a stream that begins to cling). The second one is
/// what weaker effects do that the strongest one does not: u (1 - |u|); or u^2 where strengths lie to both sides of the
/// base.
struct StrengthLaw {
  double base = 0;    ///< strength that the model has
  double scale = 1;   ///< > 0: the largest |s - base| that is asked about
  double growth = 1;  ///< > 0
  bool two_sided = false;

  std::array<double, 2> operator()(double strength) const noexcept {
    const double u = (strength - base) / scale, share = std::min(std::abs(u), 1.0);
    return {u / (share + growth * (1 - share)), two_sided ? u * u : u * (1 - share)};
  }
};

/// One component of a strength (a drag has one, a sideways pull has two), and which values of it are asked about.
struct StrengthAxis {
  StrengthLaw law{};
  std::pair<double, double> range{0, 0};  ///< the lower first
};

namespace detail {

/// The laws of all components, one after another.
inline Eigen::VectorXd strength_terms(const std::vector<StrengthAxis>& axes, const Eigen::VectorXd& strength) {
  Eigen::VectorXd phi(static_cast<Eigen::Index>(2 * axes.size()));
  for (std::size_t k = 0; k < axes.size(); ++k) {
    const std::array<double, 2> law = axes[k].law(strength[static_cast<Eigen::Index>(k)]);
    phi[static_cast<Eigen::Index>(2 * k)] = law[0];
    phi[static_cast<Eigen::Index>(2 * k + 1)] = law[1];
  }
  return phi;
}

}  // namespace detail

/// Distances d(s) = d_0 - 2 b . phi(s) + phi(s)' G phi(s), phi being the laws of all components one after another.
/// Those of several pours with one strength add up, each with laws of its own.
class StrengthProfile {
 public:
  using Strength = Eigen::VectorXd;  ///< a number for each component

  /// @param axes one to three, by component. @param without d_0: the distance at the laws' bases. @param answer b.
  /// @param square G.
  StrengthProfile(std::vector<StrengthAxis> axes, double without, Eigen::VectorXd answer, Eigen::MatrixXd square)
      : without_(without) {
    const auto terms = static_cast<Eigen::Index>(2 * axes.size());
    expects(!axes.empty() && axes.size() <= 3, "StrengthProfile: components", "1 .. 3", axes.size());
    expects(answer.size() == terms && square.rows() == terms && square.cols() == terms, "StrengthProfile: terms",
            "two for each component", answer.size());
    for (const StrengthAxis& axis : axes) {
      expects(axis.law.scale > 0, "StrengthProfile: scale", "> 0", axis.law.scale);
      expects(axis.law.growth > 0, "StrengthProfile: growth", "> 0", axis.law.growth);
      expects(axis.range.first <= axis.range.second, "StrengthProfile: range", "the lower end first", axis.range.first);
      range_.push_back(axis.range);
    }
    pours_.push_back({std::move(axes), std::move(answer), std::move(square)});
    best_ = lowest_with(range_.size(), 0);
  }

  std::size_t components() const noexcept { return range_.size(); }
  /// Which values of a component are asked about, the lower first.
  const std::pair<double, double>& range(std::size_t component) const { return range_.at(component); }

  double operator()(const Strength& strength) const {
    double sum = without_;
    for (const Pour& pour : pours_) {
      const Eigen::VectorXd phi = detail::strength_terms(pour.axes, strength);
      sum += phi.dot(pour.square * phi) - 2 * pour.answer.dot(phi);
    }
    return sum;
  }

  /// Distance where the effect is as the model has it.
  double without() const noexcept { return without_; }
  /// Where it is smallest.
  const Strength& best() const noexcept { return best_; }
  /// By how much it is smaller there than without the effect.
  double improvement() const { return without_ - (*this)(best_); }

  /// Strengths of one component, next to the best one, at which the distance is larger by less than `more`, > 0, with
  /// the other components as they then fit best.
  std::pair<double, double> within(std::size_t component, double more) const {
    const double limit = (*this)(best_) + more;
    const auto index = static_cast<Eigen::Index>(component);
    const auto end = [&](double towards) {
      double inside = best_[index];
      const double step = (towards - inside) / fine_steps;
      for (int k = 1; k <= fine_steps; ++k) {
        const double next = k == fine_steps ? towards : best_[index] + k * step;
        if ((*this)(lowest_with(component, next)) > limit) {
          double outside = next;
          for (int halving = 0; halving < 30; ++halving) {
            const double half = 0.5 * (inside + outside);
            ((*this)(lowest_with(component, half)) > limit ? outside : inside) = half;
          }
          break;
        }
        inside = next;
      }
      return inside;
    };
    return {end(range_.at(component).first), end(range_.at(component).second)};
  }

  /// With another pour's; throws std::invalid_argument if it is about other strengths.
  StrengthProfile& operator+=(const StrengthProfile& other) {
    expects(other.range_ == range_, "StrengthProfile: ranges of what is added", "the same", "others");
    without_ += other.without_;
    pours_.insert(pours_.end(), other.pours_.begin(), other.pours_.end());
    best_ = lowest_with(range_.size(), 0);
    return *this;
  }

 private:
  static constexpr int fine_steps = 50;

  struct Pour {
    std::vector<StrengthAxis> axes;
    Eigen::VectorXd answer;
    Eigen::MatrixXd square;
  };

  /// The smallest distance where one component has a value; of all, where there is no such component. Looks on a grid,
  /// then around the best of it in smaller and smaller steps: distances are smooth, but may have several valleys.
  Strength lowest_with(std::size_t held, double value) const {
    const int steps = range_.size() == 1 ? 40 : 12;
    Strength best(static_cast<Eigen::Index>(range_.size()));
    for (std::size_t k = 0; k < range_.size(); ++k) {
      best[static_cast<Eigen::Index>(k)] = k == held ? value : range_[k].first;
    }
    double lowest = (*this)(best);
    const auto look = [&](const Strength& strength) {
      const double distance = (*this)(strength);
      if (distance < lowest) {
        lowest = distance;
        best = strength;
      }
    };
    Strength place = best;
    const auto visit = [&](const auto& self, std::size_t k) -> void {
      if (k == range_.size()) {
        look(place);
        return;
      }
      const auto [low, high] = range_[k];
      const int count = k == held || high == low ? 0 : steps;
      for (int step = 0; step <= count; ++step) {
        place[static_cast<Eigen::Index>(k)] = k == held       ? value
                                              : step == 0     ? low
                                              : step == count ? high
                                                              : low + step * (high - low) / steps;
        self(self, k + 1);
      }
    };
    visit(visit, 0);
    for (double share = 1.0 / steps; share > 1e-6; share *= 0.5) {
      for (bool moved = true; moved;) {
        const double before = lowest;
        for (std::size_t k = 0; k < range_.size(); ++k) {
          if (k != held) {
            const auto index = static_cast<Eigen::Index>(k);
            const auto [low, high] = range_[k];
            for (const double way : {-share, share}) {
              Strength next = best;
              next[index] = std::clamp(best[index] + way * (high - low), low, high);
              look(next);
            }
          }
        }
        moved = lowest < before - 1e-12 * std::abs(before);
      }
    }
    return best;
  }

  std::vector<std::pair<double, double>> range_{};  ///< by component
  double without_;
  std::vector<Pour> pours_{};
  Strength best_{};
};

}  // namespace decant::inline DECANT_TARGET
