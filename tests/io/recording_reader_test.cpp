// SPDX-License-Identifier: MIT
// The strict reader of recordings: what a good one means in SI units and in the world's frame, and the one line with
// which each bad one is refused.

#include <decant/io/recording_reader.hpp>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "catch.hpp"
#include "recording_folder.hpp"

namespace {

using decant_test::message_of;
using decant_test::RecordingFolder;

std::string refusal(const RecordingFolder& folder) {
  return message_of([&] { decant::read_recording(folder.path()); });
}

struct Change {
  const char* from;
  const char* to;
  const char* message;
};

// Each change of one file alone is refused with one line that holds the file's name and the message.
void check_refusals(const std::string& name, const std::string& file, const std::vector<Change>& changes) {
  const RecordingFolder folder(name);
  const std::string good = decant::detail::read_text_file(folder.path() / file, 1 << 24);
  for (const Change& change : changes) {
    folder.change(file, change.from, change.to);
    const std::string message = refusal(folder);
    INFO("change " << change.from << " to " << change.to << "\ngot " << message);
    CHECK(message.find((folder.path() / file).string()) == 0);
    CHECK(message.find(change.message) != std::string::npos);
    CHECK(message.find('\n') == std::string::npos);
    folder.write(file, good);
  }
  CHECK(refusal(folder).empty());
}

}  // namespace

TEST_CASE("recording reader: everything arrives in SI units") {
  using namespace decant;
  const RecordingFolder folder("recording_good");
  const Recording recording = read_recording(folder.path());
  CHECK(recording.name == "pour_cup_60_a");
  CHECK(recording.frames_per_second == 20);
  CHECK(recording.frames == 4);
  CHECK(recording.width == 8);
  CHECK(recording.height == 6);
  CHECK(recording.gravity == Vector3<double>(0, 0.1, -9.7));
  CHECK(recording.timestamps == std::vector<double>{0.5, 0.55, 0.61, 0.7});

  REQUIRE(recording.bodies.size() == 2);
  CHECK(recording.bodies[0].object_id == 1);
  CHECK(recording.bodies[0].name == "cup");
  CHECK(recording.bodies[0].role == recording::Role::Source);
  CHECK(recording.bodies[0].mesh_file == "models/obj_000001.ply");
  CHECK(recording.bodies[0].mesh.triangles.size() == 4);
  CHECK(bounds(recording.bodies[0].mesh).max().isApprox(Vector3<double>::Constant(0.01)));
  CHECK(recording.bodies[1].object_id == 7);
  CHECK_FALSE(recording.bodies[1].role.has_value());
  CHECK(bounds(recording.bodies[1].mesh).max().isApprox(Vector3<double>::Constant(0.02)));
  CHECK(recording.find_body("pan") == 1);
  CHECK_FALSE(recording.find_body("mug").has_value());

  CHECK(recording.liquid.name == "oil");
  CHECK(recording.liquid.density == 920);
  CHECK(recording.liquid.viscosity == 0.05);
  CHECK(recording.liquid.surface_tension == 0.03);
  REQUIRE(recording.liquid.initial.has_value());
  CHECK(recording.liquid.initial->body == 0);
  CHECK(recording.liquid.initial->fill_fraction == 0.6);
  CHECK_FALSE(recording.liquid.initial->volume.has_value());
  CHECK(recording.liquid.initial->known());
  CHECK_FALSE(recording.liquid.inlet.has_value());

  REQUIRE(recording.thermal_imager.has_value());
  CHECK(recording.thermal_imager->width == 5);
  CHECK(recording.thermal_imager->height == 4);
  CHECK(recording.thermal_imager->threshold == 31200.5);
  CHECK(recording.thermal_imager->image_from_thermal(0, 2) == 0.25);
  CHECK(recording.thermal_imager->image_from_thermal(1, 0) == -0.01);
}

TEST_CASE("recording reader: a frame without a mask is labelled by its thermal image") {
  const RecordingFolder folder("recording_thermal_label");
  const decant::Recording recording = decant::read_recording(folder.path());
  CHECK((*recording.liquid_mask(0) == RecordingFolder::mask(0)).all());  // what is labelled already stays
  CHECK_FALSE(recording.liquid_mask(2).has_value());
  CHECK((*recording.liquid_mask(2, 1) == RecordingFolder::mask(2)).all());
  std::filesystem::remove(folder.path() / "mask_liquid/000000.png");
  // one warm pixel, at column 6.28 and row 4.66 of the image, and those to which it lends half of its warmth or more
  decant::Mask warm = decant::Mask::Zero(6, 8);
  warm(5, 6) = warm(5, 7) = warm(4, 7) = 255;
  CHECK((*recording.liquid_mask(0) == warm).all());
}

TEST_CASE("recording reader: cameras, fixed and moving") {
  using namespace decant;
  const RecordingFolder folder("recording_cameras");
  const Recording recording = read_recording(folder.path());
  REQUIRE(recording.cameras.size() == 2);
  CHECK(recording.cameras[0].fixed());
  const recording::View& view = recording.cameras[0].view(3);
  CHECK(view.fx == 600.5);
  CHECK(view.fy == 601.5);
  CHECK(view.cx == 3.5);
  CHECK(view.cy == 2.5);
  CHECK(view.distortion == std::array<double, 5>{0.1, -0.02, 0.003, 0.004, 0.005});
  CHECK(view.distorted());
  // a point 0.3 m above the table is 0.7 m away from the camera
  CHECK((view.camera_from_world * Vector3<double>(0.1, 0.2, 0.3)).isApprox(Vector3<double>(0.1, -0.2, 0.7)));

  CHECK_FALSE(recording.cameras[1].fixed());
  CHECK_FALSE(recording.cameras[1].view(0).distorted());
  CHECK(recording.cameras[1].view(2).camera_from_world.translation.isApprox(Vector3<double>(0.02, 0, 0.5)));
  CHECK((recording.cameras[1].view(0).camera_from_world * Vector3<double>(0, 0, 1))
            .isApprox(Vector3<double>(0, -1, 0.5)));
}

TEST_CASE("recording reader: bodies move in the world's frame, between frames too") {
  using namespace decant;
  const RecordingFolder folder("recording_motion");
  const Recording recording = read_recording(folder.path());
  const PoseTrack& cup = recording.bodies[0].motion;
  REQUIRE(cup.samples().size() == 2);
  CHECK(cup.samples()[0].time == 0.5);
  CHECK(cup.samples()[1].time == 0.7);
  CHECK(cup.at(0.5).translation.isApprox(Vector3<double>(0.1, 0.2, 0.3)));
  CHECK(cup.at(0.5).rotation.angularDistance(Eigen::Quaterniond::Identity()) < 1e-12);
  CHECK(cup.at(0.7).translation.isApprox(Vector3<double>(0.1, 0.2, 0.1)));
  // half the way in time: half of the quarter turn about the world's z
  CHECK(cup.at(0.6).translation.isApprox(Vector3<double>(0.1, 0.2, 0.2)));
  const Eigen::Quaterniond half(Eigen::AngleAxisd(-std::numbers::pi / 4, Vector3<double>::UnitZ()));
  const Eigen::Quaterniond other(Eigen::AngleAxisd(std::numbers::pi / 4, Vector3<double>::UnitZ()));
  CHECK(std::min(cup.at(0.6).rotation.angularDistance(half), cup.at(0.6).rotation.angularDistance(other)) < 1e-12);
  CHECK((cup.at(0.7) * Vector3<double>(1, 0, 0) - cup.at(0.7).translation).isApprox(Vector3<double>(0, 1, 0)));
  CHECK(recording.bodies[1].motion.at(9).translation.norm() < 1e-15);
}

TEST_CASE("recording reader: a moving camera does not move the bodies") {
  const RecordingFolder folder("recording_moving_camera");
  folder.write("scene_camera.json", RecordingFolder::second_camera());
  // at rest in the world: 10 mm a frame in the camera
  std::string text = "{";
  for (int frame = 0; frame < 4; ++frame) {
    for (const char* id : {"1", "7"}) {
      text += std::string(id[0] == '7' ? ", "
                          : frame > 0  ? "], \"" + std::to_string(frame) + "\": ["
                                       : "\"0\": [") +
              "{\"obj_id\": " + id + ", \"cam_R_m2c\": [1, 0, 0, 0, 0, -1, 0, 1, 0], \"cam_t_m2c\": [" +
              std::to_string(10 * frame + 5) + ", 7, 400]}";
    }
  }
  folder.write("scene_gt.json", text + "]}");
  const auto recording = decant::read_recording(folder.path());
  REQUIRE(recording.bodies[0].motion.samples().size() == 4);
  for (const auto& sample : recording.bodies[0].motion.samples()) {
    CHECK(sample.pose.translation.isApprox(decant::Vector3<double>(0.005, -0.1, -0.007)));
    CHECK(sample.pose.rotation.angularDistance(Eigen::Quaterniond::Identity()) < 1e-12);
  }
}

TEST_CASE("recording reader: images come when they are asked for, dropped frames as nothing") {
  using namespace decant;
  const RecordingFolder folder("recording_images");
  const Recording recording = read_recording(folder.path());
  REQUIRE(recording.mask(1).has_value());
  CHECK((*recording.mask(1) == RecordingFolder::mask(1)).all());
  CHECK((*recording.mask(3) == RecordingFolder::mask(3)).all());
  CHECK_FALSE(recording.mask(2).has_value());
  CHECK((*recording.mask(2, 1) == RecordingFolder::mask(2)).all());
  CHECK_FALSE(recording.mask(0, 1).has_value());
  REQUIRE(recording.thermal(0).has_value());
  CHECK((*recording.thermal(0) == RecordingFolder::thermal()).all());
  CHECK_FALSE(recording.thermal(1).has_value());
  CHECK_FALSE(recording.thermal(0, 1).has_value());
  CHECK(recording.rgb(0)->width == 8);
  CHECK_FALSE(recording.rgb(1).has_value());
  CHECK_THROWS_WITH(recording.mask(4), "Recording: frame must be below the number of frames, got 4");
  CHECK_THROWS_WITH(recording.mask(0, 2), "Recording: camera must be below the number of cameras, got 2");

  // a file that went bad after the reading
  folder.write("mask_liquid/000001.png", png_bytes(Mask::Zero(6, 9)));
  CHECK(message_of([&] { recording.mask(1); }).find("mask_liquid/000001.png: size [px] must be 8 x 6, got 9 x 6") !=
        std::string::npos);
  folder.write("thermal/000000.png", png_bytes(Image<std::uint16_t>::Zero(5, 5)));
  CHECK(message_of([&] { recording.thermal(0); }).find("000000.png: size [px] must be 5 x 4") != std::string::npos);
  const std::string bytes = png_bytes(RecordingFolder::mask(0));
  folder.write("mask_liquid/000000.png", bytes.substr(0, bytes.size() - 15));
  CHECK(message_of([&] { recording.mask(0); }).find("mask_liquid/000000.png must be a whole and undamaged PNG file") !=
        std::string::npos);
}

TEST_CASE("recording reader: measurements in SI units with gaps") {
  using namespace decant;
  using recording::Quantity;
  const RecordingFolder folder("recording_measurements");
  const auto& [times, channels] = read_recording(folder.path()).measurements;
  CHECK(times == std::vector<double>{0, 0.25});
  REQUIRE(channels.size() == 5);
  CHECK(channels[0].quantity == Quantity::TargetMass);
  CHECK(channels[0].values[0] == Approx(0.0015));
  CHECK(std::isnan(channels[0].values[1]));
  CHECK(channels[1].name == "level_mm@10,-20");
  CHECK(channels[1].quantity == Quantity::Level);
  CHECK(channels[1].place.isApprox(Vector3<double>(0.01, -0.02, 0)));
  CHECK(channels[1].values[1] == Approx(0.081));
  CHECK(channels[2].quantity == Quantity::Front);
  CHECK(std::isnan(channels[2].values[0]));
  CHECK(channels[2].values[1] == Approx(0.25));
  CHECK(channels[3].quantity == Quantity::Pressure);
  CHECK(channels[3].place.isApprox(Vector3<double>(0.001, 0.002, 0.003)));
  CHECK(channels[3].values[0] == 101325);
  CHECK(channels[4].quantity == Quantity::Other);
  CHECK(channels[4].values[0] == 20.5);
}

TEST_CASE("recording reader: what may be left out") {
  using namespace decant;
  const RecordingFolder folder("recording_short");
  SECTION("time stamps") {
    folder.change("recording.json", "\"timestamps_s\": [0.5, 0.55, 0.61, 0.7],", "");
    const Recording recording = read_recording(folder.path());
    CHECK(recording.timestamps == std::vector<double>{0, 1 / 20.0, 2 / 20.0, 3 / 20.0});
    CHECK(recording.bodies[0].motion.end_time() == 3 / 20.0);
  }
  SECTION("the initial amount, which then has to be estimated") {
    folder.change("recording.json", ", \"fill_fraction\": 0.6", "");
    CHECK_FALSE(read_recording(folder.path()).liquid.initial->known());
  }
  SECTION("the container as well") {
    folder.change("recording.json", R"(,
             "initial": {"body": "cup", "fill_fraction": 0.6})",
                  "");
    CHECK_FALSE(read_recording(folder.path()).liquid.initial.has_value());
  }
  SECTION("truth") {
    folder.change("recording.json", ",\n  \"truth\": {\"volume_ml\": [250.5, null]}", "");
    CHECK(read_recording(folder.path()).frames == 4);
  }
  SECTION("masks: thermal images alone") {
    std::filesystem::remove_all(folder.path() / "mask_liquid");
    const Recording recording = read_recording(folder.path());
    CHECK_FALSE(recording.mask(0).has_value());
    CHECK(recording.thermal(0).has_value());
  }
  SECTION("thermal images, masks alone") {
    std::filesystem::remove_all(folder.path() / "thermal");
    CHECK(read_recording(folder.path()).mask(0).has_value());
  }
}

TEST_CASE("recording reader: a volume, and none at first") {
  const RecordingFolder folder("recording_volume");
  folder.change("recording.json", "\"fill_fraction\": 0.6", "\"volume_ml\": 250");
  CHECK(*decant::read_recording(folder.path()).liquid.initial->volume == Approx(250e-6));
  folder.change("recording.json", "\"volume_ml\": 250}", "\"volume_ml\": 0}");
  const auto initial = decant::read_recording(folder.path()).liquid.initial;
  CHECK(initial->volume == 0);
  CHECK(initial->known());
}

TEST_CASE("recording reader: an inlet") {
  const RecordingFolder folder("recording_inlet");
  folder.change("recording.json", "\"initial\": {\"body\": \"cup\", \"fill_fraction\": 0.6}",
                R"("inlet": {"position_w_m": [0, 0.1, 1], "direction_w": [0, 0, -2], "radius_m": 0.01,
                             "flow_ml_s": [[0, 50], [2.5, 60]]})");
  const auto recording = decant::read_recording(folder.path());
  REQUIRE(recording.liquid.inlet.has_value());
  CHECK(recording.liquid.inlet->position == decant::Vector3<double>(0, 0.1, 1));
  CHECK(recording.liquid.inlet->direction == decant::Vector3<double>(0, 0, -1));
  CHECK(recording.liquid.inlet->radius == 0.01);
  REQUIRE(recording.liquid.inlet->flow.size() == 2);
  CHECK(recording.liquid.inlet->flow[1].first == 2.5);
  CHECK(recording.liquid.inlet->flow[1].second == Approx(60e-6));

  const std::string good = decant::detail::read_text_file(folder.path() / "recording.json", 1 << 20);
  const std::vector<Change> changes = {
      {"[0, 0, -2]", "[0, 0, 0]", "liquid.inlet.direction_w must be longer than 1e-6"},
      {"[0, 0.1, 1]", "[0, 0.1]", "liquid.inlet.position_w_m must be three numbers"},
      {"\"radius_m\": 0.01", "\"radius_m\": 0", "liquid.inlet.radius_m must be a number [m]"},
      {"[2.5, 60]", "[0, 60]", "liquid.inlet.flow_ml_s[1] must be a row [t_s, ml/s] with times that increase"},
      {"[2.5, 60]", "[2.5, -1]", "liquid.inlet.flow_ml_s[1][1] must be a row"},
      {"[2.5, 60]", "[2.5]", "liquid.inlet.flow_ml_s[1] must be a row"},
      {", [2.5, 60]", "", "liquid.inlet.flow_ml_s must be at least two rows"},
      {"\"radius_m\": 0.01", "\"radius\": 0.01", "liquid.inlet: a key must be one of position_w_m"},
  };
  for (const Change& change : changes) {
    folder.change("recording.json", change.from, change.to);
    INFO(refusal(folder));
    CHECK(refusal(folder).find(change.message) != std::string::npos);
    folder.write("recording.json", good);
  }
}

TEST_CASE("recording reader: measurements alone") {
  const decant_test::TemporaryFolder folder("recording_alone");
  folder.write("recording.json", R"({"format": "decant-recording", "version": 1, "name": "drain", "fps": 1, "frames": 0,
    "gravity_w": [0, 0, -9.81],
    "liquid": {"name": "water", "density": 998, "viscosity": 0.001, "surface_tension": 0.07}})");
  folder.write("measurements.csv", decant_test::measurements_csv);
  const auto recording = decant::read_recording(folder.path());
  CHECK(recording.cameras.empty());
  CHECK(recording.timestamps.empty());
  CHECK(recording.measurements.channels.size() == 5);

  // with poses a camera is needed, in whose frame they are
  folder.write("scene_gt.json", "{}");
  CHECK(message_of([&] { decant::read_recording(folder.path()); }) ==
        (folder.path() / "scene_camera.json").string() + ": no such file");
}

TEST_CASE("recording reader: rotations that are a little off are taken to the nearest one") {
  const RecordingFolder folder("recording_rotation");
  folder.write("scene_camera.json", R"({"0": {"cam_K": [600, 0, 3, 0, 600, 2, 0, 0, 1],
                                              "cam_R_w2c": [1, 0, 0, 0, 1, 0, 0, 0, 1], "cam_t_w2c": [0, 0, 0]}})");
  // a rotation times a symmetric matrix has that rotation as its nearest one
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(0.7, decant::Vector3<double>(1, -2, 0.5).normalized()));
  decant::Matrix3<double> stretch;
  stretch << 1.0004, 2e-4, -1e-4, 2e-4, 0.9997, 1.5e-4, -1e-4, 1.5e-4, 1.0001;
  const decant::Matrix3<double> matrix = rotation.toRotationMatrix() * stretch;
  std::string text;
  for (Eigen::Index k = 0; k < 9; ++k) {
    text += (k > 0 ? ", " : "[") + decant::detail::number_text(matrix(k / 3, k % 3));
  }
  folder.change("scene_gt.json", "[0, -1, 0, -1, 0, 0, 0, 0, -1]", text + "]");
  const auto recording = decant::read_recording(folder.path());
  CHECK(recording.bodies[0].motion.at(0.7).rotation.angularDistance(rotation) < 1e-14);
}

TEST_CASE("recording reader: a missing file is refused") {
  for (const char* file : {"recording.json", "scene_camera.json", "scene_gt.json", "camera_1/scene_camera.json"}) {
    const RecordingFolder folder("recording_missing");
    std::filesystem::remove(folder.path() / file);
    CHECK(refusal(folder) == (folder.path() / file).string() + ": no such file");
  }
  const RecordingFolder folder("recording_missing_mesh");
  std::filesystem::remove(folder.path() / "models/pan.obj");
  CHECK(refusal(folder) == (folder.path() / "recording.json").string() +
                               ": bodies[1].mesh must be an existing file, got \"models/pan.obj\"");
  CHECK(message_of([&] { decant::read_recording(folder.path() / "none"); }) ==
        (folder.path() / "none").string() + ": no such folder");
}

TEST_CASE("recording reader: JSON that does not parse is refused") {
  for (const char* file : {"recording.json", "scene_camera.json", "scene_gt.json", "camera_1/scene_camera.json"}) {
    const RecordingFolder folder("recording_json");
    for (const char* text : {"", "{\"0\": \n[}", "{\"0\": NaN}", "{\"0\": 1e999}", "{\"a\": 1, \"a\": 1}", "[1, 2]"}) {
      folder.write(file, text);
      const std::string message = refusal(folder);
      INFO(file << " with " << text << "\ngot " << message);
      CHECK(message.find((folder.path() / file).string()) == 0);
      CHECK(message.find("must be") != std::string::npos);
      CHECK(message.find('\n') == std::string::npos);
    }
  }
}

TEST_CASE("recording reader: a bad recording.json is refused with key, value and what was expected") {
  check_refusals(
      "recording_bad", "recording.json",
      {
          {"\"decant-recording\"", "\"decant-scene\"", "format must be \"decant-recording\", got \"decant-scene\""},
          {"\"version\": 1", "\"version\": 2", "version must be 1, got 2"},
          {"\"version\": 1,", "", "version is missing"},
          {"\"pour_cup_60_a\"", "\"\"", "name must be a string"},
          {"\"fps\": 20.0", "\"fps\": 0", "fps must be a number [1/s] from 1e-6 to 1e6, got 0"},
          {"\"fps\": 20.0", "\"fps\": -30", "fps must be a number"},
          {"\"fps\": 20.0, ", "", "fps is missing"},
          {"\"frames\": 4", "\"frames\": 2.5", "frames must be a whole number from 0 to 1000000, got 2.5"},
          {"\"frames\": 4", "\"frames\": -1", "frames must be a whole number"},
          {"\"frames\": 4", "\"frames\": \"4\"", "frames must be a whole number"},
          {"\"frames\": 4", "\"frames\": 3", "timestamps_s must be an array with one time for each of the 3 frames"},
          {"\"image\": {\"width\": 8, \"height\": 6},", "", "image is missing"},
          {"\"width\": 8", "\"width\": 0", "image.width must be a whole number [px] from 1 to 16384"},
          {", \"height\": 6", "", "image.height is missing"},
          {"[0.0, 0.1, -9.7]", "[0.0, 0.1]", "gravity_w must be three numbers"},
          {"[0.0, 0.1, -9.7]", "[0.0, null, 0]", "gravity_w[1] must be three numbers"},
          {"\"gravity_w\"", "\"gravity\"", "a key must be one of format, version"},
          {"\"bodies\": [", "\"bodies\": {\"a\": [", "must be JSON"},
          {"\"obj_id\": 7", "\"obj_id\": 1", "bodies[1].obj_id must be an obj_id that no other body has, got 1"},
          {"\"obj_id\": 7", "\"obj_id\": -7", "bodies[1].obj_id must be a whole number"},
          {"\"obj_id\": 7, ", "", "bodies[1].obj_id is missing"},
          {"\"pan\"", "\"cup\"", "bodies[1].name must be a name that no other body has, got \"cup\""},
          {"\"source\"", "\"sauce\"", "bodies[0].role must be \"source\", \"target\", \"junction\", \"obstacle\" or"},
          {", \"mesh\": \"models/pan.obj\"", "", "bodies[1].mesh is missing"},
          {"\"models/pan.obj\"", "\"models/none.obj\"", "bodies[1].mesh must be an existing file"},
          {"\"models/pan.obj\"", "\"models\"", "bodies[1].mesh must be an existing file"},
          {"\"models/pan.obj\"", "\"../pan.obj\"", "bodies[1].mesh must be a path that stays inside"},
          {"\"models/pan.obj\"", "\"models/../../pan.obj\"", "bodies[1].mesh must be a path that stays inside"},
          {"\"models/pan.obj\"", "\"/etc/passwd\"", "bodies[1].mesh must be a path that stays inside"},
          {"\"density\": 920.0", "\"density\": 0", "liquid.density must be a number [kg/m^3]"},
          {"\"viscosity\": 0.05", "\"viscosity\": -1", "liquid.viscosity must be"},
          {"\"surface_tension\": 0.03", "\"surface_tension\": []", "liquid.surface_tension must be"},
          {", \"viscosity\": 0.05", "", "liquid.viscosity is missing"},
          {"\"liquid\": {", "\"liquid\": {\"temperature\": 20, ", "liquid: a key must be one of name, density"},
          {"{\"body\": \"cup\"", "{\"body\": \"mug\"", "liquid.initial.body must be the name of one of the bodies"},
          {"\"body\": \"cup\", ", "", "liquid.initial.body is missing"},
          {"\"fill_fraction\": 0.6", "\"fill_fraction\": 1.01",
           "liquid.initial.fill_fraction must be a number from 0 to"},
          {"\"fill_fraction\": 0.6", "\"fill_fraction\": -0.1",
           "liquid.initial.fill_fraction must be a number from 0 to"},
          {"\"fill_fraction\": 0.6", "\"volume_ml\": -1", "liquid.initial.volume_ml must be a number [ml]"},
          {"\"fill_fraction\": 0.6", "\"fill_fraction\": 0.6, \"volume_ml\": 1", "volume_ml must be absent where"},
          {"\"fill_fraction\"", "\"fill\"", "liquid.initial: a key must be one of body, fill_fraction, volume_ml"},
          {"\"threshold\": 31200.5", "\"threshold\": 65536", "thermal.threshold must be a number of counts"},
          {"\"width\": 5, ", "", "thermal.width is missing"},
          {", [-0.01, 1.4, 0.5]]", "]", "thermal.affine_to_image must be two rows of three numbers"},
          {"[-0.01, 1.4, 0.5]", "[-0.01, 1.4]", "thermal.affine_to_image[1] must be two rows"},
          {"[-0.01, 1.4, 0.5]", "[3, 0.02, 0.5]", "a map that can be inverted"},
          {"[-0.01, 1.4, 0.5]", "[-0.01, 1.4, \"a\"]", "thermal.affine_to_image[1][2] must be two rows"},
          {"0.61, 0.7", "0.55, 0.7", "timestamps_s[2] must be later than the stamp before, 0.55, got 0.55"},
          {"0.61, 0.7", "0.5, 0.7", "timestamps_s[2] must be later than the stamp before"},
          {"0.61, 0.7", "0.61, null", "timestamps_s[3] must be a number [s]"},
          {"0.61, 0.7", "0.61, 1e400", "must be JSON"},
          {"0.61, 0.7", "0.61, 0.7, 0.8", "timestamps_s must be an array with one time for each of the 4 frames"},
          {"\"thermal\": {\"width\": 5, \"height\": 4, \"threshold\": 31200.5,\n              \"affine_to_image\": "
           "[[1.5, 0.01, 0.25], [-0.01, 1.4, 0.5]]},",
           "", "thermal is missing, which the images in"},
      });
}

TEST_CASE("recording reader: a bad scene_camera.json is refused with the frame") {
  const std::vector<Change> changes = {
      {"\"cam_K\": [600.5, 0, 3.5, 0, 601.5, 2.5, 0, 0, 1], ", "", "0.cam_K is missing"},
      {"[600.5, 0, 3.5", "[0, 0, 3.5", "0.cam_K must be nine numbers fx, 0, cx, 0, fy, cy, 0, 0, 1"},
      {"[600.5, 0, 3.5", "[600.5, 1, 3.5", "0.cam_K must be nine numbers"},
      {"2.5, 0, 0, 1]", "2.5, 0, 0]", "0.cam_K must be nine numbers"},
      {"2.5, 0, 0, 1]", "2.5, 0, 0, \"1\"]", "0.cam_K[8] must be nine numbers"},
      {"[1, 0, 0, 0, -1, 0, 0, 0, -1]", "[1, 0, 0, 0, -1, 0, 0, 0, 1]", "0.cam_R_w2c must be a rotation matrix"},
      {"[1, 0, 0, 0, -1, 0, 0, 0, -1]", "[1, 0.002, 0, 0, -1, 0, 0, 0, -1]", "0.cam_R_w2c must be a rotation matrix"},
      {"[1, 0, 0, 0, -1, 0, 0, 0, -1]", "[1, 0, 0, 0, -1, 0, 0, 0]", "0.cam_R_w2c must be nine numbers"},
      {"\"cam_R_w2c\"", "\"cam_R_w2C\"", "0.cam_R_w2c is missing"},
      {"\"cam_t_w2c\": [0, 0, 1000], ", "", "0.cam_t_w2c is missing"},
      {"[0, 0, 1000]", "[0, 0, 1e300]", "0.cam_t_w2c[2] must be three numbers [mm]"},
      {"[0, 0, 1000]", "[0, 0, null]", "0.cam_t_w2c[2] must be three numbers [mm]"},
      {"0.004, 0.005]", "0.004]", "0.cam_dist must be five numbers"},
      {"0.004, 0.005]", "0.004, 1e9]", "0.cam_dist[4] must be five numbers"},
      {"\"0\"", "\"1\"", "0 is missing: there must be an entry for every frame, or one for frame 0 alone"},
      {"\"0\"", "\"4\"", "a key must be a frame below 4, got 4"},
      {"\"0\"", "\"00\"", "a key must be an image id, 0 to 999999 without leading zeros, got \"00\""},
      {"\"0\"", "\"-1\"", "a key must be an image id"},
      {"\"0\": {", "\"1\": 5, \"0\": {", "1 must be an object, got 5"},
  };
  check_refusals("recording_bad_camera", "scene_camera.json", changes);
  check_refusals("recording_bad_second", "camera_1/scene_camera.json",
                 {{"\"2\":", "\"9\":", "a key must be a frame below 4, got 9"},
                  {"[20, 0, 500]", "[20, 0]", "2.cam_t_w2c must be three numbers"}});
  const RecordingFolder folder("recording_camera_frames");
  std::string text = RecordingFolder::second_camera();
  text = text.substr(0, text.find(", \"3\"")) + "}";
  folder.write("camera_1/scene_camera.json", text);
  CHECK(refusal(folder).find("3 is missing: there must be an entry for every frame") != std::string::npos);
}

TEST_CASE("recording reader: a bad scene_gt.json is refused with the frame") {
  check_refusals(
      "recording_bad_poses", "scene_gt.json",
      {
          {"[0, -1, 0, -1, 0, 0, 0, 0, -1]", "[0, -1, 0, -1, 0, 0, 0, 0, -1.01]", "3[0].cam_R_m2c must be a rotation"},
          {"[0, -1, 0, -1, 0, 0, 0, 0, -1]", "[0, -1, 0, -1, 0, 0, 0, 0, 1]", "3[0].cam_R_m2c must be a rotation"},
          {"[0, -1, 0, -1, 0, 0, 0, 0, -1]", "[0, 0, 0, 0, 0, 0, 0, 0, 0]", "3[0].cam_R_m2c must be a rotation"},
          {"[0, -1, 0, -1, 0, 0, 0, 0, -1]", "[0, -1, 0]", "3[0].cam_R_m2c must be nine numbers"},
          {"[100, -200, 900]", "[100, -200]", "3[0].cam_t_m2c must be three numbers [mm]"},
          {"[100, -200, 900]", "[100, -200, \"nan\"]", "3[0].cam_t_m2c[2] must be three numbers [mm]"},
          {"\"cam_t_m2c\": [100, -200, 900]", "\"t\": 1", "3[0].cam_t_m2c is missing"},
          {"\"obj_id\": 7", "\"obj_id\": 8", "0: obj_id must be that of one of the bodies, got 8"},
          {"\"obj_id\": 7", "\"obj_id\": 1", "0: obj_id must be given once in a frame, got 1 twice"},
          {"\"obj_id\": 7", "\"obj_id\": 7.5", "0[1].obj_id must be a whole number"},
          {"\"obj_id\": 7, ", "", "0[1].obj_id is missing"},
          {"\"3\"", "\"4\"", "a key must be a frame below 4, got 4"},
          {"\"3\"", "\"03\"", "a key must be an image id"},
          {"\"3\": [", "\"2\": 5, \"3\": [", "2 must be an array"},
          {"\"3\": [", "\"3\": [7, ", "3[0] must be an object, got 7"},
          {",\n        {\"obj_id\": 7, \"cam_R_m2c\": [1, 0, 0, 0, -1, 0, 0, 0, -1], \"cam_t_m2c\": [0, 0, 1000]}", "",
           "poses of obj_id 7, \"pan\" must be given in one frame at least"},
      });
}

TEST_CASE("recording reader: bad measurements are refused with the line") {
  check_refusals(
      "recording_bad_series", "measurements.csv",
      {
          {"t_s", "time", "line 1, first column must be t_s"},
          {"0.25,", "0,", "line 3, t_s must be later than the row before"},
          {"81", "inf", "line 3, \"level_mm@10,-20\" must be a finite number or empty, got \"inf\""},
          {"81", "81,1", "line 3 must be 6 cells, got 7"},
          {"@10,-20", "@10", "name of channel 2 must be level_mm@x,y with numbers [mm], got \"level_mm@10\""},
          {"@10,-20", "", "name of channel 2 must be level_mm@x,y"},
          {"@1,2,3", "@1,2,z", "name of channel 4 must be pressure_pa@x,y,z with numbers [mm]"},
          {"front_mm", "front_mm@3", "name of channel 3 must be front_mm without a place"},
          {"front_mm", "target_mass_g", "column 4 must be a name that no other column has"},
      });
}

TEST_CASE("recording reader: a bad mesh is refused with its file") {
  check_refusals("recording_bad_mesh", "models/pan.obj",
                 {{"f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n", "", "number of faces must be >= 1, got 0"},
                  {"f 1 3 2", "f 1 3 5", "vertex of a face must be 1..4"},
                  {"v 20 0 0", "v nan 0 0", "coordinate x must be a finite number"}});
  check_refusals("recording_bad_ply", "models/obj_000001.ply",
                 {{"3 1 2 3\n", "3 1 2 4\n", "vertex index (from 0) of a face must be below 4, got 4"}});
}

TEST_CASE("recording reader: bad images are refused with their file before any is loaded") {
  using namespace decant;
  const RecordingFolder folder("recording_bad_images");
  const auto refused = [&](const std::string& file, const std::string& bytes, const std::string& message) {
    const std::filesystem::path path = folder.path() / file;
    const bool was_there = std::filesystem::exists(path);
    const std::string good = was_there ? detail::read_text_file(path, 1 << 20) : "";
    folder.write(file, bytes);
    const std::string got = refusal(folder);
    INFO(got);
    CHECK(got.find(message) != std::string::npos);
    CHECK(got.find('\n') == std::string::npos);
    was_there ? static_cast<void>(folder.write(file, good)) : static_cast<void>(std::filesystem::remove(path));
  };
  const std::string mask = png_bytes(RecordingFolder::mask(0));
  refused("mask_liquid/000001.png", png_bytes(Mask::Zero(8, 6)),
          "mask_liquid/000001.png: size [px] must be 8 x 6, got 6 x 8");
  refused("camera_1/mask_liquid/000002.png", png_bytes(Mask::Zero(6, 7)),
          "camera_1/mask_liquid/000002.png: size [px] must be 8 x 6, got 7 x 6");
  refused("mask_liquid/000001.png", "", "mask_liquid/000001.png must be a PNG file, got an empty one");
  refused("mask_liquid/000001.png", "JFIF", "mask_liquid/000001.png must be a PNG file, got \"JFIF\"");
  refused("mask_liquid/000004.png", mask,
          "mask_liquid: name of an image must be a frame below 4, six digits and .png, got \"000004.png\"");
  refused("mask_liquid/1.png", mask, "name of an image must be a frame below 4, six digits and .png, got \"1.png\"");
  refused("mask_liquid/a\nb.png", mask, "got \"a\\x0ab.png\"");
  refused("thermal/000001.png", png_bytes(Image<std::uint16_t>::Zero(6, 8)),
          "thermal/000001.png: size [px] must be 5 x 4, got 8 x 6");
  refused("thermal/000001.png", png_bytes(Mask::Zero(4, 5)), "thermal/000001.png: bits per sample must be 16, got 8");
  refused("camera_3/scene_camera.json", "{}", "folders of further cameras must be camera_1 to camera_2 without a gap");
  std::filesystem::remove_all(folder.path() / "camera_3");
  folder.write("mask_liquid/notes.txt", "other files do no harm");
  folder.write("camera_settings/notes.txt", "nor do other folders");
  CHECK(refusal(folder).empty());
}

TEST_CASE("recording reader: links may not lead out of the folder") {
  const decant_test::TemporaryFolder outside("recording_outside");
  const auto mesh = outside.write("pan.obj", decant_test::model_obj);
  const auto mask = outside.write("000002.png", decant::png_bytes(RecordingFolder::mask(2)));
  const auto text = outside.write("scene_gt.json", decant_test::scene_gt_json);
  outside.write("scene_camera.json", RecordingFolder::second_camera());
  struct Link {
    std::filesystem::path target;
    const char* name;
  };
  for (const Link& link : {Link{mesh, "models/pan.obj"}, Link{mask, "mask_liquid/000002.png"},
                           Link{text, "scene_gt.json"}, Link{outside.path(), "camera_2"},
                           Link{outside.path(), "thermal"}, Link{outside.path() / "none", "mask_liquid/000002.png"}}) {
    const RecordingFolder folder("recording_links");
    std::filesystem::remove_all(folder.path() / link.name);
    std::filesystem::create_symlink(link.target, folder.path() / link.name);
    const std::string message = refusal(folder);
    INFO(link.name << ": " << message);
    CHECK(message.find("must be a path that stays inside its folder, also behind links") != std::string::npos);
    CHECK(message.find(link.name) != std::string::npos);
  }
  // one that stays inside is as good as a file
  const RecordingFolder folder("recording_links");
  std::filesystem::create_symlink("000001.png", folder.path() / "mask_liquid/000002.png");
  CHECK((*decant::read_recording(folder.path()).mask(2) == RecordingFolder::mask(1)).all());
  // and one that comes after the reading is not followed either
  const auto recording = decant::read_recording(folder.path());
  std::filesystem::remove(folder.path() / "mask_liquid/000003.png");
  std::filesystem::create_symlink(mask, folder.path() / "mask_liquid/000003.png");
  CHECK(message_of([&] { recording.mask(3); }).find("got a link that leads out") != std::string::npos);
}
