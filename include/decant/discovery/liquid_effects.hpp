// SPDX-License-Identifier: MIT
#pragma once

/// The catalogue of effects that a liquid simulation may lack, each with its unit, its range and what it does to a run.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <decant/boundary/pipe_blockage.hpp>
#include <decant/boundary/pipe_section.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/boundary/wall_place.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/simulated_interaction.hpp>
#include <decant/force/back_pressure.hpp>
#include <decant/force/body_acceleration.hpp>
#include <decant/force/gravity.hpp>
#include <decant/force/linear_drag.hpp>
#include <decant/force/quadratic_drag.hpp>
#include <decant/force/residual_viscosity.hpp>
#include <decant/force/shear_thinning_viscosity.hpp>
#include <decant/force/suction.hpp>
#include <decant/force/surface_tension.hpp>
#include <decant/force/wall_adhesion.hpp>
#include <decant/force/wall_friction.hpp>
#include <decant/simulation/inlet.hpp>
#include <decant/simulation/outlet.hpp>
#include <decant/simulation/parts.hpp>

namespace decant::inline DECANT_TARGET {

/// The default composition with every force that the catalogue can turn on. At strength zero they cost nothing.
template <class ScalarType = float>
struct EffectParts : DefaultParts<ScalarType> {
  using Forces = std::tuple<Gravity<ScalarType>, ShearThinningViscosity<ScalarType>, ResidualViscosity<ScalarType>,
                            SurfaceTension<ScalarType>, LinearDrag<ScalarType>, QuadraticDrag<ScalarType>,
                            BodyAcceleration<ScalarType>, Suction<ScalarType>, BackPressure<ScalarType>,
                            WallFriction<ScalarType>, WallAdhesion<ScalarType>>;
};

namespace detail {

template <class Bundle, class... More>
struct WithForcesParts : Bundle {
  using Forces = decltype(std::tuple_cat(std::declval<typename Bundle::Forces>(), std::declval<std::tuple<More...>>()));
};

}  // namespace detail

/// A bundle of parts with further forces, such as a user's own effect: Simulator<WithForces<EffectParts<>, Stirrer>>.
template <class Bundle, class... More>
using WithForces = detail::WithForcesParts<Bundle, More...>;

/// A window on a recording's clock in the time of a model that starts at the first frame.
template <class Model>
TimeWindow in_model_time(const TimeWindow& window, const Model& model, double first_frame) noexcept {
  return {model.time() + window.from - first_frame, model.time() + window.until - first_frame};
}

/// Since when a force acts.
enum class ForceBegins {
  WithRecording,  ///< or later: liquid at rest is not moved by it, or it was not there before
  BeforeIt        ///< liquid has come to rest under it, unless it acts for a while only: a leaning table
};

/// What may be missing from a force's own numbers: set(force, strength) changes the force before a run begins, or
/// set(force, as), with all that is asked for; windows are then in the model's own time.
template <class Force, class Model, class Set>
InteractionEffect<Model> force_effect(Effect effect, Set set, ForceBegins begins = ForceBegins::WithRecording) {
  InteractionEffect<Model> result;
  static_cast<Effect&>(result) = std::move(effect);
  result.apply = [set, begins](const AppliedEffect& as, InteractionChanges<Model>& changes) {
    const bool before = begins == ForceBegins::BeforeIt && !as.window;
    (before ? changes.before_settling : changes.of_model).push_back([=, first = changes.first](Model& model) {
      Force& force = model.template force<Force>();
      if constexpr (std::is_invocable_v<Set, Force&, const AppliedEffect&>) {
        AppliedEffect own = as;
        if (own.window) {
          own.window = in_model_time(*own.window, model, first);
        }
        set(force, own);
      } else {
        static_cast<void>(first);
        set(force, as.strength[0]);
      }
    });
  };
  return result;
}

namespace detail {

/// Effect with one component.
template <class Model, class Apply>
InteractionEffect<Model> run_effect(Effect effect, EffectKind kind, Apply apply) {
  InteractionEffect<Model> result;
  static_cast<Effect&>(result) = std::move(effect);
  result.kind = kind;
  result.apply = std::move(apply);
  return result;
}

}  // namespace detail

/// Two level directions, square to each other: the world's x and y where gravity is along its z.
inline std::array<Vector3<double>, 2> level_directions(const Vector3<double>& gravity) {
  const Vector3<double> up = -gravity.normalized();
  const Vector3<double> other = std::abs(up.x()) < 0.9 ? Vector3<double>::UnitX() : Vector3<double>::UnitZ();
  const Vector3<double> first = (other - other.dot(up) * up).normalized();
  return {first, up.cross(first)};
}

namespace detail {

/// Sets a pull in level directions, by their components, for the time that it lasts.
template <class Scalar>
auto level_pull(const Vector3<double>& gravity) {
  return [level = level_directions(gravity)](BodyAcceleration<Scalar>& force, const AppliedEffect& as) {
    const Vector3<double> pull = as.strength[0] * level[0] + as.strength[1] * level[1];
    force.pull = pull.template cast<Scalar>();
    if (as.window) {
      force.from = as.window->from;
      force.until = as.window->until;
    }
  };
}

}  // namespace detail

/// Effects by forces that act on all liquid alike, for a model of EffectParts or more. Strengths are what pours of some
/// centimetres to decimetres can show; what is tolerated is what a calibrated model is not sure of.
/// @param kinematic_viscosity that the model has [m^2/s]. @param gravity that it has [m/s^2].
template <class Model>
std::vector<InteractionEffect<Model>> force_effects(double kinematic_viscosity,
                                                    const Vector3<double>& gravity = {0, 0, -9.81}) {
  using Scalar = typename Model::Scalar;
  std::vector<InteractionEffect<Model>> effects;
  effects.push_back(force_effect<LinearDrag<Scalar>, Model>(
      plain_effect("drag_linear", "drag", "1/s", "air slows the liquid in proportion to its speed", {"", 0, 0, 4},
                   "simulator.force<LinearDrag<float>>().rate = @;"),
      [](auto& force, double s) { force.rate = static_cast<Scalar>(s); }));
  effects.push_back(force_effect<QuadraticDrag<Scalar>, Model>(
      plain_effect("drag_quadratic", "drag", "1/m", "air slows the liquid in proportion to its speed squared",
                   {"", 0, 0, 3}, "simulator.force<QuadraticDrag<float>>().drag = @;"),
      [](auto& force, double s) { force.drag = static_cast<Scalar>(s); }));
  const double thick = 2e-3;  // [m^2/s]
  effects.push_back(force_effect<ShearThinningViscosity<Scalar>, Model>(
      plain_effect("viscosity", "viscosity", "m^2/s", "the liquid is thicker than assumed",
                   {"", kinematic_viscosity, kinematic_viscosity, std::max(thick, 10 * kinematic_viscosity),
                    std::max(2e-5, kinematic_viscosity)},
                   "simulator.force<ShearThinningViscosity<float>>().kinematic_viscosity = @;"),
      [](auto& force, double s) { force.kinematic_viscosity = static_cast<Scalar>(s); }));
  effects.push_back(force_effect<ShearThinningViscosity<Scalar>, Model>(
      plain_effect(
          "shear_thinning", "viscosity", "m^2/s",
          "the liquid is thick at rest and the thinner the faster it is sheared (its strength is that at rest)",
          {"", kinematic_viscosity, kinematic_viscosity, std::max(4 * thick, 10 * kinematic_viscosity)},
          "auto& friction = simulator.force<ShearThinningViscosity<float>>(); friction.kinematic_viscosity = @; "
          "friction.high_shear_viscosity = assumed; friction.relaxation_time = 0.1F; friction.exponent = 0.4F;"),
      [kinematic_viscosity](auto& force, double s) {
        force.kinematic_viscosity = static_cast<Scalar>(s);
        force.high_shear_viscosity = static_cast<Scalar>(kinematic_viscosity);
        force.relaxation_time = Scalar(0.1);
        force.exponent = Scalar(0.4);
      }));
  effects.push_back(force_effect<SurfaceTension<Scalar>, Model>(
      plain_effect("surface_tension", "", "N/m", "the liquid's surface holds together more than assumed",
                   {"", 0, 0, 0.3, 0.02}, "simulator.force<SurfaceTension<float>>().surface_tension = @;"),
      [](auto& force, double s) { force.surface_tension = static_cast<Scalar>(s); }, ForceBegins::BeforeIt));
  effects.push_back(force_effect<WallFriction<Scalar>, Model>(
      plain_effect("wall_friction", "", "1/s", "walls slow the liquid that touches them", {"", 0, 0, 60, 1},
                   "simulator.force<WallFriction<float>>().rate = @;"),
      [](auto& force, double s) { force.rate = static_cast<Scalar>(s); }));
  effects.push_back(force_effect<WallAdhesion<Scalar>, Model>(
      plain_effect("wall_adhesion", "", "m/s^2", "walls attract the liquid, which runs down the outside of a spout",
                   {"", 0, 0, 30, 1}, "simulator.force<WallAdhesion<float>>().strength = @;"),
      [](auto& force, double s) { force.strength = static_cast<Scalar>(s); }, ForceBegins::BeforeIt));
  Effect pull = plain_effect("lateral_force", "", "m/s^2",
                             "something pulls the liquid sideways: wind, or a table that "
                             "is not level",
                             {"x", 0, -1.2, 1.2, 0.03},
                             "simulator.force<BodyAcceleration<float>>().pull = @ * level[0] + @ * level[1];");
  pull.components.push_back({"y", 0, -1.2, 1.2, 0.03});
  effects.push_back(
      force_effect<BodyAcceleration<Scalar>, Model>(pull, detail::level_pull<Scalar>(gravity), ForceBegins::BeforeIt));
  const double weight = gravity.norm();
  if (weight == 0) {
    return effects;
  }
  effects.push_back(force_effect<Gravity<Scalar>, Model>(
      plain_effect("gravity", "", "m/s^2", "gravity is other than assumed", {"", weight, 0.8 * weight, 1.2 * weight},
                   "simulator.force<Gravity<float>>().acceleration *= @ / assumed;"),
      [weight](auto& force, double s) { force.acceleration *= static_cast<Scalar>(s / weight); }));
  return effects;
}

/// A sideways pull that does not last. @param window about when [s]. @param tolerance of its ends. @param where in
/// words: "in the beginning". @param gravity that the model has [m/s^2].
template <class Model>
InteractionEffect<Model> passing_force_effect(const TimeWindow& window, double tolerance, std::string where,
                                              const Vector3<double>& gravity = {0, 0, -9.81}) {
  using Scalar = typename Model::Scalar;
  Effect effect =
      plain_effect("lateral_force", "", "m/s^2", "something pulls the liquid sideways for a while, such as a gust",
                   {"x", 0, -1.2, 1.2},
                   "auto& pull = simulator.force<BodyAcceleration<float>>(); pull.pull = @ * level[0] + @ * level[1]; "
                   "pull.from = ~; pull.until = ~;");
  effect.components.push_back({"y", 0, -1.2, 1.2});
  effect.window = window;
  effect.window_tolerance = tolerance;
  effect.where = std::move(where);
  return force_effect<BodyAcceleration<Scalar>, Model>(effect, detail::level_pull<Scalar>(gravity));
}

/// A pull toward a point. @param place [m], world frame. @param where in words.
template <class Model>
InteractionEffect<Model> suction_effect(const Vector3<double>& place, std::string where) {
  using Scalar = typename Model::Scalar;
  Effect effect = plain_effect(
      "suction", "", "m/s^2", "something draws the liquid toward a point (its strength is that at 5 cm)",
      {"", 0, 0, 12}, "auto& suction = simulator.force<Suction<float>>(); suction.strength = @; suction.point = {#};");
  effect.place = place;
  effect.where = std::move(where);
  effect.place_tolerance = 0.04;
  return force_effect<Suction<Scalar>, Model>(effect, [](Suction<Scalar>& force, const AppliedEffect& as) {
    force.strength = static_cast<Scalar>(as.strength[0]);
    force.point = as.place->template cast<Scalar>();
  });
}

namespace detail {

/// A flow in a window of time [s], or always.
inline std::vector<std::pair<double, double>> steady(double millilitres_per_second, const TimeWindow& window = {}) {
  const double flow = 1e-6 * millilitres_per_second;  // [m^3/s]
  return {{std::max(window.from, -1e6), flow}, {std::min(window.until, 1e6), flow}};
}

/// A hole in a body, in its frame.
struct Hole {
  Vector3<double> position = Vector3<double>::Zero();  ///< where liquid goes out [m]
  std::optional<Vector3<double>> exit{};               ///< where it goes on [m]; nothing: it is not seen again
  Vector3<double> out = Vector3<double>::Zero();       ///< in which direction, if it comes with a speed
};

/// @param hole_at(model, place) the Hole that is looked for there.
template <class Model, class HoleAt>
InteractionEffect<Model> hole_effect(BodyId body, const Vector3<double>& place, std::string where, HoleAt hole_at) {
  Effect effect = plain_effect("leak", "", "ml/s", "a container leaks", {"", 0, 0, 40},
                               "simulator.add_outlet({container, {#}, radius, {{0, 1e-6 * @}, {60, 1e-6 * @}}});");
  effect.place = place;
  effect.place_tolerance = 0.02;
  effect.seen_first = SeenFirst::Liquid;
  effect.where = std::move(where);
  auto result = run_effect<Model>(std::move(effect), EffectKind::Physics,
                                  [body, hole_at](const AppliedEffect& as, InteractionChanges<Model>& changes) {
                                    changes.of_model.push_back([body, hole_at, as](Model& model) {
                                      const Hole hole = hole_at(model, *as.place);
                                      OutletSettings outlet;
                                      outlet.body = body;
                                      outlet.position = hole.position;
                                      outlet.radius = 3 * model.spacing();
                                      outlet.exit = hole.exit;
                                      outlet.exit_velocity = as.speed.value_or(0) * hole.out;
                                      outlet.flow = steady(as.strength[0]);
                                      model.add_outlet(outlet);
                                    });
                                  });
  result.of_body = body;
  return result;
}

}  // namespace detail

/// A hole of which it is known where liquid goes on. @param place where it goes out, and @param below how far from
/// there it goes on outside of the wall, both in the body's frame [m]: at other places along the wall beside them, at
/// such nearer to it or farther off it as far outside as here. @param where in words.
template <class Model>
InteractionEffect<Model> leak_effect(BodyId body, const Vector3<double>& place, const Vector3<double>& below,
                                     std::string where) {
  return detail::hole_effect<Model>(body, place, std::move(where),
                                    [place, below](const Model&, const Vector3<double>& at) {
                                      const Vector3<double> moved = at - place, out = below.normalized();
                                      return detail::Hole{at, place + below + moved - out * out.dot(moved)};
                                    });
}

/// A hole anywhere in a container's wall, through which liquid leaves square to it, at rest or as a jet.
/// @param floor, mouth middles of the container's inside, lowest and highest: holes are where the wall is seen from the
/// line between them, square to it, in the direction of a place. @param place where one is looked for first. All in the
/// body's frame [m]. @param where in words.
template <class Model>
InteractionEffect<Model> wall_leak_effect(BodyId body, const Vector3<double>& floor, const Vector3<double>& mouth,
                                          const Vector3<double>& place, std::string where) {
  const auto seen_in = [body, floor, mouth](const Model& model, const Vector3<double>& direction) {
    const Vector3<double> axis = mouth - floor;
    const double height = (direction - floor).dot(axis) / axis.squaredNorm();
    const double within = std::clamp(height, 0.1, 0.95);  // of a wall, not of a floor or beyond the rim
    return wall_place(*model.bodies()[body].surface, floor + within * axis, direction + (within - height) * axis);
  };
  auto effect = detail::hole_effect<
      Model>(body, place, std::move(where), [seen_in](const Model& model, const Vector3<double>& at) {
    const WallPlace wall = seen_in(model, at);
    constexpr double before = 0.004, beyond = 0.009;  // [m], clear of the wall by particles of usual spacings
    return detail::Hole{wall.point - before * wall.out, wall.point + (wall.thickness + beyond) * wall.out, wall.out};
  });
  effect.code =
      "simulator.add_outlet({container, {#}, radius, {{0, 1e-6 * @}, {60, 1e-6 * @}}, OutletOrder::Nearest, "
      "beyond_the_wall, ^ * out_of_it});";
  effect.place_tolerance = 0.03;
  effect.fastest = 1.2;  // of water that stands 7 cm above the hole (Torricelli)
  effect.on_wall = [seen_in](const Model& model, const Vector3<double>& near) { return seen_in(model, near).point; };
  return effect;
}

/// A hole of which what goes out is not seen again: it runs into a stand, or behind something.
template <class Model>
InteractionEffect<Model> hidden_leak_effect(BodyId body, const Vector3<double>& place, std::string where) {
  auto effect = detail::hole_effect<Model>(body, place, std::move(where),
                                           [](const Model&, const Vector3<double>& at) { return detail::Hole{at}; });
  effect.seen_first = SeenFirst::Nothing;
  return effect;
}

/// Liquid that a container loses everywhere: it evaporates, or the container soaks it up. @param radius around the
/// place that the container is within [m].
template <class Model>
InteractionEffect<Model> loss_effect(BodyId body, const Vector3<double>& place, double radius, std::string where) {
  Effect effect = plain_effect("loss", "", "ml/s", "liquid disappears little by little", {"", 0, 0, 40},
                               "simulator.add_outlet({container, {#}, radius, {{0, 1e-6 * @}, {60, 1e-6 * "
                               "@}}, OutletOrder::Evenly});");
  effect.place = place;
  effect.where = std::move(where);
  return detail::run_effect<Model>(std::move(effect), EffectKind::Physics,
                                   [body, radius](const AppliedEffect& as, InteractionChanges<Model>& changes) {
                                     OutletSettings outlet;
                                     outlet.body = body;
                                     outlet.position = *as.place;
                                     outlet.radius = radius;
                                     outlet.order = OutletOrder::Evenly;
                                     outlet.flow = detail::steady(as.strength[0]);
                                     changes.of_model.push_back([outlet](Model& model) { model.add_outlet(outlet); });
                                   });
}

/// Liquid that comes from somewhere else, falling. @param place [m], world frame. @param origin of its particles.
/// @param window when. @param window_tolerance how much earlier or later its ends may be [s].
template <class Model>
InteractionEffect<Model> inflow_effect(const Vector3<double>& place, Origin origin, std::string where,
                                       const TimeWindow& window = {}, double window_tolerance = 0) {
  Effect effect = plain_effect("inflow", "", "ml/s", "liquid comes in from elsewhere", {"", 0, 0, 40},
                               "simulator.add_inlet({{#}, down, radius, {{~, 1e-6 * @}, {60, 1e-6 * @}}}, origin);");
  effect.place = place;
  effect.seen_first = SeenFirst::Falling;
  effect.where = std::move(where);
  effect.place_tolerance = 0.04;
  effect.window = window;
  effect.window_tolerance = window_tolerance;
  return detail::run_effect<Model>(
      std::move(effect), EffectKind::Physics, [origin](const AppliedEffect& as, InteractionChanges<Model>& changes) {
        InletSettings inlet;
        inlet.position = *as.place;
        inlet.radius = 0.0064;  // of a half-inch hose: how wide it is nobody knows, and the same at every spacing
        changes.of_model.push_back([inlet, origin, as, first = changes.first](Model& model) {
          InletSettings own = inlet;
          own.flow = detail::steady(as.strength[0], in_model_time(*as.window, model, first));
          own.direction = model.settings().gravity;
          model.add_inlet(own, origin);
        });
      });
}

/// A level table that containers stand on, which liquid that misses them lies on: as a rule nobody records it. What
/// falls on it spreads as a film that its boundary layer slows down within centimetres (the hydraulic jump of 25 ml/s
/// of water has a radius of 4 cm: Bohr, Dimon and Putkaradze, J. Fluid Mech. 254, 1993), which particles do not
/// resolve: it is slowed as much at the table.
/// @param place a point of its top [m], world frame, about which it reaches 0.4 m. @param gravity that the model has
/// [m/s^2], not 0.
template <class Model>
InteractionEffect<Model> table_effect(const Vector3<double>& place, const Vector3<double>& gravity = {0, 0, -9.81}) {
  Effect effect = plain_effect("table", "", "", "what misses the containers lies on a table", {"", 0, 0, 1},
                               "simulator.add_body(\"table\", box under {#});");
  effect.place = place;
  const Pose pose{Eigen::Quaterniond::FromTwoVectors(Vector3<double>::UnitZ(), -gravity), place};
  return detail::run_effect<Model>(
      std::move(effect), EffectKind::Surroundings, [pose](const AppliedEffect&, InteractionChanges<Model>& changes) {
        changes.of_model.push_back([pose](Model& model) {
          constexpr double reach = 0.4, thickness = 0.03;  // [m]
          const BodyId table =
              model.add_body("table", Box{{-reach, -reach, -thickness}, {reach, reach, 0}}, PoseTrack(pose));
          constexpr double friction = 40;  // [1/s]: what arrives at 1.6 m/s comes 4 cm
          model.template force<WallFriction<typename Model::Scalar>>().rougher.emplace_back(
              table, static_cast<typename Model::Scalar>(friction));
        });
      });
}

/// Something solid that the model does not have, on a body and moving with it: a cube. @param place of its middle, in
/// the body's frame [m]. @param where in words.
template <class Model>
InteractionEffect<Model> obstacle_effect(BodyId body, const Vector3<double>& place, std::string where) {
  Effect effect =
      plain_effect("obstacle", "", "m", "something solid is in the way (its strength is its size)", {"", 0, 0, 0.03},
                   "simulator.add_body(\"obstacle\", cube at {#} of edge @, motion_of_container);");
  effect.place = place;
  effect.seen_first = SeenFirst::Either;
  effect.where = std::move(where);
  effect.place_tolerance = 0.02;
  auto result = detail::run_effect<Model>(
      std::move(effect), EffectKind::Physics, [body](const AppliedEffect& as, InteractionChanges<Model>& changes) {
        const Vector3<double> half = Vector3<double>::Constant(0.5 * as.strength[0]), middle = *as.place;
        changes.of_model.push_back([=](Model& model) {
          if (2 * half.x() > 0.2 * model.spacing()) {  // what is smaller no particle would feel
            model.add_body("obstacle", Box{middle - half, middle + half}, model.bodies()[body].motion);
          }
        });
      });
  result.of_body = body;
  return result;
}

/// A pipe that is blocked in part. @param section where, in the frame of the body [m]. @param where in words.
template <class Model>
InteractionEffect<Model> blockage_effect(BodyId body, PipeSection section, std::string where) {
  Effect effect = plain_effect(
      "obstacle", "", "", "a pipe is blocked in part (its strength is the share that is closed)", {"", 0, 0, 0.95},
      "simulator.add_body(\"blockage\", pipe_blockage(section, 1 - @, length), motion_of_pipe);");
  effect.where = std::move(where);
  auto result = detail::run_effect<Model>(
      std::move(effect), EffectKind::Physics,
      [body, section = std::move(section)](const AppliedEffect& as, InteractionChanges<Model>& changes) {
        changes.of_model.push_back([body, section, closed = as.strength[0]](Model& model) {
          // a gap along the wall that no particle would feel is none; nobody knows how a blockage's edges are rounded
          constexpr double least = 0.02, flare = 0.3;
          if (closed > least) {
            model.add_body("blockage", pipe_blockage(section, 1 - closed, section.radius(), flare),
                           model.bodies()[body].motion);
          }
        });
      });
  result.of_body = body;
  return result;
}

/// More or less liquid comes in than is known, at the model's first inlet.
template <class Model>
InteractionEffect<Model> inlet_flow_effect() {
  return detail::run_effect<Model>(
      plain_effect("inlet_flow", "", "", "more or less liquid comes in than assumed (over what is assumed)",
                   {"", 1, 0.5, 1.5, 0.02}, "simulator.set_inlet_flow(0, flow times @);"),
      EffectKind::Physics, [](const AppliedEffect& as, InteractionChanges<Model>& changes) {
        changes.of_model.push_back([factor = as.strength[0]](Model& model) {
          if (model.inlet_count() > 0) {
            auto flow = model.inlet(0).settings().flow;
            for (auto& [time, volume] : flow) {
              volume *= factor;
            }
            model.set_inlet_flow(0, std::move(flow));
          }
        });
      });
}

/// A container's narrow neck.
struct Neck {
  BodyId body = 0;
  Vector3<double> mouth = Vector3<double>::Zero();  ///< its middle, in the body's frame [m]
  Vector3<double> axis = Vector3<double>::UnitZ();  ///< out of it, in the body's frame, unit length
  double length = 0, radius = 0;                    ///< [m]
};

/// Air that comes into a container only past the liquid that runs out. @param where in words. @param middle of the time
/// in which it does [s], which beats are counted from: bubbles come in 2 to 5 times a second.
template <class Model>
InteractionEffect<Model> back_pressure_effect(const Neck& neck, std::string where, double middle) {
  using Scalar = typename Model::Scalar;
  Effect effect =
      plain_effect("back_pressure", "", "m/s^2",
                   "air cannot get in as fast as liquid wants to get out (a bottle that glugs)", {"", 0, 0, 8},
                   "auto& air = simulator.force<BackPressure<float>>(); air.strength = @; air.mouth "
                   "= {#}; air.container = motion_of_container; air.beat = {~, ~};");
  effect.place = neck.mouth;
  effect.window = TimeWindow{};
  effect.window_tolerance = 0.08;
  effect.beats = beats_to_try(0.2, middle);
  effect.where = std::move(where);
  return detail::run_effect<Model>(
      std::move(effect), EffectKind::Physics, [neck](const AppliedEffect& as, InteractionChanges<Model>& changes) {
        changes.of_model.push_back([neck, as, first = changes.first](Model& model) {
          BackPressure<Scalar>& air = model.template force<BackPressure<Scalar>>();
          air.strength = static_cast<Scalar>(as.strength[0]);
          const TimeWindow beat = in_model_time(as.window.value_or(TimeWindow{}), model, first);
          air.beat = {beat.from, beat.until};
          air.mouth = neck.mouth;
          air.axis = neck.axis;
          air.reach = neck.length;
          air.radius = neck.radius;
          air.container = model.bodies()[neck.body].motion;
        });
      });
}

/// How much there is at first, over what the model assumes.
template <class Model>
InteractionEffect<Model> fill_effect(double most = 1.25) {
  return detail::run_effect<Model>(
      plain_effect("fill", "", "", "there is more or less liquid than assumed (over what is assumed)",
                   {"", 1, 0.75, most, 0.02}, "fill(simulator, container, FillAmount::fraction(@ * assumed));"),
      EffectKind::Physics,
      [](const AppliedEffect& as, InteractionChanges<Model>& changes) { changes.fill = as.strength[0]; });
}

namespace detail {

template <class Model>
InteractionEffect<Model> delay_effect(std::string meaning, double InteractionChanges<Model>::*delay) {
  return run_effect<Model>(
      plain_effect("latency", "", "s", std::move(meaning), {"", 0, -0.12, 0.12, 0.008}, ""), EffectKind::Measurement,
      [delay](const AppliedEffect& as, InteractionChanges<Model>& changes) { changes.*delay = as.strength[0]; });
}

}  // namespace detail

/// Poses that were recorded too late.
template <class Model>
InteractionEffect<Model> latency_effect() {
  return detail::delay_effect<Model>("poses were recorded too late (too early, where negative)",
                                     &InteractionChanges<Model>::pose_delay);
}

/// The same where no body moves, and liquid is let go when the clock starts: a gate takes its time.
template <class Model>
InteractionEffect<Model> late_start_effect() {
  return detail::delay_effect<Model>("all begins later than the clock says (earlier, where negative)",
                                     &InteractionChanges<Model>::start_delay);
}

/// A body that is elsewhere. @param body its place among the scene's motions. @param name its name.
template <class Model>
InteractionEffect<Model> body_pose_effect(std::size_t body, std::string name) {
  Effect offset = plain_effect("body_pose", "", "m", "a body is not where its poses say", {"x", 0, -0.02, 0.02, 1.5e-3},
                               "pose.translation += Eigen::Vector3d(@, @, @);");
  offset.components.push_back({"y", 0, -0.02, 0.02, 1.5e-3});
  offset.components.push_back({"z", 0, -0.02, 0.02, 1.5e-3});
  offset.where = std::move(name);
  return detail::run_effect<Model>(std::move(offset), EffectKind::Measurement,
                                   [body](const AppliedEffect& as, InteractionChanges<Model>& changes) {
                                     changes.body_offset.at(body) = as.strength.template head<3>();
                                   });
}

/// What may be wrong with cameras and masks.
template <class Model>
std::vector<InteractionEffect<Model>> camera_effects() {
  using detail::run_effect;
  using Changes = InteractionChanges<Model>;
  std::vector<InteractionEffect<Model>> effects;
  Effect shift =
      plain_effect("camera_shift", "", "px", "the camera has moved, which shifts its picture", {"u", 0, -4, 4, 1}, "");
  shift.components.push_back({"v", 0, -4, 4, 1});
  effects.push_back(run_effect<Model>(shift, EffectKind::Nuisance, [](const AppliedEffect& as, Changes& changes) {
    changes.camera_shift = as.strength.head<2>();
  }));
  effects.push_back(run_effect<Model>(
      plain_effect("camera_roll", "camera_shift", "rad", "the camera has turned about its axis",
                   {"", 0, -0.02, 0.02, 0.005}, ""),
      EffectKind::Nuisance, [](const AppliedEffect& as, Changes& changes) { changes.camera_roll = as.strength[0]; }));
  effects.push_back(run_effect<Model>(
      plain_effect("mask_bias", "", "px", "masks are fatter than the liquid (thinner, where negative)",
                   {"", 0, -2, 2, 0.7}, ""),
      EffectKind::Nuisance, [](const AppliedEffect& as, Changes& changes) { changes.mask_growth = as.strength[0]; }));
  return effects;
}

/// What may be wrong with poses and cameras. @param bodies their names, in the order of the scene's motions.
template <class Model>
std::vector<InteractionEffect<Model>> measurement_effects(const std::vector<std::string>& bodies) {
  std::vector<InteractionEffect<Model>> effects{latency_effect<Model>()};
  for (std::size_t body = 0; body < bodies.size(); ++body) {
    effects.push_back(body_pose_effect<Model>(body, bodies[body]));
  }
  for (InteractionEffect<Model>& effect : camera_effects<Model>()) {
    effects.push_back(std::move(effect));
  }
  return effects;
}

/// Sensors, by their places among the scene's, that show more or less of what happens than there is: badly calibrated,
/// or cameras that see a part of the liquid.
template <class Model>
InteractionEffect<Model> sensor_gain_effect(std::vector<std::size_t> sensors, std::string where) {
  Effect effect = plain_effect("sensor_gain", "", "", "sensors show more (less, below 1) of each change than there is",
                               {"", 1, 0.6, 1.4, 0.02}, "");
  effect.where = std::move(where);
  return detail::run_effect<Model>(std::move(effect), EffectKind::Measurement,
                                   [sensors](const AppliedEffect& as, InteractionChanges<Model>& changes) {
                                     for (const std::size_t sensor : sensors) {
                                       changes.sensor_gain.at(sensor) = as.strength[0];
                                     }
                                   });
}

}  // namespace decant::inline DECANT_TARGET
