// SPDX-License-Identifier: MIT
#pragma once

/// Many rays of one length from one point: what each of them meets first, found for all of them at once.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/detail/segment_triangle.hpp>
#include <decant/core/batch.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// `Count` directions, a multiple of 8, that are asked for together again and again. first_hits answers what
/// BoundingVolumeHierarchy::first_hit does for each ray, several times as fast where rays are short: the triangles
/// within reach are gone through once, and each is held against the rays in bundles of eight neighbours.
///
/// The hits are those of first_hit, to rounding: a ray that passes an edge, a corner or a triangle's plane within the
/// bounds of rounding is left to the very test that first_hit takes, so that no ray slips through here that does not
/// there. Of two triangles at the same distance (a ray exactly through a shared edge) either may be named, by either.
///
/// Immutable after construction; questions are const, noexcept, allocate nothing and may come from any thread.
template <std::size_t Count>
class RayFan {
  static_assert(Count > 0 && Count % 8 == 0, "RayFan: the number of directions must be a multiple of 8");

 public:
  /// @param directions unit length, in any order. The fan puts neighbours side by side: see direction().
  explicit RayFan(const std::array<Vector3<double>, Count>& directions) : direction_(directions) {
    group(0, Count);
    for (std::size_t bundle = 0; bundle < bundle_count; ++bundle) {
      set_cone(bundle);
    }
  }

  /// Direction of ray k, in the fan's order.
  const Vector3<double>& direction(std::size_t k) const noexcept { return direction_[k]; }

  /// Calls f(k, hit) for each ray k that meets the surface within `length` [m] of the origin, in the order of k. `hit`
  /// is a BoundingVolumeHierarchy::Hit whose fraction counts to the ray's end; f must not throw.
  template <class Function>
  void first_hits(const BoundingVolumeHierarchy& surface, const Vector3<double>& origin, double length,
                  Function&& f) const noexcept {
    const Eigen::AlignedBox3d& bounds = surface.bounds();
    const double radius = bounds.sizes().maxCoeff() / 2;
    // Rays that first_hit would cut to the mesh's size for the sake of rounding are asked for one by one, as are those
    // so far from zero for their length that directions round by as much as `margin`, and NaN and infinity.
    const bool close = (origin - bounds.center()).cwiseAbs().maxCoeff() + length < 3 * radius;
    if (!close || !(length > 1e-6 * origin.cwiseAbs().maxCoeff())) {
      for (std::size_t k = 0; k < Count; ++k) {
        if (const auto hit = surface.first_hit_along(origin, direction_[k], length)) {
          f(k, *hit);
        }
      }
      return;
    }
    State state(origin, length, direction_);
    surface.for_each_triangle_near(origin, length * (1 + margin),
                                   [&](const detail::TreeTriangle& triangle) { meet(triangle, state); });
    const detail::TreeTriangle* last = nullptr;
    BoundingVolumeHierarchy::Hit hit{0, origin, origin, 0};
    for (std::size_t k = 0; k < Count; ++k) {
      if (state.triangle[k] == nullptr) {
        continue;
      }
      if (state.triangle[k] != last) {  // rays side by side often meet the same one
        last = state.triangle[k];
        hit.normal = last->unit_normal();
        hit.triangle = last->index;
      }
      hit.fraction = state.fraction[k];
      hit.point = origin + hit.fraction * length * direction_[k];
      f(k, hit);
    }
  }

 private:
  using Number = Batch<double>;
  static constexpr std::size_t width = static_cast<std::size_t>(Number::width);
  static constexpr std::size_t bundle_size = 8;
  static_assert(bundle_size % width == 0);
  static constexpr std::size_t bundle_count = Count / bundle_size;
  static constexpr std::size_t padded_count = (bundle_count + width - 1) / width * width;

  // Far above rounding, far below anything that costs time: for tests that may only err toward looking closer.
  static constexpr double margin = 1e-9;

  // What the rays have met so far.
  struct State {
    State(const Vector3<double>& from, double reach, const std::array<Vector3<double>, Count>& direction) noexcept
        : origin(from), length(reach) {
      for (std::size_t k = 0; k < Count; ++k) {
        // rounded exactly as first_hit does: neighbours of an edge have to be asked about one and the same ray
        const Vector3<double> target = origin + length * direction[k];
        for (std::size_t axis = 0; axis < 3; ++axis) {
          ray[axis][k] = target[static_cast<Index>(axis)] - origin[static_cast<Index>(axis)];
        }
      }
      fraction.fill(2);
      triangle.fill(nullptr);
      std::fill_n(farthest.begin(), bundle_count, 2.0);
      std::fill(farthest.begin() + bundle_count, farthest.end(), -1.0);  // bundles that do not exist: never open
    }

    const Vector3<double> origin;
    const double length;
    std::array<std::array<double, Count>, 3> ray;  // from origin to target
    std::array<double, Count> fraction;
    std::array<const detail::TreeTriangle*, Count> triangle;
    std::array<double, padded_count> farthest;  // of each bundle's fractions
  };

  // Halves a range across its longest extent until eight are left.
  void group(std::size_t begin, std::size_t end) {
    if (end - begin <= bundle_size) {
      return;
    }
    Eigen::AlignedBox3d box;
    for (std::size_t k = begin; k < end; ++k) {
      box.extend(direction_[k]);
    }
    Index axis = 0;
    box.sizes().maxCoeff(&axis);
    const std::size_t middle = begin + (end - begin) / bundle_size / 2 * bundle_size;
    const auto first = direction_.begin();
    std::stable_sort(first + static_cast<std::ptrdiff_t>(begin), first + static_cast<std::ptrdiff_t>(end),
                     [axis](const Vector3<double>& a, const Vector3<double>& b) { return a[axis] < b[axis]; });
    group(begin, middle);
    group(middle, end);
  }

  // The cone about a bundle; where there is none that is narrower than a half-space, one that everything overlaps.
  void set_cone(std::size_t bundle) {
    Vector3<double> axis = Vector3<double>::Zero();
    for (std::size_t lane = 0; lane < bundle_size; ++lane) {
      axis += direction_[bundle * bundle_size + lane];
    }
    axis.normalize();
    double cosine = 1;
    for (std::size_t lane = 0; lane < bundle_size; ++lane) {
      cosine = std::min(cosine, axis.dot(direction_[bundle * bundle_size + lane]) - 1e-7);
    }
    if (!(cosine > 0)) {
      axis.setZero();
      cosine = 0;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      axis_[k][bundle] = axis[static_cast<Index>(k)];
    }
    cosine_[bundle] = cosine;
    sine_[bundle] = std::sqrt(1 - cosine * cosine);
  }

  // One triangle, as far as all rays share it. Volumes are those of detail::cross with the ray taken out as a factor,
  // u = d.(b x c) and so on; their sum is d.normal. All are turned so that a ray that crosses has positive ones.
  struct Prepared {
    std::array<Vector3<double>, 3> edge;  // b x c, c x a, a x b
    Vector3<double> normal;               // length: twice the area
    double height;                        // of the origin over the plane, times that length
    double edge_error, height_error;      // from where on a sign is certain, here and in detail::cross
    bool off_plane;                       // where the origin is in the plane, either turn may be the right one
  };

  void meet(const detail::TreeTriangle& triangle, State& state) const noexcept {
    const double length = state.length;
    const Vector3<double> a = triangle.a - state.origin;
    const Vector3<double> b = triangle.b - state.origin;
    const Vector3<double> c = triangle.c - state.origin;
    // at least that of detail::cross for each ray, so that the bounds of rounding are at least those there
    const double size = std::max({a.cwiseAbs().maxCoeff(), b.cwiseAbs().maxCoeff(), c.cwiseAbs().maxCoeff()}) + length;
    // a ball about the triangle, hence a cone in which it is seen
    const Vector3<double> middle = (a + b + c) * (1.0 / 3);
    const double ball =
        std::sqrt(std::max({(a - middle).squaredNorm(), (b - middle).squaredNorm(), (c - middle).squaredNorm()})) +
        margin * size;
    const double away_squared = middle.squaredNorm();
    const double away = std::sqrt(away_squared);
    const double nearest = std::max(away - ball, 0.0) / length;  // as a fraction of the ray
    if (nearest > 1) {
      return;
    }
    Prepared p;
    // Beyond four times the bound a sum here and the one in detail::cross have one sign beyond the bound. 16 for the
    // height: then a ray that is parallel to the plane, as far as can be told, is certain to stay off it.
    const double bound = detail::volume_rounding * size * size;
    p.edge_error = 4 * bound * length;
    p.height_error = 16 * bound * size;
    p.normal = (b - a).cross(c - a);
    p.height = -p.normal.dot(a);
    const double turn = p.height < 0 ? 1 : -1;
    p.height = std::abs(p.height);
    p.normal *= turn;
    p.off_plane = p.height > p.height_error;
    const double clear = p.height - p.height_error;
    const double longest_squared = p.normal.squaredNorm() * length * length * (1 + margin);
    if (clear > 0 && clear * clear > longest_squared) {
      return;  // the whole plane is out of reach
    }
    p.edge = {turn * b.cross(c), turn * c.cross(a), turn * a.cross(b)};

    // Which bundles may meet it: those whose cone overlaps the one about the ball, reaches beyond the plane, and to the
    // inner side of each edge's plane. cos(angle to a bundle) >= cos(half angle of the one cone + that of the other),
    // times the length of the vector that the angle is taken with.
    const bool around = !(away > ball);
    const double tangent = around ? 0 : std::sqrt(away_squared - ball * ball);
    const double slack = around ? 2 * away : margin * size;
    std::array<double, 3> edge_length;
    for (std::size_t k = 0; k < 3; ++k) {
      edge_length[k] = p.edge[k].norm();
    }
    // of the cone in which the plane is in reach; a little wider than that
    const double within_plane = std::sqrt(std::max(longest_squared - clear * clear, 0.0)) / length;
    for (std::size_t first = 0; first < bundle_count; first += width) {
      const Number cosine = Number::load(&cosine_[first]);
      const Number sine = Number::load(&sine_[first]);
      const auto along = [&](const Vector3<double>& v) __attribute__((always_inline)) {
        return multiply_add(
            Number::load(&axis_[0][first]), Number(v[0]),
            multiply_add(Number::load(&axis_[1][first]), Number(v[1]), Number::load(&axis_[2][first]) * Number(v[2])));
      };
      auto open = (along(middle) >= Number(tangent) * cosine - Number(ball) * sine - Number(slack)) &
                  (Number::load(&state.farthest[first]) >= Number(nearest));
      if (p.off_plane) {
        open = open & (along(p.normal) >= Number(clear / length) * cosine - Number(within_plane) * sine);
        for (std::size_t k = 0; k < 3; ++k) {
          open = open & (along(p.edge[k]) >=
                         -Number(edge_length[k]) * (sine + Number(margin)) - Number(p.edge_error / length));
        }
      }
      for (std::uint32_t bits = open.bits(); bits != 0; bits &= bits - 1) {
        meet_bundle(triangle, p, first + static_cast<std::size_t>(std::countr_zero(bits)), state);
      }
    }
  }

  void meet_bundle(const detail::TreeTriangle& triangle, const Prepared& p, std::size_t bundle,
                   State& state) const noexcept {
    const Number edge_error(p.edge_error), height_error(p.height_error), height(p.height);
    bool changed = false;
    for (std::size_t k = bundle * bundle_size; k < (bundle + 1) * bundle_size; k += width) {
      const Number x = Number::load(&state.ray[0][k]);
      const Number y = Number::load(&state.ray[1][k]);
      const Number z = Number::load(&state.ray[2][k]);
      const auto along = [&](const Vector3<double>& v) __attribute__((always_inline)) {
        return multiply_add(x, Number(v[0]), multiply_add(y, Number(v[1]), z * Number(v[2])));
      };
      const Number u = along(p.edge[0]);
      const Number v = along(p.edge[1]);
      const Number w = along(p.edge[2]);
      const Number least = minimum(u, minimum(v, w));
      auto undecided = least >= -edge_error;
      if (p.off_plane) {
        if (!any(undecided)) {
          continue;
        }
        const Number rate = along(p.normal);
        const Number below = rate - height;  // the ray's end under the plane
        const auto crossed = (least > edge_error) & (below > height_error);
        undecided = undecided & (below >= -height_error) & !crossed;
        const Number best = Number::load(&state.fraction[k]);
        const Number fraction = height / rate;
        const auto better = crossed & (fraction < best);
        if (any(better)) {
          select(better, fraction, best).store(&state.fraction[k]);
          for (std::uint32_t bits = better.bits(); bits != 0; bits &= bits - 1) {
            state.triangle[k + static_cast<std::size_t>(std::countr_zero(bits))] = &triangle;
          }
          changed = true;
        }
      } else {
        undecided = undecided | (maximum(u, maximum(v, w)) <= edge_error);
      }
      for (std::uint32_t bits = undecided.bits(); bits != 0; bits &= bits - 1) {
        const std::size_t ray = k + static_cast<std::size_t>(std::countr_zero(bits));
        const detail::TriangleCrossing crossing =
            detail::cross(triangle, state.origin, state.origin + state.length * direction_[ray]);
        if (crossing.hit && crossing.fraction < state.fraction[ray]) {
          state.fraction[ray] = crossing.fraction;
          state.triangle[ray] = &triangle;
          changed = true;
        }
      }
    }
    if (changed) {
      state.farthest[bundle] =
          *std::max_element(&state.fraction[bundle * bundle_size], &state.fraction[bundle * bundle_size] + bundle_size);
    }
  }

  std::array<Vector3<double>, Count> direction_;
  // of the cones about the bundles
  std::array<std::array<double, padded_count>, 3> axis_{};
  std::array<double, padded_count> cosine_{}, sine_{};
};

}  // namespace decant::inline DECANT_TARGET
