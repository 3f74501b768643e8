// SPDX-License-Identifier: MIT
#pragma once

/// A twin of pours in which one effect is hidden that the model lacks, or an error of the measurement, or something
/// that no model is told of: for workflows that are to name it. The reality has the model's family of solver, with
/// another kernel, spacing and sub-steps, or another solver altogether, and differs from what was recorded by small
/// errors that are tolerated.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/boundary/cavity.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/core/image.hpp>
#include <decant/force/body_acceleration.hpp>
#include <decant/force/linear_drag.hpp>
#include <decant/force/quadratic_drag.hpp>
#include <decant/force/shear_thinning_viscosity.hpp>
#include <decant/force/suction.hpp>
#include <decant/force/surface_tension.hpp>
#include <decant/force/wall_adhesion.hpp>
#include <decant/force/wall_friction.hpp>
#include <decant/io/png.hpp>
#include <decant/io/recording_writer.hpp>
#include <decant/pressure/dfsph.hpp>
#include <decant/pressure/position_based.hpp>
#include <decant/simulation/fill.hpp>
#include <decant/simulation/inlet.hpp>
#include <decant/simulation/simulator.hpp>

#include "effect_cases.hpp"
#include "effect_forces.hpp"
#include "effect_scenarios.hpp"
#include "fattened_mask.hpp"
#include "first_sight.hpp"
#include "twin.hpp"

namespace example {

/// By what a reality is simulated.
enum class RealitySolver {
  DivergenceFree,  ///< as the model is
  PositionBased    ///< foreign to the model: liquid that gives way, splashes less and clings more
};

inline const std::map<std::string, RealitySolver>& reality_solvers() {
  static const std::map<std::string, RealitySolver> solvers{{"divergence_free", RealitySolver::DivergenceFree},
                                                            {"position_based", RealitySolver::PositionBased}};
  return solvers;
}

/// How a case is recorded. What a workflow gets depends on none of it but the spacing and the seconds.
struct EffectRecordingSettings {
  RealitySolver solver = RealitySolver::DivergenceFree;
  double spacing = 0.0043;                                   ///< of the reality's particles [m]
  double longest = std::numeric_limits<double>::infinity();  ///< a pour is cut off there [s]
  bool with_effect = true;   ///< false: the same errors and noise, but nothing is hidden
  bool truth_masks = false;  ///< clean silhouettes beside the recording
  double frames_per_second = 30;
  bool scale = false;  ///< weighs what is in the pan, with noise of 1 g
};

/// All effects are there, and cost nothing where they are zero.
template <class PressureSolverType>
struct EffectRealityParts : RealityParts<PressureSolverType> {
  using Forces =
      std::tuple<decant::Gravity<float>, decant::ShearThinningViscosity<float>, decant::ResidualViscosity<float>,
                 decant::LinearDrag<float>, decant::QuadraticDrag<float>, decant::BodyAcceleration<float>,
                 decant::Suction<float>, decant::WallFriction<float>, decant::WallAdhesion<float>,
                 decant::SurfaceTension<float>, BackPressure, Stirrer, StickyPatch, Puff, ShakingTable>;
};

/// Of a reality with what is hidden and what is tolerated.
inline decant::SimulatorSettings effect_reality_settings(const std::vector<HiddenEffect>& effects,
                                                         const ToleratedErrors& errors, double spacing) {
  decant::SimulatorSettings settings;
  settings.spacing = spacing;
  settings.threads = {1};
  settings.gravity *= 1 + strength_of(effects, "gravity");
  settings.gravity += errors.pull;
  settings.liquid.dynamic_viscosity += strength_of(effects, "viscosity") * settings.liquid.density;
  settings.liquid.surface_tension = strength_of(effects, "surface_tension");
  // between those that are handed in and for_tracking's
  settings.courant_number = 1;
  settings.stability_number = 0.35;
  settings.tolerance_factor = 1.5;
  return settings;
}

/// Pulls a reality's liquid sideways, from now on or, in the variant "window", for a while.
template <class Model>
void pull_sideways(const HiddenEffect& effect, Model& model) {
  auto& pull = model.template force<decant::BodyAcceleration<float>>();
  pull.pull = (effect.strength * effect.level_direction()).template cast<float>();
  if (effect.variant == "window") {
    pull.from = effect.onset;
    pull.until = effect.until;
  }
}

/// Gives a reality the forces of what is hidden under which liquid comes to rest before the recording begins.
template <class Model>
void set_lasting_forces(const std::vector<HiddenEffect>& effects, Model& model) {
  using namespace decant;
  const auto strength = [&](const char* name) { return strength_of(effects, name); };
  const double layers = spacing_of_strengths / model.spacing();
  if (strength("shear_thinning") > 0) {  // other than catalogues have it
    ShearThinningViscosity<float>& friction = model.template force<ShearThinningViscosity<float>>();
    friction.high_shear_viscosity = friction.kinematic_viscosity;
    friction.kinematic_viscosity += static_cast<float>(strength("shear_thinning"));
    friction.relaxation_time = 0.05F;
    friction.exponent = 0.45F;
  }
  model.template force<LinearDrag<float>>().rate = static_cast<float>(strength("drag_linear"));
  model.template force<QuadraticDrag<float>>().drag = static_cast<float>(strength("drag_quadratic"));
  model.template force<WallFriction<float>>().rate = static_cast<float>(layers * strength("wall_friction"));
  model.template force<WallAdhesion<float>>().strength =
      static_cast<float>(layers * layers * strength("wall_adhesion"));
  for (const HiddenEffect& each : effects) {
    if (each.is("lateral_force", "steady")) {
      pull_sideways(each, model);
    }
  }
}

/// What really happens in one pour of a case.
template <class PressureSolverType>
class EffectReality {
 public:
  using Model = decant::Simulator<EffectRealityParts<PressureSolverType>>;

  /// @param effects those of the case, or none. @param recorded_volume what the recording will say [m^3].
  EffectReality(const EffectCase& hidden, const std::vector<HiddenEffect>& effects, std::size_t which,
                double recorded_volume, double spacing)
      : effects_(effects),
        scenario_(effect_scenarios().at(hidden.scenario)),
        container_(effect_container(scenario_.pour(which).container)),
        errors_(tolerated_errors(hidden, which)),
        container_motion_(true_container_motion(RecordedMotion(hidden.scenario, which))),
        pan_motion_(true_pan_motion()),
        model_(effect_reality_settings(effects, errors_, spacing)) {
    using namespace decant;
    container_body_ = model_.add_body("container", container_.shape, PoseTrack(container_motion_.at(0)));
    pan_body_ = model_.add_body("pan", scenario_.pan.shape(), pan_motion_);
    set_lasting_forces(effects_, model_);
    const double amount = (1 + errors_.fill) * (1 + strength_of(effects_, "fill"));
    if constexpr (std::is_same_v<PressureSolverType, Dfsph<float>>) {
      initial_volume_ = fill(model_, container_body_, FillAmount::volume(amount * recorded_volume)).volume;
    } else {
      // others start badly from liquid that was packed, and what one takes for settled is not at rest for another
      const EffectReality<Dfsph<float>> settled(hidden, effects, which, recorded_volume, spacing);
      initial_volume_ = settled.initial_volume();
      Model calming = model_;
      calming.add_particles(settled.model().fluid().position, settled.model().fluid().velocity, container_body_);
      step_reality(calming, 0.1, 0);
      model_.add_particles(calming.fluid().position, calming.fluid().velocity, container_body_);
    }
    model_.watch_contents(container_body_);
    model_.watch_contents(pan_body_);
    model_.set_motion(container_body_, container_motion_);
    for (const HiddenEffect& each : effects_) {
      descriptions_.push_back(nlohmann::json::object());
      set_passing_force(each);
      add_source_or_body(each);
    }
  }

  const Model& model() const { return model_; }
  const ToleratedErrors& errors() const { return errors_; }
  double initial_volume() const { return initial_volume_; }  ///< [m^3]
  double removed() const { return removed_; }                ///< by a leak or a loss [m^3]
  /// Of each effect, where it is, what it does and when.
  const std::vector<nlohmann::json>& descriptions() const { return descriptions_; }

  /// Goes on to a time [s]. Throws std::runtime_error where it cannot.
  decant::StepReport advance(double time) {
    constexpr double slice = 1.0 / 60;  // sub-steps end there
    const double start = model_.time();
    const int slices = std::max(1, static_cast<int>(std::lround((time - start) / slice)));
    decant::StepReport report;
    for (int k = 1; k <= slices; ++k) {
      const double end = k == slices ? time : start + (time - start) * k / slices;
      report = step_reality(model_, end, end);
      removed_ = report.drained;
    }
    // what has left the picture would fall faster and faster, and sub-steps get shorter with it
    model_.remove_particles_if([&](decant::Index i) { return model_.fluid().position(2, i) < lowest_seen; });
    return report;
  }

 private:
  static constexpr float lowest_seen = -0.3F;  // [m]
  static constexpr double samples_per_second = 200;

  decant::PoseTrack true_container_motion(const RecordedMotion& recorded) const {
    const double late = errors_.latency + strength_of(effects_, "latency");
    std::vector<decant::PoseTrack::Sample> samples;
    const int count = static_cast<int>(std::ceil((recorded.plan().duration + 0.1) * samples_per_second));
    for (int k = 0; k <= count; ++k) {
      const double time = k / samples_per_second;
      decant::Pose pose = recorded.smooth(time + late);  // what is recorded at t happened at t - late
      pose.rotation = errors_.container_error.rotation * pose.rotation;
      pose.translation += errors_.container_error.translation;
      for (const HiddenEffect& each : effects_) {
        if (each.is("body_pose", "container")) {
          pose.translation += 1e-3 * each.strength * each.direction;
        }
      }
      samples.push_back({time, pose});
    }
    return decant::PoseTrack(std::move(samples));
  }

  decant::PoseTrack true_pan_motion() const {
    decant::Pose pose;
    pose.translation = errors_.pan_offset;
    const HiddenEffect* slides = nullptr;
    for (const HiddenEffect& each : effects_) {
      if (each.is("body_pose", "pan")) {
        pose.translation += 1e-3 * each.strength * each.level_direction();
      }
      slides = each.is("sliding_pan") ? &each : slides;
    }
    if (slides == nullptr) {
      return decant::PoseTrack(pose);
    }
    decant::Pose there = pose;
    there.translation += 1e-3 * slides->strength * slides->level_direction();
    return decant::PoseTrack({{slides->onset, pose}, {slides->until, there}});
  }

  void set_passing_force(const HiddenEffect& effect) {
    using namespace decant;
    if (effect.is("lateral_force")) {
      descriptions_.back()["direction"] = vector_json(effect.level_direction());
      if (effect.variant == "window") {
        pull_sideways(effect, model_);
        say_window(effect);
      }
    } else if (effect.is("suction")) {
      // beside the jet, so that it is drawn aside and not caught
      const Vector3<double> point =
          scenario_.jet(0.55) + 0.045 * effect.side * scenario_.across() + 0.008 * effect.displacement;
      Suction<float>& suction = model_.template force<Suction<float>>();
      suction.strength = static_cast<float>(effect.strength);
      suction.point = point.cast<float>();
      say("world", point);
    } else if (effect.is("back_pressure")) {
      BackPressure& air = model_.template force<BackPressure>();
      air.strength = effect.strength;
      air.frequency = effect.frequency;
      air.onset = effect.onset - 0.3;
      air.mouth = {0, 0, container_.lip.z()};
      air.radius = container_.lip.x() + 0.002;
      air.container = container_motion_;
      say("container", air.mouth);
      descriptions_.back()["reach_m"] = air.reach;
      descriptions_.back()["frequency_hz"] = air.frequency;
      descriptions_.back()["onset_s"] = air.onset;
    } else if (effect.is("stirrer")) {
      Stirrer& stirrer = model_.template force<Stirrer>();
      stirrer.speed = effect.side * effect.strength;
      stirrer.onset = effect.onset;
      stirrer.foot = scenario_.pan.floor_below(0.015 * effect.displacement);
      say("pan", stirrer.foot);
      descriptions_.back()["onset_s"] = effect.onset;
    } else if (effect.is("sticky_patch")) {
      StickyPatch& patch = model_.template force<StickyPatch>();
      patch.rate = spacing_of_strengths / model_.spacing() * effect.strength;
      patch.body = container_body_;
      patch.side = effect.side * Vector3<double>::UnitY();
      patch.motion = container_motion_;
      say("container", {0, 0, 0});
      descriptions_.back()["direction"] = vector_json(patch.side);
    } else if (effect.is("puff")) {
      Puff& puff = model_.template force<Puff>();
      puff.strength = effect.strength;
      puff.from = effect.onset;
      puff.until = effect.until;
      puff.foot = scenario_.pan.floor_below(scenario_.jet(0) + 0.015 * effect.displacement);
      say("pan", puff.foot);
      say_window(effect);
    } else if (effect.is("shaking_table")) {
      ShakingTable& table = model_.template force<ShakingTable>();
      table.size = effect.strength * effect.level_direction();
      table.frequency = effect.frequency;
      table.from = effect.onset - 0.4;
      say("world", {0, 0, 0});
      descriptions_.back()["direction"] = vector_json(effect.level_direction());
      descriptions_.back()["frequency_hz"] = table.frequency;
      descriptions_.back()["onset_s"] = table.from;
    } else if (effect.is("sliding_pan")) {
      say("pan", {0, 0, 0});
      descriptions_.back()["direction"] = vector_json(effect.level_direction());
      say_window(effect);
    } else if (effect.is("body_pose")) {
      const bool pan = effect.variant == "pan";
      say(pan ? "pan" : "container", {0, 0, 0});
      descriptions_.back()["direction"] = vector_json(pan ? effect.level_direction() : effect.direction);
    }
  }

  void add_source_or_body(const HiddenEffect& effect) {
    using namespace decant;
    if (effect.is("leak")) {
      // where the liquid is while it is poured: in the wall below the lip
      const Vector3<double> hole = container_.wall_below_lip(0.35 + 0.15 * effect.displacement.x());
      OutletSettings outlet;
      outlet.body = container_body_;
      outlet.position = hole;
      outlet.radius = 0.012;
      outlet.exit = hole + Vector3<double>(0.012, 0, 0);  // it runs on outside
      outlet.flow = {{0, 1e-6 * effect.strength}, {60, 1e-6 * effect.strength}};
      model_.add_outlet(outlet);
      say("container", hole);
    } else if (effect.is("loss")) {
      // a cloth on the floor, which soaks up what is above it
      OutletSettings cloth;
      cloth.body = pan_body_;
      cloth.position = scenario_.pan.floor_below(0.02 * effect.displacement);
      cloth.radius = 0.6 * scenario_.pan.radius;
      cloth.order = OutletOrder::Evenly;
      cloth.flow = {{0, 1e-6 * effect.strength}, {60, 1e-6 * effect.strength}};
      model_.add_outlet(cloth);
      say("pan", cloth.position);
    } else if (effect.is("inflow")) {
      InletSettings inlet;
      const bool above = effect.variant == "above the pan";
      inlet.position = scenario_.pan.floor_below(0.35 * scenario_.pan.radius * effect.side * scenario_.across() +
                                                 0.015 * effect.displacement);
      inlet.position.z() += above ? 0.10 + 0.02 * effect.displacement.z() : 0.03;
      inlet.radius = 0.006;
      const double flow = 1e-6 * effect.strength;
      inlet.flow = {{effect.onset, flow}, {effect.onset + 60, flow}};
      model_.add_inlet(inlet, foreign_liquid);
      say("world", inlet.position);
      descriptions_.back()["radius_m"] = inlet.radius;
      descriptions_.back()["direction"] = vector_json(inlet.direction);
      descriptions_.back()["onset_s"] = effect.onset;
    } else if (effect.is("obstacle", "mouth")) {
      // a block on the inside of the wall, as high as it is wide, that ends level with the lip
      const double edge = 1e-3 * effect.strength;
      const Vector3<double> corner(container_.lip.x(), 0.5 * edge, container_.lip.z());
      add_block("container", corner - Vector3<double>::Constant(edge), corner, container_motion_);
    } else if (effect.is("obstacle", "pan")) {
      const double edge = 1e-3 * effect.strength;
      const Vector3<double> foot = scenario_.pan.floor_below(scenario_.jet(0) + 0.01 * effect.displacement);
      const Vector3<double> corner = foot - 0.5 * edge * Vector3<double>(1, 1, 0);
      add_block("pan", corner, corner + Vector3<double>::Constant(edge), pan_motion_);
    } else if (effect.is("bump")) {
      // the cap of a ball that sticks out of the floor, away from where the jet lands
      const double height = 1e-3 * effect.strength, radius = 0.032;
      const Vector3<double> foot = scenario_.pan.floor_below(
          0.5 * scenario_.pan.radius * effect.side * scenario_.across() + 0.005 * effect.displacement);
      model_.add_body("bump", Sphere{foot + Vector3<double>(0, 0, height - radius), radius}, pan_motion_);
      say("pan", foot);
    }
  }

  void add_block(const char* where, const decant::Vector3<double>& low, const decant::Vector3<double>& high,
                 const decant::PoseTrack& motion) {
    model_.add_body("block", decant::Box{low, high}, motion);
    say(where, 0.5 * (low + high));
  }

  static nlohmann::json vector_json(const decant::Vector3<double>& v) { return {v.x(), v.y(), v.z()}; }
  // a place in the frame of a body, or of the world
  void say(const char* where, const decant::Vector3<double>& position) {
    descriptions_.back()["place"] = where;
    descriptions_.back()["position_m"] = vector_json(position);
  }
  void say_window(const HiddenEffect& effect) {
    descriptions_.back()["onset_s"] = effect.onset;
    descriptions_.back()["until_s"] = effect.until;
  }

  static constexpr decant::Origin foreign_liquid = 100;

  std::vector<HiddenEffect> effects_;
  EffectScenario scenario_;
  EffectContainer container_;
  ToleratedErrors errors_;
  decant::PoseTrack container_motion_, pan_motion_;
  Model model_;
  decant::BodyId container_body_ = 0, pan_body_ = 0;
  double initial_volume_ = 0;  ///< [m^3]
  double removed_ = 0;         ///< [m^3]
  std::vector<nlohmann::json> descriptions_{};
};

/// The camera as it really is.
inline std::pair<decant::PinholeCamera, decant::Pose> true_camera(const EffectScenario& scenario,
                                                                  const std::vector<HiddenEffect>& effects) {
  const decant::PinholeCamera camera = effect_camera();
  const Eigen::Quaterniond roll(Eigen::AngleAxisd(strength_of(effects, "camera_shift", "roll") * std::numbers::pi / 180,
                                                  Eigen::Vector3d::UnitZ()));
  decant::Vector3<double> shift(0, 0, 0);  // [px]
  for (const HiddenEffect& each : effects) {
    if (each.is("camera_shift", "shift")) {
      shift += each.strength * each.level_direction();
    }
  }
  return {decant::PinholeCamera(camera.fx(), camera.fy(), camera.cx() + shift.x(), camera.cy() + shift.y(),
                                camera.width(), camera.height()),
          decant::Pose{roll, {0, 0, 0}} * effect_camera_from_world(scenario)};
}

/// The truth about a recording, for scoring alone.
template <class Reality>
nlohmann::json effect_truth(const EffectCase& hidden, const std::vector<HiddenEffect>& effects, std::size_t which,
                            const Reality& reality, RealitySolver solver) {
  const auto vector = [](const decant::Vector3<double>& v) { return nlohmann::json{v.x(), v.y(), v.z()}; };
  const ToleratedErrors& errors = reality.errors();
  const Eigen::AngleAxisd turn(errors.container_error.rotation);
  const auto told = [&](std::size_t k) {
    const HiddenEffect effect = k < effects.size() ? effects[k] : HiddenEffect{};
    nlohmann::json json = k < effects.size() ? reality.descriptions()[k] : nlohmann::json::object();
    json["effect"] = effect.name;
    json["family"] = effect.family;
    if (!effect.is("nothing")) {
      json["strength"] = effect.strength;
      json["unit"] = effect.unit;
      if (!effect.variant.empty()) {
        json["variant"] = effect.variant;
      }
    }
    if (effect.is("camera_shift", "shift")) {
      json["direction_px"] = {std::cos(effect.angle), std::sin(effect.angle)};
    }
    return json;
  };
  nlohmann::json truth = told(0);
  truth["role"] = effects.empty()                       ? "nothing"
                  : effects.size() == 2                 ? "two"
                  : effects.front().family == "outside" ? "outside"
                  : hidden.kind == "measurement"        ? "measurement"
                                                        : "catalogue";
  if (effects.size() == 2) {
    truth["second"] = told(1);
  }
  truth["range"] = hidden.range;
  truth["kind"] = hidden.kind;
  truth["case"] = hidden.number;
  truth["scenario"] = hidden.scenario;
  truth["pour"] = interaction_letter(which);
  truth["seed"] = hidden.seed;
  truth["tolerated"] = {{"latency_s", errors.latency},
                        {"fill_share", errors.fill},
                        {"pan_offset_m", vector(errors.pan_offset)},
                        {"container_offset_m", vector(errors.container_error.translation)},
                        {"container_turn_deg", turn.angle() * 180 / std::numbers::pi},
                        {"pull_m_s2", vector(errors.pull)}};
  truth["solver"] = solver == RealitySolver::DivergenceFree ? "divergence-free, another kernel" : "position-based";
  truth["spacing_mm"] = 1e3 * reality.model().spacing();
  truth["initial_ml"] = 1e6 * reality.initial_volume();
  return truth;
}

namespace detail {

template <class PressureSolverType>
void record_effect_pour(const EffectCase& hidden, std::size_t which, const std::filesystem::path& folder,
                        const EffectRecordingSettings& settings, const std::function<void(double)>& progress) {
  using namespace decant;
  const EffectScenario& scenario = effect_scenarios().at(hidden.scenario);
  const PourPlan plan = scenario.pour(which);
  const std::vector<HiddenEffect> effects = settings.with_effect ? hidden.effects() : std::vector<HiddenEffect>{};
  const BodyShape container = effect_container(plan.container).shape;
  const double recorded_volume = 1e-7 * std::round(1e7 * plan.fill * Cavity(container.mesh).volume());
  EffectReality<PressureSolverType> reality(hidden, effects, which, recorded_volume, settings.spacing);
  // the same without the effect, to know where that can be seen
  std::optional<EffectReality<PressureSolverType>> plain;
  if (!effects.empty() && effects.front().family == "outside") {
    plain.emplace(hidden, std::vector<HiddenEffect>{}, which, recorded_volume, settings.spacing);
  }

  Recording header;
  header.name = "scenario" + std::to_string(hidden.scenario) + "_" + interaction_letter(which);
  header.frames_per_second = settings.frames_per_second;
  header.bodies.push_back({1, plan.container, recording::Role::Source, {}, container.mesh, {}});
  header.bodies.push_back({2, "pan", recording::Role::Target, {}, scenario.pan.shape().mesh, {}});
  header.liquid.initial = recording::Initial{0, std::nullopt, recorded_volume};
  RecordingWriter writer(folder, with_camera(header, effect_camera(), effect_camera_from_world(scenario)));
  if (settings.truth_masks) {
    std::filesystem::create_directories(folder / "truth_mask");
  }
  const auto [camera, camera_from_world] = true_camera(scenario, effects);
  TwinSight sight(camera, camera_from_world, {0, 0, 0}, reality.model());
  std::optional<TwinSight> plain_sight;
  if (plain) {
    plain_sight.emplace(camera, camera_from_world, Vector3<double>(0, 0, 0), plain->model());
  }
  FirstSight first_sight;
  RecordedMotion recorded(hidden.scenario, which);
  const std::uint32_t noise_seed = mixed_seed({hidden.seed, 99U, static_cast<std::uint32_t>(which)});
  MaskNoise noise(noise_seed);
  std::mt19937 drops(noise_seed);

  recording::Measurements weighed;
  weighed.channels.push_back({"target_mass_g", recording::Quantity::TargetMass});
  std::mt19937 tremble(noise_seed + 1);
  std::normal_distribution<double> grams(0, 1);

  nlohmann::json container_ml = nlohmann::json::array(), pan_ml = nlohmann::json::array();
  const double seconds = std::min(plan.duration, settings.longest);
  const int frames = std::max(1, static_cast<int>(std::lround(seconds * settings.frames_per_second)));
  for (int number = 0; number < frames; ++number) {
    const double time = number / settings.frames_per_second;
    const StepReport report = reality.advance(time);
    container_ml.push_back(1e6 * report.contents[0].volume);
    pan_ml.push_back(1e6 * report.contents[1].volume);
    weighed.times.push_back(time);
    weighed.channels.front().values.push_back(header.liquid.density * report.contents[1].volume +
                                              1e-3 * grams(tremble));
    Mask seen = sight.look(reality.model());
    if (plain && !first_sight.found()) {
      plain->advance(time);
      first_sight.add(time, seen, plain_sight->look(plain->model()));
    }
    if (const double pixels = strength_of(effects, "mask_bias"); pixels != 0) {
      seen = fattened(seen, pixels);
    }
    if (settings.truth_masks) {
      write_png(folder / "truth_mask" / (decant::detail::six_digits(static_cast<std::size_t>(number)) + ".png"), seen);
    }
    recording::Frame frame;
    frame.bodies = {recorded.next_recorded(time), Pose{}};
    frame.shots.emplace_back();
    const Mask noisy = noise.apply(seen);
    if (number == 0 || drops() % 40 != 0) {  // else a dropped frame
      frame.shots.front().mask = noisy;
    }
    writer.add_frame(frame);
    progress(static_cast<double>(number + 1) / frames);
  }
  nlohmann::json truth = effect_truth(hidden, effects, which, reality, settings.solver);
  truth["recorded_ml"] = 1e6 * recorded_volume;
  truth["removed_ml"] = 1e6 * reality.removed();
  if (first_sight.found()) {
    truth["seen_first_s"] = first_sight.found()->time;
    truth["seen_first_px"] = {first_sight.found()->px.x(), first_sight.found()->px.y()};
  }
  truth["volume_ml"] = {{plan.container, container_ml}, {"pan", pan_ml}};
  writer.set_truth(truth.dump());
  if (settings.scale) {
    writer.set_measurements(std::move(weighed));
  }
  writer.finish();
}

}  // namespace detail

/// Records one pour of a case in a new folder. The recording's name tells the scenario and the pour, nothing else.
/// @param which 0: a, to learn from; 1: b, to be predicted. @param progress is told how far it is, 0 .. 1.
/// Throws std::invalid_argument and std::runtime_error.
inline void record_effect_pour(
    const EffectCase& hidden, std::size_t which, const std::filesystem::path& folder,
    const EffectRecordingSettings& settings = {}, const std::function<void(double)>& progress = [](double) {}) {
  if (settings.solver == RealitySolver::PositionBased) {
    detail::record_effect_pour<decant::PositionBased<float>>(hidden, which, folder, settings, progress);
  } else {
    detail::record_effect_pour<decant::Dfsph<float>>(hidden, which, folder, settings, progress);
  }
}

}  // namespace example
