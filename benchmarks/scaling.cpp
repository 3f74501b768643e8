// SPDX-License-Identifier: MIT
/// How time and memory grow: with particles, cameras, pixels, triangles, hypotheses, and simulations in processes of
/// their own. Each figure is measured at several sizes, which take turns, and comes with the exponent of the power law
/// that fits its medians best: 1 is in proportion, 0 does not depend on it. Runs are processes of their own, so that
/// peaks of memory are theirs.

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <deque>
#include <exception>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <decant/decant.hpp>

#include "child_process.hpp"
#include "common.hpp"
#include "cup_simulations.hpp"
#include "inputs.hpp"

namespace {

using namespace decant_benchmark;
using namespace decant;
using Model = LiquidSimulator;
using Point = Vector3<double>;

// ---- growth ---------------------------------------------------------------------------------------------------------

/// Exponent e of value = factor size^e: the line of least squares through logarithms. All above zero, two or more
/// sizes.
double fitted_exponent(const std::vector<std::pair<double, double>>& size_and_value) {
  double mean_x = 0, mean_y = 0, xx = 0, xy = 0;
  const double count = static_cast<double>(size_and_value.size());
  for (const auto& [size, value] : size_and_value) {
    mean_x += std::log(size) / count;
    mean_y += std::log(value) / count;
  }
  for (const auto& [size, value] : size_and_value) {
    xx += (std::log(size) - mean_x) * (std::log(size) - mean_x);
    xy += (std::log(size) - mean_x) * (std::log(value) - mean_y);
  }
  return xy / xx;
}

/// How figures grow with one quantity.
class Growth {
 public:
  struct Figure {
    std::string name, unit;
    bool fitted;                                    ///< whether its exponent is of interest
    std::map<long, std::vector<double>> of_size{};  ///< samples

    void add(long size, double sample) { of_size[size].push_back(sample); }
  };

  /// @param title what sizes count, such as "particles".
  Growth(Report& report, std::string title, int threads)
      : report_(report), title_(std::move(title)), threads_(threads) {}

  Figure& figure(std::string name, std::string unit, bool fitted = true) {
    return figures_.emplace_back(Figure{std::move(name), std::move(unit), fitted});
  }

  /// @param fit_from,fit_to smaller and larger sizes are left out of exponents.
  void write(long fit_from = 0, long fit_to = std::numeric_limits<long>::max()) const {
    report_.heading(title_, figures_.front().of_size.rbegin()->first, threads_);
    for (const Figure& figure : figures_) {
      std::vector<std::pair<double, double>> points;
      for (const auto& [size, samples] : figure.of_size) {
        const Spread value(samples);
        add(figure.name + " (" + std::to_string(size) + ")", size, value, figure.unit);
        if (size >= fit_from && size <= fit_to && value.median > 0) {  // memory of a few pages may come out as none
          points.emplace_back(static_cast<double>(size), value.median);
        }
      }
      if (figure.fitted && points.size() > 1) {
        char note[96];
        std::snprintf(note, sizeof note, "fitted over %.0f to %.0f %s; %.2f between the last two", points.front().first,
                      points.back().first, title_.c_str(), fitted_exponent({*(points.end() - 2), points.back()}));
        add(figure.name + ", exponent", figure.of_size.rbegin()->first, fitted_exponent(points), "", note);
      }
    }
  }

 private:
  void add(const std::string& name, long size, Spread value, const std::string& unit, std::string note = "") const {
    report_.add(
        title_,
        {.name = name, .size = size, .threads = threads_, .value = value, .unit = unit, .note = std::move(note)});
  }

  Report& report_;
  std::string title_;
  int threads_;
  std::deque<Figure> figures_{};  // references to figures stay valid
};

/// What the command line says, for all cases.
struct Plan {
  int threads, repetitions;
  bool quick;
  double seconds;  ///< least time of a sample that is short [s]

  Plan(const Options& options, const Report& report)
      : threads(options.numbers("threads").front()),
        repetitions(options.is_on("quick") ? 1 : options.numbers("repetitions").front()),
        quick(options.is_on("quick")),
        seconds((options.is_on("quick") ? 0.2 : 1) * report.seconds()) {}

  /// In ascending order; for a first look the largest is left out.
  std::vector<int> sizes(const Options& options, const std::string& name) const {
    std::vector<int> all = options.numbers(name);
    std::sort(all.begin(), all.end());
    if (quick && all.size() > 2) {
      all.pop_back();
    }
    return all;
  }
};

double median(const std::vector<double>& samples) { return Spread(samples).median; }

/// What a child process holds that does nothing [MB]. Gives freed memory back first: children would fill it again, and
/// seem to take less than they do.
double memory_of_nothing() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
  return in_child_process([] { return 0; }).peak_mb;
}

// ---- particles ------------------------------------------------------------------------------------------------------

constexpr double spacing = 0.005;  // [m]

/// A cube of per_edge^3 particles of water in the corner of a closed box, where it collapses: as in whole_step.cpp.
Model collapsing_cube(int per_edge, int threads) {
  SimulatorSettings settings;
  settings.spacing = spacing;
  settings.liquid = {1000, 1e-3, 0};
  settings.gravity = {0, -9.81, 0};
  settings.threads = {threads};
  Model model(settings);
  const int n = per_edge;
  model.add_body("box", BoxInside{{0, 0, 0}, spacing * Point(3 * n, 2 * n, n + 1), 0.01, {}});
  PointArray<float> position(3, n * n * n);
  for (int i = 0; i < n * n * n; ++i) {
    position.col(i) = (spacing * Point(i / n / n + 1, i / n % n + 1, i % n + 1)).cast<float>();
  }
  model.add_particles(position, PointArray<float>::Zero(3, position.cols()), 0);
  return model;
}

/// Sums over sub-steps.
struct Steps {
  double sub_steps = 0, iterations = 0, pressure_ms = 0;
};

/// Throws std::runtime_error if the simulation stops.
Steps advance(Model& model, double duration) {
  constexpr double frame = 0.005;  // [s]
  Steps steps;
  for (const double end = model.time() + duration; model.time() < end - 1e-9;) {
    const StepReport report = model.step(std::min(frame, end - model.time()));
    if (!report.advanced()) {
      throw std::runtime_error("the simulation stopped: " + std::string(to_string(report.status)));
    }
    steps.sub_steps += report.sub_steps;
    steps.iterations += report.density_iterations + report.divergence_iterations;
    steps.pressure_ms += report.times.pressure_ms;
  }
  return steps;
}

constexpr double warm_up = 0.02;  // simulated until buffers have grown, sub-steps too, and the floor bears the cube [s]

/// Of a sub-step.
struct CubeTimes {
  double all_ms, iterations, iteration_ms, rest_ms;
};

/// The same simulated time for all sizes; small cubes do it again and again.
CubeTimes time_cube(int per_edge, double simulated, const Plan& plan) {
  std::vector<double> all, iterations, iteration, rest;
  const auto start = std::chrono::steady_clock::now();
  do {
    Model model = collapsing_cube(per_edge, plan.threads);
    advance(model, warm_up);
    Steps steps;
    const double took_ms = 1e3 * seconds_of([&] { steps = advance(model, simulated); });
    all.push_back(took_ms / steps.sub_steps);
    iterations.push_back(steps.iterations / steps.sub_steps);
    iteration.push_back(steps.pressure_ms / steps.iterations);
    rest.push_back((took_ms - steps.pressure_ms) / steps.sub_steps);
  } while (std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() < plan.seconds);
  return {median(all), median(iterations), median(iteration), median(rest)};
}

void measure_particles(const Options& options, Report& report) {
  const Plan plan(options, report);
  Growth growth(report, "particles", plan.threads);
  auto& all = growth.figure("sub-step", "ms");
  auto& iterations = growth.figure("pressure iterations", "");
  auto& iteration = growth.figure("pressure, an iteration", "ms");
  auto& rest = growth.figure("sub-step without pressure", "ms");
  auto& memory = growth.figure("memory", "MB");
  auto& bytes = growth.figure("memory of a particle", "bytes", false);
  for (int repetition = 0; repetition < plan.repetitions; ++repetition) {
    const double nothing = memory_of_nothing();
    for (const int per_edge : plan.sizes(options, "particles")) {
      const auto run = in_child_process([&] { return time_cube(per_edge, 1e-3 * options.number("simulated"), plan); });
      const long count = static_cast<long>(per_edge) * per_edge * per_edge;
      all.add(count, run.value.all_ms);
      iterations.add(count, run.value.iterations);
      iteration.add(count, run.value.iteration_ms);
      rest.add(count, run.value.rest_ms);
      memory.add(count, run.peak_mb - nothing);
      bytes.add(count, 1e6 * (run.peak_mb - nothing) / static_cast<double>(count));
    }
  }
  growth.write();
}

// ---- cameras and pixels ---------------------------------------------------------------------------------------------

using ModelTracker = Tracker<Model, SilhouetteCorrector<>>;

constexpr double frame_time = 1.0 / 30;  // [s]
constexpr int first_frames = 2;          // in which buffers grow

/// A cup that stands, 80 % full. On one thread, as child processes follow.
Model filled_cup(double particle_spacing) {
  Model model(tracking_settings(particle_spacing, 1));
  const BodyId body = model.add_body("cup", Cup{});
  fill(model, body, FillAmount::fraction(0.8));
  return model;
}

/// One of so many cameras around the cup, which look into it from 0.4 m away, so high that the rim hides little.
Pose camera_around(int number, int count) {
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(2.5, Point::UnitX()) *
                                    Eigen::AngleAxisd(0.3 + 2 * 3.14159265358979 * number / count, Point::UnitZ()));
  return {rotation, Point(0, 0, 0.4) - rotation * Point(0, 0, 0.07)};
}

/// Its image is four thirds as wide as it is high; the cup takes a quarter of the width, whatever that is.
DistortedPinholeCamera camera_of(int width) {
  const int height = width * 3 / 4;
  return {PinholeCamera(1.4 * width, 1.4 * width, 0.5 * (width - 1), 0.5 * (height - 1), width, height), {}};
}

/// Masks of all of a tracker's cameras as they would be if its liquid were 2 mm (at 640 x 480 some 6 px) away along x,
/// one way and the other, in turns: so that each frame has something to correct.
class ShiftingMasks {
 public:
  template <class TrackerType>
  explicit ShiftingMasks(TrackerType& tracker) {
    for (const float shift : {0.002F, -0.002F}) {
      Model model = tracker.model();
      model.fluid().position.row(0).array() += shift;
      std::vector<Mask>& masks = masks_.emplace_back(tracker.cameras());
      std::vector<CameraMask>& views = views_.emplace_back();
      for (std::size_t camera = 0; camera < masks.size(); ++camera) {
        tracker.predict(model, camera, masks[camera]);
        views.push_back({camera, masks[camera]});
      }
    }
  }
  const std::vector<CameraMask>& in_frame(int frame) const { return views_[static_cast<std::size_t>(frame) % 2]; }

 private:
  std::deque<std::vector<Mask>> masks_{};
  std::vector<std::vector<CameraMask>> views_{};
};

/// Medians over frames [ms].
struct FrameTimes {
  double physics, beside, drawing, correction, relaxation;  ///< beside: all of a frame but physics
  double moves;                                             ///< of particles, over all passes of the corrector
};

FrameTimes track_cup(const Model& cup, int cameras, int width, int frames, int threads) {
  TrackerSettings settings;
  settings.threads = {threads};
  ModelTracker tracker(another(cup, cup.snapshot(), threads), {}, settings);
  for (int camera = 0; camera < cameras; ++camera) {
    tracker.add_camera(camera_of(width), camera_around(camera, cameras));
  }
  const ShiftingMasks masks(tracker);
  const double start = tracker.model().time();
  std::array<std::vector<double>, 6> samples;
  for (int frame = 1; frame <= first_frames + frames; ++frame) {
    FrameReport report;
    const double took = 1e3 * seconds_of([&] {
                          report = tracker.track({start + frame * frame_time, {}, masks.in_frame(frame), {}});
                        });
    if (report.status != (cameras > 0 ? FrameStatus::Ok : FrameStatus::Uncorrected)) {
      throw std::runtime_error("a frame is " + std::string(to_string(report.status)));
    }
    if (frame > first_frames) {
      const double values[] = {report.physics_ms,    took - report.physics_ms,
                               report.drawing_ms,    report.correction_ms,
                               report.relaxation_ms, static_cast<double>(report.correction.moved)};
      for (std::size_t k = 0; k < samples.size(); ++k) {
        samples[k].push_back(values[k]);
      }
    }
  }
  return {median(samples[0]), median(samples[1]), median(samples[2]),
          median(samples[3]), median(samples[4]), median(samples[5])};
}

/// How many cameras there are, and how many pixels an image is wide.
struct Views {
  int cameras, width;
  long size;  ///< what is reported as size
};

void measure_views(const Options& options, Report& report, const std::string& title, const std::vector<Views>& all) {
  const Plan plan(options, report);
  const int frames = plan.quick ? 4 : options.numbers("frames").front();
  const Model cup = filled_cup(1e-3 * options.number("spacing"));
  Growth growth(report, title, plan.threads);
  auto& beside = growth.figure("seeing and correcting", "ms");
  auto& drawing = growth.figure("drawing", "ms");
  auto& correction = growth.figure("correction", "ms");
  auto& relaxation = growth.figure("relaxation", "ms");
  auto& physics = growth.figure("physics", "ms", false);
  auto& moves = growth.figure("moves of particles", "", false);
  auto& memory = growth.figure("memory beside the model", "MB");
  for (int repetition = 0; repetition < plan.repetitions; ++repetition) {
    memory_of_nothing();
    const double model_mb =
        in_child_process([&] { return track_cup(cup, 0, 1, frames, plan.threads).physics; }).peak_mb;
    for (const Views& views : all) {
      const auto run =
          in_child_process([&] { return track_cup(cup, views.cameras, views.width, frames, plan.threads); });
      beside.add(views.size, run.value.beside);
      drawing.add(views.size, run.value.drawing);
      correction.add(views.size, run.value.correction);
      relaxation.add(views.size, run.value.relaxation);
      physics.add(views.size, run.value.physics);
      moves.add(views.size, run.value.moves);
      memory.add(views.size, run.peak_mb - model_mb);
    }
  }
  growth.write();
}

void measure_cameras(const Options& options, Report& report) {
  std::vector<Views> all;
  for (const int cameras : Plan(options, report).sizes(options, "cameras")) {
    all.push_back({cameras, 640, cameras});
  }
  measure_views(options, report, "cameras", all);
}

void measure_pixels(const Options& options, Report& report) {
  std::vector<Views> all;
  for (const int width : Plan(options, report).sizes(options, "widths")) {
    all.push_back({1, width, static_cast<long>(width) * (width * 3 / 4)});
  }
  measure_views(options, report, "pixels", all);
}

// ---- triangles ------------------------------------------------------------------------------------------------------

constexpr Index point_count = 8000;

/// Liquid along the inner side of cup(steps), a third of a spacing to two spacings from the wall: the same for meshes
/// of any fineness.
PointArray<double> points_in_cup(unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> height(0, 0.09), off(spacing / 3, 2 * spacing), turn(0, 2 * 3.14159265358979);
  PointArray<double> points(3, point_count);
  for (Index i = 0; i < point_count; ++i) {
    const double z = height(generator), r = 0.03 + 0.01 * z / 0.09 - off(generator), angle = turn(generator);
    points.col(i) = Point(r * std::cos(angle), r * std::sin(angle), z);
  }
  return points;
}

/// [ms]
struct MeshTimes {
  double hierarchy, wall, sight_lines, look_ups;
};

MeshTimes ask_mesh(const TriangleMesh& mesh, const Plan& plan) {
  const Threads threads{plan.threads};
  std::optional<BoundingVolumeHierarchy> surface;
  std::optional<MeshWall> wall;
  MeshTimes times{};
  times.hierarchy = 1e3 * seconds_of([&] { surface.emplace(mesh); });
  times.wall = 1e3 * seconds_of([&] { wall = MeshWall::of<CubicSpline<double>>(*surface, spacing, spacing, threads); });
  std::vector<PointArray<double>> points;
  std::vector<Point> eyes;
  for (unsigned input = 0; input < input_count; ++input) {
    points.push_back(points_in_cup(input + 1));
    eyes.push_back(camera_around(static_cast<int>(input), static_cast<int>(input_count)).inverse().translation);
  }
  std::vector<double> result(point_count);
  const auto milliseconds_over_points = [&](const auto& ask) {
    std::vector<double> samples;
    double spent = 0;
    for (std::size_t turn = 0; turn < 2 * input_count || spent < plan.seconds; ++turn) {
      const std::size_t input = turn % input_count;
      const double took = seconds_of([&] {
        parallel_for(point_count, threads,
                     [&](Index i) { result[static_cast<std::size_t>(i)] = ask(eyes[input], points[input].col(i)); });
        keep(result);
      });
      spent += took;
      if (turn >= input_count) {  // all inputs once to warm up
        samples.push_back(1e3 * took);
      }
    }
    return median(samples);
  };
  times.sight_lines = milliseconds_over_points(
      [&](const Point& eye, const Point& point) { return surface->any_hit(eye, point) ? 1.0 : 0.0; });
  times.look_ups = milliseconds_over_points([&](const Point&, const Point& point) {
    WallSample sample;
    return wall->sample(point, sample) ? sample.distance : 0.0;
  });
  return times;
}

/// What a hierarchy takes, and with a wall [MB]: several are made of the former, as small ones are but a few pages.
std::pair<double, double> memory_of_mesh(const TriangleMesh& mesh, const Plan& plan) {
  const std::size_t surfaces = 1 + 100000 / mesh.triangles.size();
  const double nothing = memory_of_nothing();
  const auto of_surfaces = in_child_process([&] {
    std::vector<std::unique_ptr<BoundingVolumeHierarchy>> all(surfaces);
    for (auto& each : all) {
      each = std::make_unique<BoundingVolumeHierarchy>(mesh);
    }
    return 0;
  });
  const auto of_both = in_child_process([&] {
    const BoundingVolumeHierarchy surface(mesh);
    keep(MeshWall::of<CubicSpline<double>>(surface, spacing, spacing, Threads{plan.threads}));
    return 0;
  });
  return {(of_surfaces.peak_mb - nothing) / static_cast<double>(surfaces), of_both.peak_mb - nothing};
}

void measure_triangles(const Options& options, Report& report) {
  const Plan plan(options, report);
  Growth growth(report, "triangles", plan.threads);
  auto& hierarchy = growth.figure("building the hierarchy", "ms");
  auto& wall = growth.figure("setting up the wall", "ms");
  auto& sight_lines = growth.figure("8000 sight lines", "ms");
  auto& look_ups = growth.figure("8000 wall look-ups", "ms");
  auto& of_surface = growth.figure("memory of the hierarchy", "MB");
  auto& of_both = growth.figure("memory with the wall", "MB");
  for (int repetition = 0; repetition < plan.repetitions; ++repetition) {
    for (const int wanted : plan.sizes(options, "triangles")) {
      const TriangleMesh mesh = cup(static_cast<std::uint32_t>(std::lround(std::sqrt(std::max(wanted, 50) / 2.0))));
      const long count = static_cast<long>(mesh.triangles.size());
      const MeshTimes times = in_child_process([&] { return ask_mesh(mesh, plan); }).value;
      hierarchy.add(count, times.hierarchy);
      wall.add(count, times.wall);
      sight_lines.add(count, times.sight_lines);
      look_ups.add(count, times.look_ups);
      const auto [surface_mb, both_mb] = memory_of_mesh(mesh, plan);
      of_surface.add(count, surface_mb);
      of_both.add(count, both_mb);
    }
  }
  growth.write();
}

// ---- hypotheses -----------------------------------------------------------------------------------------------------

/// Median time of a frame [ms]. Hypotheses are shared out over threads, each tracker runs on one; velocities differ by
/// a millimetre per second, as equal simulations would learn each other's branches.
template <class CorrectorType>
double track_hypotheses(const Model& cup, int count, int frames, int threads) {
  using OneTracker = Tracker<Model, CorrectorType>;
  HypothesisFilterSettings settings;
  settings.least_probability = 0;  // or hypotheses would be given up, and frames get cheaper
  HypothesisFilter<OneTracker> filter(settings, ThreadExecutor{{threads}});
  std::mt19937 generator(1);
  std::uniform_real_distribution<float> nudge(-1e-3F, 1e-3F);
  for (int k = 0; k < count; ++k) {
    Model model = another(cup, cup.snapshot(), 1);
    for (Index i = 0; i < model.fluid().size(); ++i) {
      model.fluid().velocity(0, i) += nudge(generator);
    }
    TrackerSettings of_one;
    of_one.threads = {1};
    OneTracker tracker(std::move(model), {}, of_one);
    tracker.add_camera(camera_of(640), camera_around(0, 1));
    filter.add(std::move(tracker));
  }
  const ShiftingMasks masks(filter.tracker(0));
  const double start = cup.time();
  std::vector<double> samples;
  for (int frame = 1; frame <= first_frames + frames; ++frame) {
    FrameReport report;
    const double took = 1e3 * seconds_of([&] {
                          report = filter.track({start + frame * frame_time, {}, masks.in_frame(frame), {}});
                        });
    if (report.status != FrameStatus::Ok || filter.running() != filter.size()) {
      throw std::runtime_error("a frame is " + std::string(to_string(report.status)) + ", or a hypothesis was lost");
    }
    if (frame > first_frames) {
      samples.push_back(took);
    }
  }
  return median(samples);
}

void measure_hypotheses(const Options& options, Report& report) {
  const Plan plan(options, report);
  const int frames = plan.quick ? 4 : options.numbers("frames").front();
  const Model cup = filled_cup(0.005);
  Growth growth(report, "hypotheses", plan.threads);
  auto& open_loop = growth.figure("a frame, uncorrected", "ms");
  auto& corrected = growth.figure("a frame, corrected", "ms");
  auto& memory = growth.figure("memory, corrected", "MB");
  auto& share = growth.figure("memory of a hypothesis", "MB", false);
  for (int repetition = 0; repetition < plan.repetitions; ++repetition) {
    const double nothing = memory_of_nothing();
    for (const int count : plan.sizes(options, "hypotheses")) {
      const auto open =
          in_child_process([&] { return track_hypotheses<OpenLoop<>>(cup, count, frames, plan.threads); });
      open_loop.add(count, open.value);
      const auto run =
          in_child_process([&] { return track_hypotheses<SilhouetteCorrector<>>(cup, count, frames, plan.threads); });
      corrected.add(count, run.value);
      memory.add(count, run.peak_mb - nothing);
      share.add(count, (run.peak_mb - nothing) / count);
    }
  }
  growth.write(plan.threads);  // up to one for each thread they take turns with nobody
}

// ---- ranks ----------------------------------------------------------------------------------------------------------

/// A process with a simulation of its own. Times are of the clock that all processes of a machine share [s].
struct Rank {
  double begin = 0, end = 0, particle_steps = 0, own_mb = 0;
};

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// So many processes at once, started and waited for by a thread each. Throws what goes wrong in one of them.
std::vector<Rank> run_ranks(int count, int per_edge, double simulated) {
  std::vector<Rank> ranks(static_cast<std::size_t>(count));
  std::vector<std::exception_ptr> errors(ranks.size());
  std::vector<std::thread> threads;
  for (std::size_t k = 0; k < ranks.size(); ++k) {
    threads.emplace_back([&, k] {
      try {
        const auto run = in_child_process([&] {
          Model model = collapsing_cube(per_edge, 1);
          Rank rank;
          rank.begin = now();
          rank.particle_steps = static_cast<double>(model.fluid().size()) * advance(model, simulated).sub_steps;
          rank.end = now();
          return rank;
        });
        ranks[k] = run.value;
        ranks[k].own_mb = run.peak_mb;
      } catch (...) {
        errors[k] = std::current_exception();
      }
    });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  for (const std::exception_ptr& error : errors) {
    if (error) {
      std::rethrow_exception(error);
    }
  }
  return ranks;
}

/// Processes that each run one simulation, as on the nodes of a cluster: they share nothing but the memory bus. decant
/// does not split one simulation over processes; what is split is a set of simulations. Above the number of cores they
/// take turns, and throughput no longer grows.
void measure_ranks(const Options& options, Report& report) {
  const Plan plan(options, report);
  const int per_edge = plan.quick ? 20 : options.numbers("rank-particles").front();
  Growth growth(report, "ranks", 1);
  auto& throughput = growth.figure("particle-steps per second", "M/s");
  auto& each = growth.figure("the same, each rank", "M/s", false);
  auto& memory = growth.figure("memory", "MB");
  for (int repetition = 0; repetition < plan.repetitions; ++repetition) {
    const double nothing = memory_of_nothing();
    for (const int count : plan.sizes(options, "ranks")) {
      const std::vector<Rank> ranks = run_ranks(count, per_edge, 2 * warm_up);
      double begin = ranks.front().begin, end = ranks.front().end, steps = 0, all_mb = 0;
      for (const Rank& rank : ranks) {
        begin = std::min(begin, rank.begin);
        end = std::max(end, rank.end);
        steps += rank.particle_steps;
        all_mb += rank.own_mb - nothing;
      }
      throughput.add(count, 1e-6 * steps / (end - begin));
      each.add(count, 1e-6 * steps / (end - begin) / count);
      memory.add(count, all_mb);
    }
  }
  growth.write(0, std::max(std::thread::hardware_concurrency(), 2U));
}

}  // namespace

int main(int argc, char** argv) {
  Options options("bench_scaling", "how time and memory grow with each quantity, and the exponents");
  options.add("seconds", "0.5", "least time of samples that are short [s]")
      .add("threads", "2", "of simulators and trackers, and over which hypotheses are shared out")
      .add("repetitions", "3", "runs of each size")
      .add("particles", "10,20,40,80", "per edge of a cube that collapses")
      .add("simulated", "20", "time that cubes are measured over [ms], after 20 ms that are not")
      .add("cameras", "1,2,4,8", "of 640 x 480 pixels")
      .add("widths", "160,320,640,1280", "of the image of one camera [px]")
      .add("spacing", "4", "of particles of the tracked cup [mm]; 4 makes 4,400 particles")
      .add("frames", "12", "that are tracked")
      .add("triangles", "1000,5000,20000,80000", "of a cup, about")
      .add("hypotheses", "1,2,4,8,16", "each a cup with particles of 5 mm")
      .add("ranks", "1,2,4", "processes at once, a simulation on one thread each")
      .add("rank-particles", "40", "per edge of each process's cube")
      .add("quick", "no", "one run of each size but the largest, for a first look");
  return benchmark_main(argc, argv, options, [](const Options& given, Report& report) {
    using Measure = void (*)(const Options&, Report&);
    const std::pair<const char*, Measure> cases[] = {
        {"particles", measure_particles}, {"cameras", measure_cameras},       {"pixels", measure_pixels},
        {"triangles", measure_triangles}, {"hypotheses", measure_hypotheses}, {"ranks", measure_ranks}};
    for (const auto& [title, measure] : cases) {
      if (report.wants(title)) {
        measure(given, report);
      }
    }
  });
}
