// SPDX-License-Identifier: MIT
#pragma once

/// Moves the liquid so that its silhouette becomes the observed one.

#include <algorithm>
#include <cmath>
#include <vector>

#include <decant/camera/distorted_pinhole_camera.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/correction/concept.hpp>
#include <decant/correction/silhouette_transport.hpp>
#include <decant/correction/silhouettes.hpp>

namespace decant::inline DECANT_TARGET {

/// One pass of TransportCorrector.
struct TransportPass {
  double cell_px = 4;           ///< see SilhouetteTransportSettings
  double blur_px = 4;           ///< likewise
  double velocity_share = 0.8;  ///< how much of a move above the gate the velocity takes, 0 .. 1
};

/// Settings of TransportCorrector.
struct TransportCorrectorSettings {
  /// Coarse to fine: far moves first, edges last.
  std::vector<TransportPass> passes{{8, 10, 0.4}, {5, 7, 0.6}, {4, 4, 0.8}, {4, 4, 0.8}, {3, 3, 0.8}, {3, 3, 0.8}};
  double dead_zone_px = 0;      ///< shorter moves are noise of the mask's edge, >= 0
  double velocity_gate_px = 2;  ///< shorter moves leave velocities alone, >= 0
  double longest_move = 0.008;  ///< per pass [m], > 0
  double fastest = 4;           ///< corrected velocities stay below [m/s], > 0
};

/// Transport of the predicted silhouette to the observed one (SilhouetteTransport), as a move of each particle that a
/// camera sees; hidden ones stay. Each view asks for a displacement d in its image, and the move is the shortest that
/// gives all of them, min sum_v |J_v D - d_v|^2 + mu |D|^2 with the projections' Jacobians: with one camera a move
/// across the line of sight, since one camera never sees depth; with two, a point in space. Equal silhouettes move
/// nothing, and what moves less than the gate keeps its velocity: this is what leaves a right simulation right.
template <class ScalarType = float, class CameraType = DistortedPinholeCamera>
class TransportCorrector {
 public:
  using Scalar = ScalarType;
  using Observation = Silhouettes<CameraType>;
  using Settings = TransportCorrectorSettings;

  TransportCorrector() : TransportCorrector(Settings{}) {}

  /// Throws std::invalid_argument if a setting is out of range.
  explicit TransportCorrector(const Settings& settings) : settings_(settings) {
    expects(!settings.passes.empty(), "TransportCorrector: passes", "at least one", 0);
    expects(settings.dead_zone_px >= 0, "TransportCorrector: dead_zone_px", ">= 0", settings.dead_zone_px);
    expects(settings.velocity_gate_px >= 0, "TransportCorrector: velocity_gate_px", ">= 0", settings.velocity_gate_px);
    expects(settings.longest_move > 0, "TransportCorrector: longest_move [m]", "> 0", settings.longest_move);
    expects(settings.fastest > 0, "TransportCorrector: fastest [m/s]", "> 0", settings.fastest);
    for (const TransportPass& pass : settings.passes) {
      expects(pass.velocity_share >= 0 && pass.velocity_share <= 1, "TransportCorrector: velocity_share", "0 .. 1",
              pass.velocity_share);
      SilhouetteTransportSettings transport;
      transport.cell_px = pass.cell_px;
      transport.blur_px = pass.blur_px;
      transports_.emplace_back(transport);
    }
  }

  int passes() const noexcept { return static_cast<int>(settings_.passes.size()); }
  void reset() noexcept {}

  CorrectionReport correct(FluidState<Scalar>& fluid, const Observation& seen, Scalar dt) noexcept {
    CorrectionReport report;
    const auto pass = static_cast<std::size_t>(std::clamp(seen.pass, 0, passes() - 1));
    normal_.resize(static_cast<std::size_t>(fluid.size()));
    displacement_px_.assign(static_cast<std::size_t>(fluid.size()), not_in_sight);
    bool any = false;
    for (const SilhouetteView<CameraType>& view : seen.views) {
      if (transports_[pass].match(*view.predicted, *view.observed)) {
        any = true;
        gather(fluid, view, transports_[pass], seen.views.size() == 1, seen.threads);
      }
    }
    if (!any || !(dt > 0)) {
      return report;
    }
    double total = 0;
    for (Index i = 0; i < fluid.size(); ++i) {
      const double displacement_px = displacement_px_[static_cast<std::size_t>(i)];
      if (!(displacement_px > 0)) {
        continue;
      }
      const Normal& normal = normal_[static_cast<std::size_t>(i)];
      // so little that it only decides what no view sees
      const double damping = 1e-4 * normal.square.trace();
      Vector3<double> move = (normal.square + damping * Matrix3<double>::Identity()).ldlt().solve(normal.wanted);
      const double length = move.norm();
      if (!(length > 0) || !std::isfinite(length)) {
        continue;
      }
      move *= std::min(1.0, settings_.longest_move / length);
      const double above_gate = std::max(0.0, 1 - settings_.velocity_gate_px / displacement_px);
      Vector3<double> velocity = fluid.velocity.col(i).template cast<double>() +
                                 settings_.passes[pass].velocity_share * above_gate / static_cast<double>(dt) * move;
      const double speed = velocity.norm();
      if (above_gate > 0 && speed > settings_.fastest) {
        velocity *= settings_.fastest / speed;
      }
      fluid.position.col(i) += move.template cast<Scalar>();
      if (above_gate > 0) {
        fluid.velocity.col(i) = velocity.template cast<Scalar>();
      }
      ++report.moved;
      total += move.norm();
    }
    report.mean_shift = report.moved > 0 ? total / static_cast<double>(report.moved) : 0;
    return report;
  }

 private:
  /// Of the least-squares problem for one particle's move.
  struct Normal {
    Matrix3<double> square = Matrix3<double>::Zero();  ///< sum of J' J
    Vector3<double> wanted = Vector3<double>::Zero();  ///< sum of J' d
  };

  /// @param alone whether no other view has a say: what this one leaves where it is then stays.
  void gather(const FluidState<Scalar>& fluid, const SilhouetteView<CameraType>& view,
              const SilhouetteTransport& transport, bool alone, Threads threads) noexcept {
    parallel_for(fluid.size(), threads, [&](Index i) {
      const auto own = static_cast<std::size_t>(i);
      if (view.hidden[own] != 0) {
        return;
      }
      const Vector3<double> x = fluid.position.col(i).template cast<double>();
      const Projection projection = view.camera().project(x);
      if (!projection.visible) {
        return;
      }
      Eigen::Vector2d d = transport.displacement(projection.pixel);
      const double length = d.norm();
      if (!(length > settings_.dead_zone_px)) {
        d.setZero();
      } else {
        d *= 1 - settings_.dead_zone_px / length;
      }
      if (alone && d.isZero(0)) {
        return;
      }
      Normal& normal = normal_[own];
      double& displacement_px = displacement_px_[own];
      if (displacement_px == not_in_sight) {
        normal = {};
      }
      const Eigen::Matrix<double, 2, 3> jacobian = view.camera().jacobian(x);
      normal.square += jacobian.transpose() * jacobian;
      normal.wanted += jacobian.transpose() * d;
      displacement_px = std::max(displacement_px, d.norm());
    });
  }

  Settings settings_;
  std::vector<SilhouetteTransport> transports_{};
  static constexpr double not_in_sight = -1;

  std::vector<Normal> normal_{};           ///< of particles in sight
  std::vector<double> displacement_px_{};  ///< the longest d of each particle, or not_in_sight
};
static_assert(Corrector<TransportCorrector<>>);

}  // namespace decant::inline DECANT_TARGET
