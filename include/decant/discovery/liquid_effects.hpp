// SPDX-License-Identifier: MIT
#pragma once

/// The catalogue of effects that a liquid simulation may lack, each with its unit, its range and what it does to a run.

#include <cmath>
#include <cstddef>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/simulated_interaction.hpp>
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
  using Forces =
      std::tuple<Gravity<ScalarType>, ShearThinningViscosity<ScalarType>, ResidualViscosity<ScalarType>,
                 SurfaceTension<ScalarType>, LinearDrag<ScalarType>, QuadraticDrag<ScalarType>,
                 BodyAcceleration<ScalarType>, Suction<ScalarType>, WallFriction<ScalarType>, WallAdhesion<ScalarType>>;
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

/// What may be missing from a force's own numbers: set(force, strength) changes the force before a run begins.
template <class Force, class Model, class Set>
InteractionEffect<Model> force_effect(Effect effect, Set set) {
  InteractionEffect<Model> result;
  static_cast<Effect&>(result) = std::move(effect);
  result.apply = [set](const Eigen::VectorXd& strength, const Vector3<double>& place,
                       InteractionChanges<Model>& changes) {
    changes.of_model.push_back([=](Model& model) {
      Force& force = model.template force<Force>();
      if constexpr (std::is_invocable_v<Set, Force&, const Eigen::VectorXd&, const Vector3<double>&>) {
        set(force, strength, place);
      } else {
        set(force, strength[0]);
      }
    });
  };
  return result;
}

namespace detail {

/// Effect with one component.
inline Effect plain_effect(std::string name, std::string family, std::string unit, std::string meaning,
                           const EffectComponent& component, std::string code) {
  Effect effect;
  effect.name = std::move(name);
  effect.family = std::move(family);
  effect.unit = std::move(unit);
  effect.meaning = std::move(meaning);
  effect.components = {component};
  effect.code = std::move(code);
  return effect;
}

template <class Model, class Apply>
InteractionEffect<Model> run_effect(Effect effect, EffectKind kind, Apply apply) {
  InteractionEffect<Model> result;
  static_cast<Effect&>(result) = std::move(effect);
  result.kind = kind;
  result.apply = std::move(apply);
  return result;
}

}  // namespace detail

/// Effects by forces that act on all liquid alike, for a model of EffectParts or more. Strengths are what pours of some
/// centimetres to decimetres can show; what is tolerated is what a calibrated model is not sure of.
/// @param kinematic_viscosity that the model has [m^2/s].
template <class Model>
std::vector<InteractionEffect<Model>> force_effects(double kinematic_viscosity) {
  using Scalar = typename Model::Scalar;
  using detail::plain_effect;
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
                    std::max(2e-5, kinematic_viscosity), true},
                   "simulator.force<ShearThinningViscosity<float>>().kinematic_viscosity = @;"),
      [](auto& force, double s) { force.kinematic_viscosity = static_cast<Scalar>(s); }));
  effects.push_back(force_effect<ShearThinningViscosity<Scalar>, Model>(
      plain_effect(
          "shear_thinning", "viscosity", "m^2/s",
          "the liquid is thick at rest and the thinner the faster it is sheared (its strength is that at rest)",
          {"", kinematic_viscosity, kinematic_viscosity, std::max(4 * thick, 10 * kinematic_viscosity), 0, true},
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
                   {"", 0, 0, 0.3, 0.02, true}, "simulator.force<SurfaceTension<float>>().surface_tension = @;"),
      [](auto& force, double s) { force.surface_tension = static_cast<Scalar>(s); }));
  effects.push_back(force_effect<WallFriction<Scalar>, Model>(
      plain_effect("wall_friction", "", "1/s", "walls slow the liquid that touches them", {"", 0, 0, 60, 1, true},
                   "simulator.force<WallFriction<float>>().rate = @;"),
      [](auto& force, double s) { force.rate = static_cast<Scalar>(s); }));
  effects.push_back(force_effect<WallAdhesion<Scalar>, Model>(
      plain_effect("wall_adhesion", "", "m/s^2", "walls attract the liquid, which runs down the outside of a spout",
                   {"", 0, 0, 30, 1}, "simulator.force<WallAdhesion<float>>().strength = @;"),
      [](auto& force, double s) { force.strength = static_cast<Scalar>(s); }));
  Effect pull = plain_effect("lateral_force", "", "m/s^2",
                             "something pulls the liquid sideways: wind, or a table that "
                             "is not level",
                             {"x", 0, -1.2, 1.2, 0.03}, "simulator.force<BodyAcceleration<float>>().pull = {@, @, 0};");
  pull.components.push_back({"y", 0, -1.2, 1.2, 0.03});
  effects.push_back(force_effect<BodyAcceleration<Scalar>, Model>(
      pull, [](auto& force, const Eigen::VectorXd& s, const Vector3<double>&) {
        force.pull = {static_cast<Scalar>(s[0]), static_cast<Scalar>(s[1]), Scalar(0)};
      }));
  effects.push_back(force_effect<Gravity<Scalar>, Model>(
      plain_effect("gravity", "", "m/s^2", "gravity is other than assumed", {"", 9.81, 7.85, 11.77},
                   "simulator.force<Gravity<float>>().acceleration *= @ / 9.81;"),
      [](auto& force, double s) { force.acceleration *= static_cast<Scalar>(s / 9.81); }));
  return effects;
}

/// A pull toward a point. @param place [m], world frame. @param where in words.
template <class Model>
InteractionEffect<Model> suction_effect(const Vector3<double>& place, std::string where) {
  using Scalar = typename Model::Scalar;
  Effect effect = detail::plain_effect(
      "suction", "", "m/s^2", "something draws the liquid toward a point (its strength is that at 5 cm)",
      {"", 0, 0, 12}, "auto& suction = simulator.force<Suction<float>>(); suction.strength = @; suction.point = {#};");
  effect.place = place;
  effect.where = std::move(where);
  effect.place_tolerance = 0.04;
  return force_effect<Suction<Scalar>, Model>(
      effect, [](Suction<Scalar>& force, const Eigen::VectorXd& s, const Vector3<double>& point) {
        force.strength = static_cast<Scalar>(s[0]);
        force.point = point.template cast<Scalar>();
      });
}

namespace detail {

/// From now on and for good.
inline std::vector<std::pair<double, double>> steady(double millilitres_per_second) {
  const double flow = 1e-6 * millilitres_per_second;  // [m^3/s]
  return {{-1e6, flow}, {1e6, flow}};
}

}  // namespace detail

/// A hole. @param place where liquid goes out, and @param below how far from there it goes on outside of the wall, both
/// in the body's frame [m]. @param where in words.
template <class Model>
InteractionEffect<Model> leak_effect(BodyId body, const Vector3<double>& place, const Vector3<double>& below,
                                     std::string where) {
  Effect effect =
      detail::plain_effect("leak", "", "ml/s", "a container leaks", {"", 0, 0, 40},
                           "simulator.add_outlet({container, {#}, radius, {{0, 1e-6 * @}, {60, 1e-6 * @}}});");
  effect.place = place;
  effect.where = std::move(where);
  return detail::run_effect<Model>(
      std::move(effect), EffectKind::Physics,
      [body, below](const Eigen::VectorXd& s, const Vector3<double>& at, InteractionChanges<Model>& changes) {
        OutletSettings outlet;
        outlet.body = body;
        outlet.position = at;
        outlet.exit = at + below;
        outlet.flow = detail::steady(s[0]);
        changes.of_model.push_back([outlet](Model& model) {
          OutletSettings own = outlet;
          own.radius = 3 * model.spacing();
          model.add_outlet(own);
        });
      });
}

/// Liquid that a container loses everywhere: it evaporates, or the container soaks it up. @param radius around the
/// place that the container is within [m].
template <class Model>
InteractionEffect<Model> loss_effect(BodyId body, const Vector3<double>& place, double radius, std::string where) {
  Effect effect = detail::plain_effect("loss", "", "ml/s", "liquid disappears little by little", {"", 0, 0, 40},
                                       "simulator.add_outlet({container, {#}, radius, {{0, 1e-6 * @}, {60, 1e-6 * "
                                       "@}}, OutletOrder::Evenly});");
  effect.place = place;
  effect.where = std::move(where);
  return detail::run_effect<Model>(
      std::move(effect), EffectKind::Physics,
      [body, radius](const Eigen::VectorXd& s, const Vector3<double>& at, InteractionChanges<Model>& changes) {
        OutletSettings outlet;
        outlet.body = body;
        outlet.position = at;
        outlet.radius = radius;
        outlet.order = OutletOrder::Evenly;
        outlet.flow = detail::steady(s[0]);
        changes.of_model.push_back([outlet](Model& model) { model.add_outlet(outlet); });
      });
}

/// Liquid that comes from somewhere else, falling. @param place [m], world frame. @param origin of its particles.
template <class Model>
InteractionEffect<Model> inflow_effect(const Vector3<double>& place, Origin origin, std::string where) {
  Effect effect =
      detail::plain_effect("inflow", "", "ml/s", "liquid comes in from elsewhere", {"", 0, 0, 40},
                           "simulator.add_inlet({{#}, down, radius, {{0, 1e-6 * @}, {60, 1e-6 * @}}}, origin);");
  effect.place = place;
  effect.where = std::move(where);
  effect.place_tolerance = 0.04;
  return detail::run_effect<Model>(
      std::move(effect), EffectKind::Physics,
      [origin](const Eigen::VectorXd& s, const Vector3<double>& at, InteractionChanges<Model>& changes) {
        InletSettings inlet;
        inlet.position = at;
        inlet.flow = detail::steady(s[0]);
        changes.of_model.push_back([inlet, origin](Model& model) {
          InletSettings own = inlet;
          own.direction = model.settings().gravity;
          own.radius = model.spacing();
          model.add_inlet(own, origin);
        });
      });
}

/// How much there is at first, over what the model assumes.
template <class Model>
InteractionEffect<Model> fill_effect(double most = 1.25) {
  return detail::run_effect<Model>(
      detail::plain_effect("fill", "", "", "there is more or less liquid than assumed (over what is assumed)",
                           {"", 1, 0.75, most, 0.02}, "fill(simulator, container, FillAmount::fraction(@ * assumed));"),
      EffectKind::Physics, [](const Eigen::VectorXd& s, const Vector3<double>&, InteractionChanges<Model>& changes) {
        changes.fill = s[0];
      });
}

/// What may be wrong with poses and cameras. @param bodies their names, in the order of the scene's motions.
template <class Model>
std::vector<InteractionEffect<Model>> measurement_effects(const std::vector<std::string>& bodies) {
  using detail::plain_effect;
  using detail::run_effect;
  using Changes = InteractionChanges<Model>;
  using Strength = Eigen::VectorXd;
  std::vector<InteractionEffect<Model>> effects;
  effects.push_back(run_effect<Model>(
      plain_effect("latency", "", "s", "poses were recorded too late (too early, where negative)",
                   {"", 0, -0.12, 0.12, 0.008}, ""),
      EffectKind::Measurement,
      [](const Strength& s, const Vector3<double>&, Changes& changes) { changes.pose_delay = s[0]; }));
  for (std::size_t body = 0; body < bodies.size(); ++body) {
    Effect offset = plain_effect("body_pose", "", "m", "a body is not where its poses say", {"x", 0, -0.02, 0.02, 2e-3},
                                 "pose.translation += Eigen::Vector3d(@, @, @);");
    offset.components.push_back({"y", 0, -0.02, 0.02, 2e-3});
    offset.components.push_back({"z", 0, -0.02, 0.02, 2e-3});
    offset.where = bodies[body];
    effects.push_back(run_effect<Model>(offset, EffectKind::Measurement,
                                        [body](const Strength& s, const Vector3<double>&, Changes& changes) {
                                          changes.body_offset.at(body) = s.head<3>();
                                        }));
  }
  Effect shift =
      plain_effect("camera_shift", "", "px", "the camera has moved, which shifts its picture", {"u", 0, -4, 4, 1}, "");
  shift.components.push_back({"v", 0, -4, 4, 1});
  effects.push_back(run_effect<Model>(
      shift, EffectKind::Nuisance,
      [](const Strength& s, const Vector3<double>&, Changes& changes) { changes.camera_shift = s.head<2>(); }));
  effects.push_back(run_effect<Model>(
      plain_effect("camera_roll", "camera_shift", "rad", "the camera has turned about its axis",
                   {"", 0, -0.02, 0.02, 0.005}, ""),
      EffectKind::Nuisance,
      [](const Strength& s, const Vector3<double>&, Changes& changes) { changes.camera_roll = s[0]; }));
  effects.push_back(run_effect<Model>(
      plain_effect("mask_bias", "", "px", "masks are fatter than the liquid (thinner, where negative)",
                   {"", 0, -2, 2, 0.7}, ""),
      EffectKind::Nuisance,
      [](const Strength& s, const Vector3<double>&, Changes& changes) { changes.mask_growth = s[0]; }));
  return effects;
}

}  // namespace decant::inline DECANT_TARGET
