// SPDX-License-Identifier: MIT
#pragma once

/// The forward model that ships: a liquid simulation among bodies that move as they were recorded to, open loop, drawn
/// as cameras would see it and read as sensors would, with effects added.

#include <algorithm>
#include <cmath>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <decant/boundary/wall_place.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/correction/open_loop.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/forward_model.hpp>
#include <decant/discovery/observation.hpp>
#include <decant/discovery/reading_series.hpp>
#include <decant/discovery/silhouette_series.hpp>
#include <decant/simulation/simulator_settings.hpp>
#include <decant/tracking/tracker.hpp>

namespace decant::inline DECANT_TARGET {

/// A camera of an interaction.
template <class CameraType>
struct InteractionCamera {
  CameraType camera;
  std::vector<Pose> camera_from_world;  ///< of each frame that is compared
  double pixels_per_radian = 500;       ///< the focal length [px]: what a turn of the camera shifts its picture by
  double distance = 1;                  ///< about how far off the liquid is [m]
};

/// A sensor of an interaction that gives one number at a time: a scale, a level probe.
template <class Model>
struct InteractionSensor {
  std::string name{};  ///< for people, with its unit
  ReadingError error{};
  /// What there is to read of a simulation as it is now, without errors; called for each frame, from several threads,
  /// each with a model of its own.
  std::function<double(Model& model)> read{};
  bool from_first = false;  ///< it shows how much there is beyond what there was in the first frame
};

/// How an interaction went, as far as it was recorded.
template <class Model, class CameraType>
struct InteractionScene {
  /// Makes the simulation with its bodies where they are at first, and settled liquid. @param solver for_tracking's
  /// settings, spacing and all that is varied among them; liquid, gravity and threads are the scene's to set.
  /// @param fill how much liquid, over what the model assumes. Bodies' poses are as of times.front().
  std::function<Model(SimulatorSettings solver, double fill)> start{};
  std::vector<PoseTrack> motion{};  ///< of each body, on the recording's clock
  std::vector<InteractionCamera<CameraType>> cameras{};
  std::vector<InteractionSensor<Model>> sensors{};  ///< read in the frames that are compared
  std::vector<double> times{};                      ///< of these frames, on the recording's clock [s]
};

/// What effects can change about a run.
template <class Model>
struct InteractionChanges {
  double first = 0;                            ///< the first frame, from which models run on [s]
  double fill = 1;                             ///< over what the model assumes
  double pose_delay = 0;                       ///< poses were recorded so late [s]
  double start_delay = 0;                      ///< all happens so much later than the clock says [s]
  std::vector<Vector3<double>> body_offset{};  ///< by body: where it is off its recorded pose [m], world frame
  Eigen::Vector2d camera_shift{0, 0};          ///< of the picture [px]
  double camera_roll = 0;                      ///< of the picture about its middle, clockwise [rad]
  double mask_growth = 0;                      ///< of silhouettes on all sides [px]
  std::vector<double> sensor_gain{};           ///< by sensor: so much of each change since the first frame
  /// Done to the model before liquid comes to rest once more, if there is any.
  std::vector<std::function<void(Model&)>> before_settling{};
  std::vector<std::function<void(Model&)>> of_model{};  ///< done to the model before it starts
};

/// An effect, and what it does to a run.
/// apply(as, changes): with place and window as they are asked for, or the effect's own.
template <class Model>
struct InteractionEffect : Effect {
  std::optional<std::size_t> of_body{};  ///< in whose frame its place is; the world's otherwise
  /// If it acts at that body's wall, wherever that may be: where, of a place near it.
  std::function<Vector3<double>(const Model& model, const Vector3<double>& near)> on_wall{};
  std::function<void(const AppliedEffect& as, InteractionChanges<Model>& changes)> apply{};
};

/// How a model is discretised and drawn, over what it is as a rule. Reality is none of this.
struct Discretisation {
  double spacing = 1;    ///< of particles
  double support = 1;    ///< of the kernel, over the spacing
  double precision = 1;  ///< so many times shorter are time steps, and smaller the pressure solver's tolerances
  double drawing = 1;    ///< radius that particles are drawn with and gaps that are closed, over the spacing

  auto operator<=>(const Discretisation&) const = default;

  SimulatorSettings applied_to(SimulatorSettings solver) const {
    solver.spacing *= spacing;
    solver.support_in_spacings *= support;
    solver.courant_number /= precision;
    solver.tolerance_factor /= precision;
    return solver;
  }
};

/// Finer and coarser ones, each number both ways whatever the others are. Measured on pours of another kernel, spacing
/// and precision in which nothing is missing: with other spacings alone they are off by 2.0 to 2.1 where the model's
/// runs are by 1.06, and at most 1.3; with these by 1.2 to 1.4, where runs are by 1.03, and at most 1.5.
inline std::vector<Discretisation> usual_discretisations() {
  return {{1, 1, 1, 1},         {0.85, 1, 1, 1},       {0.92, 1, 1, 0.94},   {1.08, 1, 1, 1},       {1.15, 1, 1, 0.94},
          {0.85, 0.88, 1.5, 1}, {0.92, 0.88, 1, 0.94}, {1, 0.88, 1.5, 0.94}, {1.08, 0.88, 1, 0.94}, {1.15, 0.88, 1, 1},
          {0.85, 1, 1.5, 0.94}, {0.92, 1.08, 1, 1},    {1, 1.08, 1.5, 1},    {1.08, 1, 1.5, 0.94}};
}

/// Settings of SimulatedInteraction.
struct SimulatedInteractionSettings {
  double spacing = 0.005;  ///< of the model's particles [m], > 0
  /// One of these is drawn where all is tolerated: what a solver makes of its settings is not what is missing.
  std::vector<Discretisation> discretisations = usual_discretisations();
  double jitter = 0.05;            ///< of particles where they start, over their spacing, 0 .. 0.3
  int cell_px = 10;                ///< of silhouettes
  double longest_step = 1.0 / 60;  ///< for which the model is told to run at a time [s], > 0
};

/// Runs of a liquid simulation, as ForwardModel has it. The settled liquid at the start is made once for each
/// discretisation and amount of liquid. Runs of different seeds begin with particles that are shifted a little: liquid
/// in free fall does the rest.
template <class Model, class CameraType>
class SimulatedInteraction {
 public:
  using Scene = InteractionScene<Model, CameraType>;
  using Changes = InteractionChanges<Model>;

  /// Throws std::invalid_argument if something is missing, or a setting is out of range.
  SimulatedInteraction(Scene scene, std::vector<InteractionEffect<Model>> effects,
                       const SimulatedInteractionSettings& settings = {})
      : scene_(std::move(scene)), settings_(settings), starts_(std::make_shared<Starts>()) {
    expects(static_cast<bool>(scene_.start), "SimulatedInteraction: start", "a function", "none");
    expects(!scene_.times.empty(), "SimulatedInteraction: times", "at least one frame", "none");
    for (std::size_t k = 0; k < scene_.times.size(); ++k) {
      expects(std::isfinite(scene_.times[k]) && (k == 0 || scene_.times[k] > scene_.times[k - 1]),
              "SimulatedInteraction: time [s]", "finite and increasing", scene_.times[k]);
    }
    for (const auto& camera : scene_.cameras) {
      expects(camera.camera_from_world.size() == scene_.times.size(), "SimulatedInteraction: poses of a camera",
              "one for each frame", camera.camera_from_world.size());
    }
    for (const InteractionSensor<Model>& sensor : scene_.sensors) {
      expects(static_cast<bool>(sensor.read), "SimulatedInteraction: what '" + sensor.name + "' reads", "a function",
              "none");
      static_cast<void>(ReadingSeries(sensor.name, sensor.error));  // throws if the error is out of range
    }
    expects(settings.spacing > 0, "SimulatedInteraction: spacing [m]", "> 0", settings.spacing);
    expects(!settings.discretisations.empty(), "SimulatedInteraction: discretisations", "at least one", "none");
    for (const Discretisation& each : settings.discretisations) {
      const double least = std::min({each.spacing, each.support, each.precision, each.drawing});
      expects(least > 0 && std::isfinite(each.spacing + each.support + each.precision + each.drawing),
              "SimulatedInteraction: numbers of a discretisation", "> 0 and finite", least);
    }
    expects(settings.jitter >= 0 && settings.jitter <= 0.3, "SimulatedInteraction: jitter", "0 .. 0.3",
            settings.jitter);
    expects(settings.longest_step > 0, "SimulatedInteraction: longest_step [s]", "> 0", settings.longest_step);
    for (InteractionEffect<Model>& effect : effects) {
      validate(effect);
      expects(static_cast<bool>(effect.apply), "Effect '" + effect.name + "': apply", "a function", "none");
      expects(!effect.of_body || *effect.of_body < scene_.motion.size(), "Effect '" + effect.name + "': of_body",
              "one of those that there are motions of", effect.of_body.value_or(0));
      expects(!effect.on_wall || effect.of_body, "Effect '" + effect.name + "': of_body", "one where it is on a wall",
              "none");
      of_body_.push_back(effect.of_body);
      on_wall_.push_back(effect.on_wall);
      apply_.push_back(std::move(effect.apply));
      effects_.push_back(std::move(effect));
    }
  }

  const std::vector<Effect>& effects() const noexcept { return effects_; }
  const Scene& scene() const noexcept { return scene_; }
  const SimulatedInteractionSettings& settings() const noexcept { return settings_; }

  /// What a run starts with: all that it changes, and how it is discretised.
  std::pair<Changes, Discretisation> changes(const ModelRun& run) const {
    std::pair<Changes, Discretisation> result;
    auto& [changes, discretisation] = result;
    changes.body_offset.assign(scene_.motion.size(), Vector3<double>::Zero());
    changes.sensor_gain.assign(scene_.sensors.size(), 1);
    changes.first = scene_.times.front();
    std::mt19937 random(run.seed);
    if (run.tolerated) {
      const std::size_t variants = settings_.discretisations.size();
      const auto which = static_cast<std::size_t>(detail::unit_draw(random) * static_cast<double>(variants));
      discretisation = settings_.discretisations[std::min(which, variants - 1)];
    }
    const std::vector<AppliedEffect> as = effects_of_run(effects_, run, random);
    for (std::size_t k = 0; k < effects_.size(); ++k) {
      if (as[k].strength != effects_[k].base()) {
        apply_[k](as[k], changes);
      }
    }
    return result;
  }

  /// Where an effect acts if that is what was seen: on the pixel's ray, in the upright plane through the effect's usual
  /// place that faces the camera, and no lower than that if it is liquid that falls. One camera does not say how far
  /// off it is. What acts at a wall is where that is nearest to what was seen.
  std::optional<Vector3<double>> place_of(std::size_t effect, const Sighting& seen) const {
    const Effect& of = effects_.at(effect);
    if (!of.place || seen.camera >= scene_.cameras.size() || !seen.pixel.allFinite() || !std::isfinite(seen.time)) {
      return std::nullopt;
    }
    const InteractionCamera<CameraType>& camera = scene_.cameras[seen.camera];
    const auto next = std::lower_bound(scene_.times.begin(), scene_.times.end(), seen.time - 1e-9);
    const auto frame =
        std::min<std::size_t>(static_cast<std::size_t>(next - scene_.times.begin()), scene_.times.size() - 1);
    const Pose world_from_camera = camera.camera_from_world[frame].inverse();
    const Pose own = of_body_[effect] ? scene_.motion[*of_body_[effect]].at(seen.time) : Pose{};
    const Vector3<double> up = -settled({}, 1).settings().gravity.normalized();
    if (on_wall_[effect]) {
      const auto nearest = nearest_of_wall(*of_body_[effect], camera.camera, own.inverse() * world_from_camera,
                                           own.rotation.conjugate() * up, seen);
      return nearest ? std::optional(placed(effect, *nearest)) : std::nullopt;
    }
    const Vector3<double> begin = world_from_camera * camera.camera.unproject(seen.pixel, 0);
    const Vector3<double> along = world_from_camera * camera.camera.unproject(seen.pixel, 1) - begin;
    const Vector3<double> sight = world_from_camera.rotation * Vector3<double>::UnitZ();
    Vector3<double> normal = sight - sight.dot(up) * up;
    if (normal.norm() < 0.3) {  // from above: a level plane
      normal = sight;
    }
    const double reach = normal.dot(own * *of.place - begin) / normal.dot(along);
    if (!std::isfinite(reach) || reach <= 0) {
      return std::nullopt;
    }
    Vector3<double> place = begin + reach * along;
    if (of.seen_first == SeenFirst::Falling) {
      place += std::max(0.0, up.dot(own * *of.place - place)) * up;
    }
    return own.inverse() * place;
  }

  /// Where an effect acts of which a place is asked for: what acts at a wall, at its wall.
  Vector3<double> placed(std::size_t effect, const Vector3<double>& place) const {
    return on_wall_.at(effect) ? on_wall_[effect](settled({}, 1), place) : place;
  }

  /// The model of a run as it starts: its clock stands at what is the first frame's time, its bodies are in motion.
  Model started(const ModelRun& run) const {
    const auto [changes, discretisation] = this->changes(run);
    Model model = unchanged(changes, discretisation, run.seed);
    change(model, changes);
    return model;
  }

  Observation predict(const ModelRun& run) const {
    Observation seen;
    for (const auto& camera : scene_.cameras) {
      seen.silhouettes.emplace_back(camera.camera.width(), camera.camera.height(), settings_.cell_px);
    }
    for (const InteractionSensor<Model>& sensor : scene_.sensors) {
      seen.readings.emplace_back(sensor.name, sensor.error);
    }
    const auto see = [&](std::size_t frame, const Model&, std::span<const Mask> masks, std::span<const double> read) {
      for (std::size_t camera = 0; camera < masks.size(); ++camera) {
        seen.silhouettes[camera].add(scene_.times[frame], masks[camera]);
      }
      for (std::size_t sensor = 0; sensor < read.size(); ++sensor) {
        seen.readings[sensor].add(scene_.times[frame], read[sensor]);
      }
    };
    return watch(run, see) ? seen : Observation();
  }

  /// Runs, and calls frame_is_there(frame, model, masks by camera, readings by sensor) for each frame that is compared.
  /// @return whether the simulation came to its end; false as well where it cannot be given an effect as it is asked
  /// for: a hole in mid-air.
  template <class FrameIsThere>
  bool watch(const ModelRun& run, FrameIsThere&& frame_is_there) const {
    const auto [changes, discretisation] = this->changes(run);
    Model model = unchanged(changes, discretisation, run.seed);
    try {
      change(model, changes);
    } catch (const std::invalid_argument&) {
      return false;
    }
    std::vector<Eye> eyes;
    for (const auto& camera : scene_.cameras) {
      eyes.push_back(eye(camera, changes, discretisation.drawing, model));
    }
    std::vector<Mask> masks(eyes.size());
    std::vector<double> first_read(scene_.sensors.size()), read(scene_.sensors.size());
    const double start = model.time() - scene_.times.front() - changes.start_delay;
    for (std::size_t frame = 0; frame < scene_.times.size(); ++frame) {
      // in equal steps: of stamps that are rounded, whole ones would leave next to nothing for the last one
      const double gap = start + scene_.times[frame] - model.time();
      const double steps = std::max(1.0, std::ceil(gap / settings_.longest_step - 1e-3));
      for (int step = 0; gap > 1e-9 && step < static_cast<int>(steps); ++step) {
        if (!model.step(gap / steps).advanced()) {
          return false;
        }
      }
      for (std::size_t k = 0; k < eyes.size(); ++k) {
        eyes[k].picture.predict(model, 0, eyes[k].turn * scene_.cameras[k].camera_from_world[frame], masks[k]);
      }
      for (std::size_t k = 0; k < read.size(); ++k) {
        const double there = scene_.sensors[k].read(model);
        if (frame == 0 || !std::isfinite(first_read[k])) {
          first_read[k] = there;
        }
        const double change = changes.sensor_gain[k] * (there - first_read[k]);
        read[k] = scene_.sensors[k].from_first ? change : changes.sensor_gain[k] == 1 ? there : first_read[k] + change;
      }
      frame_is_there(frame, model, std::span<const Mask>(masks), std::span<const double>(read));
    }
    return true;
  }

 private:
  /// The place of a body's wall nearest to what was seen, in its frame; of those that are as near as jets are wide the
  /// highest, since what leaves there falls.
  std::optional<Vector3<double>> nearest_of_wall(std::size_t body, const CameraType& camera,
                                                 const Pose& body_from_camera, const Vector3<double>& up,
                                                 const Sighting& seen) const {
    constexpr double wide = 0.01;  // [m]
    const auto& surface = *settled({}, 1).bodies()[static_cast<BodyId>(body)].surface;
    std::vector<PlaceByRay> places;
    double least = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector2d& pixel : seen.squares.empty() ? std::vector{seen.pixel} : seen.squares) {
      const Vector3<double> begin = body_from_camera * camera.unproject(pixel, 0);
      if (const auto place = place_by_ray(surface, begin, body_from_camera * camera.unproject(pixel, 1) - begin)) {
        places.push_back(*place);
        least = std::min(least, place->distance);
      }
    }
    std::erase_if(places, [&](const PlaceByRay& each) { return each.distance > least + wide; });
    const auto highest = std::max_element(
        places.begin(), places.end(), [&](const auto& a, const auto& b) { return up.dot(a.point) < up.dot(b.point); });
    return highest == places.end() ? std::nullopt : std::optional(highest->point);
  }

  using Picture = Tracker<Model, OpenLoop<typename Model::Scalar, CameraType>, CameraType>;

  /// A tracker's drawing, without its tracking.
  struct Eye {
    Picture picture;
    Pose turn;
  };

  Eye eye(const InteractionCamera<CameraType>& camera, const Changes& changes, double size, const Model& model) const {
    TrackerSettings drawing;
    drawing.threads = model.settings().threads;
    drawing.sphere_in_spacings *= size;
    drawing.gap_closing_in_spacings *= size;
    const double grown = changes.mask_growth * camera.distance / camera.pixels_per_radian;  // [m]
    drawing.sphere_in_spacings = std::max(0.1, drawing.sphere_in_spacings + grown / model.spacing());
    const Eigen::Vector2d angle = changes.camera_shift / camera.pixels_per_radian;
    const Eigen::Quaterniond turn = Eigen::AngleAxisd(changes.camera_roll, Eigen::Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(angle.x(), Eigen::Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(-angle.y(), Eigen::Vector3d::UnitX());
    Eye result{Picture(model, {}, drawing), {turn, Vector3<double>::Zero()}};
    result.picture.add_camera(camera.camera, camera.camera_from_world.front());
    return result;
  }

  /// Where a body is at a time of the recording.
  Pose pose_of(std::size_t body, double time, const Changes& changes) const {
    Pose pose = scene_.motion[body].at(time + changes.pose_delay);
    pose.translation += changes.body_offset[body];
    return pose;
  }

  static void change(Model& model, const Changes& changes) {
    for (const auto& change : changes.before_settling) {
      change(model);
    }
    if (!changes.before_settling.empty()) {
      model.settle(1, 0.002);
    }
    for (const auto& change : changes.of_model) {
      change(model);
    }
  }

  /// Before it is given what changes itself.
  Model unchanged(const Changes& changes, Discretisation discretisation, std::uint32_t seed) const {
    discretisation.drawing = 1;  // which matters later
    const Model& start = settled(discretisation, changes.fill);
    const std::vector<Index> kept = lowest(start, amount_of(const_cast<Model&>(start).fluid(), changes.fill));
    Model model = start;
    const std::size_t bodies = scene_.motion.size();
    expects(model.bodies().size() >= bodies, "SimulatedInteraction: bodies of the model",
            "at least as many as there are motions", model.bodies().size());
    // Bodies start elsewhere with what is in them: liquid is taken out, moved along and put back.
    const auto before = model.fluid();
    model.remove_particles_if([](Index) { return true; });
    const double now = model.time(), first = scene_.times.front();
    std::vector<Pose> moved;
    for (std::size_t body = 0; body < bodies; ++body) {
      const auto id = static_cast<BodyId>(body);
      const Pose from = model.bodies()[id].motion.at(now), to = pose_of(body, first, changes);
      moved.push_back(to * from.inverse());
      std::vector<PoseTrack::Sample> samples{{now, to}};
      for (const PoseTrack::Sample& sample : scene_.motion[body].samples()) {
        const double time = sample.time - changes.pose_delay;
        if (time > first + 1e-9) {
          samples.push_back({time - first + now, pose_of(body, time, changes)});
        }
      }
      model.set_motion(id, PoseTrack(std::move(samples)));
    }
    std::mt19937 random(seed);
    const auto shake = [&] {
      return settings_.jitter * model.spacing() * (static_cast<double>(random()) / 2147483648.0 - 1);
    };
    using Scalar = typename Model::Scalar;
    PointArray<Scalar> place(3, 1);
    for (const Index i : kept) {
      Vector3<double> x = before.position.col(i).template cast<double>();
      const std::size_t origin = before.origin[i];
      if (origin < bodies) {
        x = moved[origin] * x;
      }
      for (int axis = 0; axis < 3; ++axis) {
        x[axis] += shake();
      }
      place.col(0) = x.template cast<Scalar>();
      model.add_particles(place, PointArray<Scalar>::Zero(3, 1), before.origin[i]);
    }
    return model;
  }

  /// Amounts between those that are settled come from the next larger one, without its highest particles.
  static double settled_amount(double fill) noexcept { return std::ceil(fill / fill_step - 1e-9) * fill_step; }

  /// How many particles of a settled start belong to an amount.
  template <class Fluid>
  static Index amount_of(const Fluid& settled, double fill) noexcept {
    const double share = fill / settled_amount(fill);
    return static_cast<Index>(std::llround(share * static_cast<double>(settled.size())));
  }

  /// The particles that remain if the highest ones are taken off.
  static std::vector<Index> lowest(const Model& model, Index count) {
    const auto& fluid = const_cast<Model&>(model).fluid();
    const Vector3<double> down = model.settings().gravity;
    std::vector<std::pair<double, std::uint32_t>> depth(static_cast<std::size_t>(fluid.size()));
    std::vector<Index> order(depth.size());
    for (std::size_t k = 0; k < depth.size(); ++k) {
      const auto i = static_cast<Index>(k);
      order[k] = i;
      depth[k] = {-down.dot(fluid.position.col(i).template cast<double>()), fluid.id[i]};
    }
    std::sort(order.begin(), order.end(), [&](Index a, Index b) {
      return depth[static_cast<std::size_t>(a)] < depth[static_cast<std::size_t>(b)];
    });
    order.resize(static_cast<std::size_t>(count));
    return order;
  }

  /// Made by whichever thread needs it first, while others that need it wait.
  const Model& settled(const Discretisation& discretisation, double fill) const {
    Start* start = nullptr;
    {
      const std::lock_guard lock(starts_->mutex);
      auto& slot = starts_->by_kind_and_fill[{discretisation, settled_amount(fill)}];
      if (!slot) {
        slot = std::make_unique<Start>();
      }
      start = slot.get();
    }
    std::call_once(start->once, [&] {
      SimulatorSettings solver = for_tracking({});
      solver.spacing = settings_.spacing;
      start->model =
          std::make_unique<const Model>(scene_.start(discretisation.applied_to(solver), settled_amount(fill)));
    });
    return *start->model;
  }

  struct Start {
    std::once_flag once{};
    std::unique_ptr<const Model> model{};
  };
  struct Starts {
    std::mutex mutex{};
    std::map<std::pair<Discretisation, double>, std::unique_ptr<Start>> by_kind_and_fill{};
  };

  static constexpr double fill_step = 0.05;

  Scene scene_;
  SimulatedInteractionSettings settings_;
  std::vector<Effect> effects_{};
  std::vector<decltype(InteractionEffect<Model>::apply)> apply_{};
  std::vector<std::optional<std::size_t>> of_body_{};
  std::vector<decltype(InteractionEffect<Model>::on_wall)> on_wall_{};
  std::shared_ptr<Starts> starts_;  ///< copies share what they have settled
};

}  // namespace decant::inline DECANT_TARGET
