// SPDX-License-Identifier: MIT
#pragma once

/// The MAP filter of Schenck and Fox 2017: each particle looks about itself for the place that the image likes best.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <decant/camera/distorted_pinhole_camera.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/correction/concept.hpp>
#include <decant/correction/silhouettes.hpp>
#include <decant/coverage/activation.hpp>
#include <decant/coverage/image_kernel.hpp>

namespace decant::inline DECANT_TARGET {

/// Settings of MapFilterSchenck2017.
struct MapFilterSchenck2017Settings {
  double cell = 0.005;   ///< of the grid of hypotheses [m], > 0
  ImageKernel kernel{};  ///< of the activation
};

/// As printed: 27 hypotheses on a 3 x 3 x 3 grid around each predicted particle, those struck out whose path crosses a
/// body, the largest activation Psi wins (summed over cameras), and the velocity follows the change of place. Particles
/// that no camera sees stay; of equal hypotheses the nearest to the prediction wins.
/// Not to be recommended: the largest of 27 is hardly ever the middle one, so that the filter moves particles even
/// where prediction and observation agree, up to 5 mm a frame and axis, which is 0.15 m/s, and all liquid contracts to
/// the middle of its silhouette: on one recording of a pour, open loop scored 0.740, this filter 0.549.
template <class ScalarType = float, class CameraType = DistortedPinholeCamera>
class MapFilterSchenck2017 {
 public:
  using Scalar = ScalarType;
  using Observation = Silhouettes<CameraType>;
  using Settings = MapFilterSchenck2017Settings;

  MapFilterSchenck2017() : MapFilterSchenck2017(Settings{}) {}

  /// Throws std::invalid_argument if a setting is out of range.
  explicit MapFilterSchenck2017(const Settings& settings) : settings_(settings) {
    expects(settings.cell > 0 && std::isfinite(settings.cell), "MapFilterSchenck2017: cell [m]", "> 0", settings.cell);
    const ActivationField tried(1, 1, settings.kernel);  // says what is wrong with the kernel, if anything is
    for (int z : {0, -1, 1}) {
      for (int y : {0, -1, 1}) {
        for (int x : {0, -1, 1}) {
          offsets_.emplace_back(settings.cell * Vector3<double>(x, y, z));
        }
      }
    }
    std::stable_sort(offsets_.begin(), offsets_.end(),
                     [](const auto& a, const auto& b) { return a.squaredNorm() < b.squaredNorm(); });
  }

  void reset() noexcept {}

  CorrectionReport correct(FluidState<Scalar>& fluid, const Observation& seen, Scalar dt) noexcept {
    CorrectionReport report;
    if (seen.views.empty() || !(dt > 0)) {
      return report;
    }
    for (std::size_t k = 0; k < seen.views.size(); ++k) {
      const Mask& mask = *seen.views[k].observed;
      if (k == fields_.size()) {
        fields_.emplace_back(static_cast<int>(mask.cols()), static_cast<int>(mask.rows()), settings_.kernel);
      } else if (fields_[k].width() != mask.cols() || fields_[k].height() != mask.rows()) {
        fields_[k] = ActivationField(static_cast<int>(mask.cols()), static_cast<int>(mask.rows()), settings_.kernel);
      }
      fields_[k].rebuild(mask, *seen.views[k].coverage, seen.threads);
    }
    moves_.resize(static_cast<std::size_t>(fluid.size()));
    parallel_for(fluid.size(), seen.threads, [&](Index i) {
      moves_[static_cast<std::size_t>(i)] = best_move(fluid.position.col(i).template cast<double>(), i, seen);
    });
    double distance = 0;
    for (Index i = 0; i < fluid.size(); ++i) {
      const Vector3<double>& move = moves_[static_cast<std::size_t>(i)];
      if (move != Vector3<double>::Zero()) {
        fluid.position.col(i) += move.template cast<Scalar>();
        fluid.velocity.col(i) += (move / static_cast<double>(dt)).template cast<Scalar>();
        ++report.moved;
        distance += move.norm();
      }
    }
    report.mean_shift = report.moved > 0 ? distance / static_cast<double>(report.moved) : 0;
    return report;
  }

 private:
  Vector3<double> best_move(const Vector3<double>& x, Index i, const Observation& seen) const noexcept {
    Vector3<double> best = Vector3<double>::Zero();
    double largest = -1;
    for (const Vector3<double>& offset : offsets_) {
      double total = 0;
      bool visible = false;
      for (std::size_t k = 0; k < seen.views.size(); ++k) {
        if (seen.views[k].hidden[static_cast<std::size_t>(i)] == 0) {
          const Projection projection = seen.views[k].camera().project(x + offset);
          total += projection.visible ? fields_[k].value(projection.pixel) : 0;
          visible = true;
        }
      }
      if (!visible) {
        return best;
      }
      if (total > largest && !seen.views.front().sight->blocked(x, x + offset)) {
        largest = total;
        best = offset;
      }
    }
    return best;
  }

  Settings settings_;
  std::vector<Vector3<double>> offsets_{};
  std::vector<ActivationField> fields_{};
  std::vector<Vector3<double>> moves_{};
};
static_assert(Corrector<MapFilterSchenck2017<>>);

}  // namespace decant::inline DECANT_TARGET
