// SPDX-License-Identifier: MIT
#pragma once

/// Reads recordings, version 1. Strict: what does not fit the format is refused with one line that names the file, the
/// key or the frame, and what was expected. Nothing outside the recording's folder is opened.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/io/detail/bop_json.hpp>
#include <decant/io/detail/folder.hpp>
#include <decant/io/detail/json.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/mesh_file.hpp>
#include <decant/io/png.hpp>
#include <decant/io/recording.hpp>
#include <decant/io/series_file.hpp>

namespace decant::inline DECANT_TARGET {

namespace detail {

/// Turns recording.json into a Recording without what other files hold.
class RecordingHeader {
 public:
  static Recording read(const JsonNode& root) {
    Recording recording;
    root.expect_keys({"format", "version", "name", "fps", "frames", "image", "gravity_w", "bodies", "liquid", "thermal",
                      "timestamps_s", "truth"});
    if (const JsonNode format = root.at("format"); format.value() != "decant-recording") {
      format.refuse("\"decant-recording\"");
    }
    if (const JsonNode version = root.at("version"); version.value() != 1) {
      version.refuse("1");
    }
    recording.name = root.at("name").text();
    recording.frames_per_second = root.at("fps").number(1e-6, 1e6, "a number [1/s] from 1e-6 to 1e6");
    recording.frames =
        static_cast<std::size_t>(root.at("frames").whole_number(0, image_limit, "a whole number from 0 to 1000000"));
    if (const auto image = root.find("image")) {
      image->expect_keys({"width", "height"});
      recording.width = side(image->at("width"));
      recording.height = side(image->at("height"));
    }
    recording.gravity = root.at("gravity_w").vector(1e4, "three numbers [m/s^2] of at most 1e4 in size");
    if (const auto bodies = root.find("bodies")) {
      for (const JsonNode& node : bodies->elements(part_limit)) {
        recording.bodies.push_back(body(node, recording));
      }
    }
    recording.liquid = liquid(root.at("liquid"), recording);
    if (const auto node = root.find("thermal")) {
      recording.thermal_imager = thermal_imager(*node);
    }
    read_timestamps(root, recording);
    return recording;
  }

 private:
  static constexpr std::size_t part_limit = 1000;

  static int side(const JsonNode& node) {
    return static_cast<int>(node.whole_number(1, 16384, "a whole number [px] from 1 to 16384"));
  }

  static recording::Body body(const JsonNode& node, const Recording& recording) {
    node.expect_keys({"obj_id", "name", "mesh", "role"});
    recording::Body body;
    const JsonNode id = node.at("obj_id"), name = node.at("name");
    body.object_id = static_cast<int>(id.whole_number(0, object_id_limit, "a whole number from 0 to 999999"));
    body.name = name.text();
    for (const recording::Body& other : recording.bodies) {
      if (other.object_id == body.object_id) {
        id.refuse("an obj_id that no other body has");
      }
      if (other.name == body.name) {
        name.refuse("a name that no other body has");
      }
    }
    body.mesh_file = node.at("mesh").relative_path();
    if (const auto role = node.find("role")) {
      for (const auto known : {recording::Role::Source, recording::Role::Target, recording::Role::Junction,
                               recording::Role::Obstacle, recording::Role::Tool}) {
        if (role->value() == recording::role_name(known)) {
          body.role = known;
        }
      }
      if (!body.role) {
        role->refuse("\"source\", \"target\", \"junction\", \"obstacle\" or \"tool\"");
      }
    }
    return body;
  }

  static recording::Liquid liquid(const JsonNode& node, const Recording& recording) {
    node.expect_keys({"name", "density", "viscosity", "surface_tension", "initial", "inlet"});
    recording::Liquid liquid;
    liquid.name = node.at("name").text();
    liquid.density = node.at("density").number(1e-3, 1e5, "a number [kg/m^3] from 0.001 to 1e5");
    liquid.viscosity = node.at("viscosity").number(0, 1e6, "a number [Pa s] from 0 to 1e6");
    liquid.surface_tension = node.at("surface_tension").number(0, 1e3, "a number [N/m] from 0 to 1000");
    if (const auto entry = node.find("initial")) {
      entry->expect_keys({"body", "fill_fraction", "volume_ml"});
      const JsonNode name = entry->at("body");
      const auto container = recording.find_body(name.text());
      if (!container) {
        name.refuse("the name of one of the bodies");
      }
      recording::Initial initial{*container};
      if (const auto fraction = entry->find("fill_fraction")) {
        initial.fill_fraction = fraction->number(0, 1, "a number from 0 to 1");
      }
      if (const auto volume = entry->find("volume_ml")) {
        if (initial.fill_fraction) {
          volume->refuse("absent where fill_fraction is given");
        }
        initial.volume = 1e-6 * volume->number(0, 1e12, "a number [ml] from 0 to 1e12");
      }
      liquid.initial = initial;
    }
    if (const auto entry = node.find("inlet")) {
      liquid.inlet = inlet(*entry);
    }
    return liquid;
  }

  static InletSettings inlet(const JsonNode& node) {
    node.expect_keys({"position_w_m", "direction_w", "radius_m", "flow_ml_s"});
    InletSettings inlet;
    inlet.position = node.at("position_w_m").vector(1e4, "three numbers [m] of at most 1e4 in size");
    const JsonNode direction = node.at("direction_w");
    inlet.direction = direction.vector(1e6, "three numbers of at most 1e6 in size");
    if (!(inlet.direction.norm() > 1e-6)) {
      direction.refuse("longer than 1e-6");
    }
    inlet.direction.normalize();
    inlet.radius = node.at("radius_m").number(1e-6, 1e4, "a number [m] from 1e-6 to 1e4");
    const JsonNode table = node.at("flow_ml_s");
    constexpr std::string_view row_text = "a row [t_s, ml/s] with times that increase and 0 <= ml/s <= 1e9";
    for (const JsonNode& row : table.elements(100000)) {
      if (!row.value().is_array() || row.value().size() != 2) {
        row.refuse(row_text);
      }
      const std::vector<JsonNode> cells = row.elements(2);
      const double time = cells[0].number(-1e6, 1e6, row_text), rate = 1e-6 * cells[1].number(0, 1e9, row_text);
      if (!inlet.flow.empty() && !(time > inlet.flow.back().first)) {
        row.refuse(row_text);
      }
      inlet.flow.emplace_back(time, rate);
    }
    if (inlet.flow.size() < 2) {
      table.refuse("at least two rows [t_s, ml/s]");
    }
    return inlet;
  }

  static recording::ThermalImager thermal_imager(const JsonNode& node) {
    node.expect_keys({"width", "height", "threshold", "affine_to_image"});
    recording::ThermalImager imager;
    imager.width = side(node.at("width"));
    imager.height = side(node.at("height"));
    imager.threshold = node.at("threshold").number(0, 65535, "a number of counts from 0 to 65535");
    const JsonNode map = node.at("affine_to_image");
    constexpr std::string_view expected =
        "two rows of three numbers of at most 1e6 in size, a map that can be inverted";
    const std::vector<JsonNode> rows = map.elements(2);
    for (std::size_t row = 0; row < 2; ++row) {
      if (rows.size() != 2 || !rows[row].value().is_array()) {
        map.refuse(expected);
      }
      imager.image_from_thermal.row(static_cast<Index>(row)) = rows[row].vector(1e6, expected).transpose();
    }
    if (!(std::abs(imager.image_from_thermal.leftCols<2>().determinant()) > 1e-12)) {
      map.refuse(expected);
    }
    return imager;
  }

  static void read_timestamps(const JsonNode& root, Recording& recording) {
    const auto node = root.find("timestamps_s");
    if (!node) {
      for (std::size_t frame = 0; frame < recording.frames; ++frame) {
        recording.timestamps.push_back(static_cast<double>(frame) / recording.frames_per_second);
      }
      return;
    }
    if (!node->value().is_array() || node->value().size() != recording.frames) {
      refuse_file(node->where(),
                  "an array with one time for each of the " + std::to_string(recording.frames) + " frames",
                  node->value().is_array() ? std::to_string(node->value().size()) + " elements" : "none");
    }
    for (const JsonNode& stamp : node->elements(image_limit)) {
      const double time = stamp.number(-1e12, 1e12, "a number [s] of at most 1e12 in size");
      if (!recording.timestamps.empty() && !(time > recording.timestamps.back())) {
        stamp.refuse("later than the stamp before, " + number_text(recording.timestamps.back()));
      }
      recording.timestamps.push_back(time);
    }
  }
};

/// Adds the camera of a scene_camera.json.
inline void add_camera(Recording& recording, std::string_view text, const std::string& name) {
  const ByImage<recording::View> views = parse_scene_camera(text, name, true);
  if (!views.empty() && views.rbegin()->first >= recording.frames) {
    refuse_file(name + ": a key", "a frame below " + std::to_string(recording.frames),
                std::to_string(views.rbegin()->first));
  }
  recording::Camera camera;
  if (views.size() == 1 && views.begin()->first == 0) {
    camera.views.push_back(views.begin()->second);
  } else {
    for (std::size_t frame = 0; frame < recording.frames; ++frame) {
      const auto view = views.find(frame);
      if (view == views.end()) {
        throw std::runtime_error(name + ": " + std::to_string(frame) +
                                 " is missing: there must be an entry for every frame, or one for frame 0 alone");
      }
      camera.views.push_back(view->second);
    }
  }
  if (camera.views.empty()) {
    throw std::runtime_error(name + ": 0 is missing: a recording with cameras must have frames");
  }
  recording.cameras.push_back(std::move(camera));
}

/// Gives the bodies their motion from scene_gt.json; needs the first camera.
inline void read_motions(Recording& recording, std::string_view text, const std::string& name) {
  const ByImage<std::vector<BopInstance>> images = parse_scene_gt(text, name);
  std::vector<std::vector<PoseTrack::Sample>> samples(recording.bodies.size());
  for (const auto& [frame, instances] : images) {
    if (frame >= recording.frames) {
      refuse_file(name + ": a key", "a frame below " + std::to_string(recording.frames), std::to_string(frame));
    }
    const Pose world_from_camera = recording.cameras.front().view(frame).camera_from_world.inverse();
    const double time = recording.timestamps[frame];
    for (const BopInstance& instance : instances) {
      std::size_t body = 0;
      while (body < recording.bodies.size() && recording.bodies[body].object_id != instance.object_id) {
        ++body;
      }
      const std::string where = name + ": " + std::to_string(frame) + ": obj_id";
      if (body == recording.bodies.size()) {
        refuse_file(where, "that of one of the bodies", std::to_string(instance.object_id));
      }
      if (!samples[body].empty() && samples[body].back().time == time) {
        refuse_file(where, "given once in a frame", std::to_string(instance.object_id) + " twice");
      }
      samples[body].push_back({time, world_from_camera * instance.camera_from_model});
    }
  }
  for (std::size_t body = 0; body < samples.size(); ++body) {
    if (samples[body].empty()) {
      refuse_file(name + ": poses of obj_id " + std::to_string(recording.bodies[body].object_id) + ", " +
                      visible_text(recording.bodies[body].name),
                  "given in one frame at least", "none");
    }
    recording.bodies[body].motion = PoseTrack(std::move(samples[body]));
  }
}

/// What one unit of a channel's file is in SI units.
inline double file_unit(recording::Quantity quantity) noexcept {
  using recording::Quantity;
  return quantity == Quantity::Pressure || quantity == Quantity::Other ? 1 : 1e-3;  // else grammes and millimetres
}

// The place in millimetres behind the @ of a channel's name, of so many numbers.
inline Vector3<double> channel_place(std::string_view text, std::size_t count, std::string_view where,
                                     std::string_view expected, std::string_view got) {
  Vector3<double> place = Vector3<double>::Zero();
  const std::vector<std::string_view> cells = split(text, ',');
  if (cells.size() != count) {
    refuse_file(where, expected, visible_text(got));
  }
  for (std::size_t k = 0; k < count; ++k) {
    const auto number = parse_number(cells[k]);
    if (!number || !(std::abs(*number) <= 1e8)) {
      refuse_file(where, expected, visible_text(got));
    }
    place[static_cast<Index>(k)] = 1e-3 * *number;
  }
  return place;
}

inline recording::Channel channel_of(const std::string& channel_name, std::string_view where) {
  using recording::Quantity;
  recording::Channel channel;
  channel.name = channel_name;
  const std::string_view text(channel.name);
  const std::size_t at = text.find('@');
  const std::string_view kind = text.substr(0, at);
  const std::string_view place = at == std::string_view::npos ? std::string_view() : text.substr(at + 1);
  if (kind == "level_mm") {
    channel.quantity = Quantity::Level;
    channel.place = channel_place(place, 2, where, "level_mm@x,y with numbers [mm]", text);
  } else if (kind == "pressure_pa") {
    channel.quantity = Quantity::Pressure;
    channel.place = channel_place(place, 3, where, "pressure_pa@x,y,z with numbers [mm]", text);
  } else if (kind == "target_mass_g" || kind == "front_mm") {
    channel.quantity = kind == "front_mm" ? Quantity::Front : Quantity::TargetMass;
    if (at != std::string_view::npos) {
      refuse_file(where, std::string(kind) + " without a place", visible_text(text));
    }
  }
  return channel;
}

/// Reads the files of one folder.
class RecordingFolder {
 public:
  explicit RecordingFolder(std::filesystem::path folder) : folder_(std::move(folder)) {
    std::error_code error;
    if (!std::filesystem::is_directory(folder_, error)) {
      throw std::runtime_error(folder_.string() + ": no such folder");
    }
  }

  std::string name(const std::filesystem::path& relative) const { return (folder_ / relative).string(); }

  /// Throws std::runtime_error where there is no such file, or where it lies elsewhere.
  std::string text(const std::filesystem::path& relative) const {
    return read_text_file(file_inside(folder_, relative), text_byte_limit);
  }

  bool has(const std::filesystem::path& relative) const { return find_inside(folder_, relative).has_value(); }

  Recording read() const;

 private:
  void read_meshes(Recording& recording) const {
    for (std::size_t k = 0; k < recording.bodies.size(); ++k) {
      recording::Body& body = recording.bodies[k];
      const auto path = find_inside(folder_, body.mesh_file);
      std::error_code error;
      if (!path || !std::filesystem::is_regular_file(*path, error)) {
        refuse_file(name("recording.json") + ": bodies[" + std::to_string(k) + "].mesh", "an existing file",
                    visible_text(body.mesh_file.string()));
      }
      body.mesh = scaled(read_mesh(*path), 1e-3);
    }
  }

  // Cameras that have a folder of their own, of which none may be left out.
  std::size_t further_cameras() const {
    std::set<std::string> names;
    std::error_code error;
    for (std::filesystem::directory_iterator entry(folder_, error), end; !error && entry != end;
         entry.increment(error)) {
      const std::string entry_name = entry->path().filename().string();
      constexpr std::string_view prefix = "camera_";
      if (entry_name.starts_with(prefix) && entry_name.size() > prefix.size() &&
          entry_name.find_first_not_of("0123456789", prefix.size()) == std::string::npos) {
        names.insert(entry_name);
      }
    }
    for (std::size_t camera = 1; camera <= names.size(); ++camera) {
      if (!names.contains(Recording::camera_folder(camera).string())) {
        refuse_file(folder_.string() + ": folders of further cameras",
                    "camera_1 to camera_" + std::to_string(names.size()) + " without a gap",
                    visible_text(*names.rbegin()));
      }
    }
    return names.size();
  }

  // Looks at the names and headers of a folder's images, so that what is wrong shows before a run and not within.
  void check_images(const Recording& recording, const std::filesystem::path& images, bool thermal) const {
    const auto path = find_inside(folder_, images);
    if (!path) {
      return;
    }
    std::set<std::string> names;  // in order, so that the first of several flaws is named whatever the file system
    std::error_code error;
    for (std::filesystem::directory_iterator entry(*path, error), end; !error && entry != end; entry.increment(error)) {
      if (entry->path().extension() == ".png") {
        names.insert(entry->path().filename().string());
      }
    }
    if (error) {
      throw std::runtime_error(name(images) + ": cannot be listed: " + error.message());
    }
    for (const std::string& image : names) {
      const auto frame = parse_number(std::string_view(image).substr(0, image.size() - 4));
      if (!frame || !(*frame >= 0 && *frame < static_cast<double>(recording.frames)) ||
          image != six_digits(static_cast<std::size_t>(*frame)) + ".png") {
        refuse_file(name(images) + ": name of an image",
                    "a frame below " + std::to_string(recording.frames) + ", six digits and .png", visible_text(image));
      }
      const std::string where = name(images / image);
      std::ifstream file(file_inside(folder_, images / image), std::ios::binary);
      std::string beginning(29, '\0');
      file.read(beginning.data(), static_cast<std::streamsize>(beginning.size()));
      beginning.resize(static_cast<std::size_t>(file.gcount()));
      const PngHeader header = parse_png_header(beginning, where);
      if (thermal) {
        expect_png_size(header, recording.thermal_imager->width, recording.thermal_imager->height, where);
        if (header.bit_depth != 16) {
          refuse_file(where + ": bits per sample", "16", std::to_string(header.bit_depth));
        }
      } else {
        expect_png_size(header, recording.width, recording.height, where);
      }
    }
  }

  std::filesystem::path folder_;
};

}  // namespace detail

/// What recording.json alone says: bodies have no mesh and no motion yet, and there are no cameras and measurements.
/// `name` stands for the file in messages. Throws std::runtime_error, one line that names the key, the value and what
/// was expected.
inline Recording parse_recording(std::string_view text, const std::string& name) {
  const nlohmann::json document = detail::parse_json(text, name);
  return detail::RecordingHeader::read(detail::JsonNode(document, name));
}

/// Measurements from the text of a measurements.csv. Places in the names of channels are in millimetres of the world
/// frame. Names that the format does not list are kept with their values as they are. Throws std::runtime_error, one
/// line that names `name`, the line and what was expected.
inline recording::Measurements parse_measurements(std::string_view text, const std::string& name) {
  Series series = parse_series(text, name);
  recording::Measurements measurements;
  measurements.times = std::move(series.columns.front());
  for (std::size_t k = 1; k < series.names.size(); ++k) {
    recording::Channel channel =
        detail::channel_of(series.names[k], name + ": header, name of channel " + std::to_string(k));
    channel.values = std::move(series.columns[k]);
    for (double& value : channel.values) {
      value *= detail::file_unit(channel.quantity);
    }
    measurements.channels.push_back(std::move(channel));
  }
  return measurements;
}

inline Recording detail::RecordingFolder::read() const {
  Recording recording = parse_recording(text("recording.json"), name("recording.json"));
  recording.folder = std::filesystem::canonical(folder_);
  read_meshes(recording);
  const std::size_t further = further_cameras();
  const bool tracked = !recording.bodies.empty() || has("scene_gt.json");
  const bool seen = tracked || further > 0 || has("scene_camera.json") || has("mask_liquid") ||
                    has("thermal");  // else a recording of measurements alone, which needs no camera
  for (std::size_t camera = 0; seen && camera <= further; ++camera) {
    const std::filesystem::path camera_folder = Recording::camera_folder(camera);
    add_camera(recording, text(camera_folder / "scene_camera.json"), name(camera_folder / "scene_camera.json"));
    if (recording.width == 0) {
      throw std::runtime_error(name("recording.json") + ": image is missing");
    }
    check_images(recording, camera_folder / "mask_liquid", false);
    if (!recording.thermal_imager && has(camera_folder / "thermal")) {
      throw std::runtime_error(name("recording.json") + ": thermal is missing, which the images in " +
                               name(camera_folder / "thermal") + " need");
    }
    check_images(recording, camera_folder / "thermal", true);
  }
  if (tracked) {
    read_motions(recording, text("scene_gt.json"), name("scene_gt.json"));
  }
  if (has("measurements.csv")) {
    recording.measurements = parse_measurements(text("measurements.csv"), name("measurements.csv"));
  }
  return recording;
}

/// The recording in a folder, with its meshes; images are looked over (names, sizes) but not loaded. Throws
/// std::runtime_error, one line that names the file, the key or the frame, and what was expected.
inline Recording read_recording(const std::filesystem::path& folder) { return detail::RecordingFolder(folder).read(); }

}  // namespace decant::inline DECANT_TARGET
