// SPDX-License-Identifier: MIT
// The strict reader of scene files: what a good file means, and the message of each bad one.

#include <decant/io/scene.hpp>

#include <string>
#include <vector>

#include "catch.hpp"
#include "temporary_folder.hpp"

namespace {

constexpr const char* example = R"({
  "format": "decant-scene", "version": 1,
  "name": "dam_break_obstacle", "spacing_m": 0.02, "end_s": 3.0, "record_hz": 50,
  "gravity_m_s2": [0, -1, -9.5],
  "composition": "state_equation",
  "liquid": {"density": 900.0, "viscosity": 0.002, "surface_tension": 0.05},
  "solver": {"density_error": 0.002, "divergence_error": 0.003, "max_step_s": 0.004, "cfl": 0.3, "step_s": 0.001},
  "bodies": [
    {"name": "tank", "shape": {"box_inside": {"min_m": [0, 0, 0], "max_m": [3.2, 1, 1]}, "open": "+z"}},
    {"name": "obstacle", "shape": {"box": {"min_m": [0.7, 0.3, 0], "max_m": [0.9, 0.7, 0.16]}}, "slip": "none"},
    {"name": "glass", "shape": {"cylinder_inside": {"radius_m": 0.049, "height_m": 0.15, "wall_m": 0.003},
                                "open": "+z"}, "motion": "poses.csv"},
    {"name": "cup", "shape": {"mesh": "meshes/cup.stl", "scale": 0.001},
     "pose": {"position_m": [0, 0, 0.1], "quaternion_wxyz": [0, 0, 1, 0]}},
    {"name": "ball", "shape": {"sphere": {"center_m": [1, 2, 3], "radius_m": 0.1}}},
    {"name": "post", "shape": {"cylinder": {"radius_m": 0.1, "height_m": 0.2}}}
  ],
  "fluid": [
    {"box": {"min_m": [2.0, 0, 0], "max_m": [3.2, 1, 0.5]}},
    {"fill": {"body": "cup", "fraction": 0.6}},
    {"fill": {"body": "glass", "volume_ml": 250}},
    {"fill": {"body": "tank", "level_m": 0.25}},
    {"inlet": {"position_m": [0, 0, 1], "direction": [0, 0, -2], "radius_m": 0.01, "flow_ml_s": [[0, 50], [2, 60]]}}
  ],
  "gauges": ["level_mm@2.66,0.5", "pressure_pa@0.9,0.5,-2e-2", "front_mm", "volume_ml@cup", "force_n@tank",
             "top_mm@glass"]
})";

// The example with the first occurrence of one piece of text replaced.
std::string changed(const std::string& from, const std::string& to) {
  std::string text = example;
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

struct SceneFolder : decant_test::TemporaryFolder {
  explicit SceneFolder(const std::string& name) : TemporaryFolder(name) {
    write("scene/poses.csv", "t_s,x_m,y_m,z_m,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n1.5,0.1,0,0,1,0,0,0\n");
    write("scene/meshes/cup.stl", "");
    write("outside.stl", "");
  }
  decant::Scene parse(const std::string& text) const { return decant::parse_scene(text, path() / "scene", "s.json"); }
};

}  // namespace

TEST_CASE("scene: every key of the format arrives in SI units") {
  using namespace decant;
  const SceneFolder folder("scene_good");
  const Scene scene = folder.parse(example);
  CHECK(scene.name == "dam_break_obstacle");
  CHECK(scene.spacing == 0.02);
  CHECK(scene.end == 3.0);
  CHECK(scene.record_rate == 50);
  CHECK(scene.gravity == Vector3<double>(0, -1, -9.5));
  CHECK(scene.composition == scene::Composition::StateEquation);
  CHECK(scene.liquid.density == 900);
  CHECK(scene.liquid.viscosity == 0.002);
  CHECK(scene.liquid.surface_tension == 0.05);
  CHECK(scene.solver.density_error == 0.002);
  CHECK(scene.solver.divergence_error == 0.003);
  CHECK(scene.solver.max_step == 0.004);
  CHECK(scene.solver.cfl == 0.3);
  CHECK(scene.solver.step == 0.001);

  REQUIRE(scene.bodies.size() == 6);
  const auto& tank = std::get<scene::BoxInside>(scene.bodies[0].shape);
  CHECK(tank.inner.max == Vector3<double>(3.2, 1, 1));
  CHECK(tank.wall == 0.002);
  CHECK(tank.open == scene::Face::PositiveZ);
  CHECK(scene.bodies[0].slip == scene::Slip::Free);
  CHECK(scene.bodies[0].motion.samples().empty());
  CHECK(std::get<scene::Box>(scene.bodies[1].shape).min == Vector3<double>(0.7, 0.3, 0));
  CHECK(scene.bodies[1].slip == scene::Slip::None);
  CHECK_FALSE(scene.bodies[1].container());
  const auto& glass = std::get<scene::CylinderInside>(scene.bodies[2].shape);
  CHECK(glass.radius == 0.049);
  CHECK(glass.height == 0.15);
  CHECK(glass.wall == 0.003);
  CHECK(scene.bodies[2].moving);
  CHECK(scene.bodies[2].motion.end_time() == 1.5);
  CHECK(scene.bodies[2].motion.at(0.75).translation.x() == Approx(0.05));
  const auto& cup = std::get<scene::Mesh>(scene.bodies[3].shape);
  CHECK(cup.file.filename() == "cup.stl");
  CHECK(cup.scale == 0.001);
  CHECK(scene.bodies[3].container());
  CHECK(scene.bodies[3].motion.at(7).translation.z() == 0.1);
  CHECK(scene.bodies[3].motion.at(7).rotation.y() == 1);
  CHECK(std::get<scene::Sphere>(scene.bodies[4].shape).center == Vector3<double>(1, 2, 3));
  CHECK(std::get<scene::Cylinder>(scene.bodies[5].shape).height == 0.2);

  REQUIRE(scene.fluid.size() == 5);
  CHECK(std::get<scene::Box>(scene.fluid[0]).max == Vector3<double>(3.2, 1, 0.5));
  const auto fill = [&](std::size_t k) { return std::get<scene::Fill>(scene.fluid[k]); };
  CHECK(fill(1).body == 3);
  CHECK(fill(1).amount == scene::Fill::Amount::Fraction);
  CHECK(fill(1).value == 0.6);
  CHECK(fill(2).amount == scene::Fill::Amount::Volume);
  CHECK(fill(2).value == Approx(250e-6));
  CHECK(fill(3).amount == scene::Fill::Amount::Level);
  CHECK(fill(3).value == 0.25);
  const auto& inlet = std::get<scene::Inlet>(scene.fluid[4]);
  CHECK(inlet.direction == Vector3<double>(0, 0, -1));
  CHECK(inlet.flow.at(1).time == 2);
  CHECK(inlet.flow.at(1).rate == Approx(60e-6));

  REQUIRE(scene.gauges.size() == 6);
  CHECK(scene.gauges[0].name == "level_mm@2.66,0.5");
  CHECK(std::get<scene::LevelGauge>(scene.gauges[0].kind).x == 2.66);
  CHECK(std::get<scene::PressureGauge>(scene.gauges[1].kind).point == Vector3<double>(0.9, 0.5, -0.02));
  CHECK(std::holds_alternative<scene::FrontGauge>(scene.gauges[2].kind));
  CHECK(std::get<scene::VolumeGauge>(scene.gauges[3].kind).body == 3);
  CHECK(std::get<scene::ForceGauge>(scene.gauges[4].kind).body == 0);
  CHECK(std::get<scene::TopGauge>(scene.gauges[5].kind).body == 2);
}

TEST_CASE("scene: what may be left out") {
  const SceneFolder folder("scene_short");
  const auto scene =
      folder.parse(R"({"format": "decant-scene", "version": 1, "name": "a", "spacing_m": 0.01, "end_s": 1})");
  CHECK(scene.gravity == decant::Vector3<double>(0, 0, -9.81));
  CHECK(scene.composition == decant::scene::Composition::Default);
  CHECK_FALSE(scene.solver.density_error.has_value());
  CHECK(scene.bodies.empty());
  const auto path = folder.write("scene/s.json", example);
  CHECK(decant::read_scene(path).bodies.size() == 6);
  CHECK(decant_test::message_of([&] { decant::read_scene(folder.path() / "no.json"); }).find("no.json: no such file") !=
        std::string::npos);
}

TEST_CASE("scene: a bad file is refused with one line that names key and value and what was expected") {
  const SceneFolder folder("scene_bad");
  struct Case {
    const char* from;
    const char* to;
    const char* message;
  };
  const std::vector<Case> cases = {
      {"\"decant-scene\"", "\"decant-recording\"", "format must be \"decant-scene\", got \"decant-recording\""},
      {"\"version\": 1", "\"version\": 2", "version must be 1, got 2"},
      {"\"name\": \"dam_break_obstacle\", ", "", "name is missing"},
      {"\"dam_break_obstacle\"", "\"a\\nb\"", "name must be a string of 1 to 200 characters"},
      {"\"dam_break_obstacle\"", "7", "name must be a string, got 7"},
      {"\"spacing_m\": 0.02, ", "", "spacing_m is missing"},
      {"0.02", "-0.02", "spacing_m must be a number from 1e-6 to 1000, got -0.02"},
      {"0.02", "\"0.02\"", "spacing_m must be a number from 1e-6 to 1000, got \"0.02\""},
      {"0.02", "1e999", "must be JSON"},
      {"0.02", "NaN", "must be JSON"},
      {"\"end_s\": 3.0", "\"end_s\": -1", "end_s must be a number from 0 to 1e6, got -1"},
      {"\"end_s\": 3.0", "\"end_s\": 300000", "end_s must be at most 1e7 samples long at record_hz"},
      {"\"record_hz\": 50", "\"record_hz\": 0", "record_hz must be"},
      {"\"record_hz\": 50", "\"record_rate\": 50", "a key must be one of format, version"},
      {"[0, -1, -9.5]", "[0, -1]", "gravity_m_s2 must be three numbers"},
      {"[0, -1, -9.5]", "[0, null, -9.5]", "gravity_m_s2[1] must be three numbers"},
      {"\"state_equation\"", "\"magic\"", "composition must be \"default\""},
      {"\"density\": 900.0", "\"density\": 0", "liquid.density must be"},
      {"\"viscosity\": 0.002", "\"viscosity\": -1", "liquid.viscosity must be"},
      {"\"surface_tension\": 0.05", "\"surface_tension\": 1e4", "liquid.surface_tension must be"},
      {"\"density\": 900.0", "\"dense\": 900.0", "liquid: a key must be one of density"},
      {"{\"density\": 900.0, \"viscosity\": 0.002, \"surface_tension\": 0.05}", "3", "liquid must be an object, got 3"},
      {"\"density_error\": 0.002", "\"density_error\": 0", "solver.density_error must be"},
      {"\"divergence_error\": 0.003", "\"divergence_error\": 2", "solver.divergence_error must be"},
      {"\"max_step_s\": 0.004", "\"max_step_s\": 0", "solver.max_step_s must be"},
      {"\"cfl\": 0.3", "\"cfl\": 0", "solver.cfl must be"},
      {"\"step_s\": 0.001", "\"step_s\": -1", "solver.step_s must be"},
      {"\"bodies\": [", "\"bodies\": 1, \"x\": [", "a key must be one of"},
      {"\"obstacle\"", "\"tank\"", "bodies[1].name must be a name that no other body has, got \"tank\""},
      {"\"name\": \"tank\", ", "", "bodies[0].name is missing"},
      {"\"box_inside\"", "\"box_outside\"", "bodies[0].shape: a key must be one of box, sphere"},
      {"{\"box_inside\": {\"min_m\": [0, 0, 0], \"max_m\": [3.2, 1, 1]}, \"open\": \"+z\"}", "{}",
       "bodies[0].shape must be given as one of box"},
      {"\"scale\": 0.001", "\"sphere\": {\"radius_m\": 1}", "bodies[3].shape must be given as one of box"},
      {"[3.2, 1, 1]", "[3.2, 0, 1]", "bodies[0].shape.box_inside.max_m must be greater than min_m"},
      {"[3.2, 1, 1]", "[3.2, 1, 1e9]", "max_m[2] must be three numbers [m] of at most 1e4"},
      {"\"open\": \"+z\"}}", "\"open\": \"up\"}}", "bodies[0].shape.open must be one of"},
      {"\"open\": \"+z\"}, \"motion\"", "\"open\": \"+x\"}, \"motion\"",
       "bodies[2].shape.open must be \"+z\" or \"-z\" with cylinder_inside"},
      {"0.16]}}", "0.16]}, \"open\": \"+z\"}", "bodies[1].shape.open must be absent"},
      {"0.16]}}", "0.16]}, \"scale\": 2}", "bodies[1].shape.scale must be absent"},
      {"\"radius_m\": 0.049", "\"radius_m\": 0", "bodies[2].shape.cylinder_inside.radius_m must be"},
      {"\"height_m\": 0.15, ", "", "bodies[2].shape.cylinder_inside.height_m is missing"},
      {"\"wall_m\": 0.003", "\"wall_m\": -1", "bodies[2].shape.cylinder_inside.wall_m must be"},
      {"\"scale\": 0.001", "\"scale\": 0", "bodies[3].shape.scale must be"},
      {"meshes/cup.stl", "meshes/no.stl", "bodies[3].shape.mesh must be an existing file, got \"meshes/no.stl\""},
      {"meshes/cup.stl", "../outside.stl", "bodies[3].shape.mesh must be a path that stays inside"},
      {"meshes/cup.stl", "/etc/passwd", "bodies[3].shape.mesh must be a path that stays inside"},
      {"\"poses.csv\"", "\"none.csv\"", "bodies[2].motion must be an existing file"},
      {"\"motion\": \"poses.csv\"", "\"motion\": \"poses.csv\", \"pose\": {}",
       "bodies[2].motion must be absent where pose is given"},
      {"[0, 0, 1, 0]", "[0, 0, 1, 1]", "bodies[3].pose.quaternion_wxyz must be four numbers"},
      {"[0, 0, 1, 0]", "[0, 0, 1]", "bodies[3].pose.quaternion_wxyz must be four numbers"},
      {"[0, 0, 0.1]", "[0, 0, \"x\"]", "bodies[3].pose.position_m[2] must be three numbers"},
      {"\"slip\": \"none\"", "\"slip\": \"some\"", "bodies[1].slip must be \"free\" or \"none\""},
      {"{\"box\": {\"min_m\": [2.0, 0, 0], \"max_m\": [3.2, 1, 0.5]}}", "{}", "fluid[0] must be an object with one of"},
      {"{\"box\": {\"min_m\": [2.0, 0, 0], \"max_m\": [3.2, 1, 0.5]}}", "[1]", "fluid[0] must be an object"},
      {"[3.2, 1, 0.5]", "[3.2, 1000, 1000]", "fluid[0].box must be liquid of at most 1e8 particles"},
      {"\"fraction\": 0.6", "\"fraction\": 60", "fluid[1].fill.fraction must be a number from 0 to 1, got 60"},
      {"\"fraction\": 0.6", "\"fraction\": 0.6, \"level_m\": 1", "fluid[1].fill must be a body and one of"},
      {"\"volume_ml\": 250", "\"volume_ml\": -1", "fluid[2].fill.volume_ml must be"},
      {"\"volume_ml\": 250", "\"volume_ml\": 1e12", "fluid[2].fill.volume_ml must be liquid of at most 1e8"},
      {"\"level_m\": 0.25", "\"level_m\": -1", "fluid[3].fill.level_m must be"},
      {"{\"body\": \"cup\"", "{\"body\": \"mug\"", "fluid[1].fill.body must be the name of a container"},
      {"{\"body\": \"cup\"", "{\"body\": \"obstacle\"", "fluid[1].fill.body must be the name of a container"},
      {"[0, 0, -2]", "[0, 0, 0]", "fluid[4].inlet.direction must be longer than 1e-6"},
      {"\"radius_m\": 0.01", "\"radius_m\": -0.01", "fluid[4].inlet.radius_m must be"},
      {"[[0, 50], [2, 60]]", "[[0, 50]]", "fluid[4].inlet.flow_ml_s must be at least two rows"},
      {"[[0, 50], [2, 60]]", "[[0, 50], [0, 60]]", "fluid[4].inlet.flow_ml_s[1] must be a row"},
      {"[[0, 50], [2, 60]]", "[[0, 50], [1, -6]]", "fluid[4].inlet.flow_ml_s[1][1] must be a row"},
      {"[[0, 50], [2, 60]]", "[[0, 50], [1]]", "fluid[4].inlet.flow_ml_s[1] must be a row"},
      {"[[0, 50], [2, 60]]", "[[0, 5e8], [1e6, 5e8]]", "fluid[4].inlet.flow_ml_s must be liquid of at most 1e8"},
      {"level_mm@2.66,0.5", "level_mm@2.66", "gauges[0] must be level_mm@x,y"},
      {"level_mm@2.66,0.5", "level_mm@2.66,nan", "gauges[0] must be level_mm@x,y"},
      {"level_mm@2.66,0.5", "front_mm@2", "gauges[0] must be level_mm@x,y"},
      {"-2e-2", "-2e-2,1", "gauges[1] must be"},
      {"\"volume_ml@cup\"", "\"volume_ml@ball\"", "gauges[3] must be volume_ml@ and the name of a container"},
      {"\"force_n@tank\"", "\"force_n@tanks\"", "gauges[4] must be force_n@ and the name of one of the bodies"},
      {"\"top_mm@glass\"", "\"top_mm\"", "gauges[5] must be top_mm@ and the name of one of the bodies"},
      {"\"top_mm@glass\"", "\"front_mm\"", "gauges[5] must be a gauge that is not listed yet"},
      {"\"top_mm@glass\"", "[]", "gauges[5] must be a string"},
      {"\"version\": 1,", "\"version\": 1, \"version\": 1,", "key \"version\" must be given once"},
      {"\"version\": 1,", "\"version\": [[[[[[[[[[[[[[[[[1]]]]]]]]]]]]]]]]],",
       "nesting must be at most 16 levels deep"},
      {"\"version\": 1,", "\"vers", "must be JSON"},
  };
  for (const Case& c : cases) {
    const std::string text = changed(c.from, c.to);
    const std::string message = decant_test::message_of([&] { folder.parse(text); });
    INFO("change " << c.from << " to " << c.to << "\ngot " << message);
    CHECK(message.find(c.message) != std::string::npos);
    CHECK(message.find("s.json") != std::string::npos);
    CHECK(message.find('\n') == std::string::npos);
  }
}

TEST_CASE("scene: hostile documents end in a message") {
  const SceneFolder folder("scene_hostile");
  const auto message = [&](const std::string& text) { return decant_test::message_of([&] { folder.parse(text); }); };
  CHECK(message("").find("must be JSON") != std::string::npos);
  CHECK(message("[]").find("must be an object") != std::string::npos);
  CHECK(message(std::string(1000000, '[')).find("nesting") != std::string::npos);
  CHECK(message(std::string(1000000, '{')).find("must be JSON") != std::string::npos);
  CHECK(message("{\"\x01\xff\": 1}").find("must be JSON") != std::string::npos);
  CHECK(message("{\"a\\nb\\u0000\": 1}").find("got \"a\\x0ab\\x00\"") != std::string::npos);
  std::error_code error;  // a link that leads out of the folder
  std::filesystem::create_symlink(folder.path() / "outside.stl", folder.path() / "scene/link.stl", error);
  REQUIRE_FALSE(error);
  CHECK(message(changed("meshes/cup.stl", "link.stl")).find("also behind links") != std::string::npos);
}
