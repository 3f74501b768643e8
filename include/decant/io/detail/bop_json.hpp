// SPDX-License-Identifier: MIT
#pragma once

/// BOP's per-image files as text: scene_camera.json (intrinsics and world-to-camera pose) and scene_gt.json (poses of
/// bodies in the camera's frame). Millimetres there, metres here. Keys that are not ours are passed over: BOP's own
/// tools add some.

#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
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
#include <decant/io/detail/json.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/recording.hpp>

namespace decant::inline DECANT_TARGET::detail {

inline constexpr std::size_t image_limit = 1000000;  // what six digits can name
inline constexpr std::int64_t object_id_limit = 999999;
inline constexpr std::uintmax_t text_byte_limit = std::uintmax_t{1}
                                                  << 26;  // a document in memory takes some 20 times its text

/// An instance of a model in one image.
struct BopInstance {
  int object_id = 0;
  Pose camera_from_model;
};

/// Entries of a file by image id.
template <class Entry>
using ByImage = std::map<std::size_t, Entry>;

/// A rotation matrix, nine numbers row by row. Rounded ones are taken to the nearest rotation.
inline Eigen::Quaterniond rotation_of(const JsonNode& node) {
  constexpr std::string_view nine = "nine numbers, the rows of a rotation matrix";
  if (!node.value().is_array() || node.value().size() != 9) {
    node.refuse(nine);
  }
  const std::vector<JsonNode> entries = node.elements(9);
  Matrix3<double> matrix;
  for (std::size_t k = 0; k < 9; ++k) {
    matrix(static_cast<Index>(k / 3), static_cast<Index>(k % 3)) = entries[k].number(-2, 2, nine);
  }
  const double off = (matrix.transpose() * matrix - Matrix3<double>::Identity()).cwiseAbs().maxCoeff();
  if (!(off <= 1e-3) || !(matrix.determinant() > 0)) {
    node.refuse("a rotation matrix R (R^T R within 1e-3 of the identity, determinant 1)");
  }
  // Newton's iteration for the polar factor (Higham 1986): quadratic, from 1e-3 three rounds reach rounding
  for (int round = 0; round < 4; ++round) {
    Matrix3<double> cofactors;
    for (Index row = 0; row < 3; ++row) {
      cofactors.row(row) = matrix.row((row + 1) % 3).cross(matrix.row((row + 2) % 3));
    }
    matrix = 0.5 * (matrix + cofactors / matrix.determinant());
  }
  return Eigen::Quaterniond(matrix).normalized();
}

inline Vector3<double> millimetres_of(const JsonNode& node) {
  return 1e-3 * node.vector(1e8, "three numbers [mm] of at most 1e8 in size");
}

/// Calls visit(image id, node) for each entry of a file's top object.
template <class Visit>
void for_each_image(const JsonNode& root, Visit&& visit) {
  if (!root.value().is_object()) {
    root.refuse("an object with one entry per image");
  }
  for (const auto& item : root.value().items()) {
    const std::string& key = item.key();
    std::size_t image = 0;
    const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), image);
    const bool plain = error == std::errc() && end == key.data() + key.size() && (key.size() == 1 || key[0] != '0');
    if (!plain || image >= image_limit) {
      refuse_file(root.where() + ": a key", "an image id, 0 to 999999 without leading zeros", visible_text(key));
    }
    visit(image, root.at(key));
  }
}

/// The view of one image; `posed` asks for a world-to-camera pose, which BOP itself leaves open.
inline recording::View view_of(const JsonNode& node, bool posed) {
  recording::View view;
  const JsonNode matrix = node.at("cam_K");
  constexpr std::string_view expected = "nine numbers fx, 0, cx, 0, fy, cy, 0, 0, 1 with fx and fy > 0";
  if (!matrix.value().is_array() || matrix.value().size() != 9) {
    matrix.refuse(expected);
  }
  const std::vector<JsonNode> entries = matrix.elements(9);
  std::array<double, 9> k{};
  for (std::size_t i = 0; i < 9; ++i) {
    k[i] = entries[i].number(-1e7, 1e7, expected);
  }
  if (!(k[0] > 0 && k[4] > 0) || k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1) {
    matrix.refuse(expected);
  }
  view.fx = k[0];
  view.cx = k[2];
  view.fy = k[4];
  view.cy = k[5];
  if (const auto distortion = node.find("cam_dist")) {
    constexpr std::string_view five = "five numbers k1, k2, p1, p2, k3 of at most 1e6 in size";
    if (!distortion->value().is_array() || distortion->value().size() != 5) {
      distortion->refuse(five);
    }
    const std::vector<JsonNode> coefficients = distortion->elements(5);
    for (std::size_t i = 0; i < 5; ++i) {
      view.distortion[i] = coefficients[i].number(-1e6, 1e6, five);
    }
  }
  const auto rotation = node.find("cam_R_w2c"), translation = node.find("cam_t_w2c");
  if (posed || rotation || translation) {
    view.camera_from_world.rotation = rotation_of(node.at("cam_R_w2c"));
    view.camera_from_world.translation = millimetres_of(node.at("cam_t_w2c"));
  }
  return view;
}

/// scene_camera.json. Throws std::runtime_error, one line that names `name`, the image and what was expected.
inline ByImage<recording::View> parse_scene_camera(std::string_view text, const std::string& name, bool posed) {
  const nlohmann::json document = parse_json(text, name);
  ByImage<recording::View> views;
  for_each_image(JsonNode(document, name), [&](std::size_t image, const JsonNode& node) {
    if (!node.value().is_object()) {
      node.refuse("an object");
    }
    views.emplace(image, view_of(node, posed));
  });
  return views;
}

/// scene_gt.json. Throws as parse_scene_camera.
inline ByImage<std::vector<BopInstance>> parse_scene_gt(std::string_view text, const std::string& name) {
  const nlohmann::json document = parse_json(text, name);
  ByImage<std::vector<BopInstance>> instances;
  for_each_image(JsonNode(document, name), [&](std::size_t image, const JsonNode& node) {
    std::vector<BopInstance>& list = instances[image];
    for (const JsonNode& entry : node.elements(10000)) {
      if (!entry.value().is_object()) {
        entry.refuse("an object");
      }
      BopInstance instance;
      instance.object_id =
          static_cast<int>(entry.at("obj_id").whole_number(0, object_id_limit, "a whole number from 0 to 999999"));
      instance.camera_from_model.rotation = rotation_of(entry.at("cam_R_m2c"));
      instance.camera_from_model.translation = millimetres_of(entry.at("cam_t_m2c"));
      list.push_back(instance);
    }
  });
  return instances;
}

/// Numbers as a JSON array that reads back to the same bits.
template <class Numbers>
std::string json_numbers(const Numbers& numbers) {
  std::string text = "[";
  for (const double number : numbers) {
    text += (text.size() > 1 ? ", " : "") + number_text(number);
  }
  return text + "]";
}

inline std::string json_vector(const Vector3<double>& vector) {
  return json_numbers(std::array<double, 3>{vector.x(), vector.y(), vector.z()});
}

/// `"cam_R_<frames>": [...], "cam_t_<frames>": [...]`
inline std::string bop_pose_text(const Pose& pose, const std::string& frames) {
  const Matrix3<double> matrix = pose.rotation.normalized().toRotationMatrix();
  std::array<double, 9> rows{};
  for (std::size_t k = 0; k < 9; ++k) {
    rows[k] = matrix(static_cast<Index>(k / 3), static_cast<Index>(k % 3));
  }
  return "\"cam_R_" + frames + "\": " + json_numbers(rows) + ", \"cam_t_" + frames +
         "\": " + json_vector(1e3 * pose.translation);
}

inline std::string scene_camera_text(const ByImage<recording::View>& views) {
  std::string text = "{";
  for (const auto& [image, view] : views) {
    text += std::string(text.size() > 1 ? "," : "") + "\n  \"" + std::to_string(image) + "\": {\"cam_K\": " +
            json_numbers(std::array<double, 9>{view.fx, 0, view.cx, 0, view.fy, view.cy, 0, 0, 1}) + ", " +
            bop_pose_text(view.camera_from_world, "w2c") +
            (view.distorted() ? ", \"cam_dist\": " + json_numbers(view.distortion) : "") + ", \"depth_scale\": 1.0}";
  }
  return text + "\n}\n";
}

inline std::string scene_gt_text(const ByImage<std::vector<BopInstance>>& instances) {
  std::string text = "{";
  for (const auto& [image, list] : instances) {
    text += std::string(text.size() > 1 ? "," : "") + "\n  \"" + std::to_string(image) + "\": [";
    bool first = true;
    for (const BopInstance& instance : list) {
      text += std::string(first ? "" : ",\n    ") + "{\"obj_id\": " + std::to_string(instance.object_id) + ", " +
              bop_pose_text(instance.camera_from_model, "m2c") + "}";
      first = false;
    }
    text += "]";
  }
  return text + "\n}\n";
}

inline std::filesystem::path model_file(int object_id) {
  return std::filesystem::path("models") / ("obj_" + six_digits(static_cast<std::size_t>(object_id)) + ".ply");
}

/// Writes a mesh [m] as BOP has models: text PLY in millimetres, with the value types that BOP's own reader knows.
inline void write_model(const std::filesystem::path& path, const TriangleMesh& mesh) {
  validate(mesh);
  std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(mesh.vertices.size()) +
                     "\nproperty double x\nproperty double y\nproperty double z\nelement face " +
                     std::to_string(mesh.triangles.size()) + "\nproperty list uchar int vertex_indices\nend_header\n";
  for (const Vector3<double>& vertex : mesh.vertices) {
    text += number_text(1e3 * vertex.x()) + " " + number_text(1e3 * vertex.y()) + " " + number_text(1e3 * vertex.z()) +
            "\n";
  }
  for (const TriangleMesh::Triangle& triangle : mesh.triangles) {
    text += "3 " + std::to_string(triangle[0]) + " " + std::to_string(triangle[1]) + " " + std::to_string(triangle[2]) +
            "\n";
  }
  write_text_file(path, text);
}

}  // namespace decant::inline DECANT_TARGET::detail
