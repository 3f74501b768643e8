// SPDX-License-Identifier: MIT
// libFuzzer target: any bytes as the text files of a recording end in values that make sense or in std::runtime_error
// of one line. The input holds recording.json, scene_camera.json, scene_gt.json and measurements.csv in this order with
// a line `%%` between them; where the first one is bad, the others are tried with a recording that is not. Build with
// clang++ -fsanitize=fuzzer,address,undefined; seeds are in corpus/recording.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include <decant/io/recording_reader.hpp>

#include "survive.hpp"

namespace {

// What comes before the next divider, which is cut off.
std::string_view next_part(std::string_view& rest) {
  constexpr std::string_view divider = "\n%%\n";
  const std::size_t end = rest.find(divider);
  const std::string_view part = rest.substr(0, end);
  rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + divider.size());
  return part;
}

decant::Recording good() {
  decant::Recording recording;
  recording.frames = 3;
  recording.timestamps = {0, 0.1, 0.2};
  recording.bodies.resize(2);
  recording.bodies[0].object_id = 1;
  recording.bodies[1].object_id = 2;
  return recording;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  const std::string_view header = next_part(rest), camera = next_part(rest), poses = next_part(rest);
  decant::Recording recording = good();
  survive([&] {
    decant::Recording parsed = decant::parse_recording(header, "recording.json");
    require(parsed.timestamps.size() == parsed.frames);
    if (parsed.frames < 1000) {  // a million frames would only slow the search
      recording = std::move(parsed);
    }
  });
  survive([&] {
    decant::detail::add_camera(recording, camera, "scene_camera.json");
    require(recording.cameras.size() == 1);
    for (const auto& view : recording.cameras[0].views) {
      require(view.fx > 0 && view.fy > 0 && view.camera_from_world.finite());
    }
  });
  if (recording.cameras.empty()) {
    recording.cameras.resize(1);
    recording.cameras[0].views.resize(1);
  }
  survive([&] {
    decant::detail::read_motions(recording, poses, "scene_gt.json");
    for (const auto& body : recording.bodies) {
      const decant::Pose pose = body.motion.at(0.05);
      require(pose.finite() && std::abs(pose.rotation.norm() - 1) < 1e-9);
    }
  });
  survive([&] {
    const auto measurements = decant::parse_measurements(rest, "measurements.csv");
    for (const auto& channel : measurements.channels) {
      require(channel.values.size() == measurements.times.size() && channel.place.allFinite());
    }
  });
  return 0;
}
