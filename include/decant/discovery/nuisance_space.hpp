// SPDX-License-Identifier: MIT
#pragma once

/// How far apart two recordings' features are, counted in what differs anyway where no effect is missing.

#include <algorithm>
#include <cmath>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// Simulations of one interaction in which nothing is missing, as features in columns: rows are the same features
/// throughout (p of them).
struct NuisanceSample {
  Eigen::MatrixXd baseline{};    ///< p x b, b >= 1: the model as it is, with other seeds
  Eigen::MatrixXd draws{};       ///< p x n, n >= 4: with everything drawn that is tolerated (seed, spacing, poses, ...)
  Eigen::MatrixXd templates{};   ///< p x m: how features answer an error of measurement of one tolerance
  Eigen::MatrixXd references{};  ///< p x r: of recordings that are known to have no hidden effect, less the baseline of
                                 ///< their own poses
  double reference_error = 0.5;  ///< how much of their mean may not carry over, as a standard deviation, 0 .. 1
  Eigen::VectorXd floor{};       ///< by feature: its least standard deviation, > 0; the settings' where there is none

  /// The same as if one of the draws had not been made.
  NuisanceSample without_draw(Eigen::Index draw) const {
    return {baseline, without_column(draws, draw), templates, references, reference_error, floor};
  }
  /// Or one of the references.
  NuisanceSample without_reference(Eigen::Index reference) const {
    return {baseline, draws, templates, without_column(references, reference), reference_error, floor};
  }

 private:
  static Eigen::MatrixXd without_column(const Eigen::MatrixXd& all, Eigen::Index column) {
    Eigen::MatrixXd rest(all.rows(), all.cols() - 1);
    rest.leftCols(column) = all.leftCols(column);
    rest.rightCols(rest.cols() - column) = all.rightCols(rest.cols() - column);
    return rest;
  }
};

/// Settings of NuisanceSpace.
struct NuisanceSettings {
  double floor = 0.1;             ///< least standard deviation of a feature, in its unit, > 0
  int directions = 12;            ///< in which all features vary together, >= 0; at most a quarter of the draws
  double template_deviation = 3;  ///< how many times its tolerance an error of measurement may be, >= 0
};

/// Features are standardised, z = (y - f) / s, with f half the mean of the baseline and half that of the draws, and s
/// what the draws are off from f by, plus a floor. What they have in common is a covariance of low rank over noise,
///   Sigma = rho I + sum_k (lambda_k - rho) v_k v_k' + sum_m t^2 w_m w_m',
/// where lambda_k, v_k are the largest principal components of the draws, rho the mean variance of what is left (by the
/// degrees of freedom that are left), and w_m the templates, t times their size. Distances are z' Sigma^-1 z / p, about
/// 1 for a draw that the space was not made of: one that is among its draws is far nearer, so calibrate on
/// NuisanceSample::without_draw. Generalised least squares (Rao, Linear Statistical Inference, 1973, section 4a), with
/// the covariance of factor analysis. The mean residual of references is what reality does differently whatever is
/// missing: take it off what was recorded (as_modelled). What of it may not carry over, and what they scatter, is added
/// to what varies. A single direction that varies counts for next to nothing among p features, however large.
class NuisanceSpace {
 public:
  using Vector = Eigen::VectorXd;
  using Matrix = Eigen::MatrixXd;

  /// Throws std::invalid_argument if a setting is out of range, or the sample's matrices do not fit or are not finite.
  explicit NuisanceSpace(const NuisanceSample& sample, const NuisanceSettings& settings = {}) {
    check(sample, settings);
    const Eigen::Index features = sample.draws.rows();
    center_ = 0.5 * (sample.baseline.rowwise().mean() + sample.draws.rowwise().mean());
    always_ = Vector::Zero(features);
    Matrix off = sample.draws.colwise() - center_;
    Matrix templates = sample.templates;
    Vector variance = off.array().square().rowwise().mean();
    if (sample.floor.size() > 0) {
      variance += sample.floor.cwiseAbs2();
    } else {
      variance.array() += settings.floor * settings.floor;
    }
    if (sample.references.cols() > 0) {
      always_ = sample.references.rowwise().mean();
      const Matrix scatter = sample.references.colwise() - always_;
      const Vector error = sample.reference_error * always_;
      variance.array() += scatter.array().square().rowwise().mean() + error.array().square();
      append(off, scatter);
      append(templates, error / std::max(settings.template_deviation, 1e-300));
    }
    inverse_deviation_ = variance.array().rsqrt();
    off = inverse_deviation_.asDiagonal() * off;

    Matrix common(features, 0);  // directions that vary more than noise, as long as their deviation beyond it
    const Components components = principal(off / std::sqrt(static_cast<double>(off.cols())));
    const Eigen::Index kept =
        std::min<Eigen::Index>({settings.directions, off.cols() / 4, components.direction.cols()});
    // each direction that is kept has taken one of the draws' degrees of freedom
    const double left = (components.variance.sum() - components.variance.head(kept).sum()) *
                        static_cast<double>(off.cols()) / static_cast<double>(off.cols() - kept);
    // with as few features as draws nothing may be left: then noise is what the floor makes of it
    noise_ = std::max(left / static_cast<double>(std::max<Eigen::Index>(1, features - kept)), 1e-3);
    for (Eigen::Index k = 0; k < kept; ++k) {
      append(common, components.direction.col(k) * std::sqrt(std::max(0.0, components.variance[k] - noise_)));
    }
    for (Eigen::Index m = 0; m < templates.cols(); ++m) {
      append(common, settings.template_deviation * (inverse_deviation_.asDiagonal() * templates.col(m)));
    }
    const Components all = principal(common);
    direction_ = all.direction;
    // 1 / rho - 1 / (rho + g) = g / (rho + g) / rho
    taken_ = all.variance.array() / (noise_ + all.variance.array());
  }

  Eigen::Index features() const noexcept { return center_.size(); }
  /// What the model predicts where nothing is missing.
  const Vector& center() const noexcept { return center_; }
  /// What a model would have to predict for features that were recorded: without what references are off from theirs.
  Vector as_modelled(const Vector& recorded) const { return recorded - always_; }
  /// Variance of standardised features beyond what they have in common.
  double noise() const noexcept { return noise_; }

  /// How far features are from the center, in their standard deviations. @param features p of them.
  Vector standardised(const Vector& features) const { return inverse_deviation_.cwiseProduct(features - center_); }
  /// The same of a difference between features.
  Vector standardised_difference(const Vector& difference) const { return inverse_deviation_.cwiseProduct(difference); }

  /// a' Sigma^-1 b / p, of standardised features.
  double inner(const Vector& a, const Vector& b) const {
    const Vector own = direction_.transpose() * a, other = direction_.transpose() * b;
    return (a.dot(b) - (taken_.array() * own.array() * other.array()).sum()) /
           (noise_ * static_cast<double>(features()));
  }
  /// From the center, of standardised features.
  double distance(const Vector& a) const { return inner(a, a); }

 private:
  struct Components {
    Matrix direction;  ///< orthonormal columns
    Vector variance;   ///< by column, the largest first, > 0
  };

  static void check(const NuisanceSample& sample, const NuisanceSettings& settings) {
    expects(settings.floor > 0 && std::isfinite(settings.floor), "NuisanceSpace: floor", "> 0", settings.floor);
    expects(settings.directions >= 0, "NuisanceSpace: directions", ">= 0", settings.directions);
    expects(settings.template_deviation >= 0 && std::isfinite(settings.template_deviation),
            "NuisanceSpace: template_deviation", ">= 0", settings.template_deviation);
    expects(sample.reference_error >= 0 && sample.reference_error <= 1, "NuisanceSpace: reference_error", "0 .. 1",
            sample.reference_error);
    expects(sample.draws.cols() >= 4, "NuisanceSpace: draws", "at least 4", sample.draws.cols());
    expects(sample.baseline.cols() >= 1, "NuisanceSpace: baseline", "at least one simulation", sample.baseline.cols());
    expects(sample.draws.rows() >= 1, "NuisanceSpace: features", "at least one", sample.draws.rows());
    expects(sample.floor.size() == 0 || sample.floor.size() == sample.draws.rows(), "NuisanceSpace: floors",
            "one for each feature", sample.floor.size());
    expects(sample.floor.size() == 0 || (sample.floor.minCoeff() > 0 && sample.floor.allFinite()),
            "NuisanceSpace: floors", "> 0 and finite", sample.floor.size() == 0 ? 0 : sample.floor.minCoeff());
    for (const Matrix* each : {&sample.draws, &sample.baseline, &sample.templates, &sample.references}) {
      expects(each->cols() == 0 || each->rows() == sample.draws.rows(), "NuisanceSpace: features of all matrices",
              "as many as of the draws", each->rows());
      expects(each->allFinite(), "NuisanceSpace: features", "finite", "others");
    }
  }

  static void append(Matrix& matrix, const Matrix& columns) {
    matrix.conservativeResize(columns.rows(), matrix.cols() + columns.cols());
    matrix.rightCols(columns.cols()) = columns;
  }

  /// Of matrix * matrix', from the small matrix' * matrix: there are thousands of features and dozens of columns.
  static Components principal(const Matrix& matrix) {
    if (matrix.cols() == 0) {
      return {Matrix(matrix.rows(), 0), Vector(0)};
    }
    const Eigen::SelfAdjointEigenSolver<Matrix> solver(matrix.transpose() * matrix);
    const double largest = std::max(0.0, solver.eigenvalues()[matrix.cols() - 1]);
    Components found{Matrix(matrix.rows(), 0), Vector(0)};
    for (Eigen::Index k = matrix.cols() - 1; k >= 0; --k) {
      const double variance = solver.eigenvalues()[k];
      if (!(variance > 1e-12 * largest)) {
        break;
      }
      append(found.direction, matrix * solver.eigenvectors().col(k) / std::sqrt(variance));
      found.variance.conservativeResize(found.variance.size() + 1);
      found.variance[found.variance.size() - 1] = variance;
    }
    return found;
  }

  Vector center_;
  Vector always_;  ///< mean residual of references
  Vector inverse_deviation_;
  Matrix direction_;
  Vector taken_;
  double noise_ = 1;
};

}  // namespace decant::inline DECANT_TARGET
