// SPDX-License-Identifier: MIT
// A model without particles, and readings that come one by one: a can with a hole empties into a glass on a scale while
// a float in the can says how high the water stands. How wide is the hole? Both sensors are sources of evidence for one
// posterior; the float sticks, so that its errors last for seconds.

#include <cmath>
#include <cstdio>
#include <random>
#include <span>
#include <vector>

#include <decant/hypothesis/posterior.hpp>
#include <decant/hypothesis/series_misfit.hpp>
#include <decant/hypothesis/series_model.hpp>
#include <decant/hypothesis/value_estimate.hpp>

/// Parameter: radius of the hole [m]. Channels: level in the can [m], mass in the glass [kg].
/// By Torricelli's law sqrt(level) falls evenly in a can with straight walls.
struct LeakingCan {
  double radius = 0.04, start = 0.12;  // of the can, of its level [m]

  std::vector<std::vector<double>> predict(std::span<const double> parameters, std::span<const double> times) const {
    const double share = std::pow(parameters[0] / radius, 2), area = 3.14159 * radius * radius;
    std::vector<std::vector<double>> channels(2);
    for (const double t : times) {
      const double root = std::sqrt(start) - 0.62 * share * std::sqrt(9.81 / 2) * t;
      const double level = root > 0 ? root * root : 0;
      channels[0].push_back(level);
      channels[1].push_back(998 * area * (start - level));
    }
    return channels;
  }
};
static_assert(decant::SeriesModel<LeakingCan>);

int main() {
  using namespace decant;
  const double hole = 0.00312;  // what really is [m]
  const LeakingCan can;
  std::vector<double> times(300);
  for (std::size_t k = 0; k < times.size(); ++k)
    times[k] = 0.1 * static_cast<double>(k);
  const auto really = can.predict(std::vector{hole}, times);

  const SeriesMisfit level({.deviation = 0.003, .readings_per_error = 20, .idle = 0.12});  // [m], errs for 2 s
  const SeriesMisfit mass({.deviation = 0.008});                                           // [kg], noise alone
  Posterior posterior;
  const std::size_t scale = posterior.add_source(mass.evidence(1));
  std::vector<std::vector<std::vector<double>>> predicted;
  std::vector<double> radius;
  for (double r = 0.0025; r < 0.0036; r += 0.00002) {
    posterior.add();
    radius.push_back(r);
    predicted.push_back(can.predict(std::vector{r}, times));
  }

  std::mt19937 random(2);
  std::normal_distribution<double> noise;
  double stuck = 0;
  ValueEstimate found;
  for (std::size_t k = 0; k < times.size(); ++k) {
    stuck += k % 20 == 0 ? 0.003 * noise(random) - stuck : 0;
    const double seen = really[0][k] + stuck, weighed = really[1][k] + 0.008 * noise(random);
    posterior.set_source(0, level.evidence(static_cast<double>(k + 1)));
    posterior.set_source(scale, mass.evidence(static_cast<double>(k + 1)));
    std::vector<double> log_posterior;
    for (std::size_t n = 0; n < posterior.size(); ++n) {
      posterior.observe(n, level.misfit(predicted[n][0][k], seen));
      posterior.observe(n, mass.misfit(predicted[n][1][k], weighed), scale);
      log_posterior.push_back(posterior.log_posterior(n));
    }
    if (k % 60 == 59) {
      found = estimate_value(radius, log_posterior);
      std::printf("after %4.1f s: radius %.3f mm, 90 %% within %.3f .. %.3f\n", times[k], 1e3 * found.median,
                  1e3 * found.low, 1e3 * found.high);
    }
  }
  const bool held = found.low < hole && hole < found.high;
  return held && found.high - found.low < 0.0003 && std::abs(found.median - hole) < 0.0001 ? 0 : 1;
}
