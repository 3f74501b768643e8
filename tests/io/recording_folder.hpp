// SPDX-License-Identifier: MIT
#pragma once

/// A small recording for tests, written by hand and not by decant's writer.

#include <cstdint>
#include <string>

#include <decant/io/png.hpp>

#include "catch.hpp"
#include "temporary_folder.hpp"

namespace decant_test {

inline constexpr const char* recording_json = R"({
  "format": "decant-recording", "version": 1,
  "name": "pour_cup_60_a",
  "fps": 20.0, "frames": 4,
  "image": {"width": 8, "height": 6},
  "gravity_w": [0.0, 0.1, -9.7],
  "bodies": [
    {"obj_id": 1, "name": "cup", "mesh": "models/obj_000001.ply", "role": "source"},
    {"obj_id": 7, "name": "pan", "mesh": "models/pan.obj"}
  ],
  "liquid": {"name": "oil", "density": 920.0, "viscosity": 0.05, "surface_tension": 0.03,
             "initial": {"body": "cup", "fill_fraction": 0.6}},
  "thermal": {"width": 5, "height": 4, "threshold": 31200.5,
              "affine_to_image": [[1.5, 0.01, 0.25], [-0.01, 1.4, 0.5]]},
  "timestamps_s": [0.5, 0.55, 0.61, 0.7],
  "truth": {"volume_ml": [250.5, null]}
})";

// The camera looks straight down from 1 m: its x is the world's x, its y the world's -y, its z the world's -z.
inline constexpr const char* scene_camera_json = R"({
  "0": {"cam_K": [600.5, 0, 3.5, 0, 601.5, 2.5, 0, 0, 1], "cam_R_w2c": [1, 0, 0, 0, -1, 0, 0, 0, -1],
        "cam_t_w2c": [0, 0, 1000], "depth_scale": 1.0, "cam_dist": [0.1, -0.02, 0.003, 0.004, 0.005]}
})";

inline constexpr const char* scene_gt_json = R"({
  "0": [{"obj_id": 1, "cam_R_m2c": [1, 0, 0, 0, -1, 0, 0, 0, -1], "cam_t_m2c": [100, -200, 700]},
        {"obj_id": 7, "cam_R_m2c": [1, 0, 0, 0, -1, 0, 0, 0, -1], "cam_t_m2c": [0, 0, 1000]}],
  "3": [{"obj_id": 1, "cam_R_m2c": [0, -1, 0, -1, 0, 0, 0, 0, -1], "cam_t_m2c": [100, -200, 900], "visib": 1}]
})";

inline constexpr const char* measurements_csv =
    "t_s,target_mass_g,level_mm@10,-20,front_mm,\"pressure_pa@1,2,3\",temperature_c\n"
    "0,1.5,80,,101325,20.5\n0.25,,81,250,101326,\n";

/// A tetrahedron, 10 mm along each axis.
inline constexpr const char* model_ply =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n10 0 0\n0 10 0\n0 0 10\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";

inline constexpr const char* model_obj = "v 0 0 0\nv 20 0 0\nv 0 20 0\nv 0 0 20\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

/// Two cameras; frame 2 of the first one was dropped.
class RecordingFolder : public TemporaryFolder {
 public:
  explicit RecordingFolder(const std::string& name) : TemporaryFolder(name) {
    write("recording.json", recording_json);
    write("scene_camera.json", scene_camera_json);
    write("scene_gt.json", scene_gt_json);
    write("measurements.csv", measurements_csv);
    write("models/obj_000001.ply", model_ply);
    write("models/pan.obj", model_obj);
    write("mask_liquid/000000.png", decant::png_bytes(mask(0)));
    write("mask_liquid/000001.png", decant::png_bytes(mask(1)));
    write("mask_liquid/000003.png", decant::png_bytes(mask(3)));
    write("thermal/000000.png", decant::png_bytes(thermal()));
    write("rgb/000000.png", decant::png_bytes(decant::Picture(8, 6)));
    write("camera_1/scene_camera.json", second_camera());
    write("camera_1/mask_liquid/000002.png", decant::png_bytes(mask(2)));
  }

  static decant::Mask mask(int frame) {
    decant::Mask mask = decant::Mask::Zero(6, 8);
    mask(frame, 2 * frame) = 255;
    mask(5, 7) = 128;
    return mask;
  }

  static decant::Image<std::uint16_t> thermal() {
    decant::Image<std::uint16_t> image = decant::Image<std::uint16_t>::Constant(4, 5, 31200);
    image(3, 4) = 31201;
    return image;
  }

  // Moves along x, 10 mm a frame.
  static std::string second_camera() {
    std::string text = "{";
    for (int frame = 0; frame < 4; ++frame) {
      text += std::string(frame > 0 ? ", " : "") + "\"" + std::to_string(frame) +
              "\": {\"cam_K\": [500, 0, 4, 0, 500, 3, 0, 0, 1], \"cam_R_w2c\": [1, 0, 0, 0, 0, -1, 0, 1, 0], "
              "\"cam_t_w2c\": [" +
              std::to_string(10 * frame) + ", 0, 500]}";
    }
    return text + "}";
  }

  /// Replaces the first occurrence of a piece of text in one of the files.
  void change(const std::string& file, const std::string& from, const std::string& to) const {
    std::string text = decant::detail::read_text_file(path() / file, 1 << 24);
    const std::size_t at = text.find(from);
    REQUIRE(at != std::string::npos);
    write(file, text.replace(at, from.size(), to));
  }
};

}  // namespace decant_test
