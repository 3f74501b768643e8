// SPDX-License-Identifier: MIT
#pragma once

/// Wall integrals of a triangle mesh: computed once on a grid in the body's frame, then looked up.

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/ray_fan.hpp>
#include <decant/boundary/wall_function.hpp>
#include <decant/boundary/wall_sample.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// What lies in the shadow of a mesh: the integral of the wall's weight (WallFunction) over all points that the surface
/// hides from the particle. Along a ray in direction u that meets the surface at distance t, the radial part is known
/// in closed form, so only directions are summed:
///   share    = int du G(t),     G(t) = int_t^R w s^2 ds   = (share_plane(t) + t slope_plane(t)) / 2 pi
///   gradient = int du u K(t),   K(t) = -int_t^R w' s^2 ds = t^2 w(t) + slope_plane(t) / pi
///   moment   = int du K(t) t (u.n)^2 n n^T,   n the surface's normal where the ray meets it
/// A surface hides what is behind it whatever its thickness and orientation, which makes thin walls and small defects
/// harmless; corners and curved walls need no special case.
/// Immutable after construction and shared between simulations; refers to the hierarchy, which it does not own.
class MeshWall {
 public:
  /// Number of grid cells per particle spacing.
  static constexpr double cells_per_spacing = 3;

  /// @param spacing particle spacing [m], > 0.
  template <class Kernel>
  static MeshWall of(const BoundingVolumeHierarchy& surface, double smoothing_length, double spacing, Threads threads) {
    expects(std::isfinite(spacing) && spacing > 0, "MeshWall: particle spacing [m]", "> 0", spacing);
    MeshWall wall;
    wall.surface_ = &surface;
    wall.plane_ = WallFunction::of<Kernel>(smoothing_length, spacing);
    wall.cell_ = spacing / cells_per_spacing;
    wall.clear_ = std::sqrt(3.0) * wall.cell_;
    wall.clear_of_plane_ = wall.plane_.share_and_slope(wall.clear_);
    wall.build(threads);
    return wall;
  }

  /// Distance from which the wall is not felt [m].
  double reach() const noexcept { return plane_.reach(); }

  /// False where no wall is within the support of x (in the body's frame).
  bool sample(const Vector3<double>& x, WallSample& result) const noexcept {
    switch (look_up(x, result)) {
      case LookUp::Far:
        return false;
      case LookUp::Crossed:
        return sample_close(x, result);
      default:
        return result.share > 0;
    }
  }

  /// The sum over directions at x itself: slower by a factor of some tens, exact at any place.
  bool sample_directly(const Vector3<double>& x, WallSample& result) const noexcept {
    const auto nearest = surface_->closest_point(x, reach());
    if (!nearest) {
      return false;
    }
    result.distance = nearest->distance;
    return add_up_directions(x, result);
  }

 private:
  enum class LookUp { Far, Found, Crossed };

  // All of a sample but the distance.
  bool add_up_directions(const Vector3<double>& x, WallSample& result) const noexcept {
    result.share = 0;
    result.gradient.setZero();
    result.moment.setZero();
    const RayFan<direction_count>& fan = directions();
    // rays side by side often meet one triangle: their moments share a normal
    std::uint32_t triangle = 0;
    Vector3<double> normal = Vector3<double>::Zero();
    double moment = 0;
    const auto add_moment = [&] {
      for (Index column = 0; column < 3; ++column) {
        result.moment.col(column) += moment * normal[column] * normal;
      }
      moment = 0;
    };
    fan.first_hits(*surface_, x, reach(), [&](std::size_t k, const BoundingVolumeHierarchy::Hit& hit) {
      if (hit.triangle != triangle) {
        add_moment();
        triangle = hit.triangle;
      }
      normal = hit.normal;
      const Vector3<double>& direction = fan.direction(k);
      const double t = hit.fraction * reach();
      const WallFunction::Terms plane = plane_.terms(t);
      result.share += (plane.share + t * plane.slope) / (2 * pi);
      const double pull = t * plane.radius_times_weight + plane.slope / pi;
      const double facing = direction.dot(normal);
      result.gradient += pull * direction;
      moment += pull * t * facing * facing;
    });
    add_moment();
    const double solid_angle = 4 * pi / static_cast<double>(direction_count);
    result.share *= solid_angle;
    result.gradient *= solid_angle;
    result.moment *= solid_angle;
    return result.share > 0;
  }

  /// From the grid; a cell that the surface passes through has corners that see different sides, and no answer.
  LookUp look_up(const Vector3<double>& x, WallSample& result) const noexcept {
    std::array<int, 3> cell;
    Vector3<double> t;
    for (int axis = 0; axis < 3; ++axis) {
      const double place = (x[axis] - origin_[axis]) / cell_;
      if (!(place >= 0 && place < static_cast<double>(blocks_[static_cast<std::size_t>(axis)] * block_cells))) {
        return LookUp::Far;
      }
      const auto at = static_cast<std::size_t>(axis);
      cell[at] = static_cast<int>(place);
      t[axis] = place - cell[at];
    }
    const std::int32_t block =
        block_of_[block_number(cell[0] / block_cells, cell[1] / block_cells, cell[2] / block_cells)];
    if (block < 0) {
      return LookUp::Far;
    }
    const int i = cell[0] % block_cells, j = cell[1] % block_cells, k = cell[2] % block_cells;
    const Block& nodes = *block_data_[static_cast<std::size_t>(block)];
    const std::size_t number = cell_number(i, j, k);
    if (!nodes.felt[number]) {
      return LookUp::Far;  // most of the liquid: told by one bit, without a look at the nodes
    }
    if (nodes.crossed[number]) {
      return LookUp::Crossed;
    }
    StoredValues stored = StoredValues::Zero();
    for (int corner = 0; corner < 8; ++corner) {
      const int di = corner & 1, dj = (corner >> 1) & 1, dk = corner >> 2;
      const double weight = (di ? t[0] : 1 - t[0]) * (dj ? t[1] : 1 - t[1]) * (dk ? t[2] : 1 - t[2]);
      stored += static_cast<float>(weight) * nodes.value[node_number(i + di, j + dj, k + dk)];
    }
    const NodeValues mean = stored.cast<double>();
    const auto [share, slope] = plane_.share_and_slope(mean[0]);
    result.share = share;
    result.distance = mean[4];
    const NodeValues scaled = slope * mean;
    result.gradient = scaled.segment<3>(1);
    result.moment << scaled[5], scaled[6], scaled[7], scaled[6], scaled[8], scaled[9], scaled[7], scaled[9], scaled[10];
    return LookUp::Found;
  }

  /// Close to the surface: from the grid a little farther off it, with the part of the nearest wall, taken for a plane,
  /// replaced by what it is at x. Where that wall is not nearly all there is (in corners, where each wall hides some of
  /// what is behind the other) or there is no room to step back, the sum over directions.
  bool sample_close(const Vector3<double>& x, WallSample& result) const noexcept {
    const auto nearest = surface_->closest_point(x, clear_);
    if (!nearest || !(nearest->distance > 1e-3 * cell_)) {
      return sample_directly(x, result);
    }
    const double distance = nearest->distance;
    const Vector3<double> toward = (nearest->point - x) / distance;
    const Vector3<double> back = x - (clear_ - distance) * toward;
    WallSample farther;
    if (look_up(back, farther) != LookUp::Found || surface_->any_hit(x, back) ||
        !(std::abs(farther.share - clear_of_plane_.share) < 0.1 * clear_of_plane_.share)) {
      return sample_directly(x, result);
    }
    const WallFunction::ShareAndSlope here = plane_.share_and_slope(distance);
    result.distance = distance;
    result.share = std::max(farther.share + here.share - clear_of_plane_.share, 0.0);
    result.gradient = farther.gradient + (here.slope - clear_of_plane_.slope) * toward;
    result.moment =
        farther.moment + (here.slope * distance - clear_of_plane_.slope * clear_) * toward * toward.transpose();
    return result.share > 0;
  }

  static constexpr double pi = 3.14159265358979323846;
  static constexpr std::size_t direction_count = 128;
  static constexpr int block_cells = 8;
  static constexpr int block_nodes = block_cells + 1;

  /// Eight cells a side; border nodes are stored in both blocks, so that a look-up stays within one.
  /// A node holds the distance of a plane that would have the same share, the gradient over that plane's slope, the
  /// true distance, and the moment over that slope (xx, xy, xz, yy, yz, zz). Near a plane all of these are linear or
  /// constant in space, so interpolation is exact there, although the share itself is steep.
  /// The twelfth value is nothing: with it, four at a time are read and weighted.
  using NodeValues = Eigen::Matrix<double, 12, 1>;
  using StoredValues = Eigen::Matrix<float, 12, 1>;
  struct Block {
    std::array<StoredValues, block_nodes * block_nodes * block_nodes> value;
    std::bitset<block_cells * block_cells * block_cells> crossed;
    std::bitset<block_cells * block_cells * block_cells> felt;  ///< cells in which there may be a share
  };

  using Place = std::array<int, 3>;  // of a block in the table

  static std::size_t node_number(int i, int j, int k) noexcept {
    return static_cast<std::size_t>((k * block_nodes + j) * block_nodes + i);
  }

  static std::size_t cell_number(int i, int j, int k) noexcept {
    return static_cast<std::size_t>((k * block_cells + j) * block_cells + i);
  }

  std::size_t block_number(int i, int j, int k) const noexcept {
    return (static_cast<std::size_t>(k) * static_cast<std::size_t>(blocks_[1]) + static_cast<std::size_t>(j)) *
               static_cast<std::size_t>(blocks_[0]) +
           static_cast<std::size_t>(i);
  }

  /// Evenly spread over the sphere (Fibonacci lattice), the same everywhere so that the sum varies smoothly in space.
  static const RayFan<direction_count>& directions() noexcept {
    static const RayFan<direction_count> all = [] {
      std::array<Vector3<double>, direction_count> made;
      const double golden_angle = pi * (3 - std::sqrt(5.0));
      for (std::size_t k = 0; k < direction_count; ++k) {
        const double z = 1 - 2 * (static_cast<double>(k) + 0.5) / static_cast<double>(direction_count);
        const double radius = std::sqrt(1 - z * z);
        const double angle = golden_angle * static_cast<double>(k);
        made[k] = {radius * std::cos(angle), radius * std::sin(angle), z};
      }
      return RayFan<direction_count>(made);
    }();
    return all;
  }

  void build(Threads threads) {
    const Eigen::AlignedBox3d bounds = surface_->bounds();
    const double margin = reach() + cell_;
    const double block_size = cell_ * block_cells;
    origin_ = bounds.min().array() - margin;
    double blocks = 1;
    for (int axis = 0; axis < 3; ++axis) {
      const double length = bounds.max()[axis] - bounds.min()[axis] + 2 * margin;
      const double count = std::ceil(length / block_size);
      blocks *= count;
      // 1e8 blocks of 8 cells: 400 MB of table; beyond it the spacing does not fit the body
      expects(blocks < 1e8, "MeshWall: size of the mesh over the particle spacing", "< 1e3 per axis or so",
              length / spacing_of_cell());
      blocks_[static_cast<std::size_t>(axis)] = static_cast<int>(count);
    }
    block_of_.assign(static_cast<std::size_t>(blocks), -1);
    std::vector<Place> used;
    const double half_diagonal = 0.5 * std::sqrt(3.0) * block_size;
    for (int k = 0; k < blocks_[2]; ++k) {
      for (int j = 0; j < blocks_[1]; ++j) {
        for (int i = 0; i < blocks_[0]; ++i) {
          const Vector3<double> center = origin_ + block_size * Vector3<double>(i + 0.5, j + 0.5, k + 0.5);
          if (surface_->closest_point(center, reach() + half_diagonal)) {
            block_of_[block_number(i, j, k)] = static_cast<std::int32_t>(used.size());
            used.push_back({i, j, k});
          }
        }
      }
    }
    block_data_.resize(used.size());
    for (auto& block : block_data_) {
      block = std::make_unique<Block>();
    }
    // Every node is computed by one block, the one that it begins or the only one that there is, and copied to others.
    const auto for_each_block = [&](auto&& f) {
      parallel_ranges(static_cast<Index>(used.size()), threads, 1, [&](Index b, Index) {
        const auto& place = used[static_cast<std::size_t>(b)];
        f(*block_data_[static_cast<std::size_t>(b)], place);
      });
    };
    for_each_block([&](Block& block, const Place& place) { set_nearest(block, place); });
    for_each_block([&](Block& block, const Place& place) { copy_borders(block, place); });
    for_each_block([&](Block& block, const Place& place) { set_crossed(block, place); });
    for_each_block([&](Block& block, const Place& place) { set_sums(block, place); });
    for_each_block([&](Block& block, const Place& place) { copy_borders(block, place); });
    for_each_block([&](Block& block, const Place&) { set_felt(block); });
  }

  double spacing_of_cell() const noexcept { return cell_ * cells_per_spacing; }

  /// Of node or cell i, j, k of a block, where these may be fractions.
  Vector3<double> position(const Place& place, double i, double j, double k) const noexcept {
    return origin_ +
           cell_ * Vector3<double>(block_cells * place[0] + i, block_cells * place[1] + j, block_cells * place[2] + k);
  }

  /// The block there; none outside of the table and far from the surface.
  const Block* block_at(const Place& place) const noexcept {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (place[axis] < 0 || place[axis] >= blocks_[axis]) {
        return nullptr;
      }
    }
    const std::int32_t block = block_of_[block_number(place[0], place[1], place[2])];
    return block < 0 ? nullptr : block_data_[static_cast<std::size_t>(block)].get();
  }

  /// The other block that computes a node on the border of this one.
  const Block* owner(const Place& place, int i, int j, int k) const noexcept {
    const Place next{place[0] + i / block_cells, place[1] + j / block_cells, place[2] + k / block_cells};
    return next == place ? nullptr : block_at(next);
  }

  template <class Function>
  static void for_each_node(Function&& f) {
    for (int k = 0; k < block_nodes; ++k) {
      for (int j = 0; j < block_nodes; ++j) {
        for (int i = 0; i < block_nodes; ++i) {
          f(i, j, k);
        }
      }
    }
  }

  void copy_borders(Block& block, const Place& place) const noexcept {
    for_each_node([&](int i, int j, int k) {
      // its own borders may be written meanwhile, but not this node, which is not at its upper ones
      if (const Block* from = owner(place, i, j, k)) {
        block.value[node_number(i, j, k)] = from->value[node_number(i % block_cells, j % block_cells, k % block_cells)];
      }
    });
  }

  /// The nearest wall, taken for a plane.
  void set_nearest(Block& block, const Place& place) const noexcept {
    double limit = 2 * reach();
    for_each_node([&](int i, int j, int k) {
      if (owner(place, i, j, k) != nullptr) {
        limit = 2 * reach();
        return;
      }
      const Vector3<double> x = position(place, i, j, k);
      NodeValues node = NodeValues::Zero();
      node[0] = node[4] = 2 * reach();
      // the distance changes by a cell at most from one node to the next in the row, which saves most of the search
      const auto nearest = surface_->closest_point(x, i == 0 ? 2 * reach() : limit);
      limit = 2 * reach();
      if (nearest) {
        limit = std::min(limit, nearest->distance + 1.001 * cell_);
        node[0] = node[4] = nearest->distance;
        if (nearest->distance > 0) {
          const Vector3<double> toward = (nearest->point - x) / nearest->distance;
          node.segment<3>(1) = toward;
          set_moment(node, nearest->distance * toward * toward.transpose());
        }
      }
      block.value[node_number(i, j, k)] = node.cast<float>();
    });
  }

  void set_crossed(Block& block, const Place& place) const noexcept {
    const double half_diagonal = 0.5 * std::sqrt(3.0) * cell_;
    for (int k = 0; k < block_cells; ++k) {
      for (int j = 0; j < block_cells; ++j) {
        for (int i = 0; i < block_cells; ++i) {
          // two corners on opposite sides of a wall have a distance sum below their own distance: within one cell, a
          // surface can only be where some corner is nearer than half the diagonal
          float nearest = std::numeric_limits<float>::max();
          for (int corner_number = 0; corner_number < 8; ++corner_number) {
            nearest = std::min(nearest, block.value[node_number(i + (corner_number & 1), j + ((corner_number >> 1) & 1),
                                                                k + (corner_number >> 2))][4]);
          }
          if (static_cast<double>(nearest) < half_diagonal) {
            block.crossed[cell_number(i, j, k)] =
                surface_->closest_point(position(place, i + 0.5, j + 0.5, k + 0.5), half_diagonal).has_value();
          }
        }
      }
    }
  }

  /// Where all corners are out of a plane's reach, so is what is interpolated between them.
  void set_felt(Block& block) const noexcept {
    for (int k = 0; k < block_cells; ++k) {
      for (int j = 0; j < block_cells; ++j) {
        for (int i = 0; i < block_cells; ++i) {
          bool felt = block.crossed[cell_number(i, j, k)];
          for (int corner = 0; corner < 8 && !felt; ++corner) {
            const auto& node = block.value[node_number(i + (corner & 1), j + ((corner >> 1) & 1), k + (corner >> 2))];
            felt = static_cast<double>(node[0]) < reach();
          }
          block.felt[cell_number(i, j, k)] = felt;
        }
      }
    }
  }

  /// Whether look_up reads a node that this block computes: if one of the cells around it has an answer.
  bool is_read(const Place& place, int i, int j, int k) const noexcept {
    for (int corner = 0; corner < 8; ++corner) {
      // one block further, so that what is below it counts from 0 as well
      const int ci = i - (corner & 1) + block_cells, cj = j - ((corner >> 1) & 1) + block_cells,
                ck = k - (corner >> 2) + block_cells;
      const Block* block =
          block_at({place[0] + ci / block_cells - 1, place[1] + cj / block_cells - 1, place[2] + ck / block_cells - 1});
      if (block != nullptr && !block->crossed[cell_number(ci % block_cells, cj % block_cells, ck % block_cells)]) {
        return true;
      }
    }
    return false;
  }

  /// The sums over directions where there is something to sum.
  void set_sums(Block& block, const Place& place) const noexcept {
    for_each_node([&](int i, int j, int k) {
      StoredValues& stored = block.value[node_number(i, j, k)];
      if (!(static_cast<double>(stored[4]) < reach()) || owner(place, i, j, k) != nullptr || !is_read(place, i, j, k)) {
        return;
      }
      WallSample sample;
      if (!add_up_directions(position(place, i, j, k), sample)) {
        return;
      }
      const double distance = plane_.distance_for(sample.share);
      // close to the reach share and slope tend to zero, and their quotients to rounding: the nearest point tells
      // better
      if (distance < 0.9 * reach()) {
        NodeValues node = NodeValues::Zero();
        node[0] = distance;
        node.segment<3>(1) = sample.gradient / plane_.slope(distance);
        node[4] = static_cast<double>(stored[4]);
        set_moment(node, sample.moment / plane_.slope(distance));
        stored = node.cast<float>();
      }
    });
  }

  static void set_moment(NodeValues& node, const Eigen::Matrix3d& moment) noexcept {
    node.segment<6>(5) << moment(0, 0), moment(0, 1), moment(0, 2), moment(1, 1), moment(1, 2), moment(2, 2);
  }

  const BoundingVolumeHierarchy* surface_ = nullptr;
  WallFunction plane_{};
  double cell_ = 0;
  double clear_ = 0;  ///< at a cell's diagonal from the surface no cell is crossed by it
  WallFunction::ShareAndSlope clear_of_plane_{};
  Vector3<double> origin_ = Vector3<double>::Zero();
  std::array<int, 3> blocks_{};
  std::vector<std::int32_t> block_of_{};
  std::vector<std::unique_ptr<Block>> block_data_{};
};

}  // namespace decant::inline DECANT_TARGET
