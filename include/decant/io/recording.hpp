// SPDX-License-Identifier: MIT
#pragma once

/// What a robot saw and tracked during one interaction with a liquid, as plain data in SI units; the images stay in
/// their folder until they are asked for. recording_reader.hpp reads one, recording_writer.hpp writes one.

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include <decant/boundary/triangle_mesh.hpp>
#include <decant/camera/affine_map.hpp>
#include <decant/camera/thermal_label.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/io/detail/folder.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/png.hpp>
#include <decant/simulation/inlet.hpp>

namespace decant::inline DECANT_TARGET {

/// What a recording is made of.
namespace recording {

/// What a body is there for: a hint for examples and reports, of no meaning to a simulation.
enum class Role { Source, Target, Junction, Obstacle, Tool };

/// As recording.json spells it.
inline std::string_view role_name(Role role) noexcept {
  constexpr std::array<std::string_view, 5> names{"source", "target", "junction", "obstacle", "tool"};
  return names[static_cast<std::size_t>(role)];
}

/// A rigid body that was tracked.
struct Body {
  int object_id = 0;  ///< BOP's obj_id
  std::string name;
  std::optional<Role> role{};
  std::filesystem::path mesh_file{};  ///< relative to the recording's folder
  TriangleMesh mesh{};                ///< [m], in the body's frame
  PoseTrack motion{};                 ///< world from body; samples at the frames in which the body was tracked
};

/// What is known of the liquid before the first frame.
struct Initial {
  std::size_t body = 0;                   ///< the container, by its place among the bodies
  std::optional<double> fill_fraction{};  ///< of the container's inner volume below its rim [-]
  std::optional<double> volume{};         ///< [m^3]; with neither of the two the amount has to be estimated

  bool known() const { return fill_fraction.has_value() || volume.has_value(); }
};

struct Liquid {
  std::string name = "water";
  double density = 998;             ///< [kg/m^3]
  double viscosity = 0.001;         ///< dynamic [Pa s]
  double surface_tension = 0.0728;  ///< [N/m]
  std::optional<Initial> initial{};
  std::optional<InletSettings> inlet{};  ///< where liquid pours in from a fixed opening
};

/// The imager beside the camera whose 16-bit pictures show warm liquid.
struct ThermalImager {
  int width = 0;         ///< [px]
  int height = 0;        ///< [px]
  double threshold = 0;  ///< counts; from here on a pixel shows liquid
  /// Takes a pixel (u, v, 1) of the thermal image to the camera's image.
  Eigen::Matrix<double, 2, 3> image_from_thermal = Eigen::Matrix<double, 2, 3>::Identity();
};

/// A camera at one frame. Pixel (0, 0) is the centre of the top left one.
struct View {
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< [px]
  std::array<double, 5> distortion{};     ///< k1, k2, p1, p2, k3 (plumb bob); zeros for a pinhole
  Pose camera_from_world{};

  /// Whether another view differs by its pose at most.
  bool same_lens(const View& other) const {
    return fx == other.fx && fy == other.fy && cx == other.cx && cy == other.cy && distortion == other.distortion;
  }
  bool distorted() const {
    for (const double coefficient : distortion) {
      if (coefficient != 0) {
        return true;
      }
    }
    return false;
  }
};

struct Camera {
  std::vector<View> views{};  ///< one for each frame, or a single one where the camera does not move

  bool fixed() const { return views.size() == 1; }
  const View& view(std::size_t frame) const { return fixed() ? views.front() : views.at(frame); }
};

/// What a channel of measurements is about.
enum class Quantity {
  TargetMass,  ///< liquid in the target [kg]
  Level,       ///< height of the free surface above `place`, of which x and y count [m]
  Front,       ///< the liquid's furthest x in the world [m]
  Pressure,    ///< at `place` [Pa]
  Other,       ///< a name that the format does not list; values as they are
};

struct Channel {
  std::string name;  ///< as the file has it, with its unit and place in millimetres
  Quantity quantity = Quantity::Other;
  Vector3<double> place = Vector3<double>::Zero();  ///< [m], world frame
  std::vector<double> values{};                     ///< SI units, one per time; NaN where a sample is missing
};

/// Scalar series with a common clock, that of the frames.
struct Measurements {
  std::vector<double> times{};  ///< [s], increasing
  std::vector<Channel> channels{};
};

}  // namespace recording

/// One recording. What really happened, where it is known, is no part of it: see recording_truth.hpp.
struct Recording {
  std::filesystem::path folder{};  ///< where the images are
  std::string name;
  double frames_per_second = 30;
  std::size_t frames = 0;
  int width = 0;                         ///< of every camera's image [px]; 0 where there is no camera
  int height = 0;                        ///< [px]
  Vector3<double> gravity{0, 0, -9.81};  ///< [m/s^2], world frame
  std::vector<recording::Body> bodies{};
  recording::Liquid liquid{};
  std::optional<recording::ThermalImager> thermal_imager{};
  std::vector<double> timestamps{};  ///< of each frame [s], increasing
  std::vector<recording::Camera> cameras{};
  recording::Measurements measurements{};

  /// The place of the body of that name.
  std::optional<std::size_t> find_body(std::string_view body) const {
    for (std::size_t k = 0; k < bodies.size(); ++k) {
      if (bodies[k].name == body) {
        return k;
      }
    }
    return std::nullopt;
  }

  /// Where the liquid was seen in a frame, or nothing for a dropped one. Reads the file. Throws std::runtime_error, one
  /// line, where it cannot be read or is not of the recording's size, std::invalid_argument for a frame or camera that
  /// the recording does not have.
  std::optional<Mask> mask(std::size_t frame, std::size_t camera = 0) const {
    const auto image = image_file("mask_liquid", frame, camera, width, height);
    return image ? std::optional<Mask>(parse_png_grey8(image->bytes, image->name)) : std::nullopt;
  }

  /// The thermographic image of a frame, or nothing; else as mask().
  std::optional<Image<std::uint16_t>> thermal(std::size_t frame, std::size_t camera = 0) const {
    const auto image = image_file("thermal", frame, camera, thermal_imager ? thermal_imager->width : 0,
                                  thermal_imager ? thermal_imager->height : 0);
    return image ? std::optional<Image<std::uint16_t>>(parse_png_grey16(image->bytes, image->name)) : std::nullopt;
  }

  /// Where liquid was seen: the mask or, where a frame has none but a thermal image, the label of that
  /// (ThermalLabel); nothing for a frame with neither. What the thermal imager does not see counts as no liquid. Else
  /// as mask().
  std::optional<Mask> liquid_mask(std::size_t frame, std::size_t camera = 0) const {
    std::optional<Mask> label = mask(frame, camera);
    if (!label && thermal_imager) {
      if (const auto image = thermal(frame, camera)) {
        label.emplace(height, width);
        ThermalLabel(thermal_imager->threshold, AffineMap(thermal_imager->image_from_thermal)).label(*image, *label);
      }
    }
    return label;
  }

  /// The colour picture of a frame, of any size, or nothing; else as mask().
  std::optional<Picture> rgb(std::size_t frame, std::size_t camera = 0) const {
    const auto image = image_file("rgb", frame, camera, 0, 0);
    return image ? std::optional<Picture>(parse_png_picture(image->bytes, image->name)) : std::nullopt;
  }

  /// Where the files of a camera are, relative to the recording's folder: the first one's are in the folder itself.
  static std::filesystem::path camera_folder(std::size_t camera) {
    return camera == 0 ? std::filesystem::path() : std::filesystem::path("camera_" + std::to_string(camera));
  }

 private:
  struct ImageFile {
    std::string name;
    std::string bytes;
  };

  // Columns and rows of 0 stand for any.
  std::optional<ImageFile> image_file(const char* kind, std::size_t frame, std::size_t camera, int columns,
                                      int rows) const {
    expects(frame < frames, "Recording: frame", "below the number of frames", frame);
    expects(camera < cameras.size(), "Recording: camera", "below the number of cameras", camera);
    const std::filesystem::path relative = camera_folder(camera) / kind / (detail::six_digits(frame) + ".png");
    const auto path = detail::find_inside(folder, relative);
    if (!path) {
      return std::nullopt;
    }
    ImageFile image{(folder / relative).string(), detail::read_text_file(*path, detail::png_byte_limit)};
    if (columns > 0) {
      detail::expect_png_size(parse_png_header(image.bytes, image.name), columns, rows, image.name);
    }
    return image;
  }
};

}  // namespace decant::inline DECANT_TARGET
