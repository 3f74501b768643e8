// SPDX-License-Identifier: MIT
// The density that the solver keeps within its tolerance is the sum over all pairs.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <decant/neighbor/brute_force.hpp>
#include <decant/simulation/simulator.hpp>

#include "catch.hpp"
#include "physics/scene.hpp"

using decant::Index;

TEST_CASE("mean density error of a collapsing block stays within tolerance in every step") {
  using Kernel = decant::DefaultParts<double>::Kernel;
  const double spacing = 0.01;
  decant::SimulatorSettings settings;
  settings.spacing = spacing;
  settings.threads = {1};
  settings.fixed_step = 0.001;
  decant::Simulator<decant::DefaultParts<double>> simulator(settings);
  simulator.add_body("tank", decant::BoxInside{{0, 0, 0}, {0.2, 0.05, 0.2}, 0.02, {}});
  const auto places = decant_test::block<double>({0, 0, 0}, 10, 5, 12, spacing);
  simulator.add_particles(places, decant::PointArray<double>::Zero(3, places.cols()), 0);
  const double tolerance = simulator.pressure_solver().density_tolerance;
  REQUIRE(tolerance == Approx(1e-3));

  double largest_report = 0, largest_mean = 0, largest_difference = 0;
  int not_converged = 0;
  for (int step = 0; step < 1000; ++step) {
    const decant::PointArray<double> before = simulator.fluid().position;
    std::vector<std::size_t> place_of(static_cast<std::size_t>(before.cols()));
    for (Index i = 0; i < before.cols(); ++i) {
      place_of[simulator.fluid().id[i]] = static_cast<std::size_t>(i);
    }
    const auto report = simulator.step(settings.fixed_step);
    REQUIRE(report.sub_steps == 1);
    largest_report = std::max(largest_report, report.density_error);
    not_converged += report.status == decant::StepStatus::Ok ? 0 : 1;
    if (step % 50 != 49) {
      continue;
    }
    // the densities of this sub-step are those of the positions before it
    decant::BruteForce<double> pairs;
    const double h = simulator.smoothing_length();
    pairs.rebuild(before, settings.support_in_spacings * spacing);
    const auto& fluid = simulator.fluid();
    double excess = 0;
    for (Index i = 0; i < fluid.size(); ++i) {
      double density = fluid.mass[i] * Kernel::value(0.0, h) + settings.liquid.density * simulator.walls().share[i];
      pairs.for_each(static_cast<Index>(place_of[fluid.id[i]]), [&](Index, double r_squared) {
        density += fluid.mass[0] * Kernel::value(std::sqrt(r_squared), h);
      });
      largest_difference = std::max(largest_difference, std::abs(density - fluid.density[i]) / settings.liquid.density);
      excess += std::max(density / settings.liquid.density - 1, 0.0);
    }
    largest_mean = std::max(largest_mean, excess / static_cast<double>(fluid.size()));
  }
  CHECK(largest_report <= tolerance);
  CHECK(not_converged == 0);
  CHECK(largest_mean <= tolerance);
  CHECK(largest_difference < 1e-12);
}
