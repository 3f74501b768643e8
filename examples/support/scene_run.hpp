// SPDX-License-Identifier: MIT
#pragma once

/// Runs a Scene with a simulator of the caller's choice: steps it, reads the gauges, keeps pictures and VTK files.
/// Shared by the tools simulate and replay_motion.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <sys/resource.h>

#include <decant/boundary/cavity.hpp>
#include <decant/core/fluid_state.hpp>
#include <decant/io/liquid_picture.hpp>
#include <decant/io/png.hpp>
#include <decant/io/progress.hpp>
#include <decant/io/report.hpp>
#include <decant/io/scene.hpp>
#include <decant/io/series_file.hpp>
#include <decant/io/vtk.hpp>
#include <decant/simulation/gauges.hpp>
#include <decant/simulation/simulator.hpp>

#include "scene_simulator.hpp"
#include "stands_within.hpp"

namespace example {

/// What a run is to leave behind besides its series.
struct RunOptions {
  int threads = 0;                                  ///< 0: all
  std::optional<std::filesystem::path> vtk_folder;  ///< VTK files go there
  double vtk_rate = 60;                             ///< at most so many per second [Hz]
  bool pictures = false;
  int most_pictures = 80;
  int picture_width = 560;  ///< [px]
  /// Pictures travel with this body, as a camera on it would; else they are of the world.
  std::optional<std::size_t> pictures_follow;
  /// Also records the liquid's centre of mass in this body's frame: columns center_x_mm, center_y_mm.
  std::optional<std::size_t> center_in;
};

/// What a run came to.
struct RunResult {
  decant::Series series;  ///< t_s, then the gauges as they are named
  std::vector<decant::HtmlReport::Frame> pictures;
  std::vector<std::string> notes;     ///< about fillings, one line each
  std::vector<std::string> warnings;  ///< about meshes, one line each; also printed to stderr
  std::string status = "ok";          ///< or why it ended early
  long particles = 0, lost = 0, spilled = 0;
  long sub_steps = 0, iterations = 0, unconverged_frames = 0;
  double density_error_max = 0;  ///< [-]
  double volume = 0;             ///< [m^3]
  double fastest = 0;            ///< of the particles, at recorded instants [m/s]
  double set_up_seconds = 0, step_seconds = 0;
};

namespace detail {

/// The most memory that this process has had [MB].
inline double peak_memory_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
#if defined(__APPLE__)
  return static_cast<double>(usage.ru_maxrss) / 1e6;  // bytes there, kilobytes elsewhere
#else
  return static_cast<double>(usage.ru_maxrss) / 1e3;
#endif
}

/// One scene in one simulator.
template <class Parts>
class SceneRun {
 public:
  using Scalar = typename Parts::Scalar;

  SceneRun(const decant::Scene& scene, const RunOptions& options)
      : scene_(scene),
        options_(options),
        set_up_(set_up_scene<Parts>(
            scene, settings(), 1,
            [](const std::string& warning) { std::fprintf(stderr, "warning: %s\n", warning.c_str()); })),
        simulator_(set_up_.simulator),
        gauges_(scene.spacing),
        prepared_(scene.bodies.size()) {
    result_.notes = set_up_.notes;
    result_.warnings = set_up_.warnings;
    prepare_gauges();
    if (options.vtk_folder) {
      vtk_.emplace(*options.vtk_folder);
    }
    if (options.pictures) {
      set_up_pictures();
    }
    result_.set_up_seconds = seconds_since(begin_);
  }

  /// Steps to the scene's end or to the first frame that fails.
  RunResult run() {
    const auto samples = static_cast<long>(std::floor(scene_.end * scene_.record_rate + 1e-6));
    decant::Progress progress(scene_.name, scene_.end);
    record(0);
    for (long k = 1; k <= samples; ++k) {
      const double time = static_cast<double>(k) / scene_.record_rate;
      const auto begin = Clock::now();
      const decant::StepReport report = simulator_.step(std::max(0.0, time - simulator_.time()));
      result_.step_seconds += seconds_since(begin);
      result_.sub_steps += report.sub_steps;
      result_.iterations += report.density_iterations + report.divergence_iterations;
      result_.density_error_max = std::max(result_.density_error_max, report.density_error);
      result_.unconverged_frames += report.status == decant::StepStatus::NotConverged ? 1 : 0;
      result_.lost = static_cast<long>(report.lost + report.non_finite);
      if (!report.advanced()) {
        result_.status = std::string(to_string(report.status)) + " in the frame that ends at " +
                         decant::detail::fixed_text(time, 4) + " s";
        break;
      }
      record(k);
      progress.update(time, std::to_string(simulator_.fluid().size()) + " particles");
    }
    result_.particles = static_cast<long>(simulator_.fluid().size());
    result_.volume = simulator_.fluid().mass.template cast<double>().sum() / scene_.liquid.density;
    result_.spilled = spilled();
    if (vtk_) {
      vtk_->finish();
    }
    return std::move(result_);
  }

  const decant::Simulator<Parts>& simulator() const { return simulator_; }

 private:
  using Clock = std::chrono::steady_clock;

  struct Prepared {
    std::optional<decant::Cavity> cavity;
    double level_at_start = std::numeric_limits<double>::quiet_NaN();  // for top_mm, in the body's frame [m]
  };

  static double seconds_since(Clock::time_point begin) {
    return std::chrono::duration<double>(Clock::now() - begin).count();
  }

  decant::SimulatorSettings settings() const {
    decant::SimulatorSettings settings = simulator_settings(scene_);
    settings.threads.count = options_.threads;
    return settings;
  }

  decant::BodyId id(std::size_t body) const { return static_cast<decant::BodyId>(body); }
  decant::Pose pose_of(std::size_t body) const { return simulator_.bodies()[id(body)].motion.at(simulator_.time()); }

  // Which way is up in a body that stands as it does now.
  decant::Vector3<double> up_in(std::size_t body) const {
    return pose_of(body).rotation.conjugate() * up_of(scene_.gravity);
  }

  void prepare_gauges() {
    result_.series.names.push_back("t_s");
    for (const decant::scene::Gauge& gauge : scene_.gauges) {
      if (const auto* force = std::get_if<decant::scene::ForceGauge>(&gauge.kind)) {
        for (const char* axis : {"x", "y", "z"}) {
          result_.series.names.push_back(std::string("force_n_") + axis + "@" + scene_.bodies[force->body].name);
        }
      } else {
        result_.series.names.push_back(gauge.name);
      }
    }
    if (options_.center_in) {
      result_.series.names.push_back("center_x_mm");
      result_.series.names.push_back("center_y_mm");
    }
    result_.series.columns.resize(result_.series.names.size());
    // what a container holds is asked of the way up it starts with
    for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
      if (scene_.bodies[b].container()) {
        decant::Cavity cavity(simulator_.bodies()[id(b)].surface, up_in(b));
        if (!cavity.empty()) {
          prepared_[b].cavity.emplace(std::move(cavity));
        }
      }
    }
  }

  void record(long sample) {
    const double time = simulator_.time();
    const double none = std::numeric_limits<double>::quiet_NaN();
    std::vector<double> row{time};
    gauges_.observe(simulator_.fluid(), {options_.threads});
    for (const decant::scene::Gauge& gauge : scene_.gauges) {
      if (const auto* level = std::get_if<decant::scene::LevelGauge>(&gauge.kind)) {
        const auto height = gauges_.level(
            level->x, level->y, [this](const auto& x) { return stands_within(simulator_, x, 1.5 * scene_.spacing); });
        row.push_back(height ? 1e3 * *height : none);
      } else if (std::holds_alternative<decant::scene::FrontGauge>(gauge.kind)) {
        const auto front = gauges_.front();
        row.push_back(front ? 1e3 * *front : none);
      } else if (const auto* pressure = std::get_if<decant::scene::PressureGauge>(&gauge.kind)) {
        row.push_back(sample > 0 ? gauges_.pressure(pressure->point) : none);  // none is known before the first step
      } else if (const auto* volume = std::get_if<decant::scene::VolumeGauge>(&gauge.kind)) {
        const auto& cavity = prepared_[volume->body].cavity;
        row.push_back(cavity ? 1e6 * gauges_.volume_in(*cavity, pose_of(volume->body)) : 0.0);
      } else if (const auto* force = std::get_if<decant::scene::ForceGauge>(&gauge.kind)) {
        const decant::Vector3<double> total = simulator_.pressure_force_on(id(force->body));
        for (int axis = 0; axis < 3; ++axis) {
          row.push_back(sample > 0 ? total[axis] : none);
        }
      } else if (const auto* top = std::get_if<decant::scene::TopGauge>(&gauge.kind)) {
        const auto height = gauges_.top(pose_of(top->body), simulator_.bodies()[id(top->body)].bounds);
        Prepared& prepared = prepared_[top->body];
        if (sample == 0 && height) {
          prepared.level_at_start = *height;
        }
        row.push_back(height ? 1e3 * (*height - prepared.level_at_start) : none);
      }
    }
    if (options_.center_in) {
      decant::Vector3<double> center = decant::Vector3<double>::Constant(none);
      if (simulator_.fluid().size() > 0) {
        center = simulator_.fluid().position.template cast<double>().rowwise().mean();
      }
      center = pose_of(*options_.center_in).inverse() * center;
      row.push_back(1e3 * center.x());
      row.push_back(1e3 * center.y());
    }
    for (std::size_t k = 0; k < row.size(); ++k) {
      result_.series.columns[k].push_back(row[k]);
    }
    if (simulator_.fluid().size() > 0) {
      result_.fastest =
          std::max(result_.fastest, static_cast<double>(simulator_.fluid().velocity.colwise().norm().maxCoeff()));
    }
    if (vtk_ && time >= next_vtk_ - 1e-9) {
      next_vtk_ = time + 1 / options_.vtk_rate;
      vtk_->add_particles(time, simulator_.fluid());
      for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
        vtk_->add_body(time, b, scene_.bodies[b].name, simulator_.bodies()[id(b)].shape->mesh, pose_of(b),
                       scene_.bodies[b].moving);
      }
    }
    if (painter_ && time >= next_picture_ - 1e-9) {
      next_picture_ = time + std::max(scene_.end / options_.most_pictures, 1 / scene_.record_rate);
      paint(time);
    }
  }

  // Particles that are in no container, where there is one.
  long spilled() const {
    bool any = false;
    long outside = 0;
    std::vector<decant::Pose> body_from_world;
    for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
      any = any || prepared_[b].cavity.has_value();
      body_from_world.push_back(pose_of(b).inverse());
    }
    for (decant::Index i = 0; any && i < simulator_.fluid().size(); ++i) {
      const decant::Vector3<double> x = simulator_.fluid().position.col(i).template cast<double>();
      bool inside = false;
      for (std::size_t b = 0; b < scene_.bodies.size() && !inside; ++b) {
        inside = prepared_[b].cavity && prepared_[b].cavity->contains(body_from_world[b] * x);
      }
      outside += inside ? 0 : 1;
    }
    return outside;
  }

  void set_up_pictures() {
    Eigen::AlignedBox3d box;
    const bool follow = options_.pictures_follow.has_value();
    for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
      bodies_.emplace_back(simulator_.bodies()[id(b)].shape->mesh);
      if (follow && b == *options_.pictures_follow) {
        box.extend(simulator_.bodies()[id(b)].bounds);
      }
      for (int k = 0; !follow && k <= (scene_.bodies[b].moving ? 20 : 0); ++k) {
        const decant::Pose pose = simulator_.bodies()[id(b)].motion.at(scene_.end * k / 20);
        for (int corner = 0; corner < 8; ++corner) {
          const auto type = static_cast<Eigen::AlignedBox3d::CornerType>(corner);
          box.extend(pose * decant::Vector3<double>(simulator_.bodies()[id(b)].bounds.corner(type)));
        }
      }
    }
    if (box.isEmpty()) {
      for (decant::Index i = 0; i < simulator_.fluid().size(); ++i) {
        box.extend(decant::Vector3<double>(simulator_.fluid().position.col(i).template cast<double>()));
      }
    }
    if (box.isEmpty() || !(box.diagonal().norm() > 0)) {
      return;
    }
    // from the front, a little from the right and from above
    const decant::Vector3<double> up =
        follow ? decant::Vector3<double>(decant::Vector3<double>::UnitZ()) : up_of(scene_.gravity);
    const decant::Vector3<double> across = std::abs(up.x()) < 0.9
                                               ? decant::Vector3<double>(decant::Vector3<double>::UnitX())
                                               : decant::Vector3<double>(decant::Vector3<double>::UnitY());
    const decant::Vector3<double> away = up.cross(across).normalized();
    const decant::Vector3<double> right = away.cross(up);
    const decant::Vector3<double> direction = away - 0.35 * right - 0.4 * up;
    // a long tank gets a long picture
    const double shape = std::abs(box.sizes().dot(up)) / box.sizes().dot(right.cwiseAbs());
    const int height = static_cast<int>(options_.picture_width * std::clamp(1.2 * shape + 0.1, 0.35, 0.9));
    painter_.emplace(decant::PictureView::around(box, direction, up, options_.picture_width, height));
  }

  void paint(double time) {
    const auto& fluid = simulator_.fluid();
    decant::PointArray<double> places = fluid.position.template cast<double>();
    decant::Pose view_from_world;
    if (options_.pictures_follow) {
      view_from_world = pose_of(*options_.pictures_follow).inverse();
      for (decant::Index i = 0; i < places.cols(); ++i) {
        places.col(i) = view_from_world * decant::Vector3<double>(places.col(i));
      }
    }
    // light where the liquid is fast against the fall from the height of the scene
    std::vector<decant::LiquidPainter::PlacedBody> placed;
    decant::ScalarArray<double> shade(places.cols());
    decant::RigidVelocity frame;
    if (options_.pictures_follow) {
      frame = simulator_.bodies()[id(*options_.pictures_follow)].motion.velocity(time, 1e-3);
    }
    for (decant::Index i = 0; i < places.cols(); ++i) {
      const decant::Vector3<double> x = fluid.position.col(i).template cast<double>();
      const decant::Vector3<double> v = fluid.velocity.col(i).template cast<double>() - frame.at(x);
      shade[i] = std::min(1.0, 0.15 + 0.85 * v.norm() / shade_speed());
    }
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      placed.push_back({&bodies_[b], view_from_world * pose_of(b)});
    }
    result_.pictures.push_back({time, decant::png_bytes(painter_->draw(places, 0.75 * scene_.spacing, shade, placed))});
  }

  double shade_speed() const { return options_.pictures_follow ? 1.0 : 2.0; }  // [m/s]

  Clock::time_point begin_ = Clock::now();
  decant::Scene scene_;
  RunOptions options_;
  SceneSetUp<Parts> set_up_;
  decant::Simulator<Parts>& simulator_;  // of set_up_
  decant::Gauges<Scalar> gauges_;
  RunResult result_;
  std::vector<Prepared> prepared_;
  std::optional<decant::VtkSequence> vtk_;
  double next_vtk_ = 0, next_picture_ = 0;
  std::vector<decant::PictureBody> bodies_;
  std::optional<decant::LiquidPainter> painter_;
};

}  // namespace detail

/// Sets the scene up and runs it. Throws std::invalid_argument or std::runtime_error, one line, if the scene cannot be
/// set up; a run that fails later says so in the result's status.
template <class Parts>
RunResult run_scene(const decant::Scene& scene, const RunOptions& options) {
  detail::SceneRun<Parts> run(scene, options);
  return run.run();
}

}  // namespace example
