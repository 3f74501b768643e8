// SPDX-License-Identifier: MIT
#pragma once

/// How far predictions are from what was measured, by the strength of an effect.

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// How features answer an effect as its strength s grows from what the model has, u = (s - base) / scale:
/// c_1 u + c_2 u^2, or c_1 u / (0.15 + |u|) + c_2 u where they answer less and less (viscosity, friction at walls).
struct StrengthLaw {
  double base = 0;   ///< strength that the model has
  double scale = 1;  ///< > 0: the largest |s - base| that is asked about
  bool saturating = false;

  std::array<double, 2> operator()(double strength) const noexcept {
    const double u = (strength - base) / scale;
    return saturating ? std::array{u / (0.15 + std::abs(u)), u} : std::array{u, u * u};
  }
  bool operator==(const StrengthLaw&) const = default;
};

/// Distances d(s) = d_0 - 2 b . phi(s) + phi(s)' G phi(s), phi being the law. Those of several pours with one strength
/// add up.
class StrengthProfile {
 public:
  /// @param range strengths that are asked about, the lower first.
  /// @param without d_0: the distance at the law's base. @param answer b. @param square G.
  StrengthProfile(const StrengthLaw& law, std::pair<double, double> range, double without,
                  const Eigen::Vector2d& answer, const Eigen::Matrix2d& square)
      : law_(law), range_(range), without_(without), answer_(answer), square_(square) {
    expects(law.scale > 0, "StrengthProfile: scale", "> 0", law.scale);
    expects(range.first <= range.second, "StrengthProfile: range", "the lower end first", range.first);
  }

  double operator()(double strength) const noexcept {
    const std::array<double, 2> law = law_(strength);
    const Eigen::Vector2d phi(law[0], law[1]);
    return without_ - 2 * answer_.dot(phi) + phi.dot(square_ * phi);
  }

  /// Distance where the effect is as the model has it.
  double without() const noexcept { return without_; }
  const std::pair<double, double>& range() const noexcept { return range_; }

  /// Where it is smallest; of equals the lowest.
  double best() const noexcept {
    double best = range_.first;
    const auto look = [&](double strength) { best = (*this)(strength) < (*this)(best) ? strength : best; };
    for (int k = 1; k <= steps; ++k) {
      look(place(k));
    }
    double width = (range_.second - range_.first) / steps;
    while (width > 1e-6 * law_.scale) {  // between the steps
      const double around = best;
      look(std::max(range_.first, around - 0.5 * width));
      look(std::min(range_.second, around + 0.5 * width));
      width *= 0.5;
    }
    return best;
  }
  /// By how much it is smaller there than without the effect.
  double improvement() const noexcept { return without_ - (*this)(best()); }

  /// Strengths next to the best one at which it is larger by less than `more`, > 0.
  std::pair<double, double> within(double more) const noexcept {
    const double middle = best(), limit = (*this)(middle) + more;
    const auto end = [&](double towards) {
      double inside = middle;
      const double step = (towards - middle) / fine_steps;
      for (int k = 1; k <= fine_steps; ++k) {
        const double next = k == fine_steps ? towards : middle + k * step;
        if ((*this)(next) > limit) {
          double outside = next;
          for (int halving = 0; halving < 40; ++halving) {
            const double half = 0.5 * (inside + outside);
            ((*this)(half) > limit ? outside : inside) = half;
          }
          break;
        }
        inside = next;
      }
      return inside;
    };
    return {end(range_.first), end(range_.second)};
  }

  /// With another pour's; throws std::invalid_argument if it is about other strengths.
  StrengthProfile& operator+=(const StrengthProfile& other) {
    expects(other.law_ == law_ && other.range_ == range_, "StrengthProfile: law and range of what is added", "the same",
            "others");
    without_ += other.without_;
    answer_ += other.answer_;
    square_ += other.square_;
    return *this;
  }

 private:
  static constexpr int steps = 40, fine_steps = 200;

  double place(int step) const noexcept { return range_.first + step * (range_.second - range_.first) / steps; }

  StrengthLaw law_;
  std::pair<double, double> range_;
  double without_;
  Eigen::Vector2d answer_;
  Eigen::Matrix2d square_;
};

}  // namespace decant::inline DECANT_TARGET
