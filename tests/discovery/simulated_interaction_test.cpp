// SPDX-License-Identifier: MIT

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/pipe_network.hpp>
#include <decant/boundary/pipe_section.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/discovery/disagreement_place.hpp>
#include <decant/discovery/effect_dictionary.hpp>
#include <decant/discovery/liquid_effects.hpp>
#include <decant/discovery/simulated_interaction.hpp>
#include <decant/simulation/fill.hpp>
#include <decant/simulation/simulator.hpp>

#include "catch.hpp"

using namespace decant;

namespace {

/// A user's own effect: turns liquid about the z axis.
struct Stirrer {
  using Scalar = float;
  float rate = 0;  // [1/s^2]

  template <class Step>
  void accumulate(const Step& step, PointArray<float>& acceleration) noexcept {
    for (Index i = 0; i < step.fluid.size(); ++i) {
      const Vector3<float> x = step.fluid.position.col(i);
      acceleration.col(i) += rate * Vector3<float>(-x.y(), x.x(), 0);
    }
  }
  template <class Step>
  float largest_step(const Step&) const noexcept {
    return 1;
  }
};

using PourModel = Simulator<WithForces<EffectParts<>, Stirrer>>;
using Pour = SimulatedInteraction<PourModel, PinholeCamera>;
constexpr double pour_seconds = 0.6;

/// A small cup that turns over a pan in half a second, both moved along by `aside`, its motion late by `late`.
Pour::Scene pour_scene(const Vector3<double>& aside = Vector3<double>::Zero(), double late = 0) {
  Pour::Scene scene;
  std::vector<PoseTrack::Sample> samples;
  for (int k = 0; k <= 40; ++k) {
    const double time = 0.025 * k, turn = 1.9 * std::clamp((time - late) / 0.4, 0.0, 1.0);
    samples.push_back({time,
                       {Eigen::Quaterniond(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY())),
                        Vector3<double>(-0.05, 0, 0.12) + aside}});
  }
  scene.motion = {PoseTrack(samples), PoseTrack(Pose{Eigen::Quaterniond::Identity(), aside})};
  scene.start = [first = scene.motion](SimulatorSettings settings, double fill) {
    settings.threads = {1};
    settings.liquid.surface_tension = 0;
    PourModel model(settings);
    const BodyId cup = model.add_body("cup", Cup{0.025, 0.03, 0.07, 0.003}, PoseTrack(first[0].at(0)));
    model.add_body("pan", CylinderInside{0.08, 0.03, 0.003, Face::PositiveZ}, PoseTrack(first[1].at(0)));
    decant::fill(model, cup, FillAmount::fraction(0.6 * fill));
    return model;
  };
  const Eigen::Matrix3d axes = (Eigen::Matrix3d() << 1, 0, 0, 0, 0, -1, 0, 1, 0).finished();  // looks along +y
  InteractionCamera<PinholeCamera> camera{PinholeCamera(300, 300, 159.5, 119.5, 320, 240), {}, 300, 0.5};
  for (double time = 0; time < pour_seconds + 1e-9; time += 0.1) {
    scene.times.push_back(time);
    camera.camera_from_world.push_back({Eigen::Quaterniond(axes), {0, 0.08, 0.5}});
  }
  scene.cameras = {camera};
  return scene;
}

std::vector<InteractionEffect<PourModel>> pour_catalogue() {
  auto effects = force_effects<PourModel>(1e-6);
  effects.push_back(suction_effect<PourModel>({0.1, 0, 0.05}, "beside"));
  effects.push_back(leak_effect<PourModel>(0, {0, 0, 0.004}, {0, 0, -0.02}, "cup"));
  effects.push_back(loss_effect<PourModel>(1, {0, 0, 0.015}, 0.1, "pan"));
  effects.push_back(inflow_effect<PourModel>({0.03, 0, 0.1}, 2, "above"));
  effects.push_back(fill_effect<PourModel>());
  for (auto& effect : measurement_effects<PourModel>({"cup", "pan"})) {
    effects.push_back(std::move(effect));
  }
  return effects;
}

Pour pour_of(Pour::Scene scene = pour_scene(), double jitter = 0.05) {
  SimulatedInteractionSettings settings;
  settings.spacing = 0.009;
  settings.jitter = jitter;
  return Pour(std::move(scene), pour_catalogue(), settings);
}

ModelRun run_with(const Pour& pour, const std::string& name, const std::vector<double>& strength,
                  const std::string& where = "") {
  for (std::size_t k = 0; k < pour.effects().size(); ++k) {
    if (pour.effects()[k].name == name && (where.empty() || pour.effects()[k].where == where)) {
      return {{{k, Eigen::Map<const Eigen::VectorXd>(strength.data(), static_cast<Index>(strength.size())), {}}}, 1};
    }
  }
  throw std::runtime_error("no effect " + name);
}

/// All shares together, where they are, and how far they differ.
double wet_area(const SilhouetteSeries& seen) {
  double sum = 0;
  for (std::size_t frame = 0; frame < seen.frames(); ++frame) {
    for (Index row = 0; row < seen.rows(); ++row) {
      for (Index column = 0; column < seen.columns(); ++column) {
        sum += static_cast<double>(seen.share(frame, row, column));
      }
    }
  }
  return sum;
}
double apart(const SilhouetteSeries& a, const SilhouetteSeries& b, Index columns_on = 0, Index rows_on = 0) {
  double sum = 0;
  for (std::size_t frame = 0; frame < a.frames(); ++frame) {
    for (Index row = 0; row + rows_on < a.rows(); ++row) {
      for (Index column = 0; column + columns_on < a.columns(); ++column) {
        sum += std::abs(static_cast<double>(a.share(frame, row, column)) -
                        static_cast<double>(b.share(frame, row + rows_on, column + columns_on)));
      }
    }
  }
  return sum;
}

}  // namespace

TEST_CASE("simulated interaction: a run is what its seed and its effects make of it") {
  const Pour pour = pour_of();
  const auto once = pour.predict({{}, 1, false}).silhouettes, again = pour.predict({{}, 1, false}).silhouettes;
  REQUIRE(once.size() == 1);
  CHECK(once[0].frames() == 7);
  CHECK(once[0].numbers() == again[0].numbers());
  CHECK(wet_area(once[0]) > 20);
  CHECK(apart(once[0], pour.predict({{}, 2, false}).silhouettes[0]) > 1);
  // without any shaking seeds make no difference
  const Pour calm = pour_of(pour_scene(), 0);
  CHECK(calm.predict({{}, 1, false}).silhouettes[0].numbers() == calm.predict({{}, 2, false}).silhouettes[0].numbers());
  // liquid has arrived in the pan
  PourModel model = pour.started({{}, 1, false});
  const float most = 0.04F;
  CHECK((model.fluid().position.row(2).array() > most).all());
  REQUIRE(model.step(pour_seconds).advanced());
  CHECK((model.fluid().position.row(2).array() < most).count() > model.fluid().size() / 2);
}

TEST_CASE("simulated interaction: poses that are late or off are the motion that they tell of") {
  // recorded late by a tenth of a second: what is recorded for 0.1 s later is so now
  const Pour late = pour_of(pour_scene(Vector3<double>::Zero(), 0.1), 0), in_time = pour_of(pour_scene(), 0);
  const auto seen = late.predict(run_with(late, "latency", {0.1})).silhouettes;
  CHECK(apart(seen[0], in_time.predict({{}, 1, false}).silhouettes[0]) < 1e-6 + 0.02 * wet_area(seen[0]));
  CHECK(apart(seen[0], late.predict({{}, 1, false}).silhouettes[0]) > 0.2 * wet_area(seen[0]));

  // the cup alone, then the pan alone, with the liquid of the cup going along
  const Vector3<double> off(0.02, 0, 0);
  const PourModel moved = in_time.started(run_with(in_time, "body_pose", {0.02, 0, 0}, "cup"));
  const PourModel still = in_time.started({{}, 1, false});
  CHECK((moved.bodies()[0].motion.at(0.3 + moved.time()).translation -
         still.bodies()[0].motion.at(0.3 + still.time()).translation - off)
            .norm() < 1e-12);
  CHECK((moved.bodies()[1].motion.at(0.3).translation - still.bodies()[1].motion.at(0.3).translation).norm() == 0);
  CHECK(moved.fluid().size() == still.fluid().size());
  CHECK((moved.fluid().position.rowwise().mean() - still.fluid().position.rowwise().mean() - off.cast<float>()).norm() <
        1e-5F);
}

TEST_CASE("simulated interaction: errors of a camera change its picture alone") {
  const Pour pour = pour_of(pour_scene(), 0);
  const auto plain = pour.predict({{}, 1, false}).silhouettes;
  // ten pixels are one cell
  const auto shifted = pour.predict(run_with(pour, "camera_shift", {10, 0})).silhouettes;
  CHECK(apart(plain[0], shifted[0], 1) < 0.1 * apart(plain[0], shifted[0]));
  const auto lower = pour.predict(run_with(pour, "camera_shift", {0, 10})).silhouettes;
  CHECK(apart(plain[0], lower[0], 0, 1) < 0.1 * apart(plain[0], lower[0]));  // v points down
  CHECK(wet_area(pour.predict(run_with(pour, "mask_bias", {2})).silhouettes[0]) > 1.1 * wet_area(plain[0]));
  CHECK(wet_area(pour.predict(run_with(pour, "mask_bias", {-2})).silhouettes[0]) < 0.95 * wet_area(plain[0]));
  // a turn of the picture about its middle by a quarter takes what is above it to the right
  const auto turned = pour.predict(run_with(pour, "camera_roll", {1.5707963})).silhouettes;
  CHECK(apart(plain[0], turned[0]) > wet_area(plain[0]));
}

TEST_CASE("disagreement place: a pixel shows what is as far off as liquid there, and the nearest body is named") {
  SimulatorSettings settings;
  settings.spacing = 0.01;
  settings.threads = {1};
  PourModel model(settings);
  model.add_body("block", Box{{-0.05, -0.05, -0.02}, {0.05, 0.05, 0}});
  // turned by a quarter: from x = 0.2 on, up to z = 0.2
  const Pose upright{Eigen::Quaterniond(Eigen::AngleAxisd(-0.5 * std::numbers::pi, Eigen::Vector3d::UnitY())),
                     {0.21, 0, 0}};
  model.add_body("post", Box{{-0.02, -0.01, -0.01}, {0.2, 0.01, 0.01}}, PoseTrack(upright));
  const Eigen::Matrix3d axes = (Eigen::Matrix3d() << 1, 0, 0, 0, 0, -1, 0, 1, 0).finished();  // looks along +y
  const Pose camera_from_world{Eigen::Quaterniond(axes), {0, 0.1, 0.5}};
  const PinholeCamera camera(300, 300, 159.5, 119.5, 320, 240);
  const auto seen_at = [&](const Eigen::Vector2d& pixel) {
    return place_of_liquid(model, camera, camera_from_world, pixel);
  };
  const auto pixel_of = [&](const Vector3<double>& x) { return camera.project(camera_from_world * x).pixel; };
  CHECK(!seen_at({160, 120}));  // there is no liquid

  const Vector3<double> front(0, 0, 0.05), aside(0.15, 0.02, 0.1);
  PointArray<float> places(3, 4);
  places.col(0) = (front + 0.2 * (front - camera_from_world.inverse().translation)).cast<float>();  // hidden by it
  places.col(1) = front.cast<float>();
  places.col(2) = aside.cast<float>();
  places.col(3) = Vector3<float>(0.2F, -0.8F, 0.1F);  // behind the camera
  model.add_particles(places, PointArray<float>::Zero(3, 4), 0);
  const auto above = seen_at(pixel_of(front)), beside = seen_at(pixel_of(aside));
  REQUIRE((above && beside));
  CHECK((above->place - front).norm() < 1e-6);
  CHECK(above->body == 0);
  CHECK(above->distance == Approx(0.05).epsilon(1e-4));
  CHECK((beside->place - aside).norm() < 1e-6);
  CHECK(beside->body == 1);
  CHECK(beside->distance == Approx(std::hypot(0.05, 0.01)).epsilon(1e-4));  // of its edge
  // Where no liquid is, it would be as far off as the nearest that is seen: what comes out of it is not far.
  const Eigen::Vector2d other = pixel_of(aside) + Eigen::Vector2d(10, 0);
  const auto out = seen_at(other);
  REQUIRE(out);
  CHECK((pixel_of(out->place) - other).norm() < 1e-6);
  CHECK((out->place - aside).norm() < 0.02);
  CHECK(!seen_at({std::nan(""), 120}));
}

TEST_CASE("disagreement place: it is told where liquid is in the world when a disagreement begins") {
  const Pour pour = pour_of();
  const auto& camera = pour.scene().cameras.front();
  Vector3<double> in_cup, in_pan;
  pour.watch({}, [&](std::size_t frame, const PourModel& model, auto&&...) {
    (frame == 0 ? in_cup : in_pan) = model.fluid().position.rowwise().mean().cast<double>();
  });
  const auto begins = [&](double time, const Vector3<double>& where) {
    Disagreement one;
    one.begin = time;
    const Eigen::Vector2d pixel = camera.camera.project(camera.camera_from_world.front() * where).pixel;
    one.onset_u = pixel.x();
    one.onset_v = pixel.y();
    return one;
  };
  Disagreement of_none = begins(0.3, in_pan);
  of_none.camera = 1;
  const auto places = places_of({begins(pour_seconds, in_pan), of_none, begins(0, in_cup)}, pour);
  REQUIRE(places.size() == 3);
  REQUIRE((places[0] && places[2]));
  CHECK(places[0]->body == 1);
  CHECK((places[0]->place - in_pan).head<2>().norm() < 0.08);  // the pan's radius
  CHECK(places[0]->distance < 0.02);
  CHECK(places[2]->body == 0);
  CHECK((places[2]->place - in_cup).norm() < 0.03);  // the cup's
  CHECK(!places[1]);
  CHECK(places_of({}, pour).empty());
}

TEST_CASE("simulated interaction: effects reach the model, and amounts are what is asked for") {
  const Pour pour = pour_of();
  const auto number = [&](const char* name, const std::vector<double>& strength, auto read) {
    PourModel model = pour.started(run_with(pour, name, strength));
    return static_cast<double>(read(model));
  };
  CHECK(number("drag_linear", {1.5}, [](auto& m) { return m.template force<LinearDrag<float>>().rate; }) == 1.5);
  CHECK(number("drag_quadratic", {1.5}, [](auto& m) { return m.template force<QuadraticDrag<float>>().drag; }) == 1.5);
  CHECK(number("viscosity", {1e-3}, [](auto& m) {
          return m.template force<ShearThinningViscosity<float>>().kinematic_viscosity;
        }) == Approx(1e-3));
  CHECK(number("surface_tension", {0.2},
               [](auto& m) { return m.template force<SurfaceTension<float>>().surface_tension; }) == Approx(0.2));
  CHECK(number("wall_friction", {20}, [](auto& m) { return m.template force<WallFriction<float>>().rate; }) == 20);
  CHECK(number("wall_adhesion", {20}, [](auto& m) { return m.template force<WallAdhesion<float>>().strength; }) == 20);
  CHECK(number("gravity", {9}, [](auto& m) { return m.template force<Gravity<float>>().acceleration.z(); }) ==
        Approx(-9));
  CHECK(number("lateral_force", {0.5, -0.25},
               [](auto& m) { return m.template force<BodyAcceleration<float>>().pull.y(); }) == -0.25);
  // sideways is level wherever gravity points
  for (const Vector3<double>& gravity :
       {Vector3<double>(0, 0, -9.81), Vector3<double>(0, -9, 4), Vector3<double>(9, 0, 0)}) {
    const auto level = level_directions(gravity);
    CHECK(std::abs(level[0].dot(gravity)) + std::abs(level[1].dot(gravity)) + std::abs(level[0].dot(level[1])) < 1e-12);
    CHECK(level[0].norm() == Approx(1));
    CHECK(level[0].cross(level[1]).dot(gravity) == Approx(-gravity.norm()));
  }
  CHECK(level_directions({0, 0, -9.81})[0] == Vector3<double>::UnitX());
  CHECK(force_effects<PourModel>(1e-6, {0, 0, 0}).size() + 1 == force_effects<PourModel>(1e-6).size());
  CHECK(number("suction", {6}, [](auto& m) { return m.template force<Suction<float>>().strength; }) == 6);
  CHECK(number("suction", {6}, [](auto& m) { return m.template force<Suction<float>>().point.x(); }) == Approx(0.1));
  ModelRun elsewhere = run_with(pour, "suction", {6});
  elsewhere.effects[0].place = Vector3<double>(0, 0.2, 0);
  CHECK(pour.started(elsewhere).force<Suction<float>>().point.y() == Approx(0.2));

  const auto amount = [&](double fill) { return number("fill", {fill}, [](auto& m) { return m.fluid().size(); }); };
  const double assumed = static_cast<double>(pour.started({{}, 1, false}).fluid().size());
  for (const double fill : {0.8, 0.93, 1.02, 1.2}) {
    CHECK(amount(fill) == Approx(fill * assumed).margin(1));
  }
}

TEST_CASE("simulated interaction: leaks, losses and inflow take and bring what they are asked for") {
  const Pour pour = pour_of();
  const double particle = 0.009 * 0.009 * 0.009;
  const auto after = [&](const char* name, double flow) {
    PourModel model = pour.started(run_with(pour, name, {flow}));
    StepReport report;
    for (int frame = 0; frame < 12; ++frame) {
      report = model.step(0.05);
      REQUIRE(report.advanced());
    }
    return report;
  };
  const auto start = static_cast<double>(pour.started({{}, 1, false}).fluid().size());
  // 30 ml/s for 0.6 s, where the cup holds liquid for so long; what has leaked is still there
  const StepReport leak = after("leak", 30);
  CHECK(leak.drained > 4e-6);
  CHECK(leak.drained < 18e-6 + particle);
  CHECK(static_cast<double>(leak.particles) == start);
  const StepReport loss = after("loss", 30);
  CHECK(loss.drained > 1e-6);  // from when liquid has arrived
  CHECK(static_cast<double>(loss.particles) == Approx(start - loss.drained / particle).margin(0.5));
  const StepReport inflow = after("inflow", 30);
  CHECK(static_cast<double>(inflow.particles) - start == Approx(18e-6 / particle).margin(6));
}

TEST_CASE("simulated interaction: what acts for a while acts then, on the recording's clock") {
  Pour::Scene scene = pour_scene();
  for (double& time : scene.times) {  // a clock that does not begin at zero
    time += 3;
  }
  std::vector<PoseTrack::Sample> samples = scene.motion[0].samples();
  for (PoseTrack::Sample& sample : samples) {
    sample.time += 3;
  }
  scene.motion[0] = PoseTrack(samples);
  auto effects = pour_catalogue();
  effects.push_back(passing_force_effect<PourModel>({3.25, 3.45}, 0.1, "for a while"));
  effects.push_back(inflow_effect<PourModel>({0.03, 0, 0.1}, 2, "later", TimeWindow{.from = 3.31}, 0.1));
  SimulatedInteractionSettings settings;
  settings.spacing = 0.009;
  const Pour pour(scene, effects, settings);
  const auto plain = pour.predict({{}, 1, false}).silhouettes;
  const auto frames_that_differ = [&](const ModelRun& run) {
    const auto seen = pour.predict(run).silhouettes;
    std::vector<std::size_t> frames;
    for (std::size_t frame = 0; frame < seen[0].frames(); ++frame) {
      bool same = true;
      for (Index row = 0; row < seen[0].rows(); ++row) {
        for (Index column = 0; column < seen[0].columns(); ++column) {
          same = same && seen[0].share(frame, row, column) == plain[0].share(frame, row, column);
        }
      }
      if (!same) {
        frames.push_back(frame);
      }
    }
    return frames;
  };
  const ModelRun gust = run_with(pour, "lateral_force", {3, 0}, "for a while");
  CHECK(frames_that_differ(gust) == std::vector<std::size_t>{3, 4, 5, 6});  // frames are 0.1 s apart
  ModelRun later = gust;
  later.effects[0].window = TimeWindow{3.45, 3.5};
  CHECK(frames_that_differ(later) == std::vector<std::size_t>{5, 6});
  // for as long as it lasts, and no longer
  PourModel model = pour.started(gust);
  const auto& pull = model.force<BodyAcceleration<float>>();
  CHECK(pull.from - model.time() == Approx(0.25));
  CHECK(pull.until - model.time() == Approx(0.45));
  const std::vector<std::size_t> wet = frames_that_differ(run_with(pour, "inflow", {40}, "later"));
  REQUIRE(!wet.empty());
  CHECK(wet.front() == 4);
}

TEST_CASE("simulated interaction: liquid has come to rest under what pulls it all the time and not under a gust") {
  const double radius = 0.04, depth = 0.04, pull = 1;
  Pour::Scene scene;
  scene.motion = {PoseTrack(Pose{})};
  scene.times = {0, 0.5};
  scene.start = [&](SimulatorSettings settings, double fill) {
    settings.threads = {1};
    PourModel model(settings);
    const BodyId glass = model.add_body("glass", CylinderInside{radius, 3 * depth, 0.003, Face::PositiveZ});
    decant::fill(model, glass, FillAmount::volume(fill * std::numbers::pi * radius * radius * depth));
    return model;
  };
  auto effects = force_effects<PourModel>(1e-6);
  effects.push_back(passing_force_effect<PourModel>({0, 10}, 0.1, "from the beginning"));
  SimulatedInteractionSettings settings;
  settings.spacing = 0.006;
  const Pour still(scene, effects, settings);
  const auto aside = [](PourModel& model) {
    return static_cast<double>(model.fluid().position.row(0).template cast<double>().mean());
  };
  const double analytic = 0.25 * radius * radius / depth * pull / 9.81;  // the middle of a cylinder's oblique end
  PourModel plain = still.started({{}, 1, false});
  PourModel leaning = still.started(run_with(still, "lateral_force", {pull, 0}, ""));
  const double from = aside(plain), rest = aside(leaning) - from;
  CHECK(rest == Approx(analytic).epsilon(0.12));
  PourModel gust = still.started(run_with(still, "lateral_force", {pull, 0}, "from the beginning"));
  CHECK(aside(gust) == from);
  // one stays as it is, the other sloshes to twice as far
  double farthest = 0, nearest = 1, thrown = 0;
  for (int k = 0; k < 30; ++k) {
    REQUIRE(leaning.step(0.01).advanced());
    REQUIRE(gust.step(0.01).advanced());
    farthest = std::max(farthest, aside(leaning) - from);
    nearest = std::min(nearest, aside(leaning) - from);
    thrown = std::max(thrown, aside(gust) - from);
  }
  CHECK(nearest > 0.85 * rest);
  CHECK(farthest < 1.15 * rest);
  CHECK(thrown > 1.5 * rest);
}

TEST_CASE("simulated interaction: a pipe that is blocked in part lets less pass, and inlets bring in what is asked") {
  PipeNetwork straight;
  straight.radius = 0.018;
  straight.places = {{0, 0.3}, {0, 0.1}};
  straight.pipes = {{0, 1}};
  const TriangleMesh pipe = straight.mesh();
  Pour::Scene scene;
  scene.motion = {PoseTrack(Pose{})};
  scene.start = [pipe](SimulatorSettings settings, double) {
    settings.threads = {1};
    PourModel model(settings);
    model.add_body("pipe", pipe);
    InletSettings inlet;
    inlet.position = {0, 0, 0.28};
    inlet.radius = 0.012;
    inlet.flow = {{0, 4e-4}, {0.5, 4e-4}};
    model.add_inlet(inlet, 1);
    return model;
  };
  scene.times = {0, 0.5};
  InteractionSensor<PourModel> below;  // what has passed [m^3]
  below.error = {1e-6, 0.1};
  below.read = [](PourModel& model) {
    double mass = 0;
    for (Index i = 0; i < model.fluid().size(); ++i) {
      mass += model.fluid().position(2, i) < 0.15F ? static_cast<double>(model.fluid().mass[i]) : 0.0;
    }
    return mass / model.settings().liquid.density;
  };
  scene.sensors = {below};
  const auto section =
      pipe_section(BoundingVolumeHierarchy(pipe), Vector3<double>(0, 0, 0.2), Vector3<double>(0, 0, -1), 0.05);
  REQUIRE(section);
  SimulatedInteractionSettings settings;
  settings.spacing = 0.007;
  settings.jitter = 0;
  const Pour piped(std::move(scene), {blockage_effect<PourModel>(0, *section, "pipe"), inlet_flow_effect<PourModel>()},
                   settings);
  const auto passed = [&](const char* effect, double strength) {
    return piped.predict(run_with(piped, effect, {strength})).readings[0].value(1);
  };
  const double open = piped.predict({{}, 1, false}).readings[0].value(1);
  REQUIRE(open > 5e-5);
  CHECK(passed("obstacle", 0.01) == Approx(open).epsilon(0.02));
  CHECK(passed("obstacle", 0.7) < 0.6 * open);
  CHECK(passed("obstacle", 0.95) < 0.5 * passed("obstacle", 0.7));
  CHECK(passed("inlet_flow", 0.6) < 0.75 * open);
  // it is the inlet's own flow that changes
  PourModel model = piped.started(run_with(piped, "inlet_flow", {0.6}));
  REQUIRE(model.inlet_count() == 1);
  CHECK(model.inlet(0).flow(0.2) == Approx(0.6 * 4e-4));
}

TEST_CASE("simulated interaction: obstacles go with their body, and necks hold liquid back") {
  auto effects = pour_catalogue();
  effects.push_back(obstacle_effect<PourModel>(0, {0.01, 0, 0.06}, "mouth"));
  effects.push_back(back_pressure_effect<PourModel>({0, {0, 0, 0.07}, {0, 0, 1}, 0.07, 0.04}, "cup", 0.2));
  SimulatedInteractionSettings settings;
  settings.spacing = 0.009;
  const Pour pour(pour_scene(), effects, settings);
  ModelRun block = run_with(pour, "obstacle", {0.02});
  PourModel model = pour.started(block);
  REQUIRE(model.bodies().size() == 3);
  const auto& cube = model.bodies()[2].surface->bounds();
  CHECK((cube.min() - Vector3<double>(0, -0.01, 0.05)).norm() < 1e-12);
  CHECK((cube.max() - Vector3<double>(0.02, 0.01, 0.07)).norm() < 1e-12);
  for (const double turned_at : {0.0, 0.4}) {
    const Pose cup = model.bodies()[0].motion.at(model.time() + turned_at);
    const Pose with_it = model.bodies()[2].motion.at(model.time() + turned_at);
    CHECK((cup * Vector3<double>(0.01, 0, 0.06) - with_it * Vector3<double>(0.01, 0, 0.06)).norm() < 1e-12);
  }
  block.effects[0].place = Vector3<double>(0, 0, 0.065);
  CHECK(apart(pour.predict(block).silhouettes[0], pour.predict({{}, 1, false}).silhouettes[0]) > 5);
  CHECK(pour.started(run_with(pour, "obstacle", {1e-4})).bodies().size() == 2);  // no particle would feel it

  const auto left_in_cup = [&](const ModelRun& run) {
    PourModel poured = pour.started(run);
    poured.watch_contents(0);
    StepReport report;
    for (int frame = 0; frame < 9; ++frame) {
      report = poured.step(0.05);
      REQUIRE(report.advanced());
    }
    return report.contents[0].volume;
  };
  ModelRun held_up = run_with(pour, "back_pressure", {8});
  CHECK(left_in_cup(held_up) > 1.3 * left_in_cup({{}, 1, false}));
  const auto beat_of = [&](const ModelRun& run) {
    PourModel started = pour.started(run);
    return std::pair(started.force<BackPressure<float>>().beat, started.time());
  };
  CHECK(beat_of(held_up).first.share(0.05) == 1);  // in the mean over many beats
  held_up.effects[0].window = TimeWindow{0.2, 0.45};
  const auto [beat, begin] = beat_of(held_up);
  CHECK(beat.from == Approx(begin + 0.2 - pour.scene().times.front()));
  CHECK(beat.until == Approx(begin + 0.45 - pour.scene().times.front()));
}

TEST_CASE("simulated interaction: what is tolerated is drawn within its tolerance, by the seed") {
  const Pour pour = pour_of();
  double most_delay = 0, most_pull = 0;
  int coarser = 0, finer = 0, sharper = 0, more_precise = 0, thinner = 0;
  for (std::uint32_t seed = 0; seed < 40; ++seed) {
    const auto [changes, discretisation] = pour.changes({{}, seed, true});
    CHECK(pour.changes({{}, seed, true}).first.pose_delay == changes.pose_delay);
    CHECK(std::abs(changes.pose_delay) <= 0.008);
    CHECK(std::abs(changes.fill - 1) <= 0.02);
    CHECK(changes.body_offset[1].cwiseAbs().maxCoeff() <= 2e-3);
    // taken account of by templates
    CHECK(changes.camera_shift.norm() == 0);
    CHECK(changes.mask_growth == 0);
    coarser += discretisation.spacing > 1 ? 1 : 0;
    finer += discretisation.spacing < 1 ? 1 : 0;
    sharper += discretisation.support < 1 ? 1 : 0;
    more_precise += discretisation.precision > 1 ? 1 : 0;
    thinner += discretisation.drawing < 1 ? 1 : 0;
    most_delay = std::max(most_delay, std::abs(changes.pose_delay));
    PourModel model = pour.started({{}, seed, true});
    CHECK(model.spacing() == Approx(discretisation.spacing * pour.settings().spacing));
    CHECK(model.settings().support_in_spacings == Approx(2 * discretisation.support));
    CHECK(model.settings().courant_number == Approx(1.6 / discretisation.precision));
    const auto& pull = model.force<BodyAcceleration<float>>().pull;
    CHECK(pull.cwiseAbs().maxCoeff() <= 0.03F);
    most_pull = std::max(most_pull, static_cast<double>(std::abs(pull.x())));
  }
  CHECK(most_delay > 0.006);
  CHECK(most_pull > 0.02);
  CHECK(coarser > 5);
  CHECK(finer > 5);
  CHECK(sharper > 5);
  CHECK(more_precise > 5);
  CHECK(thinner > 5);
  const auto [changes, discretisation] = pour.changes({{}, 3, false});
  CHECK(discretisation == Discretisation{});
  CHECK(changes.of_model.empty());
}

TEST_CASE("simulated interaction: what is seen somewhere has its place there, as far off as it usually is") {
  for (const double pitch : {0.0, 0.7}) {  // of the camera, down from along y
    INFO("pitch " << pitch);
    Pour::Scene scene = pour_scene();
    const double c = std::cos(pitch), s = std::sin(pitch);
    const Eigen::Matrix3d axes = (Eigen::Matrix3d() << 1, 0, 0, 0, -s, -c, 0, c, -s).finished();
    const Vector3<double> eye(0, -0.5 * c, 0.08 + 0.5 * s);
    scene.cameras[0].camera_from_world.assign(scene.times.size(), {Eigen::Quaterniond(axes), -axes * eye});
    const Pour pour = pour_of(scene);
    const auto number = [&](const std::string& name) {
      const auto found = std::find_if(pour.effects().begin(), pour.effects().end(),
                                      [&](const Effect& effect) { return effect.name == name; });
      return static_cast<std::size_t>(found - pour.effects().begin());
    };
    const auto& camera = scene.cameras[0];
    const auto seen = [&](const Vector3<double>& world, std::size_t frame) {
      return Sighting{0, camera.camera.project(camera.camera_from_world[frame] * world).pixel, scene.times[frame]};
    };
    // an inflow's place is in the world
    const std::size_t inflow = number("inflow");
    const Vector3<double> there = *pour.effects()[inflow].place + Vector3<double>(-0.04, 0, 0.03);
    CHECK((*pour.place_of(inflow, seen(there, 2)) - there).norm() < 1e-9);
    // of what is nearer to the camera it is told where it would be if it were as far off as usual
    CHECK((*pour.place_of(inflow, seen(there + 0.3 * (eye - there), 2)) - there).norm() < 1e-9);
    // liquid that falls comes from above
    const Vector3<double> fallen = *pour.effects()[inflow].place + Vector3<double>(-0.04, 0, -0.03);
    CHECK((*pour.place_of(inflow, seen(fallen, 2)) - (fallen + Vector3<double>(0, 0, 0.03))).norm() < 1e-9);
    // a leak's place is in its container, which turns
    const std::size_t leak = number("leak");
    for (const std::size_t frame : {std::size_t{0}, std::size_t{3}}) {
      const Pose cup = scene.motion[0].at(scene.times[frame]);
      const Vector3<double> hole = *pour.effects()[leak].place + Vector3<double>(0.01, 0, 0.02);
      CHECK((*pour.place_of(leak, seen(cup * hole, frame)) - hole).norm() < 1e-9);
    }
    CHECK(!pour.place_of(number("drag_linear"), seen(there, 0)));
    CHECK(!pour.place_of(inflow, Sighting{1, {0, 0}, 0}));
    CHECK(!pour.place_of(inflow, Sighting{0, {std::nan(""), 0}, 0}));
  }
}

TEST_CASE("simulated interaction: liquid that leaks goes on outside of the wall, wherever the hole is looked for") {
  const Pour pour = pour_of();
  ModelRun run = run_with(pour, "leak", {30});
  for (const double height : {0.001, 0.012, 0.018, 0.024}) {  // the exit is 2 cm below 4 mm, the floor 3 mm thick
    run.effects[0].place = Vector3<double>(0.008, 0, height);
    PourModel model = pour.started(run);
    double drained = 0;
    for (int frame = 0; frame < 4; ++frame) {
      const StepReport report = model.step(0.025);
      REQUIRE(report.advanced());
      drained = report.drained;
    }
    CHECK(drained > 1e-6);
  }
}

TEST_CASE("simulated interaction: a hole is in the wall that is there, and a jet leaves square to it") {
  auto effects = pour_catalogue();
  InteractionEffect<PourModel> hole =
      wall_leak_effect<PourModel>(0, {0, 0, 0}, {0, 0, 0.07}, {0.03, 0, 0.02}, "wall of the cup");
  hole.name = "of_wall";
  effects.push_back(hole);
  SimulatedInteractionSettings settings;
  settings.spacing = 0.009;
  const Pour pour(pour_scene(), effects, settings);
  ModelRun run = run_with(pour, "of_wall", {40});
  for (const double turn : {0.0, 2.0, 4.0}) {
    for (const double radius : {0.02, 0.05}) {  // a place off the wall means that which is behind it, or before it
      const Vector3<double> out(std::cos(turn), std::sin(turn), 0);
      run.effects[0].place = radius * out + Vector3<double>(0, 0, 0.02);
      run.effects[0].speed = 0.8;
      PourModel model = pour.started(run);
      int jets = 0;
      for (int frame = 0; frame < 20 && jets == 0; ++frame) {
        REQUIRE(model.step(0.004).advanced());
        const Pose cup_from_world = model.bodies()[0].motion.at(model.time()).inverse();
        for (Index i = 0; i < model.fluid().size(); ++i) {
          const Vector3<double> x = cup_from_world * Vector3<double>(model.fluid().position.col(i).cast<double>());
          const Vector3<double> v =
              cup_from_world.rotation * Vector3<double>(model.fluid().velocity.col(i).cast<double>());
          if (x.head<2>().norm() > 0.031) {  // outside
            ++jets;
            CHECK(x.head<2>().normalized().dot(out.head<2>()) > 0.98);
            CHECK(v.dot(out) > 0.7);
            CHECK(v.dot(out) < 0.9);
          }
        }
      }
      CHECK(jets == 1);
    }
  }
  hole.of_body.reset();
  CHECK_THROWS_WITH(Pour(pour_scene(), {hole}, settings), decant_test::contains("of_body"));
}

TEST_CASE("simulated interaction: what misses the containers falls for good, or onto a table") {
  auto effects = pour_catalogue();
  const Vector3<double> aside(0.3, 0, 0.1), top(0.2, 0.1, -0.03);
  effects.push_back(inflow_effect<PourModel>(aside, 2, "beside all"));
  effects.back().name = "stray";
  effects.push_back(table_effect<PourModel>(top));
  CHECK(effects.back().kind == EffectKind::Surroundings);
  CHECK(plan_dictionary({effects.back()}).size() == plan_dictionary(std::vector<Effect>()).size());  // none with it
  SimulatedInteractionSettings settings;
  settings.spacing = 0.009;
  const Pour pour(pour_scene(), effects, settings);
  for (const bool there : {false, true}) {
    ModelRun run = run_with(pour, "stray", {40});
    if (there) {
      run.effects.push_back(run_with(pour, "table", {1}).effects.front());
    }
    PourModel model = pour.started(run);
    for (int frame = 0; frame < 40; ++frame) {
      REQUIRE(model.step(0.0125).advanced());
    }
    const double lowest = model.fluid().position.row(2).minCoeff();
    INFO("lowest " << lowest);
    if (there) {
      CHECK(lowest > top.z());
      CHECK(lowest < top.z() + 0.009);
    } else {
      CHECK(lowest < top.z() - 0.3);
    }
  }
}

TEST_CASE("simulated interaction: a hole is looked for where a wall is nearest to what was seen, and highest") {
  Pour::Scene scene = pour_scene();
  auto effects = pour_catalogue();
  effects.push_back(wall_leak_effect<PourModel>(0, {0, 0, 0}, {0, 0, 0.07}, {0.03, 0, 0.02}, "wall of the cup"));
  SimulatedInteractionSettings settings;
  settings.spacing = 0.009;
  const Pour pour(scene, effects, settings);
  const std::size_t leak = effects.size() - 1;
  const auto& camera = scene.cameras[0];
  const std::size_t frame = 3;
  const Pose cup = scene.motion[0].at(scene.times[frame]);
  const auto pixel = [&](const Vector3<double>& in_cup) {
    return Eigen::Vector2d(camera.camera.project(camera.camera_from_world[frame] * (cup * in_cup)).pixel);
  };
  const auto seen = [&](const std::vector<Vector3<double>>& places) {
    Sighting sighting{0, pixel(places.front()), scene.times[frame], {}};
    for (const Vector3<double>& each : places) {
      sighting.squares.push_back(pixel(each));
    }
    return sighting;
  };
  // on the side that faces the camera, which looks along +y
  const Vector3<double> hole =
      cup.inverse().rotation * Vector3<double>(0, -1, 0) * 0.0295 + Vector3<double>(0, 0, 0.02);
  const auto nearest = pour.place_of(leak, seen({hole}));
  REQUIRE(nearest);
  CHECK(nearest->z() == Approx(0.02).margin(0.002));
  CHECK(nearest->head<2>().norm() == Approx(std::lerp(0.025, 0.03, 2.0 / 7)).margin(3e-4));  // on the inside
  CHECK(nearest->head<2>().normalized().dot(hole.head<2>().normalized()) > 0.99);
  // a jet from there falls in front of the cup and on
  const Vector3<double> down = cup.inverse().rotation * Vector3<double>(0, 0, -1);
  const auto of_jet = pour.place_of(leak, seen({hole + 0.06 * down, hole + 0.02 * down, hole, hole + 0.01 * down}));
  REQUIRE(of_jet);
  CHECK((*of_jet - *nearest).norm() < 1e-9);
  // beside the cup it is the wall's nearest place
  const Vector3<double> aside = cup.inverse().rotation * Vector3<double>(1, 0, 0);
  const auto beside = pour.place_of(leak, seen({Vector3<double>(0, 0, 0.035) + 0.1 * aside}));
  REQUIRE(beside);
  CHECK(beside->normalized().dot(aside) > 0.5);
  // what is seen beyond its floor comes from its wall, low down
  const auto below = pour.place_of(leak, seen({Vector3<double>(0.06, 0, -0.08)}));
  REQUIRE(below);
  CHECK(below->z() == Approx(0.007).margin(1e-6));
  CHECK(!pour.place_of(leak, Sighting{0, {std::nan(""), 0}, 0, {}}));
}

TEST_CASE("simulated interaction: what leaks out of sight is gone") {
  auto effects = pour_catalogue();
  InteractionEffect<PourModel> hole = hidden_leak_effect<PourModel>(0, {0, 0, 0.004}, "cup, out of sight");
  hole.name = "hidden";
  CHECK(hole.seen_first == SeenFirst::Nothing);
  effects.push_back(hole);
  SimulatedInteractionSettings settings;
  settings.spacing = 0.009;
  const Pour pour(pour_scene(), effects, settings);
  for (const char* name : {"leak", "hidden"}) {
    PourModel model = pour.started(run_with(pour, name, {30}));
    const auto before = model.fluid().size();
    for (int frame = 0; frame < 4; ++frame) {
      REQUIRE(model.step(0.025).advanced());
    }
    // 3 ml of 0.729 a particle
    const auto gone = before - model.fluid().size();
    CHECK(gone == (name == std::string("hidden") ? 4 : 0));
  }
}

TEST_CASE("simulated interaction: a run with an effect that cannot be as it is asked for has failed, and no more") {
  auto effects = pour_catalogue();
  InteractionEffect<PourModel> hole = leak_effect<PourModel>(0, {0, 0, 0.004}, {0, 0, -0.0055}, "into the floor");
  hole.name = "bad";
  effects.push_back(hole);
  SimulatedInteractionSettings settings;
  settings.spacing = 0.009;
  const Pour pour(pour_scene(), effects, settings);
  const ModelRun run = run_with(pour, "bad", {30});
  CHECK(pour.predict(run).empty());
  CHECK_THROWS_WITH(pour.started(run), decant_test::contains("exit"));
}

TEST_CASE("simulated interaction: sensors read the model in the frames that are compared") {
  Pour::Scene scene = pour_scene();
  scene.sensors.push_back({"lowest [m]", {0.001, 0}, [](PourModel& model) {
                             return static_cast<double>(model.fluid().position.row(2).minCoeff());
                           }});
  scene.sensors.push_back({"time [s]", {0.001, 0}, [](PourModel& model) { return model.time(); }});
  const Pour pour = pour_of(scene);
  const Observation seen = pour.predict({{}, 1, false});
  REQUIRE(seen.silhouettes.size() == 1);
  REQUIRE(seen.readings.size() == 2);
  CHECK(seen.readings[0].name() == "lowest [m]");
  PourModel model = pour.started({{}, 1, false});
  const double start = model.time();
  for (std::size_t frame = 0; frame < scene.times.size(); ++frame) {
    while (model.time() < start + scene.times[frame] - 1e-9) {
      const double left = start + scene.times[frame] - model.time();
      REQUIRE(model.step(std::min(SimulatedInteractionSettings{}.longest_step, left)).advanced());
    }
    CHECK(seen.readings[0].value(frame) == static_cast<double>(model.fluid().position.row(2).minCoeff()));
    CHECK(seen.readings[0].time(frame) == scene.times[frame]);
    CHECK(seen.readings[1].value(frame) == Approx(start + scene.times[frame]).margin(1e-6));
  }
  CHECK(seen.readings[0].value(6) < seen.readings[0].value(0) - 0.05);  // it has been poured
  Pour::Scene without_cameras = scene;
  without_cameras.cameras.clear();
  const Observation read = pour_of(without_cameras).predict({{}, 1, false});
  CHECK(read.silhouettes.empty());
  CHECK(read.readings[0].values() == seen.readings[0].values());
  // a sensor that shows half of each change, another only changes
  std::vector<InteractionEffect<PourModel>> gains = {sensor_gain_effect<PourModel>({0}, "of the first")};
  scene.sensors[1].from_first = true;
  SimulatedInteractionSettings settings;
  settings.spacing = 0.009;
  const Pour uncertain(scene, gains, settings);
  const Observation half = uncertain.predict({{{0, Eigen::VectorXd::Constant(1, 0.5)}}, 1, false});
  for (std::size_t frame = 0; frame < scene.times.size(); ++frame) {
    const double first = seen.readings[0].value(0);
    CHECK(half.readings[0].value(frame) - first == Approx(0.5 * (seen.readings[0].value(frame) - first)).margin(1e-6));
    CHECK(half.readings[1].value(frame) == Approx(scene.times[frame] - scene.times[0]).margin(1e-6));
  }
  scene.sensors[1].error.deviation = 0;
  CHECK_THROWS_WITH(pour_of(scene), decant_test::contains("'time [s]': deviation"));
  scene.sensors[1].read = nullptr;
  CHECK_THROWS_WITH(pour_of(scene), decant_test::contains("what 'time [s]' reads"));
}

TEST_CASE("simulated interaction: an effect of a user's own is a force, a name and a range") {
  auto effects = pour_catalogue();
  Effect stirrer;
  stirrer.name = "stirrer";
  stirrer.unit = "1/s^2";
  stirrer.components = {{"", 0, -50, 50}};
  effects.push_back(
      force_effect<Stirrer, PourModel>(stirrer, [](Stirrer& force, double s) { force.rate = static_cast<float>(s); }));
  SimulatedInteractionSettings settings;
  settings.spacing = 0.009;
  const Pour pour(pour_scene(), effects, settings);
  CHECK(pour.started(run_with(pour, "stirrer", {40})).force<Stirrer>().rate == 40);
  CHECK(apart(pour.predict(run_with(pour, "stirrer", {40})).silhouettes[0],
              pour.predict({{}, 1, false}).silhouettes[0]) > 5);
}

TEST_CASE("simulated interaction: scenes, effects and runs are checked") {
  CHECK_THROWS_WITH(Pour({}, {}), decant_test::contains("start"));
  Pour::Scene scene = pour_scene();
  scene.times[2] = scene.times[1];
  CHECK_THROWS_WITH(Pour(scene, {}), decant_test::contains("increasing"));
  scene = pour_scene();
  scene.cameras[0].camera_from_world.pop_back();
  CHECK_THROWS_WITH(Pour(scene, {}), decant_test::contains("poses of a camera"));
  auto effects = pour_catalogue();
  effects[0].components[0].low = 1;
  CHECK_THROWS_WITH(Pour(pour_scene(), effects), decant_test::contains("drag_linear"));
  effects = pour_catalogue();
  effects[0].apply = nullptr;
  CHECK_THROWS_WITH(Pour(pour_scene(), effects), decant_test::contains("apply"));
  const Pour pour = pour_of();
  CHECK_THROWS_WITH(pour.predict({{{99, Eigen::VectorXd::Zero(1), {}}}}), decant_test::contains("effect"));
  CHECK_THROWS_WITH(pour.predict({{{0, Eigen::VectorXd::Zero(2), {}}}}), decant_test::contains("each component"));
}
