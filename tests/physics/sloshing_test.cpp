// SPDX-License-Identifier: MIT
// A tank that is shaken near the frequency at which its water sloshes, against the gauge of Faltinsen and others 2000.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include <decant/io/scene.hpp>
#include <decant/simulation/gauges.hpp>
#include <decant/simulation/simulator.hpp>

#include "../../examples/support/slosh_analysis.hpp"
#include "catch.hpp"
#include "data.hpp"
#include "physics/scene.hpp"

namespace {

/// The crests (sign 1) or troughs (-1) of a record: time and value of the most extreme sample of each stretch that
/// stays beyond `threshold`.
std::vector<std::pair<double, double>> extremes(const example::Record& record, double sign, double threshold) {
  std::vector<std::pair<double, double>> found;
  bool beyond = false;
  for (std::size_t k = 0; k < record.time.size(); ++k) {
    const double value = record.value[k];
    if (!(sign * value > threshold)) {
      beyond = false;
    } else if (!beyond || sign * value > sign * found.back().second) {
      if (!beyond) {
        found.emplace_back();
      }
      found.back() = {record.time[k], value};
      beyond = true;
    }
  }
  return found;
}

}  // namespace

TEST_CASE("a shaken tank sloshes as Faltinsen and others measured", "[slow]") {
  const auto path = decant_test::measurements("sloshing_faltinsen/elevation.csv");
  if (!path) {
    return;
  }
  example::Record measured;
  {
    std::ifstream file(*path);
    std::string line;
    std::getline(file, line);  // names
    while (std::getline(file, line)) {
      const auto comma = line.find(',');
      measured.time.push_back(std::stod(line.substr(0, comma)));
      measured.value.push_back(std::stod(line.substr(comma + 1)));
    }
  }
  REQUIRE(measured.time.size() == 171);

  // the motion is that of the scene which comes with the library
  const auto scene = decant::read_scene(decant_test::repository("examples/scenes/sloshing_faltinsen.json"));
  const double filled = 0.6, length = 1.73, spacing = 0.04;
  const int across = 4;
  auto simulator = decant_test::slice(spacing, across);
  const auto tank = simulator.add_body("tank", decant::BoxInside{{0, -0.5, 0}, {length, 0.5, 1.15}, 0.05, {}},
                                       scene.bodies.at(0).motion);
  auto places = decant_test::slice_block(length, across, filled, spacing);
  places.row(0).array() *= static_cast<float>(length / spacing / std::round(length / spacing));
  places.row(0).array() += static_cast<float>(scene.bodies.at(0).motion.at(0).translation.x());
  simulator.add_particles(places, decant::PointArray<float>::Zero(3, places.cols()), 0);
  decant::Gauges<float> gauges(spacing);
  example::Record simulated;
  while (simulator.time() < 9.95) {
    REQUIRE(simulator.step(1.0 / 60).advanced());
    gauges.observe(simulator.fluid(), {1});
    const double wall = simulator.bodies()[tank].motion.at(simulator.time()).translation.x();
    const auto level =
        gauges.level(wall + 0.05, 0.5 * across * spacing, [&](const auto& x) { return x.z() < 1.5 * spacing; });
    simulated.time.push_back(simulator.time());
    simulated.value.push_back(level.value_or(0) - filled);
  }

  double squared = 0, measured_squared = 0;
  for (std::size_t k = 0; k < measured.time.size(); ++k) {
    squared += std::pow(example::value_at(simulated, measured.time[k]) - measured.value[k], 2);
    measured_squared += std::pow(measured.value[k], 2);
  }
  const double misfit = std::sqrt(squared / measured_squared);
  // a crest comes every 1.3 to 1.7 s; the lowest measured one is 40 mm high
  const auto measured_crests = extremes(measured, 1, 0.03), crests = extremes(simulated, 1, 0.02);
  REQUIRE(measured_crests.size() == 6);
  double latest = 0, highest = 0, lowest = 0, low_crest_late = 0, low_crest_off = 0;
  for (const auto& [time, height] : measured_crests) {
    const auto nearest = std::min_element(crests.begin(), crests.end(), [&, at = time](const auto& a, const auto& b) {
      return std::abs(a.first - at) < std::abs(b.first - at);
    });
    REQUIRE(nearest != crests.end());
    UNSCOPED_INFO("crest at " << nearest->first << " s (measured " << time << "), " << 1000 * nearest->second << " mm ("
                              << 1000 * height << ")");
    if (height < 0.06) {  // one of six, where the two sloshing frequencies are out of step
      low_crest_late = std::abs(nearest->first - time);
      low_crest_off = std::abs(nearest->second - height);
      continue;
    }
    latest = std::max(latest, std::abs(nearest->first - time));
    highest = std::max(highest, nearest->second / height - 1);
    lowest = std::min(lowest, nearest->second / height - 1);
  }
  const double deepest = -*std::min_element(simulated.value.begin(), simulated.value.end());
  const double crest = *std::max_element(simulated.value.begin(), simulated.value.end());
  CAPTURE(misfit, latest, highest, lowest, low_crest_late, low_crest_off, crest, deepest);
  CHECK(crest > 1.2 * deepest);  // as nonlinear waves have it; linear theory: 1.07
  // The description sets no bar, and breaking waves are chaotic: what is reached, over 16 starts whose particles were
  // moved by up to 0.1 mm, is a misfit of 0.33 +- 0.01, a first crest that comes 87 +- 13 ms before the measured one
  // and a second one that is 25 +- 1 % too high; the others are within 20 +- 24 ms and 10 % (with particles of 30 mm,
  // one start: 0.33, 80 ms, 35 %). Bars are at least four of these spreads from the means. The first trough and crest
  // come 0.1 s before the measured ones in linear theory of this motion as well (misfit 0.40), as if the tank had
  // started more softly than the cosine of the description. What that excites beats with the rest: the second crest is
  // the one that is too high.
  CHECK(misfit < 0.38);
  CHECK(latest < 0.14);
  CHECK(highest < 0.35);
  CHECK(lowest > -0.2);
  // The low crest is where a small error in phase shows: 38 +- 37 ms early and 7 +- 3 mm too low, on a tank of 40 mm
  // particles.
  CHECK(low_crest_late < 0.19);
  CHECK(low_crest_off < 0.5 * spacing);
}
