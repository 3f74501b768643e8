// SPDX-License-Identifier: MIT
#pragma once

/// Finds the affine map between two images from points that were found in both, such as a board's corners.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string_view>

#include <Eigen/Core>
#include <Eigen/LU>

#include <decant/camera/affine_map.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

struct AffineFitSettings {
  bool refuse_outliers = true;  ///< false: least squares over all pairs

  /// How far a correct pair may lie from the best affine map [px], > 0. An affine map knows neither lens distortion nor
  /// perspective, so correct pairs miss it by several pixels; such a miss is the model's fault, and leaving the
  /// image's corners out would hide it. 8.5 px on a board that fills a third of a 640 x 480 image. Points taken for
  /// their neighbors, which is how corners go wrong, miss it by a square of the board.
  double largest_model_error_px = 12;

  /// Pairs within this many robust standard deviations are kept as well, >= 2: where points are found only roughly, the
  /// model error alone would refuse good ones. Of pairs with Gaussian errors, all but 3e-4 lie within 4.
  double scatter_factor = 4;
};

enum class AffineFitStatus {
  Good,        ///< more than half of the pairs agree, and pairs are left to check the map with
  Unverified,  ///< at most four pairs: if one of them were wrong, nothing would tell which
  Scattered,   ///< at most half of the pairs come within largest_model_error_px: do not use the map
};

/// The status in words.
constexpr std::string_view to_string(AffineFitStatus status) noexcept {
  switch (status) {
    case AffineFitStatus::Good:
      return "good";
    case AffineFitStatus::Unverified:
      return "too few pairs to tell a wrong one";
    case AffineFitStatus::Scattered:
      break;
  }
  return "more than half of the pairs follow no common affine map";
}

struct AffineFit {
  AffineMap map;                                 ///< to_from_from
  Eigen::Array<bool, Eigen::Dynamic, 1> inlier;  ///< per pair, whether the map was fitted to it
  Index inliers = 0;
  double rms_px = 0;      ///< root of the mean squared distance of an inlier's image from its partner
  double largest_px = 0;  ///< the largest such distance
  AffineFitStatus status = AffineFitStatus::Good;
};

namespace detail {

using Points2 = Eigen::Matrix2Xd;

// Distances of the mapped points from their partners [px].
inline Eigen::ArrayXd affine_residuals(const AffineMap::Matrix& map, const Points2& from, const Points2& to) {
  return (((map.leftCols<2>() * from).colwise() + map.col(2)) - to).colwise().norm().transpose().array();
}

// Root mean squared distance [px] from the straight line that fits the points best: zero if they are collinear.
inline double extent_across(const Points2& points) {
  const Points2 centred = points.colwise() - points.rowwise().mean();
  // The smaller eigenvalue of the 2 x 2 scatter, from its determinant and the larger one: Eigen's solver, which is
  // written for any size, takes compilers several seconds.
  const double xx = centred.row(0).squaredNorm(), yy = centred.row(1).squaredNorm();
  const double xy = centred.row(0).dot(centred.row(1));
  const double larger = 0.5 * (xx + yy) + std::hypot(0.5 * (xx - yy), xy);
  return larger > 0 ? std::sqrt(std::max(0.0, (xx * yy - xy * xy) / larger) / static_cast<double>(points.cols())) : 0;
}

// Whether the chosen points fix a map in both directions.
inline bool spread_enough(const Points2& points, const Eigen::Array<bool, Eigen::Dynamic, 1>& chosen) {
  Points2 these(2, chosen.count());
  Index next = 0;
  for (Index i = 0; i < points.cols(); ++i) {
    if (chosen(i)) {
      these.col(next++) = points.col(i);
    }
  }
  return these.cols() >= 3 && extent_across(these) >= 0.5;
}

// Least squares over the chosen pairs. About their centroids offset and linear part decouple, and the 2x2 normal
// equations are as well conditioned as the points are spread.
inline AffineMap::Matrix least_squares_affine(const Points2& from, const Points2& to,
                                              const Eigen::Array<bool, Eigen::Dynamic, 1>& chosen) {
  const Eigen::RowVectorXd weight = chosen.cast<double>().matrix().transpose() / static_cast<double>(chosen.count());
  // sums of some dozen terms: lazyProduct spares compilers Eigen's product of large matrices
  const Eigen::Vector2d from_centre = from.lazyProduct(weight.transpose());
  const Eigen::Vector2d to_centre = to.lazyProduct(weight.transpose());
  const Points2 centred = from.colwise() - from_centre, to_centred = to.colwise() - to_centre;
  const Points2 weighted = centred.array().rowwise() * weight.array();
  const Eigen::Matrix2d linear = Eigen::Matrix2d(to_centred.lazyProduct(weighted.transpose())) *
                                 Eigen::Matrix2d(centred.lazyProduct(weighted.transpose())).inverse();
  AffineMap::Matrix map;
  map << linear, to_centre - linear * from_centre;
  return map;
}

// Numbers that look random and are the same every time (Steele, Lea & Flood 2014, SplitMix64).
class SplitMix64 {
 public:
  std::uint64_t next() noexcept {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15U);
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
    return z ^ (z >> 31U);
  }

 private:
  std::uint64_t state_ = 0;
};

// Calls f(i, j, k) for every triple of `count` points where these are few, else for 10,000 drawn ones: among so many,
// triples without an outlier are found even where half of the points are outliers (one triple in eight is clean).
template <class Function>
void for_each_triple(Index count, Function&& f) {
  if (count <= 40) {
    for (Index i = 0; i < count; ++i) {
      for (Index j = i + 1; j < count; ++j) {
        for (Index k = j + 1; k < count; ++k) {
          f(i, j, k);
        }
      }
    }
    return;
  }
  SplitMix64 draw;
  const auto any = [&] { return static_cast<Index>(draw.next() % static_cast<std::uint64_t>(count)); };
  for (int n = 0; n < 10000; ++n) {
    const Index i = any(), j = any(), k = any();
    if (i != j && j != k && k != i) {
      f(i, j, k);
    }
  }
}

struct MedianFit {
  AffineMap::Matrix map = AffineMap::Matrix::Identity();
  double scale_px = 0;  // robust standard deviation of the pairs per axis
};

// How many pairs have to agree: with so many, no other map can have as many pairs without sharing three of them.
inline Index majority(Index count) { return (count + 4) / 2; }

// A Gaussian's standard deviation per axis from the distance within which `majority` of the pairs lie: the square of a
// distance in the plane is exponential, so half of them lie within sqrt(2 ln 2) deviations. The last factor makes up
// for small samples (Rousseeuw & Leroy 1987, p. 202), with three points taken up by the fit.
inline double robust_scale(Eigen::ArrayXd residuals) {
  const auto middle = residuals.data() + majority(residuals.size()) - 1;
  std::nth_element(residuals.data(), middle, residuals.data() + residuals.size());
  const double spare = static_cast<double>(std::max<Index>(1, residuals.size() - 3));
  return *middle / std::sqrt(2 * std::log(2.0)) * (1 + 5 / spare);
}

// Least median of squares (Rousseeuw 1984): the map through three pairs that comes closest to more than half of all.
inline MedianFit least_median_affine(const Points2& from, const Points2& to) {
  MedianFit best;
  best.scale_px = std::numeric_limits<double>::infinity();
  for_each_triple(from.cols(), [&](Index i, Index j, Index k) {
    const Eigen::Vector2d origin = from.col(i);
    Eigen::Matrix2d from_edges, to_edges;
    from_edges << from.col(j) - origin, from.col(k) - origin;
    to_edges << to.col(j) - to.col(i), to.col(k) - to.col(i);
    // a triangle less than half a pixel high fixes nothing across it
    const double longest = std::max(from_edges.colwise().norm().maxCoeff(), (from.col(k) - from.col(j)).norm());
    if (!(std::abs(from_edges.determinant()) > 0.5 * longest)) {
      return;
    }
    AffineMap::Matrix map;
    map.leftCols<2>() = to_edges * from_edges.inverse();
    map.col(2) = to.col(i) - map.leftCols<2>() * origin;
    const double scale = robust_scale(affine_residuals(map, from, to));
    if (scale < best.scale_px) {
      best = {map, scale};
    }
  });
  return best;
}

inline Index affine_fit_check(const Points2& from, const Points2& to, const AffineFitSettings& settings) {
  expects(settings.largest_model_error_px > 0 && std::isfinite(settings.largest_model_error_px),
          "fit_affine: largest_model_error_px", "> 0 and finite", settings.largest_model_error_px);
  // a majority lies within 1.2 robust deviations, so from 2 on a majority is always kept
  expects(settings.scatter_factor >= 2 && std::isfinite(settings.scatter_factor), "fit_affine: scatter_factor",
          ">= 2 and finite", settings.scatter_factor);
  expects(from.cols() >= 3, "fit_affine: number of point pairs", ">= 3", from.cols());
  expects(to.cols() == from.cols(), "fit_affine: number of points in `to`", "that of `from`", to.cols());
  for (const Points2* points : {&from, &to}) {
    const bool finite = points->array().isFinite().all();
    const double largest = finite ? points->cwiseAbs().maxCoeff() : std::nan("");
    expects(largest <= 1e6, "fit_affine: largest coordinate [px]", "finite and at most 1e6", largest);
    const double across = extent_across(*points);
    expects(across >= 1, "fit_affine: root mean square distance of the points from a common line [px]",
            ">= 1, or nothing is known across it", across);
  }
  return from.cols();
}

}  // namespace detail

/// The affine map that takes the points `from` nearest to their partners `to`, both 2xN [px], one point a column.
///
/// Outliers are refused in three steps: least median of squares (Rousseeuw 1984, "Least Median of Squares Regression")
/// over all triples of pairs, or over 10,000 drawn ones above 40 pairs; keep what lies within largest_model_error_px
/// or scatter_factor robust deviations; least squares over these, and again until the kept ones stay the same. Up to
/// (N - 3) / 2 wrong pairs are found, if they are wrong by more than those bounds and do not agree with each other.
/// Same input, same output. Takes milliseconds for a board's corners. For set-up: allocates.
///
/// Throws std::invalid_argument for fewer than 3 pairs, sizes that disagree, coordinates that are not finite or beyond
/// 1e6, points of which all lie on a line to within a pixel, a setting out of range, and if the map found has no
/// inverse. Look at status before using the map.
[[nodiscard]] inline AffineFit fit_affine(const Eigen::Ref<const Eigen::Matrix2Xd>& from,
                                          const Eigen::Ref<const Eigen::Matrix2Xd>& to,
                                          const AffineFitSettings& settings = {}) {
  const detail::Points2 source = from;
  const detail::Points2 target = to;
  const Index count = detail::affine_fit_check(source, target, settings);

  AffineFit fit;
  fit.inlier.setConstant(count, true);
  AffineMap::Matrix map = detail::least_squares_affine(source, target, fit.inlier);
  Eigen::ArrayXd residuals = detail::affine_residuals(map, source, target);
  const detail::MedianFit median =
      settings.refuse_outliers ? detail::least_median_affine(source, target) : detail::MedianFit{};
  if (std::isfinite(median.scale_px) && settings.refuse_outliers) {
    Eigen::ArrayXd distances = detail::affine_residuals(median.map, source, target);
    double scale = median.scale_px;
    // settles in two or three rounds; the bound is against sets that alternate
    for (int round = 0; round < 30; ++round) {
      const double bound = std::max(settings.largest_model_error_px, settings.scatter_factor * scale);
      const Eigen::Array<bool, Eigen::Dynamic, 1> kept = distances <= bound;
      if ((round > 0 && (kept == fit.inlier).all()) || !detail::spread_enough(source, kept)) {
        break;
      }
      fit.inlier = kept;
      map = detail::least_squares_affine(source, target, kept);
      distances = residuals = detail::affine_residuals(map, source, target);
      scale = detail::robust_scale(distances);
    }
  }

  fit.map = AffineMap(map);
  fit.inliers = fit.inlier.count();
  const Eigen::ArrayXd of_inliers = fit.inlier.select(residuals, 0);
  fit.rms_px = std::sqrt(of_inliers.square().sum() / static_cast<double>(fit.inliers));
  fit.largest_px = of_inliers.maxCoeff();
  const Index near = (residuals <= settings.largest_model_error_px).count();
  fit.status = count < 5                        ? AffineFitStatus::Unverified
               : near < detail::majority(count) ? AffineFitStatus::Scattered
                                                : AffineFitStatus::Good;
  return fit;
}

}  // namespace decant::inline DECANT_TARGET
