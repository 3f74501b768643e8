// SPDX-License-Identifier: MIT
// Containers hold: whatever a vessel does, every particle is inside of it or has left over its rim. The check knows
// nothing of the library's own: it looks at places in the body's frame before and after each call of step.

#include <decant/simulation/simulator.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <decant/boundary/cavity.hpp>
#include <decant/boundary/mesh_repair.hpp>
#include <decant/boundary/shapes.hpp>
#include <decant/io/mesh_file.hpp>
#include <decant/simulation/fill.hpp>

#include "catch.hpp"
#include "data.hpp"

using namespace decant;

namespace {

constexpr double unbounded = std::numeric_limits<double>::infinity();
using std::numbers::pi;

// Round walls are polygons, at most 0.03 mm beyond the circle (boundary/shapes.hpp); the rest is rounding of floats.
constexpr double slack = 0.05e-3;

struct Vessel {
  std::string name;
  BodyShape shape;
  std::function<bool(const Vector3<double>&)> inside;  // below the rim, body's frame
  double rim;                                          // height of the rim's plane; unbounded: closed
};

Vessel cylinder(double radius, double height, double wall, bool open) {
  const CylinderInside form{radius, height, wall, open ? std::optional<Face>(Face::PositiveZ) : std::nullopt};
  return {open ? "open cylinder" : "closed cylinder", form,
          [=](const Vector3<double>& x) {
            return std::hypot(x[0], x[1]) < radius + slack && x[2] > -slack && x[2] < height + slack;
          },
          open ? height : unbounded};
}

Vessel box(const Vector3<double>& size, double wall) {
  return {
      "closed box", BoxInside{Vector3<double>::Zero(), size, wall, {}},
      [=](const Vector3<double>& x) { return (x.array() > -slack).all() && (x.array() < size.array() + slack).all(); },
      unbounded};
}

Vessel cup(double floor_radius, double rim_radius, double height, double wall) {
  return {"cup", Cup{floor_radius, rim_radius, height, wall},
          [=](const Vector3<double>& x) {
            const double radius = floor_radius + (rim_radius - floor_radius) * x[2] / height;
            return std::hypot(x[0], x[1]) < radius + slack && x[2] > -slack && x[2] < height + slack;
          },
          height};
}

Vessel bowl(double rim_radius, double depth, double wall) {
  const double radius = (rim_radius * rim_radius + depth * depth) / (2 * depth);
  // the sphere is polygons both ways, so chords add up to twice 0.03 mm
  return {"bowl", Bowl{rim_radius, depth, wall},
          [=](const Vector3<double>& x) {
            return (x - Vector3<double>(0, 0, radius)).norm() < radius + 3 * slack && x[2] < depth + slack;
          },
          depth};
}

// A cylinder with a handle of three bars, all in closed form.
Vessel mug(double radius, double height, double wall) {
  Vessel vessel = cylinder(radius, height, wall, true);
  vessel.name = "mug";
  const double half = 0.006, bar = 0.006, reach = 0.03;
  // where the bars' edges meet the round wall
  const double at_wall = std::sqrt((radius + wall) * (radius + wall) - half * half);
  const double out = at_wall + reach, low = 0.2 * height, high = 0.8 * height;
  for (const Box& part :
       {Box{{at_wall, -half, low}, {out, half, low + bar}}, Box{{at_wall, -half, high - bar}, {out, half, high}},
        Box{{out - bar, -half, low + bar}, {out, half, high - bar}}}) {
    vessel.shape.mesh = joined(std::move(vessel.shape.mesh), part.mesh());
    vessel.shape.parts.push_back(SolidBox{part.min, part.max});
  }
  return vessel;
}

Vessel scan(const std::string& name, const std::filesystem::path& file, double spacing) {
  const TriangleMesh mesh = repaired(read_mesh(file), spacing);
  const auto cavity = std::make_shared<const Cavity>(mesh);
  return {name, mesh, [cavity](const Vector3<double>& x) { return cavity->contains(x); }, cavity->rim_height()};
}

struct Drive {
  double speed = 0;      // largest of the body's origin [m/s], > 0
  double stroke = 0.06;  // of the shaking, or a little more [m]
  double tilt = 0;       // rocks to and fro up to here [rad]
  double spin = 0;       // about the body's z [rad/s]
  double tumble = 0;     // about a level axis [rad/s]
};

PoseTrack driven(const Drive& drive, double seconds) {
  // at their fastest all three swings together are as fast as the body is to be; they hardly ever are all at once
  const Vector3<double> swing(0.8, 0.3, 0.5), rate(1, 0.73, 0.61);
  const double pulse = drive.speed / drive.stroke / swing.cwiseProduct(rate).norm();
  std::vector<PoseTrack::Sample> samples;
  double fastest = 0;
  for (double t = 0; t < seconds + 0.05; t += 0.002) {
    // starts within a fifth of a second
    const double on = std::min(1.0, t / 0.2);
    Pose pose;
    pose.translation = on * drive.stroke * swing.cwiseProduct((pulse * t * rate).array().sin().matrix());
    pose.rotation = Eigen::AngleAxisd(on * drive.tilt * std::sin(5 * t), Eigen::Vector3d(1, 0.5, 0).normalized()) *
                    Eigen::AngleAxisd(drive.tumble * t, Eigen::Vector3d(0.3, 1, 0).normalized()) *
                    Eigen::AngleAxisd(drive.spin * t, Eigen::Vector3d::UnitZ());
    if (!samples.empty()) {
      fastest = std::max(fastest, (pose.translation - samples.back().pose.translation).norm() / 0.002);
    }
    samples.push_back({t, pose});
  }
  for (PoseTrack::Sample& sample : samples) {
    sample.pose.translation *= drive.speed / fastest;
  }
  return PoseTrack(std::move(samples));
}

enum class Region { Inside, Above, Outside };

struct Outcome {
  Index particles = 0;
  Index inside = 0, spilled = 0;
  Index through_wall = 0;  // changed sides without a way over the rim
  Index in_material = 0;   // ended a step in the wall
  Index missing = 0;       // not accounted for
  Index non_finite = 0, refused_steps = 0, lost = 0, guarded = 0;
  double fastest = 0;
};

template <class Parts>
Outcome watch(Simulator<Parts>& simulator, BodyId body, const Vessel& vessel, double seconds, double frame = 0.002) {
  struct Seen {
    Region region;
    double height, speed;
  };
  Outcome outcome;
  const auto& surface = *simulator.bodies()[body].surface;
  const auto region_of = [&](const Vector3<double>& x) {
    if (x[2] > vessel.rim) {
      return Region::Above;
    }
    return vessel.inside(x) ? Region::Inside : Region::Outside;
  };
  std::unordered_map<std::uint32_t, Seen> seen;
  const double spacing = simulator.settings().spacing;
  Index removed = 0;
  outcome.particles = simulator.fluid().size();
  // of any corner of its bounds during the next frame
  const auto largest_speed = [&](const auto& moving, double time) {
    const Pose now = moving.motion.at(time), then = moving.motion.at(time + frame);
    double largest = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const Vector3<double> x = moving.bounds.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner));
      largest = std::max(largest, (then * x - now * x).norm() / frame);
    }
    return largest;
  };
  const auto frames = static_cast<int>(std::ceil(seconds / frame));
  double earlier_wall_speed = 0;
  for (int k = 0; k <= frames; ++k) {
    if (k > 0) {
      const StepReport report = simulator.step(frame);
      outcome.refused_steps += report.advanced() ? 0 : 1;
      outcome.lost = report.lost;
      outcome.guarded += report.guarded;
    }
    const auto& fluid = simulator.fluid();
    const Pose pose = simulator.bodies()[body].motion.at(simulator.time());
    const Pose body_from_world = pose.inverse();
    const double wall_speed = largest_speed(simulator.bodies()[body], simulator.time());
    outcome.inside = 0;
    outcome.spilled = removed;
    for (Index i = 0; i < fluid.size(); ++i) {
      const Vector3<double> place = fluid.position.col(i).template cast<double>();
      const double speed = static_cast<double>(fluid.velocity.col(i).norm());
      if (!place.allFinite() || !std::isfinite(speed)) {
        ++outcome.non_finite;
        continue;
      }
      outcome.fastest = std::max(outcome.fastest, speed);
      const Vector3<double> x = body_from_world * place;
      const Region region = region_of(x);
      ++(region == Region::Inside ? outcome.inside : outcome.spilled);
      const auto [entry, fresh] = seen.try_emplace(fluid.id[i], Seen{region, x[2], speed});
      Seen& before = entry->second;
      if (fresh) {
        outcome.missing += k > 0 ? 1 : 0;
      } else if (before.region != region && before.region != Region::Above && region != Region::Above) {
        // From inside to outside or back within one call, both below the rim: only over it, and only if that is near.
        const double way = 2 * vessel.rim - before.height - x[2];
        const double reach =
            1.5 * frame * (std::max(before.speed, speed) + std::max(wall_speed, earlier_wall_speed)) + spacing;
        outcome.through_wall += way > reach ? 1 : 0;
      }
      if (region == Region::Outside && surface.inside_material(x) &&
          surface.closest_point(x, 1).value().distance > slack) {
        ++outcome.in_material;
      }
      before = {region, x[2], speed};
    }
    outcome.missing += std::abs(outcome.inside + outcome.spilled - outcome.particles) + outcome.non_finite;
    earlier_wall_speed = wall_speed;
    // what has left for good would fall ever faster and shorten everybody's steps
    removed += simulator.remove_particles_if([&](Index i) {
      const Vector3<double> x = body_from_world * Vector3<double>(fluid.position.col(i).template cast<double>());
      return region_of(x) != Region::Inside &&
             (x - surface.bounds().center()).norm() > surface.bounds().diagonal().norm();
    });
  }
  return outcome;
}

template <class Parts = DefaultParts<>>
Outcome shake(const Vessel& vessel, double spacing, double filled, const Drive& drive, double seconds) {
  SimulatorSettings settings;
  settings.spacing = spacing;
  settings.threads = {1};
  Simulator<Parts> simulator(settings);
  const BodyId body = simulator.add_body(vessel.name, vessel.shape);
  fill(simulator, body, FillAmount::fraction(filled));
  simulator.set_motion(body, driven(drive, seconds));
  return watch(simulator, body, vessel, seconds);
}

void check_held(const Vessel& vessel, const Outcome& outcome) {
  INFO(vessel.name << ": " << outcome.particles << " particles, inside " << outcome.inside << ", spilled "
                   << outcome.spilled << ", guarded " << outcome.guarded << ", fastest [m/s] " << outcome.fastest);
  CHECK(outcome.particles > 50);
  CHECK(outcome.inside + outcome.spilled == outcome.particles);
  CHECK(outcome.through_wall == 0);
  CHECK(outcome.in_material == 0);
  CHECK(outcome.missing == 0);
  CHECK(outcome.non_finite == 0);
  CHECK(outcome.refused_steps == 0);
  CHECK(outcome.lost == 0);
  if (vessel.rim == unbounded) {
    CHECK(outcome.spilled == 0);
  }
}

void check(const Vessel& vessel, double spacing, double filled, const Drive& drive, double seconds) {
  check_held(vessel, shake(vessel, spacing, filled, drive, seconds));
}

const Drive hard{2.0, 0.06, 0.5, 2 * pi, 0};
const Drive rolling{2.0, 0.06, 0.0, 0, 2 * pi};
const Drive sweeping{2.0, 0.5, 0.2, 2 * pi, 0};  // as fast, but at 1 g instead of 8: open vessels keep some
const Drive lively{0.6, 0.05, 0.2, 2 * pi, 0};   // spills some, keeps some
const Drive gentle{0.05, 0.02, 0.1, 1, 0};       // far below the liquid's own frequencies

}  // namespace

TEST_CASE("containers: bodies are driven as fast as the drives say") {
  for (const Drive& drive : {hard, rolling, sweeping, lively, gentle}) {
    const PoseTrack track = driven(drive, 2);
    double fastest = 0, most_turn = 0;
    for (double t = 0; t < 2; t += 0.001) {
      const RigidVelocity velocity = track.velocity(t, 0.001);
      fastest = std::max(fastest, velocity.linear.norm());
      most_turn = std::max(most_turn, velocity.angular.norm());
    }
    CHECK(fastest == Approx(drive.speed).epsilon(0.01));
    CHECK(most_turn > 0.99 * std::max(drive.spin, drive.tumble));
  }
}

TEST_CASE("containers: a closed cylinder with a wall of 1 mm loses nothing when shaken and tumbled") {
  check(cylinder(0.025, 0.06, 0.001, false), 0.005, 0.6, rolling, 3);
}

TEST_CASE("containers: a closed cylinder with a wall of 5 mm loses nothing when shaken and spun") {
  check(cylinder(0.04, 0.08, 0.005, false), 0.008, 0.5, hard, 3);
}

TEST_CASE("containers: a closed box with a wall of 1 mm loses nothing when shaken and tumbled") {
  check(box({0.05, 0.04, 0.05}, 0.001), 0.005, 0.7, rolling, 3);
}

TEST_CASE("containers: small closed vessels at fine spacing lose nothing") {
  check(cylinder(0.012, 0.03, 0.001, false), 0.003, 0.6, rolling, 1);
  check(box({0.024, 0.024, 0.03}, 0.002), 0.003, 0.6, hard, 1);
}

TEST_CASE("containers: open cylinders spill over the rim only") {
  check(cylinder(0.03, 0.08, 0.001, true), 0.005, 0.6, hard, 2);
  check(cylinder(0.04, 0.08, 0.003, true), 0.008, 0.6, hard, 2);
}

TEST_CASE("containers: a mug with a handle spills over the rim only") {
  check(mug(0.03, 0.07, 0.002), 0.008, 0.6, hard, 2);
}

TEST_CASE("containers: cups spill over the rim only") {
  check(cup(0.025, 0.035, 0.07, 0.001), 0.006, 0.6, hard, 2);
  check(cup(0.03, 0.04, 0.09, 0.002), 0.008, 0.6, hard, 2);
}

TEST_CASE("containers: bowls spill over the rim only") {
  check(bowl(0.06, 0.04, 0.001), 0.007, 0.6, hard, 2);
  check(bowl(0.06, 0.05, 0.003), 0.008, 0.6, hard, 2);
}

TEST_CASE("containers: gently moved vessels keep everything") {
  for (const Vessel& vessel :
       {cylinder(0.03, 0.08, 0.001, true), cup(0.03, 0.04, 0.09, 0.002), bowl(0.06, 0.05, 0.002)}) {
    const Outcome outcome = shake(vessel, 0.008, 0.4, gentle, 1);
    check_held(vessel, outcome);
    CHECK(outcome.inside == outcome.particles);
  }
}

TEST_CASE("containers: a cup that is turned over is empty and all of it left over the rim") {
  const Vessel vessel = cup(0.03, 0.04, 0.06, 0.002);
  SimulatorSettings settings;
  settings.spacing = 0.008;
  settings.threads = {1};
  LiquidSimulator simulator(settings);
  const BodyId body = simulator.add_body("cup", vessel.shape);
  fill(simulator, body, FillAmount::fraction(0.7));
  std::vector<PoseTrack::Sample> samples;
  for (int k = 0; k <= 50; ++k) {
    samples.push_back({0.02 * k, {Eigen::Quaterniond(Eigen::AngleAxisd(pi * k / 50, Eigen::Vector3d::UnitY())), {}}});
    samples.back().pose.translation.setZero();
  }
  simulator.set_motion(body, PoseTrack(std::move(samples)));
  const Outcome outcome = watch(simulator, body, vessel, 2.0);
  check_held(vessel, outcome);
  CHECK(outcome.inside == 0);
}

namespace {

// A cup full of liquid that stands at rest, within a box full of liquid around it or alone, after some steps.
std::unordered_map<std::uint32_t, std::array<Vector3<double>, 2>> full_cup(bool surrounded, int frames,
                                                                           std::vector<double>& densities) {
  SimulatorSettings settings;
  settings.spacing = 0.005;
  settings.threads = {1};
  settings.fixed_step = 0.001;
  Simulator<DefaultParts<double>> simulator(settings);
  // tight tolerances: what the solver leaves over depends on the mean of all liquid
  simulator.pressure_solver().density_tolerance = 1e-6;
  simulator.pressure_solver().divergence_tolerance = 1e-6;
  const double d = settings.spacing, wall = 0.001;
  const BodyId cup_body = simulator.add_body("cup", BoxInside{{0, 0, 0}, {6 * d, 6 * d, 6 * d}, wall, Face::PositiveZ});
  const BodyId tank =
      simulator.add_body("tank", BoxInside{{-5 * d, -5 * d, -5 * d}, {11 * d, 11 * d, 20 * d}, 0.002, Face::PositiveZ});
  std::vector<Vector3<double>> in, out;
  for (double x = -4.5 * d; x < 11 * d; x += d) {
    for (double y = -4.5 * d; y < 11 * d; y += d) {
      for (double z = -4.5 * d; z < 5 * d; z += d) {
        const Vector3<double> place(x, y, z);
        if ((place.array() > 0).all() && x < 6 * d && y < 6 * d) {
          in.push_back(place);
        } else if (x < -wall - 0.4 * d || y < -wall - 0.4 * d || z < -wall - 0.4 * d || x > 6 * d + wall + 0.4 * d ||
                   y > 6 * d + wall + 0.4 * d) {
          out.push_back(place);
        }
      }
    }
  }
  const auto add = [&](const std::vector<Vector3<double>>& places, BodyId origin) {
    PointArray<double> x(3, static_cast<Index>(places.size()));
    for (std::size_t k = 0; k < places.size(); ++k) {
      x.col(static_cast<Index>(k)) = places[k];
    }
    simulator.add_particles(x, PointArray<double>::Zero(3, x.cols()), origin);
  };
  add(in, cup_body);
  if (surrounded) {
    add(out, tank);
  }
  densities.assign(in.size(), 0);
  std::unordered_map<std::uint32_t, std::array<Vector3<double>, 2>> result;
  for (int k = 0; k < frames; ++k) {
    REQUIRE(simulator.step(0.001).advanced());
    for (Index i = 0; k == 0 && i < simulator.fluid().size(); ++i) {
      if (simulator.fluid().origin[i] == cup_body) {
        densities[simulator.fluid().id[i]] = simulator.fluid().density[i];
      }
    }
  }
  for (Index i = 0; i < simulator.fluid().size(); ++i) {
    if (simulator.fluid().origin[i] == cup_body) {
      result[simulator.fluid().id[i]] = {simulator.fluid().position.col(i), simulator.fluid().velocity.col(i)};
    }
  }
  return result;
}

}  // namespace

TEST_CASE("containers: liquid around a full cup is not felt inside") {
  std::vector<double> alone_density, surrounded_density;
  const auto alone = full_cup(false, 20, alone_density);
  const auto surrounded = full_cup(true, 20, surrounded_density);
  REQUIRE(alone.size() == 180);
  REQUIRE(surrounded.size() == alone.size());
  for (std::size_t k = 0; k < alone_density.size(); ++k) {
    // the same sums in another order
    REQUIRE(surrounded_density[k] == Approx(alone_density[k]).epsilon(1e-9));
  }
  double farthest = 0, fastest = 0;
  for (const auto& [id, there] : alone) {
    farthest = std::max(farthest, (there[0] - surrounded.at(id)[0]).norm());
    fastest = std::max(fastest, (there[1] - surrounded.at(id)[1]).norm());
  }
  INFO("differences [m] " << farthest << " [m/s] " << fastest);
  // solver tolerances are what remains: 1e-6 gives 4e-5 m/s, 1e-8 gives 3e-7 m/s
  CHECK(farthest < 1e-6);
  CHECK(fastest < 1e-4);
}

TEST_CASE("containers: a plate of 1 mm hides what is behind it from everybody before it") {
  const double d = 0.008;
  std::vector<double> density;
  for (const double behind : {0.0, 0.1, 0.4, 0.7}) {  // 0: nothing there
    for (const double before : {0.3, 0.9, 1.1, 1.5}) {
      SimulatorSettings settings;
      settings.spacing = d;
      settings.threads = {1};
      Simulator<DefaultParts<double>> simulator(settings);
      simulator.add_body("plate", Box{{-0.001, -0.5, -0.5}, {0, 0.5, 0.5}});
      PointArray<double> x(3, behind > 0 ? 26 : 1);
      x.col(0) = Vector3<double>(before * d, 0, 0);
      for (Index k = 1; k < x.cols(); ++k) {
        const auto y = static_cast<double>((k - 1) % 5 - 2) * d, z = static_cast<double>((k - 1) / 5 - 2) * d;
        x.col(k) = Vector3<double>(-0.001 - behind * d, y, z);
      }
      simulator.add_particles(x, PointArray<double>::Zero(3, x.cols()), 0);
      REQUIRE(simulator.step(1e-6).advanced());
      const auto& id = simulator.fluid().id;
      const Index i = std::find(id.data(), id.data() + id.size(), 0u) - id.data();
      density.push_back(simulator.fluid().density[i]);
      INFO("at " << before << " spacings, liquid behind at " << behind);
      CHECK(density.back() == Approx(density[(density.size() - 1) % 4]).epsilon(1e-9));
    }
  }
}

TEST_CASE("containers: real cups and mugs and bowls hold when tilted and shaken", "[slow]") {
  const double spacing = 0.008;
  for (const auto& [file, drive] : {std::pair<const char*, Drive>{"meshes_contactdb/cup.stl", hard},
                                    {"meshes_contactdb/bowl.stl", hard},
                                    {"meshes_ycb/025_mug.obj", hard},
                                    {"meshes_ycb/024_bowl.obj", hard}}) {
    if (const auto path = decant_test::measurements(file)) {
      check(scan(file, *path, spacing), spacing, 0.5, drive, 1);
    }
  }
}

// A minute each, walls of 1 to 5 mm, spacings of 3 to 8 mm. Open vessels are empty within seconds of hard shaking, so
// that they are shaken hard for less.

TEST_CASE("containers: closed vessels lose nothing in a minute of shaking and turning", "[.][long]") {
  check(cylinder(0.03, 0.05, 0.001, false), 0.008, 0.6, rolling, 60);
  check(cylinder(0.025, 0.06, 0.005, false), 0.005, 0.6, hard, 60);
  check(box({0.05, 0.04, 0.05}, 0.003), 0.006, 0.7, rolling, 60);
  check(box({0.024, 0.024, 0.03}, 0.002), 0.003, 0.6, hard, 60);
}

TEST_CASE("containers: open vessels spill over the rim only in a minute of shaking and turning", "[.][long]") {
  check(cylinder(0.03, 0.08, 0.001, true), 0.006, 0.5, lively, 60);
  check(cup(0.03, 0.035, 0.08, 0.001), 0.006, 0.5, lively, 60);
  check(cup(0.03, 0.035, 0.08, 0.005), 0.007, 0.5, lively, 60);
  check(bowl(0.06, 0.05, 0.004), 0.007, 0.5, lively, 60);
  check(mug(0.03, 0.08, 0.002), 0.008, 0.5, lively, 60);
}

TEST_CASE("containers: open vessels spill over the rim only in a minute at full speed", "[.][long]") {
  check(cylinder(0.03, 0.12, 0.005, true), 0.008, 0.5, sweeping, 60);
  check(cup(0.03, 0.04, 0.09, 0.002), 0.007, 0.5, sweeping, 60);
  check(bowl(0.06, 0.05, 0.005), 0.007, 0.5, sweeping, 60);
  check(mug(0.03, 0.1, 0.002), 0.008, 0.5, sweeping, 60);
}

TEST_CASE("containers: open vessels spill over the rim only when shaken hard", "[.][long]") {
  check(cylinder(0.03, 0.12, 0.005, true), 0.008, 0.8, hard, 10);
  check(cylinder(0.03, 0.08, 0.001, true), 0.006, 0.8, hard, 10);
  check(cup(0.03, 0.04, 0.09, 0.002), 0.008, 0.8, hard, 10);
  check(bowl(0.06, 0.05, 0.005), 0.007, 0.8, hard, 10);
  check(mug(0.03, 0.08, 0.002), 0.008, 0.8, hard, 10);
}

TEST_CASE("containers: open vessels at fine spacing spill over the rim only", "[.][long]") {
  check(cylinder(0.02, 0.05, 0.001, true), 0.003, 0.6, hard, 5);
  check(cup(0.018, 0.022, 0.05, 0.005), 0.003, 0.6, hard, 5);
  check(bowl(0.035, 0.025, 0.003), 0.003, 0.6, hard, 5);
}

namespace {

// The meshes that are at hand, each of some shape of vessel.
std::vector<Vessel> scans(double spacing) {
  std::vector<Vessel> vessels{scan("mug.ply", decant_test::repository("examples/scenes/mug.ply"), spacing)};
  for (const char* file :
       {"meshes_contactdb/cup.stl", "meshes_contactdb/bowl.stl", "meshes_ycb/025_mug.obj", "meshes_ycb/024_bowl.obj"}) {
    if (const auto path = decant_test::measurements(file)) {
      vessels.push_back(scan(file, *path, spacing));
    }
  }
  return vessels;
}

}  // namespace

TEST_CASE("containers: real cups and mugs and bowls hold for a minute of shaking and turning", "[.][long]") {
  for (const Vessel& vessel : scans(0.008)) {
    check(vessel, 0.008, 0.5, lively, 60);
  }
}

TEST_CASE("containers: real cups and mugs and bowls hold for half a minute at full speed", "[.][long]") {
  for (const Vessel& vessel : scans(0.008)) {
    check(vessel, 0.008, 0.5, sweeping, 30);
  }
}

TEST_CASE("containers: real cups and mugs and bowls hold when shaken hard and tumbled", "[.][long]") {
  for (const Vessel& vessel : scans(0.008)) {
    check(vessel, 0.008, 0.6, hard, 10);
    check(vessel, 0.008, 0.6, rolling, 3);
  }
}
