// SPDX-License-Identifier: MIT
#pragma once

/// Fast questions to a triangle mesh that does not change: the nearest point of its surface, the first triangle that a
/// segment meets, and whether a point is inside of the material. Set-up takes memory; questions take none.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include <decant/boundary/detail/segment_triangle.hpp>
#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

namespace detail {

// Four floats side by side, a GCC and Clang extension that every target of theirs maps to what it has.
typedef float Float4 __attribute__((vector_size(16)));
typedef std::int32_t Int4 __attribute__((vector_size(16)));

inline Float4 broadcast(float x) noexcept { return Float4{x, x, x, x}; }
inline Float4 absolute(Float4 x) noexcept { return x < 0 ? -x : x; }

// Bit k is set where lane k of a comparison is true.
inline unsigned lanes(Int4 mask) noexcept {
#ifdef __SSE2__
  return static_cast<unsigned>(_mm_movemask_ps(reinterpret_cast<__m128>(mask)));
#else
  return static_cast<unsigned>((mask[0] & 1) | (mask[1] & 2) | (mask[2] & 4) | (mask[3] & 8));
#endif
}

}  // namespace detail

/// Tree of boxes over the triangles of a mesh, four boxes to a node. Copies what it needs; owns everything. All
/// questions are const, noexcept, allocate nothing and may come from any number of threads. Coordinates are those of
/// the mesh (the body's frame). Triangles without area are left out: where the mesh is closed, their neighbours cover
/// them. Questions with NaN or infinite coordinates are answered by "nothing there".
///
/// Hits are two-sided, and touching counts: a segment that meets a triangle's edge or corner, ends on a triangle or
/// runs within its plane hits it. Tests carry bounds of their own rounding error, so that no segment slips between two
/// triangles that share an edge, whatever the compiler makes of multiply-adds; the price is that a segment within
/// about 1e-14 of its distance beside a free edge may be reported as well.
class BoundingVolumeHierarchy {
 public:
  /// The point of the surface that is nearest to a given one.
  struct Closest {
    Vector3<double> point;   ///< [m]
    double distance;         ///< [m], >= 0
    Vector3<double> normal;  ///< of the triangle, unit, toward its front
    std::uint32_t triangle;  ///< index into the mesh's triangles
  };

  /// Where a segment first meets the surface.
  struct Hit {
    double fraction;         ///< 0 at the segment's origin, 1 at its target
    Vector3<double> point;   ///< [m], on the triangle
    Vector3<double> normal;  ///< of the triangle, unit, toward its front, whichever side was hit
    std::uint32_t triangle;  ///< index into the mesh's triangles
  };

  /// Throws std::invalid_argument if the mesh does not validate, has no triangle with an area, or has 2^28 or more.
  explicit BoundingVolumeHierarchy(const TriangleMesh& mesh);

  /// Nearest point of the surface within max_distance [m]; nothing if there is none.
  std::optional<Closest> closest_point(const Vector3<double>& x, double max_distance) const noexcept;

  /// First meeting of the segment from origin to target with the surface.
  std::optional<Hit> first_hit(const Vector3<double>& origin, const Vector3<double>& target) const noexcept;

  /// As first_hit along a ray, up to `length` times the length of `direction`; fraction counts to that end.
  std::optional<Hit> first_hit_along(const Vector3<double>& origin, const Vector3<double>& direction,
                                     double length) const noexcept {
    return first_hit(origin, origin + length * direction);
  }

  /// Whether the segment between a and b meets the surface anywhere; cheaper than first_hit.
  bool any_hit(const Vector3<double>& a, const Vector3<double>& b) const noexcept;

  /// Whether x is inside of the material that a closed mesh encloses. Counts signed crossings along rays (winding
  /// number), so that shells that overlap are all material and the hollow of a hollow body is not. Three rays in odd
  /// directions vote: a small hole misleads few of them. Rays that graze an edge are replaced by others. On the surface
  /// itself either answer may come.
  bool inside_material(const Vector3<double>& x) const noexcept;

  /// How many triangles the segment between a and b crosses; nothing if it passes too close to an edge, or within the
  /// plane of a triangle, for such a count to mean anything.
  std::optional<int> crossing_count(const Vector3<double>& a, const Vector3<double>& b) const noexcept {
    const Crossings found = crossings(a, b);
    return found.grazing ? std::nullopt : std::optional<int>(found.count);
  }

  const Eigen::AlignedBox3d& bounds() const noexcept { return bounds_; }

  /// How many triangles are in the tree: those of the mesh that have an area.
  std::size_t size() const noexcept { return leaf_triangles_.size(); }

  /// Calls f(a, b, c) with the corners of each triangle in the tree [m], in an order of the tree's own.
  template <class Function>
  void for_each_triangle(Function&& f) const {
    for (const detail::TreeTriangle& triangle : leaf_triangles_) {
      f(triangle.a, triangle.b, triangle.c);
    }
  }

  /// Calls f(triangle) for each triangle within max_distance of x [m], and for some that are a little farther, by and
  /// large from near to far. `triangle` is a detail::TreeTriangle: its corners a, b, c [m] and its index in the mesh;
  /// it stays where it is as long as the hierarchy does.
  template <class Function>
  void for_each_triangle_near(const Vector3<double>& x, double max_distance, Function&& f) const;

 private:
  static constexpr std::uint32_t leaf_flag = 0x80000000U;
  static constexpr std::uint32_t no_child = 0xFFFFFFFFU;
  static constexpr std::uint32_t largest_leaf = 4;
  // From this depth on ranges are halved by count, which bounds the depth (and the stack of a question) for any input.
  static constexpr int sah_depth = 24;
  // 3 entries more per level; 4-way halving adds 14 levels for 2^28 triangles.
  static constexpr int stack_size = 3 * (sah_depth + 16) + 4;
  // Squared distances to boxes are rounded: the factor leaves room for it, the pad of the boxes for that of the place.
  static constexpr double room = 1.0001;

  // Boxes as centre and half size, in float relative to the middle of the mesh, rounded outward.
  struct Node {
    detail::Float4 center[3];
    detail::Float4 half[3];
    std::uint32_t child[4];  // a node, or leaf_flag | (count - 1) << 28 | first triangle, or no_child
  };

  // A segment as the boxes see it.
  struct FloatSegment {
    detail::Float4 middle[3], half[3], direction[3], size[3];
  };

  struct Crossings {
    int count = 0;
    int winding = 0;  // out of the front minus in through it
    bool grazing = false;
  };

  struct Range {
    std::uint32_t begin, end;
    Eigen::AlignedBox3d box;
  };
  struct Item {
    Eigen::AlignedBox3d box;
    Vector3<double> center;
    std::uint32_t triangle;
  };

  std::uint32_t build(std::vector<Item>& items, const Range& range, int depth);
  static std::pair<Range, Range> split(std::vector<Item>& items, const Range& range, int depth);
  static Range box_of(const std::vector<Item>& items, std::uint32_t begin, std::uint32_t end);
  bool clip(Vector3<double>& from, Vector3<double>& to, double& t_from, double& t_to) const noexcept;
  Crossings crossings(const Vector3<double>& a, const Vector3<double>& b) const noexcept;
  FloatSegment to_float(const Vector3<double>& from, const Vector3<double>& to) const noexcept;
  static unsigned overlapping(const Node& node, const FloatSegment& segment) noexcept;
  static detail::Float4 distances_squared(const Node& node, const detail::Float4 (&x)[3]) noexcept;
  static void push_farthest_first(const Node& node, unsigned open, const detail::Float4& far,
                                  std::array<std::uint32_t, stack_size>& stack, int& top) noexcept;
  // From the root: into the children of a node whose bits open_of(node) has, the least far_of(node) first, and to
  // visit(triangle) until it returns true.
  template <class Open, class Far, class Visit>
  bool descend(Open&& open_of, Far&& far_of, Visit&& visit) const;
  // Calls visit(triangle, segment) for every triangle whose box the segment may meet, until it returns true.
  template <class Visit>
  bool walk(const Vector3<double>& from, const Vector3<double>& to, Visit&& visit) const noexcept;

  Eigen::AlignedBox3d bounds_;
  Vector3<double> center_;  // of the bounds; origin of the boxes
  double radius_ = 0;       // largest half extent of the bounds
  float pad_ = 0;           // what float rounding may move a coordinate by, with room
  std::vector<Node> nodes_;
  std::vector<detail::TreeTriangle> leaf_triangles_;
};

inline BoundingVolumeHierarchy::BoundingVolumeHierarchy(const TriangleMesh& mesh) {
  validate(mesh);
  expects(mesh.triangles.size() < (std::size_t{1} << 28), "BoundingVolumeHierarchy: number of triangles", "below 2^28",
          mesh.triangles.size());
  std::vector<Item> items;
  items.reserve(mesh.triangles.size());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vector3<double>& a = mesh.corner(t, 0);
    const Vector3<double>& b = mesh.corner(t, 1);
    const Vector3<double>& c = mesh.corner(t, 2);
    const double longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    const double area = mesh.area_normal(t).norm();
    // below a few roundings the normal is noise
    if (!(area > 8 * std::numeric_limits<double>::epsilon() * longest)) {
      continue;
    }
    Item item;
    item.box = Eigen::AlignedBox3d(a);
    item.box.extend(b).extend(c);
    item.center = item.box.center();
    item.triangle = t;
    items.push_back(item);
    bounds_.extend(item.box);
  }
  expects(!items.empty(), "BoundingVolumeHierarchy: number of triangles with an area", ">= 1", items.size());
  center_ = bounds_.center();
  radius_ = bounds_.sizes().maxCoeff() / 2;
  // Questions are clipped to 3 radii, so |coordinates| <= 3 radii: 2^-24 of that for each of about five roundings.
  pad_ = static_cast<float>(4e-6 * radius_);
  build(items, {0, static_cast<std::uint32_t>(items.size()), bounds_}, 0);
  leaf_triangles_.reserve(items.size());
  for (const Item& item : items) {
    leaf_triangles_.push_back(
        {mesh.corner(item.triangle, 0), mesh.corner(item.triangle, 1), mesh.corner(item.triangle, 2), item.triangle});
  }
}

inline auto BoundingVolumeHierarchy::box_of(const std::vector<Item>& items, std::uint32_t begin, std::uint32_t end)
    -> Range {
  Range range{begin, end, {}};
  for (std::uint32_t i = begin; i < end; ++i) {
    range.box.extend(items[i].box);
  }
  return range;
}

// In two by the surface area heuristic over 16 bins along each axis (I. Wald, "On fast construction of SAH-based
// bounding volume hierarchies", 2007); by count where that finds nothing.
inline auto BoundingVolumeHierarchy::split(std::vector<Item>& items, const Range& range, int depth)
    -> std::pair<Range, Range> {
  constexpr int bin_count = 16;
  const auto half_area = [](const Eigen::AlignedBox3d& box) {
    const Vector3<double> s = box.sizes();
    return s[0] * s[1] + s[1] * s[2] + s[2] * s[0];
  };
  Eigen::AlignedBox3d centers;
  for (std::uint32_t i = range.begin; i < range.end; ++i) {
    centers.extend(items[i].center);
  }
  const auto first = items.begin() + range.begin;
  const auto last = items.begin() + range.end;
  Index widest = 0;
  centers.sizes().maxCoeff(&widest);
  auto middle = first;
  if (depth < sah_depth) {
    double best_cost = std::numeric_limits<double>::infinity();
    Index best_axis = -1;
    int best_bin = 0;
    const auto bin_of = [&](const Item& item, Index axis) {
      const double place = (item.center[axis] - centers.min()[axis]) / centers.sizes()[axis];
      return std::min(static_cast<int>(place * bin_count), bin_count - 1);
    };
    for (Index axis = 0; axis < 3; ++axis) {
      if (!(centers.sizes()[axis] > 0)) {
        continue;
      }
      std::array<Eigen::AlignedBox3d, bin_count> boxes;
      std::array<int, bin_count> counts{};
      for (auto item = first; item != last; ++item) {
        const auto bin = static_cast<std::size_t>(bin_of(*item, axis));
        boxes[bin].extend(item->box);
        ++counts[bin];
      }
      std::array<double, bin_count> cost_below{};
      Eigen::AlignedBox3d box;
      int count = 0;
      for (std::size_t bin = 0; bin + 1 < bin_count; ++bin) {
        box.extend(boxes[bin]);
        count += counts[bin];
        cost_below[bin] = count > 0 ? count * half_area(box) : 0;
      }
      box.setEmpty();
      count = 0;
      for (std::size_t bin = bin_count - 1; bin > 0; --bin) {
        box.extend(boxes[bin]);
        count += counts[bin];
        const bool both_sides = count > 0 && count < static_cast<int>(range.end - range.begin);
        const double cost =
            both_sides ? cost_below[bin - 1] + count * half_area(box) : std::numeric_limits<double>::infinity();
        if (cost < best_cost) {
          best_cost = cost;
          best_axis = axis;
          best_bin = static_cast<int>(bin);
        }
      }
    }
    if (best_axis >= 0) {
      // stable, so that the tree does not depend on the standard library's choice of order
      middle = std::stable_partition(first, last, [&](const Item& item) { return bin_of(item, best_axis) < best_bin; });
    }
  }
  if (middle == first || middle == last) {
    std::stable_sort(first, last,
                     [widest](const Item& a, const Item& b) { return a.center[widest] < b.center[widest]; });
    middle = first + (last - first) / 2;
  }
  const auto cut = static_cast<std::uint32_t>(middle - items.begin());
  return {box_of(items, range.begin, cut), box_of(items, cut, range.end)};
}

inline std::uint32_t BoundingVolumeHierarchy::build(std::vector<Item>& items, const Range& range, int depth) {
  std::array<Range, 4> children;
  children[0] = range;
  std::size_t count = 1;
  while (count < 4) {
    // opens the child with most triangles: surface area would save little and could leave one child with almost all
    std::size_t largest = 0;
    for (std::size_t k = 1; k < count; ++k) {
      if (children[k].end - children[k].begin > children[largest].end - children[largest].begin) {
        largest = k;
      }
    }
    if (children[largest].end - children[largest].begin <= largest_leaf) {
      break;
    }
    auto [low, high] = split(items, children[largest], depth);
    children[largest] = low;
    children[count++] = high;
  }
  const auto at = static_cast<std::uint32_t>(nodes_.size());
  Node node;
  for (std::size_t k = 0; k < 4; ++k) {
    node.child[k] = no_child;
    for (Index axis = 0; axis < 3; ++axis) {
      // a lane without a child is nowhere: a negative half size fails every test
      float center = 0;
      float half = -1e15F;
      if (k < count) {
        const Eigen::AlignedBox3d& box = children[k].box;
        center = static_cast<float>(box.center()[axis] - center_[axis]);
        half = static_cast<float>(box.sizes()[axis] / 2) + pad_;
      }
      node.center[axis][static_cast<int>(k)] = center;
      node.half[axis][static_cast<int>(k)] = half;
    }
  }
  nodes_.push_back(node);
  for (std::size_t k = 0; k < count; ++k) {
    const std::uint32_t size = children[k].end - children[k].begin;
    const std::uint32_t child = size <= largest_leaf ? leaf_flag | ((size - 1) << 28) | children[k].begin
                                                     : build(items, children[k], depth + 1);
    nodes_[at].child[k] = child;  // nodes_ may have moved
  }
  return at;
}

// From a point relative to the middle of the mesh to the boxes, rounded: the pad of the boxes makes up for it.
inline detail::Float4 BoundingVolumeHierarchy::distances_squared(const Node& node,
                                                                 const detail::Float4 (&x)[3]) noexcept {
  const detail::Float4 zero{};
  detail::Float4 sum{};
  for (int axis = 0; axis < 3; ++axis) {
    const detail::Float4 beyond = detail::absolute(node.center[axis] - x[axis]) - node.half[axis];
    const detail::Float4 outside = beyond > zero ? beyond : zero;
    sum += outside * outside;
  }
  return sum;
}

inline auto BoundingVolumeHierarchy::closest_point(const Vector3<double>& x, double max_distance) const noexcept
    -> std::optional<Closest> {
  const Vector3<double> local = x - center_;
  // farther out float squares would overflow; also refuses NaN
  if (!(local.cwiseAbs().maxCoeff() < 1e14) || !(max_distance >= 0)) {
    return std::nullopt;
  }
  using detail::Float4;
  const Float4 from[3] = {detail::broadcast(static_cast<float>(local[0])),
                          detail::broadcast(static_cast<float>(local[1])),
                          detail::broadcast(static_cast<float>(local[2]))};
  double best = std::min(max_distance * max_distance, 1e29);
  const detail::TreeTriangle* nearest = nullptr;
  Vector3<double> point = Vector3<double>::Zero();

  struct Entry {
    float distance_squared;
    std::uint32_t child;
  };
  std::array<Entry, stack_size> stack;
  int top = 0;
  stack[static_cast<std::size_t>(top++)] = {0, 0};
  while (top > 0) {
    const Entry entry = stack[static_cast<std::size_t>(--top)];
    if (static_cast<double>(entry.distance_squared) > best * room) {
      continue;
    }
    if ((entry.child & leaf_flag) != 0) {
      const std::uint32_t first = entry.child & 0x0FFFFFFFU;
      const std::uint32_t last = first + ((entry.child >> 28) & 7U);
      for (std::uint32_t t = first; t <= last; ++t) {
        const Vector3<double> candidate = detail::closest_on(leaf_triangles_[t], x);
        const double distance_squared = (x - candidate).squaredNorm();
        if (distance_squared < best || (nearest == nullptr && distance_squared <= best)) {
          best = distance_squared;
          nearest = &leaf_triangles_[t];
          point = candidate;
        }
      }
      continue;
    }
    const Node& node = nodes_[entry.child];
    const Float4 distance_squared = distances_squared(node, from);
    const Float4 limit = detail::broadcast(static_cast<float>(best * room));
    unsigned open = detail::lanes(distance_squared <= limit);
    // farthest first onto the stack, so that the nearest is looked at next
    const int bottom = top;
    for (int k = 0; open != 0; ++k, open >>= 1) {
      if ((open & 1U) == 0) {
        continue;
      }
      const Entry fresh{distance_squared[k], node.child[k]};
      int place = top++;
      while (place > bottom && stack[static_cast<std::size_t>(place - 1)].distance_squared < fresh.distance_squared) {
        stack[static_cast<std::size_t>(place)] = stack[static_cast<std::size_t>(place - 1)];
        --place;
      }
      stack[static_cast<std::size_t>(place)] = fresh;
    }
  }
  if (nearest == nullptr) {
    return std::nullopt;
  }
  return Closest{point, std::sqrt(best), nearest->unit_normal(), nearest->index};
}

// So that the nearest is looked at next. @param open a bit for each child that goes onto the stack. @param far how far
// they are, in any measure.
inline void BoundingVolumeHierarchy::push_farthest_first(const Node& node, unsigned open, const detail::Float4& far,
                                                         std::array<std::uint32_t, stack_size>& stack,
                                                         int& top) noexcept {
  std::array<float, 4> keys;
  const int bottom = top;
  for (int k = 0; open != 0; ++k, open >>= 1) {
    if ((open & 1U) == 0) {
      continue;
    }
    int place = top++;
    while (place > bottom && keys[static_cast<std::size_t>(place - 1 - bottom)] < far[k]) {
      keys[static_cast<std::size_t>(place - bottom)] = keys[static_cast<std::size_t>(place - 1 - bottom)];
      stack[static_cast<std::size_t>(place)] = stack[static_cast<std::size_t>(place - 1)];
      --place;
    }
    keys[static_cast<std::size_t>(place - bottom)] = far[k];
    stack[static_cast<std::size_t>(place)] = node.child[k];
  }
}

template <class Open, class Far, class Visit>
bool BoundingVolumeHierarchy::descend(Open&& open_of, Far&& far_of, Visit&& visit) const {
  std::array<std::uint32_t, stack_size> stack;
  int top = 0;
  stack[static_cast<std::size_t>(top++)] = 0;
  while (top > 0) {
    const std::uint32_t child = stack[static_cast<std::size_t>(--top)];
    if ((child & leaf_flag) != 0) {
      const std::uint32_t first = child & 0x0FFFFFFFU;
      const std::uint32_t last = first + ((child >> 28) & 7U);
      for (std::uint32_t t = first; t <= last; ++t) {
        if (visit(leaf_triangles_[t])) {
          return true;
        }
      }
      continue;
    }
    const Node& node = nodes_[child];
    const unsigned open = open_of(node);
    if (open == 0) {
      continue;
    }
    if ((open & (open - 1)) == 0) {  // one: nothing to sort
      stack[static_cast<std::size_t>(top++)] = node.child[std::countr_zero(open)];
      continue;
    }
    push_farthest_first(node, open, far_of(node), stack, top);
  }
  return false;
}

template <class Function>
void BoundingVolumeHierarchy::for_each_triangle_near(const Vector3<double>& x, double max_distance,
                                                     Function&& f) const {
  const Vector3<double> local = x - center_;
  if (!(local.cwiseAbs().maxCoeff() < 1e14) || !(max_distance >= 0)) {
    return;  // as in closest_point
  }
  using detail::Float4;
  const Float4 from[3] = {detail::broadcast(static_cast<float>(local[0])),
                          detail::broadcast(static_cast<float>(local[1])),
                          detail::broadcast(static_cast<float>(local[2]))};
  const Float4 limit = detail::broadcast(static_cast<float>(std::min(max_distance * max_distance, 1e29) * room));
  Float4 distance_squared{};
  descend(
      [&](const Node& node) {
        distance_squared = distances_squared(node, from);
        return detail::lanes(distance_squared <= limit);
      },
      [&](const Node&) { return distance_squared; },
      [&](const detail::TreeTriangle& triangle) {
        f(triangle);
        return false;
      });
}

// Cuts a long segment down to where the mesh is, so that what follows has coordinates of the mesh's size.
inline bool BoundingVolumeHierarchy::clip(Vector3<double>& from, Vector3<double>& to, double& t_from,
                                          double& t_to) const noexcept {
  t_from = 0;
  t_to = 1;
  const double reach = 3 * radius_;
  const double extent = std::max((from - center_).cwiseAbs().maxCoeff(), (to - center_).cwiseAbs().maxCoeff());
  if (extent <= reach) {
    return true;
  }
  if (!(extent < 1e100)) {
    return false;  // NaN or infinite
  }
  const double kept = 2 * radius_;
  const Vector3<double> d = to - from;
  for (Index axis = 0; axis < 3; ++axis) {
    const double low = center_[axis] - kept - from[axis];
    const double high = center_[axis] + kept - from[axis];
    if (d[axis] == 0) {
      if (low > 0 || high < 0) {
        return false;
      }
      continue;
    }
    const double enter = (d[axis] > 0 ? low : high) / d[axis];
    const double leave = (d[axis] > 0 ? high : low) / d[axis];
    t_from = std::max(t_from, enter);
    t_to = std::min(t_to, leave);
  }
  if (!(t_from <= t_to)) {
    return false;
  }
  to = from + t_to * d;
  from += t_from * d;
  return true;
}

inline auto BoundingVolumeHierarchy::to_float(const Vector3<double>& from, const Vector3<double>& to) const noexcept
    -> FloatSegment {
  const Vector3<double> middle = 0.5 * (from + to) - center_;
  const Vector3<double> d = to - from;
  const double longest = d.cwiseAbs().maxCoeff();
  const Vector3<double> direction =
      longest > 0 ? Vector3<double>(d / longest) : Vector3<double>(Vector3<double>::Zero());
  FloatSegment result;
  for (Index axis = 0; axis < 3; ++axis) {
    result.middle[axis] = detail::broadcast(static_cast<float>(middle[axis]));
    result.half[axis] = detail::broadcast(static_cast<float>(std::abs(d[axis]) / 2));
    result.direction[axis] = detail::broadcast(static_cast<float>(direction[axis]));
    // a little longer than the direction, against its own rounding and against underflow in products
    result.size[axis] = detail::broadcast(static_cast<float>(std::abs(direction[axis])) + 1e-7F);
  }
  return result;
}

// Separating axes of a segment and a box: the three of the box and their products with the segment. The boxes are
// padded by more than what rounding may move the segment, so nothing that touches is missed.
inline unsigned BoundingVolumeHierarchy::overlapping(const Node& node, const FloatSegment& s) noexcept {
  using detail::absolute;
  const detail::Float4 x = node.center[0] - s.middle[0];
  const detail::Float4 y = node.center[1] - s.middle[1];
  const detail::Float4 z = node.center[2] - s.middle[2];
  detail::Int4 open = (absolute(x) <= node.half[0] + s.half[0]) & (absolute(y) <= node.half[1] + s.half[1]) &
                      (absolute(z) <= node.half[2] + s.half[2]);
  open &= absolute(y * s.direction[2] - z * s.direction[1]) <= node.half[1] * s.size[2] + node.half[2] * s.size[1];
  open &= absolute(z * s.direction[0] - x * s.direction[2]) <= node.half[2] * s.size[0] + node.half[0] * s.size[2];
  open &= absolute(x * s.direction[1] - y * s.direction[0]) <= node.half[0] * s.size[1] + node.half[1] * s.size[0];
  return detail::lanes(open);
}

template <class Visit>
bool BoundingVolumeHierarchy::walk(const Vector3<double>& from, const Vector3<double>& to,
                                   Visit&& visit) const noexcept {
  FloatSegment segment = to_float(from, to);
  return descend([&](const Node& node) { return overlapping(node, segment); },
                 [&](const Node& node) {  // along the segment
                   return node.center[0] * segment.direction[0] + node.center[1] * segment.direction[1] +
                          node.center[2] * segment.direction[2];
                 },
                 [&](const detail::TreeTriangle& triangle) { return visit(triangle, segment); });
}

inline auto BoundingVolumeHierarchy::first_hit(const Vector3<double>& origin,
                                               const Vector3<double>& target) const noexcept -> std::optional<Hit> {
  Vector3<double> from = origin;
  Vector3<double> to = target;
  double t_from = 0;
  double t_to = 1;
  if (!clip(from, to, t_from, t_to)) {
    return std::nullopt;
  }
  detail::TriangleCrossing best;
  best.fraction = 2;
  const detail::TreeTriangle* hit = nullptr;
  walk(from, to, [&](const detail::TreeTriangle& triangle, FloatSegment& segment) {
    const detail::TriangleCrossing crossing = detail::cross(triangle, from, to);
    if (crossing.hit && crossing.fraction < best.fraction) {
      best = crossing;
      hit = &triangle;
      // boxes beyond the hit need no look; the tests of triangles go on with the whole segment
      segment = to_float(from, from + best.fraction * (to - from));
    }
    return false;
  });
  if (hit == nullptr) {
    return std::nullopt;
  }
  const double sum = best.u + best.v + best.w;
  Hit result;
  result.fraction = t_from + best.fraction * (t_to - t_from);
  result.point = sum > 0 ? Vector3<double>((best.u * hit->a + best.v * hit->b + best.w * hit->c) / sum)
                         : detail::closest_on(*hit, from + best.fraction * (to - from));
  result.normal = hit->unit_normal();
  result.triangle = hit->index;
  return result;
}

inline bool BoundingVolumeHierarchy::any_hit(const Vector3<double>& a, const Vector3<double>& b) const noexcept {
  Vector3<double> from = a;
  Vector3<double> to = b;
  double t_from = 0;
  double t_to = 1;
  return clip(from, to, t_from, t_to) && walk(from, to, [&](const detail::TreeTriangle& triangle, FloatSegment&) {
           return detail::cross(triangle, from, to).hit;
         });
}

inline auto BoundingVolumeHierarchy::crossings(const Vector3<double>& a, const Vector3<double>& b) const noexcept
    -> Crossings {
  Vector3<double> from = a;
  Vector3<double> to = b;
  double t_from = 0;
  double t_to = 1;
  Crossings found;
  if (!clip(from, to, t_from, t_to)) {
    return found;
  }
  walk(from, to, [&](const detail::TreeTriangle& triangle, FloatSegment&) {
    const detail::TriangleCrossing crossing = detail::cross(triangle, from, to);
    if (crossing.hit) {
      ++found.count;
      found.winding += crossing.side < 0 ? 1 : -1;
      found.grazing = crossing.grazing;
    }
    return found.grazing;
  });
  return found;
}

inline bool BoundingVolumeHierarchy::inside_material(const Vector3<double>& x) const noexcept {
  if (!bounds_.contains(x)) {
    return false;
  }
  // Directions without a simple ratio between their components, so that hardly any mesh has edges along them.
  constexpr std::array<std::array<double, 3>, 9> directions{{{0.5257, 0.3819, 0.7601},
                                                             {-0.6653, 0.7112, -0.2272},
                                                             {0.1931, -0.8714, 0.4510},
                                                             {-0.3113, -0.4127, -0.8560},
                                                             {0.8331, -0.2173, -0.5087},
                                                             {-0.9127, 0.0761, 0.4013},
                                                             {0.0871, 0.9573, 0.2756},
                                                             {-0.4517, 0.1297, 0.8827},
                                                             {0.7019, 0.6883, -0.1831}}};
  int votes_inside = 0;
  int votes_outside = 0;
  for (std::size_t k = 0; k < directions.size(); ++k) {
    const Crossings found =
        crossings(x, x + 4 * radius_ * Vector3<double>(directions[k][0], directions[k][1], directions[k][2]));
    if (found.grazing && k + 1 < directions.size()) {
      continue;
    }
    (found.winding != 0 ? votes_inside : votes_outside) += 1;
    if (votes_inside == 2 || votes_outside == 2) {
      break;
    }
  }
  return votes_inside > votes_outside;
}

}  // namespace decant::inline DECANT_TARGET
