// SPDX-License-Identifier: MIT
// Where the legs of a recorded junction are, and where they may leak.

#include "../../examples/support/junction_legs.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "../../examples/support/junction_scenarios.hpp"
#include "catch.hpp"

using namespace decant;
using example::JunctionLeg;
using example::JunctionScenario;

namespace {

Recording recorded(const JunctionScenario& scenario) {
  Recording recording;
  recording.timestamps = {0};
  recording.gravity = {0, 0, -9.81};
  recording.bodies.push_back(
      {1, "junction", recording::Role::Junction, {}, scenario.pipes().mesh(), PoseTrack(Pose{})});
  return recording;
}

}  // namespace

TEST_CASE("junction legs: a leak is looked for wherever a leg has an underside, and not where it runs down") {
  const JunctionScenario& scenario = example::junction_scenarios().front();
  const std::vector<JunctionLeg> legs = example::junction_legs(recorded(scenario), 0);
  REQUIRE(legs.size() == 2);
  CHECK(legs[0].name == "left");
  CHECK(legs[1].name == "right");
  const Vector3<double> down(0, 0, -1);
  constexpr double apart = 0.03;
  for (const JunctionLeg& leg : legs) {
    const double side = leg.name == "left" ? -1 : 1;
    const std::vector<PipeSection> sections = example::sections_with_underside(leg, down, apart);
    REQUIRE(sections.size() >= 3);
    for (const PipeSection& each : sections) {
      CHECK(std::abs(each.direction.z()) < 0.3);
      CHECK(side * each.center.x() > 0);
    }
    // from clear of the stem to clear of the bend
    for (double x = scenario.stem_radius + 2 * scenario.leg_radius; x < scenario.reach - 3 * scenario.leg_radius;
         x += 0.002) {
      const auto off = [&](const PipeSection& each) { return std::abs(side * each.center.x() - x); };
      const auto nearest = std::min_element(sections.begin(), sections.end(),
                                            [&](const auto& a, const auto& b) { return off(a) < off(b); });
      CAPTURE(leg.name, x);
      CHECK(off(*nearest) < 0.5 * apart + 0.25 * scenario.leg_radius);
    }
    // seen the other way round, the outlet is what has an underside
    for (const PipeSection& each : example::sections_with_underside(leg, Vector3<double>(side, 0, 0), apart)) {
      CHECK(std::abs(each.direction.z()) > 0.7);
    }
  }
}
