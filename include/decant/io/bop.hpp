// SPDX-License-Identifier: MIT
#pragma once

/// Scenes of BOP datasets (the 6D-pose benchmark's folders) to recordings and back. BOP has no liquids: here a liquid's
/// masks are those of an object id that the caller names, or a folder mask_liquid/ beside BOP's own.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/io/detail/bop_json.hpp>
#include <decant/io/detail/folder.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/mesh_file.hpp>
#include <decant/io/png.hpp>
#include <decant/io/recording.hpp>
#include <decant/io/recording_reader.hpp>
#include <decant/io/recording_writer.hpp>

namespace decant::inline DECANT_TARGET {

/// A BOP scene, and what BOP does not say about it.
struct BopScene {
  std::filesystem::path folder;    ///< of the scene: scene_camera.json, scene_gt.json, mask_visib/, rgb/
  std::filesystem::path models{};  ///< of the dataset; empty: models/ two folders above the scene, as BOP has it
  /// The object whose instances' masks show the liquid; it needs no model. Without it, or where the scene has a folder
  /// mask_liquid/ (NNNNNN.png by image id), masks are taken from there.
  std::optional<int> liquid_object{};
  std::string name = "bop";
  double frames_per_second = 30;         ///< of image ids, which may have gaps: those are gaps in time
  Vector3<double> gravity{0, 0, -9.81};  ///< [m/s^2], in BOP's world, or in the camera's frame where it states no world
  recording::Liquid liquid{};            ///< a body in it is a place among the annotated objects by increasing number
  std::map<int, std::string> names{};    ///< of objects; others are called obj_NNNNNN
  std::map<int, recording::Role> roles{};  ///< of objects
};

namespace detail {

// The liquid of one image: the union of its instances' visible masks; nothing where it has none.
inline std::optional<Mask> bop_liquid_mask(const BopScene& scene, std::size_t image,
                                           const std::vector<BopInstance>& instances, const PngHeader& size) {
  const auto read = [&](const std::filesystem::path& relative) {
    const std::string name = (scene.folder / relative).string();
    const std::string bytes = read_text_file(file_inside(scene.folder, relative), png_byte_limit);
    expect_png_size(parse_png_header(bytes, name), size.width, size.height, name);
    return parse_png_grey8(bytes, name);
  };
  if (find_inside(scene.folder, "mask_liquid")) {
    const std::filesystem::path relative = std::filesystem::path("mask_liquid") / (six_digits(image) + ".png");
    return find_inside(scene.folder, relative) ? std::optional<Mask>(read(relative)) : std::nullopt;
  }
  std::optional<Mask> mask;
  for (std::size_t k = 0; k < instances.size(); ++k) {
    if (scene.liquid_object && instances[k].object_id == *scene.liquid_object) {
      const Mask part = read(std::filesystem::path("mask_visib") / (six_digits(image) + "_" + six_digits(k) + ".png"));
      mask = mask ? Mask(mask->max(part)) : part;
    }
  }
  return mask;
}

// The size of the scene's images, which BOP does not state: that of the first PNG by name.
inline PngHeader bop_image_size(const std::filesystem::path& folder) {
  for (const char* kind : {"mask_liquid", "mask_visib", "mask", "rgb", "gray", "depth"}) {
    std::error_code error;
    std::filesystem::path first;
    for (std::filesystem::directory_iterator entry(folder / kind, error), end; !error && entry != end;
         entry.increment(error)) {
      if (entry->path().extension() == ".png" && (first.empty() || entry->path() < first)) {
        first = entry->path();
      }
    }
    if (!first.empty()) {
      return parse_png_header(
          read_text_file(file_inside(folder, std::filesystem::path(kind) / first.filename()), png_byte_limit),
          first.string());
    }
  }
  throw std::runtime_error(folder.string() + ": must hold one PNG at least, from which the images' size is known");
}

}  // namespace detail

/// Turns a BOP scene into a recording in the folder `out`, which must be new or empty; read_recording takes it from
/// there. Image ids in their order become frames 0, 1, 2, ..., with time stamps id / frames_per_second from the first
/// one on. Every object that was annotated becomes a body, but for the liquid; an image in which the liquid has no
/// instance becomes a dropped frame, since nobody says that there was none. Without world-to-camera poses the first
/// camera's frame is the world. Throws std::runtime_error, one line, where a file is missing or wrong, or where an
/// object has two instances in one image (nothing tells which is which in the next); std::invalid_argument where the
/// settings break the format of recordings.
inline void recording_from_bop(const BopScene& scene, const std::filesystem::path& out) {
  const detail::RecordingFolder files(scene.folder);
  const auto views =
      detail::parse_scene_camera(files.text("scene_camera.json"), files.name("scene_camera.json"), false);
  const auto images = detail::parse_scene_gt(files.text("scene_gt.json"), files.name("scene_gt.json"));
  if (views.empty()) {
    throw std::runtime_error(files.name("scene_camera.json") + ": must hold one image at least");
  }

  Recording header;
  header.name = scene.name;
  header.frames_per_second = scene.frames_per_second;
  header.gravity = scene.gravity;
  header.liquid = scene.liquid;
  const PngHeader size = detail::bop_image_size(scene.folder);
  header.width = size.width;
  header.height = size.height;
  header.cameras.resize(1);
  std::map<int, std::size_t> body_of;  // by object
  for (const auto& [image, instances] : images) {
    if (!views.contains(image)) {
      throw std::runtime_error(files.name("scene_camera.json") + ": " + std::to_string(image) +
                               " is missing, which scene_gt.json has");
    }
    for (const detail::BopInstance& instance : instances) {
      if (instance.object_id != scene.liquid_object) {
        body_of.emplace(instance.object_id, 0);
      }
    }
  }
  const std::filesystem::path models =
      scene.models.empty() ? scene.folder.lexically_normal() / ".." / ".." / "models" : scene.models;
  for (auto& [object, body] : body_of) {
    body = header.bodies.size();
    recording::Body next;
    next.object_id = object;
    const auto name = scene.names.find(object);
    next.name =
        name != scene.names.end() ? name->second : "obj_" + detail::six_digits(static_cast<std::size_t>(object));
    if (const auto role = scene.roles.find(object); role != scene.roles.end()) {
      next.role = role->second;
    }
    next.mesh = scaled(read_mesh(models / detail::model_file(object).filename()), 1e-3);
    header.bodies.push_back(std::move(next));
  }

  RecordingWriter writer(out, header);
  const std::size_t first = views.begin()->first;
  for (const auto& [image, view] : views) {
    recording::Frame frame;
    frame.time = static_cast<double>(image - first) / scene.frames_per_second;
    frame.bodies.resize(header.bodies.size());
    frame.shots.resize(1);
    frame.shots[0].view = view;
    const auto found = images.find(image);
    const std::vector<detail::BopInstance> none;
    const std::vector<detail::BopInstance>& instances = found != images.end() ? found->second : none;
    const Pose world_from_camera = view.camera_from_world.inverse();
    for (const detail::BopInstance& instance : instances) {
      if (instance.object_id == scene.liquid_object) {
        continue;
      }
      std::optional<Pose>& pose = frame.bodies[body_of.at(instance.object_id)];
      if (pose) {
        detail::refuse_file(files.name("scene_gt.json") + ": " + std::to_string(image) + ": obj_id",
                            "given once in an image", std::to_string(instance.object_id) + " twice");
      }
      pose = world_from_camera * instance.camera_from_model;
    }
    frame.shots[0].mask = detail::bop_liquid_mask(scene, image, instances, size);
    if (const auto rgb =
            detail::find_inside(scene.folder, std::filesystem::path("rgb") / (detail::six_digits(image) + ".png"))) {
      frame.shots[0].rgb = read_png_picture(*rgb);
    }
    writer.add_frame(frame);
  }
  writer.finish();
}

/// Writes one camera of a recording as a BOP dataset: models/ and the scene test/000000/ with scene_camera.json,
/// scene_gt.json, rgb/ and mask_visib/. The liquid becomes an object `liquid_object` without a model, whose pose is the
/// world's, with a mask in every frame that was not dropped; recording_from_bop with the same number takes it back.
/// Lost are what BOP does not know: the liquid's properties, measurements, thermal images, uneven time stamps. Throws
/// std::invalid_argument where a body has that number or the camera does not exist, std::runtime_error, one line, where
/// the folder is not empty or files cannot be read or written.
inline void write_bop(const Recording& recording, const std::filesystem::path& folder, int liquid_object,
                      std::size_t camera = 0) {
  namespace fs = std::filesystem;
  expects(camera < recording.cameras.size(), "write_bop: camera", "below the number of cameras", camera);
  expects(liquid_object >= 0 && liquid_object <= detail::object_id_limit, "write_bop: liquid_object", "0 to 999999",
          liquid_object);
  for (const recording::Body& body : recording.bodies) {
    expects(body.object_id != liquid_object, "write_bop: liquid_object", "a number that no body has", liquid_object);
  }
  std::error_code error;
  if (fs::exists(folder, error) && !fs::is_empty(folder, error)) {
    detail::refuse_file(folder.string(), "a new or an empty folder", "one with files");
  }
  const fs::path scene = folder / "test" / "000000";
  for (const fs::path& made : {folder / "models", scene / "mask_visib", scene / "rgb"}) {
    detail::make_folder(made);
  }
  for (const recording::Body& body : recording.bodies) {
    detail::write_model(folder / detail::model_file(body.object_id), body.mesh);
  }
  detail::ByImage<recording::View> views;
  detail::ByImage<std::vector<detail::BopInstance>> images;
  for (std::size_t frame = 0; frame < recording.frames; ++frame) {
    const recording::View& view = recording.cameras[camera].view(frame);
    views.emplace(frame, view);
    std::vector<detail::BopInstance>& instances = images[frame];
    for (const recording::Body& body : recording.bodies) {
      instances.push_back({body.object_id, view.camera_from_world * body.motion.at(recording.timestamps[frame])});
    }
    const std::string number = detail::six_digits(frame);
    if (const auto mask = recording.mask(frame, camera)) {
      write_png(scene / "mask_visib" / (number + "_" + detail::six_digits(instances.size()) + ".png"), *mask);
      instances.push_back({liquid_object, view.camera_from_world});
    }
    if (const auto rgb = recording.rgb(frame, camera)) {
      write_png(scene / "rgb" / (number + ".png"), *rgb);
    }
  }
  detail::write_text_file(scene / "scene_camera.json", detail::scene_camera_text(views));
  detail::write_text_file(scene / "scene_gt.json", detail::scene_gt_text(images));
}

}  // namespace decant::inline DECANT_TARGET
