// SPDX-License-Identifier: MIT
#pragma once

/// A MAP filter that lets a right simulation be: each particle looks about itself for the place that is likeliest by
/// the image, and has a prior to stay.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <vector>

#include <decant/camera/distorted_pinhole_camera.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/correction/concept.hpp>
#include <decant/correction/silhouettes.hpp>
#include <decant/coverage/activation.hpp>
#include <decant/coverage/silhouette_distance.hpp>

namespace decant::inline DECANT_TARGET {

/// Settings of MapFilter.
struct MapFilterSettings {
  /// One for each pass of a frame: distance of the 3 x 3 x 3 hypotheses [m], > 0.
  std::vector<double> cells{0.005, 0.004, 0.003, 0.002};
  double edge_px = 2;           ///< standard deviation of where the mask says that liquid ends [px], > 0
  double reach_px = 20;         ///< farther from observed liquid the image does not say where to go [px], > edge_px
  double pull = 4;              ///< of unexplained liquid: log-likelihood in the midst of it, >= 0
  double pull_length_px = 8;    ///< how far it is felt, > 4
  double step = 0.01;           ///< standard deviation of the prior on moves [m], > 0
  double velocity_share = 0.3;  ///< of a move over the frame's time that the velocity takes on, 0 .. 1
  double velocity_gate_px = 2;  ///< shorter moves leave velocities alone, >= 0
};

/// What is printed in Schenck and Fox 2017 (MapFilterSchenck2017) takes the most active of 27 hypotheses, and the most
/// active one is hardly ever to stay. Here a hypothesis D for a particle at x weighs
///   sum over cameras of [ -E(x + D)^2 / (2 edge^2)  +  pull U(x + D) ]  -  |D|^2 / (2 step^2),
/// with E the distance in the image to observed liquid, cut off at the reach, and U the share of unexplained liquid
/// (observed, not predicted) around it, weighed by exp(-(d / length)^2). If prediction and observation agree, E and U
/// are zero where the particles are, and all of them stay. Several passes, each drawn anew, from coarse to fine.
/// Particles that no camera sees stay, and none is taken out of a picture that shows it; of equal hypotheses the
/// nearest wins.
template <class ScalarType = float, class CameraType = DistortedPinholeCamera>
class MapFilter {
 public:
  using Scalar = ScalarType;
  using Observation = Silhouettes<CameraType>;
  using Settings = MapFilterSettings;

  MapFilter() : MapFilter(Settings{}) {}

  /// Throws std::invalid_argument if a setting is out of range.
  explicit MapFilter(const Settings& settings) : settings_(settings) {
    expects(!settings.cells.empty(), "MapFilter: cells", "at least one", 0);
    for (const double cell : settings.cells) {
      expects(cell > 0 && std::isfinite(cell), "MapFilter: cells [m]", "> 0", cell);
    }
    expects(settings.edge_px > 0, "MapFilter: edge_px", "> 0", settings.edge_px);
    expects(settings.reach_px > settings.edge_px, "MapFilter: reach_px", "> edge_px", settings.reach_px);
    expects(settings.pull >= 0, "MapFilter: pull", ">= 0", settings.pull);
    expects(settings.pull_length_px >= 4 && settings.pull_length_px < 1e4, "MapFilter: pull_length_px", "4 .. 10000",
            settings.pull_length_px);
    expects(settings.step > 0, "MapFilter: step [m]", "> 0", settings.step);
    expects(settings.velocity_share >= 0 && settings.velocity_share <= 1, "MapFilter: velocity_share", "0 .. 1",
            settings.velocity_share);
    expects(settings.velocity_gate_px >= 0, "MapFilter: velocity_gate_px", ">= 0", settings.velocity_gate_px);
    for (int z : {0, -1, 1}) {
      for (int y : {0, -1, 1}) {
        for (int x : {0, -1, 1}) {
          offsets_.emplace_back(x, y, z);
        }
      }
    }
    std::stable_sort(offsets_.begin(), offsets_.end(),
                     [](const auto& a, const auto& b) { return a.squaredNorm() < b.squaredNorm(); });
  }

  int passes() const noexcept { return static_cast<int>(settings_.cells.size()); }
  void reset() noexcept {}

  CorrectionReport correct(FluidState<Scalar>& fluid, const Observation& seen, Scalar dt) noexcept {
    CorrectionReport report;
    if (seen.views.empty() || !(dt > 0)) {
      return report;
    }
    evidence_.resize(std::max(evidence_.size(), seen.views.size()));
    for (std::size_t k = 0; k < seen.views.size(); ++k) {
      evidence_[k].rebuild(seen.views[k], settings_, seen.threads);
    }
    const double cell = settings_.cells[static_cast<std::size_t>(std::clamp(seen.pass, 0, passes() - 1))];
    moves_.resize(static_cast<std::size_t>(fluid.size()));
    parallel_for(fluid.size(), seen.threads, [&](Index i) {
      moves_[static_cast<std::size_t>(i)] = best_move(fluid.position.col(i).template cast<double>(), i, cell, seen);
    });
    double distance = 0;
    for (Index i = 0; i < fluid.size(); ++i) {
      const Move& move = moves_[static_cast<std::size_t>(i)];
      if (move.offset != Vector3<double>::Zero()) {
        fluid.position.col(i) += move.offset.template cast<Scalar>();
        const double above_gate =
            move.length_px > settings_.velocity_gate_px ? 1 - settings_.velocity_gate_px / move.length_px : 0;
        fluid.velocity.col(i) +=
            (settings_.velocity_share * above_gate / static_cast<double>(dt) * move.offset).template cast<Scalar>();
        ++report.moved;
        distance += move.offset.norm();
      }
    }
    report.mean_shift = report.moved > 0 ? distance / static_cast<double>(report.moved) : 0;
    return report;
  }

 private:
  struct Move {
    Vector3<double> offset = Vector3<double>::Zero();
    double length_px = 0;
  };

  /// What one camera's image says of a particle's place.
  class Evidence {
   public:
    void rebuild(const SilhouetteView<CameraType>& view, const Settings& settings, Threads threads) {
      const Mask& observed = *view.observed;
      to_observed_.rebuild(observed, MaskPart::Liquid, threads);
      unexplained_ = (observed >= 128 && *view.predicted < 128)
                         .select(Mask::Constant(observed.rows(), observed.cols(), mask_liquid),
                                 Mask::Zero(observed.rows(), observed.cols()));
      const ImageKernel kernel{settings.pull_length_px, 3 * settings.pull_length_px};
      if (!field_ || field_->width() != observed.cols() || field_->height() != observed.rows()) {
        field_.emplace(static_cast<int>(observed.cols()), static_cast<int>(observed.rows()), kernel);
        none_ = Image<float>::Zero(observed.rows(), observed.cols());
      }
      field_->rebuild(unexplained_, none_, threads);
    }

    double log_likelihood(const Eigen::Vector2d& pixel, const Settings& settings) const noexcept {
      const double length = settings.pull_length_px;
      const double off = distance(pixel, settings.reach_px) / settings.edge_px;
      return -0.5 * off * off + settings.pull * field_->value(pixel) / (std::numbers::pi * length * length);
    }

   private:
    /// Between pixels, too: what lies between whole pixels would not pull otherwise. Cut off before it is interpolated,
    /// since it is infinite where no liquid was seen at all.
    double distance(const Eigen::Vector2d& pixel, double reach_px) const noexcept {
      const Image<float>& table = to_observed_.distance_px();
      const double x = std::clamp(pixel.x(), 0.0, static_cast<double>(table.cols() - 1));
      const double y = std::clamp(pixel.y(), 0.0, static_cast<double>(table.rows() - 1));
      const auto left = static_cast<Index>(x), top = static_cast<Index>(y);
      const Index beside = std::min(left + 1, table.cols() - 1), below = std::min(top + 1, table.rows() - 1);
      const double right = x - static_cast<double>(left), lower = y - static_cast<double>(top);
      const auto at = [&](Index row, Index column) {
        return std::min(static_cast<double>(table(row, column)), reach_px);
      };
      return (1 - lower) * ((1 - right) * at(top, left) + right * at(top, beside)) +
             lower * ((1 - right) * at(below, left) + right * at(below, beside));
    }

    SilhouetteDistance to_observed_{};
    Mask unexplained_{};
    Image<float> none_{};
    std::optional<ActivationField> field_{};
  };

  Move best_move(const Vector3<double>& x, Index i, double cell, const Observation& seen) const noexcept {
    Move best;
    double largest = 0;
    for (std::size_t hypothesis = 0; hypothesis < offsets_.size(); ++hypothesis) {
      const Vector3<double> offset = cell * offsets_[hypothesis];
      double total = -0.5 * offset.squaredNorm() / (settings_.step * settings_.step), length_px = 0;
      bool visible = false, leaves = false;
      for (std::size_t k = 0; k < seen.views.size(); ++k) {
        if (seen.views[k].hidden[static_cast<std::size_t>(i)] != 0) {
          continue;
        }
        const Projection from = seen.views[k].camera().project(x), to = seen.views[k].camera().project(x + offset);
        leaves = leaves || (from.visible && !to.visible);
        if (from.visible && to.visible) {
          total += evidence_[k].log_likelihood(to.pixel, settings_);
          length_px = std::max(length_px, (to.pixel - from.pixel).norm());
          visible = true;
        }
      }
      if (hypothesis == 0) {
        if (!visible) {
          return best;
        }
        largest = total;
      } else if (!leaves && total > largest + 1e-9 && !seen.views.front().sight->blocked(x, x + offset)) {
        largest = total;
        best = {offset, length_px};
      }
    }
    return best;
  }

  Settings settings_;
  std::vector<Vector3<double>> offsets_{};
  std::vector<Evidence> evidence_{};
  std::vector<Move> moves_{};
};
static_assert(Corrector<MapFilter<>>);

}  // namespace decant::inline DECANT_TARGET
