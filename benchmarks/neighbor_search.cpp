// SPDX-License-Identifier: MIT
/// Neighbour searches, the neighbour list and sweeps over its pairs: liquid at rest in general position, spacing 5 mm,
/// support 10 mm. Lists are compared with nanoflann's and with brute force, and with step_limit's where it is there.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include <decant/kernel/cubic_spline.hpp>
#include <decant/neighbor/brute_force.hpp>
#include <decant/neighbor/cell_grid.hpp>
#include <decant/neighbor/neighbor_list.hpp>
#if __has_include(<nanoflann.hpp>)
#include <decant/neighbor/kd_tree.hpp>
#endif

#include "common.hpp"
#include "inputs.hpp"
#include "step_limit.hpp"

namespace {

using namespace decant_benchmark;
using decant::CellGrid;
using decant::NeighborList;
using decant::PointArray;
using decant::Threads;

using Scalar = float;
using B = decant::Batch<Scalar>;
using Kernel = decant::CubicSpline<Scalar>;
constexpr Scalar spacing = 0.005f;
constexpr Scalar support = 0.010f;

// ---- lists ----------------------------------------------------------------------------------------------------------

/// The same liquids in random order and as a simulator keeps them.
struct Liquids {
  std::vector<PointArray<Scalar>> shuffled{}, sorted{};

  explicit Liquids(int per_edge) {
    const std::size_t count = per_edge <= 40 ? input_count : 4;  // half a million particles are not learnt by heart
    for (std::size_t seed = 0; seed < count; ++seed) {
      shuffled.push_back(resting_liquid<Scalar>(per_edge, static_cast<double>(spacing), seed));
      sorted.push_back(in_cell_order(shuffled.back(), support));
    }
  }
  const PointArray<Scalar>& in_disorder(std::size_t turn) const { return shuffled[turn % shuffled.size()]; }
  const PointArray<Scalar>& in_order(std::size_t turn) const { return sorted[turn % sorted.size()]; }
  Index particles() const { return sorted[0].cols(); }
};

// Number of pairs and sum of neighbours' indices: who finds the same has the same.
std::uint64_t fingerprint(const NeighborList<Scalar>& list) {
  std::uint64_t result = list.pairs() << 40;
  for (Index i = 0; i < list.size(); ++i) {
    list.for_each(i, [&](Index j, const auto&, Scalar) {
      result += static_cast<std::uint64_t>(i + 1) * static_cast<std::uint64_t>(j);
    });
  }
  return result;
}

void measure_lists(Report& report, const Liquids& liquids, int thread_count) {
  const Threads threads{thread_count};
  const long size = liquids.particles();
  CellGrid<Scalar> grid;
  NeighborList<Scalar> list;
  const auto sort_and_list = [&](std::size_t turn) {
    grid.rebuild(liquids.in_disorder(turn), support, threads);
    grid.adopt_order(threads);  // a simulator moves its particles into this order, which the sorted liquid already has
    list.build_from(grid, liquids.in_order(turn), threads);
  };
  list.build(grid, liquids.in_order(0), support, threads);
  const std::uint64_t expected = fingerprint(list);
  const double neighbors = static_cast<double>(list.pairs()) / static_cast<double>(size);
  const auto check = [&](const std::string& name) {
    if (fingerprint(list) != expected) {
      throw std::runtime_error("the list by " + name + " differs");
    }
  };
  sort_and_list(0);
  check("sorting");

  Comparison lists(report, "neighbour lists", size, thread_count);
#if __has_include(<nanoflann.hpp>)
  decant::KdTree<Scalar> tree;
  list.build(tree, liquids.in_order(0), support, threads);
  check("nanoflann");
  lists.add("KdTree (nanoflann, its tree is built on one thread)",
            [&](std::size_t turn) { list.build(tree, liquids.in_order(turn), support, threads); });
#endif
  lists.add("CellGrid: sort and list", sort_and_list, std::to_string(neighbors).substr(0, 4) + " neighbours");
  lists.add("CellGrid: list of sorted particles",
            [&](std::size_t turn) { list.build(grid, liquids.in_order(turn), support, threads); });
  lists.add("CellGrid: list of shuffled particles",
            [&](std::size_t turn) { list.build(grid, liquids.in_disorder(turn), support, threads); });
  lists.add("CellGrid: sort", [&](std::size_t turn) { grid.rebuild(liquids.in_disorder(turn), support, threads); });
  lists.add("CellGrid: sort again", [&](std::size_t turn) { grid.rebuild(liquids.in_order(turn), support, threads); });
  decant::BruteForce<Scalar> brute_force;
  if (size <= 8000) {
    list.build(brute_force, liquids.in_order(0), support, threads);
    check("brute force");
    lists.add("BruteForce",
              [&](std::size_t turn) { list.build(brute_force, liquids.in_order(turn), support, threads); });
  }
  lists.run();

  if (!step_limit_program().empty()) {
    const int per_edge = static_cast<int>(std::lround(std::cbrt(static_cast<double>(size))));
    Comparison beside(report, "neighbour lists, beside step_limit", size, thread_count);
    beside.add_from_elsewhere("step_limit: sort and list",
                              [=] { return step_limit_figure("SEARCH sort+list v2", per_edge, thread_count); });
    beside.add("CellGrid: sort and list", sort_and_list);
    beside.add("the same, one input only, as step_limit has", [&](std::size_t) { sort_and_list(0); });
    beside.run();
  }
}

// ---- sweeps over pairs ----------------------------------------------------------------------------------------------

/// a_i = sum_j m (k_i + k_j) grad W_ij, a pressure sweep: kernels anew from separations, or gradients stored before.
/// And what follows it in an iteration, the divergence of these accelerations.
class PairSweeps {
 public:
  PairSweeps(const Liquids& liquids, Threads threads) : threads_(threads) {
    const auto count = static_cast<std::size_t>(liquids.particles());
    const std::size_t inputs = inputs_for(count <= 8000 ? 20 : count <= 64000 ? 40 : 80);
    CellGrid<Scalar> grid;
    for (std::size_t input = 0; input < inputs; ++input) {
      lists_.emplace_back().build(grid, liquids.in_order(input), support, threads);
    }
    for (std::size_t i = 0; i < count; ++i) {
      term_.push_back(1e-6f * static_cast<Scalar>(1 + i % 7));
    }
    result_.resize(4 * count);
    divergence_.resize(count);
    for (auto& values : axis_) {
      values.assign(count, Scalar(1));
    }
  }

  void take(std::size_t input) { list_ = &lists_[input % lists_.size()]; }

  void recompute_gradients() {
    over_particles([&](Index i) {
      B x(0), y(0), z(0);
      const B own(term_[static_cast<std::size_t>(i)]);
      list_->for_each_batch(i, [&](const auto& pair) {
        const B both = mass * (own + decant::gather(term_.data(), pair.neighbor)) *
                       Kernel::derivative_over_radius(square_root(pair.distance_squared), support / 2);
        x = multiply_add(both, pair.x, x);
        y = multiply_add(both, pair.y, y);
        z = multiply_add(both, pair.z, z);
      });
      set_result(i, x, y, z);
    });
  }

  void store_gradients() {
    for (auto& values : gradient_) {
      values.require(list_->index_size());
    }
    over_particles([&](Index i) {
      list_->for_each_batch(i, [&](const auto& pair) {
        const B slope = mass * Kernel::derivative_over_radius(square_root(pair.distance_squared), support / 2);
        (slope * pair.x).store(&gradient_[0][pair.slot]);
        (slope * pair.y).store(&gradient_[1][pair.slot]);
        (slope * pair.z).store(&gradient_[2][pair.slot]);
      });
    });
  }

  void acceleration_of_stored() {
    over_particles([&](Index i) {
      B x(0), y(0), z(0);
      const B own(term_[static_cast<std::size_t>(i)]);
      for_each_slot(i, [&](std::size_t k) {
        const B both = own + decant::gather(term_.data(), list_->index() + k);
        x = multiply_add(both, B::load(&gradient_[0][k]), x);
        y = multiply_add(both, B::load(&gradient_[1][k]), y);
        z = multiply_add(both, B::load(&gradient_[2][k]), z);
      });
      set_result(i, x, y, z);
    });
  }

  void divergence_of_stored() {
    over_particles([&](Index i) {
      B total(0);
      const Scalar* const own = result_.data() + 4 * i;
      for_each_slot(i, [&](std::size_t k) {
        const auto other = decant::gather3(result_.data(), list_->index() + k);
        total = multiply_add(own[0] - other.x, B::load(&gradient_[0][k]), total);
        total = multiply_add(own[1] - other.y, B::load(&gradient_[1][k]), total);
        total = multiply_add(own[2] - other.z, B::load(&gradient_[2][k]), total);
      });
      divergence_[static_cast<std::size_t>(i)] = sum(total);
    });
  }

  void read_by_transposing() {
    over_particles([&](Index i) {
      B total(0);
      for_each_slot(i, [&](std::size_t k) {
        const auto other = decant::gather3(list_->records(), list_->index() + k);
        total += other.x + other.y + other.z;
      });
      divergence_[static_cast<std::size_t>(i)] = sum(total);
    });
  }

  void read_by_gathers() {
    over_particles([&](Index i) {
      B total(0);
      for_each_slot(i, [&](std::size_t k) {
        const std::uint32_t* const index = list_->index() + k;
        total += decant::gather(axis_[0].data(), index) + decant::gather(axis_[1].data(), index) +
                 decant::gather(axis_[2].data(), index);
      });
      divergence_[static_cast<std::size_t>(i)] = sum(total);
    });
  }

  const std::vector<Scalar>& result() const { return result_; }

 private:
  template <class Function>
  void over_particles(Function&& f) {
    decant::parallel_for(list_->size(), threads_, f);
    keep(divergence_);
  }
  template <class Function>
  void for_each_slot(Index i, Function&& f) const {
    const std::size_t end = list_->padded_end(i);
    for (std::size_t k = list_->first(i); k < end; k += B::width) {
      f(k);
    }
  }
  void set_result(Index i, const B& x, const B& y, const B& z) {
    Scalar* const record = result_.data() + 4 * i;
    record[0] = sum(x);
    record[1] = sum(y);
    record[2] = sum(z);
  }

  static constexpr Scalar mass = 1000 * spacing * spacing * spacing;
  Threads threads_;
  std::vector<NeighborList<Scalar>> lists_{};
  const NeighborList<Scalar>* list_ = nullptr;
  std::vector<Scalar> term_{}, result_{}, divergence_{}, axis_[3]{};
  decant::detail::Scratch<Scalar> gradient_[3]{};
};

void measure_sweeps(Report& report, const Liquids& liquids, int threads) {
  if (!report.wants("sweeps over the pairs") && !report.wants("reading x, y, z of neighbours")) {
    return;
  }
  PairSweeps sweeps(liquids, Threads{threads});
  sweeps.take(0);
  sweeps.recompute_gradients();
  const std::vector<Scalar> expected = sweeps.result();
  sweeps.store_gradients();
  sweeps.acceleration_of_stored();
  Scalar error = 0, largest = 0;
  for (std::size_t k = 0; k < expected.size(); ++k) {
    error = std::max(error, std::abs(sweeps.result()[k] - expected[k]));
    largest = std::max(largest, std::abs(expected[k]));
  }
  if (!(error < 1e-4f * largest)) {
    throw std::runtime_error("accelerations by stored gradients differ");
  }

  const auto add = [&](Comparison& comparison, const std::string& name, void (PairSweeps::*sweep)(), bool stored) {
    auto& added = comparison.add(name, [&sweeps, sweep](std::size_t) { (sweeps.*sweep)(); });
    added.prepare = [&sweeps, stored](std::size_t turn) {
      sweeps.take(turn);
      if (stored) {
        sweeps.store_gradients();
      }
    };
  };
  Comparison iteration(report, "sweeps over the pairs", liquids.particles(), threads);
  add(iteration, "acceleration, gradients recomputed", &PairSweeps::recompute_gradients, false);
  add(iteration, "storing gradients", &PairSweeps::store_gradients, false);
  add(iteration, "acceleration, gradients stored", &PairSweeps::acceleration_of_stored, true);
  add(iteration, "divergence, gradients stored", &PairSweeps::divergence_of_stored, true);
  iteration.run();
  Comparison reading(report, "reading x, y, z of neighbours", liquids.particles(), threads);
  add(reading, "records, transposed in registers", &PairSweeps::read_by_transposing, false);
  add(reading, "three gathers", &PairSweeps::read_by_gathers, false);
  reading.run();
}

}  // namespace

int main(int argc, char** argv) {
  Options options("bench_neighbor_search", "neighbour searches, neighbour lists, and sweeps over their pairs");
  options.add_threads().add("sizes", "20,40,80", "particles per edge of a cube of liquid");
  return benchmark_main(argc, argv, options, [](const Options& given, Report& report) {
    const std::vector<int> threads = given.numbers("threads");
    for (const int per_edge : given.numbers("sizes")) {
      const Liquids liquids(per_edge);
      for (const int count : threads) {
        measure_lists(report, liquids, count);
        measure_sweeps(report, liquids, count);
      }
    }
  });
}
