// SPDX-License-Identifier: MIT
#pragma once

/// The camera with a lens that bends straight lines.

#include <algorithm>
#include <cmath>
#include <limits>

#include <decant/camera/concept.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>

namespace decant::inline DECANT_TARGET {

/// Coefficients of the lens model "plumb_bob" (D. C. Brown 1966; J.-Y. Bouguet's calibration toolbox), in the order of
/// OpenCV's and ROS's arrays. All are without unit.
struct LensDistortion {
  double k1 = 0, k2 = 0;  ///< radial
  double p1 = 0, p2 = 0;  ///< tangential
  double k3 = 0;          ///< radial
};

/// Central projection through a lens: with a = x/z, b = y/z, r^2 = a^2 + b^2 and c = 1 + k1 r^2 + k2 r^4 + k3 r^6,
///   a' = c a + 2 p1 a b + p2 (r^2 + 2 a^2),   u = fx a' + cx
///   b' = c b + p1 (r^2 + 2 b^2) + 2 p2 a b,   v = fy b' + cy.
/// Such polynomials hold within the calibrated image only: farther out they may turn round and fold what is far beside
/// the camera back into its image. What is at or beyond largest_radius() counts as out of sight: it is not projected.
class DistortedPinholeCamera {
 public:
  /// Throws std::invalid_argument unless every coefficient is finite and within 1e6.
  DistortedPinholeCamera(const PinholeCamera& pinhole, const LensDistortion& lens)
      : pinhole_(pinhole), lens_(lens), radius_(first_fold(lens)) {
    const double largest =
        std::max({std::abs(lens.k1), std::abs(lens.k2), std::abs(lens.p1), std::abs(lens.p2), std::abs(lens.k3)});
    const bool finite = std::isfinite(lens.k1) && std::isfinite(lens.k2) && std::isfinite(lens.p1) &&
                        std::isfinite(lens.p2) && std::isfinite(lens.k3);
    expects(finite && largest <= 1e6, "DistortedPinholeCamera: coefficient of the lens [-]", "finite and within 1e6",
            finite ? largest : std::numeric_limits<double>::quiet_NaN());
  }

  Projection project(const Vector3<double>& x_in_camera) const noexcept {
    Projection seen;
    Eigen::Vector2d place;
    if (!place_of(x_in_camera, place)) {
      return seen;
    }
    const Eigen::Vector2d bent = distorted(place);
    seen.pixel = {pinhole_.fx() * bent.x() + pinhole_.cx(), pinhole_.fy() * bent.y() + pinhole_.cy()};
    seen.depth = x_in_camera.z();
    seen.visible = inside_image(seen.pixel, width(), height());
    return seen;
  }

  /// Accurate to 1e-12 times the focal length, but for pixels where the lens is close to folding. Where no point falls
  /// on the pixel, a point at the edge of what the lens takes in, whose projection is another pixel.
  Vector3<double> unproject(const Eigen::Vector2d& pixel, double depth) const noexcept {
    if (depth == 0) {
      return Vector3<double>::Zero();  // every ray's beginning, which occlusion asks for often
    }
    const Eigen::Vector2d bent((pixel.x() - pinhole_.cx()) / pinhole_.fx(),
                               (pixel.y() - pinhole_.cy()) / pinhole_.fy());
    const Eigen::Vector2d place = undistorted(bent);
    return {place.x() * depth, place.y() * depth, depth};
  }

  Eigen::Matrix<double, 2, 3> jacobian(const Vector3<double>& x_in_camera) const noexcept {
    Eigen::Matrix<double, 2, 3> rate = Eigen::Matrix<double, 2, 3>::Zero();
    Eigen::Vector2d place;
    if (place_of(x_in_camera, place)) {
      const double over_z = 1 / x_in_camera.z();
      Eigen::Matrix<double, 2, 3> of_place;
      of_place << over_z, 0, -place.x() * over_z,  //
          0, over_z, -place.y() * over_z;
      rate = Eigen::Vector2d(pinhole_.fx(), pinhole_.fy()).asDiagonal() * (bending(place) * of_place);
    }
    return rate;
  }

  /// Where the lens sends (x/z, y/z). May be asked beyond largest_radius(), where it means nothing.
  Eigen::Vector2d distorted(const Eigen::Vector2d& place) const noexcept {
    const double a = place.x();
    const double b = place.y();
    const double r2 = a * a + b * b;
    const double c = stretch(r2);
    return {c * a + 2 * lens_.p1 * a * b + lens_.p2 * (r2 + 2 * a * a),
            c * b + lens_.p1 * (r2 + 2 * b * b) + 2 * lens_.p2 * a * b};
  }

  /// The inverse of `distorted`, by Newton's method with steps that are halved until they lead nearer and stay within
  /// largest_radius(); ends when it is off by 1e-12 or less. Where that cannot be had, as near as it came.
  Eigen::Vector2d undistorted(const Eigen::Vector2d& bent) const noexcept {
    Eigen::Vector2d place = Eigen::Vector2d::Zero();
    Eigen::Vector2d error = bent;
    double distance = error.norm();
    const double tolerance = 1e-12 * std::max(1.0, distance);
    // Newton squares the error: 5 rounds are usual, more are needed only where the lens all but folds
    for (int round = 0; round < 100 && distance > tolerance; ++round) {
      const Eigen::Vector2d step = bending(place).inverse() * error;
      double fraction = 1;
      bool nearer = false;
      for (int halving = 0; halving < 40 && !nearer; ++halving, fraction /= 2) {
        const Eigen::Vector2d next = place + fraction * step;
        if (next.norm() < radius_) {
          const Eigen::Vector2d next_error = bent - distorted(next);
          const double next_distance = next_error.norm();
          if (next_distance < distance) {
            place = next;
            error = next_error;
            distance = next_distance;
            nearer = true;
          }
        }
      }
      if (!nearer) {
        break;
      }
    }
    return place;
  }

  /// The lens maps the disc x^2 + y^2 < (radius z)^2 one to one [-]; infinite for a lens that never folds. Where
  /// tangential distortion is strong, a little is left out on the side where the lens would go on.
  double largest_radius() const noexcept { return radius_; }

  const PinholeCamera& pinhole() const noexcept { return pinhole_; }
  const LensDistortion& lens() const noexcept { return lens_; }
  int width() const noexcept { return pinhole_.width(); }
  int height() const noexcept { return pinhole_.height(); }

 private:
  double stretch(double r2) const noexcept { return 1 + r2 * (lens_.k1 + r2 * (lens_.k2 + r2 * lens_.k3)); }

  // Derivative of `distorted`. It is symmetric: the lens is the gradient of a potential.
  Eigen::Matrix2d bending(const Eigen::Vector2d& place) const noexcept {
    const double a = place.x();
    const double b = place.y();
    const double r2 = a * a + b * b;
    const double c = stretch(r2);
    const double c_rate = lens_.k1 + r2 * (2 * lens_.k2 + r2 * 3 * lens_.k3);  // by r^2
    const double mixed = 2 * a * b * c_rate + 2 * lens_.p1 * a + 2 * lens_.p2 * b;
    Eigen::Matrix2d rate;
    rate << c + 2 * a * a * c_rate + 2 * lens_.p1 * b + 6 * lens_.p2 * a, mixed,  //
        mixed, c + 2 * b * b * c_rate + 6 * lens_.p1 * b + 2 * lens_.p2 * a;
    return rate;
  }

  bool place_of(const Vector3<double>& x_in_camera, Eigen::Vector2d& place) const noexcept {
    if (!detail::before_camera(x_in_camera)) {
      return false;
    }
    place = x_in_camera.head<2>() / x_in_camera.z();
    return place.norm() < radius_;
  }

  // The lens's derivative at radius r has the eigenvalues c and d(rc)/dr from the radial part; the tangential part
  // moves them by at most 6 r |(p1, p2)|. Within the disc where the smaller one stays positive, a disc being convex,
  // the lens is the gradient of a strictly convex function and hence one to one. Goes outward by steps that cannot jump
  // over a zero: each is no longer than the value over a bound of the slope.
  static double first_fold(const LensDistortion& lens) noexcept {
    const double tangential = 6 * std::hypot(lens.p1, lens.p2);
    const auto smallest = [&](double r) {
      const double r2 = r * r;
      const double across = 1 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3));
      const double along = 1 + r2 * (3 * lens.k1 + r2 * (5 * lens.k2 + r2 * 7 * lens.k3));
      return std::min(across, along) - r * tangential;
    };
    const auto steepest = [&](double r) {
      const double r2 = r * r;
      return tangential + r * (6 * std::abs(lens.k1) + r2 * (20 * std::abs(lens.k2) + r2 * 42 * std::abs(lens.k3)));
    };
    constexpr double nearly_zero = 1e-6;  // a lens that shrinks a million times is as good as folded
    constexpr double plane = 1e5;         // where before_camera ends
    double r = 0;
    for (int round = 0; round < 100000; ++round) {
      const double value = smallest(r);
      if (!(value > nearly_zero)) {
        return r;
      }
      if (r > plane) {
        return std::numeric_limits<double>::infinity();
      }
      const double reach = std::max(r, 1e-3);
      r += std::min(reach, value / steepest(r + reach));
    }
    return r;
  }

  PinholeCamera pinhole_;
  LensDistortion lens_;
  double radius_;
};
static_assert(CameraModel<DistortedPinholeCamera>);

}  // namespace decant::inline DECANT_TARGET
