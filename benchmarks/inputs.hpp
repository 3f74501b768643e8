// SPDX-License-Identifier: MIT
#pragma once

/// What benchmarks measure with: liquids in general position, and a cup.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/types.hpp>
#include <decant/neighbor/cell_grid.hpp>

namespace decant_benchmark {

using decant::Index;

/// Inputs that a case rotates through: a processor learns the branches of one, and makes rays look twice as fast.
inline constexpr std::size_t input_count = 16;

/// per_edge^3 particles of a liquid at rest, in general position: a lattice, jittered by a tenth of the spacing [m],
/// turned against the axes, in random order. A lattice along the axes would flatter cell grids by a fifth.
/// @param seed other seeds give other jitter and another order.
template <class Scalar>
decant::PointArray<Scalar> resting_liquid(Index per_edge, double spacing, std::size_t seed = 0) {
  using decant::Vector3;
  std::mt19937 generator(static_cast<unsigned>(seed) + 1);
  std::uniform_real_distribution<double> jitter(-0.1, 0.1);
  const decant::Matrix3<double> turn =
      (Eigen::AngleAxisd(0.9, Vector3<double>::UnitZ()) * Eigen::AngleAxisd(0.5, Vector3<double>::UnitX()) *
       Eigen::AngleAxisd(0.3, Vector3<double>::UnitY()))
          .toRotationMatrix();
  decant::PointArray<Scalar> position(3, per_edge * per_edge * per_edge);
  for (Index i = 0; i < position.cols(); ++i) {
    const Vector3<double> corner(static_cast<double>(i % per_edge), static_cast<double>(i / per_edge % per_edge),
                                 static_cast<double>(i / per_edge / per_edge));
    const Vector3<double> shift(jitter(generator), jitter(generator), jitter(generator));
    position.col(i) = (turn * (corner + shift) * spacing).template cast<Scalar>();
  }
  for (Index i = position.cols() - 1; i > 0; --i) {
    position.col(i).swap(position.col(static_cast<Index>(generator() % static_cast<unsigned>(i + 1))));
  }
  return position;
}

/// The same particles in the order in which a simulator keeps them: by cells of one support radius [m].
template <class Scalar>
decant::PointArray<Scalar> in_cell_order(const decant::PointArray<Scalar>& shuffled, Scalar support) {
  decant::CellGrid<Scalar> grid;
  grid.rebuild(shuffled, support, decant::Threads{1});
  decant::PointArray<Scalar> sorted(3, shuffled.cols());
  for (Index k = 0; k < shuffled.cols(); ++k) {
    sorted.col(k) = shuffled.col(grid.order()[static_cast<std::size_t>(k)]);
  }
  return sorted;
}

/// Liquids that differ by their jitter, each in cell order.
template <class Scalar>
std::vector<decant::PointArray<Scalar>> sorted_liquids(Index per_edge, double spacing,
                                                       std::size_t count = input_count) {
  std::vector<decant::PointArray<Scalar>> liquids;
  for (std::size_t seed = 0; seed < count; ++seed) {
    liquids.push_back(in_cell_order(resting_liquid<Scalar>(per_edge, spacing, seed), static_cast<Scalar>(2 * spacing)));
  }
  return liquids;
}

/// How many inputs are enough where each takes much memory (10 MB for the lists of 8,000 particles): no processor
/// learns the branches of a hundred thousand rows, so that large inputs need no company.
inline std::size_t inputs_for(int per_edge) { return per_edge <= 20 ? input_count : per_edge <= 40 ? 4 : 2; }

/// A cup with 3 mm walls, 0.09 m high, whose outline has `steps` pieces and is turned in as many: 2 steps^2 triangles.
inline decant::TriangleMesh cup(std::uint32_t steps) {
  const std::vector<Eigen::Vector2d> outline{{0.001, -0.003}, {0.033, -0.003}, {0.043, 0.09},
                                             {0.040, 0.09},   {0.030, 0},      {0.001, 0}};
  double length = 0;
  for (std::size_t k = 0; k < outline.size(); ++k) {
    length += (outline[(k + 1) % outline.size()] - outline[k]).norm();
  }
  decant::TriangleMesh mesh;
  for (std::uint32_t i = 0; i < steps; ++i) {
    double way = length * i / steps;
    std::size_t piece = 0;
    const auto size = [&] { return (outline[(piece + 1) % outline.size()] - outline[piece]).norm(); };
    while (way > size()) {
      way -= size();
      ++piece;
    }
    const Eigen::Vector2d at = outline[piece] + way / size() * (outline[(piece + 1) % outline.size()] - outline[piece]);
    for (std::uint32_t j = 0; j < steps; ++j) {
      const double turn = 2 * 3.14159265358979 * j / steps;
      mesh.vertices.emplace_back(at.x() * std::cos(turn), at.x() * std::sin(turn), at.y());
      const std::uint32_t next_i = (i + 1) % steps;
      const std::uint32_t next_j = (j + 1) % steps;
      mesh.triangles.push_back({i * steps + j, i * steps + next_j, next_i * steps + j});
      mesh.triangles.push_back({i * steps + next_j, next_i * steps + next_j, next_i * steps + j});
    }
  }
  return mesh;
}

}  // namespace decant_benchmark
