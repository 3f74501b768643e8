// SPDX-License-Identifier: MIT
#pragma once

/// Takes liquid from where it is least justified to where liquid is seen and none is simulated.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <decant/camera/distorted_pinhole_camera.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/pixel_box.hpp>
#include <decant/core/target.hpp>
#include <decant/correction/concept.hpp>
#include <decant/correction/silhouettes.hpp>
#include <decant/coverage/detail/liquid_box.hpp>
#include <decant/coverage/silhouette_distance.hpp>

namespace decant::inline DECANT_TARGET {

/// Settings of MassRelocation. Pixels are those of the image.
struct MassRelocationSettings {
  double unexplained_px = 3;      ///< farther from the predicted silhouette, observed liquid is unexplained; > 0
  double persistence_px = 6;      ///< it counts if there was some as near in the frame before, >= 0
  double misplaced_px = 5;        ///< farther from the observed silhouette, a particle in sight is misplaced; > 0
  double return_px = 10;          ///< and even farther, it goes back to where it came from if it is not needed; > 0
  double share_per_frame = 0.04;  ///< of all particles that may be taken elsewhere, 0 .. 1
  double balance = 0.5;           ///< of the difference in area that hidden liquid may make up for per frame, 0 .. 1
  double nearest_px = 90;         ///< farther from all simulated liquid in sight nothing is known of depth, > 0
};

/// The amount of liquid never changes, and every move is counted. Liquid that is seen where none is simulated, two
/// frames running, is filled up, the farthest first and a spacing apart, from these in turn: particles in sight where
/// no liquid is seen, the farthest first; then hidden ones that stand higher than where they are needed, from the top,
/// as far as the image shows more liquid than is simulated. Where more is simulated than seen, what is left of the
/// misplaced goes back on top of the hidden liquid. Depth and velocity are those of the simulated liquid nearest to it;
/// nothing is put behind the first wall. What this does not see is the depth: with one camera, a jet that is nearer by
/// some centimetres than the simulated one is filled up at the simulated one's depth.
template <class ScalarType = float, class CameraType = DistortedPinholeCamera>
class MassRelocation {
 public:
  using Scalar = ScalarType;
  using Observation = Silhouettes<CameraType>;
  using Settings = MassRelocationSettings;

  MassRelocation() : MassRelocation(Settings{}) {}

  /// Throws std::invalid_argument if a setting is out of range.
  explicit MassRelocation(const Settings& settings) : settings_(settings) {
    const auto positive = [](double value, const char* name) {
      expects(value > 0 && std::isfinite(value), name, "> 0", value);
    };
    positive(settings.unexplained_px, "MassRelocation: unexplained_px");
    expects(settings.persistence_px >= 0, "MassRelocation: persistence_px", ">= 0", settings.persistence_px);
    positive(settings.misplaced_px, "MassRelocation: misplaced_px");
    positive(settings.return_px, "MassRelocation: return_px");
    positive(settings.nearest_px, "MassRelocation: nearest_px");
    expects(settings.share_per_frame >= 0 && settings.share_per_frame <= 1, "MassRelocation: share_per_frame", "0 .. 1",
            settings.share_per_frame);
    expects(settings.balance >= 0 && settings.balance <= 1, "MassRelocation: balance", "0 .. 1", settings.balance);
  }

  void reset() noexcept { unexplained_before_.clear(); }

  CorrectionReport correct(FluidState<Scalar>& fluid, const Observation& seen, Scalar) noexcept {
    CorrectionReport report;
    for (const SilhouetteView<CameraType>& view : seen.views) {
      unexplained_before_.resize(std::max(unexplained_before_.size(), view.number + 1));
      report.relocated += relocate(fluid, seen, view, unexplained_before_[view.number]);
    }
    report.moved = report.relocated;
    return report;
  }

 private:
  struct InSight {
    Index particle;
    Eigen::Vector2d pixel;
    double depth;
    double off_px;  ///< distance to observed liquid
  };
  /// What a camera makes of a particle.
  struct Seen {
    Projection at;
    double area_scale =
        0;  ///< size in the image over size across the line of sight [px^2/m^2]; 0 if it is not in sight
  };
  struct Hidden {
    double height;  ///< times gravity [m^2/s^2]
    Index particle;
  };
  struct Wanted {
    Eigen::Vector2d pixel;
    double off_px;  ///< distance to simulated liquid
  };

  Index relocate(FluidState<Scalar>& fluid, const Observation& seen, const SilhouetteView<CameraType>& view,
                 Mask& unexplained_before) noexcept {
    const PixelBox of_observed = detail::liquid_box(*view.observed), of_predicted = detail::liquid_box(*view.predicted);
    const Index observed_px = detail::count_liquid(*view.observed, of_observed);
    const Index predicted_px = detail::count_liquid(*view.predicted, of_predicted);
    // asked at observed pixels
    to_predicted_.rebuild(*view.predicted, of_predicted.hull(of_observed), MaskPart::Liquid, seen.threads);
    find_wanted(view, of_observed, unexplained_before, seen.threads);
    sort_particles(fluid, seen, view, of_observed);

    const Vector3<double> up = seen.gravity.norm() > 0 ? Vector3<double>(-seen.gravity.normalized())
                                                       : Vector3<double>(Vector3<double>::UnitZ());
    const double area = particle_px(seen.spacing);
    const auto most = static_cast<Index>(settings_.share_per_frame * static_cast<double>(fluid.size()));
    const auto share = [&](Index more, Index less) {
      return std::min(
          most, static_cast<Index>(settings_.balance * static_cast<double>(std::max<Index>(0, more - less)) / area));
    };
    Index from_hidden = share(observed_px, predicted_px);
    Index taken = 0;
    std::size_t next_misplaced = 0;
    const double apart = std::sqrt(area);
    chosen_.clear();
    for (const Wanted& wanted : wanted_) {
      if (taken >= most) {
        break;
      }
      const bool crowded = std::any_of(chosen_.begin(), chosen_.end(), [&](const Eigen::Vector2d& other) {
        return (other - wanted.pixel).squaredNorm() < apart * apart;
      });
      Vector3<double> place, velocity;
      if (crowded || !place_at(fluid, seen, view, wanted.pixel, place, velocity)) {
        continue;
      }
      Index donor = -1;
      if (next_misplaced < misplaced_.size()) {
        donor = in_sight_[misplaced_[next_misplaced++]].particle;
      } else {
        while (from_hidden > 0 && !hidden_.empty() && donor < 0) {
          const Index candidate = take_highest_hidden();
          const Vector3<double> x = fluid.position.col(candidate).template cast<double>();
          donor = up.dot(x - place) > -seen.spacing ? candidate : -1;
        }
        from_hidden -= donor >= 0 ? 1 : 0;
      }
      if (donor < 0) {
        break;
      }
      put(fluid, donor, place, velocity);
      chosen_.push_back(wanted.pixel);
      ++taken;
    }
    return taken + send_back(fluid, seen, view, up, next_misplaced, share(predicted_px, observed_px));
  }

  /// Observed pixels that no simulated liquid is near, now and in the frame before; the farthest first.
  void find_wanted(const SilhouetteView<CameraType>& view, const PixelBox& of_observed, Mask& unexplained_before,
                   Threads threads) noexcept {
    const Mask& observed = *view.observed;
    unexplained_.setZero(observed.rows(), observed.cols());
    const auto for_each_observed = [&](auto&& visit) {
      for (Index v = of_observed.v_begin; v < of_observed.v_end; ++v) {
        for (Index u = of_observed.u_begin; u < of_observed.u_end; ++u) {
          visit(v, u);
        }
      }
    };
    for_each_observed([&](Index v, Index u) {
      if (is_liquid(observed(v, u)) &&
          static_cast<double>(to_predicted_.distance_px()(v, u)) > settings_.unexplained_px) {
        unexplained_(v, u) = mask_liquid;
      }
    });
    wanted_.clear();
    if (unexplained_before.rows() == observed.rows() && unexplained_before.cols() == observed.cols()) {
      const PixelBox now = detail::liquid_box(unexplained_), before = detail::liquid_box(unexplained_before);
      if (!now.empty() && !before.empty()) {
        to_unexplained_.rebuild(unexplained_before, now.hull(before), MaskPart::Liquid, threads);
        for_each_observed([&](Index v, Index u) {
          if (is_liquid(unexplained_(v, u)) &&
              static_cast<double>(to_unexplained_.distance_px()(v, u)) <= settings_.persistence_px) {
            wanted_.push_back({{static_cast<double>(u), static_cast<double>(v)},
                               static_cast<double>(to_predicted_.distance_px()(v, u))});
          }
        });
      }
      std::stable_sort(wanted_.begin(), wanted_.end(),
                       [](const Wanted& a, const Wanted& b) { return a.off_px > b.off_px; });
    }
    unexplained_before.swap(unexplained_);
  }

  void sort_particles(const FluidState<Scalar>& fluid, const Observation& seen, const SilhouetteView<CameraType>& view,
                      const PixelBox& of_observed) noexcept {
    seen_.resize(static_cast<std::size_t>(fluid.size()));
    parallel_for(fluid.size(), seen.threads, [&](Index i) {
      const auto& camera = view.camera().camera();
      const Vector3<double> x = view.camera().to_camera(fluid.position.col(i).template cast<double>());
      Seen& particle = seen_[static_cast<std::size_t>(i)];
      particle.at = camera.project(x);
      if (particle.at.visible && view.hidden[static_cast<std::size_t>(i)] == 0) {
        particle.area_scale = std::abs(camera.jacobian(x).template leftCols<2>().determinant());
      }
    });
    in_sight_.clear();
    misplaced_.clear();
    hidden_.clear();
    behind_walls_.clear();
    PixelBox asked = of_observed;
    total_area_scale_ = 0;
    for (Index i = 0; i < fluid.size(); ++i) {
      const auto& [at, area_scale] = seen_[static_cast<std::size_t>(i)];
      if (view.hidden[static_cast<std::size_t>(i)] != 0) {
        hidden_.push_back({-seen.gravity.dot(fluid.position.col(i).template cast<double>()), i});
        if (at.visible) {
          behind_walls_.push_back({i, at.pixel, at.depth, 0});
        }
      } else if (at.visible) {
        in_sight_.push_back({i, at.pixel, at.depth, 0});
        total_area_scale_ += area_scale;
        const auto [v, u] = pixel_at(at.pixel);
        asked = asked.hull({u, v, u + 1, v + 1});
      }
    }
    std::make_heap(hidden_.begin(), hidden_.end(), lower);
    to_observed_.rebuild(*view.observed, asked, MaskPart::Liquid, seen.threads);
    for (std::size_t k = 0; k < in_sight_.size(); ++k) {
      const auto [v, u] = pixel_at(in_sight_[k].pixel);
      in_sight_[k].off_px = static_cast<double>(to_observed_.distance_px()(v, u));
      if (in_sight_[k].off_px > settings_.misplaced_px) {
        misplaced_.push_back(k);
      }
    }
    std::stable_sort(misplaced_.begin(), misplaced_.end(),
                     [&](std::size_t a, std::size_t b) { return in_sight_[a].off_px > in_sight_[b].off_px; });
  }

  /// Row and column; the image reaches half a pixel beyond the centres of its first ones.
  static std::pair<int, int> pixel_at(const Eigen::Vector2d& pixel) noexcept {
    return {std::max(0, static_cast<int>(std::lround(pixel.y()))),
            std::max(0, static_cast<int>(std::lround(pixel.x())))};
  }

  /// Of two that are equally high, the one with the larger number counts as lower.
  static bool lower(const Hidden& a, const Hidden& b) noexcept {
    return a.height < b.height || (a.height == b.height && a.particle > b.particle);
  }

  Index take_highest_hidden() noexcept {
    std::pop_heap(hidden_.begin(), hidden_.end(), lower);
    const Index particle = hidden_.back().particle;
    hidden_.pop_back();
    return particle;
  }

  /// Area of one particle's share of a surface in the image [px^2], at the depth of the liquid in sight.
  double particle_px(double spacing) const noexcept {
    const double mean = in_sight_.empty() ? 0 : total_area_scale_ / static_cast<double>(in_sight_.size());
    return std::max(spacing * spacing * mean, 1.0);
  }

  /// Of the particles that are where liquid is seen, the one nearest to a pixel. What is misplaced itself says nothing
  /// of where liquid is.
  const InSight* nearest_to(const Eigen::Vector2d& pixel, const std::vector<InSight>& candidates) const noexcept {
    const InSight* nearest = nullptr;
    double least = settings_.nearest_px * settings_.nearest_px;
    for (const InSight& candidate : candidates) {
      const double squared = (candidate.pixel - pixel).squaredNorm();
      if (squared < least && candidate.off_px <= settings_.misplaced_px) {
        least = squared;
        nearest = &candidate;
      }
    }
    return nearest;
  }

  /// Where liquid that is seen at a pixel would be, and how fast, by the simulated liquid in sight nearest to it; by
  /// the nearest behind a wall if there is none: then it has come from there in free fall.
  bool place_at(const FluidState<Scalar>& fluid, const Observation& seen, const SilhouetteView<CameraType>& view,
                const Eigen::Vector2d& pixel, Vector3<double>& place, Vector3<double>& velocity) const noexcept {
    const InSight* nearest = nearest_to(pixel, in_sight_);
    const bool emerging = nearest == nullptr;
    if (emerging) {
      nearest = nearest_to(pixel, behind_walls_);
    }
    if (nearest == nullptr) {
      return false;
    }
    double depth = nearest->depth;
    if (const auto wall = view.sight->first_wall(pixel)) {
      depth = std::min(depth, *wall - 0.5 * seen.spacing);
    }
    if (!(depth > 0)) {
      return false;
    }
    place = view.camera().unproject(pixel, depth);
    velocity = fluid.velocity.col(nearest->particle).template cast<double>();
    const Vector3<double> path = place - fluid.position.col(nearest->particle).template cast<double>();
    const double acceleration = seen.gravity.norm();
    const double fall = acceleration > 0 ? path.dot(seen.gravity) / acceleration : 0;
    if (emerging && fall > 0) {
      const double time = std::sqrt(2 * fall / acceleration);
      velocity = (path - fall / acceleration * seen.gravity) / time + time * seen.gravity;
    }
    return place.allFinite();
  }

  Index send_back(FluidState<Scalar>& fluid, const Observation& seen, const SilhouetteView<CameraType>& view,
                  const Vector3<double>& up, std::size_t next_misplaced, Index most) noexcept {
    Index sent = 0;
    for (; next_misplaced < misplaced_.size() && sent < most; ++next_misplaced) {
      const InSight& misplaced = in_sight_[misplaced_[next_misplaced]];
      if (!(misplaced.off_px > settings_.return_px)) {
        break;
      }
      // on top of hidden liquid that stands higher: that is where it should still be
      bool found = false;
      while (!hidden_.empty() && !found) {
        const Index below = take_highest_hidden();
        const Vector3<double> x = fluid.position.col(below).template cast<double>();
        const Vector3<double> place = x + 0.8 * seen.spacing * up;
        const Vector3<double> now = fluid.position.col(misplaced.particle).template cast<double>();
        if (up.dot(place - now) > 0 && view.sight->hidden(place) && !view.sight->blocked(x, place)) {
          put(fluid, misplaced.particle, place, fluid.velocity.col(below).template cast<double>());
          found = true;
          ++sent;
        }
      }
      if (!found) {
        break;
      }
    }
    return sent;
  }

  static void put(FluidState<Scalar>& fluid, Index i, const Vector3<double>& place,
                  const Vector3<double>& velocity) noexcept {
    fluid.position.col(i) = place.template cast<Scalar>();
    fluid.velocity.col(i) = velocity.template cast<Scalar>();
  }

  Settings settings_;
  SilhouetteDistance to_observed_{}, to_predicted_{}, to_unexplained_{};
  Mask unexplained_{};
  std::vector<Mask> unexplained_before_{};
  std::vector<InSight> in_sight_{};
  std::vector<std::size_t> misplaced_{};  ///< in in_sight_
  std::vector<InSight> behind_walls_{};   ///< but in the image
  std::vector<Hidden> hidden_{};          ///< a heap, with the highest first
  std::vector<Seen> seen_{};              ///< N
  double total_area_scale_ = 0;           ///< of what is in sight
  std::vector<Wanted> wanted_{};
  std::vector<Eigen::Vector2d> chosen_{};
};
static_assert(Corrector<MassRelocation<>>);

}  // namespace decant::inline DECANT_TARGET
