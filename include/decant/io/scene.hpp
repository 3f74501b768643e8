// SPDX-License-Identifier: MIT
#pragma once

/// Reads scene files, version 1: bodies, liquid, solver settings and gauges of one open-loop simulation in JSON.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <decant/core/fluid_state.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/io/detail/json.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/motion_file.hpp>

namespace decant::inline DECANT_TARGET {

/// What a scene is made of.
namespace scene {

/// Which ready-made simulator runs the scene.
enum class Composition { Default, StateEquation, PositionBased, Paper };
/// The face of a container that is missing.
enum class Face { NegativeX, PositiveX, NegativeY, PositiveY, NegativeZ, PositiveZ };
enum class Slip { Free, None };

struct Box {
  Vector3<double> min = Vector3<double>::Zero();  ///< [m]
  Vector3<double> max = Vector3<double>::Zero();  ///< [m]
};
struct Sphere {
  Vector3<double> center = Vector3<double>::Zero();  ///< [m]
  double radius = 0;                                 ///< [m]
};
/// Solid; origin in the centre of its lower face, axis +z.
struct Cylinder {
  double radius = 0;  ///< [m]
  double height = 0;  ///< [m]
};
/// A container of a box's inner size.
struct BoxInside {
  Box inner;
  double wall = 0.002;  ///< [m]
  std::optional<Face> open;
};
/// A container; origin in the centre of the floor's inner face, axis +z.
struct CylinderInside {
  double radius = 0;    ///< inner [m]
  double height = 0;    ///< inner [m]
  double wall = 0.002;  ///< [m]
  std::optional<Face> open;
};
struct Mesh {
  std::filesystem::path file;
  double scale = 1;  ///< multiplies the file's coordinates
};
using Shape = std::variant<Box, Sphere, Cylinder, BoxInside, CylinderInside, Mesh>;

struct Body {
  std::string name;
  Shape shape;
  PoseTrack motion;     ///< of one sample where the body stands still, empty where its frame is the world's
  bool moving = false;  ///< the file gave a motion
  Slip slip = Slip::Free;

  bool container() const {
    return std::holds_alternative<BoxInside>(shape) || std::holds_alternative<CylinderInside>(shape) ||
           std::holds_alternative<Mesh>(shape);
  }
};

struct Fill {
  enum class Amount { Fraction, Volume, Level };
  std::size_t body = 0;
  Amount amount = Amount::Fraction;
  double value = 0;  ///< of the volume below the rim [-], [m^3], or above the cavity's lowest point [m]
};
struct Inlet {
  struct Flow {
    double time = 0;  ///< [s]
    double rate = 0;  ///< [m^3/s]
  };
  Vector3<double> position = Vector3<double>::Zero();     ///< [m]
  Vector3<double> direction = -Vector3<double>::UnitZ();  ///< unit length
  double radius = 0;                                      ///< [m]
  std::vector<Flow> flow;  ///< linear between its rows (at least two), zero before the first and after the last
};
using Fluid = std::variant<Box, Fill, Inlet>;

struct LevelGauge {
  double x = 0, y = 0;  ///< [m]
};
struct FrontGauge {};
struct PressureGauge {
  Vector3<double> point = Vector3<double>::Zero();  ///< [m]
};
struct VolumeGauge {
  std::size_t body = 0;
};
struct ForceGauge {
  std::size_t body = 0;
};
struct TopGauge {
  std::size_t body = 0;
};
struct Gauge {
  std::string name;  ///< as written, the column's name
  std::variant<LevelGauge, FrontGauge, PressureGauge, VolumeGauge, ForceGauge, TopGauge> kind;
};

struct Liquid {
  double density = 998;             ///< [kg/m^3]
  double viscosity = 0.001;         ///< dynamic [Pa s]
  double surface_tension = 0.0728;  ///< [N/m]
};
/// What the file says; the composition's own defaults elsewhere.
struct Solver {
  std::optional<double> density_error;     ///< relative
  std::optional<double> divergence_error;  ///< relative
  std::optional<double> max_step;          ///< [s]
  std::optional<double> step;              ///< fixed [s]
  std::optional<double> cfl;               ///< spacings per step
};

}  // namespace scene

/// A scene as written in its file, in SI units; meshes are paths still, motions are read. Bodies are referred to by
/// their place in `bodies`.
struct Scene {
  std::string name;
  double spacing = 0;                    ///< [m]
  double end = 0;                        ///< [s]
  double record_rate = 100;              ///< [Hz]
  Vector3<double> gravity{0, 0, -9.81};  ///< [m/s^2]
  scene::Composition composition = scene::Composition::Default;
  scene::Liquid liquid;
  scene::Solver solver;
  std::vector<scene::Body> bodies;
  std::vector<scene::Fluid> fluid;
  std::vector<scene::Gauge> gauges;
};

namespace detail {

/// Turns the JSON of one scene into a Scene; keeps what the parts refer to.
class SceneReader {
 public:
  SceneReader(const std::filesystem::path& folder) : folder_(folder) {}

  Scene read(const JsonNode& root) {
    root.expect_keys({"format", "version", "name", "spacing_m", "end_s", "record_hz", "gravity_m_s2", "composition",
                      "liquid", "solver", "bodies", "fluid", "gauges"});
    if (const JsonNode format = root.at("format"); format.value() != "decant-scene") {
      format.refuse("\"decant-scene\"");
    }
    if (const JsonNode version = root.at("version"); version.value() != 1) {
      version.refuse("1");
    }
    scene_.name = root.at("name").text();
    scene_.spacing = root.at("spacing_m").number(1e-6, 1e3, "a number from 1e-6 to 1000");
    scene_.end = root.at("end_s").number(0, 1e6, "a number from 0 to 1e6");
    if (const auto node = root.find("record_hz")) {
      scene_.record_rate = node->number(1e-3, 1e6, "a number from 0.001 to 1e6");
    }
    if (!(scene_.end * scene_.record_rate <= sample_limit)) {
      root.at("end_s").refuse("at most 1e7 samples long at record_hz");
    }
    if (const auto node = root.find("gravity_m_s2")) {
      scene_.gravity = node->vector(1e4, "three numbers of at most 1e4 in size");
    }
    if (const auto node = root.find("composition")) {
      scene_.composition = composition(*node);
    }
    if (const auto node = root.find("liquid")) {
      read_liquid(*node);
    }
    if (const auto node = root.find("solver")) {
      read_solver(*node);
    }
    if (const auto node = root.find("bodies")) {
      for (const JsonNode& entry : node->elements(part_limit)) {
        read_body(entry);
      }
    }
    if (const auto node = root.find("fluid")) {
      for (const JsonNode& entry : node->elements(part_limit)) {
        read_fluid(entry);
      }
    }
    if (const auto node = root.find("gauges")) {
      for (const JsonNode& entry : node->elements(part_limit)) {
        read_gauge(entry);
      }
    }
    return std::move(scene_);
  }

 private:
  // Bounds that no sensible scene reaches, so that a mistyped number ends in a message and not in swapping.
  static constexpr double sample_limit = 1e7;
  static constexpr double length_limit = 1e4;  // [m]
  static constexpr std::size_t part_limit = 1000;

  static constexpr std::string_view point_text = "three numbers [m] of at most 1e4 in size";

  static scene::Composition composition(const JsonNode& node) {
    const auto is = [&](const char* name) { return node.value() == name; };
    if (is("default")) {
      return scene::Composition::Default;
    }
    if (is("state_equation")) {
      return scene::Composition::StateEquation;
    }
    if (is("position_based")) {
      return scene::Composition::PositionBased;
    }
    if (is("paper")) {
      return scene::Composition::Paper;
    }
    node.refuse("\"default\", \"state_equation\", \"position_based\" or \"paper\"");
  }

  static double length(const JsonNode& node) {
    return node.number(1e-6, length_limit, "a number [m] from 1e-6 to 1e4");
  }

  void read_liquid(const JsonNode& node) {
    node.expect_keys({"density", "viscosity", "surface_tension"});
    if (const auto entry = node.find("density")) {
      scene_.liquid.density = entry->number(1e-3, 1e5, "a number [kg/m^3] from 0.001 to 1e5");
    }
    if (const auto entry = node.find("viscosity")) {
      scene_.liquid.viscosity = entry->number(0, 1e6, "a number [Pa s] from 0 to 1e6");
    }
    if (const auto entry = node.find("surface_tension")) {
      scene_.liquid.surface_tension = entry->number(0, 1e3, "a number [N/m] from 0 to 1000");
    }
  }

  void read_solver(const JsonNode& node) {
    node.expect_keys({"density_error", "divergence_error", "max_step_s", "step_s", "cfl"});
    const auto optional = [&](const char* key, double low, double high, std::string_view expected) {
      const auto entry = node.find(key);
      return entry ? std::optional<double>(entry->number(low, high, expected)) : std::nullopt;
    };
    scene::Solver& solver = scene_.solver;
    solver.density_error = optional("density_error", 1e-9, 1, "a relative error from 1e-9 to 1");
    solver.divergence_error = optional("divergence_error", 1e-9, 1, "a relative error from 1e-9 to 1");
    solver.max_step = optional("max_step_s", 1e-9, 1, "a number [s] from 1e-9 to 1");
    solver.step = optional("step_s", 1e-9, 1, "a number [s] from 1e-9 to 1");
    solver.cfl = optional("cfl", 1e-3, 10, "a number from 0.001 to 10");
  }

  static scene::Box box(const JsonNode& node) {
    const scene::Box box{node.at("min_m").vector(length_limit, point_text),
                         node.at("max_m").vector(length_limit, point_text)};
    if (!((box.max - box.min).array() > 0).all()) {
      node.at("max_m").refuse("greater than min_m in each of x, y, z");
    }
    return box;
  }

  static scene::Face face(const JsonNode& node) {
    constexpr const char* names[] = {"-x", "+x", "-y", "+y", "-z", "+z"};
    for (int k = 0; k < 6; ++k) {
      if (node.value() == names[k]) {
        return static_cast<scene::Face>(k);
      }
    }
    node.refuse("one of \"-x\", \"+x\", \"-y\", \"+y\", \"-z\", \"+z\"");
  }

  scene::Shape shape(const JsonNode& node) const {
    node.expect_keys({"box", "sphere", "cylinder", "box_inside", "cylinder_inside", "mesh", "open", "scale"});
    constexpr std::string_view one_of = "given as one of box, sphere, cylinder, box_inside, cylinder_inside, mesh";
    std::optional<JsonNode> kind;
    for (const char* name : {"box", "sphere", "cylinder", "box_inside", "cylinder_inside", "mesh"}) {
      if (auto found = node.find(name)) {
        if (kind) {
          node.refuse(one_of);
        }
        kind = std::move(found);
      }
    }
    if (!kind) {
      node.refuse(one_of);
    }
    const std::string name = kind->path().substr(kind->path().rfind('.') + 1);
    if (node.find("open") && name != "box_inside" && name != "cylinder_inside") {
      node.at("open").refuse("absent but with box_inside or cylinder_inside");
    }
    if (node.find("scale") && name != "mesh") {
      node.at("scale").refuse("absent but with mesh");
    }
    std::optional<scene::Face> open;
    if (const auto entry = node.find("open")) {
      open = face(*entry);
    }
    if (name == "box") {
      kind->expect_keys({"min_m", "max_m"});
      return box(*kind);
    }
    if (name == "sphere") {
      kind->expect_keys({"center_m", "radius_m"});
      scene::Sphere sphere;
      if (const auto center = kind->find("center_m")) {
        sphere.center = center->vector(length_limit, point_text);
      }
      sphere.radius = length(kind->at("radius_m"));
      return sphere;
    }
    if (name == "cylinder") {
      kind->expect_keys({"radius_m", "height_m"});
      return scene::Cylinder{length(kind->at("radius_m")), length(kind->at("height_m"))};
    }
    if (name == "mesh") {
      scene::Mesh mesh{kind->file_inside(folder_), 1};
      if (const auto scale = node.find("scale")) {
        mesh.scale = scale->number(1e-6, 1e6, "a number from 1e-6 to 1e6");
      }
      return mesh;
    }
    if (name == "box_inside") {
      kind->expect_keys({"min_m", "max_m", "wall_m"});
      scene::BoxInside container{box(*kind), 0.002, open};
      if (const auto wall = kind->find("wall_m")) {
        container.wall = length(*wall);
      }
      return container;
    }
    kind->expect_keys({"radius_m", "height_m", "wall_m"});
    scene::CylinderInside container{length(kind->at("radius_m")), length(kind->at("height_m")), 0.002, open};
    if (const auto wall = kind->find("wall_m")) {
      container.wall = length(*wall);
    }
    if (open && *open != scene::Face::NegativeZ && *open != scene::Face::PositiveZ) {
      node.at("open").refuse("\"+z\" or \"-z\" with cylinder_inside");
    }
    return container;
  }

  static Pose pose(const JsonNode& node) {
    node.expect_keys({"position_m", "quaternion_wxyz"});
    Pose pose;
    if (const auto position = node.find("position_m")) {
      pose.translation = position->vector(length_limit, point_text);
    }
    if (const auto quaternion = node.find("quaternion_wxyz")) {
      constexpr std::string_view expected = "four numbers w, x, y, z with a norm within 1e-3 of 1";
      if (!quaternion->value().is_array() || quaternion->value().size() != 4) {
        quaternion->refuse(expected);
      }
      double value[4];
      for (std::size_t k = 0; k < 4; ++k) {
        value[k] = quaternion->elements(4)[k].number(-2, 2, expected);
      }
      pose.rotation = Eigen::Quaterniond(value[0], value[1], value[2], value[3]);
      if (!(std::abs(pose.rotation.norm() - 1) < 1e-3)) {
        quaternion->refuse(expected);
      }
      pose.rotation.normalize();
    }
    return pose;
  }

  void read_body(const JsonNode& node) {
    node.expect_keys({"name", "shape", "pose", "motion", "slip"});
    scene::Body body;
    body.name = node.at("name").text();
    for (const scene::Body& other : scene_.bodies) {
      if (other.name == body.name) {
        node.at("name").refuse("a name that no other body has");
      }
    }
    body.shape = shape(node.at("shape"));
    const auto fixed = node.find("pose");
    const auto motion = node.find("motion");
    if (fixed && motion) {
      motion->refuse("absent where pose is given");
    }
    if (fixed) {
      body.motion = PoseTrack(pose(*fixed));
    }
    if (motion) {
      body.motion = read_motion(motion->file_inside(folder_));
      body.moving = true;
    }
    if (const auto slip = node.find("slip")) {
      if (slip->value() != "free" && slip->value() != "none") {
        slip->refuse("\"free\" or \"none\"");
      }
      body.slip = slip->value() == "free" ? scene::Slip::Free : scene::Slip::None;
    }
    scene_.bodies.push_back(std::move(body));
  }

  // The body of that name, or nothing.
  std::optional<std::size_t> find_body(std::string_view name) const {
    for (std::size_t k = 0; k < scene_.bodies.size(); ++k) {
      if (scene_.bodies[k].name == name) {
        return k;
      }
    }
    return std::nullopt;
  }

  void count_particles(const JsonNode& node, double volume) {
    particles_ += volume / (scene_.spacing * scene_.spacing * scene_.spacing);
    if (!(particles_ <= most_particles)) {
      node.refuse("liquid of at most 1e8 particles in all at this spacing_m");
    }
  }

  void read_fluid(const JsonNode& node) {
    node.expect_keys({"box", "fill", "inlet"});
    if (node.value().size() != 1) {
      node.refuse("an object with one of box, fill, inlet");
    }
    if (const auto entry = node.find("box")) {
      entry->expect_keys({"min_m", "max_m"});
      const scene::Box region = box(*entry);
      count_particles(*entry, (region.max - region.min).prod());
      scene_.fluid.push_back(region);
    } else if (const auto amount = node.find("fill")) {
      scene_.fluid.push_back(fill(*amount));
    } else {
      scene_.fluid.push_back(inlet(node.at("inlet")));
    }
  }

  scene::Fill fill(const JsonNode& node) {
    node.expect_keys({"body", "fraction", "volume_ml", "level_m"});
    const JsonNode name = node.at("body");
    const auto body = find_body(name.text());
    if (!body || !scene_.bodies[*body].container()) {
      name.refuse("the name of a container (box_inside, cylinder_inside or mesh) among bodies");
    }
    if (node.value().size() != 2) {
      node.refuse("a body and one of fraction, volume_ml, level_m");
    }
    scene::Fill fill;
    fill.body = *body;
    if (const auto fraction = node.find("fraction")) {
      fill.value = fraction->number(0, 1, "a number from 0 to 1");
    } else if (const auto volume = node.find("volume_ml")) {
      fill.amount = scene::Fill::Amount::Volume;
      fill.value = 1e-6 * volume->number(0, 1e12, "a number [ml] from 0 to 1e12");
      count_particles(*volume, fill.value);
    } else {
      fill.amount = scene::Fill::Amount::Level;
      fill.value = node.at("level_m").number(0, length_limit, "a number [m] from 0 to 1e4");
    }
    return fill;
  }

  scene::Inlet inlet(const JsonNode& node) {
    node.expect_keys({"position_m", "direction", "radius_m", "flow_ml_s"});
    scene::Inlet inlet;
    inlet.position = node.at("position_m").vector(length_limit, point_text);
    const JsonNode direction = node.at("direction");
    inlet.direction = direction.vector(1e6, "three numbers of at most 1e6 in size");
    if (!(inlet.direction.norm() > 1e-6)) {
      direction.refuse("longer than 1e-6");
    }
    inlet.direction.normalize();
    inlet.radius = length(node.at("radius_m"));
    const JsonNode table = node.at("flow_ml_s");
    constexpr std::string_view row_text = "a row [t_s, ml/s] with times that increase and 0 <= ml/s <= 1e9";
    double volume = 0;  // [m^3]
    for (const JsonNode& row : table.elements(100000)) {
      if (!row.value().is_array() || row.value().size() != 2) {
        row.refuse(row_text);
      }
      const std::vector<JsonNode> cells = row.elements(2);
      const scene::Inlet::Flow flow{cells[0].number(-1e6, 1e6, row_text), 1e-6 * cells[1].number(0, 1e9, row_text)};
      if (!inlet.flow.empty()) {
        const scene::Inlet::Flow& last = inlet.flow.back();
        if (!(flow.time > last.time)) {
          row.refuse(row_text);
        }
        volume += 0.5 * (flow.rate + last.rate) * (flow.time - last.time);
      }
      inlet.flow.push_back(flow);
    }
    if (inlet.flow.size() < 2) {
      table.refuse("at least two rows [t_s, ml/s]");
    }
    count_particles(table, volume);
    return inlet;
  }

  void read_gauge(const JsonNode& node) {
    constexpr std::string_view expected =
        "level_mm@x,y, front_mm, pressure_pa@x,y,z, volume_ml@body, force_n@body or top_mm@body";
    scene::Gauge gauge;
    gauge.name = node.text(1000);
    for (const scene::Gauge& other : scene_.gauges) {
      if (other.name == gauge.name) {
        node.refuse("a gauge that is not listed yet");
      }
    }
    const std::size_t at = gauge.name.find('@');
    const std::string_view kind = std::string_view(gauge.name).substr(0, at);
    const std::string_view place =
        at == std::string::npos ? std::string_view() : std::string_view(gauge.name).substr(at + 1);
    if (kind == "front_mm" && at == std::string::npos) {
      gauge.kind = scene::FrontGauge{};
    } else if (kind == "level_mm" || kind == "pressure_pa") {
      std::vector<double> numbers;
      for (const std::string_view cell : split(place, ',')) {
        const auto number = parse_number(cell);
        if (!number || !(std::abs(*number) <= length_limit)) {
          node.refuse(expected);
        }
        numbers.push_back(*number);
      }
      if (numbers.size() != (kind == "level_mm" ? 2U : 3U)) {
        node.refuse(expected);
      }
      if (kind == "level_mm") {
        gauge.kind = scene::LevelGauge{numbers[0], numbers[1]};
      } else {
        gauge.kind = scene::PressureGauge{{numbers[0], numbers[1], numbers[2]}};
      }
    } else if (kind == "volume_ml" || kind == "force_n" || kind == "top_mm") {
      const auto body = find_body(place);
      if (!body || (kind == "volume_ml" && !scene_.bodies[*body].container())) {
        node.refuse(kind == "volume_ml" ? "volume_ml@ and the name of a container among bodies"
                                        : std::string(kind) + "@ and the name of one of the bodies");
      }
      if (kind == "volume_ml") {
        gauge.kind = scene::VolumeGauge{*body};
      } else if (kind == "force_n") {
        gauge.kind = scene::ForceGauge{*body};
      } else {
        gauge.kind = scene::TopGauge{*body};
      }
    } else {
      node.refuse(expected);
    }
    scene_.gauges.push_back(std::move(gauge));
  }

  std::filesystem::path folder_;
  Scene scene_;
  double particles_ = 0;
};

}  // namespace detail

/// A scene from JSON text; `name` stands for the file in messages, paths are taken relative to `folder` and must stay
/// inside it. Motions are read; meshes are only looked up. Throws std::runtime_error with one line that names the key,
/// the value and what was expected.
inline Scene parse_scene(std::string_view text, const std::filesystem::path& folder, const std::string& name) {
  const nlohmann::json document = detail::parse_json(text, name);
  return detail::SceneReader(folder).read(detail::JsonNode(document, name));
}

/// parse_scene of a file of at most 16 MiB, with its folder. Throws std::runtime_error.
inline Scene read_scene(const std::filesystem::path& path) {
  return parse_scene(detail::read_text_file(path, std::uintmax_t{1} << 24), path.parent_path(), path.string());
}

}  // namespace decant::inline DECANT_TARGET
