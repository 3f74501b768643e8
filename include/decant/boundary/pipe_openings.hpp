// SPDX-License-Identifier: MIT
#pragma once

/// Where the inside of a pipe-like body meets the open air: straight pipes, elbows, junctions, manifolds, and cups,
/// which are pipes with one end.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/pipe_section.hpp>
#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// An end of a pipe.
struct PipeOpening {
  /// The outermost cut across the pipe that has wall all round, `direction` out of the pipe. Area and outline are those
  /// a tenth of a radius farther in, where a rim's rounding is over, moved out along the pipe.
  PipeSection rim{};
  std::size_t passage = 0;  ///< openings of equal number are joined inside; 0 has most room in it
};

namespace detail {

/// The space about a body in cubes, and how much of the sky is seen from each.
class OpenSky {
 public:
  /// At most about so many cubes.
  static constexpr double most_cubes = 8e5;

  explicit OpenSky(const BoundingVolumeHierarchy& surface) : surface_(&surface) {
    lay_out();
    mark_walls();
    look_up();
  }

  double width() const noexcept { return width_; }
  std::size_t size() const noexcept { return free_.size(); }
  /// Neither wall nor so open that more than a third of all directions lead out.
  bool enclosed(std::size_t cube) const noexcept { return free_[cube] != 0 && 3 * seen_[cube] < all_seen; }
  bool open(std::size_t cube) const noexcept { return free_[cube] != 0 && 3 * seen_[cube] >= all_seen; }
  std::array<int, 3> place(std::size_t cube) const noexcept {
    const auto nx = static_cast<std::size_t>(count_[0]), ny = static_cast<std::size_t>(count_[1]);
    return {static_cast<int>(cube % nx), static_cast<int>(cube / nx % ny), static_cast<int>(cube / nx / ny)};
  }
  std::ptrdiff_t step(int x, int y, int z) const noexcept {
    return x + static_cast<std::ptrdiff_t>(count_[0]) * (y + static_cast<std::ptrdiff_t>(count_[1]) * z);
  }
  /// Middle of a cube in the frame of the mesh [m].
  Vector3<double> middle(std::size_t cube) const noexcept {
    const std::array<int, 3> at = place(cube);
    return origin_ + width_ * (axes_ * Vector3<double>(at[0], at[1], at[2]));
  }
  /// From the cubes' frame.
  Vector3<double> turned(const Vector3<double>& v) const noexcept { return axes_ * v; }

 private:
  static constexpr std::uint32_t all_seen = 60000;  ///< about; fits 16 bits
  static constexpr int margin =
      2;  ///< cubes of open air on each side, as far as a step goes: all others have neighbours

  /// Along the body's own axes, so that it makes no difference how it is turned, and slim bodies get small cubes.
  void lay_out() {
    double total = 0;
    Vector3<double> mean = Vector3<double>::Zero();
    Matrix3<double> moment = Matrix3<double>::Zero();
    surface_->for_each_triangle([&](const Vector3<double>& a, const Vector3<double>& b, const Vector3<double>& c) {
      const double area = (b - a).cross(c - a).norm();
      const Vector3<double> middle = (a + b + c) / 3 - surface_->bounds().center();
      total += area;
      mean += area * middle;
      moment += area * middle * middle.transpose();
    });
    moment -= mean * mean.transpose() / total;
    const Eigen::SelfAdjointEigenSolver<Matrix3<double>> solver(moment / total);
    axes_ = solver.eigenvectors();
    if (!axes_.allFinite()) {
      axes_.setIdentity();
    }
    Eigen::AlignedBox3d box;
    surface_->for_each_triangle([&](const Vector3<double>& a, const Vector3<double>& b, const Vector3<double>& c) {
      for (const Vector3<double>* x : {&a, &b, &c}) {
        box.extend(Vector3<double>(axes_.transpose() * *x));
      }
    });
    const Vector3<double> size = box.sizes();
    width_ = std::max(std::cbrt(size.prod() / most_cubes), size.maxCoeff() / 1000);
    const auto cubes = [&] { return (size.array() / width_ + 1 + 2 * margin).prod(); };
    while (cubes() > most_cubes) {
      width_ *= 1.02;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      count_[axis] = static_cast<int>(std::ceil(size[static_cast<Index>(axis)] / width_)) + 1 + 2 * margin;
    }
    const Vector3<double> extent(count_[0] - 1, count_[1] - 1, count_[2] - 1);
    origin_ = axes_ * (box.center() - 0.5 * width_ * extent);
    free_.assign(
        static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]) * static_cast<std::size_t>(count_[2]),
        1);
  }

  /// A cube is wall if its circumscribed ball meets the surface. Between two that are not and touch, even at a corner
  /// only, no surface passes.
  void mark_walls() {
    constexpr int block = 16;
    for (int z = 0; z < count_[2]; z += block) {
      for (int y = 0; y < count_[1]; y += block) {
        for (int x = 0; x < count_[0]; x += block) {
          mark_walls({x, y, z}, block);
        }
      }
    }
  }
  void mark_walls(const std::array<int, 3>& low, int side) {
    if (low[0] >= count_[0] || low[1] >= count_[1] || low[2] >= count_[2]) {
      return;
    }
    const Vector3<double> middle = Vector3<double>(low[0], low[1], low[2]).array() + 0.5 * (side - 1);
    if (!surface_->closest_point(origin_ + width_ * (axes_ * middle), 0.5 * std::sqrt(3.0) * side * width_)) {
      return;
    }
    if (side == 1) {
      free_[static_cast<std::size_t>(step(low[0], low[1], low[2]))] = 0;
      return;
    }
    const int half = side / 2;
    for (int k = 0; k < 8; ++k) {
      mark_walls({low[0] + half * (k & 1), low[1] + half * ((k >> 1) & 1), low[2] + half * (k >> 2)}, half);
    }
  }

  /// All steps between cubes of at most two along each axis, none a multiple of another, with the share of all
  /// directions that is nearest to each.
  static std::vector<std::pair<std::array<int, 3>, std::uint16_t>> directions() {
    std::vector<std::pair<std::array<int, 3>, std::uint16_t>> result;
    for (int z = -2; z <= 2; ++z) {
      for (int y = -2; y <= 2; ++y) {
        for (int x = -2; x <= 2; ++x) {
          if (std::gcd(std::gcd(x, y), z) == 1) {
            result.push_back({{x, y, z}, 0});
          }
        }
      }
    }
    // points spread evenly over the sphere on a spiral
    constexpr int points = 6000;
    std::vector<int> nearest(result.size(), 0);
    for (int k = 0; k < points; ++k) {
      const double height = 1 - (2 * k + 1.0) / points;
      const double turn = std::numbers::pi * (1 + std::sqrt(5.0)) * k, wide = std::sqrt(1 - height * height);
      const Vector3<double> point(wide * std::cos(turn), wide * std::sin(turn), height);
      std::size_t best = 0;
      double largest = -2;
      for (std::size_t d = 0; d < result.size(); ++d) {
        const auto& [x, y, z] = result[d].first;
        const Vector3<double> direction(x, y, z);
        const double cosine = direction.dot(point) / direction.norm();
        if (cosine > largest) {
          largest = cosine;
          best = d;
        }
      }
      ++nearest[best];
    }
    for (std::size_t d = 0; d < result.size(); ++d) {
      result[d].second = static_cast<std::uint16_t>(static_cast<std::uint32_t>(nearest[d]) * all_seen /
                                                    static_cast<std::uint32_t>(points));
    }
    return result;
  }

  /// Adds up over all directions: a cube sees the sky in a direction if it is free and the next one sees it.
  void look_up() {
    seen_.assign(free_.size(), 0);
    std::vector<std::uint8_t> sees;
    for (const auto& [direction, weight] : directions()) {
      sees.assign(free_.size(), 1);
      look_along(direction, sees);
      std::uint16_t* const __restrict sum = seen_.data();
      const std::uint8_t* const __restrict term = sees.data();
      for (std::size_t cube = 0; cube < seen_.size(); ++cube) {
        sum[cube] = static_cast<std::uint16_t>(sum[cube] + static_cast<std::uint16_t>(weight * term[cube]));
      }
    }
  }

  void look_along(const std::array<int, 3>& d, std::vector<std::uint8_t>& sees) const {
    const int dx = d[0];  // no structured binding: Clang before 16 does not let a lambda capture one
    const int dy = d[1];
    const int dz = d[2];
    const std::ptrdiff_t there = step(dx, dy, dz);
    // What the straight way passes between; one that is free is enough for no surface to be in the way.
    std::vector<std::ptrdiff_t> between;
    for (int z = std::min(dz, 0); z <= std::max(dz, 0); ++z) {
      for (int y = std::min(dy, 0); y <= std::max(dy, 0); ++y) {
        for (int x = std::min(dx, 0); x <= std::max(dx, 0); ++x) {
          const bool first = std::abs(x) <= 1 && std::abs(y) <= 1 && std::abs(z) <= 1;
          const bool second = std::abs(dx - x) <= 1 && std::abs(dy - y) <= 1 && std::abs(dz - z) <= 1;
          if (std::max({std::abs(dx), std::abs(dy), std::abs(dz)}) > 1 && first && second) {
            between.push_back(step(x, y, z));
          }
        }
      }
    }
    const auto loop = [](int begin, int end, bool down, auto&& body) {
      if (down) {
        for (int k = end - 1; k >= begin; --k) {
          body(k);
        }
      } else {
        for (int k = begin; k < end; ++k) {
          body(k);
        }
      }
    };
    const int length = count_[0] - 2 * margin;
    std::vector<std::uint8_t> way(static_cast<std::size_t>(length));
    loop(margin, count_[2] - margin, dz > 0, [&](int z) {
      loop(margin, count_[1] - margin, dy > 0, [&](int y) {
        const std::ptrdiff_t row = step(margin, y, z);
        std::uint8_t* const here = sees.data() + row;
        const std::uint8_t* const is_free = free_.data() + row;
        if (dy == 0 && dz == 0) {
          loop(0, length, dx > 0, [&](int x) { here[x] = is_free[x] & here[x + dx]; });
          return;
        }
        if (between.empty()) {
          std::copy_n(is_free, length, way.data());
        } else {
          std::fill(way.begin(), way.end(), std::uint8_t(0));
          for (const std::ptrdiff_t offset : between) {
            combine(length, is_free + offset, way.data(), [](int a, int b) { return a | b; });
          }
          combine(length, is_free, way.data(), [](int a, int b) { return a & b; });
        }
        combine(length, here + there, way.data(), [](int a, int b) { return a & b; });
        std::copy_n(way.data(), length, here);
      });
    });
  }

  /// b = f(a, b) for rows that do not overlap, which lets the compiler take many at a time.
  template <class Function>
  static void combine(int length, const std::uint8_t* __restrict a, std::uint8_t* __restrict b, Function&& f) noexcept {
    for (int x = 0; x < length; ++x) {
      b[x] = static_cast<std::uint8_t>(f(a[x], b[x]));
    }
  }

  const BoundingVolumeHierarchy* surface_;
  Matrix3<double> axes_ = Matrix3<double>::Identity();
  Vector3<double> origin_ = Vector3<double>::Zero();  // middle of the first cube, frame of the mesh
  double width_ = 0;
  std::array<int, 3> count_{};
  std::vector<std::uint8_t> free_{};   // 1: no wall
  std::vector<std::uint16_t> seen_{};  // of all_seen
};

/// A patch between enclosed space and open air: where about an opening is.
struct AirPatch {
  Vector3<double> center = Vector3<double>::Zero();  // [m]
  Vector3<double> normal = Vector3<double>::Zero();  // outward, its length the area [m^2]
  std::size_t room = 0;                              // number of the enclosed room behind it
};

/// Patches, and how many cubes each room has.
inline std::pair<std::vector<AirPatch>, std::vector<std::size_t>> air_patches(const OpenSky& sky) {
  constexpr std::uint32_t none = 0xFFFFFFFFU;
  const std::array<std::array<int, 3>, 6> sides{{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};
  std::vector<std::uint32_t> room(sky.size(), none);
  std::vector<std::size_t> room_size;
  std::vector<std::size_t> stack, rims;  // rims: enclosed cubes beside open air
  std::vector<std::uint8_t> is_rim(sky.size(), 0);
  for (std::size_t start = 0; start < sky.size(); ++start) {
    if (room[start] != none || !sky.enclosed(start)) {
      continue;
    }
    const auto number = static_cast<std::uint32_t>(room_size.size());
    room_size.push_back(0);
    room[start] = number;
    stack.assign(1, start);
    while (!stack.empty()) {
      const std::size_t cube = stack.back();
      stack.pop_back();
      ++room_size.back();
      for (const auto& [x, y, z] : sides) {
        const auto next = static_cast<std::size_t>(static_cast<std::ptrdiff_t>(cube) + sky.step(x, y, z));
        if (sky.enclosed(next) && room[next] == none) {
          room[next] = number;
          stack.push_back(next);
        } else if (sky.open(next) && is_rim[cube] == 0) {
          is_rim[cube] = 1;
          rims.push_back(cube);
        }
      }
    }
  }
  std::vector<AirPatch> patches;
  for (const std::size_t start : rims) {
    if (is_rim[start] != 1) {
      continue;
    }
    AirPatch patch;
    patch.room = room[start];
    double faces = 0;
    is_rim[start] = 2;
    stack.assign(1, start);
    while (!stack.empty()) {
      const std::size_t cube = stack.back();
      stack.pop_back();
      for (const auto& [x, y, z] : sides) {
        if (sky.open(static_cast<std::size_t>(static_cast<std::ptrdiff_t>(cube) + sky.step(x, y, z)))) {
          patch.normal += Vector3<double>(x, y, z);
          patch.center += sky.middle(cube);
          faces += 1;
        }
      }
      for (int k = 0; k < 27; ++k) {
        const auto next =
            static_cast<std::size_t>(static_cast<std::ptrdiff_t>(cube) + sky.step(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
        if (is_rim[next] == 1 && room[next] == room[cube]) {
          is_rim[next] = 2;
          stack.push_back(next);
        }
      }
    }
    patch.center /= faces;
    patch.normal = sky.width() * sky.width() * sky.turned(patch.normal);
    patches.push_back(patch);
  }
  return {std::move(patches), std::move(room_size)};
}

/// From a section inside of a pipe outward to where the wall ends, at most three radii.
inline PipeSection last_closed(const BoundingVolumeHierarchy& surface, PipeSection section, double reach) {
  const double radius = section.radius();
  const auto outward = [&](double step) -> std::optional<PipeSection> {
    const Vector3<double> across = section.outline.front() - section.center;
    auto next =
        look_across_from_middle(surface, section.center + step * section.direction, section.direction, across, reach);
    // beyond the rim there may be other walls all round, but not close by
    if (!next || !(next->section.area < 2 * section.area)) {
      return std::nullopt;
    }
    return std::move(next->section);
  };
  double step = radius / 8;
  for (double left = 3 * radius; left > 0 && step > 1e-5 * radius;) {
    if (auto next = outward(step)) {
      section = std::move(*next);
      left -= step;
    } else {
      step /= 2;
    }
  }
  return section;
}

/// The opening behind a patch of open air, exactly; nothing if there is no pipe.
inline std::optional<PipeSection> opening_at(const BoundingVolumeHierarchy& surface, const AirPatch& patch,
                                             double width) {
  const double area = patch.normal.norm();
  if (!(area > 2 * width * width)) {
    return std::nullopt;
  }
  const double radius = std::sqrt(area / std::numbers::pi) + width, reach = 4 * radius;
  const Vector3<double> outward = patch.normal / area;
  std::optional<PipeSection> inside;
  for (int k = 0; k < 8 && !inside; ++k) {
    inside = pipe_section(surface, patch.center - 0.15 * k * radius * outward, outward, reach);
  }
  if (!inside || !(inside->direction.dot(outward) > 0.5) || !(inside->radius() < 2.5 * radius)) {
    return std::nullopt;
  }
  PipeSection rim = last_closed(surface, *inside, reach);
  for (int round = 0; round < 3; ++round) {
    // the direction of the walls next to the rim, over some depth because scans are rough
    const double bore = rim.radius();
    const Vector3<double> across = rim.outline.front() - rim.center;
    Matrix3<double> spread = Matrix3<double>::Zero();
    PipeSection innermost = rim;
    for (const double depth : {0.1, 0.2, 0.3, 0.4}) {
      const auto view =
          look_across_from_middle(surface, rim.center - depth * bore * rim.direction, rim.direction, across, reach);
      if (view && view->section.area < 1.3 * rim.area) {
        spread += view->spread;
        innermost = view->section;
      }
    }
    if (spread.isZero()) {
      break;
    }
    innermost.direction = direction_of_walls(spread, rim.direction);
    const bool settled = (innermost.direction - rim.direction).norm() < 1e-5;
    rim = last_closed(surface, innermost, reach);
    if (settled) {
      break;
    }
  }
  const Vector3<double> across = rim.outline.front() - rim.center;
  const double depth = 0.1 * rim.radius();
  if (auto bore = look_across_from_middle(surface, rim.center - depth * rim.direction, rim.direction, across, reach)) {
    const Vector3<double> middle = rim.center;
    rim = std::move(bore->section);
    const Vector3<double> shift = (middle - rim.center).dot(rim.direction) * rim.direction;
    rim.center += shift;
    for (Vector3<double>& point : rim.outline) {
      point += shift;
    }
  }
  rim.distance = 0;
  return rim;
}

/// Which of the rooms behind some patches or openings are dents: dead ends with little room beside the largest.
class Dents {
 public:
  /// @param room_of gives the number of the room behind each. @param room_size cubes of each room.
  Dents(const auto& ways_in, const std::vector<std::size_t>& room_size, auto room_of)
      : room_size_(room_size), ways_(room_size.size(), 0) {
    for (const auto& way : ways_in) {
      largest_ = std::max(largest_, room_size[room_of(way)]);
      ++ways_[room_of(way)];
    }
  }
  bool dead_end(std::size_t room) const { return ways_[room] == 1; }
  bool dent(std::size_t room) const { return dead_end(room) && 20 * room_size_[room] < largest_; }

 private:
  const std::vector<std::size_t>& room_size_;
  std::vector<int> ways_;
  std::size_t largest_ = 0;
};

/// The largest patches, without those of dents: a rough surface has thousands, which would take minutes.
inline std::vector<AirPatch> worth_a_look(std::vector<AirPatch> patches, const std::vector<std::size_t>& room_size) {
  constexpr std::size_t most = 64;
  const Dents dents(patches, room_size, [](const AirPatch& patch) { return patch.room; });
  const auto dent = [&](const AirPatch& patch) { return dents.dent(patch.room); };
  patches.erase(std::remove_if(patches.begin(), patches.end(), dent), patches.end());
  std::stable_sort(patches.begin(), patches.end(),
                   [](const AirPatch& a, const AirPatch& b) { return a.normal.norm() > b.normal.norm(); });
  patches.resize(std::min(patches.size(), most));
  return patches;
}

/// Takes out dead ends that are no pipes. @param room_size cubes of each room, by PipeOpening::passage.
inline void leave_out_dents(const BoundingVolumeHierarchy& surface, const std::vector<std::size_t>& room_size,
                            std::vector<PipeOpening>& openings) {
  const Dents dents(openings, room_size, [](const PipeOpening& opening) { return opening.passage; });
  const auto is_dent = [&](const PipeOpening& opening) {
    if (!dents.dead_end(opening.passage) || dents.dent(opening.passage)) {
      return dents.dent(opening.passage);
    }
    // 0.53 in a corner of three walls, 0.62 in a bowl whose depth is five eighths of its rim's radius
    const auto inside = follow_pipe(surface, opening.rim, 0.3 * opening.rim.radius());
    return !inside || inside->area < 0.6 * opening.rim.area;
  };
  openings.erase(std::remove_if(openings.begin(), openings.end(), is_dent), openings.end());
}

}  // namespace detail

/// Finds the openings of a body. Sorted by where they are in the body's frame, mostly by x, then y, then z.
///
/// How: the space about the body is cut into some 800,000 cubes along the body's own axes; those from which less than a
/// third of all directions leads out into the open are inside. Where inside meets open air there is an opening, which
/// then is looked at with rays: its middle, the direction of the walls, and the last cut across them that is closed all
/// round. Only surfaces count, not what is material: sheets, turned triangles and cracks do no harm. A slanted rim ends
/// where its low side does.
///
/// A cup or a deep bowl has one opening; boxes, balls and closed vessels have none, and dents do not count: dead ends
/// that narrow quickly, or with less than a twentieth of the room that the largest passage has. A hole right through a
/// plate or a ring is a pipe if it is longer than about 0.85 of its diameter; shorter ones, as in a washer or a torus,
/// have no inside. A pipe that ends inside of a vessel of the same mesh is part of the vessel's inside.
/// Bores narrower than five cubes may be missed: a cube is (volume of the bounds / 8e5)^(1/3) or a thousandth of the
/// length, 1.6 mm for a body of 30 x 20 x 5 cm.
///
/// Takes some tenths of a second. Same input, same output. Empty if there is no opening.
inline std::vector<PipeOpening> find_pipe_openings(const BoundingVolumeHierarchy& surface) {
  std::vector<PipeOpening> openings;
  if (surface.size() == 0 || !(surface.bounds().sizes().maxCoeff() > 0)) {
    return openings;
  }
  const detail::OpenSky sky(surface);
  const auto [patches, room_size] = detail::air_patches(sky);
  for (const detail::AirPatch& patch : detail::worth_a_look(patches, room_size)) {
    auto rim = detail::opening_at(surface, patch, sky.width());
    if (!rim) {
      continue;
    }
    // a ragged patch may fall apart, and all of its parts lead to one rim
    const bool known = std::any_of(openings.begin(), openings.end(), [&](const PipeOpening& other) {
      return (other.rim.center - rim->center).norm() < 0.5 * other.rim.radius() &&
             other.rim.direction.dot(rim->direction) > 0;
    });
    if (!known) {
      openings.push_back({std::move(*rim), patch.room});
    }
  }
  detail::leave_out_dents(surface, room_size, openings);
  // a direction that symmetric bodies hardly have two openings across
  const Vector3<double> order(1, 0.1, 0.01);
  std::stable_sort(openings.begin(), openings.end(), [&](const PipeOpening& a, const PipeOpening& b) {
    return order.dot(a.rim.center) < order.dot(b.rim.center);
  });
  std::vector<std::size_t> rooms;
  for (const PipeOpening& opening : openings) {
    if (std::find(rooms.begin(), rooms.end(), opening.passage) == rooms.end()) {
      rooms.push_back(opening.passage);
    }
  }
  std::stable_sort(rooms.begin(), rooms.end(),
                   [&, &sizes = room_size](std::size_t a, std::size_t b) { return sizes[a] > sizes[b]; });
  for (PipeOpening& opening : openings) {
    opening.passage = static_cast<std::size_t>(std::find(rooms.begin(), rooms.end(), opening.passage) - rooms.begin());
  }
  return openings;
}

/// Throws std::invalid_argument if the mesh does not validate or has no area.
inline std::vector<PipeOpening> find_pipe_openings(const TriangleMesh& mesh) {
  return find_pipe_openings(BoundingVolumeHierarchy(mesh));
}

}  // namespace decant::inline DECANT_TARGET
