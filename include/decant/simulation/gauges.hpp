// SPDX-License-Identifier: MIT
#pragma once

/// Readings that an experimenter would take of the liquid: levels, fronts, wall pressures, volumes, highest points.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <tuple>
#include <vector>

#include <Eigen/Dense>

#include <decant/boundary/cavity.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/fluid_state.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/neighbor/cell_grid.hpp>

namespace decant::inline DECANT_TARGET {

/// Takes readings of particles at one instant: observe() first, then any number of readings. SI units, world frame, up
/// is +z. Particles with non-finite coordinates are passed over.
///
/// A particle stands for a cube of one spacing, so surfaces lie half a spacing beyond the outermost centres. Which
/// droplets are left out: liquid is one piece where particles are within two spacings of each other (they feel each
/// other), and the bulk is the largest piece.
template <class ScalarType>
class Gauges {
 public:
  using Scalar = ScalarType;

  /// @param spacing of the particles [m], > 0.
  explicit Gauges(double spacing) : spacing_(spacing) {
    expects(spacing > 0 && std::isfinite(spacing), "Gauges: spacing [m]", "> 0 and finite", spacing);
  }

  /// Readings are of this liquid from now on; it is not owned and must not change between here and the readings.
  void observe(const FluidState<Scalar>& fluid, Threads threads = {}) {
    fluid_ = &fluid;
    grid_.rebuild(fluid.position, static_cast<Scalar>(reach()), threads);
    pieces_known_ = false;
  }

  /// Height of the free surface above (x, y) [m]: the top of the lowest column that stands on something. Nothing where
  /// no such column is there. @param stands bool(const Vector3<double>& x): is there something solid within 1.5
  /// spacings below x, or can liquid not fall from there for another reason?
  template <class Stands>
  std::optional<double> level(double x, double y, Stands&& stands) const {
    std::vector<Vector3<double>> column;
    for (Index i = 0; i < count(); ++i) {
      const Vector3<double> p = position(i);
      if (std::hypot(p.x() - x, p.y() - y) < reach() && std::isfinite(p.z())) {
        column.push_back(p);
      }
    }
    std::sort(column.begin(), column.end(), [](const auto& a, const auto& b) { return a.z() < b.z(); });
    for (std::size_t begin = 0; begin < column.size();) {
      std::size_t end = begin + 1;
      while (end < column.size() && column[end].z() - column[end - 1].z() < 1.5 * spacing_) {
        ++end;
      }
      if (stands(column[begin])) {
        return surface_over(
            x, y,
            {column.begin() + static_cast<std::ptrdiff_t>(begin), column.begin() + static_cast<std::ptrdiff_t>(end)});
      }
      begin = end;
    }
    return std::nullopt;
  }

  /// The bulk's furthest x [m]. Nothing without liquid.
  std::optional<double> front() {
    find_pieces();
    const std::uint32_t bulk = largest_piece([](Index) { return true; });
    std::optional<double> furthest;
    for (Index i = 0; i < count(); ++i) {
      if (piece_[static_cast<std::size_t>(i)] == bulk && !(furthest && *furthest >= position(i).x())) {
        furthest = position(i).x();
      }
    }
    return furthest ? std::optional<double>(*furthest + 0.5 * spacing_) : std::nullopt;
  }

  /// Pressure at a point of a wall or in the liquid [Pa]: a linear fit to the particles within two spacings, 0 where
  /// there are none (a dry wall), never less than 0.
  double pressure(const Vector3<double>& point) const {
    // unknowns: pressure at the point, its gradient times the spacing
    Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    double weights = 0;
    int found = 0;
    grid_.for_each_near(point.cast<Scalar>(), [&](Index i, Scalar) {
      const Vector3<double> apart = (position(i) - point) / spacing_;
      const double weight = std::pow(std::max(0.0, 1 - apart.squaredNorm() / 4), 2);
      const Eigen::Vector4d row(1, apart.x(), apart.y(), apart.z());
      normal += weight * row * row.transpose();
      right += weight * static_cast<double>(fluid_->pressure[i]) * row;
      weights += weight;
      ++found;
    });
    if (!(weights > 0)) {
      return 0;
    }
    // held near zero where few particles, or all in a plane, say little about the gradient
    const double stiffness = (found < 4 ? 1.0 : found < 8 ? 0.02 : 0.002) * weights;
    normal.diagonal().tail<3>().array() += stiffness;
    const double value = normal.ldlt().solve(right)[0];
    return std::isfinite(value) ? std::max(value, 0.0) : 0.0;
  }

  /// Liquid in a container [m^3]: that of the particles in its cavity.
  double volume_in(const Cavity& cavity, const Pose& world_from_body) const {
    const Pose body_from_world = world_from_body.inverse();
    Index inside = 0;
    for (Index i = 0; i < count(); ++i) {
      inside += cavity.contains(body_from_world * position(i)) ? 1 : 0;
    }
    return static_cast<double>(inside) * spacing_ * spacing_ * spacing_;
  }

  /// Highest point of the liquid along a body's own z axis, in the body's frame [m]; of the liquid within the body's
  /// `bounds` across that axis, the largest piece counts. Nothing where there is none.
  /// Liquid is measured by volume, as the highest particle would be too high by what particles stray: above a slab in
  /// which liquid is everywhere, a column of a few spacings across holds as much more as its surface is higher. A
  /// surface that leans goes on to where the liquid ends. Crests narrower than the column are flattened; liquid less
  /// than seven spacings deep counts by its highest particle.
  std::optional<double> top(const Pose& world_from_body, const Eigen::AlignedBox3d& bounds) {
    find_pieces();
    const Pose body_from_world = world_from_body.inverse();
    in_body_.resize(static_cast<std::size_t>(count()));
    const auto place = [&](Index i) -> Vector3<double>& { return in_body_[static_cast<std::size_t>(i)]; };
    const auto within = [&](Index i) {
      const Vector3<double>& x = place(i);
      return x.x() >= bounds.min().x() && x.x() <= bounds.max().x() && x.y() >= bounds.min().y() &&
             x.y() <= bounds.max().y();
    };
    for (Index i = 0; i < count(); ++i) {
      place(i) = body_from_world * position(i);
    }
    const std::uint32_t bulk = largest_piece(within);
    bulk_.clear();
    double highest = -std::numeric_limits<double>::infinity();
    for (Index i = 0; i < count(); ++i) {
      if (piece_[static_cast<std::size_t>(i)] == bulk && within(i)) {
        bulk_.push_back(place(i));
        highest = std::max(highest, place(i).z());
      }
    }
    if (bulk_.empty()) {
      return std::nullopt;
    }
    // across the axis only: columns are found as neighbours on a plane
    flat_.resize(3, static_cast<Index>(bulk_.size()));
    for (std::size_t k = 0; k < bulk_.size(); ++k) {
      flat_.col(static_cast<Index>(k)) = Vector3<double>(bulk_[k].x(), bulk_[k].y(), 0);
    }
    flat_grid_.rebuild(flat_, column_radius * spacing_);
    columns_.clear();
    for (const Index i : highest_of_each_square(highest - 4 * spacing_)) {
      columns_.push_back(column_at(i));
    }
    centers_.resize(3, static_cast<Index>(columns_.size()));
    for (std::size_t k = 0; k < columns_.size(); ++k) {
      centers_.col(static_cast<Index>(k)) = Vector3<double>(columns_[k].center.x(), columns_[k].center.y(), 0);
    }
    flat_grid_.rebuild(centers_, slope_reach * spacing_);
    double best = -std::numeric_limits<double>::infinity();
    for (Index k = 0; k < centers_.cols(); ++k) {
      const Column& column = columns_[static_cast<std::size_t>(k)];
      Plane plane;
      const auto add = [&](const Column& other, double distance_squared) {
        const Vector3<double> apart((other.center.x() - column.center.x()) / spacing_,
                                    (other.center.y() - column.center.y()) / spacing_,
                                    (other.height - column.height) / spacing_);
        plane.add(apart, 1 - distance_squared / (slope_reach * slope_reach * spacing_ * spacing_));
      };
      add(column, 0);
      flat_grid_.for_each(
          k, [&](Index j, double distance_squared) { add(columns_[static_cast<std::size_t>(j)], distance_squared); });
      const Eigen::Vector3d fit = plane.solve();
      const Eigen::Vector2d slope = fit.tail<2>();
      const double steepness = slope.norm();
      // a plane steeper than 45 degrees is no surface that a plane describes
      const Eigen::Vector2d lean = steepness > 1 ? Eigen::Vector2d(slope / steepness) : slope;
      const Eigen::Vector2d outward = column.place - column.center;
      best = std::max(best, column.height + spacing_ * fit[0] + lean.dot(outward) + 0.5 * spacing_ * lean.norm());
    }
    return best;
  }

 private:
  // z = a + b x + c y by weighted least squares.
  struct Plane {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();

    void add(const Vector3<double>& x, double weight) {
      const Eigen::Vector3d row(1, x.x(), x.y());
      normal += weight * row * row.transpose();
      right += weight * x.z() * row;
    }

    // The slope is held at zero where there are too few points for one.
    Eigen::Vector3d solve() const {
      Eigen::Matrix3d held = normal;
      held.diagonal().tail<2>().array() += 0.05 * normal(0, 0);
      return held.ldlt().solve(right);
    }
  };

  // The liquid over one place of a plane.
  struct Column {
    Eigen::Vector2d place, center;  // where it was looked for, and the middle of what was found
    double height = 0;
  };

  struct Square {
    double x, y;
    Index highest;
  };

  // In spacings: wide and deep enough that counting particles measures a surface to a tenth of a spacing.
  static constexpr double column_radius = 2.5, slab_depth = 8, slab_below_top = 5, slope_reach = 3;

  // Of the particles above `low` that share a square of a spacing across the axis, the highest stands for all.
  const std::vector<Index>& highest_of_each_square(double low) {
    squares_.clear();
    for (Index i = 0; i < flat_.cols(); ++i) {
      if (bulk_[static_cast<std::size_t>(i)].z() > low) {
        squares_.push_back({std::floor(flat_(0, i) / spacing_), std::floor(flat_(1, i) / spacing_), i});
      }
    }
    std::sort(squares_.begin(), squares_.end(), [&](const Square& a, const Square& b) {
      const auto height = [&](const Square& s) { return bulk_[static_cast<std::size_t>(s.highest)].z(); };
      return std::tuple(a.x, a.y, -height(a), a.highest) < std::tuple(b.x, b.y, -height(b), b.highest);
    });
    surface_.clear();
    for (std::size_t k = 0; k < squares_.size(); ++k) {
      if (k == 0 || squares_[k].x != squares_[k - 1].x || squares_[k].y != squares_[k - 1].y) {
        surface_.push_back(squares_[k].highest);
      }
    }
    return surface_;
  }

  Column column_at(Index i) const {
    const Vector3<double>& own = bulk_[static_cast<std::size_t>(i)];
    double high = own.z(), low = own.z();
    flat_grid_.for_each(i, [&](Index j, double) {
      high = std::max(high, bulk_[static_cast<std::size_t>(j)].z());
      low = std::min(low, bulk_[static_cast<std::size_t>(j)].z());
    });
    Column column;
    column.place = own.template head<2>();
    column.center = column.place;
    column.height = high + 0.5 * spacing_;
    const double slab_top = high - slab_below_top * spacing_;
    // off the floor, where the lowest particle says little about how far liquid reaches
    const double slab_bottom = std::max(low + 0.5 * spacing_, slab_top - slab_depth * spacing_);
    if (slab_top - slab_bottom < 2 * spacing_) {
      return column;
    }
    double above = 0, in_slab = 0;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    const auto add = [&](const Vector3<double>& x, double distance_squared) {
      const double left = 1 - distance_squared / (column_radius * column_radius * spacing_ * spacing_);
      const double weight = left * left;
      // a particle on the border between slab and rest belongs to both by halves
      const double over = std::clamp((x.z() - slab_top) / spacing_ + 0.5, 0.0, 1.0);
      const double under = std::clamp((slab_bottom - x.z()) / spacing_ + 0.5, 0.0, 1.0);
      above += weight * over;
      in_slab += weight * (1 - over - under);
      sum += weight * (1 - under) * x.template head<2>();
    };
    add(own, 0);
    flat_grid_.for_each(
        i, [&](Index j, double distance_squared) { add(bulk_[static_cast<std::size_t>(j)], distance_squared); });
    if (in_slab > 0) {
      column.center = sum / (above + in_slab);
      column.height = slab_top + above / in_slab * (slab_top - slab_bottom);
    }
    return column;
  }

  double reach() const { return 2 * spacing_; }
  Index count() const { return fluid_ == nullptr ? 0 : fluid_->size(); }
  Vector3<double> position(Index i) const { return fluid_->position.col(i).template cast<double>(); }

  // Whether a particle at that offset hides one from above: within 35 degrees of the vertical.
  static bool covers(const Vector3<double>& apart) { return apart.z() > 1.43 * apart.template head<2>().norm(); }

  double surface_over(double x, double y, const std::vector<Vector3<double>>& column) const {
    Plane plane;
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (auto p = column.begin(); p != column.end(); ++p) {
      // sorted by height: only what follows can cover it
      const bool covered = std::any_of(p + 1, column.end(), [&](const Vector3<double>& other) {
        const Vector3<double> apart = other - *p;
        return apart.z() < reach() && covers(apart);
      });
      if (covered) {
        continue;
      }
      const Vector3<double> apart((p->x() - x) / spacing_, (p->y() - y) / spacing_, p->z() / spacing_);
      plane.add(apart, std::max(1e-6, 1 - apart.template head<2>().squaredNorm() / 4));
      low = std::min(low, p->z());
      high = std::max(high, p->z());
    }
    return std::clamp(spacing_ * plane.solve()[0], low, high) + 0.5 * spacing_;
  }

  // Numbers the connected pieces: piece_[i] is the lowest index in i's piece.
  void find_pieces() {
    if (pieces_known_) {
      return;
    }
    piece_.resize(static_cast<std::size_t>(count()));
    std::iota(piece_.begin(), piece_.end(), 0U);
    const auto root = [&](std::uint32_t i) {
      while (piece_[i] != i) {
        piece_[i] = piece_[piece_[i]];
        i = piece_[i];
      }
      return i;
    };
    for (Index i = 0; i < count(); ++i) {
      grid_.for_each(i, [&](Index j, Scalar) {
        if (j < i) {
          const std::uint32_t a = root(static_cast<std::uint32_t>(i)), b = root(static_cast<std::uint32_t>(j));
          piece_[std::max(a, b)] = std::min(a, b);
        }
      });
    }
    for (Index i = 0; i < count(); ++i) {
      piece_[static_cast<std::size_t>(i)] = root(static_cast<std::uint32_t>(i));
      if (!position(i).allFinite()) {
        piece_[static_cast<std::size_t>(i)] = none;
      }
    }
    pieces_known_ = true;
  }

  // The piece that has the most particles for which `counts`.
  template <class Counts>
  std::uint32_t largest_piece(Counts&& counts) {
    size_.assign(piece_.size(), 0);
    std::uint32_t largest = none;
    for (Index i = 0; i < count(); ++i) {
      const std::uint32_t piece = piece_[static_cast<std::size_t>(i)];
      if (piece != none && counts(i)) {
        ++size_[piece];
        largest = largest == none || size_[piece] > size_[largest] ? piece : largest;
      }
    }
    // `none` marks particles too, so without any piece the answer must match nothing
    return largest == none ? none - 1 : largest;
  }

  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();

  double spacing_;
  const FluidState<Scalar>* fluid_ = nullptr;
  CellGrid<Scalar> grid_{};
  bool pieces_known_ = false;
  std::vector<std::uint32_t> piece_, size_;
  std::vector<Vector3<double>> in_body_, bulk_;
  std::vector<Square> squares_;
  std::vector<Index> surface_;
  std::vector<Column> columns_;
  PointArray<double> flat_, centers_;
  CellGrid<double> flat_grid_{};
};

}  // namespace decant::inline DECANT_TARGET
