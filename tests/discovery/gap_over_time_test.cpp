// SPDX-License-Identifier: MIT
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include <decant/core/image.hpp>
#include <decant/discovery/gap_over_time.hpp>
#include <decant/discovery/observation_features.hpp>

#include "catch.hpp"

using namespace decant;

TEST_CASE("gap over time: squares of all cameras and readings of all sensors, by window of time") {
  SilhouetteSeries film(40, 40, 10);
  ReadingSeries level("level", {1.0});
  for (int frame = 0; frame < 6; ++frame) {
    const double time = frame / 15.0;
    Mask mask = Mask::Zero(40, 40);
    mask.topRows(20).setConstant(mask_liquid);
    film.add(time, mask);
    level.add(time, 3.0);
  }
  const Observation seen{{film, film}, {level, level}};
  const std::vector<std::vector<SilhouetteSeries>> simulated{seen.silhouettes};
  const ObservationFeatures features(seen, simulated, {}, {});
  const GapOverTime over_time(features);
  Eigen::VectorXd off(static_cast<Eigen::Index>(features.size()));
  std::vector<double> expected;  // by window, first of silhouettes, then of readings
  for (const bool reading : {false, true}) {
    for (int window = 0; window < 3; ++window) {
      expected.push_back(0);
      const std::size_t begin = reading ? features.silhouettes().size() : 0;
      const std::size_t end = reading ? features.size() : features.silhouettes().size();
      for (std::size_t k = begin; k < end; ++k) {
        const double here = 1.0 + static_cast<double>(k % 5);
        if ((reading ? features.readings().place(k - begin).window : features.silhouettes().place(k).window) ==
            window) {
          off[static_cast<Eigen::Index>(k)] = here;
          expected.back() += here * here;
        }
      }
    }
  }
  const Eigen::VectorXd gap = over_time(off);
  REQUIRE(gap.size() == 6);
  CHECK(gap.sum() == Approx(off.squaredNorm()));
  for (std::size_t k = 0; k < expected.size(); ++k) {
    CHECK(gap[static_cast<Eigen::Index>(k)] == Approx(expected[k]));
  }
}

TEST_CASE("gap over time: it grows where it is more than before and more than by chance") {
  const Eigen::Vector4d before(10, 30, 0, 0), by_chance(2, 2, 2, 2);
  CHECK(grown_gap(before, Eigen::Vector4d(10, 0, 2, 1), by_chance) == 0);
  // by 5 over what was there, and by 3 over what may be chance, of 40
  CHECK(grown_gap(before, Eigen::Vector4d(15, 0, 5, 2), by_chance) == Approx(0.2));
}
