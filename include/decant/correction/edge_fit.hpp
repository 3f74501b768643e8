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
#include <decant/core/pixel_box.hpp>
#include <decant/core/target.hpp>
#include <decant/correction/concept.hpp>
#include <decant/correction/silhouettes.hpp>
#include <decant/coverage/detail/mask_disagreement.hpp>

namespace decant::inline DECANT_TARGET {

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
      for (const Disc& disc : discs_) {
        const Vector3<double> move = move_of(disc, seen.spacing);
        if (move.squaredNorm() > 0) {
          fluid.position.col(disc.particle) += move.template cast<Scalar>();
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

  /// A particle in sight that masks disagree about.
  struct Disc {
    Index particle = 0;
    Pixels center{0, 0};
    double radius = 0;  ///< [px]
    Eigen::Matrix<double, 2, 3> jacobian = Eigen::Matrix<double, 2, 3>::Zero();
    Pixels wanted{0, 0};  ///< how it is to move [px]
    Pixels pull{0, 0};    ///< sum over the pixels that pull it
    int pulling = 0;      ///< how many
  };

  /// The discs that have to do with a pixel on which the masks disagree: nothing moves any other.
  void place_discs(const FluidState<Scalar>& fluid, const Observation& seen,
                   const SilhouetteView<CameraType>& view) noexcept {
    disagreement_.rebuild(*view.predicted, *view.observed);
    concerned_.assign(static_cast<std::size_t>(fluid.size()), 0);
    const auto disc_of = [&](Index i, const Projection& at) {
      Disc disc;
      disc.particle = i;
      disc.center = at.pixel;
      disc.jacobian = view.camera().jacobian(fluid.position.col(i).template cast<double>());
      disc.radius = seen.radius * std::sqrt(0.5 * disc.jacobian.squaredNorm());
      return disc;
    };
    const auto projection_of = [&](Index i) {
      return view.camera().project(fluid.position.col(i).template cast<double>());
    };
    parallel_for(fluid.size(), seen.threads, [&](Index i) {
      if (view.hidden[static_cast<std::size_t>(i)] != 0) {
        return;
      }
      const Projection at = projection_of(i);
      if (at.visible) {
        const Disc disc = disc_of(i, at);
        const PixelBox pixels = pixels_around(disc, settings_.reach_px, *view.observed);
        concerned_[static_cast<std::size_t>(i)] = disc.radius > 0 && disagreement_.any_in(pixels) ? 1 : 0;
      }
    });
    discs_.clear();
    for (Index i = 0; i < fluid.size(); ++i) {
      if (concerned_[static_cast<std::size_t>(i)] != 0) {
        discs_.push_back(disc_of(i, projection_of(i)));
      }
    }
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
    if (rim_distance_.rows() != observed.rows() || rim_distance_.cols() != observed.cols()) {
      rim_distance_.setConstant(observed.rows(), observed.cols(), unreached);
      nearest_.resize(observed.rows(), observed.cols());
    }
    reached_.clear();
    for (std::size_t i = 0; i < discs_.size(); ++i) {
      for_each_pixel(discs_[i], settings_.reach_px, observed, [&](Index v, Index u, const Pixels& offset) {
        if (is_liquid(observed(v, u)) && !is_liquid((*view.predicted)(v, u))) {
          const auto distance = static_cast<float>(offset.norm() - discs_[i].radius);
          if (distance < rim_distance_(v, u)) {
            if (rim_distance_(v, u) == unreached) {
              reached_.push_back(v * observed.cols() + u);
            }
            rim_distance_(v, u) = distance;
            nearest_(v, u) = static_cast<std::int32_t>(i);
          }
        }
      });
    }
    std::sort(reached_.begin(), reached_.end());
    for (const Index pixel : reached_) {
      float& rim_distance = rim_distance_.data()[pixel];
      Disc& disc = discs_[static_cast<std::size_t>(nearest_.data()[pixel])];
      const Pixels place(static_cast<double>(pixel % observed.cols()), static_cast<double>(pixel / observed.cols()));
      const Pixels offset = place - disc.center;
      // half a pixel more: a pixel is covered if its centre is within the disc
      const double distance = std::max(0.0, static_cast<double>(rim_distance)) + 0.5;
      disc.pull += distance / offset.norm() * offset;
      ++disc.pulling;
      rim_distance = unreached;
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

  /// The pixels of an image that a square around a disc and `margin` more [px] has.
  static PixelBox pixels_around(const Disc& disc, double margin, const Mask& image) noexcept {
    const double radius = disc.radius + margin;
    const auto within = [](double value, Index size) {
      return static_cast<int>(std::clamp(value, 0.0, static_cast<double>(size)));
    };
    return {within(std::ceil(disc.center.x() - radius), image.cols()),
            within(std::ceil(disc.center.y() - radius), image.rows()),
            within(std::floor(disc.center.x() + radius) + 1, image.cols()),
            within(std::floor(disc.center.y() + radius) + 1, image.rows())};
  }

  /// Calls visit(v, u, offset from the centre) for the pixels of an image within `margin` of a disc [px].
  template <class Visit>
  static void for_each_pixel(const Disc& disc, double margin, const Mask& image, Visit visit) noexcept {
    const double radius = disc.radius + margin;
    const PixelBox box = pixels_around(disc, margin, image);
    for (Index v = box.v_begin; v < box.v_end; ++v) {
      for (Index u = box.u_begin; u < box.u_end; ++u) {
        const Pixels offset = Pixels(static_cast<double>(u), static_cast<double>(v)) - disc.center;
        if (offset.squaredNorm() <= radius * radius) {
          visit(v, u, offset);
        }
      }
    }
  }

  static constexpr float unreached = std::numeric_limits<float>::max();

  Settings settings_;
  detail::MaskDisagreement disagreement_{};
  std::vector<std::uint8_t> concerned_{};  ///< N, 1 for the particles of discs_
  std::vector<Disc> discs_{};              ///< in the order of particles
  /// Of observed pixels that no disc covers, to the disc nearest to them [px]; unreached between calls.
  Image<float> rim_distance_{};
  Image<std::int32_t> nearest_{};
  std::vector<Index> reached_{};  ///< these pixels, row by row
};
static_assert(Corrector<EdgeFit<>>);

}  // namespace decant::inline DECANT_TARGET
