// SPDX-License-Identifier: MIT
// The density that the solver keeps within its tolerance is the sum over all pairs, in every sub-step.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <tuple>
#include <vector>

#include <decant/kernel/lattice.hpp>
#include <decant/neighbor/brute_force.hpp>
#include <decant/simulation/simulator.hpp>

#include "catch.hpp"
#include "physics/scene.hpp"

using decant::Index;

namespace {

/// A force of nothing, which is asked once per sub-step and sums up the densities there by brute force: those of the
/// places that the sub-step before ended with.
struct DensityWatch {
  using Scalar = double;

  std::vector<double> mean, largest;  ///< compression over rest density, of each sub-step
  double difference = 0;              ///< between the simulator's densities and ours, over rest density

  template <class Step>
  void accumulate(const Step& step, decant::PointArray<double>&) noexcept {
    using Kernel = typename Step::Kernel;
    const double h = step.smoothing_length, rest = step.rest_density;
    const auto& fluid = step.fluid;
    pairs_.rebuild(fluid.position, Kernel::support_factor * h);
    double total = 0, most = 0;
    for (Index i = 0; i < fluid.size(); ++i) {
      double density = fluid.mass[i] * decant::own_value<Kernel>(h, step.spacing) + rest * step.walls.share[i];
      pairs_.for_each(
          i, [&](Index j, double r_squared) { density += fluid.mass[j] * Kernel::value(std::sqrt(r_squared), h); });
      difference = std::max(difference, std::abs(density - fluid.density[i]) / rest);
      total += std::max(density / rest - 1, 0.0);
      most = std::max(most, density / rest - 1);
    }
    mean.push_back(total / static_cast<double>(fluid.size()));
    largest.push_back(most);
  }

  template <class Step>
  double largest_step(const Step&) const noexcept {
    return std::numeric_limits<double>::infinity();
  }

 private:
  decant::BruteForce<double> pairs_{};
};

struct WatchedParts : decant::DefaultParts<double> {
  using Forces =
      std::tuple<decant::Gravity<double>, decant::Viscosity<double>, decant::ResidualViscosity<double>, DensityWatch>;
};

struct Collapse {
  double worst_mean = 0, mean_in_time = 0, largest = 0;  // but for the first sub-step
  double share_above = 0;                                // of the sub-steps, with a mean above the tolerance
  double difference = 0, largest_report = 0;
  bool always_converged = true;
};

enum class Room {
  Slot,  // 10 x 5 x 12 particles against two walls and between two more
  Hall   // 10 x 10 x 10, half a spacing off the walls
};

/// @param tolerance 0: the default. @param fixed_step [s], 0: as long as the simulator lets them be.
Collapse collapse(Room room, double spacing, double tolerance, double fixed_step, double seconds) {
  decant::SimulatorSettings settings;
  settings.spacing = spacing;
  settings.threads = {1};
  settings.fixed_step = fixed_step;
  decant::Simulator<WatchedParts> simulator(settings);
  const bool slot = room == Room::Slot;
  const decant::Vector3<double> size = slot ? decant::Vector3<double>(20, 5, 20) : decant::Vector3<double>(30, 11, 20);
  simulator.add_body("tank", decant::BoxInside{{0, 0, 0}, spacing * size, 0.02, {}});
  const double off = slot ? 0 : 0.5 * spacing;
  const auto places = decant_test::block<double>({off, off, off}, 10, slot ? 5 : 10, slot ? 12 : 10, spacing);
  simulator.add_particles(places, decant::PointArray<double>::Zero(3, places.cols()), 0);
  if (tolerance > 0) {
    simulator.pressure_solver().density_tolerance = tolerance;
  }
  tolerance = simulator.pressure_solver().density_tolerance;

  Collapse found;
  while (simulator.time() < seconds - 1e-9) {
    const auto report = simulator.step(0.02);
    REQUIRE(report.advanced());
    found.largest_report = std::max(found.largest_report, report.density_error);
    found.always_converged = found.always_converged && report.status == decant::StepStatus::Ok;
  }
  const auto& watch = simulator.force<DensityWatch>();
  found.difference = watch.difference;
  // the first entry is that of the lattice as it was put there, which no solver has seen
  const auto count = static_cast<double>(watch.mean.size() - 1);
  for (std::size_t k = 1; k < watch.mean.size(); ++k) {
    found.worst_mean = std::max(found.worst_mean, watch.mean[k]);
    found.mean_in_time += watch.mean[k] / count;
    found.share_above += watch.mean[k] > tolerance ? 1 / count : 0;
    found.largest = std::max(found.largest, watch.largest[k]);
  }
  return found;
}

}  // namespace

TEST_CASE("mean density error of a collapsing block stays within tolerance in every step") {
  const Collapse found = collapse(Room::Slot, 0.01, 0, 0.001, 1);
  CAPTURE(found.worst_mean, found.largest, found.largest_report);
  CHECK(found.worst_mean <= 1e-3);
  CHECK(found.largest_report <= 1e-3);
  CHECK(found.always_converged);
  CHECK(found.difference < 1e-12);
  // Where the front meets the wall, single particles are driven together: 0.11 to 0.15 at 5 and 10 mm in either room
  // with steps in which a front of 1.5 m/s moves by 0.15 spacings, 0.03 with half of them.
  CHECK(found.largest < 0.2);
}

TEST_CASE("the user's density tolerance is the one that is kept") {
  const Collapse coarse = collapse(Room::Slot, 0.01, 5e-3, 0.001, 0.5),
                 fine = collapse(Room::Slot, 0.01, 1e-4, 0.0005, 0.5);
  CAPTURE(coarse.worst_mean, fine.worst_mean, fine.mean_in_time, fine.share_above);
  CHECK(coarse.worst_mean <= 5e-3);
  CHECK(coarse.largest_report > 1e-3);  // it does make use of what it is allowed
  CHECK(fine.largest_report <= 1e-4);
  CHECK(fine.mean_in_time <= 1e-4);
  CHECK((coarse.always_converged && fine.always_converged));
  // The solver keeps what it predicts to first order in the way of a sub-step; what is of second order is on top. At 5
  // and 10 mm and in either room 1.2e-4 to 1.4e-4 at worst, and 5e-4 with twice the step.
  CHECK(fine.worst_mean <= 2e-4);
  CHECK(fine.share_above < 0.03);
}

TEST_CASE("mean density error of a collapsing block with the simulator's own sub-steps is bounded") {
  // Not within 1e-3 in every sub-step. Where the front meets the wall, particles come 0.4 spacings nearer in a sub-step
  // and some ten of them end up at the places of others: more than the first order predicts, and Dfsph sets at most 20 %
  // right per sub-step. It reports what it predicts, which is within 1e-3. At 10 mm and in either room: 2.9e-3 to 3.4e-3
  // in the worst sub-step, 2.5 to 4 % of all sub-steps (1 s) above 1e-3, 4.6e-4 in the mean of all, 0.42 to 0.45 for a
  // single particle. With a courant_number of 0.2 it is 1.3e-3 at worst.
  for (const Room room : {Room::Slot, Room::Hall}) {
    const Collapse found = collapse(room, 0.01, 0, 0, 1);
    CAPTURE(room == Room::Slot, found.worst_mean, found.mean_in_time, found.share_above, found.largest);
    CHECK(found.worst_mean < 4.5e-3);
    CHECK(found.share_above < 0.06);
    CHECK(found.mean_in_time < 1e-3);
    CHECK(found.largest < 0.6);
    CHECK(found.largest_report <= 1e-3);
    CHECK(found.always_converged);
    CHECK(found.difference < 1e-12);
  }
}
