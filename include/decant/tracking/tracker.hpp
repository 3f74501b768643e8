// SPDX-License-Identifier: MIT
#pragma once

/// Closing the loop: a simulation runs along with a camera, and is corrected by what the camera sees, frame by frame.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <decant/boundary/swept_contact.hpp>
#include <decant/camera/distorted_pinhole_camera.hpp>
#include <decant/camera/posed_camera.hpp>
#include <decant/camera/ray_occlusion.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/stopwatch.hpp>
#include <decant/core/target.hpp>
#include <decant/correction/concept.hpp>
#include <decant/correction/silhouettes.hpp>
#include <decant/coverage/mask_cleaning.hpp>
#include <decant/projector/gap_closing.hpp>
#include <decant/projector/silhouette.hpp>
#include <decant/tracking/image_likelihood.hpp>
#include <decant/tracking/liquid_model.hpp>
#include <decant/tracking/mask_trust.hpp>
#include <decant/tracking/overlap.hpp>

namespace decant::inline DECANT_TARGET {

/// What a tracker needs to know beside its model and its corrector.
struct TrackerSettings {
  double sphere_in_spacings = 0.66;      ///< radius with which particles are drawn, over their spacing, > 0
  double gap_closing_in_spacings = 1.4;  ///< wider gaps between particles are not liquid; the diagonal in a film; >= 0
  int cleaning_window_px = 3;            ///< of MaskCleaning; 1 takes masks as they come
  int smallest_region_px = 10;           ///< likewise
  int least_pixels = 150;                ///< of liquid in a mask that is believed in any case: see MaskTrust; >= 1
  double occlusion_margin = 1e-3;        ///< see RayOcclusion [m]
  int relaxation_sweeps = 4;             ///< after each correction, what is too dense moves apart; >= 0
  double longest_path_in_spacings = 5;   ///< longer moves are mass taken from place to place, not paths; > 0
  double longest_gap = 1;                ///< between frames [s]; later ones are refused, > 0
  ImageLikelihoodSettings likelihood{};
  Vector3<double> gravity{0, 0, -9.81};  ///< [m/s^2], for correctors
  Threads threads{};
};

/// Where a body was seen.
struct TrackedPose {
  BodyId body = 0;
  Pose world_from_body{};
};

/// What one camera's segmentation says. Does not own the mask.
struct CameraMask {
  std::size_t camera = 0;
  ConstMaskView mask;
};

/// Where a camera that moves is.
struct CameraPose {
  std::size_t camera = 0;
  Pose camera_from_world{};
};

/// All that arrives with one frame. Bodies that are not named go on as they were told before; cameras without a mask
/// saw nothing: the simulation runs on, uncorrected by them. Cameras without a pose are where they were.
struct TrackerFrame {
  double time = 0;  ///< [s], on the model's clock
  std::span<const TrackedPose> poses{};
  std::span<const CameraMask> masks{};
  std::span<const CameraPose> cameras{};
};

enum class FrameStatus {
  Ok,
  Uncorrected,  ///< time went on, but there was no mask that could be believed
  Late,         ///< the frame is not newer than the one before: nothing was done
  Gap,          ///< the frame is later than longest_gap, or its time is not finite: nothing was done
  BadInput,     ///< a body or camera that does not exist, a pose that is none, or a mask of another size: nothing was
                ///< done
  ModelFailed,  ///< the simulation could not take the step: nothing was done
};

constexpr std::string_view to_string(FrameStatus status) {
  switch (status) {
    case FrameStatus::Ok:
      return "ok";
    case FrameStatus::Uncorrected:
      return "uncorrected";
    case FrameStatus::Late:
      return "late";
    case FrameStatus::Gap:
      return "gap";
    case FrameStatus::BadInput:
      return "bad_input";
    case FrameStatus::ModelFailed:
      return "model_failed";
  }
  return "";
}

/// How a frame went.
struct FrameReport {
  FrameStatus status = FrameStatus::Ok;
  double time = 0;            ///< of the model, afterwards [s]
  Overlap prior{};            ///< simulation against cleaned masks before the correction, all cameras together
  Overlap posterior{};        ///< and after it
  double log_likelihood = 0;  ///< of the masks, given the corrected state [nat]
  CorrectionReport correction{};
  double relocated_volume = 0;  ///< mass that was taken from one place to another [m^3]
  double physics_ms = 0, drawing_ms = 0, correction_ms = 0, relaxation_ms = 0;  ///< wall time [ms]

  bool advanced() const noexcept { return status == FrameStatus::Ok || status == FrameStatus::Uncorrected; }
};

/// A liquid model, cameras, and a corrector, stepped together. Not to be called from several threads at once; copies
/// are independent, with meshes shared.
template <class ModelType, class CorrectorType, class CameraType = DistortedPinholeCamera>
class Tracker {
  static_assert(LiquidModel<ModelType>,
                "Tracker: Model must model decant::LiquidModel, see <decant/tracking/liquid_model.hpp>");
  static_assert(CameraModel<CameraType>,
                "Tracker: Camera must model decant::CameraModel, see <decant/camera/concept.hpp>");
  static_assert(Corrector<CorrectorType>,
                "Tracker: Corrector must model decant::Corrector, see <decant/correction/concept.hpp>");

 public:
  using Model = ModelType;
  using Camera = CameraType;
  using Scalar = typename Model::Scalar;
  using Settings = TrackerSettings;
  using Observation = Silhouettes<Camera>;
  using StepReportType = decltype(std::declval<Model&>().step(0.0));

  static_assert(std::is_same_v<typename CorrectorType::Observation, Observation>,
                "Tracker: Corrector::Observation must be decant::Silhouettes<Camera>");

  /// The model as it starts: bodies added, liquid filled. Throws std::invalid_argument if a setting is out of range.
  explicit Tracker(Model model, CorrectorType corrector = {}, const Settings& settings = {})
      : model_(std::move(model)),
        corrector_(std::move(corrector)),
        settings_(settings),
        likelihood_(settings.likelihood) {
    expects(settings.sphere_in_spacings > 0 && settings.sphere_in_spacings < 100, "Tracker: sphere_in_spacings",
            "> 0 and < 100", settings.sphere_in_spacings);
    expects(settings.gap_closing_in_spacings >= 0 && settings.gap_closing_in_spacings < 100,
            "Tracker: gap_closing_in_spacings", ">= 0 and < 100", settings.gap_closing_in_spacings);
    expects(settings.least_pixels >= 1, "Tracker: least_pixels", ">= 1", settings.least_pixels);
    expects(settings.relaxation_sweeps >= 0, "Tracker: relaxation_sweeps", ">= 0", settings.relaxation_sweeps);
    expects(settings.longest_path_in_spacings > 0, "Tracker: longest_path_in_spacings", "> 0",
            settings.longest_path_in_spacings);
    expects(settings.longest_gap > 0, "Tracker: longest_gap [s]", "> 0", settings.longest_gap);
    expects(settings.gravity.allFinite(), "Tracker: gravity [m/s^2]", "finite", settings.gravity.transpose());
  }

  /// Takes one more camera. The number that is returned counts up from 0.
  std::size_t add_camera(const Camera& camera, const Pose& camera_from_world) {
    eyes_.push_back(Eye(camera, camera_from_world, settings_, model_));
    views_.reserve(eyes_.size());
    return eyes_.size() - 1;
  }

  /// Takes the simulation to the frame's time and corrects it by the frame's masks. Never throws; a frame that is
  /// refused leaves everything as it was. A frame at the model's own time is only compared, not simulated.
  [[nodiscard]] FrameReport track(const TrackerFrame& frame) noexcept {
    FrameReport report;
    report.time = model_.time();
    report.status = check(frame);
    if (report.status != FrameStatus::Ok) {
      return report;
    }
    const double duration = frame.time - model_.time();
    if (duration > 0) {
      const Stopwatch physics(report.physics_ms);
      for (const TrackedPose& pose : frame.poses) {
        model_.move_body(pose.body, pose.world_from_body, duration);
      }
      step_report_ = model_.step(duration);
      if (!step_report_.advanced()) {
        report.status = FrameStatus::ModelFailed;
        return report;
      }
    }
    started_ = true;
    report.time = model_.time();
    for (const CameraPose& pose : frame.cameras) {
      eyes_[pose.camera].occlusion.set_camera_pose(pose.camera_from_world);
    }
    look(frame, report);
    report.prior = compare();
    if (views_.empty()) {
      report.status = FrameStatus::Uncorrected;
    } else if (duration > 0) {
      correct(duration, report);
    }
    report.posterior = compare();
    report.log_likelihood = likelihood_.log_likelihood(report.posterior);
    return report;
  }

  /// For what track() would refuse a frame (Late, Gap, BadInput), else Ok.
  FrameStatus check(const TrackerFrame& frame) const noexcept {
    const double duration = frame.time - model_.time();
    if (!std::isfinite(frame.time) || duration > settings_.longest_gap) {
      return FrameStatus::Gap;
    }
    if (duration < 0 || (duration == 0 && started_)) {
      return FrameStatus::Late;
    }
    return usable(frame) ? FrameStatus::Ok : FrameStatus::BadInput;
  }

  /// Forgets earlier frames' observations; the model stays as it is.
  void reset() noexcept {
    corrector_.reset();
    for (Eye& eye : eyes_) {
      eye.trust.reset();
    }
    started_ = false;
  }

  /// What the model said of its last step.
  const StepReportType& step_report() const noexcept { return step_report_; }

  Model& model() noexcept { return model_; }
  const Model& model() const noexcept { return model_; }
  CorrectorType& corrector() noexcept { return corrector_; }
  const Settings& settings() const noexcept { return settings_; }
  std::size_t cameras() const noexcept { return eyes_.size(); }

  /// As of the last frame: what the simulation says the camera sees, and what it saw, cleaned.
  const Mask& predicted(std::size_t camera) const { return eyes_.at(camera).predicted; }
  /// The same before the frame's correction.
  const Mask& predicted_before(std::size_t camera) const { return eyes_.at(camera).prior; }
  const Mask& observed(std::size_t camera) const { return eyes_.at(camera).observed; }
  /// Whether the last frame had a mask of this camera, and one that was believed.
  bool believes(std::size_t camera) const { return eyes_.at(camera).believed; }

  /// The silhouette of a model's liquid in one of the cameras, with the bodies where that model has them: for
  /// forecasts, made by a copy of the model that runs ahead.
  void predict(const Model& model, std::size_t camera, Mask& mask) {
    expects(camera < eyes_.size(), "Tracker: camera", "one that was added", camera);
    Eye& eye = eyes_[camera];
    mask.resize(eye.predicted.rows(), eye.predicted.cols());
    draw(model, eye, mask);
  }
  /// The same for a camera that will be elsewhere by then.
  void predict(const Model& model, std::size_t camera, const Pose& camera_from_world, Mask& mask) {
    expects(camera < eyes_.size(), "Tracker: camera", "one that was added", camera);
    Eye& eye = eyes_[camera];
    const Pose now = eye.occlusion.camera().camera_from_world();
    eye.occlusion.set_camera_pose(camera_from_world);
    predict(model, camera, mask);
    eye.occlusion.set_camera_pose(now);
  }

 private:
  /// A camera with all that belongs to its picture.
  struct Eye {
    RayOcclusion<Camera> occlusion;
    Silhouette<DiscSplat<Scalar>> silhouette;
    MaskCleaning cleaning;
    MaskTrust trust;
    Mask observed, predicted, prior;
    std::vector<std::uint8_t> hidden{};
    bool has_mask = false, believed = false;

    Eye(const Camera& camera, const Pose& camera_from_world, const Settings& settings, const Model& model)
        : occlusion(PosedCamera<Camera>(camera, camera_from_world), settings.occlusion_margin),
          silhouette(DiscSplat<Scalar>(settings.sphere_in_spacings * model.spacing()), GapClosing(0)),
          cleaning(settings.cleaning_window_px, settings.smallest_region_px),
          trust(settings.least_pixels),
          observed(Mask::Zero(camera.height(), camera.width())),
          predicted(observed),
          prior(observed) {
      occlusion.add_bodies(model.bodies(), model.time());
    }
  };

  bool usable(const TrackerFrame& frame) const noexcept {
    const auto is_pose = [](const Pose& pose) {
      const double norm = pose.rotation.norm();
      return pose.finite() && norm > 0.5 && norm < 2;
    };
    return std::all_of(frame.poses.begin(), frame.poses.end(),
                       [&](const TrackedPose& pose) {
                         return pose.body < model_.bodies().size() && is_pose(pose.world_from_body);
                       }) &&
           std::all_of(frame.masks.begin(), frame.masks.end(),
                       [&](const CameraMask& mask) {
                         return mask.camera < eyes_.size() && mask.mask.rows() == eyes_[mask.camera].observed.rows() &&
                                mask.mask.cols() == eyes_[mask.camera].observed.cols();
                       }) &&
           std::all_of(frame.cameras.begin(), frame.cameras.end(), [&](const CameraPose& pose) {
             return pose.camera < eyes_.size() && is_pose(pose.camera_from_world);
           });
  }

  void look(const TrackerFrame& frame, FrameReport& report) noexcept {
    const Stopwatch drawing(report.drawing_ms);
    for (Eye& eye : eyes_) {
      eye.has_mask = eye.believed = false;
    }
    for (const CameraMask& mask : frame.masks) {
      Eye& eye = eyes_[mask.camera];
      eye.cleaning.apply(mask.mask, eye.observed, settings_.threads);
      eye.has_mask = true;
      eye.believed = eye.trust.believes(eye.observed);
    }
    views_.clear();
    for (std::size_t camera = 0; camera < eyes_.size(); ++camera) {
      Eye& eye = eyes_[camera];
      draw(model_, eye, eye.predicted);
      eye.prior = eye.predicted;
      if (eye.believed) {
        views_.push_back(
            {&eye.occlusion, &eye.observed, &eye.predicted, &eye.silhouette.coverage(), eye.hidden, camera});
      }
    }
  }

  /// Median over some of the particles [px/m]; 0 if the camera can see none of these.
  static double pixels_per_metre(const PosedCamera<Camera>& camera, const ConstPointsView<Scalar>& position) noexcept {
    std::array<double, 256> scale;
    std::size_t count = 0;
    for (Index i = 0; i < position.cols(); i += 1 + position.cols() / static_cast<Index>(scale.size())) {
      const double both_ways = camera.jacobian(position.col(i).template cast<double>()).squaredNorm();
      if (both_ways > 0 && std::isfinite(both_ways)) {
        scale[count++] = std::sqrt(0.5 * both_ways);
      }
    }
    const auto median = scale.begin() + static_cast<std::ptrdiff_t>(count / 2);
    std::nth_element(scale.begin(), median, scale.begin() + static_cast<std::ptrdiff_t>(count));
    return count > 0 ? *median : 0;
  }

  void draw(const Model& model, Eye& eye, Mask& mask) noexcept {
    const auto& position = const_cast<Model&>(model).fluid().position;
    eye.occlusion.follow(model.bodies(), model.time());
    eye.hidden.resize(static_cast<std::size_t>(position.count()));
    eye.occlusion.find_hidden(position, settings_.threads, eye.hidden);
    const PosedCamera<Camera>& camera = eye.occlusion.camera();
    const double gap_px = settings_.gap_closing_in_spacings * model.spacing() * pixels_per_metre(camera, position);
    eye.silhouette.closing().set_gap_px(static_cast<int>(std::lround(std::min<double>(gap_px, GapClosing::widest_px))));
    eye.silhouette.render(position, eye.hidden, camera.camera(), camera.camera_from_world(), mask, settings_.threads);
  }

  Overlap compare() const noexcept {
    Overlap total;
    for (const Eye& eye : eyes_) {
      if (eye.has_mask) {
        total += overlap(eye.predicted, eye.observed);
      }
    }
    return total;
  }

  int passes() const noexcept {
    if constexpr (requires { corrector_.passes(); }) {
      return corrector_.passes();
    } else {
      return 1;
    }
  }

  void correct(double duration, FrameReport& report) noexcept {
    FluidState<Scalar>& fluid = model_.fluid();
    const double radius = settings_.sphere_in_spacings * model_.spacing();
    double distance = 0;
    for (int pass = 0; pass < passes(); ++pass) {
      before_ = fluid.position;
      CorrectionReport moves;
      {
        const Stopwatch correction(report.correction_ms);
        for (SilhouetteView<Camera>& view : views_) {
          view.hidden = eyes_[view.number].hidden;
        }
        moves =
            corrector_.correct(fluid, {views_, pass, model_.spacing(), radius, settings_.gravity, settings_.threads},
                               static_cast<Scalar>(duration));
      }
      if (moves.moved + moves.relocated == 0) {
        continue;  // the silhouette is still right for the next pass
      }
      report.correction.moved += moves.moved;
      report.correction.relocated += moves.relocated;
      distance += moves.mean_shift * static_cast<double>(moves.moved);
      {
        const Stopwatch relaxation(report.relaxation_ms);
        adopt();
      }
      const Stopwatch drawing(report.drawing_ms);
      for (Eye& eye : eyes_) {
        draw(model_, eye, eye.predicted);
      }
    }
    if (report.correction.moved > 0) {
      report.correction.mean_shift = distance / static_cast<double>(report.correction.moved);
    }
    report.relocated_volume =
        static_cast<double>(report.correction.relocated) * std::pow(static_cast<double>(model_.spacing()), 3);
  }

  void adopt() noexcept {
    const double longest_path = settings_.longest_path_in_spacings * model_.spacing();
    if constexpr (requires { model_.adopt_moves(before_, longest_path, 1); }) {
      model_.adopt_moves(before_, longest_path, settings_.relaxation_sweeps);
    } else {
      stop_at_walls(longest_path);
    }
  }

  void stop_at_walls(double longest_path) noexcept {
    FluidState<Scalar>& fluid = model_.fluid();
    for (BodyId body = 0; body < model_.bodies().size(); ++body) {
      const BoundingVolumeHierarchy& surface = *model_.bodies()[body].surface;
      const Pose world_from_body = model_.bodies()[body].motion.at(model_.time());
      const Pose body_from_world = world_from_body.inverse();
      parallel_for(fluid.size(), settings_.threads, [&](Index i) {
        const Vector3<double> start = before_.col(i).template cast<double>();
        const Vector3<double> end = fluid.position.col(i).template cast<double>();
        if (start == end || (end - start).norm() > longest_path) {
          return;
        }
        Vector3<double> end_in_body = body_from_world * end;
        const SweptResult result =
            keep_on_side(surface, body_from_world * start, end_in_body, 0.1 * static_cast<double>(model_.spacing()));
        if (result != SweptResult::Free) {
          fluid.position.col(i) = (world_from_body * end_in_body).template cast<Scalar>();
        }
      });
    }
  }

  Model model_;
  CorrectorType corrector_;
  Settings settings_;
  ImageLikelihood likelihood_;
  std::vector<Eye> eyes_{};
  std::vector<SilhouetteView<Camera>> views_{};
  Growable<Scalar, 3> before_{};
  StepReportType step_report_{};
  bool started_ = false;
};

}  // namespace decant::inline DECANT_TARGET
