// SPDX-License-Identifier: MIT
#pragma once

/// Fits the liquid's outline to the observed one, disc by disc: the last pixel.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <decant/camera/distorted_pinhole_camera.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>
#include <decant/correction/concept.hpp>
#include <decant/correction/silhouettes.hpp>

namespace decant {

/// Settings of EdgeFit.
struct EdgeFitSettings {
  double push = 0.8;                 ///< share of the depth to which a disc reaches beyond the outline, 0 .. 1
  double pull = 0.8;                 ///< share of the mean distance to observed pixels that no disc covers, 0 .. 1
  double reach_px = 3;               ///< pixels farther from a disc do not pull it, > 0
  double longest_in_spacings = 0.5;  ///< longest move per call, over the spacing, > 0
};

/// A silhouette of discs is off by a pixel all along its edge even where the liquid is in its place, and that is most
/// of what is left when SilhouetteTransport is done. Two small moves mend it, each of particles in sight across the
/// line of sight, and each zero where prediction and observation agree.
/// - A disc that reaches beyond the observed outline is pushed back by as much. The part of a disc of radius r beyond a
///   straight line at the distance h from its centre has the first moment 2/3 (r^2 - h^2)^(3/2), across the line:
///   summed over pixels, it gives direction and depth r - h without looking for a line in a ragged mask. What sticks
///   out on both sides, as a thin jet does, stays.
/// - Observed pixels that no disc covers pull the disc next to them, by the mean of their distances from its rim; one
/// or
///   two of them are noise and pull less.
/// Moves are too small to say anything of velocities.
template <class ScalarType = float, class CameraType = DistortedPinholeCamera>
class EdgeFit {
 public:
  using Scalar = ScalarType;
  using Observation = Silhouettes<CameraType>;
  using Settings = EdgeFitSettings;

  EdgeFit() : EdgeFit(Settings{}) {}

  /// Throws std::invalid_argument if a setting is out of range.
  explicit EdgeFit(const Settings& settings) : settings_(settings) {
    const auto share = [](double value, const char* name) { expects(value >= 0 && value <= 1, name, "0 .. 1", value); };
    const auto positive = [](double value, const char* name) {
      expects(value > 0 && std::isfinite(value), name, "> 0", value);
    };
    share(settings.push, "EdgeFit: push");
    share(settings.pull, "EdgeFit: pull");
    positive(settings.reach_px, "EdgeFit: reach_px");
    positive(settings.longest_in_spacings, "EdgeFit: longest_in_spacings");
  }

  void reset() noexcept {}

  CorrectionReport correct(FluidState<Scalar>& fluid, const Observation& seen, Scalar) noexcept {
    CorrectionReport report;
    double total = 0;
    for (const SilhouetteView<CameraType>& view : seen.views) {
      place_discs(fluid, seen, view);
      push_back(view, seen.threads);
      pull_out(view);
      for (std::size_t i = 0; i < discs_.size(); ++i) {
        const Vector3<double> move = move_of(discs_[i], seen.spacing);
        if (move.squaredNorm() > 0) {
          fluid.position.col(static_cast<Index>(i)) += move.template cast<Scalar>();
          ++report.moved;
          total += move.norm();
        }
      }
    }
    report.mean_shift = report.moved > 0 ? total / static_cast<double>(report.moved) : 0;
    return report;
  }

 private:
  using Pixels = Eigen::Vector2d;

  /// A particle in the image.
  struct Disc {
    Pixels center{0, 0};
    double radius = 0;  ///< [px]; 0 if it is not in sight
    Eigen::Matrix<double, 2, 3> jacobian = Eigen::Matrix<double, 2, 3>::Zero();
    Pixels wanted{0, 0};  ///< how it is to move [px]
    Pixels pull{0, 0};    ///< sum over the pixels that pull it
    int pulling = 0;      ///< how many
  };

  void place_discs(const FluidState<Scalar>& fluid, const Observation& seen,
                   const SilhouetteView<CameraType>& view) noexcept {
    discs_.assign(static_cast<std::size_t>(fluid.size()), Disc{});
    parallel_for(fluid.size(), seen.threads, [&](Index i) {
      const Vector3<double> x = fluid.position.col(i).template cast<double>();
      const Projection at = view.camera().project(x);
      if (view.hidden[static_cast<std::size_t>(i)] == 0 && at.visible) {
        Disc& disc = discs_[static_cast<std::size_t>(i)];
        disc.center = at.pixel;
        disc.jacobian = view.camera().jacobian(x);
        disc.radius = seen.radius * std::sqrt(0.5 * disc.jacobian.squaredNorm());
      }
    });
  }

  void push_back(const SilhouetteView<CameraType>& view, Threads threads) noexcept {
    parallel_for(static_cast<Index>(discs_.size()), threads, [&](Index i) {
      Disc& disc = discs_[static_cast<std::size_t>(i)];
      Pixels moment(0, 0);
      for_each_pixel(disc, 0, *view.observed, [&](Index v, Index u, const Pixels& offset) {
        if (!is_liquid((*view.observed)(v, u)) && is_liquid((*view.predicted)(v, u))) {
          moment += offset;
        }
      });
      const double size = moment.norm();
      if (size > 0) {
        const double root = std::cbrt(1.5 * size);
        const double h_squared = disc.radius * disc.radius - root * root;
        disc.wanted -= settings_.push * (disc.radius - std::sqrt(std::max(0.0, h_squared))) / size * moment;
      }
    });
  }

  void pull_out(const SilhouetteView<CameraType>& view) noexcept {
    const Mask& observed = *view.observed;
    rim_distance_.setConstant(observed.rows(), observed.cols(), unreached);
    nearest_.resize(observed.rows(), observed.cols());
    for (std::size_t i = 0; i < discs_.size(); ++i) {
      for_each_pixel(discs_[i], settings_.reach_px, observed, [&](Index v, Index u, const Pixels& offset) {
        if (is_liquid(observed(v, u)) && !is_liquid((*view.predicted)(v, u))) {
          const auto distance = static_cast<float>(offset.norm() - discs_[i].radius);
          if (distance < rim_distance_(v, u)) {
            rim_distance_(v, u) = distance;
            nearest_(v, u) = static_cast<std::int32_t>(i);
          }
        }
      });
    }
    for (Index v = 0; v < observed.rows(); ++v) {
      for (Index u = 0; u < observed.cols(); ++u) {
        if (rim_distance_(v, u) < unreached) {
          Disc& disc = discs_[static_cast<std::size_t>(nearest_(v, u))];
          const Pixels offset = Pixels(static_cast<double>(u), static_cast<double>(v)) - disc.center;
          // half a pixel more: a pixel is covered if its centre is within the disc
          const double distance = std::max(0.0, static_cast<double>(rim_distance_(v, u))) + 0.5;
          disc.pull += distance / offset.norm() * offset;
          ++disc.pulling;
        }
      }
    }
    for (Disc& disc : discs_) {
      disc.wanted += settings_.pull / std::max(3, disc.pulling) * disc.pull;
    }
  }

  /// The shortest move in space that moves a disc as it is to move [m].
  Vector3<double> move_of(const Disc& disc, double spacing) const noexcept {
    if (!(disc.wanted.squaredNorm() > 0)) {
      return Vector3<double>::Zero();
    }
    const Eigen::Matrix2d square = disc.jacobian * disc.jacobian.transpose();
    const Vector3<double> move = disc.jacobian.transpose() * square.ldlt().solve(disc.wanted);
    const double length = move.norm();
    return length > 0 && std::isfinite(length)
               ? Vector3<double>(std::min(1.0, settings_.longest_in_spacings * spacing / length) * move)
               : Vector3<double>::Zero();
  }

  /// Calls visit(v, u, offset from the centre) for the pixels of an image within `margin` of a disc [px].
  template <class Visit>
  static void for_each_pixel(const Disc& disc, double margin, const Mask& image, Visit visit) noexcept {
    if (!(disc.radius > 0)) {
      return;
    }
    const double radius = disc.radius + margin;
    const auto within = [](double value, Index size) {
      return static_cast<Index>(std::clamp(value, 0.0, static_cast<double>(size)));
    };
    const Index v_end = within(std::floor(disc.center.y() + radius) + 1, image.rows());
    const Index u_end = within(std::floor(disc.center.x() + radius) + 1, image.cols());
    for (Index v = within(std::ceil(disc.center.y() - radius), image.rows()); v < v_end; ++v) {
      for (Index u = within(std::ceil(disc.center.x() - radius), image.cols()); u < u_end; ++u) {
        const Pixels offset = Pixels(static_cast<double>(u), static_cast<double>(v)) - disc.center;
        if (offset.squaredNorm() <= radius * radius) {
          visit(v, u, offset);
        }
      }
    }
  }

  static constexpr float unreached = std::numeric_limits<float>::max();

  Settings settings_;
  std::vector<Disc> discs_{};
  Image<float> rim_distance_{};  ///< of observed pixels that no disc covers, to the disc nearest to them [px]
  Image<std::int32_t> nearest_{};
};
static_assert(Corrector<EdgeFit<>>);

}  // namespace decant
