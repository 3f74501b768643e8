// SPDX-License-Identifier: MIT
#pragma once

/// What an effect of any strength would change, from simulations with a few strengths.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/discovery/nuisance_space.hpp>
#include <decant/discovery/strength_profile.hpp>

namespace decant::inline DECANT_TARGET {

/// A curve through standardised features, fitted to simulations with the effect less the baseline by least squares.
/// Two coefficients per feature and component smooth what is chaotic in single simulations; components add up. How an
/// effect grows with its strength (StrengthLaw::growth) is what weaker simulations have of the strongest ones. The
/// second coefficient, by which weaker simulations do something else, is held back as far as chaos drowns it: c
/// minimises sum |d - c1 p1 - c2 p2|^2 + l |c2|^2, where l is the variance of chaos over what the second coefficient is
/// expected to be, which is as large as the effect is at its largest strength (ridge regression: Hoerl and Kennard,
/// Technometrics 12, 1970). So weak effects do the same at every strength, more or less of it, and strong ones what was
/// simulated. Beyond the simulated strengths it says nothing.
class EffectCurve {
 public:
  using Strength = StrengthProfile::Strength;

  /// @param space has to outlive it.
  /// @param base what the model has, one to three components. @param strengths of each simulation, by component; each
  /// component has one or more other than its base, and several simulations may have the same (other seeds).
  /// @param differences p x as many: features less the space's center. @param chaos distance of a single simulation
  /// from the mean of many, >= 0; 0 goes through all simulations as closely as two coefficients can. Throws
  /// std::invalid_argument if numbers do not fit or are not finite.
  EffectCurve(const NuisanceSpace& space, const Strength& base, const std::vector<Strength>& strengths,
              const Eigen::MatrixXd& differences, double chaos = 0)
      : space_(&space), axes_(static_cast<std::size_t>(base.size())) {
    expects(differences.rows() == space.features(), "EffectCurve: features", "as many as of the space",
            differences.rows());
    expects(differences.cols() == static_cast<Eigen::Index>(strengths.size()), "EffectCurve: strengths",
            "one for each simulation", strengths.size());
    expects(differences.allFinite(), "EffectCurve: features", "finite", "others");
    Eigen::MatrixXd standardised(differences.rows(), differences.cols());
    for (Eigen::Index k = 0; k < differences.cols(); ++k) {
      standardised.col(k) = space.standardised_difference(differences.col(k));
    }
    std::vector<Eigen::Index> used;  // of the terms of all laws
    for (std::size_t k = 0; k < axes_.size(); ++k) {
      const std::size_t distinct = set_axis(k, base[static_cast<Eigen::Index>(k)], strengths);
      axes_[k].law.growth = growth(k, strengths, standardised, chaos);
      used.push_back(static_cast<Eigen::Index>(2 * k));
      if (distinct > 1) {
        used.push_back(static_cast<Eigen::Index>(2 * k + 1));
      }
    }
    Eigen::MatrixXd at(static_cast<Eigen::Index>(used.size()), differences.cols());
    for (Eigen::Index k = 0; k < differences.cols(); ++k) {
      const Eigen::VectorXd phi = detail::strength_terms(axes_, strengths[static_cast<std::size_t>(k)]);
      at.col(k) = phi(used);
    }
    const Eigen::MatrixXd normal = at * at.transpose();
    Eigen::MatrixXd held_back = normal;
    for (std::size_t k = 0; k < used.size(); ++k) {
      if (used[k] % 2 == 1 && chaos > 0) {
        const double size = largest_effect(static_cast<std::size_t>(used[k] / 2), strengths, standardised) - chaos;
        held_back(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(k)) += chaos / std::max(size, 0.05 * chaos);
      }
    }
    const Eigen::MatrixXd solved = held_back.ldlt().solve(at * standardised.transpose()).transpose();
    const auto count = static_cast<Eigen::Index>(2 * axes_.size());
    uncertainty_.setZero(count, count);
    const Eigen::MatrixXd inverse = held_back.ldlt().solve(Eigen::MatrixXd::Identity(normal.rows(), normal.cols()));
    uncertainty_(used, used) = inverse * normal * inverse;
    coefficient_.setZero(differences.rows(), count);
    for (std::size_t k = 0; k < used.size(); ++k) {
      coefficient_.col(used[k]) = solved.col(static_cast<Eigen::Index>(k));
    }
    expects(coefficient_.allFinite(), "EffectCurve: strengths", "enough of each component apart from the others",
            "too few");
    square_.resize(count, count);
    for (Eigen::Index i = 0; i < count; ++i) {
      for (Eigen::Index j = 0; j < count; ++j) {
        square_(i, j) = space.inner(coefficient_.col(i), coefficient_.col(j));
      }
    }
  }

  /// What the effect changes, in standardised features.
  Eigen::VectorXd at(const Strength& strength) const { return coefficient_ * detail::strength_terms(axes_, strength); }

  /// How far the effect takes features at a strength, as a distance. @param chaos distance of a single simulation from
  /// the mean of many, which the curve has a share of, and which is taken off.
  double energy(const Strength& strength, double chaos) const {
    const Eigen::VectorXd phi = detail::strength_terms(axes_, strength);
    return phi.dot(square_ * phi) - chaos * phi.dot(uncertainty_ * phi);
  }

  /// By component, from the base to the largest strengths that were simulated.
  const std::vector<StrengthAxis>& axes() const noexcept { return axes_; }

  /// How far standardised features are from the curve.
  StrengthProfile profile(const Eigen::VectorXd& standardised) const {
    Eigen::VectorXd answer(coefficient_.cols());
    for (Eigen::Index k = 0; k < answer.size(); ++k) {
      answer[k] = space_->inner(standardised, coefficient_.col(k));
    }
    return {axes_, space_->distance(standardised), std::move(answer), square_};
  }

 private:
  /// @return how many strengths other than the base there are.
  std::size_t set_axis(std::size_t component, double base, const std::vector<Strength>& strengths) {
    std::set<double> distinct;
    std::pair<double, double> range{base, base};
    for (const Strength& each : strengths) {
      expects(each.size() == static_cast<Eigen::Index>(axes_.size()), "EffectCurve: strength of a simulation",
              "a number for each component", each.size());
      const double strength = each[static_cast<Eigen::Index>(component)];
      expects(std::isfinite(strength), "EffectCurve: strength", "finite", strength);
      range = {std::min(range.first, strength), std::max(range.second, strength)};
      if (strength != base) {
        distinct.insert(strength);
      }
    }
    expects(!distinct.empty(), "EffectCurve: strengths", "at least one other than the base", base);
    axes_[component].range = range;
    axes_[component].law = {base, std::max(range.second - base, base - range.first), 1,
                            range.first < base && base < range.second};
    return distinct.size();
  }

  /// How an effect grows: by what simulations with weaker ones have of the mean of those with the strongest one, to
  /// each side. Of weak effects little is known, and a straight line (1) is as likely as anything: the logarithm of a
  /// growth has a standard deviation of 1 beforehand, and chaos has a tenth of its distance in one direction.
  double growth(std::size_t component, const std::vector<Strength>& strengths, const Eigen::MatrixXd& standardised,
                double chaos) const {
    struct Weaker {
      double share, inner, energy;
    };
    const auto index = static_cast<Eigen::Index>(component);
    StrengthLaw law = axes_[component].law;
    std::vector<Weaker> weaker;
    for (const double side : {-1.0, 1.0}) {
      const auto share = [&](const Strength& strength) { return side * (strength[index] - law.base) / law.scale; };
      Eigen::VectorXd strongest = Eigen::VectorXd::Zero(standardised.rows());
      double count = 0;
      for (std::size_t k = 0; k < strengths.size(); ++k) {
        if (share(strengths[k]) >= 0.999) {
          strongest += standardised.col(static_cast<Eigen::Index>(k));
          count += 1;
        }
      }
      if (count > 0) {
        strongest /= count;
        const double energy = std::max(space_->distance(strongest) - chaos / count, 0.05 * chaos);
        for (std::size_t k = 0; k < strengths.size() && energy > 0; ++k) {
          if (const double of = share(strengths[k]); of > 0 && of < 0.999 && alone(component, strengths[k])) {
            weaker.push_back({of, space_->inner(standardised.col(static_cast<Eigen::Index>(k)), strongest), energy});
          }
        }
      }
    }
    double best = 1, least = std::numeric_limits<double>::infinity();
    for (int step = -40; step <= 40 && !weaker.empty(); ++step) {
      const double logarithm = 0.045 * step;
      law.growth = std::exp(logarithm);
      double cost = 0.1 * chaos * logarithm * logarithm;
      for (const Weaker& each : weaker) {
        const double off = each.inner / each.energy - law(law.base + each.share * law.scale)[0];
        cost += each.energy * off * off;
      }
      if (cost < least) {
        least = cost;
        best = law.growth;
      }
    }
    return best;
  }
  /// Whether all other components are at their bases.
  bool alone(std::size_t component, const Strength& strength) const {
    for (std::size_t k = 0; k < axes_.size(); ++k) {
      if (k != component && strength[static_cast<Eigen::Index>(k)] != axes_[k].law.base) {
        return false;
      }
    }
    return true;
  }

  /// The mean distance of simulations at a component's largest strength.
  double largest_effect(std::size_t component, const std::vector<Strength>& strengths,
                        const Eigen::MatrixXd& standardised) const {
    const StrengthLaw& law = axes_[component].law;
    double sum = 0, count = 0;
    for (std::size_t k = 0; k < strengths.size(); ++k) {
      if (std::abs(strengths[k][static_cast<Eigen::Index>(component)] - law.base) >= 0.999 * law.scale) {
        sum += space_->distance(standardised.col(static_cast<Eigen::Index>(k)));
        count += 1;
      }
    }
    return count > 0 ? sum / count : 0;
  }

  const NuisanceSpace* space_;
  std::vector<StrengthAxis> axes_;
  Eigen::MatrixXd coefficient_{};  ///< p x two for each component
  Eigen::MatrixXd square_{};
  Eigen::MatrixXd uncertainty_{};  ///< covariance of the coefficients of a feature, over the variance of chaos
};

}  // namespace decant::inline DECANT_TARGET
