// SPDX-License-Identifier: MIT
#pragma once

/// Sets a Scene up in a simulator of the caller's choice: bodies, liquid and the solver's settings.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include <decant/boundary/body_shape.hpp>
#include <decant/boundary/cavity.hpp>
#include <decant/boundary/mesh_repair.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/fluid_state.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/types.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/mesh_file.hpp>
#include <decant/io/scene.hpp>
#include <decant/simulation/fill.hpp>
#include <decant/simulation/simulator.hpp>

namespace example {

/// A simulator as its scene begins.
template <class Parts>
struct SceneSetUp {
  decant::Simulator<Parts> simulator;
  std::vector<std::string> notes{};     ///< about fillings, one line each
  std::vector<std::string> warnings{};  ///< about meshes, one line each
};

namespace detail {

inline decant::Face face_of(decant::scene::Face face) { return static_cast<decant::Face>(face); }

inline std::optional<decant::Face> face_of(const std::optional<decant::scene::Face>& face) {
  return face ? std::optional<decant::Face>(face_of(*face)) : std::nullopt;
}

/// The shape of a body in the library's terms; meshes are read and mended. Throws std::runtime_error or
/// std::invalid_argument with one line about what is wrong with it.
inline decant::BodyShape shape_of(const decant::scene::Body& body, double spacing) {
  using namespace decant;
  if (const auto* box = std::get_if<scene::Box>(&body.shape)) {
    return BodyShape(Box{box->min, box->max});
  }
  if (const auto* sphere = std::get_if<scene::Sphere>(&body.shape)) {
    return BodyShape(Sphere{sphere->center, sphere->radius});
  }
  if (const auto* cylinder = std::get_if<scene::Cylinder>(&body.shape)) {
    return BodyShape(Cylinder{cylinder->radius, cylinder->height});
  }
  if (const auto* room = std::get_if<scene::BoxInside>(&body.shape)) {
    return BodyShape(BoxInside{room->inner.min, room->inner.max, room->wall, face_of(room->open)});
  }
  if (const auto* vessel = std::get_if<scene::CylinderInside>(&body.shape)) {
    return BodyShape(CylinderInside{vessel->radius, vessel->height, vessel->wall, face_of(vessel->open)});
  }
  const auto& file = std::get<scene::Mesh>(body.shape);
  RepairReport repair;
  return BodyShape(repaired(scaled(read_mesh(file.file), file.scale), spacing, repair));
}

/// Places for liquid that fills a box: whole spacings along each axis, stretched to touch both sides. A box that is no
/// whole number of spacings wide gets as many as fit, and its liquid sinks a little.
inline decant::PointArray<double> lattice(const decant::scene::Box& box, double spacing) {
  const decant::Vector3<double> size = box.max - box.min;
  const Eigen::Array3d count = (size.array() / spacing + 1e-6).floor();
  decant::expects(count.prod() <= decant::most_particles, "scene: number of particles in a box",
                  "at most 1e8 at this spacing", count.prod());
  decant::PointArray<double> places(3, static_cast<decant::Index>(count.prod()));
  const Eigen::Array3d width = size.array() / count.max(1.0);
  decant::Index n = 0;
  for (int z = 0; z < count[2]; ++z) {
    for (int y = 0; y < count[1]; ++y) {
      for (int x = 0; x < count[0]; ++x) {
        places.col(n++) = box.min.array() + (Eigen::Array3d(x, y, z) + 0.5) * width;
      }
    }
  }
  return places;
}

/// Which way is up.
inline decant::Vector3<double> up_of(const decant::Vector3<double>& gravity) {
  return gravity.norm() > 0 ? decant::Vector3<double>(-gravity.normalized())
                            : decant::Vector3<double>(decant::Vector3<double>::UnitZ());
}

/// Places for so much more (less, below 1) liquid than fills a box, on the same ground: whole layers, the highest of
/// which is not full.
inline decant::PointArray<double> lattice_of_more(decant::scene::Box box, double amount, double spacing,
                                                  const decant::Vector3<double>& up) {
  const auto wanted =
      static_cast<std::size_t>(std::llround(amount * static_cast<double>(lattice(box, spacing).cols())));
  decant::Index axis = 0;
  up.cwiseAbs().maxCoeff(&axis);
  const double height = box.max[axis] - box.min[axis];
  const double more = spacing * std::ceil(amount * height / spacing) - height;
  if (up[axis] > 0) {
    box.max[axis] += more;
  } else {
    box.min[axis] -= more;
  }
  const decant::PointArray<double> places = lattice(box, spacing);
  std::vector<decant::Index> order(static_cast<std::size_t>(places.cols()));
  std::iota(order.begin(), order.end(), decant::Index{0});
  std::stable_sort(order.begin(), order.end(), [&](decant::Index a, decant::Index b) {
    return std::llround(1e9 * places(axis, a) * up[axis]) < std::llround(1e9 * places(axis, b) * up[axis]);
  });
  order.resize(std::min(order.size(), wanted));
  return places(Eigen::all, order);
}

/// Puts a scene's bodies and liquid into a simulator, one after the other.
template <class Parts>
class SceneBuilder {
 public:
  using Scalar = typename Parts::Scalar;

  /// @param amount of liquid, over what the scene says. @param warn is told of meshes that are not as they should be.
  SceneBuilder(const decant::Scene& scene, const decant::SimulatorSettings& settings, double amount,
               const std::function<void(const std::string&)>& warn)
      : scene_(&scene), amount_(amount), made_{decant::Simulator<Parts>(settings)} {
    set_solver();
    for (const decant::scene::Body& body : scene.bodies) {
      add(body, warn);
    }
    for (const decant::scene::Fluid& fluid : scene.fluid) {
      std::visit([&](const auto& each) { add(each); }, fluid);
    }
  }

  SceneSetUp<Parts> made() && { return std::move(made_); }

 private:
  decant::Simulator<Parts>& simulator() { return made_.simulator; }
  double spacing() const { return made_.simulator.spacing(); }
  static decant::BodyId id(std::size_t body) { return static_cast<decant::BodyId>(body); }

  void set_solver() {
    auto& solver = simulator().pressure_solver();
    if constexpr (requires { solver.density_tolerance; }) {
      solver.density_tolerance =
          static_cast<Scalar>(scene_->solver.density_error.value_or(static_cast<double>(solver.density_tolerance)));
    }
    if constexpr (requires { solver.divergence_tolerance; }) {
      solver.divergence_tolerance = static_cast<Scalar>(
          scene_->solver.divergence_error.value_or(static_cast<double>(solver.divergence_tolerance)));
    }
  }

  void add(const decant::scene::Body& body, const std::function<void(const std::string&)>& warn) {
    const auto slip = body.slip == decant::scene::Slip::None ? decant::Slip::None : decant::Slip::Free;
    const decant::BodyId added = simulator().add_body(body.name, shape_of(body, spacing()), body.motion, slip);
    if (std::holds_alternative<decant::scene::Mesh>(body.shape)) {
      for (const std::string& warning : simulator().mesh_report(added).warnings) {
        made_.warnings.push_back("body '" + body.name + "': " + warning);
        warn(made_.warnings.back());
      }
    }
  }

  void add(const decant::scene::Box& box) {
    const decant::PointArray<double> places =
        amount_ == 1 ? lattice(box, spacing()) : lattice_of_more(box, amount_, spacing(), up_of(scene_->gravity));
    std::vector<decant::Vector3<double>> kept;
    for (decant::Index k = 0; k < places.cols(); ++k) {
      const decant::Vector3<double> x = places.col(k);
      if (!in_solid(x)) {
        kept.push_back(x);
      }
    }
    decant::PointArray<Scalar> position(3, static_cast<decant::Index>(kept.size()));
    for (std::size_t k = 0; k < kept.size(); ++k) {
      position.col(static_cast<decant::Index>(k)) = kept[k].template cast<Scalar>();
    }
    simulator().add_particles(position, decant::PointArray<Scalar>::Zero(3, position.cols()), origin_++);
  }

  // Inside of a solid, or nearer to a wall than a particle at rest would be.
  bool in_solid(const decant::Vector3<double>& x) {
    for (std::size_t b = 0; b < simulator().bodies().size(); ++b) {
      const auto& body = simulator().bodies()[id(b)];
      const decant::Vector3<double> x_in_body = body.motion.at(simulator().time()).inverse() * x;
      for (const decant::SolidPart& part : body.shape->parts) {
        if (std::visit([&](const auto& solid) { return solid.closest(x_in_body).distance; }, part) < 0.3 * spacing()) {
          return true;
        }
      }
    }
    return false;
  }

  void add(const decant::scene::Fill& fill) {
    using Amount = decant::scene::Fill::Amount;
    using decant::detail::fixed_text;
    decant::FillAmount amount = fill.amount == Amount::Fraction ? decant::FillAmount::fraction(fill.value)
                                : fill.amount == Amount::Volume ? decant::FillAmount::volume(fill.value)
                                                                : decant::FillAmount::level(fill.value);
    if (amount_ != 1) {
      const decant::Cavity cavity = cavity_of(fill.body);
      const double volume = fill.amount == Amount::Fraction ? fill.value * cavity.volume()
                            : fill.amount == Amount::Volume ? fill.value
                                                            : cavity.volume_below(cavity.bottom_height() + fill.value);
      amount = decant::FillAmount::volume(std::min(amount_ * volume, cavity.volume()));
    }
    const decant::FillReport report = decant::fill(simulator(), id(fill.body), amount);
    made_.notes.push_back("body '" + scene_->bodies[fill.body].name + "' holds " + fixed_text(1e6 * report.volume, 1) +
                          " of " + fixed_text(1e6 * report.capacity, 1) + " ml, " + fixed_text(1e3 * report.level, 1) +
                          " mm deep");
  }

  // Of a container as it stands.
  decant::Cavity cavity_of(std::size_t body) {
    const auto& of = simulator().bodies()[id(body)];
    return decant::Cavity(of.surface, of.motion.at(simulator().time()).rotation.conjugate() * up_of(scene_->gravity));
  }

  void add(const decant::scene::Inlet& inlet) {
    decant::InletSettings settings;
    settings.position = inlet.position;
    settings.direction = inlet.direction;
    settings.radius = inlet.radius;
    for (const auto& flow : inlet.flow) {
      settings.flow.emplace_back(flow.time, flow.rate);
    }
    simulator().add_inlet(settings, origin_++);
  }

  const decant::Scene* scene_;
  double amount_;
  SceneSetUp<Parts> made_;
  decant::Origin origin_ = 1000;  // liquid of boxes and inlets; what was filled into body b has origin b
};

}  // namespace detail

/// What a simulator of the scene is set to: with the scene's spacing, liquid and gravity, and the library's choice
/// where the scene makes none.
inline decant::SimulatorSettings simulator_settings(const decant::Scene& scene) {
  decant::SimulatorSettings settings;
  settings.spacing = scene.spacing;
  settings.liquid = {scene.liquid.density, scene.liquid.viscosity, scene.liquid.surface_tension};
  settings.gravity = scene.gravity;
  settings.largest_step = scene.solver.max_step.value_or(settings.largest_step);
  settings.courant_number = scene.solver.cfl.value_or(settings.courant_number);
  settings.fixed_step = scene.solver.step.value_or(settings.fixed_step);
  return settings;
}

/// Sets a scene up. @param settings simulator_settings, or others. @param amount of liquid, over what the scene says;
/// boxes get higher, and a container holds no more than there is room for. @param warn is told at once of meshes that
/// are not as they should be, as filling may fail because of it. Throws std::invalid_argument or std::runtime_error,
/// one line, if the scene cannot be set up.
template <class Parts>
SceneSetUp<Parts> set_up_scene(
    const decant::Scene& scene, const decant::SimulatorSettings& settings, double amount = 1,
    const std::function<void(const std::string&)>& warn = [](const std::string&) {}) {
  return detail::SceneBuilder<Parts>(scene, settings, amount, warn).made();
}

}  // namespace example
