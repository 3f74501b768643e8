// SPDX-License-Identifier: MIT
// Where effects are looked for if recordings say where they begin to disagree with a model.

#include <decant/discovery/effect_location.hpp>

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include <decant/core/types.hpp>
#include <decant/discovery/disagreement.hpp>
#include <decant/discovery/effect.hpp>
#include <decant/discovery/forward_model.hpp>
#include <decant/discovery/observation.hpp>

#include "catch.hpp"

using namespace decant;

namespace {

/// Whose holes are where something is seen, a pixel a centimetre, at the mean of all squares.
struct SeenHoles {
  std::vector<Effect> holes;

  const std::vector<Effect>& effects() const { return holes; }
  Observation predict(const ModelRun&) const { return {}; }
  std::optional<Vector3<double>> place_of(std::size_t, const Sighting& seen) const {
    Eigen::Vector2d mean(0, 0);
    for (const Eigen::Vector2d& each : seen.squares) {
      mean += each / static_cast<double>(seen.squares.size());
    }
    return Vector3<double>(0.01 * mean.x(), 0.01 * mean.y(), 0);
  }
};

Effect hole_at(const Vector3<double>& place, double fastest) {
  Effect hole = plain_effect("leak", "", "ml/s", "", {"", 0, 0, 40});
  hole.place = place;
  hole.place_tolerance = 0.02;
  hole.seen_first = SeenFirst::Liquid;
  hole.fastest = fastest;
  return hole;
}

}  // namespace

TEST_CASE("located effects: of holes the nearest one, at rest and with speeds up to the fastest") {
  SeenHoles model{{hole_at({0.5, 0.5, 0}, 1.2), hole_at({0.06, 0.04, 0}, 1.2), hole_at({0.12, 0.04, 0}, 0)}};
  Disagreement jet;
  jet.begin = 0.2;
  jet.squares = {{{2, 2, 4, 4}, 0.2, 0.3, 5}, {{4, 4, 10, 6}, 0.2, 0.3, 5}, {{40, 60, 42, 62}, 0.3, 0.4, 9}};
  jet.onset_u = 100;  // which holes are not asked for where there are squares
  const std::vector<AppliedEffect> located = located_effects<SeenHoles>({&model}, {{jet}});
  REQUIRE(located.size() == 5);
  for (std::size_t k = 0; k < located.size(); ++k) {
    CHECK(located[k].effect == 1);
    CHECK(located[k].speed == Approx(0.3 * static_cast<double>(k)));
    // middles of the two that it begins with: 2.5, 2.5 and 6.5, 4.5 px
    CHECK((*located[k].place - Vector3<double>(0.045, 0.035, 0)).norm() < 1e-12);
  }
  model.holes.erase(model.holes.begin() + 1);  // the other one has no speeds
  const std::vector<AppliedEffect> others = located_effects<SeenHoles>({&model}, {{jet}});
  CHECK(others.empty());  // and is too far off
  model.holes.back().place_tolerance = 0.03;
  const std::vector<AppliedEffect> near = located_effects<SeenHoles>({&model}, {{jet}});
  REQUIRE(near.size() == 1);
  CHECK(near[0].effect == 1);
  CHECK_FALSE(near[0].speed);
}
