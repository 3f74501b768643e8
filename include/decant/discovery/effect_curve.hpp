// SPDX-License-Identifier: MIT
#pragma once

/// What an effect of any strength would change, from simulations with a few strengths.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/discovery/nuisance_space.hpp>
#include <decant/discovery/strength_profile.hpp>

namespace decant::inline DECANT_TARGET {

/// One component of an effect's strength, as a model has it.
struct StrengthBase {
  double base = 0;          ///< what the model has
  bool saturating = false;  ///< see StrengthLaw
};

/// A curve through standardised features, fitted to simulations with the effect less the baseline by least squares.
/// Two coefficients per feature and component smooth what is chaotic in single simulations; components add up. The
/// second one, by which the effect is not in proportion to the law's first term, is held back as far as chaos drowns
/// it: c minimises sum |d - c1 p1 - c2 p2|^2 + l |c2|^2, where l is the variance of chaos over what the second
/// coefficient is expected to be, which is as large as the effect is at its largest strength (ridge regression: Hoerl
/// and Kennard, Technometrics 12, 1970). So weak effects are straight lines and strong ones as they were simulated.
/// Beyond the simulated strengths it says nothing.
class EffectCurve {
 public:
  using Strength = StrengthProfile::Strength;

  /// @param space has to outlive it.
  /// @param components one to three. @param strengths of each simulation, by component; each component has one or more
  /// other than its base, and several simulations may have the same (other seeds).
  /// @param differences p x as many: features less the space's center. @param chaos distance of a single simulation
  /// from the mean of many, >= 0; 0 goes through all simulations as closely as two coefficients can. Throws
  /// std::invalid_argument if numbers do not fit or are not finite.
  EffectCurve(const NuisanceSpace& space, const std::vector<StrengthBase>& components,
              const std::vector<Strength>& strengths, const Eigen::MatrixXd& differences, double chaos = 0)
      : space_(&space), axes_(components.size()) {
    expects(differences.rows() == space.features(), "EffectCurve: features", "as many as of the space",
            differences.rows());
    expects(differences.cols() == static_cast<Eigen::Index>(strengths.size()), "EffectCurve: strengths",
            "one for each simulation", strengths.size());
    expects(differences.allFinite(), "EffectCurve: features", "finite", "others");
    std::vector<Eigen::Index> used;  // of the terms of all laws
    for (std::size_t k = 0; k < components.size(); ++k) {
      const std::size_t distinct = set_axis(k, components[k], strengths);
      used.push_back(static_cast<Eigen::Index>(2 * k));
      if (distinct > 1) {
        used.push_back(static_cast<Eigen::Index>(2 * k + 1));
      }
    }
    Eigen::MatrixXd at(static_cast<Eigen::Index>(used.size()), differences.cols());
    Eigen::MatrixXd standardised(differences.rows(), differences.cols());
    for (Eigen::Index k = 0; k < differences.cols(); ++k) {
      const Eigen::VectorXd phi = detail::strength_terms(axes_, strengths[static_cast<std::size_t>(k)]);
      at.col(k) = phi(used);
      standardised.col(k) = space.standardised_difference(differences.col(k));
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
    const auto count = static_cast<Eigen::Index>(2 * components.size());
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
  std::size_t set_axis(std::size_t component, const StrengthBase& of, const std::vector<Strength>& strengths) {
    std::set<double> distinct;
    std::pair<double, double> range{of.base, of.base};
    for (const Strength& each : strengths) {
      expects(each.size() == static_cast<Eigen::Index>(axes_.size()), "EffectCurve: strength of a simulation",
              "a number for each component", each.size());
      const double strength = each[static_cast<Eigen::Index>(component)];
      expects(std::isfinite(strength), "EffectCurve: strength", "finite", strength);
      range = {std::min(range.first, strength), std::max(range.second, strength)};
      if (strength != of.base) {
        distinct.insert(strength);
      }
    }
    expects(!distinct.empty(), "EffectCurve: strengths", "at least one other than the base", of.base);
    axes_[component] = {{of.base, std::max(range.second - of.base, of.base - range.first), of.saturating}, range};
    return distinct.size();
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
