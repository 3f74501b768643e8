// SPDX-License-Identifier: MIT
#pragma once

/// Wall integrals of a triangle mesh from boundary particles on its surface.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/wall_sample.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// After Akinci, Ihmsen, Akinci, Solenthaler and Teschner 2012, "Versatile rigid-fluid coupling for incompressible SPH"
/// (ACM TOG 31): the surface is covered with boundary particles b, and with volumes V_b = 1 / sum_c W(x_b - x_c), which
/// even out a coverage that is not uniform,
///   fraction = sum_b V_b W(x - x_b),     gradient = sum_b V_b grad W(x - x_b).
/// One layer stands for the wall whatever its thickness. What differs from MeshWall: the fraction is that of a layer,
/// not of the space behind it, so it falls off again behind the surface, a thin wall is felt from both sides (with the
/// gradient towards the surface on either), and corners and flat parts differ by the unevenness of the cover, some 6
/// per cent; and liquid begins half a spacing off the surface, so that a vessel is narrower by as much. Memory grows
/// with the area only. Kept for comparison with other codes; MeshWall is more accurate.
/// Immutable after construction; refers to the hierarchy, which it does not own.
class SampledWall {
 public:
  /// Least distance of two boundary particles over the particle spacing.
  static constexpr double sample_distance = 0.7;

  /// Covers the surface. Deterministic: the same mesh gives the same particles, whatever the number of threads.
  /// @param smoothing_length [m] > 0. @param spacing of the liquid's particles [m], > 0.
  template <class Kernel>
  static SampledWall of(const BoundingVolumeHierarchy& surface, double smoothing_length, double spacing, Threads) {
    expects(std::isfinite(spacing) && spacing > 0, "SampledWall: particle spacing [m]", "> 0 and finite", spacing);
    expects(std::isfinite(smoothing_length) && smoothing_length > 0, "SampledWall: smoothing length [m]",
            "> 0 and finite", smoothing_length);
    SampledWall wall;
    wall.surface_ = &surface;
    wall.support_ = static_cast<double>(Kernel::support_factor) * smoothing_length;
    wall.tabulate<Kernel>(smoothing_length);
    wall.cover(sample_distance * spacing);
    wall.weigh();
    return wall;
  }

  /// Distance from which the wall is not felt [m].
  double reach() const noexcept { return support_; }

  /// Number of boundary particles.
  std::size_t size() const noexcept { return places_.size(); }
  /// Places of the boundary particles, in the body's frame [m].
  const std::vector<Vector3<double>>& places() const noexcept { return places_; }

  /// False where no wall is within the support of x (in the body's frame).
  bool sample(const Vector3<double>& x, WallSample& result) const noexcept {
    double fraction = 0;
    Vector3<double> gradient = Vector3<double>::Zero();
    for_each_near(x, [&](std::size_t b, const Vector3<double>& apart, double r_squared) {
      const double r = std::sqrt(r_squared);
      fraction += volume_[b] * look_up(value_, r);
      gradient += volume_[b] * look_up(slope_, r) * apart;
    });
    if (!(fraction > 0)) {
      return false;
    }
    const auto nearest = surface_->closest_point(x, support_);
    result.share = fraction;
    result.gradient = gradient;
    result.distance = nearest ? nearest->distance : support_;
    const double steepness = gradient.norm();
    result.moment.setZero();
    if (steepness > 0) {  // as if all of it were one plane
      result.moment = result.distance / steepness * gradient * gradient.transpose();
    }
    return true;
  }

 private:
  static constexpr std::size_t table_entries = 512;

  using Cell = std::array<std::int64_t, 3>;

  /// Kernel and (dW/dr)/r over the support: the wall's type does not know the kernel.
  template <class Kernel>
  void tabulate(double smoothing_length) {
    using KernelScalar = typename Kernel::Scalar;
    value_.resize(table_entries + 1);
    slope_.resize(table_entries + 1);
    for (std::size_t k = 0; k <= table_entries; ++k) {
      const auto r = static_cast<KernelScalar>(support_ * static_cast<double>(k) / table_entries);
      const auto h = static_cast<KernelScalar>(smoothing_length);
      value_[k] = static_cast<double>(Kernel::value(r, h));
      slope_[k] = static_cast<double>(Kernel::derivative_over_radius(r, h));
    }
  }

  double look_up(const std::vector<double>& table, double r) const noexcept {
    const double place = r / support_ * static_cast<double>(table_entries);
    const auto k = std::min(static_cast<std::size_t>(place), table_entries - 1);
    return table[k] + (place - static_cast<double>(k)) * (table[k + 1] - table[k]);
  }

  /// A candidate on the surface and the order in which it gets its turn.
  struct Candidate {
    std::uint64_t turn;
    Vector3<double> place;
  };

  /// Throws darts: candidates, evenly spread over each triangle, take their turns in a shuffled order and stay if no
  /// other that stayed is nearer than `least`. With some 20 candidates per disc of that size hardly a gap is left.
  void cover(double least) {
    std::vector<Candidate> candidates;
    std::uint64_t number = 0;
    double owed = 0;  // fractions of a candidate add up from triangle to triangle, so small triangles get their share
    surface_->for_each_triangle([&](const Vector3<double>& a, const Vector3<double>& b, const Vector3<double>& c) {
      const double area = 0.5 * (b - a).cross(c - a).norm();
      owed += candidates_per_square * area / (least * least);
      expects(owed < 1e8, "SampledWall: area of a triangle over the spacing squared", "below 4e6",
              area / (least * least));
      for (; owed >= 1; owed -= 1, ++number) {
        // the R2 sequence (Roberts 2018), folded onto the triangle
        double u = fraction_of(0.5 + 0.7548776662466927 * static_cast<double>(number));
        double v = fraction_of(0.5 + 0.5698402909980532 * static_cast<double>(number));
        if (u + v > 1) {
          u = 1 - u;
          v = 1 - v;
        }
        candidates.push_back({shuffled(number), a + u * (b - a) + v * (c - a)});
      }
    });
    if (candidates.empty()) {
      surface_->for_each_triangle([&](const Vector3<double>& a, const Vector3<double>&, const Vector3<double>&) {
        if (candidates.empty()) {
          candidates.push_back({0, a});  // a surface much smaller than a particle
        }
      });
    }
    std::sort(candidates.begin(), candidates.end(),
              [](const Candidate& a, const Candidate& b) { return a.turn < b.turn; });
    // Cells of the least distance's size: a dart has to look at 27 of them.
    std::vector<std::vector<std::uint32_t>> buckets(bucket_count(candidates.size()));
    const auto bucket = [&](const Cell& cell) { return hash(cell) & (buckets.size() - 1); };
    for (const Candidate& candidate : candidates) {
      const Cell cell = cell_of(candidate.place, least);
      bool is_free = true;
      for_each_around(cell, [&](const Cell& near) {
        for (const std::uint32_t b : buckets[bucket(near)]) {
          is_free = is_free && (places_[b] - candidate.place).squaredNorm() >= least * least;
        }
      });
      if (is_free) {
        buckets[bucket(cell)].push_back(static_cast<std::uint32_t>(places_.size()));
        places_.push_back(candidate.place);
      }
    }
    sort_into_cells();
  }

  /// Orders the particles by hashed cell, so that those of one are side by side.
  void sort_into_cells() {
    const std::size_t buckets = bucket_count(places_.size());
    std::vector<std::pair<std::size_t, std::size_t>> order(places_.size());
    for (std::size_t b = 0; b < places_.size(); ++b) {
      order[b] = {hash(cell_of(places_[b], support_)) & (buckets - 1), b};
    }
    std::sort(order.begin(), order.end());
    std::vector<Vector3<double>> sorted(places_.size());
    first_.assign(buckets + 1, 0);
    for (std::size_t k = 0; k < order.size(); ++k) {
      sorted[k] = places_[order[k].second];
      ++first_[order[k].first + 1];
    }
    for (std::size_t k = 0; k < buckets; ++k) {
      first_[k + 1] += first_[k];
    }
    places_.swap(sorted);
  }

  void weigh() {
    volume_.assign(places_.size(), 0.0);
    for (std::size_t b = 0; b < places_.size(); ++b) {
      double sum = 0;
      for_each_near(places_[b], [&](std::size_t, const Vector3<double>&, double r_squared) {
        sum += look_up(value_, std::sqrt(r_squared));
      });
      volume_[b] = 1 / sum;  // at least W(0)
    }
  }

  /// Calls f(b, x - x_b, r^2) for each boundary particle within the support of x, once.
  template <class Function>
  void for_each_near(const Vector3<double>& x, Function&& f) const noexcept {
    const std::size_t mask = first_.size() - 2;
    std::array<std::size_t, 27> seen{};
    std::size_t count = 0;
    if (!x.allFinite() || x.cwiseAbs().maxCoeff() > 1e9 * support_) {
      return;
    }
    for_each_around(cell_of(x, support_), [&](const Cell& near) {
      const std::size_t bucket = hash(near) & mask;
      if (std::find(seen.begin(), seen.begin() + static_cast<std::ptrdiff_t>(count), bucket) !=
          seen.begin() + static_cast<std::ptrdiff_t>(count)) {
        return;  // two cells may share a bucket
      }
      seen[count++] = bucket;
      for (std::size_t b = first_[bucket]; b < first_[bucket + 1]; ++b) {
        const Vector3<double> apart = x - places_[b];
        const double r_squared = apart.squaredNorm();
        if (r_squared < support_ * support_) {
          f(b, apart, r_squared);
        }
      }
    });
  }

  template <class Function>
  static void for_each_around(const Cell& cell, Function&& f) {
    for (std::int64_t i = -1; i <= 1; ++i) {
      for (std::int64_t j = -1; j <= 1; ++j) {
        for (std::int64_t k = -1; k <= 1; ++k) {
          f(Cell{cell[0] + i, cell[1] + j, cell[2] + k});
        }
      }
    }
  }

  static Cell cell_of(const Vector3<double>& x, double size) noexcept {
    return {static_cast<std::int64_t>(std::floor(x[0] / size)), static_cast<std::int64_t>(std::floor(x[1] / size)),
            static_cast<std::int64_t>(std::floor(x[2] / size))};
  }

  static std::size_t bucket_count(std::size_t entries) noexcept {
    std::size_t count = 1;
    while (count < entries) {
      count *= 2;
    }
    return count;
  }

  /// The finalizer of SplitMix64 (Steele, Lea and Flood 2014): a bijection that scatters.
  static std::uint64_t shuffled(std::uint64_t x) noexcept {
    x += 0x9e3779b97f4a7c15ull;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
    return x ^ (x >> 31);
  }

  static std::size_t hash(const Cell& cell) noexcept {
    std::uint64_t mixed = 0;
    for (const std::int64_t k : cell) {
      mixed = shuffled(mixed ^ static_cast<std::uint64_t>(k));
    }
    return static_cast<std::size_t>(mixed);
  }

  static double fraction_of(double x) noexcept { return x - std::floor(x); }

  static constexpr double candidates_per_square = 25;

  const BoundingVolumeHierarchy* surface_ = nullptr;
  double support_ = 0;
  std::vector<double> value_{}, slope_{};
  std::vector<Vector3<double>> places_{};
  std::vector<double> volume_{};
  std::vector<std::size_t> first_{};  ///< of each bucket, and the end
};

}  // namespace decant::inline DECANT_TARGET
