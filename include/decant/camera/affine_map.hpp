// SPDX-License-Identifier: MIT
#pragma once

/// The map between the images of two cameras that look at the same scene from about the same place.

#include <cmath>

#include <Eigen/Core>
#include <Eigen/LU>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// x -> A x + b from one image's pixels to another's; always invertible. Named like a pose, image_from_thermal: the
/// recording format's affine_to_image takes a thermal pixel (u, v) to the colour image's pixel.
class AffineMap {
 public:
  using Matrix = Eigen::Matrix<double, 2, 3>;

  /// The identity.
  AffineMap() : matrix_(Matrix::Identity()) {}

  /// @param matrix [A b], b in pixels of the image that the map leads to. Entries are finite and at most 1e9 in
  /// magnitude, and A's two directions may not fall together, nor one of them vanish beside the other:
  /// |det A| > 1e-9 |A|^2, which holds for A exactly where it holds for its inverse. Throws std::invalid_argument.
  explicit AffineMap(const Matrix& matrix) : matrix_(matrix) {
    const double largest = matrix.array().isFinite().all() ? matrix.cwiseAbs().maxCoeff() : std::nan("");
    expects(largest <= 1e9, "AffineMap: largest coefficient", "finite and at most 1e9", largest);
    const double invertibility = std::abs(linear().determinant()) / linear().squaredNorm();
    expects(invertibility > 1e-9, "AffineMap: |det A| / |A|^2", "> 1e-9, so that the map has an inverse",
            invertibility);
  }

  /// Where a pixel of the first image falls in the second [px].
  Eigen::Vector2d apply(const Eigen::Vector2d& pixel) const noexcept { return linear() * pixel + offset(); }

  /// Many pixels at once, one a column.
  Eigen::Matrix2Xd apply_all(const Eigen::Ref<const Eigen::Matrix2Xd>& pixels) const {
    return (linear() * pixels).colwise() + offset();
  }

  /// From the second image back to the first.
  AffineMap inverse() const noexcept {
    AffineMap back;
    const Eigen::Matrix2d inverse_of_linear = linear().inverse();
    back.matrix_ << inverse_of_linear, -inverse_of_linear * offset();
    return back;
  }

  /// (c_from_b * b_from_a) is c_from_a: the right one first. Throws like the constructor.
  friend AffineMap operator*(const AffineMap& second, const AffineMap& first) {
    Matrix product;
    product << second.linear() * first.linear(), second.linear() * first.offset() + second.offset();
    return AffineMap(product);
  }

  /// [A b].
  const Matrix& matrix() const noexcept { return matrix_; }
  /// A, without unit: how far a pixel's move in the first image moves it in the second.
  Eigen::Matrix2d linear() const noexcept { return matrix_.leftCols<2>(); }
  /// b [px]: where the first image's pixel (0, 0) falls.
  Eigen::Vector2d offset() const noexcept { return matrix_.col(2); }

 private:
  Matrix matrix_;
};

}  // namespace decant::inline DECANT_TARGET
