// SPDX-License-Identifier: MIT
// BOP scenes, as their datasets have them, become recordings, and recordings become BOP scenes.

#include <decant/io/bop.hpp>

#include <filesystem>
#include <string>
#include <vector>

#include "catch.hpp"
#include "recording_folder.hpp"

namespace {

using decant_test::message_of;
using decant_test::RecordingFolder;

// Images 3, 4 and 7 of a scene without a world; object 2 is the liquid, twice in image 3, out of view in image 4.
struct Dataset : decant_test::TemporaryFolder {
  explicit Dataset(const std::string& name) : TemporaryFolder(name) {
    write("bop/models/obj_000005.ply", decant_test::model_ply);
    std::string cameras, poses;
    const std::string pose = R"("cam_R_m2c": [1, 0, 0, 0, 1, 0, 0, 0, 1], "cam_t_m2c": [10, 20, )";
    for (const char* image : {"3", "4", "7"}) {
      cameras += std::string(cameras.empty() ? "" : ", ") + "\"" + image +
                 R"(": {"cam_K": [500, 0, 4, 0, 501, 3, 0, 0, 1], "depth_scale": 0.1, "view_level": 2})";
    }
    const std::string liquid = "{\"obj_id\": 2, " + pose + "0]}";
    poses = "\"3\": [" + liquid + ", {\"obj_id\": 5, " + pose + "300]}, " + liquid + "], \"4\": [{\"obj_id\": 5, " +
            pose + "400]}], \"7\": [{\"obj_id\": 5, " + pose + "700]}, " + liquid + "]";
    write("bop/test/000048/scene_camera.json", "{" + cameras + "}");
    write("bop/test/000048/scene_gt.json", "{" + poses + "}");
    for (const char* file : {"000003_000000", "000003_000002", "000007_000001"}) {
      write(std::string("bop/test/000048/mask_visib/") + file + ".png", decant::png_bytes(mask(file)));
    }
    write("bop/test/000048/rgb/000004.png", decant::png_bytes(decant::Picture(8, 6)));
  }

  static decant::Mask mask(const std::string& file) {
    return RecordingFolder::mask(file == "000003_000000" ? 0 : file == "000003_000002" ? 1 : 2);
  }

  decant::BopScene scene() const {
    decant::BopScene scene;
    scene.folder = path() / "bop/test/000048";
    scene.liquid_object = 2;
    scene.frames_per_second = 10;
    scene.gravity = {0, 9.81, 0};
    scene.names = {{5, "mug"}};
    scene.roles = {{5, decant::recording::Role::Source}};
    return scene;
  }
};

}  // namespace

TEST_CASE("bop: a scene becomes a recording") {
  using namespace decant;
  const Dataset dataset("bop_in");
  recording_from_bop(dataset.scene(), dataset.path() / "out");
  const Recording recording = read_recording(dataset.path() / "out");
  CHECK(recording.name == "bop");
  CHECK(recording.frames == 3);
  CHECK(recording.timestamps == std::vector<double>{0, 0.1, 0.4});
  CHECK(recording.width == 8);
  CHECK(recording.height == 6);
  CHECK(recording.gravity == Vector3<double>(0, 9.81, 0));
  REQUIRE(recording.bodies.size() == 1);
  CHECK(recording.bodies[0].object_id == 5);
  CHECK(recording.bodies[0].name == "mug");
  CHECK(recording.bodies[0].role == recording::Role::Source);
  CHECK(bounds(recording.bodies[0].mesh).max().isApprox(Vector3<double>::Constant(0.01)));
  CHECK(recording.bodies[0].motion.at(0.1).translation.isApprox(Vector3<double>(0.01, 0.02, 0.4)));
  CHECK(recording.bodies[0].motion.at(0.25).translation.isApprox(Vector3<double>(0.01, 0.02, 0.55)));
  CHECK(recording.cameras[0].fixed());
  CHECK(recording.cameras[0].view(0).fy == 501);
  CHECK(recording.cameras[0].view(0).camera_from_world.translation.isZero());
  CHECK((*recording.mask(0) == RecordingFolder::mask(0).max(RecordingFolder::mask(1))).all());
  CHECK_FALSE(recording.mask(1).has_value());
  CHECK((*recording.mask(2) == RecordingFolder::mask(2)).all());
  CHECK(recording.rgb(1)->width == 8);
}

TEST_CASE("bop: a folder mask_liquid goes before the masks of an object") {
  const Dataset dataset("bop_mask_liquid");
  dataset.write("bop/test/000048/mask_liquid/000004.png", decant::png_bytes(RecordingFolder::mask(3)));
  decant::recording_from_bop(dataset.scene(), dataset.path() / "out");
  const auto recording = decant::read_recording(dataset.path() / "out");
  CHECK_FALSE(recording.mask(0).has_value());
  CHECK((*recording.mask(1) == RecordingFolder::mask(3)).all());
}

TEST_CASE("bop: a recording goes out and comes back") {
  using namespace decant;
  const RecordingFolder folder("bop_out");
  const Recording first = read_recording(folder.path());
  write_bop(first, folder.path() / "bop", 99);
  CHECK(std::filesystem::exists(folder.path() / "bop/models/obj_000007.ply"));
  CHECK(std::filesystem::exists(folder.path() / "bop/test/000000/mask_visib/000003_000002.png"));
  CHECK_FALSE(std::filesystem::exists(folder.path() / "bop/test/000000/mask_visib/000002_000002.png"));
  BopScene scene;
  scene.folder = folder.path() / "bop/test/000000";
  scene.liquid_object = 99;
  scene.gravity = first.gravity;
  recording_from_bop(scene, folder.path() / "back");
  const Recording second = read_recording(folder.path() / "back");
  CHECK(second.frames == 4);
  CHECK(second.cameras[0].fixed());
  CHECK(second.cameras[0].view(0).distortion == first.cameras[0].view(0).distortion);
  REQUIRE(second.bodies.size() == 2);
  CHECK(second.bodies[1].name == "obj_000007");
  for (std::size_t frame = 0; frame < 4; ++frame) {
    REQUIRE(second.mask(frame).has_value() == first.mask(frame).has_value());
    if (first.mask(frame)) {
      CHECK((*second.mask(frame) == *first.mask(frame)).all());
    }
    for (std::size_t body = 0; body < 2; ++body) {
      const Pose a = second.bodies[body].motion.at(second.timestamps[frame]);
      const Pose b = first.bodies[body].motion.at(first.timestamps[frame]);
      CHECK((a.translation - b.translation).norm() < 1e-14);
      CHECK(a.rotation.angularDistance(b.rotation) < 1e-14);
    }
  }
  // the second camera, which moves
  write_bop(first, folder.path() / "bop_1", 99, 1);
  scene.folder = folder.path() / "bop_1/test/000000";
  recording_from_bop(scene, folder.path() / "back_1");
  const Recording third = read_recording(folder.path() / "back_1");
  CHECK_FALSE(third.cameras[0].fixed());
  CHECK((*third.mask(2) == RecordingFolder::mask(2)).all());
  CHECK((third.bodies[0].motion.at(0).translation - first.bodies[0].motion.at(0).translation).norm() < 1e-14);

  CHECK_THROWS_WITH(write_bop(first, folder.path() / "x", 7),
                    "write_bop: liquid_object must be a number that no body has, got 7");
  CHECK_THROWS_WITH(write_bop(first, folder.path() / "x", 99, 2),
                    "write_bop: camera must be below the number of cameras, got 2");
  CHECK(message_of([&] { write_bop(first, folder.path() / "bop", 99); }) ==
        (folder.path() / "bop").string() + " must be a new or an empty folder, got one with files");
}

TEST_CASE("bop: a bad scene is refused with one line") {
  const auto refusal = [](const auto& change) {
    const Dataset dataset("bop_bad");
    decant::BopScene scene = dataset.scene();
    change(dataset, scene);
    const std::string line = message_of([&] { decant::recording_from_bop(scene, dataset.path() / "out"); });
    INFO(line);
    CHECK(line.find('\n') == std::string::npos);
    CHECK_FALSE(std::filesystem::exists(dataset.path() / "out/recording.json"));
    return line;
  };
  const auto has = [](const std::string& line, const char* part) { return line.find(part) != std::string::npos; };
  const auto remove = [](const char* file) {
    return [file](const Dataset& dataset, decant::BopScene&) { std::filesystem::remove_all(dataset.path() / file); };
  };
  CHECK(has(refusal(remove("bop/test/000048")), "000048: no such folder"));
  CHECK(has(refusal(remove("bop/test/000048/scene_gt.json")), "scene_gt.json: no such file"));
  CHECK(has(refusal(remove("bop/test/000048/scene_camera.json")), "scene_camera.json: no such file"));
  CHECK(has(refusal(remove("bop/models")), "obj_000005.ply: no such file"));
  CHECK(has(refusal(remove("bop/test/000048/mask_visib/000003_000002.png")), "000003_000002.png: no such file"));
  CHECK(has(refusal([](const Dataset& d, decant::BopScene&) { d.write("bop/test/000048/scene_camera.json", "{}"); }),
            "must hold one image at least"));
  CHECK(has(
      refusal([](const Dataset& d, decant::BopScene&) { d.write("bop/test/000048/scene_gt.json", R"({"5": []})"); }),
      "scene_camera.json: 5 is missing, which scene_gt.json has"));
  CHECK(has(refusal([](const Dataset& d, decant::BopScene& s) {
              s.liquid_object.reset();
              d.write("bop/models/obj_000002.ply", decant_test::model_ply);
            }),
            "scene_gt.json: 3: obj_id must be given once in an image, got 2 twice"));
  CHECK(has(refusal([](const Dataset& d, decant::BopScene&) {
              d.write("bop/test/000048/mask_visib/000003_000002.png", decant::png_bytes(decant::Mask::Zero(6, 6)));
            }),
            "000003_000002.png: size [px] must be 8 x 6, got 6 x 6"));
  CHECK(has(refusal([](const Dataset& d, decant::BopScene&) {
              d.write("bop/test/000048/mask_liquid/000003.png", decant::png_bytes(RecordingFolder::mask(0)));
              d.write("bop/test/000048/mask_liquid/000004.png", decant::png_bytes(decant::Mask::Zero(6, 9)));
            }),
            "mask_liquid/000004.png: size [px] must be 8 x 6, got 9 x 6"));
  CHECK(has(refusal([](const Dataset& d, decant::BopScene&) {
              std::filesystem::remove_all(d.path() / "bop/test/000048/mask_visib");
              std::filesystem::remove_all(d.path() / "bop/test/000048/rgb");
            }),
            "000048: must hold one PNG at least"));
  CHECK(has(refusal([](const Dataset&, decant::BopScene& s) { s.frames_per_second = 0; }), "fps must be a number"));
}
