// SPDX-License-Identifier: MIT
#pragma once

/// What an effect of any strength would change, from simulations with a few strengths.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
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
/// Two coefficients per feature smooth what is chaotic in single simulations. Beyond the simulated strengths it says
/// nothing.
class EffectCurve {
 public:
  /// @param space has to outlive it.
  /// @param strengths of each simulation, one or more other than `base`; several may be equal (other seeds).
  /// @param differences p x as many: features less the space's center.
  /// @param base strength that the model has. @param saturating see StrengthLaw.
  /// Throws std::invalid_argument if numbers do not fit or are not finite.
  EffectCurve(const NuisanceSpace& space, const std::vector<double>& strengths, const Eigen::MatrixXd& differences,
              double base = 0, bool saturating = false)
      : space_(&space) {
    expects(differences.rows() == space.features(), "EffectCurve: features", "as many as of the space",
            differences.rows());
    expects(differences.cols() == static_cast<Eigen::Index>(strengths.size()), "EffectCurve: strengths",
            "one for each simulation", strengths.size());
    expects(differences.allFinite(), "EffectCurve: features", "finite", "others");
    std::set<double> distinct;
    range_ = {base, base};
    for (const double strength : strengths) {
      expects(std::isfinite(strength), "EffectCurve: strength", "finite", strength);
      range_ = {std::min(range_.first, strength), std::max(range_.second, strength)};
      if (strength != base) {
        distinct.insert(strength);
      }
    }
    expects(!distinct.empty(), "EffectCurve: strengths", "at least one other than the base", base);
    law_ = {base, std::max(range_.second - base, base - range_.first), saturating};

    const Eigen::Index terms = distinct.size() > 1 ? 2 : 1;
    Eigen::MatrixXd at(terms, differences.cols()), standardised(differences.rows(), differences.cols());
    for (Eigen::Index k = 0; k < differences.cols(); ++k) {
      const std::array<double, 2> law = law_(strengths[static_cast<std::size_t>(k)]);
      for (Eigen::Index term = 0; term < terms; ++term) {
        at(term, k) = law[static_cast<std::size_t>(term)];
      }
      standardised.col(k) = space.standardised_difference(differences.col(k));
    }
    coefficient_.setZero(differences.rows(), 2);
    const Eigen::MatrixXd normal = at * at.transpose();
    coefficient_.leftCols(terms) = normal.ldlt().solve(at * standardised.transpose()).transpose();
    for (Eigen::Index i = 0; i < 2; ++i) {
      for (Eigen::Index j = 0; j < 2; ++j) {
        square_(i, j) = space.inner(coefficient_.col(i), coefficient_.col(j));
      }
    }
  }

  /// What the effect changes, in standardised features.
  Eigen::VectorXd at(double strength) const {
    const std::array<double, 2> law = law_(strength);
    return law[0] * coefficient_.col(0) + law[1] * coefficient_.col(1);
  }

  /// From the base to the largest strengths that were simulated.
  const std::pair<double, double>& range() const noexcept { return range_; }

  /// How far standardised features are from the curve.
  StrengthProfile profile(const Eigen::VectorXd& standardised) const {
    const Eigen::Vector2d answer(space_->inner(standardised, coefficient_.col(0)),
                                 space_->inner(standardised, coefficient_.col(1)));
    return {law_, range_, space_->distance(standardised), answer, square_};
  }

 private:
  const NuisanceSpace* space_;
  StrengthLaw law_;
  std::pair<double, double> range_;
  Eigen::MatrixXd coefficient_;  ///< p x 2
  Eigen::Matrix2d square_;
};

}  // namespace decant::inline DECANT_TARGET
