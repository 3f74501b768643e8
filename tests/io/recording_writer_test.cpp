// SPDX-License-Identifier: MIT
// What the writer writes is what the reader reads; a recording that is not finished is none; mistakes show early.

#include <decant/io/recording_writer.hpp>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <decant/io/recording_truth.hpp>

#include "catch.hpp"
#include "recording_folder.hpp"

namespace {

using decant_test::message_of;
using decant_test::RecordingFolder;

decant::Pose pose(double turn, double x, double y, double z) {
  const decant::Vector3<double> axis = decant::Vector3<double>(1, 2, -0.5).normalized();
  return {Eigen::Quaterniond(Eigen::AngleAxisd(turn, axis)), {x, y, z}};
}

void check_pose(const decant::Pose& a, const decant::Pose& b) {
  CHECK(a.rotation.angularDistance(b.rotation) < 1e-14);
  CHECK((a.translation - b.translation).norm() < 1e-14);
}

// Odd numbers throughout, which seven digits would not hold.
decant::Recording header() {
  using namespace decant;
  Recording recording;
  recording.name = "a \"quoted\" name \xC3\xA4";
  recording.frames_per_second = 29.97;
  recording.width = 8;
  recording.height = 6;
  recording.gravity = {0.1 / 3, -0.2, -9.81};
  const TriangleMesh mesh = parse_mesh(decant_test::model_ply, MeshFormat::Ply, "model");
  recording.bodies.push_back({3, "cup", recording::Role::Target, {}, scaled(mesh, 1e-3 / 7), {}});
  recording.bodies.push_back({12, "pan", std::nullopt, {}, mesh, PoseTrack(pose(0.3, 1, 2, 3))});
  recording.liquid.name = "honey";
  recording.liquid.density = 1400.0 / 3;
  recording.liquid.viscosity = 7.1;
  recording.liquid.surface_tension = 0.05;
  recording.liquid.initial = recording::Initial{1, 1.0 / 3, std::nullopt};
  recording.thermal_imager.emplace();
  recording.thermal_imager->width = 5;
  recording.thermal_imager->height = 4;
  recording.thermal_imager->threshold = 31200.25;
  recording.thermal_imager->image_from_thermal << 1.0 / 3, 0.1, 2, -0.1, 0.7, 1e-17;
  recording.cameras.resize(2);
  recording.cameras[0].views = {{600.1, 601.2, 3.3, 2.2, {0.1, 1e-9, -0.3, 0.4, 0.5}, pose(2, 0.1, 0.2, 0.9)}};
  recording.cameras[1].views = {{500, 500, 4, 3, {}, pose(-1, -0.1, 0.2, 0.7)}};
  recording.measurements.times = {-0.5, 0.1, 7.0 / 3};
  const double gap = std::numeric_limits<double>::quiet_NaN();
  recording.measurements.channels = {
      {"target_mass_g", recording::Quantity::TargetMass, Vector3<double>::Zero(), {0.1, gap, 0.3}},
      {"level_mm@1.5,-2", recording::Quantity::Level, {0.0015, -0.002, 0}, {gap, gap, 1.0 / 7}},
      {"weight_n", recording::Quantity::Other, Vector3<double>::Zero(), {1, 2, 3}}};
  return recording;
}

}  // namespace

TEST_CASE("recording writer: what is written is read back") {
  using namespace decant;
  const decant_test::TemporaryFolder folder("recording_written");
  const Recording given = header();
  RecordingWriter writer(folder.path() / "a", given);
  writer.set_truth(R"({"volume_ml": 0.1, "list": [1, null]})");
  std::vector<Pose> cup;
  for (int k = 0; k < 3; ++k) {
    recording::Frame frame;
    cup.push_back(pose(0.4 * k, 0.1 * k, 1.0 / 3, -k));
    frame.bodies = {cup.back(), k == 1 ? std::nullopt : std::optional(pose(k, 0, 0, 0.1))};
    if (k != 1) {
      frame.shots.resize(2);
      frame.shots[0].mask = RecordingFolder::mask(k);
      frame.shots[0].rgb = Picture(4, 3);
      frame.shots[1].thermal = RecordingFolder::thermal();
      frame.shots[1].view = given.cameras[1].views[0];
      frame.shots[1].view->camera_from_world = pose(-1 + 0.1 * k, 0, 0, 1);
    }
    writer.add_frame(frame);
    CHECK_FALSE(std::filesystem::exists(folder.path() / "a/recording.json"));
  }
  CHECK(writer.frames() == 3);
  writer.finish();
  CHECK_FALSE(std::filesystem::exists(folder.path() / "a/recording.json.part"));

  const Recording back = read_recording(folder.path() / "a");
  CHECK(back.name == given.name);
  CHECK(back.frames_per_second == given.frames_per_second);
  CHECK(back.frames == 3);
  CHECK(back.width == 8);
  CHECK(back.height == 6);
  CHECK(back.gravity == given.gravity);
  CHECK(back.timestamps == std::vector<double>{0, 1 / 29.97, 2 / 29.97});
  REQUIRE(back.bodies.size() == 2);
  CHECK(back.bodies[0].object_id == 3);
  CHECK(back.bodies[0].name == "cup");
  CHECK(back.bodies[0].role == recording::Role::Target);
  CHECK(back.bodies[0].mesh_file == "models/obj_000003.ply");
  CHECK(back.bodies[0].mesh.triangles == given.bodies[0].mesh.triangles);
  for (std::size_t k = 0; k < given.bodies[0].mesh.vertices.size(); ++k) {
    CHECK((back.bodies[0].mesh.vertices[k] - given.bodies[0].mesh.vertices[k]).norm() < 1e-18);
  }
  CHECK_FALSE(back.bodies[1].role.has_value());
  REQUIRE(back.bodies[0].motion.samples().size() == 3);
  for (std::size_t k = 0; k < 3; ++k) {
    check_pose(back.bodies[0].motion.samples()[k].pose, cup[k]);
  }
  REQUIRE(back.bodies[1].motion.samples().size() == 2);  // not tracked in frame 1
  CHECK(back.bodies[1].motion.samples()[1].time == 2 / 29.97);
  CHECK(back.liquid.name == "honey");
  CHECK(back.liquid.density == given.liquid.density);
  CHECK(back.liquid.viscosity == 7.1);
  CHECK(back.liquid.surface_tension == 0.05);
  CHECK(back.liquid.initial->body == 1);
  CHECK(back.liquid.initial->fill_fraction == 1.0 / 3);
  CHECK_FALSE(back.liquid.initial->volume.has_value());
  CHECK(back.thermal_imager->threshold == 31200.25);
  CHECK(back.thermal_imager->image_from_thermal == given.thermal_imager->image_from_thermal);

  REQUIRE(back.cameras.size() == 2);
  REQUIRE(back.cameras[0].fixed());
  const recording::View& view = back.cameras[0].views[0];
  CHECK(view.fx == 600.1);
  CHECK(view.fy == 601.2);
  CHECK(view.cx == 3.3);
  CHECK(view.cy == 2.2);
  CHECK(view.distortion == given.cameras[0].views[0].distortion);
  check_pose(view.camera_from_world, given.cameras[0].views[0].camera_from_world);
  REQUIRE_FALSE(back.cameras[1].fixed());
  check_pose(back.cameras[1].view(1).camera_from_world, given.cameras[1].views[0].camera_from_world);
  check_pose(back.cameras[1].view(2).camera_from_world, pose(-0.8, 0, 0, 1));

  CHECK((*back.mask(2) == RecordingFolder::mask(2)).all());
  CHECK_FALSE(back.mask(1).has_value());
  CHECK((*back.thermal(0, 1) == RecordingFolder::thermal()).all());
  CHECK(back.rgb(0)->width == 4);

  REQUIRE(back.measurements.times == given.measurements.times);
  REQUIRE(back.measurements.channels.size() == 3);
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& a = back.measurements.channels[k];
    const auto& b = given.measurements.channels[k];
    CHECK(a.name == b.name);
    CHECK(a.quantity == b.quantity);
    CHECK(a.place.isApprox(b.place));
    for (std::size_t i = 0; i < 3; ++i) {
      CHECK(std::isnan(a.values[i]) == std::isnan(b.values[i]));
      CHECK((std::isnan(b.values[i]) || a.values[i] == Approx(b.values[i]).epsilon(1e-15)));
    }
  }
  CHECK(read_truth(folder.path() / "a") == R"({"list":[1,null],"volume_ml":0.1})");
}

TEST_CASE("recording writer: a recording that was read is written again as the same one") {
  using namespace decant;
  const RecordingFolder folder("recording_again");
  const Recording first = read_recording(folder.path());
  write_recording(folder.path() / "copy", first);
  const Recording second = read_recording(folder.path() / "copy");
  CHECK(second.timestamps == first.timestamps);  // uneven ones
  CHECK(second.gravity == first.gravity);
  CHECK(second.liquid.initial->fill_fraction == 0.6);
  for (std::size_t frame = 0; frame < first.frames; ++frame) {
    for (std::size_t camera = 0; camera < 2; ++camera) {
      REQUIRE(second.mask(frame, camera).has_value() == first.mask(frame, camera).has_value());
      if (first.mask(frame, camera)) {
        CHECK((*second.mask(frame, camera) == *first.mask(frame, camera)).all());
      }
      CHECK(second.thermal(frame, camera).has_value() == first.thermal(frame, camera).has_value());
      check_pose(second.cameras[camera].view(frame).camera_from_world,
                 first.cameras[camera].view(frame).camera_from_world);
    }
    for (std::size_t body = 0; body < 2; ++body) {
      const double time = first.timestamps[frame] + 0.01;
      check_pose(second.bodies[body].motion.at(time), first.bodies[body].motion.at(time));
    }
  }
  CHECK(second.measurements.channels.size() == 5);
  CHECK_FALSE(read_truth(folder.path() / "copy").has_value());
  CHECK(read_truth(folder.path()) == R"({"volume_ml":[250.5,null]})");
}

TEST_CASE("recording writer: inlet, volume and time stamps of a live clock") {
  using namespace decant;
  const decant_test::TemporaryFolder folder("recording_live");
  Recording given = header();
  given.liquid.initial = recording::Initial{0, std::nullopt, 250e-6};
  given.liquid.inlet = InletSettings{{0.1, 0.2, 0.3}, {0, 0.6, -0.8}, 0.01, {{0, 50e-6}, {1.0 / 3, 60e-6}}};
  given.measurements = {};
  given.bodies[0].motion = PoseTrack({{1000, pose(0, 0, 0, 0)}, {1001, pose(0, 1, 0, 0)}});
  RecordingWriter writer(folder.path() / "a", given);
  for (const double time : {1000.25, 1000.26, 1000.5}) {
    writer.add_frame({time, {}, {}});
  }
  writer.finish();
  const Recording back = read_recording(folder.path() / "a");
  CHECK(back.timestamps == std::vector<double>{1000.25, 1000.26, 1000.5});
  CHECK(back.cameras[1].fixed());
  check_pose(back.bodies[0].motion.samples()[1].pose, pose(0, 1000.26 - 1000, 0, 0));
  CHECK(*back.liquid.initial->volume == Approx(250e-6).epsilon(1e-15));
  REQUIRE(back.liquid.inlet.has_value());
  CHECK(back.liquid.inlet->position == given.liquid.inlet->position);
  CHECK(back.liquid.inlet->direction.isApprox(given.liquid.inlet->direction));
  CHECK(back.liquid.inlet->radius == 0.01);
  CHECK(back.liquid.inlet->flow[1].first == 1.0 / 3);
  CHECK(back.liquid.inlet->flow[1].second == Approx(60e-6).epsilon(1e-15));
  CHECK(back.measurements.channels.empty());
}

TEST_CASE("recording writer: measurements alone") {
  using namespace decant;
  const decant_test::TemporaryFolder folder("recording_only_series");
  Recording given;
  given.name = "drain";
  RecordingWriter writer(folder.path() / "a", given);
  writer.set_measurements(header().measurements);
  writer.finish();
  const Recording back = read_recording(folder.path() / "a");
  CHECK(back.frames == 0);
  CHECK(back.cameras.empty());
  CHECK(back.measurements.channels.size() == 3);
}

TEST_CASE("recording writer: what is left behind before finish is no recording") {
  const decant_test::TemporaryFolder folder("recording_unfinished");
  {
    decant::RecordingWriter writer(folder.path() / "a", header());
    writer.add_frame({std::nullopt, {pose(0, 0, 0, 0), std::nullopt}, {}});
  }
  CHECK(message_of([&] { decant::read_recording(folder.path() / "a"); }).find("recording.json: no such file") !=
        std::string::npos);
  CHECK(message_of([&] { decant::RecordingWriter(folder.path() / "a", header()); }) ==
        (folder.path() / "a").string() + " must be a new or an empty folder, got one with files");
}

TEST_CASE("recording writer: a header that breaks the format is refused at once") {
  using decant::Recording;
  const decant_test::TemporaryFolder folder("recording_bad_header");
  const auto refusal = [&](const auto& change) {
    Recording given = header();
    change(given);
    std::string line;
    try {
      decant::RecordingWriter(folder.path() / "a", given);
    } catch (const std::invalid_argument& error) {
      line = error.what();
    }
    INFO(line);
    CHECK(line.find('\n') == std::string::npos);
    CHECK_FALSE(std::filesystem::exists(folder.path() / "a"));
    return line;
  };
  const auto has = [](const std::string& line, const char* part) { return line.find(part) != std::string::npos; };
  CHECK(has(refusal([](Recording& r) { r.name = ""; }), "RecordingWriter: header: recording.json: name must be"));
  CHECK(has(refusal([](Recording& r) { r.name = "\xff"; }), "RecordingWriter: header"));
  CHECK(has(refusal([](Recording& r) { r.frames_per_second = 0; }), "fps must be a number"));
  CHECK(has(refusal([](Recording& r) { r.gravity.x() = std::nan(""); }), "must be JSON"));
  CHECK(has(refusal([](Recording& r) { r.bodies[1].object_id = 3; }), "an obj_id that no other body has"));
  CHECK(has(refusal([](Recording& r) { r.bodies[1].mesh.triangles[0][0] = 4; }), "vertex index of a triangle"));
  CHECK(has(refusal([](Recording& r) { r.liquid.initial->body = 2; }), "Recording: body of the initial liquid"));
  CHECK(has(refusal([](Recording& r) { r.liquid.initial->fill_fraction = 1.5; }), "fill_fraction must be"));
  CHECK(has(refusal([](Recording& r) { r.liquid.initial->volume = 1; }), "volume_ml must be absent"));
  CHECK(has(refusal([](Recording& r) { r.cameras.clear(); }), "RecordingWriter: number of cameras must be >= 1"));
  CHECK(has(refusal([](Recording& r) { r.width = r.height = 0; }), "RecordingWriter: width [px] must be > 0"));
  CHECK(has(refusal([](Recording& r) { r.measurements.channels[0].values.pop_back(); }), "number of values"));
  CHECK(has(refusal([](Recording& r) { r.measurements.times[1] = -1; }), "measurements: measurements.csv: line 3"));
  CHECK(has(refusal([](Recording& r) { r.measurements.channels[1].place.x() = 1; }), "says its quantity and place"));
  CHECK(has(refusal([](Recording& r) { r.measurements.channels[2].name = "front_mm"; }), "says its quantity"));
}

TEST_CASE("recording writer: a frame that does not fit is refused before anything is written") {
  using namespace decant;
  const decant_test::TemporaryFolder folder("recording_bad_frame");
  RecordingWriter writer(folder.path() / "a", header());
  recording::Frame good;
  good.bodies = {pose(0, 0, 0, 0), pose(0, 0, 0, 0)};
  good.shots.resize(1);
  good.shots[0].mask = RecordingFolder::mask(0);
  const auto refusal = [&](const auto& change) {
    recording::Frame frame = good;
    change(frame);
    const std::string line = message_of([&] { writer.add_frame(frame); });
    INFO(line);
    CHECK(line.find("RecordingWriter: ") == 0);
    CHECK_FALSE(std::filesystem::exists(folder.path() / "a/mask_liquid"));
    return line;
  };
  const auto has = [](const std::string& line, const char* part) { return line.find(part) != std::string::npos; };
  CHECK(has(refusal([](auto& f) { f.bodies.pop_back(); }), "number of poses in a frame"));
  CHECK(has(refusal([](auto& f) { f.bodies[0]->translation.x() = std::nan(""); }), "pose of a body must be finite"));
  CHECK(has(refusal([](auto& f) { f.bodies[0]->rotation.coeffs() *= 2; }), "pose of a body"));
  CHECK(has(refusal([](auto& f) { f.bodies[0]->translation.x() = 1e6; }), "pose of a body"));
  CHECK(has(refusal([](auto& f) { f.shots.resize(3); }), "number of shots"));
  CHECK(has(refusal([](auto& f) { f.shots[0].mask = Mask::Zero(8, 6); }), "width [px] of a mask must be 8, got 6"));
  CHECK(has(refusal([](auto& f) { f.shots[0].mask = Mask::Zero(5, 8); }), "height [px] of a mask must be 6, got 5"));
  CHECK(has(refusal([](auto& f) { f.shots[0].thermal = Image<std::uint16_t>::Zero(4, 6); }), "of a thermal image"));
  CHECK(has(refusal([](auto& f) { f.time = std::nan(""); }), "time [s] of a frame"));
  CHECK(has(refusal([](auto& f) {
              f.shots[0].view = header().cameras[0].views[0];
              f.shots[0].view->fx = 0;
            }),
            "fx [px] must be > 0"));
  CHECK(has(refusal([](auto& f) {
              f.shots[0].view = header().cameras[0].views[0];
              f.shots[0].view->camera_from_world.translation.x() = std::nan("");
            }),
            "pose of a camera"));
  writer.add_frame(good);
  CHECK(has(message_of([&] {
              recording::Frame frame = good;
              frame.time = 5;
              writer.add_frame(frame);
            }),
            "time of a frame must be given for every frame or for none"));
  CHECK(has(message_of([&] { writer.set_truth("{\"a\": "); }), "RecordingWriter: truth"));
  CHECK(has(message_of([&] { writer.set_truth("1, \"frames\": 2"); }), "RecordingWriter: truth"));
  writer.finish();
  CHECK(has(message_of([&] { writer.add_frame(good); }), "before finish()"));
  CHECK(has(message_of([&] { writer.finish(); }), "called once"));
  CHECK(read_recording(folder.path() / "a").frames == 1);
}

TEST_CASE("recording writer: what never came is noticed at the end") {
  const decant_test::TemporaryFolder folder("recording_nothing");
  decant::RecordingWriter writer(folder.path() / "a", header());
  CHECK(message_of([&] { writer.finish(); }) ==
        "RecordingWriter: number of frames must be >= 1 where there are cameras, got 0");
  writer.add_frame({});  // the pan stands where the header has it, the cup is nowhere
  CHECK(message_of([&] { writer.finish(); }) ==
        "RecordingWriter: poses of body cup must be given once at least, got 0");
}
