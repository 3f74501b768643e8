// SPDX-License-Identifier: MIT
// Which effects are hidden in which recordings, and the parts of a twin that stand on their own: forces that only it
// has against their laws in numbers, holes through which liquid leaves, silhouettes that are fattened.

#include "../../examples/support/effect_cases.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <numbers>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/cavity.hpp>
#include <decant/testing/force.hpp>

#include "../../examples/support/effect_forces.hpp"
#include "../../examples/support/fattened_mask.hpp"
#include "../../examples/support/first_sight.hpp"
#include "catch.hpp"

using namespace example;

namespace {

constexpr std::array both_ranges{CaseRange::Develop, CaseRange::Report};
constexpr std::array kinds_of_effects{CaseKind::Moderate,    CaseKind::Weak,     CaseKind::Outside,
                                      CaseKind::Measurement, CaseKind::Cylinder, CaseKind::Junction};

/// One particle, as a force sees it.
struct LoneParticle {
  decant::testing::LooseLiquid<decant::CubicSpline<float>> liquid;
  decant::PointArray<float> acceleration = decant::PointArray<float>::Zero(3, 1);

  LoneParticle(const decant::Vector3<double>& position, const decant::Vector3<double>& velocity) {
    liquid.spacing = 0.005F;
    liquid.smoothing_length = 0.005F;
    liquid.time_step = 0.001F;
    liquid.place(position.cast<float>());
    liquid.fluid.velocity.col(0) = velocity.cast<float>();
  }

  template <class Force>
  decant::Vector3<double> felt(Force force, double time) {
    auto step = liquid.view();
    step.time = time;
    acceleration.setOnes();  // what is there is added to
    force.accumulate(step, acceleration);
    return acceleration.col(0).cast<double>() - decant::Vector3<double>::Ones();
  }
};

}  // namespace

TEST_CASE("effect cases: ranges share neither scenarios nor seeds, and a case is the same each time") {
  std::set<std::uint32_t> seeds;
  std::size_t cases = 0;
  std::map<CaseRange, std::set<std::size_t>> scenarios;
  for (const CaseRange range : both_ranges) {
    for (const CaseKind kind : {CaseKind::Moderate, CaseKind::Weak, CaseKind::Nothing, CaseKind::Outside,
                                CaseKind::Measurement, CaseKind::Two}) {
      for (int number = 0; number < 100; ++number) {
        const EffectCase one = effect_case(range, kind, number), again = effect_case(range, kind, number);
        CHECK((one.seed == again.seed && one.effect.name == again.effect.name &&
               one.effect.strength == again.effect.strength && one.effect.displacement == again.effect.displacement));
        seeds.insert(one.seed);
        scenarios[range].insert(one.scenario);
        ++cases;
      }
    }
  }
  for (std::uint32_t seed = 0; seed < 100; ++seed) {
    seeds.insert(reference_case(0, seed).seed);
    seeds.insert(reference_case(1, seed).seed);
    cases += 2;
  }
  CHECK(seeds.size() == cases);
  CHECK(scenarios[CaseRange::Develop] == std::set<std::size_t>{0, 1, 2, 3, 4});
  CHECK(scenarios[CaseRange::Report] == std::set<std::size_t>{5, 6, 7, 8});
  const auto cylinders = [](CaseRange range) { return scenarios_of(range, CaseKind::Cylinder); };
  CHECK(cylinders(CaseRange::Develop) == std::vector<std::size_t>{0, 1});
  CHECK(cylinders(CaseRange::Report) == std::vector<std::size_t>{2, 3, 4, 5, 6});
  CHECK(scenarios_of(CaseRange::Develop, CaseKind::Junction) == std::vector<std::size_t>{0});
  CHECK(scenarios_of(CaseRange::Report, CaseKind::Junction) == std::vector<std::size_t>{1, 2, 3});
  CHECK(effect_case(CaseRange::Develop, CaseKind::Cylinder, 3).seed !=
        effect_case(CaseRange::Report, CaseKind::Cylinder, 3).seed);
  CHECK_THROWS_AS(effect_case(CaseRange::Develop, CaseKind::Weak, -1), std::invalid_argument);
  CHECK_THROWS_AS(reference_case(effect_scenarios().size(), 1), std::invalid_argument);
}

TEST_CASE("effect cases: each effect comes equally often and in all scenarios, as strong as its kind says") {
  for (const CaseRange range : both_ranges) {
    for (const CaseKind kind : kinds_of_effects) {
      const std::vector<EffectEntry>& entries = entries_of(kind);
      const std::size_t rounds = 20 * scenarios_of(range, kind).size();
      std::map<std::string, std::map<std::size_t, std::size_t>> found;
      std::map<std::string, std::set<bool>> signs;
      std::size_t thinning = 0;
      for (std::size_t k = 0; k < rounds * entries.size(); ++k) {
        const EffectCase hidden = effect_case(range, kind, static_cast<int>(k));
        const bool thins = hidden.effect.is("shear_thinning");
        const EffectEntry& listed = entries[k % entries.size()];
        const EffectEntry& entry = thins ? shear_thinning : listed;
        REQUIRE(hidden.effect.name == entry.name);
        CHECK(hidden.effect.family == listed.family);
        ++found[listed.name][hidden.scenario];
        thinning += thins ? 1 : 0;
        signs[listed.name].insert(hidden.effect.strength > 0);
        const bool roll = hidden.effect.variant == "roll";
        const double factor = kind == CaseKind::Weak ? 0.5 : 1;
        const double least = hidden.effect.is("camera_shift") ? (roll ? 0.5 : 2) : entry.least;
        const double most = hidden.effect.is("camera_shift") ? (roll ? 1 : 6) : entry.most;
        CHECK(std::abs(hidden.effect.strength) >= factor * least);
        CHECK(std::abs(hidden.effect.strength) <= factor * most);
        CHECK(hidden.effect.direction.norm() == Approx(1));
      }
      for (const EffectEntry& entry : entries) {
        INFO(entry.name);
        if (std::string(entry.name) == "back_pressure") {
          for (const auto& [scenario, times] : found[entry.name]) {
            CHECK(effect_container(effect_scenarios()[scenario].pours[0].container).neck);
          }
        } else {
          CHECK(found[entry.name].size() == scenarios_of(range, kind).size());
          for (const auto& [scenario, times] : found[entry.name]) {
            CHECK(times == 20);
          }
        }
        const bool either = entry.either_sign || std::string(entry.name) == "camera_shift";
        CHECK(signs[entry.name].size() == (either ? 2U : 1U));
      }
      const bool physics = kind == CaseKind::Moderate || kind == CaseKind::Weak;
      CHECK(thinning == (physics ? rounds / 2 : 0));
    }
  }
}

TEST_CASE("effect cases: there are as many of each kind to report on as a share of them takes") {
  const auto reported = [](CaseKind kind) { return usual_cases(CaseRange::Report, kind); };
  CHECK(reported(CaseKind::Moderate) >= 100);
  CHECK(reported(CaseKind::Nothing) >= 60);
  for (const CaseKind kind : {CaseKind::Outside, CaseKind::Measurement, CaseKind::Two, CaseKind::Cylinder,
                              CaseKind::CylinderTwo, CaseKind::Junction}) {
    CHECK(reported(kind) >= 24);
  }
}

TEST_CASE("effect scenarios: what may be recorded next differs from what was, and there is no more of it") {
  const EffectScenario& pours = effect_scenarios().front();
  CHECK(pours.pour(2).lip_height > pours.pour(0).lip_height);
  CHECK(pours.pour(3).tilt.size() > pours.pour(0).tilt.size());
  CHECK(pours.pour(4).tilt.back().time > pours.pour(0).tilt.back().time);
  CHECK(pours.pour(5).fill < pours.pour(0).fill);
  CHECK(interaction_letter(5) == "f");
  CHECK_THROWS_AS(pours.pour(6), std::out_of_range);
  CHECK_THROWS_AS(cylinder_scenarios().front().path(6), std::out_of_range);
  CHECK_THROWS_AS(junction_scenarios().front().pour(6), std::out_of_range);
}

TEST_CASE("effect cases: two at once are of different families, and all pairs come up") {
  for (const CaseKind kind : {CaseKind::Two, CaseKind::CylinderTwo}) {
    const std::vector<EffectEntry>& entries = entries_of(kind);
    std::set<std::set<std::string>> pairs, possible;
    for (const EffectEntry& one : entries) {
      for (const EffectEntry& other : entries) {
        if (std::string(one.family) != other.family) {
          possible.insert({one.family, other.family});
        }
      }
    }
    for (std::size_t k = 0; k < entries.size() * entries.size(); ++k) {
      const EffectCase hidden = effect_case(CaseRange::Report, kind, static_cast<int>(k));
      REQUIRE(hidden.effects().size() == 2);
      CHECK(hidden.effect.family != hidden.second.family);
      pairs.insert({hidden.effect.family, hidden.second.family});
    }
    CHECK(pairs == possible);
  }
  CHECK(effect_case(CaseRange::Report, CaseKind::Moderate, 3).effects().size() == 1);
  CHECK(effect_case(CaseRange::Report, CaseKind::Nothing, 3).effects().empty());
}

TEST_CASE("effect cases: tolerated errors are within what is tolerated, and differ between pours") {
  double latency = 0, offset = 0, turn = 0, pull = 0, fill = 0;
  for (int number = 0; number < 300; ++number) {
    const EffectCase hidden = effect_case(CaseRange::Develop, CaseKind::Nothing, number);
    CHECK(hidden.effect.is("nothing"));
    CHECK(tolerated_errors(hidden, 0).latency != tolerated_errors(hidden, 1).latency);
    const ToleratedErrors errors = tolerated_errors(hidden, 0);
    latency = std::max(latency, std::abs(errors.latency));
    offset = std::max({offset, errors.pan_offset.norm(), errors.container_error.translation.norm()});
    turn = std::max(turn, Eigen::AngleAxisd(errors.container_error.rotation).angle() * 180 / std::numbers::pi);
    pull = std::max(pull, errors.pull.norm());
    fill = std::max(fill, std::abs(errors.fill));
  }
  // of 300 even draws the largest is above 0.95 of the limit but for a chance of 2e-7
  CHECK((latency > 0.0057 && latency <= 0.006));
  CHECK((offset > 0.00095 && offset <= 0.0010001));
  CHECK((turn > 0.285 && turn <= 0.30001));
  CHECK((pull > 0.019 && pull <= 0.020001));
  CHECK((fill > 0.0095 && fill <= 0.01));
}

TEST_CASE("effect scenarios: the lip stays in place, at rest for a quarter of a second, and what is recorded is near") {
  for (std::size_t scenario = 0; scenario < effect_scenarios().size(); ++scenario) {
    for (std::size_t which = 0; which < 2 + further_interactions; ++which) {
      RecordedMotion motion(scenario, which);
      const PourPlan& plan = motion.plan();
      const decant::Vector3<double> lip = effect_container(plan.container).lip;
      const bool further = which >= 2;
      CHECK((plan.duration >= 2.7 && plan.duration <= (further ? 4.1 : 3.2)));
      CHECK((plan.lip_height >= 0.15 && plan.lip_height <= (further ? 0.30 : 0.25)));
      CHECK((plan.fill >= (further ? 0.37 : 0.5) && plan.fill <= 0.8));
      CHECK(plan.tilt.back().time <= plan.duration);
      CHECK((!further || plan.container == effect_scenarios()[scenario].pours[0].container));
      const decant::Pose first = motion.smooth(0);
      for (int frame = 0; frame < 30 * plan.duration; ++frame) {
        const double time = frame / 30.0;
        const decant::Pose pose = motion.smooth(time), recorded = motion.next_recorded(time);
        if (time <= 0.25) {
          CHECK((pose.translation == first.translation && pose.rotation.coeffs() == first.rotation.coeffs()));
        }
        CHECK((pose * lip - effect_scenarios()[scenario].lip(which)).norm() <
              0.006);  // three waves of 0.8 mm on 3 axes
        CHECK((recorded.translation - pose.translation).norm() <= 0.0002 + 1e-12);
        CHECK(recorded.rotation.angularDistance(pose.rotation) * 180 / std::numbers::pi <= 0.1 + 1e-6);
      }
      // the container's axis leans by the plan's last tilt, but for the tremor's 2 degrees
      const double tilt = std::acos((motion.smooth(plan.duration).rotation * Eigen::Vector3d::UnitZ()).z());
      CHECK(std::abs(tilt * 180 / std::numbers::pi - plan.tilt.back().tilt_deg) < 2);
    }
  }
}

TEST_CASE("cylinder scenarios: paths lead from rest to rest, smoothly, and slosh what is in the cylinder") {
  for (const CylinderScenario& scenario : cylinder_scenarios()) {
    for (std::size_t which = 0; which < 2 + further_interactions; ++which) {
      const CylinderPath path = scenario.path(which);
      const double step = 1e-3;
      const auto place = [&](double time) { return path.at(time).translation; };
      const auto acceleration = [&](double time) {
        return decant::Vector3<double>((place(time + step) - 2 * place(time) + place(time - step)) / (step * step));
      };
      CHECK(place(path.rest).norm() == 0);
      CHECK(path.at(path.rest).rotation.angularDistance(Eigen::Quaterniond::Identity()) == Approx(0).margin(1e-9));
      CHECK(place(path.rest + path.moving).norm() < 1e-9);
      CHECK(place(path.duration()).norm() < 1e-9);
      const Eigen::Quaterniond turned(Eigen::AngleAxisd(path.turn, Eigen::Vector3d::UnitZ()));
      CHECK(path.at(path.duration()).rotation.angularDistance(turned) == Approx(0).margin(1e-6));
      double strongest = 0, jump = 0;
      for (double time = step; time < path.duration(); time += step) {
        strongest = std::max(strongest, acceleration(time).head<2>().norm());
        jump = std::max(jump, (acceleration(time + step) - acceleration(time)).norm());
      }
      CHECK(strongest > 1);  // the surface leans by a tenth at least
      CHECK(strongest < 6);  // and liquid stays in
      CHECK(jump < 0.15);
    }
  }
}

TEST_CASE("junction scenarios: legs pass what is asked for, and bowls hold what is poured") {
  for (const JunctionScenario& scenario : junction_scenarios()) {
    const decant::BoundingVolumeHierarchy pipes(scenario.pipes().mesh());
    LegOpenings half;
    half.left = 0.5;
    const decant::BoundingVolumeHierarchy narrow(scenario.pipes(half).mesh());
    const auto radius_at = [&](const decant::BoundingVolumeHierarchy& of, double side) {
      const double share = 0.5;
      const decant::Vector3<double> middle(side * share * scenario.reach, 0, 0.18 - share * scenario.fall);
      const auto hit = of.first_hit_along(middle, decant::Vector3<double>::UnitY(), 0.1);
      return hit ? 0.1 * hit->fraction : 0.0;
    };
    for (const double side : {-1.0, 1.0}) {
      CHECK(radius_at(pipes, side) == Approx(scenario.leg_radius).epsilon(0.01));
      CHECK(radius_at(narrow, side) == Approx((side < 0 ? std::sqrt(0.5) : 1) * scenario.leg_radius).epsilon(0.02));
    }
    for (std::size_t which = 0; which < 2 + further_interactions; ++which) {
      const decant::InletSettings inlet = scenario.inlet(which);
      double volume = 0;
      for (std::size_t k = 1; k < inlet.flow.size(); ++k) {
        volume +=
            0.5 * (inlet.flow[k].second + inlet.flow[k - 1].second) * (inlet.flow[k].first - inlet.flow[k - 1].first);
      }
      CHECK(volume == Approx(scenario.pour(which).first).epsilon(1e-3));
      CHECK(volume < scenario.bowl().volume());  // all of it in one
      CHECK(inlet.flow.back().first + scenario.runs_out == Approx(scenario.duration(which)));
    }
  }
}

TEST_CASE("effect scenarios: containers hold at first what any case fills in") {
  for (std::size_t scenario = 0; scenario < effect_scenarios().size(); ++scenario) {
    for (std::size_t which = 0; which < 2 + further_interactions; ++which) {
      const RecordedMotion motion(scenario, which);
      const decant::BodyShape shape = effect_container(motion.plan().container).shape;
      const auto surface = std::make_shared<const decant::BoundingVolumeHierarchy>(shape.mesh);
      const double recorded = motion.plan().fill * decant::Cavity(surface).volume();
      INFO("scenario " << scenario << ", pour " << which << ": " << 1e6 * recorded << " ml");
      CHECK((recorded > (which < 2 ? 150e-6 : 110e-6) && recorded < 260e-6));
      const auto holds = [&](double pull) {  // toward where the container leans
        const decant::Vector3<double> up = Eigen::Vector3d(0, 0, 9.81) - pull * effect_scenarios()[scenario].ahead();
        return decant::Cavity(surface, motion.smooth(0).rotation.conjugate() * up).volume();
      };
      CHECK(holds(0) > 1.14 * 1.01 * recorded);
      CHECK(holds(0.82) > 1.01 * recorded);
    }
  }
}

TEST_CASE("effect scenarios: the wall below the lip is where the outline has it") {
  CHECK((effect_container("mug").wall_below_lip(0.5) - Eigen::Vector3d(0.040, 0, 0.040)).norm() < 1e-12);
  CHECK((effect_container("cone_cup").wall_below_lip(0.25) - Eigen::Vector3d(0.030, 0, 0.025)).norm() < 1e-12);
  // of the bowl's ball, radius R = (65^2 + 55^2) / 110 mm, between corners of its outline
  const double ball = (0.065 * 0.065 + 0.055 * 0.055) / 0.11;
  const decant::Vector3<double> place = effect_container("bowl").wall_below_lip(0.5);
  CHECK(std::hypot(place.x(), place.z() - ball) == Approx(ball).epsilon(0.001));
  CHECK_THROWS_AS(effect_container("sieve"), std::invalid_argument);
  // a basin's, against its mesh
  const EffectPan basin{EffectPan::Form::Basin, 0.12, 0.06};
  const decant::BoundingVolumeHierarchy surface(basin.shape().mesh);
  const auto below = surface.closest_point(basin.floor_below({0.05, -0.03, 0.3}), 0.01);
  REQUIRE(below);
  CHECK(below->distance < 1e-4);  // chords of the mesh are so near to the ball
  CHECK(basin.floor_below({0.05, -0.03, 0.3}).head<2>() == Eigen::Vector2d(0.05, -0.03));
  CHECK(EffectPan{}.floor_below({0.05, -0.03, 0.3}) == Eigen::Vector3d(0.05, -0.03, 0));
}

TEST_CASE("effect forces: air holds back what is in the neck, in pulses") {
  BackPressure air;
  air.strength = 8;
  air.frequency = 2;
  air.onset = 1;
  air.mouth = {0, 0, 0.1};
  decant::Pose lying{Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitY())), {1, 0, 0}};
  air.container = decant::PoseTrack(lying);  // its mouth is at x = 1.1, and opens toward +x
  const auto felt = [&](double x, double z, double time) { return LoneParticle({x, 0, z}, {0, 0, 0}).felt(air, time); };
  CHECK((felt(1.08, 0.01, 1.25) - Eigen::Vector3d(-8, 0, 0)).norm() < 1e-5);  // the middle of a pulse
  CHECK((felt(1.08, 0.01, 1.125) - Eigen::Vector3d(-4, 0, 0)).norm() < 1e-5);
  CHECK(felt(1.08, 0.01, 1.5).norm() < 1e-5);
  CHECK(felt(1.08, 0.01, 0.75).norm() == 0);   // not yet
  CHECK(felt(1.11, 0.01, 1.25).norm() == 0);   // outside
  CHECK(felt(1.05, 0.01, 1.25).norm() == 0);   // behind the neck
  CHECK(felt(1.08, 0.025, 1.25).norm() == 0);  // beside it
}

TEST_CASE("effect forces: a stirrer brings liquid to its own speed, a puff lifts it, a table shakes it") {
  Stirrer stirrer;
  stirrer.speed = -0.6;
  stirrer.foot = {0.1, 0, 0};
  const decant::Vector3<double> at_rim(0.1 + stirrer.radius, 0, 0.01);
  CHECK((LoneParticle(at_rim, {0, 0, 0}).felt(stirrer, 1) - Eigen::Vector3d(0, -0.6 * stirrer.rate, 0)).norm() < 1e-4);
  CHECK(LoneParticle(at_rim, {0, -0.6, 0}).felt(stirrer, 1).norm() < 1e-4);
  const decant::Vector3<double> beside(0.1, stirrer.radius, 0.01);
  CHECK((LoneParticle(beside, {0, 0, 0}).felt(stirrer, 1) - Eigen::Vector3d(0.6 * stirrer.rate, 0, 0)).norm() < 1e-4);
  CHECK(LoneParticle(at_rim + Eigen::Vector3d(0.05, 0, 0), {0, 0, 0}).felt(stirrer, 1).norm() == 0);

  Puff puff;
  puff.strength = 20;
  puff.from = 1;
  puff.until = 2;
  CHECK((LoneParticle({0, puff.radius, 0}, {0, 0, 0}).felt(puff, 1.5) - Eigen::Vector3d(0, 0, 20 / std::numbers::e))
            .norm() < 1e-4);
  CHECK(LoneParticle({0, 0, 0}, {0, 0, 0}).felt(puff, 2.5).norm() == 0);

  ShakingTable table;
  table.size = {0, 3, 0};
  table.frequency = 2.5;
  table.from = 0.5;
  CHECK((LoneParticle({0, 0, 0}, {0, 0, 0}).felt(table, 0.6) - Eigen::Vector3d(0, 3, 0)).norm() < 1e-5);
  CHECK((LoneParticle({0, 0, 0}, {0, 0, 0}).felt(table, 0.8) - Eigen::Vector3d(0, -3, 0)).norm() < 1e-5);
  CHECK(LoneParticle({0, 0, 0}, {0, 0, 0}).felt(table, 0.4).norm() == 0);
}

TEST_CASE("effect forces: a sticky patch slows liquid along one side of a wall") {
  StickyPatch patch;
  patch.rate = 500;
  patch.body = 3;
  patch.side = Eigen::Vector3d::UnitY();
  const auto felt = [&](double y, std::uint32_t body) {
    LoneParticle one({0, y, 0.0025}, {0.4, 0, -0.1});
    auto& walls = one.liquid.walls;  // a floor that moves at 0.1 m/s
    walls.distance[0] = 0.0025F;
    walls.contact_count[0] = 1;
    walls.contacts_of(0)->body = body;
    walls.contacts_of(0)->gradient = {0, 0, -100};
    walls.contacts_of(0)->velocity = {0.1F, 0, 0};
    return one.felt(patch, 0);
  };
  const double after = 0.3 * std::exp(-0.5);  // slip after a sub-step of 1 ms
  CHECK((felt(0.01, 3) - Eigen::Vector3d((after - 0.3) / 0.001, 0, 0)).norm() < 0.01);
  CHECK(felt(-0.01, 3).norm() == 0);
  CHECK(felt(0.01, 2).norm() == 0);
}

TEST_CASE("fattened mask: a disc for each pixel, or one less of what is not liquid") {
  decant::Mask mask = decant::Mask::Zero(20, 30);
  mask(10, 15) = decant::mask_liquid;
  mask(0, 0) = decant::mask_liquid;
  const auto area = [](const decant::Mask& m) { return (m.cast<int>() / 255).sum(); };
  CHECK(area(fattened(mask, 1)) == 5 + 3);  // a cross, and what of it is in the picture
  CHECK(area(fattened(mask, 1.5)) == 9 + 4);
  CHECK(area(fattened(mask, 2)) == 13 + 6);
  CHECK((fattened(mask, 0) == mask).all());
  CHECK(area(fattened(fattened(mask, 2), -2)) == 2);
  CHECK(area(fattened(mask, -1)) == 0);
  decant::Mask full = decant::Mask::Constant(20, 30, decant::mask_liquid);
  CHECK((fattened(full, -2) == full).all());  // the picture's border is no edge of the liquid
}

TEST_CASE("first sight: from when on a square differs for good, and where") {
  // 30 frames a second, windows of four; a block of pixels differs in some frames
  const auto seen = [](int first, int last, int rows, bool more) {
    FirstSight sight;
    for (int frame = 0; frame < 24; ++frame) {
      const decant::Mask without = decant::Mask::Constant(100, 130, more ? 0 : decant::mask_liquid);
      decant::Mask with = without;
      if (frame >= first && frame <= last) {
        with.block(40, 60, rows, 20).setConstant(more ? decant::mask_liquid : 0);
      }
      sight.add(frame / 30.0, with, without);
    }
    return sight.found();
  };
  CHECK_FALSE(seen(100, 100, 20, true).has_value());
  for (const bool more : {true, false}) {
    const auto sight = seen(8, 23, 20, more);
    REQUIRE(sight.has_value());
    CHECK(sight->time == Approx(8 / 30.0));
    CHECK(sight->px.x() == Approx(69.5));
    CHECK(sight->px.y() == Approx(49.5));
  }
  CHECK(seen(7, 23, 20, true)->time == Approx(8 / 30.0));  // a quarter of the window before
  CHECK(seen(6, 23, 20, true)->time == Approx(4 / 30.0));  // a half
  CHECK_FALSE(seen(8, 11, 20, true).has_value());          // a drop
  CHECK_FALSE(seen(8, 23, 5, true).has_value());
  CHECK(seen(8, 23, 7, true).has_value());
}
