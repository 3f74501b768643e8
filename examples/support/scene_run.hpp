// SPDX-License-Identifier: MIT
#pragma once

/// Runs a Scene: sets it up in the simulator that it names, steps it, reads the gauges, keeps pictures and VTK files.
/// Shared by the tools simulate and replay_motion; compiled once per composition (run_*.cpp).

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <decant/io/report.hpp>
#include <decant/io/scene.hpp>
#include <decant/io/series_file.hpp>

namespace example {

/// What a run is to leave behind besides its series.
struct RunOptions {
  int threads = 0;                                  ///< 0: all
  std::optional<std::filesystem::path> vtk_folder;  ///< VTK files go there
  double vtk_rate = 60;                             ///< at most so many per second [Hz]
  bool pictures = false;
  int most_pictures = 80;
  int picture_width = 560;                          ///< [px]
  /// Pictures travel with this body, as a camera on it would; else they are of the world.
  std::optional<std::size_t> pictures_follow;
  /// Also records the liquid's centre of mass in this body's frame: columns center_x_mm, center_y_mm.
  std::optional<std::size_t> center_in;
};

/// What a run came to.
struct RunResult {
  decant::Series series;            ///< t_s, then the gauges as they are named
  std::vector<decant::HtmlReport::Frame> pictures;
  std::vector<std::string> notes;   ///< about meshes and fillings, one line each
  std::string status = "ok";        ///< or why it ended early
  long particles = 0, lost = 0, spilled = 0;
  long sub_steps = 0, iterations = 0, unconverged_frames = 0;
  double density_error_max = 0;     ///< [-]
  double volume = 0;                ///< [m^3]
  double fastest = 0;               ///< of the particles, at recorded instants [m/s]
  double set_up_seconds = 0, step_seconds = 0;
};

/// Sets the scene up in the composition that it names and runs it. Throws std::invalid_argument or std::runtime_error,
/// one line, if the scene cannot be set up; a run that fails later says so in the result's status.
RunResult run_composition(const decant::Scene& scene, const RunOptions& options);

RunResult run_default(const decant::Scene& scene, const RunOptions& options);

/// The most memory that this process has had [MB].
double peak_memory_mb();

}  // namespace example
