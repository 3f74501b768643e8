// SPDX-License-Identifier: MIT
#pragma once

/// The laws of a ForceTerm.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <decant/boundary/wall_state.hpp>
#include <decant/core/domain.hpp>
#include <decant/core/fluid_state.hpp>
#include <decant/core/growable.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/force/step_view.hpp>
#include <decant/kernel/lattice.hpp>
#include <decant/neighbor/brute_force.hpp>
#include <decant/neighbor/neighbor_list.hpp>
#include <decant/testing/law.hpp>

namespace decant::inline DECANT_TARGET::testing {

/// Liquid by itself with all that a StepView refers to, for trying forces and pressure solvers without a simulator.
template <class KernelType, class Domain = OpenDomain>
struct LooseLiquid {
  using Kernel = KernelType;
  using Scalar = typename Kernel::Scalar;
  using Neighbors = NeighborList<Scalar, Domain>;

  FluidState<Scalar> fluid{};
  Neighbors neighbors{};
  PairKernel<Scalar> pairs{};
  WallState<Scalar> walls{};
  GradientCorrection<Scalar> correction{};
  Growable<Scalar, 3> shift{};
  Scalar spacing = Scalar(0.005);           ///< [m]
  Scalar smoothing_length = Scalar(0.005);  ///< [m]
  Scalar rest_density = Scalar(1000);       ///< [kg/m^3]
  Scalar time_step = Scalar(1e-3);          ///< [s]
  Threads threads{1};
  Domain domain{};

  /// Puts particles of one spacing's volume at these places, at rest, and finds neighbours and densities. Benchmarks
  /// name a faster Search.
  template <class Search = BruteForce<Scalar, Domain>>
  void place(const PointArray<Scalar>& position) {
    neighbors = Neighbors(domain);
    fluid.resize(position.cols());
    fluid.position = position;
    fluid.velocity.setZero();
    fluid.mass.setConstant(rest_density * spacing * spacing * spacing);
    fluid.pressure.setZero();
    for (Index i = 0; i < fluid.size(); ++i) {
      fluid.id[i] = static_cast<std::uint32_t>(i);
      fluid.origin[i] = 0;
    }
    shift.set_count(position.cols());
    shift.setZero();
    walls.resize(position.cols());
    walls.share.setZero();
    walls.gradient.setZero();
    walls.moment.setZero();
    walls.flux.setZero();
    walls.distance.setConstant(static_cast<Scalar>(Kernel::support_factor) * smoothing_length);
    walls.contact_count.setZero();
    update<Search>();
  }

  /// Finds neighbours and densities again after positions have changed. @param margin see
  /// PressureSolver::search_margin.
  template <class Search = BruteForce<Scalar, Domain>>
  void update(double margin = 0) {
    Search search(domain);
    neighbors.build(search, fluid.position,
                    static_cast<Scalar>(static_cast<double>(Kernel::support_factor) * (1 + margin)) * smoothing_length,
                    threads);
    pairs.compute(view());
    const Scalar own = own_value<Kernel>(static_cast<double>(smoothing_length), static_cast<double>(spacing));
    for (Index i = 0; i < fluid.size(); ++i) {  // once more, in a way of its own
      Scalar density = fluid.mass[i] * own;
      neighbors.for_each(i, [&](Index j, const Vector3<Scalar>&, Scalar r_squared) {
        density += fluid.mass[j] * Kernel::value(std::sqrt(r_squared), smoothing_length);
      });
      fluid.density[i] = density + rest_density * walls.share[i];
    }
    correction.compute(view());
  }

  StepView<Kernel, Neighbors> view() {
    return {fluid,   neighbors,    pairs,     walls, correction, shift, smoothing_length,
            spacing, rest_density, time_step, 0.0,   threads};
  }
};

/// A ball of liquid on a disturbed lattice, with velocities that vary from particle to particle. The same every time.
template <class Kernel>
LooseLiquid<Kernel> loose_ball(typename Kernel::Scalar spacing, int radius_in_spacings, double disorder, double speed) {
  using Scalar = typename Kernel::Scalar;
  LooseLiquid<Kernel> liquid;
  liquid.spacing = spacing;
  liquid.smoothing_length = spacing * 2 / static_cast<Scalar>(Kernel::support_factor);
  std::uint64_t state = 88172645463325252ull;  // Marsaglia's xorshift: the same numbers with any standard library
  const auto random = [&state] {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return static_cast<double>(state >> 11) * 0x1p-52 - 1;
  };
  std::vector<Vector3<Scalar>> places;
  for (int i = -radius_in_spacings; i <= radius_in_spacings; ++i) {
    for (int j = -radius_in_spacings; j <= radius_in_spacings; ++j) {
      for (int k = -radius_in_spacings; k <= radius_in_spacings; ++k) {
        const Vector3<double> x(i + 0.3, j + 0.1, k - 0.2);
        if (x.norm() < radius_in_spacings) {
          const Vector3<double> moved = x + disorder * Vector3<double>(random(), random(), random());
          places.push_back((static_cast<double>(spacing) * moved).cast<Scalar>());
        }
      }
    }
  }
  PointArray<Scalar> position(3, static_cast<Index>(places.size()));
  for (std::size_t i = 0; i < places.size(); ++i) {
    position.col(static_cast<Index>(i)) = places[i];
  }
  liquid.place(position);
  for (Index i = 0; i < liquid.fluid.size(); ++i) {
    liquid.fluid.velocity.col(i) = (speed * Vector3<double>(random(), random(), random())).template cast<Scalar>();
  }
  return liquid;
}

/// The radius [spacings] of a ball that is large enough to be shared among four threads.
inline constexpr int radius_for_four_threads = 8;
static_assert(4 * radius_for_four_threads * radius_for_four_threads * radius_for_four_threads >= 4 * least_per_thread);

/// Which of the momenta a force claims to keep.
enum class Keeps { Neither, Linear, LinearAndAngular };

/// Tries the laws of a force on a small ball of liquid.
/// @param keeps what the force's docstring promises of a free drop.
template <class Kernel, class Force>
std::vector<Law> force_laws(Force force, Keeps keeps) {
  using Scalar = typename Kernel::Scalar;
  const double rounding = static_cast<double>(std::numeric_limits<Scalar>::epsilon());
  LooseLiquid<Kernel> liquid = loose_ball<Kernel>(Scalar(0.005), 5, 0.2, 0.1);
  const Index count = liquid.fluid.size();
  const auto accelerations = [&force](LooseLiquid<Kernel>& of, int threads) {
    PointArray<Scalar> result = PointArray<Scalar>::Zero(3, of.fluid.size());
    of.threads = {threads};
    force.accumulate(of.view(), result);
    return result;
  };
  const PointArray<Scalar> alone = accelerations(liquid, 1);
  const double largest = static_cast<double>(alone.cwiseAbs().maxCoeff());

  PointArray<Scalar> onto = PointArray<Scalar>::Constant(3, count, Scalar(3));
  force.accumulate(liquid.view(), onto);
  const double added = static_cast<double>((onto - alone).array().operator-(Scalar(3)).abs().maxCoeff());

  LooseLiquid<Kernel> shared_out = loose_ball<Kernel>(Scalar(0.005), radius_for_four_threads, 0.2, 0.1);
  const PointArray<Scalar> by_one = accelerations(shared_out, 1);
  double threads_differ = 0;
  for (const int threads : {1, 2, 4}) {
    threads_differ += accelerations(shared_out, threads) == by_one ? 0 : 1;
  }

  Vector3<double> momentum = Vector3<double>::Zero(), angular = Vector3<double>::Zero();
  double size = 0, lever = 0;
  for (Index i = 0; i < count; ++i) {
    const Vector3<double> push = static_cast<double>(liquid.fluid.mass[i]) * alone.col(i).template cast<double>();
    const Vector3<double> x = liquid.fluid.position.col(i).template cast<double>();
    momentum += push;
    angular += x.cross(push);
    size += push.norm();
    lever += x.norm() * push.norm();
  }

  std::vector<Law> laws{
      {"acceleration is finite (1 if not)", alone.allFinite() ? 0.0 : 1.0, 0},
      {"it is added to what was there, relative to the largest", added / std::max(largest, 1.0), 16 * rounding},
      {"the same bits with 1, 2 and 4 threads (numbers of threads that differ)", threads_differ, 0},
  };
  // each particle's sum carries rounding of some thirty terms, larger than itself by the terms' cancellation
  if (keeps != Keeps::Neither) {
    laws.push_back(
        {"linear momentum is kept, relative to the sum of all forces", momentum.norm() / size, 100 * rounding});
  }
  if (keeps == Keeps::LinearAndAngular) {
    laws.push_back(
        {"angular momentum is kept, relative to the sum of all torques", angular.norm() / lever, 100 * rounding});
  }

  const Scalar longest = force.largest_step(liquid.view());
  laws.push_back({"the longest step is above zero (1 if not)", longest > 0 ? 0.0 : 1.0, 0});

  PointArray<Scalar> twins(3, 3);
  twins << 0, 0, Scalar(0.004), 0, 0, 0, 0, 0, 0;
  liquid.place(twins);
  PointArray<Scalar> result = PointArray<Scalar>::Zero(3, 3);
  force.accumulate(liquid.view(), result);
  laws.push_back({"two particles at one place: finite (1 if not)", result.allFinite() ? 0.0 : 1.0, 0});

  for (const Index few : {0, 1}) {
    liquid.place(PointArray<Scalar>::Zero(3, few));
    result = PointArray<Scalar>::Zero(3, few);
    force.accumulate(liquid.view(), result);
    laws.push_back({few == 0 ? "no particle: nothing happens (1 if not)" : "one particle: finite (1 if not)",
                    result.allFinite() ? 0.0 : 1.0, 0});
  }
  return laws;
}

}  // namespace decant::inline DECANT_TARGET::testing
