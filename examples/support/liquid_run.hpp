// SPDX-License-Identifier: MIT
#pragma once

/// What a liquid of given properties would have looked like in recordings, and how far that is from what was seen.

#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/correction/open_loop.hpp>
#include <decant/hypothesis/executor.hpp>
#include <decant/hypothesis/parameter_axis.hpp>
#include <decant/hypothesis/posterior.hpp>
#include <decant/io/recording_reader.hpp>
#include <decant/tracking/overlap_score.hpp>
#include <decant/tracking/silhouette_cells.hpp>
#include <decant/tracking/tracker.hpp>

#include "tracking_run.hpp"

namespace example {

/// The tracking model with surface tension, which is zero and costs nothing unless it is fitted: at millimetres of
/// spacing most of what the force does is its own damping (see SurfaceTension).
struct LiquidParts : TrackingParts {
  using Forces = std::tuple<decant::Gravity<float>, decant::Viscosity<float>, decant::ResidualViscosity<float>,
                            decant::LinearDrag<float>, decant::SurfaceTension<float>>;
};
using LiquidModel = decant::Simulator<LiquidParts>;

/// What can be fitted, by the names that scripts use. Kinematic viscosity from water's to that of light oil: the
/// model's force is explicit, and stable up to about 1e-2 m^2/s. Tension up to above water's.
inline const std::vector<decant::ParameterAxis>& liquid_parameters() {
  static const std::vector<decant::ParameterAxis> axes{
      {"viscosity", "m^2/s", 1e-6, 1e-3, decant::AxisScale::Logarithmic, 13},
      {"surface_tension", "N/m", 0, 0.1, decant::AxisScale::Linear, 6}};
  return axes;
}

/// Throws std::invalid_argument for a name that is none of liquid_parameters.
inline decant::ParameterAxis liquid_parameter(const std::string& name) {
  for (const decant::ParameterAxis& axis : liquid_parameters()) {
    if (axis.name == name) {
      return axis;
    }
  }
  decant::expects(false, "fit_liquid: parameter", "viscosity or surface_tension", name);
  return {};
}

/// One recording under one set of properties.
struct LiquidScore {
  static constexpr std::ptrdiff_t count = 4;  ///< of its numbers()

  decant::Misfit misfit{};  ///< of what was predicted before each frame's correction, in cells of masks
  double iou = std::numeric_limits<double>::quiet_NaN();  ///< the same predictions, mean over frames
  bool to_the_end = false;                                ///< the model followed the recording

  decant::JobResult numbers() const { return {misfit.squared, misfit.measured, iou, to_the_end ? 1.0 : 0.0}; }
  static LiquidScore from(const decant::JobResult& numbers) {
    return {{numbers.at(0), numbers.at(1)}, numbers.at(2), numbers.at(3) > 0};
  }
};

/// A recording and the model as it starts, filled once: runs with different properties then differ in nothing else.
class LiquidRecording {
 public:
  /// Throws as model_of does, and std::runtime_error for a recording without cameras.
  LiquidRecording(decant::Recording recording, const TrackingOptions& options)
      : recording_(std::move(recording)), options_(options) {
    if (recording_.cameras.empty()) {
      throw std::runtime_error(recording_.name + ": no camera: expected masks to compare a model with");
    }
    decant::Recording tensionless = recording_;
    tensionless.liquid.surface_tension = 0;
    start_ = model_of<LiquidParts>(tensionless, options_);
  }

  const decant::Recording& recording() const noexcept { return recording_; }
  const TrackingOptions& options() const noexcept { return options_; }

  /// What the recording says that the liquid has of a parameter.
  double assumed(const std::string& parameter) const {
    return parameter == "viscosity" ? recording_.liquid.viscosity / recording_.liquid.density
                                    : recording_.liquid.surface_tension;
  }

  /// Open loop: what corrects a model also hides what is wrong with its liquid. @param value of each of the axes.
  /// Callable from several threads.
  LiquidScore run(const std::vector<decant::ParameterAxis>& axes, const std::vector<double>& value) const {
    LiquidModel model = start_;
    for (std::size_t k = 0; k < axes.size(); ++k) {
      if (axes[k].name == "viscosity") {
        model.force<decant::Viscosity<float>>().kinematic_viscosity = static_cast<float>(value[k]);
      } else {
        model.force<decant::SurfaceTension<float>>().surface_tension = static_cast<float>(value[k]);
      }
    }
    return follow(std::move(model), decant::OpenLoop<>());
  }

  /// @param corrector what was predicted before it corrects each frame is judged.
  template <class CorrectorType>
  LiquidScore follow(LiquidModel model, CorrectorType corrector) const {
    using namespace decant;
    const double start = recording_.timestamps.front() - model.time();
    auto tracker = tracker_for(recording_, std::move(model), std::move(corrector), options_);
    const SilhouetteCells cells;
    LiquidScore score;
    OverlapScore overlaps;
    for (std::size_t frame = 0; frame < recording_.frames; ++frame) {
      const RecordedFrame recorded = frame_of(recording_, frame, options_);
      const FrameReport report = tracker.track(recorded.at(recording_.timestamps[frame] - start));
      if (!report.advanced()) {
        score.misfit.squared = std::numeric_limits<double>::quiet_NaN();
        return score;
      }
      overlaps.add(report.prior);
      for (const CameraMask& mask : recorded.masks) {
        if (tracker.believes(mask.camera)) {
          const auto observed = cells.shares(tracker.observed(mask.camera));
          score.misfit += {(cells.shares(tracker.predicted_before(mask.camera)) - observed).square().sum(),
                           observed.square().sum()};
        }
      }
    }
    score.iou = overlaps.mean_over_frames();
    score.to_the_end = true;
    return score;
  }

 private:
  decant::Recording recording_;
  TrackingOptions options_;
  LiquidModel start_{};
};

}  // namespace example
