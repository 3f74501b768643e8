// SPDX-License-Identifier: MIT
#pragma once

/// A recording as the workflow for missing effects takes it: a simulation that can be given effects, and silhouettes as
/// they were seen.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/boundary/cavity.hpp>
#include <decant/camera/distorted_pinhole_camera.hpp>
#include <decant/coverage/mask_cleaning.hpp>
#include <decant/discovery/liquid_effects.hpp>
#include <decant/discovery/missing_effect.hpp>
#include <decant/discovery/silhouette_series.hpp>
#include <decant/discovery/simulated_interaction.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/recording_reader.hpp>
#include <decant/simulation/simulator.hpp>

#include "junction_legs.hpp"
#include "pour_places.hpp"
#include "recorded_sensors.hpp"
#include "tracking_run.hpp"

namespace example {

using EffectModel = decant::Simulator<decant::EffectParts<float>>;
using RecordedModel = decant::SimulatedInteraction<EffectModel, decant::DistortedPinholeCamera>;

struct InteractionOptions {
  double frames_per_second = 15;  ///< of those of the recording that are compared
  decant::SimulatedInteractionSettings model{};
  std::map<std::string, double> tolerances{};  ///< by effect: of each of its components, in place of the catalogue's
  std::set<std::string> without{};             ///< effects that are known not to be missing, beyond their tolerances
  std::set<std::string> elsewhere{};           ///< effects that other recordings of a search can have: to name them in
                                               ///< tolerances or without is no mistake where one cannot
  std::map<std::string, double> reading_errors{};  ///< see recorded_sensors
  /// Kinds of sensors that may show too much or too little: the same for all recordings of a search, see
  /// uncertain_gains.
  std::set<std::string> gain_of{};
  /// What effects' words call bodies, by role, in order: as the first recording of a search does, so that all of them
  /// know an effect by the same words. By their own names where there is none.
  std::map<std::optional<decant::recording::Role>, std::vector<std::string>> names{};
  /// Not what was seen, but what would be: each camera is there, with or without pictures, and what was seen or read is
  /// left out.
  bool planned = false;
};

/// What a recording calls its bodies, for InteractionOptions::names of those that are compared with it.
inline std::map<std::optional<decant::recording::Role>, std::vector<std::string>> names_by_role(
    const decant::Recording& recording) {
  std::map<std::optional<decant::recording::Role>, std::vector<std::string>> names;
  for (const decant::recording::Body& body : recording.bodies) {
    names[body.role].push_back(body.name);
  }
  return names;
}

namespace detail {

/// Of a recording's bodies, see InteractionOptions::names.
inline std::vector<std::string> names_in_words(
    const decant::Recording& recording,
    const std::map<std::optional<decant::recording::Role>, std::vector<std::string>>& names) {
  std::map<std::optional<decant::recording::Role>, std::size_t> before;
  std::vector<std::string> result;
  for (const decant::recording::Body& body : recording.bodies) {
    const std::size_t number = before[body.role]++;
    const auto of_role = names.find(body.role);
    result.push_back(of_role != names.end() && number < of_role->second.size() ? of_role->second[number] : body.name);
  }
  return result;
}

inline std::string text_of_file(const std::filesystem::path& file) {
  return decant::detail::read_text_file(file, std::uintmax_t{1} << 30);
}

/// What a recording's model is made from: all but its name, its images and its truth.
inline std::vector<std::string> sources_of(const decant::Recording& recording) {
  nlohmann::json description = nlohmann::json::parse(text_of_file(recording.folder / "recording.json"));
  for (const char* key : {"name", "truth", "measurements"}) {
    description.erase(key);
  }
  std::vector<std::string> sources{description.dump()};
  for (const char* file : {"scene_gt.json", "scene_camera.json"}) {
    if (std::filesystem::exists(recording.folder / file)) {
      sources.push_back(text_of_file(recording.folder / file));
    }
  }
  for (const decant::recording::Body& body : recording.bodies) {
    sources.push_back(text_of_file(recording.folder / body.mesh_file));
  }
  return sources;
}

/// All that a model's predictions depend on, as a short text: what it is made from, and what it can be given. What
/// differs in nothing else shares its model's runs. A 64-bit hash (FNV-1a).
inline std::string fingerprint(const std::vector<std::string>& sources, const RecordedModel& model) {
  std::uint64_t hash = 14695981039346656037U;
  const auto add = [&](const std::string& bytes) {
    for (const char byte : bytes) {
      hash = (hash ^ static_cast<unsigned char>(byte)) * 1099511628211U;
    }
  };
  add("4");  // one more whenever the same words come to mean other predictions
  for (const std::string& each : sources) {
    add(each);
  }
  const auto number = [&](double value) { add(decant::detail::number_text(value) + ' '); };
  // places are worked out from meshes: a compiler's own rounding is no other model (and -0 no other number than 0)
  const auto rounded = [&](double value) { number(std::round(1e9 * value) / 1e9 + 0.0); };
  for (const decant::Effect& effect : model.effects()) {
    add(effect.words());
    for (const decant::EffectComponent& each : effect.components) {
      number(each.base);
      number(each.low);
      number(each.high);
      number(each.tolerance);
    }
    for (const double x : effect.place.value_or(decant::Vector3<double>::Zero())) {
      rounded(x);
    }
    rounded(effect.window.value_or(decant::TimeWindow{}).from);
    rounded(effect.window.value_or(decant::TimeWindow{}).until);
    number(effect.speed);
  }
  number(model.settings().spacing);
  number(model.settings().jitter);
  for (const auto& sensor : model.scene().sensors) {
    add(sensor.name);
  }
  for (const decant::Discretisation& each : model.settings().discretisations) {
    for (const double factor : {each.spacing, each.support, each.precision, each.drawing}) {
      number(factor);
    }
  }
  std::string digits(16, '0');
  for (std::size_t k = 0; k < digits.size(); ++k) {
    digits[k] = "0123456789abcdef"[(hash >> (60 - 4 * k)) & 15U];
  }
  return digits;
}

/// Numbers of the frames that are compared: the first one, and then whichever is next after the time between two.
inline std::vector<std::size_t> compared_frames(const decant::Recording& recording, double frames_per_second) {
  std::vector<std::size_t> frames;
  for (std::size_t frame = 0; frame < recording.frames; ++frame) {
    const double since = recording.timestamps[frame] - recording.timestamps.front();
    if (since * frames_per_second > static_cast<double>(frames.size()) - 0.25) {
      frames.push_back(frame);
    }
  }
  return frames;
}

/// Masks of a camera, cleaned, by frame. Frames without a mask, and empty ones between others, are faults of the
/// camera: there is nothing of them.
inline std::vector<std::optional<decant::Mask>> believed_masks(const decant::Recording& recording, std::size_t camera,
                                                               const std::vector<std::size_t>& frames) {
  using namespace decant;
  const TrackerSettings tracker;
  MaskCleaning cleaning(tracker.cleaning_window_px, tracker.smallest_region_px);
  const auto has_liquid = [](const Mask& mask) { return (mask.array() >= 128).any(); };
  std::vector<std::optional<Mask>> masks;
  std::size_t first = frames.size(), last = 0;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    masks.push_back(recording.liquid_mask(frames[k], camera));
    if (masks.back()) {
      Mask cleaned(recording.height, recording.width);
      cleaning.apply(*masks.back(), cleaned);
      masks.back() = std::move(cleaned);
      if (has_liquid(*masks.back())) {
        first = std::min(first, k);
        last = k;
      }
    }
  }
  for (std::size_t k = first; k < last; ++k) {
    if (masks[k] && !has_liquid(*masks[k])) {
      masks[k].reset();
    }
  }
  return masks;
}

/// What a camera saw, in cells. Nothing if it has no picture of any frame.
inline std::optional<decant::SilhouetteSeries> seen_by(const decant::Recording& recording, std::size_t camera,
                                                       const std::vector<std::size_t>& frames, int cell_px) {
  decant::SilhouetteSeries series(recording.width, recording.height, cell_px);
  const auto masks = believed_masks(recording, camera, frames);
  if (std::none_of(masks.begin(), masks.end(), [](const auto& each) { return each.has_value(); })) {
    return std::nullopt;
  }
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const double time = recording.timestamps[frames[k]];
    if (masks[k]) {
      series.add(time, *masks[k]);
    } else {
      series.add_unseen(time);
    }
  }
  return series;
}

/// Whether anything moves in a recording.
inline bool moves(const decant::Recording& recording) {
  const auto moves_on = [](const decant::recording::Body& body) {
    const decant::Pose first = body.motion.at(0);
    return std::any_of(body.motion.samples().begin(), body.motion.samples().end(), [&](const auto& sample) {
      return sample.pose.translation != first.translation || sample.pose.rotation.coeffs() != first.rotation.coeffs();
    });
  };
  return std::any_of(recording.bodies.begin(), recording.bodies.end(), moves_on);
}

/// What pipes may do: each way out of a junction may be blocked in part, or leak. @param name of the body in words.
inline std::vector<decant::InteractionEffect<EffectModel>> effects_of_junction(const decant::Recording& recording,
                                                                               std::size_t body,
                                                                               const std::string& name) {
  using namespace decant;
  std::vector<InteractionEffect<EffectModel>> effects;
  const BoundingVolumeHierarchy surface(recording.bodies[body].mesh);
  const Pose first = recording.bodies[body].motion.at(recording.timestamps.front());
  const Vector3<double> down = first.rotation.conjugate() * recording.gravity.normalized();
  for (const JunctionLeg& leg : junction_legs(recording, body)) {
    const std::string where = leg.name + " leg of the " + name;
    effects.push_back(blockage_effect<EffectModel>(static_cast<BodyId>(body), leg.section, where));
    // wherever a leg leaks, one of them is as near as leaks' places may be off
    constexpr double apart = 0.04;  // [m]
    const std::vector<PipeSection> sections = sections_with_underside(leg, down, apart);
    for (std::size_t k = 0; k < sections.size(); ++k) {
      const Vector3<double>& middle = sections[k].center;
      const WallPlace place = wall_place(surface, middle, middle + down);
      const std::string of = std::to_string(k + 1) + " of " + std::to_string(sections.size());
      effects.push_back(leak_effect<EffectModel>(static_cast<BodyId>(body), place.point - 0.004 * place.out,
                                                 (place.thickness + 0.013) * place.out,
                                                 where + ", underside, place " + of + " from its end"));
    }
  }
  return effects;
}

/// The catalogue, as far as it applies to a recording. @param most_fill how much more liquid there may be at most, over
/// what is assumed; nothing where that is not asked. @param names of the bodies in words.
inline std::vector<decant::InteractionEffect<EffectModel>> catalogue_of(const decant::Recording& recording,
                                                                        const PourPlaces& places,
                                                                        std::optional<double> most_fill,
                                                                        const std::vector<std::string>& names) {
  using namespace decant;
  auto effects = force_effects<EffectModel>(recording.liquid.viscosity / recording.liquid.density, recording.gravity);
  const Vector3<double> up = -recording.gravity.normalized();
  const auto [across, along] = level_directions(recording.gravity);
  if (places.jet) {
    const double aside = 0.08;  // [m]
    effects.push_back(suction_effect<EffectModel>(*places.jet + aside * across, "beside the jet, one side"));
    effects.push_back(suction_effect<EffectModel>(*places.jet - aside * across, "beside the jet, the other side"));
    effects.push_back(suction_effect<EffectModel>(*places.jet + aside * along, "beside the jet, behind"));
    effects.push_back(suction_effect<EffectModel>(*places.jet - aside * along, "beside the jet, in front"));
  }
  const double begin = recording.timestamps.front(), seconds = recording.timestamps.back() - begin;
  std::vector<InteractionEffect<EffectModel>> of_bodies, out_of_sight;
  for (std::size_t k = 0; k < recording.bodies.size(); ++k) {
    const recording::Body& body = recording.bodies[k];
    if (body.role == recording::Role::Junction) {
      for (auto& effect : effects_of_junction(recording, k, names[k])) {
        of_bodies.push_back(std::move(effect));
      }
      continue;
    }
    const bool source = body.role == recording::Role::Source;
    if (!source && body.role != recording::Role::Target) {
      continue;
    }
    const Pose first = body.motion.at(begin);
    const std::optional<Inside>& inside = places.inside[k];
    if (!inside) {
      continue;
    }
    double lowest = 0;  // of the body's outside below its floor
    for (const auto& vertex : body.mesh.vertices) {
      lowest = std::min(lowest, inside->up.dot(vertex - inside->floor));
    }
    const auto id = static_cast<BodyId>(k);
    effects.push_back(leak_effect<EffectModel>(id, inside->floor + 0.003 * inside->up, (lowest - 0.009) * inside->up,
                                               "floor of the " + names[k]));
    constexpr double half = 0.01;  // of an obstacle of middling size [m]
    if (source) {
      // of a pan it would be a loss
      out_of_sight.push_back(hidden_leak_effect<EffectModel>(id, inside->floor + 0.003 * inside->up,
                                                             "floor of the " + names[k] + ", out of sight"));
      // on the wall below where liquid leaves
      const Vector3<double> in = (inside->mouth() - places.lip).normalized();
      of_bodies.push_back(
          obstacle_effect<EffectModel>(id, places.lip + half * (in - inside->up), "mouth of the " + names[k]));
      // where liquid is while it is poured: holes of other heights let out jets that do not overlap
      const double wall = inside->up.dot(places.lip - inside->floor);
      const BoundingVolumeHierarchy surface(body.mesh);
      for (const auto& [where, share] : std::initializer_list<std::pair<const char*, double>>{
               {"foot of the wall of the ", 0.2}, {"wall of the ", 0.5}, {"wall below the rim of the ", 0.8}}) {
        const Vector3<double> lower = (1 - share) * wall * inside->up;
        const Vector3<double> middle = inside->mouth() - lower;
        const WallPlace place = wall_place(surface, middle, places.lip - lower);
        of_bodies.push_back(
            wall_leak_effect<EffectModel>(id, inside->floor, inside->mouth(), place.point, where + names[k]));
      }
      if (inside->has_neck()) {
        of_bodies.push_back(back_pressure_effect<EffectModel>(
            {id, inside->mouth(), inside->up, 2 * inside->rim_radius(), inside->rim_radius() + 0.002}, names[k],
            begin + 0.5 * seconds));
      }
    } else {
      effects.push_back(loss_effect<EffectModel>(id, inside->middle,
                                                 0.5 * BoundingVolumeHierarchy(body.mesh).bounds().diagonal().norm(),
                                                 "in the " + names[k]));
      const double out = 0.45 * inside->rim_radius();
      for (const auto& [where, off] : std::initializer_list<std::pair<const char*, Vector3<double>>>{
               {"above the ", Vector3<double>::Zero()},
               {"on one side above the ", out * across},
               {"on the other side above the ", -out * across},
               {"behind, above the ", out * along},
               {"in front, above the ", -out * along}}) {
        effects.push_back(inflow_effect<EffectModel>(first * inside->middle + 0.08 * up + off,
                                                     static_cast<Origin>(recording.bodies.size()), where + names[k],
                                                     TimeWindow{.from = begin + 0.3 * seconds}, 0.3 * seconds));
      }
      of_bodies.push_back(obstacle_effect<EffectModel>(id, inside->floor + half * inside->up, "in the " + names[k]));
    }
  }
  if (most_fill) {
    effects.push_back(fill_effect<EffectModel>(*most_fill));
  }
  if (recording.liquid.inlet) {
    effects.push_back(inlet_flow_effect<EffectModel>());
  }
  effects.push_back(moves(recording) ? latency_effect<EffectModel>() : late_start_effect<EffectModel>());
  for (std::size_t body = 0; body < recording.bodies.size(); ++body) {
    effects.push_back(body_pose_effect<EffectModel>(body, names[body]));
  }
  if (!recording.cameras.empty()) {
    for (auto& effect : camera_effects<EffectModel>()) {
      effects.push_back(std::move(effect));
    }
  }
  for (auto& effect : of_bodies) {
    effects.push_back(std::move(effect));
  }
  effects.push_back(passing_force_effect<EffectModel>({begin + 0.2 * seconds, begin + 0.6 * seconds}, 0.25 * seconds,
                                                      "for a while, early", recording.gravity));
  effects.push_back(passing_force_effect<EffectModel>({begin + 0.5 * seconds, begin + 0.95 * seconds}, 0.25 * seconds,
                                                      "for a while, late", recording.gravity));
  for (auto& effect : out_of_sight) {
    effects.push_back(std::move(effect));
  }
  for (const recording::Body& body : recording.bodies) {
    if (body.role == recording::Role::Target && stands(body)) {
      effects.push_back(table_effect<EffectModel>(foot_of(body, begin, up), recording.gravity));
      break;
    }
  }
  return effects;
}

}  // namespace detail

/// A recording, ready to be explained.
struct RecordedInteraction {
  decant::Recording recording;
  RecordedModel model;
  std::vector<std::size_t> frames;   ///< of the recording, that are compared
  std::vector<std::size_t> cameras;  ///< of the recording, whose pictures are compared
  decant::Observation seen;
  std::string of_model;  ///< all that the model's predictions depend on

  /// Their names.
  std::vector<std::string> sensors() const {
    std::vector<std::string> names;
    for (const decant::ReadingSeries& each : seen.readings) {
      names.push_back(each.name());
    }
    return names;
  }

  /// @param name by which messages and journals know it.
  decant::Interaction<RecordedModel> interaction(std::string name) const {
    return {std::move(name), &model, seen, of_model};
  }
};

/// What a search takes for its settings: readings are averaged over two of the frames that are compared, at most.
inline decant::MissingEffectSettings search_settings(decant::MissingEffectSettings settings,
                                                     const InteractionOptions& options) {
  double& window = settings.evidence.readings.window;
  window = std::min(window, 2 / options.frames_per_second);
  return settings;
}

namespace detail {

/// @param start see InteractionScene. @param most_fill see catalogue_of. @param sources what the model is made from.
inline RecordedInteraction interaction_of(decant::Recording recording, const InteractionOptions& options,
                                          decltype(RecordedModel::Scene::start) start, std::optional<double> most_fill,
                                          std::vector<std::string> sources) {
  using namespace decant;
  std::vector<std::size_t> frames = compared_frames(recording, options.frames_per_second);
  RecordedModel::Scene scene;
  scene.start = std::move(start);
  for (const std::size_t frame : frames) {
    scene.times.push_back(recording.timestamps[frame]);
  }
  for (const recording::Body& body : recording.bodies) {
    scene.motion.push_back(body.motion);
  }
  Observation seen;
  const PourPlaces places = pour_places(recording);
  const Vector3<double> middle = places.jet.value_or(Vector3<double>::Zero());
  std::vector<std::size_t> cameras;
  for (std::size_t camera = 0; camera < recording.cameras.size(); ++camera) {
    auto series = seen_by(recording, camera, frames, options.model.cell_px);
    if (!series) {
      if (!options.planned) {
        continue;
      }
      sources.push_back("a picture by camera " + std::to_string(camera));  // which other models of it do not predict
    }
    const recording::Camera& of = recording.cameras[camera];
    InteractionCamera<DistortedPinholeCamera> one{camera_of(of.view(0), recording.width, recording.height), {}};
    one.pixels_per_radian = of.view(0).fx;
    one.distance = std::max(0.05, (of.view(0).camera_from_world * middle).z());
    for (const std::size_t frame : frames) {
      one.camera_from_world.push_back(of.view(frame).camera_from_world);
    }
    scene.cameras.push_back(std::move(one));
    if (!options.planned) {
      seen.silhouettes.push_back(std::move(*series));
    }
    cameras.push_back(camera);
  }
  std::tie(scene.sensors, seen.readings) =
      recorded_sensors<EffectModel>(recording, scene.times, places, options.reading_errors, options.planned);
  if (options.planned) {
    seen.readings.clear();
  }
  if (scene.cameras.empty() && scene.sensors.empty()) {
    throw std::runtime_error(recording.name + ": expected masks or measurements to compare a model with");
  }
  auto catalogue = catalogue_of(recording, places, most_fill, names_in_words(recording, options.names));
  for (const std::string& kind : options.gain_of) {
    std::vector<std::size_t> sensors;
    for (std::size_t sensor = 0; sensor < scene.sensors.size(); ++sensor) {
      if (kind_of_channel(scene.sensors[sensor].name) == kind) {
        sensors.push_back(sensor);
      }
    }
    catalogue.push_back(sensor_gain_effect<EffectModel>(std::move(sensors), kind));
  }
  const auto change = [&](const std::string& option, const std::string& name, const auto& apply) {
    bool found = false;
    for (auto& effect : catalogue) {
      if (effect.name == name) {
        found = true;
        apply(effect);
      }
    }
    if (!found && !options.elsewhere.contains(name)) {
      throw std::runtime_error(option + " '" + name + "': expected an effect of the catalogue of " + recording.name);
    }
  };
  for (const auto& [name, tolerance] : options.tolerances) {
    change("tolerance of", name, [tolerance = tolerance](Effect& effect) {
      for (EffectComponent& component : effect.components) {
        component.tolerance = tolerance;
      }
    });
  }
  for (const std::string& name : options.without) {
    change("without", name, [](Effect& effect) {
      if (effect.kind != EffectKind::Nuisance) {  // which are never named
        effect.kind = EffectKind::Tolerated;
      }
    });
  }
  RecordedModel model(std::move(scene), std::move(catalogue), options.model);
  std::string of_model = fingerprint(sources, model);
  return {std::move(recording), std::move(model), std::move(frames),
          std::move(cameras),   std::move(seen),  std::move(of_model)};
}

}  // namespace detail

/// Throws std::invalid_argument and std::runtime_error for recordings in which nothing was seen or read, or with an
/// amount that is not known, and for tolerances of effects that there are not.
inline RecordedInteraction recorded_interaction(decant::Recording recording, const InteractionOptions& options) {
  using namespace decant;
  const auto start_of = std::make_shared<Recording>(recording);
  start_of->liquid.surface_tension = 0;
  auto start = [start_of](const SimulatorSettings& solver, double fill) {
    TrackingOptions tracking;
    tracking.spacing = solver.spacing;
    tracking.solver = solver;
    tracking.threads = 1;
    tracking.initial_amount_factor = fill;
    return model_of<EffectParts<float>>(*start_of, tracking);
  };
  std::optional<double> most_fill;
  if (const auto& initial = recording.liquid.initial) {
    most_fill = std::clamp(initial->fill_fraction ? 1 / *initial->fill_fraction : 1.25, 1.05, 1.25);
  }
  const std::vector<std::string> sources = detail::sources_of(recording);
  return detail::interaction_of(std::move(recording), options, std::move(start), most_fill, sources);
}

}  // namespace example
