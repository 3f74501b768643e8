// SPDX-License-Identifier: MIT
#pragma once

/// Writes recordings frame by frame, as a live robot or a simulated one produces them.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/io/detail/bop_json.hpp>
#include <decant/io/detail/folder.hpp>
#include <decant/io/detail/json.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/png.hpp>
#include <decant/io/recording.hpp>
#include <decant/io/recording_reader.hpp>
#include <decant/io/series_file.hpp>

namespace decant::inline DECANT_TARGET {

namespace recording {

/// What one camera gave in one frame.
struct Shot {
  std::optional<View> view{};  ///< where the camera is not where the header's camera has it
  std::optional<Mask> mask{};  ///< nothing: a dropped frame
  std::optional<Image<std::uint16_t>> thermal{};
  std::optional<Picture> rgb{};
};

/// One frame as it comes in.
struct Frame {
  std::optional<double> time{};  ///< [s]; in every frame or in none, which then are 1 / frames_per_second apart
  /// World from body for each of the header's bodies, nothing for one that was not tracked in this frame. Left empty,
  /// the bodies are where their motion in the header has them.
  std::vector<std::optional<Pose>> bodies{};
  std::vector<Shot> shots{};  ///< of the header's cameras in their order; those left out dropped the frame
};

}  // namespace recording

namespace detail {

// recording.json. Numbers that JSON cannot hold end up as words that do not parse, which the caller checks.
inline std::string recording_text(const Recording& recording, bool with_timestamps, const std::string& truth) {
  const auto quoted = [](const std::string& text) { return nlohmann::json(text).dump(); };
  std::string text = "{\n  \"format\": \"decant-recording\", \"version\": 1,\n  \"name\": " + quoted(recording.name) +
                     ",\n  \"fps\": " + number_text(recording.frames_per_second) +
                     ", \"frames\": " + std::to_string(recording.frames);
  if (recording.width != 0 || recording.height != 0) {
    text += ",\n  \"image\": {\"width\": " + std::to_string(recording.width) +
            ", \"height\": " + std::to_string(recording.height) + "}";
  }
  text += ",\n  \"gravity_w\": " + json_vector(recording.gravity) + ",\n  \"bodies\": [";
  for (std::size_t k = 0; k < recording.bodies.size(); ++k) {
    const recording::Body& body = recording.bodies[k];
    text += std::string(k > 0 ? "," : "") + "\n    {\"obj_id\": " + std::to_string(body.object_id) +
            ", \"name\": " + quoted(body.name) + ", \"mesh\": " + quoted(model_file(body.object_id).generic_string());
    if (body.role) {
      text += ", \"role\": " + quoted(std::string(recording::role_name(*body.role)));
    }
    text += "}";
  }
  const recording::Liquid& liquid = recording.liquid;
  text += "\n  ],\n  \"liquid\": {\"name\": " + quoted(liquid.name) + ", \"density\": " + number_text(liquid.density) +
          ", \"viscosity\": " + number_text(liquid.viscosity) +
          ", \"surface_tension\": " + number_text(liquid.surface_tension);
  if (liquid.initial) {
    expects(liquid.initial->body < recording.bodies.size(), "Recording: body of the initial liquid",
            "below the number of bodies", liquid.initial->body);
    text += ",\n    \"initial\": {\"body\": " + quoted(recording.bodies[liquid.initial->body].name);
    if (liquid.initial->fill_fraction) {
      text += ", \"fill_fraction\": " + number_text(*liquid.initial->fill_fraction);
    }
    if (liquid.initial->volume) {
      text += ", \"volume_ml\": " + number_text(1e6 * *liquid.initial->volume);
    }
    text += "}";
  }
  if (liquid.inlet) {
    text += ",\n    \"inlet\": {\"position_w_m\": " + json_vector(liquid.inlet->position) +
            ", \"direction_w\": " + json_vector(liquid.inlet->direction) +
            ", \"radius_m\": " + number_text(liquid.inlet->radius) + ", \"flow_ml_s\": [";
    for (std::size_t k = 0; k < liquid.inlet->flow.size(); ++k) {
      const auto& [time, flow] = liquid.inlet->flow[k];
      text += std::string(k > 0 ? ", " : "") + "[" + number_text(time) + ", " + number_text(1e6 * flow) + "]";
    }
    text += "]}";
  }
  text += "}";
  if (const auto& imager = recording.thermal_imager) {
    text += ",\n  \"thermal\": {\"width\": " + std::to_string(imager->width) +
            ", \"height\": " + std::to_string(imager->height) + ", \"threshold\": " + number_text(imager->threshold) +
            ", \"affine_to_image\": [" + json_vector(imager->image_from_thermal.row(0)) + ", " +
            json_vector(imager->image_from_thermal.row(1)) + "]}";
  }
  if (with_timestamps) {
    text += ",\n  \"timestamps_s\": " + json_numbers(recording.timestamps);
  }
  if (!truth.empty()) {
    text += ",\n  \"truth\": " + truth;
  }
  return text + "\n}\n";
}

inline Series series_of(const recording::Measurements& measurements) {
  Series series;
  series.names.emplace_back("t_s");
  series.columns.push_back(measurements.times);
  for (const recording::Channel& channel : measurements.channels) {
    series.names.push_back(channel.name);
    series.columns.push_back(channel.values);
    for (double& value : series.columns.back()) {
      value /= file_unit(channel.quantity);
    }
  }
  return series;
}

}  // namespace detail

/// Writes one recording into a folder of its own. Images are written as they come, recording.json last and in one
/// step: a folder that has one is complete. A writer that is let go before finish() leaves a folder that no reader
/// takes for a recording. What is written reads back as the same numbers, but for rounding where millimetres and
/// metres, matrices and quaternions, or frames of reference change.
class RecordingWriter {
 public:
  /// Makes the folder, which must be new or empty, and writes the meshes. Of `header`, `folder`, `frames`, `timestamps`
  /// and the bodies' `mesh_file` are not looked at. Throws std::invalid_argument where the header breaks the format,
  /// std::runtime_error where files cannot be written.
  RecordingWriter(const std::filesystem::path& folder, Recording header)
      : folder_(folder), recording_(std::move(header)), views_(recording_.cameras.size()) {
    namespace fs = std::filesystem;
    recording_.folder = folder;
    recording_.frames = 0;
    recording_.timestamps.clear();
    check("header", [&] { parse_recording(detail::recording_text(recording_, false, ""), "recording.json"); });
    expects(recording_.bodies.empty() || !recording_.cameras.empty(), "RecordingWriter: number of cameras",
            ">= 1 where there are bodies, whose poses are stored in the camera's frame", recording_.cameras.size());
    expects(recording_.cameras.empty() || recording_.width > 0, "RecordingWriter: width [px]",
            "> 0 where there are cameras", recording_.width);
    set_measurements(std::move(recording_.measurements));
    for (const recording::Body& body : recording_.bodies) {
      validate(body.mesh);
    }
    posed_.resize(recording_.bodies.size(), false);

    std::error_code error;
    if (fs::exists(folder_, error) && !fs::is_empty(folder_, error)) {
      detail::refuse_file(folder_.string(), "a new or an empty folder", "one with files");
    }
    detail::make_folder(folder_ / "models");
    for (const recording::Body& body : recording_.bodies) {
      detail::write_model(folder_ / detail::model_file(body.object_id), body.mesh);
    }
  }

  /// Takes the next frame and writes its images. Throws std::invalid_argument where the frame does not fit the header
  /// (number of bodies and cameras, sizes of images, poses that are not finite, a time not after the last), before
  /// anything is written; std::runtime_error where a file cannot be written.
  void add_frame(const recording::Frame& frame) {
    expects(!finished_, "RecordingWriter: add_frame", "called before finish()", "a call after it");
    const std::size_t number = recording_.frames;
    expects(number < detail::image_limit, "RecordingWriter: number of frames", "at most 1000000", number);
    expects(number == 0 || timed_ == frame.time.has_value(), "RecordingWriter: time of a frame",
            "given for every frame or for none, frame", number);
    const double time = frame.time.value_or(static_cast<double>(number) / recording_.frames_per_second);
    expects(std::abs(time) <= 1e12 && (number == 0 || time > recording_.timestamps.back()),
            "RecordingWriter: time [s] of a frame", "at most 1e12 in size and later than the one before", time);
    expects(frame.bodies.empty() || frame.bodies.size() == recording_.bodies.size(),
            "RecordingWriter: number of poses in a frame", "that of the header's bodies, or 0", frame.bodies.size());
    expects(frame.shots.size() <= recording_.cameras.size(), "RecordingWriter: number of shots in a frame",
            "at most that of the header's cameras", frame.shots.size());
    std::vector<recording::View> views;
    for (std::size_t camera = 0; camera < recording_.cameras.size(); ++camera) {
      const recording::Shot shot = camera < frame.shots.size() ? frame.shots[camera] : recording::Shot{};
      views.push_back(view(shot, camera, number));
      check_shot(shot);
    }
    std::vector<detail::BopInstance> instances;
    for (std::size_t body = 0; body < recording_.bodies.size(); ++body) {
      const std::optional<Pose> pose = body_pose(frame, body, time);
      if (pose) {
        check_pose(*pose, "RecordingWriter: pose of a body", number);
        instances.push_back({recording_.bodies[body].object_id, views.front().camera_from_world * normalized(*pose)});
      }
    }

    for (std::size_t camera = 0; camera < frame.shots.size(); ++camera) {
      write_shot(frame.shots[camera], camera, number);
    }
    for (std::size_t camera = 0; camera < views.size(); ++camera) {
      views_[camera].emplace(number, views[camera]);
    }
    for (std::size_t body = 0; body < posed_.size(); ++body) {
      posed_[body] = posed_[body] || body_pose(frame, body, time).has_value();
    }
    if (!instances.empty()) {
      instances_.emplace(number, std::move(instances));
    }
    timed_ = frame.time.has_value();
    recording_.timestamps.push_back(time);
    ++recording_.frames;
  }

  /// Replaces the header's measurements; may be called until finish(). Throws std::invalid_argument where times do not
  /// increase, a channel is of another length, or its name says another quantity or place.
  void set_measurements(recording::Measurements measurements) {
    for (const recording::Channel& channel : measurements.channels) {
      expects(channel.values.size() == measurements.times.size(), "RecordingWriter: number of values in a channel",
              "that of the times", channel.values.size());
    }
    check("measurements", [&] {
      const recording::Measurements back =
          parse_measurements(series_text(detail::series_of(measurements)), "measurements.csv");
      for (std::size_t k = 0; k < measurements.channels.size(); ++k) {
        const recording::Channel& channel = measurements.channels[k];
        if (back.channels[k].name != channel.name || back.channels[k].quantity != channel.quantity ||
            !back.channels[k].place.isApprox(channel.place)) {
          detail::refuse_file("name of a channel", "one that says its quantity and place as the format has it",
                              detail::visible_text(channel.name));
        }
      }
    });
    recording_.measurements = std::move(measurements);
  }

  /// What really happened, as the text of a JSON value, for scoring alone. Throws std::invalid_argument where it is
  /// none.
  void set_truth(const std::string& json) {
    check("truth", [&] { detail::parse_json(json, "truth", 15); });
    truth_ = json;
  }

  /// Writes all that is left and, last, recording.json. Throws std::invalid_argument where a body was never tracked or
  /// there are cameras but no frames, std::runtime_error where a file cannot be written.
  void finish() {
    expects(!finished_, "RecordingWriter: finish", "called once", "a second call");
    expects(recording_.cameras.empty() || recording_.frames > 0, "RecordingWriter: number of frames",
            ">= 1 where there are cameras", recording_.frames);
    for (std::size_t body = 0; body < posed_.size(); ++body) {
      expects(posed_[body], "RecordingWriter: poses of body " + recording_.bodies[body].name, "given once at least", 0);
    }
    for (std::size_t camera = 0; camera < views_.size(); ++camera) {
      const std::filesystem::path inside = folder_ / Recording::camera_folder(camera);
      detail::make_folder(inside);
      detail::write_text_file(inside / "scene_camera.json", detail::scene_camera_text(shortened(views_[camera])));
    }
    if (!recording_.bodies.empty()) {
      detail::write_text_file(folder_ / "scene_gt.json", detail::scene_gt_text(instances_));
    }
    if (!recording_.measurements.channels.empty()) {
      write_series(folder_ / "measurements.csv", detail::series_of(recording_.measurements));
    }
    const std::filesystem::path part = folder_ / "recording.json.part";
    detail::write_text_file(part, detail::recording_text(recording_, timed_, truth_));
    std::error_code error;
    std::filesystem::rename(part, folder_ / "recording.json", error);
    if (error) {
      throw std::runtime_error((folder_ / "recording.json").string() + ": cannot be written: " + error.message());
    }
    finished_ = true;
  }

  std::size_t frames() const { return recording_.frames; }

 private:
  // What a reader would refuse is a mistake of the caller's here.
  template <class Call>
  static void check(const char* what, Call&& call) {
    try {
      call();
    } catch (const std::runtime_error& error) {
      throw std::invalid_argument(std::string("RecordingWriter: ") + what + ": " + error.what());
    } catch (const nlohmann::json::exception& error) {  // text that is not UTF-8
      throw std::invalid_argument(std::string("RecordingWriter: ") + what + ": " + error.what());
    }
  }

  // A quarter of what the reader takes, so that a body far from a far camera still fits.
  static void check_pose(const Pose& pose, const char* what, std::size_t number) {
    expects(pose.finite() && std::abs(pose.rotation.norm() - 1) < 1e-3 && pose.translation.norm() <= 2.5e4, what,
            "finite, within 2.5e4 m, with a quaternion of norm 1, in frame", number);
  }

  static Pose normalized(const Pose& pose) { return {pose.rotation.normalized(), pose.translation}; }

  std::optional<Pose> body_pose(const recording::Frame& frame, std::size_t body, double time) const {
    if (!frame.bodies.empty()) {
      return frame.bodies[body];
    }
    const PoseTrack& motion = recording_.bodies[body].motion;
    return motion.samples().empty() ? std::nullopt : std::optional<Pose>(motion.at(time));
  }

  recording::View view(const recording::Shot& shot, std::size_t camera, std::size_t number) const {
    const recording::Camera& known = recording_.cameras[camera];
    expects(shot.view || known.fixed() || number < known.views.size(), "RecordingWriter: view of a camera",
            "in the frame where the header has none, frame", number);
    recording::View view = shot.view ? *shot.view : known.view(number);
    check_pose(view.camera_from_world, "RecordingWriter: pose of a camera", number);
    view.camera_from_world = normalized(view.camera_from_world);
    expects(view.fx > 0 && view.fx <= 1e7, "RecordingWriter: fx [px]", "> 0 and at most 1e7", view.fx);
    expects(view.fy > 0 && view.fy <= 1e7, "RecordingWriter: fy [px]", "> 0 and at most 1e7", view.fy);
    expects(std::abs(view.cx) <= 1e7, "RecordingWriter: cx [px]", "at most 1e7 in size", view.cx);
    expects(std::abs(view.cy) <= 1e7, "RecordingWriter: cy [px]", "at most 1e7 in size", view.cy);
    for (const double coefficient : view.distortion) {
      expects(std::abs(coefficient) <= 1e6, "RecordingWriter: distortion", "at most 1e6 in size", coefficient);
    }
    return view;
  }

  void check_shot(const recording::Shot& shot) const {
    const auto check_size = [](const auto& image, int width, int height, const std::string& what) {
      expects(image.cols() == width, "RecordingWriter: width [px] of a " + what, std::to_string(width), image.cols());
      expects(image.rows() == height, "RecordingWriter: height [px] of a " + what, std::to_string(height),
              image.rows());
    };
    if (shot.mask) {
      check_size(*shot.mask, recording_.width, recording_.height, "mask");
    }
    if (shot.thermal) {
      expects(recording_.thermal_imager.has_value(), "RecordingWriter: thermal_imager",
              "in the header where there are thermal images", "none");
      check_size(*shot.thermal, recording_.thermal_imager->width, recording_.thermal_imager->height, "thermal image");
    }
  }

  void write_shot(const recording::Shot& shot, std::size_t camera, std::size_t number) const {
    const auto write = [&](const char* kind, const auto& image) {
      const std::filesystem::path inside = folder_ / Recording::camera_folder(camera) / kind;
      detail::make_folder(inside);
      write_png(inside / (detail::six_digits(number) + ".png"), image);
    };
    if (shot.mask) {
      write("mask_liquid", *shot.mask);
    }
    if (shot.thermal) {
      write("thermal", *shot.thermal);
    }
    if (shot.rgb) {
      write("rgb", *shot.rgb);
    }
  }

  // Frame 0 alone where the camera stood still.
  static detail::ByImage<recording::View> shortened(const detail::ByImage<recording::View>& views) {
    const recording::View& first = views.begin()->second;
    for (const auto& [frame, view] : views) {
      const bool same = view.fx == first.fx && view.fy == first.fy && view.cx == first.cx && view.cy == first.cy &&
                        view.distortion == first.distortion &&
                        view.camera_from_world.translation == first.camera_from_world.translation &&
                        view.camera_from_world.rotation.coeffs() == first.camera_from_world.rotation.coeffs();
      if (!same) {
        return views;
      }
    }
    return {{0, first}};
  }

  std::filesystem::path folder_;
  Recording recording_;
  std::vector<detail::ByImage<recording::View>> views_;
  detail::ByImage<std::vector<detail::BopInstance>> instances_;
  std::vector<bool> posed_;
  std::string truth_;
  bool timed_ = false;
  bool finished_ = false;
};

/// Writes a whole recording, images and all, into another folder, e.g. after its header was edited. Poses are those at
/// the frames' times. @param truth JSON text, or empty. Throws as RecordingWriter does, and where images cannot be
/// read.
inline void write_recording(const std::filesystem::path& folder, const Recording& recording,
                            const std::string& truth = {}) {
  RecordingWriter writer(folder, recording);
  if (!truth.empty()) {
    writer.set_truth(truth);
  }
  bool regular = true;
  for (std::size_t frame = 0; frame < recording.frames; ++frame) {
    regular = regular && recording.timestamps[frame] == static_cast<double>(frame) / recording.frames_per_second;
  }
  for (std::size_t frame = 0; frame < recording.frames; ++frame) {
    recording::Frame next;
    if (!regular) {
      next.time = recording.timestamps[frame];
    }
    for (std::size_t camera = 0; camera < recording.cameras.size(); ++camera) {
      next.shots.push_back({std::nullopt, recording.mask(frame, camera), recording.thermal(frame, camera),
                            recording.rgb(frame, camera)});
    }
    writer.add_frame(next);
  }
  writer.finish();
}

}  // namespace decant::inline DECANT_TARGET
