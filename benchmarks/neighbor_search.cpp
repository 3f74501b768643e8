// SPDX-License-Identifier: MIT
/// Times neighbour searches, the neighbour list and sweeps over its pairs: liquid at rest in general position, spacing
/// 5 mm, support 10 mm. Usage: bench_micro_neighbor_search [threads, default 1 and 2] [particles per edge, default 20
/// 40 80]

#include <cstdint>
#include <cstdlib>
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

namespace {

using namespace decant_benchmark;
using decant::Batch;
using decant::CellGrid;
using decant::CubicSpline;
using decant::NeighborList;
using decant::PointArray;
using decant::Threads;

using Scalar = float;
using B = Batch<Scalar>;
constexpr Scalar spacing = 0.005f;
constexpr Scalar support = 0.010f;

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

// a_i = sum_j m (k_i + k_j) grad W_ij, a pressure sweep: kernels anew from positions, or gradients stored before.
void pair_sweeps(Csv& csv, const NeighborList<Scalar>& list, Threads threads) {
  using Kernel = CubicSpline<Scalar>;
  const Index count = list.size();
  const double neighbors = static_cast<double>(list.pairs()) / static_cast<double>(count);
  const Scalar mass = 1000 * spacing * spacing * spacing;
  std::vector<Scalar> term(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < term.size(); ++i) {
    term[i] = 1e-6f * static_cast<Scalar>(1 + i % 7);
  }
  std::vector<Scalar> result(4 * static_cast<std::size_t>(count)), again(result.size());
  const auto store = [](std::vector<Scalar>& to, Index i, const B& x, const B& y, const B& z) {
    Scalar* const record = to.data() + 4 * i;
    record[0] = sum(x);
    record[1] = sum(y);
    record[2] = sum(z);
  };
  csv.row("sweep: recomputed gradients", threads.count, count, neighbors, time_of([&] {
            decant::parallel_for(count, threads, [&](Index i) {
              B x(0), y(0), z(0);
              const B own(term[static_cast<std::size_t>(i)]);
              list.for_each_batch(i, [&](const auto& pair) {
                const B both = mass * (own + decant::gather(term.data(), pair.neighbor)) *
                               Kernel::derivative_over_radius(square_root(pair.distance_squared), support / 2);
                x = multiply_add(both, pair.x, x);
                y = multiply_add(both, pair.y, y);
                z = multiply_add(both, pair.z, z);
              });
              store(result, i, x, y, z);
            });
          }));

  decant::detail::Scratch<Scalar> gradient_x, gradient_y, gradient_z;
  gradient_x.require(list.index_size());
  gradient_y.require(list.index_size());
  gradient_z.require(list.index_size());
  csv.row("sweep: storing gradients", threads.count, count, neighbors, time_of([&] {
            decant::parallel_for(count, threads, [&](Index i) {
              list.for_each_batch(i, [&](const auto& pair) {
                const B slope = mass * Kernel::derivative_over_radius(square_root(pair.distance_squared), support / 2);
                (slope * pair.x).store(&gradient_x[pair.slot]);
                (slope * pair.y).store(&gradient_y[pair.slot]);
                (slope * pair.z).store(&gradient_z[pair.slot]);
              });
            });
          }));
  csv.row("sweep: stored gradients: acceleration", threads.count, count, neighbors, time_of([&] {
            decant::parallel_for(count, threads, [&](Index i) {
              B x(0), y(0), z(0);
              const B own(term[static_cast<std::size_t>(i)]);
              const std::size_t end = list.padded_end(i);
              for (std::size_t k = list.first(i); k < end; k += B::width) {
                const B both = own + decant::gather(term.data(), list.index() + k);
                x = multiply_add(both, B::load(&gradient_x[k]), x);
                y = multiply_add(both, B::load(&gradient_y[k]), y);
                z = multiply_add(both, B::load(&gradient_z[k]), z);
              }
              store(again, i, x, y, z);
            });
          }));
  std::vector<Scalar> divergence(static_cast<std::size_t>(count));
  csv.row("sweep: stored gradients: divergence", threads.count, count, neighbors, time_of([&] {
            decant::parallel_for(count, threads, [&](Index i) {
              B total(0);
              const Scalar* const own = again.data() + 4 * i;
              const B own_x(own[0]), own_y(own[1]), own_z(own[2]);
              const std::size_t end = list.padded_end(i);
              for (std::size_t k = list.first(i); k < end; k += B::width) {
                const auto other = decant::gather3(again.data(), list.index() + k);
                total = multiply_add(own_x - other.x, B::load(&gradient_x[k]), total);
                total = multiply_add(own_y - other.y, B::load(&gradient_y[k]), total);
                total = multiply_add(own_z - other.z, B::load(&gradient_z[k]), total);
              }
              divergence[static_cast<std::size_t>(i)] = sum(total);
            });
          }));
  Scalar error = 0, size = 0;
  for (std::size_t k = 0; k < result.size(); ++k) {
    error = std::max(error, std::abs(result[k] - again[k]));
    size = std::max(size, std::abs(result[k]));
  }
  if (!(error < 1e-4f * size)) {
    throw std::runtime_error("the two sweeps disagree");
  }

  // The two ways to read records of four by index.
  csv.row("sweep: x y z by one transposing gather", threads.count, count, neighbors, time_of([&] {
            decant::parallel_for(count, threads, [&](Index i) {
              B total(0);
              const std::size_t end = list.padded_end(i);
              for (std::size_t k = list.first(i); k < end; k += B::width) {
                const auto other = decant::gather3(list.records(), list.index() + k);
                total += other.x + other.y + other.z;
              }
              divergence[static_cast<std::size_t>(i)] = sum(total);
            });
          }));
  std::vector<Scalar> axis[3];
  for (std::size_t a = 0; a < 3; ++a) {
    for (Index i = 0; i < count; ++i) {
      axis[a].push_back(list.records()[4 * static_cast<std::size_t>(i) + a]);
    }
  }
  csv.row("sweep: x y z by three hardware gathers", threads.count, count, neighbors, time_of([&] {
            decant::parallel_for(count, threads, [&](Index i) {
              B total(0);
              const std::size_t end = list.padded_end(i);
              for (std::size_t k = list.first(i); k < end; k += B::width) {
                total += decant::gather(axis[0].data(), list.index() + k) +
                         decant::gather(axis[1].data(), list.index() + k) +
                         decant::gather(axis[2].data(), list.index() + k);
              }
              divergence[static_cast<std::size_t>(i)] = sum(total);
            });
          }));
  keep(divergence);
}

void run(Csv& csv, Index per_edge, Threads threads) {
  const PointArray<Scalar> shuffled = resting_liquid<Scalar>(per_edge, spacing);
  const Index count = shuffled.cols();
  CellGrid<Scalar> grid;
  NeighborList<Scalar> list;
  grid.rebuild(shuffled, support, threads);
  PointArray<Scalar> sorted(3, count);
  for (Index k = 0; k < count; ++k) {
    sorted.col(k) = shuffled.col(grid.order()[static_cast<std::size_t>(k)]);
  }
  list.build(grid, sorted, support, threads);
  const double neighbors = static_cast<double>(list.pairs()) / static_cast<double>(count);
  const std::uint64_t expected = fingerprint(list);

  csv.row("CellGrid: sort", threads.count, count, neighbors,
          time_of([&] { grid.rebuild(shuffled, support, threads); }));
  csv.row("CellGrid: sort again", threads.count, count, neighbors,
          time_of([&] { grid.rebuild(sorted, support, threads); }));
  csv.row("NeighborList: sort and list", threads.count, count, neighbors, time_of([&] {
            grid.rebuild(shuffled, support, threads);
            grid.adopt_order(threads);
            list.build_from(grid, sorted, threads);
          }));
  if (fingerprint(list) != expected) {
    throw std::runtime_error("lists disagree");
  }
  csv.row("NeighborList: sorted particles", threads.count, count, neighbors,
          time_of([&] { list.build(grid, sorted, support, threads); }));
  csv.row("NeighborList: shuffled particles", threads.count, count, neighbors,
          time_of([&] { list.build(grid, shuffled, support, threads); }));

#if __has_include(<nanoflann.hpp>)
  if (count <= 64000) {
    decant::KdTree<Scalar> tree;
    NeighborList<Scalar> from_tree;
    csv.row("KdTree: NeighborList of sorted particles", threads.count, count, neighbors,
            time_of([&] { from_tree.build(tree, sorted, support, threads); }), "nanoflann builds on one thread");
    if (fingerprint(from_tree) != expected) {
      throw std::runtime_error("KdTree's list disagrees");
    }
  }
#endif
  if (count <= 8000) {
    decant::BruteForce<Scalar> reference;
    NeighborList<Scalar> from_all;
    csv.row("BruteForce: NeighborList of sorted particles", threads.count, count, neighbors,
            time_of([&] { from_all.build(reference, sorted, support, threads); }));
    if (fingerprint(from_all) != expected) {
      throw std::runtime_error("brute force's list disagrees");
    }
  }
  list.build(grid, sorted, support, threads);
  pair_sweeps(csv, list, threads);
}

}  // namespace

int main(int argc, char** argv) {
  Csv csv;
  const std::vector<int> thread_counts = argc > 1 ? std::vector<int>{std::atoi(argv[1])} : std::vector<int>{1, 2};
  const std::vector<int> edges = argc > 2 ? std::vector<int>{std::atoi(argv[2])} : std::vector<int>{20, 40, 80};
  for (const int per_edge : edges) {
    for (const int threads : thread_counts) {
      run(csv, per_edge, Threads{threads});
    }
  }
}
