// SPDX-License-Identifier: MIT
#pragma once

/// Where in a body liquid stays when the body stands still: how much fits below the rim, how high a given amount
/// stands, and whether a point is in there.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <numeric>
#include <queue>
#include <utility>
#include <vector>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// The region of a body that holds liquid when `up` (in the body's frame) is up: of all places that keep liquid below
/// their own rim, the one that holds most. A closed hollow counts as a whole; it is chosen if no open place holds a
/// quarter of it (a can is a can in spite of the groove on its lid, a thermos flask is open in spite of its void).
/// Heights are along `up`, from the origin of the body's frame: height of x is up.dot(x).
///
/// How: vertical columns through the body are cut where they meet the surface. Pieces of neighbouring columns are
/// connected at heights where the level segment between them meets no wall, however thin; flooding from outside in the
/// order of height gives each piece the level to which it holds liquid (priority flood, R. Barnes et al., Computers &
/// Geosciences 62, 2014, here on pieces of columns instead of a terrain). Column lengths add up to volumes. Openings
/// narrower than a column's width may be missed. Cost: about 0.1 s for a scanned cup.
/// Queries are const, noexcept and callable from any thread.
class Cavity {
 public:
  /// @param surface of the body; shared, because contains() asks it. @param up any length but 0.
  /// @param column_width at most this wide [m]; in any case there are 40,000 columns or so on the body's footprint,
  /// which give volumes within 0.3 %, and at most 4 million.
  explicit Cavity(std::shared_ptr<const BoundingVolumeHierarchy> surface,
                  const Vector3<double>& up = Vector3<double>::UnitZ(),
                  double column_width = std::numeric_limits<double>::infinity())
      : surface_(std::move(surface)) {
    expects(surface_ != nullptr, "Cavity: surface", "given", "none");
    expects(up.allFinite() && up.norm() > 0, "Cavity: length of up", "> 0 and finite", up.norm());
    expects(column_width > 0, "Cavity: width [m] of a column", "> 0", column_width);
    find(up.normalized(), column_width);
  }

  explicit Cavity(const TriangleMesh& mesh, const Vector3<double>& up = Vector3<double>::UnitZ(),
                  double column_width = std::numeric_limits<double>::infinity())
      : Cavity(std::make_shared<const BoundingVolumeHierarchy>(mesh), up, column_width) {}

  /// True if the body holds no liquid at all this way up.
  bool empty() const noexcept { return pieces_.empty(); }

  /// True if the cavity has no opening.
  bool closed() const noexcept { return closed_; }

  /// Unit length, in the body's frame.
  const Vector3<double>& up() const noexcept { return axes_[2]; }

  /// Level above which liquid runs out [m]; of a closed cavity its highest point. 0 if empty, as is bottom_height.
  double rim_height() const noexcept { return rim_; }

  /// Lowest point [m].
  double bottom_height() const noexcept { return bottom_; }

  /// What fits below the rim [m^3].
  double volume() const noexcept { return levels_.empty() ? 0 : levels_.back().volume; }

  /// What fits below a level [m^3]: 0 below the bottom, volume() above the rim.
  double volume_below(double height) const noexcept {
    const auto above = std::lower_bound(levels_.begin(), levels_.end(), height,
                                        [](const Level& level, double h) { return level.height < h; });
    if (above == levels_.begin()) {
      return 0;
    }
    if (above == levels_.end()) {
      return volume();
    }
    const Level& below = *(above - 1);
    const double share = (height - below.height) / (above->height - below.height);
    return below.volume + share * (above->volume - below.volume);
  }

  /// The level at which an amount stands [m]. Throws std::invalid_argument unless 0 <= amount <= volume() (with room
  /// for rounding) [m^3].
  double height_of(double amount) const {
    expects(amount >= 0 && amount <= volume() * (1 + 1e-9), "Cavity: volume [m^3] to fill in",
            ">= 0 and at most what fits below the rim", amount);
    const auto above = std::lower_bound(levels_.begin(), levels_.end(), amount,
                                        [](const Level& level, double v) { return level.volume < v; });
    if (above == levels_.begin()) {
      return bottom_;
    }
    if (above == levels_.end()) {
      return rim_;
    }
    const Level& below = *(above - 1);
    const double share = (amount - below.volume) / (above->volume - below.volume);
    return below.height + share * (above->height - below.height);
  }

  /// Whether a point of the body's frame lies in the cavity, below the rim. Takes about 20 ns away from walls; within a
  /// column's width of them the surface is asked, so that the answer is right on both sides of a thin wall.
  bool contains(const Vector3<double>& x) const noexcept {
    const Vector3<double> local = to_columns(x);
    // also refuses NaN
    if (!(local[2] >= bottom_ && local[2] <= rim_) || pieces_.empty()) {
      return false;
    }
    const double column_u = std::floor((local[0] - origin_u_) / width_ + 0.5);
    const double column_v = std::floor((local[1] - origin_v_) / width_ + 0.5);
    if (!(column_u >= 1 && column_u + 1 < count_u_ && column_v >= 1 && column_v + 1 < count_v_)) {
      return false;  // nothing stands in the outermost columns
    }
    const auto u = static_cast<int>(column_u);
    const auto v = static_cast<int>(column_v);
    std::array<const Piece*, 9> found;
    std::array<std::size_t, 9> found_at;
    std::size_t count = 0;
    bool all_around = true;
    for (std::size_t k = 0; k < 9; ++k) {
      const std::size_t at = column(u + nearby[k][0], v + nearby[k][1]);
      const Piece* nearest = nullptr;
      bool within = false;
      for (std::uint32_t p = first_piece_[at]; p < first_piece_[at + 1]; ++p) {
        const Piece& piece = pieces_[p];
        if (local[2] > piece.low - width_ && local[2] < piece.high + width_) {
          nearest = &piece;
          within = local[2] >= piece.low && local[2] <= piece.high;
          if (within) {
            break;
          }
        }
      }
      all_around = all_around && within;
      if (nearest != nullptr) {
        found[count] = nearest;
        found_at[count++] = k;
      }
    }
    if (all_around) {
      return true;
    }
    for (std::size_t k = 0; k < count; ++k) {
      const Piece& piece = *found[k];
      const double inset = 1e-3 * (piece.high - piece.low);
      const double height = std::clamp(local[2], piece.low + inset, piece.high - inset);
      if (!surface_->any_hit(x, place(u + nearby[found_at[k]][0], v + nearby[found_at[k]][1], height))) {
        return true;
      }
    }
    return false;
  }

 private:
  struct Piece {
    double low, high;  // [m] along up
  };
  struct Level {
    double height, volume;
  };
  struct Cut {
    double height;
    int sign;
  };
  // All pieces of all columns while the cavity is looked for, in the order of columns.
  struct Pieces {
    std::vector<std::uint32_t> first;  // per column, and one past the end
    std::vector<Piece> piece;
    std::vector<std::uint32_t> column;
    std::vector<int> winding;
    std::vector<double> level;  // to which a piece holds liquid
  };

  static constexpr double infinity = std::numeric_limits<double>::infinity();
  static constexpr std::array<std::array<int, 2>, 9> nearby{
      {{0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, 1}, {1, -1}, {-1, -1}}};

  // Coordinates across the columns, and height.
  Vector3<double> to_columns(const Vector3<double>& x) const noexcept {
    return {axes_[0].dot(x), axes_[1].dot(x), axes_[2].dot(x)};
  }
  std::size_t column(int u, int v) const noexcept {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(count_u_) + static_cast<std::size_t>(u);
  }
  Vector3<double> place(int u, int v, double height) const noexcept {
    return (origin_u_ + u * width_) * axes_[0] + (origin_v_ + v * width_) * axes_[1] + height * axes_[2];
  }

  void find(const Vector3<double>& up, double column_width) {
    lay_out(up, column_width);
    Pieces pieces = cut_columns();
    flood(pieces);
    choose(pieces);
  }

  void lay_out(const Vector3<double>& up, double column_width);
  Pieces cut_columns() const;
  void flood(Pieces& pieces) const;
  double lowest_link(const Pieces& pieces, std::uint32_t a, std::uint32_t b, double enough) const;
  template <class Function>
  void for_each_neighbor(const Pieces& pieces, std::uint32_t a, Function&& f) const;
  Vector3<double> middle_of(const Pieces& pieces, std::uint32_t a) const {
    const auto count_u = static_cast<std::uint32_t>(count_u_);
    return place(static_cast<int>(pieces.column[a] % count_u), static_cast<int>(pieces.column[a] / count_u),
                 (pieces.piece[a].low + pieces.piece[a].high) / 2);
  }
  void choose(const Pieces& pieces);

  std::shared_ptr<const BoundingVolumeHierarchy> surface_;
  std::array<Vector3<double>, 3> axes_;  // across the columns, and up
  double origin_u_ = 0, origin_v_ = 0;   // of column (0, 0) [m]
  double width_ = 0;                     // of a column [m]
  int count_u_ = 0, count_v_ = 0;
  double top_ = 0;         // of the body [m]
  double resolution_ = 0;  // lengths below are rounding [m]

  bool closed_ = false;
  double rim_ = 0, bottom_ = 0;
  std::vector<std::uint32_t> first_piece_;  // of the cavity, per column, and one past the end
  std::vector<Piece> pieces_;
  std::vector<Level> levels_;  // volume over height, linear in between
};

inline void Cavity::lay_out(const Vector3<double>& up, double column_width) {
  axes_[2] = up;
  Index least = 0;
  up.cwiseAbs().minCoeff(&least);
  const Vector3<double> side = up.cross(Vector3<double>::Unit(least)).normalized();
  const Vector3<double> other = up.cross(side);
  // The grid is turned against the body's axes by the slope that is farthest from any ratio of small numbers. A box's
  // walls then cut columns at all distances alike, where they would otherwise all gain or all lose half a column.
  const double golden = (std::sqrt(5.0) - 1) / 2;
  axes_[0] = (side + golden * other).normalized();
  axes_[1] = up.cross(axes_[0]);
  Eigen::AlignedBox3d box;        // in column coordinates
  Eigen::AlignedBox2d footprint;  // along side and other: smaller, decides the number of columns
  surface_->for_each_triangle([&](const Vector3<double>& a, const Vector3<double>& b, const Vector3<double>& c) {
    for (const Vector3<double>* x : {&a, &b, &c}) {
      box.extend(to_columns(*x));
      footprint.extend(Eigen::Vector2d(side.dot(*x), other.dot(*x)));
    }
  });
  const double size = box.sizes().maxCoeff();
  const double area = footprint.sizes().prod();
  width_ = std::max(std::min(column_width, std::sqrt(area / 40000)), std::sqrt(area / 4e6));
  // a flat body seen from its edge has no area: still few columns along it
  width_ = std::max(width_, size / 4000);
  origin_u_ = box.min()[0] - 2.5 * width_;
  origin_v_ = box.min()[1] - 2.5 * width_;
  count_u_ = static_cast<int>(box.sizes()[0] / width_) + 6;
  count_v_ = static_cast<int>(box.sizes()[1] / width_) + 6;
  top_ = box.max()[2];
  resolution_ = 1e-8 * std::max(size, box.max().cwiseAbs().maxCoeff() * 1e-3);
}

inline auto Cavity::cut_columns() const -> Pieces {
  struct ColumnCut {
    std::size_t column;
    Cut cut;
  };
  std::vector<ColumnCut> cuts;
  surface_->for_each_triangle([&](const Vector3<double>& a, const Vector3<double>& b, const Vector3<double>& c) {
    const Vector3<double> p = to_columns(a);
    const Vector3<double> q = to_columns(b);
    const Vector3<double> r = to_columns(c);
    const auto cross = [](const Vector3<double>& e, const Vector3<double>& f) { return e[0] * f[1] - e[1] * f[0]; };
    const double area = cross(q - p, r - p);
    const Vector3<double> low = p.cwiseMin(q).cwiseMin(r);
    const Vector3<double> high = p.cwiseMax(q).cwiseMax(r);
    const double slack = 1e-12 * (high - low).head<2>().squaredNorm();
    if (!(std::abs(area) > 4 * slack)) {
      return;  // upright: it bounds columns from the side only
    }
    const double sign = area > 0 ? 1 : -1;
    const int first_u = static_cast<int>(std::ceil((low[0] - origin_u_) / width_ - 1e-9));
    const int last_u = static_cast<int>(std::floor((high[0] - origin_u_) / width_ + 1e-9));
    const int first_v = static_cast<int>(std::ceil((low[1] - origin_v_) / width_ - 1e-9));
    const int last_v = static_cast<int>(std::floor((high[1] - origin_v_) / width_ + 1e-9));
    for (int v = first_v; v <= last_v; ++v) {
      for (int u = first_u; u <= last_u; ++u) {
        const Vector3<double> x(origin_u_ + u * width_, origin_v_ + v * width_, 0);
        double weight_p = sign * cross(r - q, x - q);
        double weight_q = sign * cross(p - r, x - r);
        double weight_r = sign * cross(q - p, x - p);
        // inclusive: a column through an edge is cut twice at one height, which does no harm, and never missed
        if (weight_p < -slack || weight_q < -slack || weight_r < -slack) {
          continue;
        }
        weight_p = std::max(weight_p, 0.0);
        weight_q = std::max(weight_q, 0.0);
        weight_r = std::max(weight_r, 0.0);
        const double height = (weight_p * p[2] + weight_q * q[2] + weight_r * r[2]) / (weight_p + weight_q + weight_r);
        cuts.push_back({column(u, v), {height, area > 0 ? -1 : 1}});
      }
    }
  });
  std::sort(cuts.begin(), cuts.end(), [](const ColumnCut& a, const ColumnCut& b) {
    return a.column != b.column ? a.column < b.column : a.cut.height < b.cut.height;
  });
  Pieces pieces;
  const std::size_t column_count = static_cast<std::size_t>(count_u_) * static_cast<std::size_t>(count_v_);
  pieces.first.reserve(column_count + 1);
  std::size_t next = 0;
  for (std::size_t at = 0; at < column_count; ++at) {
    pieces.first.push_back(static_cast<std::uint32_t>(pieces.piece.size()));
    double low = -infinity;
    int winding = 0;
    const auto add = [&](double high) {
      pieces.piece.push_back({low, high});
      pieces.column.push_back(static_cast<std::uint32_t>(at));
      pieces.winding.push_back(winding);
    };
    for (; next < cuts.size() && cuts[next].column == at; ++next) {
      if (cuts[next].cut.height - low > resolution_) {
        add(cuts[next].cut.height);
      }
      low = cuts[next].cut.height;
      winding += cuts[next].cut.sign;
    }
    add(infinity);
  }
  pieces.first.push_back(static_cast<std::uint32_t>(pieces.piece.size()));
  return pieces;
}

// Lowest height at which one can go level from piece a to piece b of the column beside it, or infinity. Any height up
// to `enough` is as good as the lowest.
inline double Cavity::lowest_link(const Pieces& pieces, std::uint32_t a, std::uint32_t b, double enough) const {
  const double low = std::max(pieces.piece[a].low, pieces.piece[b].low);
  // above the body all is free
  const double high = std::min({pieces.piece[a].high, pieces.piece[b].high, top_ + 4 * resolution_});
  if (!(high - low > 2 * resolution_)) {
    return infinity;
  }
  const auto count_u = static_cast<std::uint32_t>(count_u_);
  const auto ua = static_cast<int>(pieces.column[a] % count_u);
  const auto va = static_cast<int>(pieces.column[a] / count_u);
  const auto ub = static_cast<int>(pieces.column[b] % count_u);
  const auto vb = static_cast<int>(pieces.column[b] / count_u);
  const auto is_free = [&](double height) { return !surface_->any_hit(place(ua, va, height), place(ub, vb, height)); };
  if (low == -infinity) {
    return -infinity;  // both are under the body, where all is free
  }
  const double lowest = low + resolution_;
  const double highest = high - resolution_;
  if (enough > lowest && enough < highest && is_free(enough)) {
    return enough;
  }
  if (is_free(lowest)) {
    return lowest;
  }
  // In steps of a column's width (what is smaller may be missed across columns as well), and back by halving.
  const int steps = std::clamp(static_cast<int>(std::ceil((highest - lowest) / width_)), 2, 512);
  double blocked = lowest;
  for (int step = 1; step <= steps; ++step) {
    double open = lowest + (highest - lowest) * step / steps;
    if (is_free(open)) {
      while (open - blocked > std::max(4 * resolution_, 1e-3 * width_)) {
        const double middle = (open + blocked) / 2;
        (is_free(middle) ? open : blocked) = middle;
      }
      return open;
    }
    blocked = open;
  }
  return infinity;
}

// Pieces of the four columns beside that of piece a.
template <class Function>
void Cavity::for_each_neighbor(const Pieces& pieces, std::uint32_t a, Function&& f) const {
  const auto count_u = static_cast<std::uint32_t>(count_u_);
  const auto u = static_cast<int>(pieces.column[a] % count_u);
  const auto v = static_cast<int>(pieces.column[a] / count_u);
  for (std::size_t k = 1; k < 5; ++k) {
    const int other_u = u + nearby[k][0];
    const int other_v = v + nearby[k][1];
    if (other_u < 0 || other_v < 0 || other_u >= count_u_ || other_v >= count_v_) {
      continue;
    }
    const std::size_t other = column(other_u, other_v);
    for (std::uint32_t b = pieces.first[other]; b < pieces.first[other + 1]; ++b) {
      f(b);
    }
  }
}

inline void Cavity::flood(Pieces& pieces) const {
  struct Front {
    double level;
    std::uint32_t piece;
    bool operator<(const Front& other) const {
      return level != other.level ? level > other.level : piece > other.piece;
    }
  };
  // Material is never entered; knowing it saves the search for a way through its walls. Both tests have to agree, so
  // that a triangle turned the wrong way does not make a wall of what is free.
  enum class Kind : std::uint8_t { Unknown, Free, Material };
  std::vector<Kind> kind(pieces.piece.size(), Kind::Unknown);
  const auto is_material = [&](std::uint32_t a) {
    if (kind[a] == Kind::Unknown) {
      const bool material = pieces.winding[a] != 0 && surface_->inside_material(middle_of(pieces, a));
      kind[a] = material ? Kind::Material : Kind::Free;
    }
    return kind[a] == Kind::Material;
  };
  std::priority_queue<Front> front;
  pieces.level.assign(pieces.piece.size(), infinity);
  for (std::uint32_t a = 0; a < pieces.piece.size(); ++a) {
    if (pieces.piece[a].low == -infinity) {
      pieces.level[a] = -infinity;  // liquid falls out of sight
      front.push({-infinity, a});
    }
  }
  while (!front.empty()) {
    const Front next = front.top();
    front.pop();
    if (next.level > pieces.level[next.piece]) {
      continue;  // a lower way was found meanwhile
    }
    for_each_neighbor(pieces, next.piece, [&](std::uint32_t b) {
      if (pieces.level[b] <= next.level || is_material(b)) {
        return;
      }
      const double level = std::max(next.level, lowest_link(pieces, next.piece, b, next.level));
      if (level < pieces.level[b]) {
        pieces.level[b] = level;
        front.push({level, b});
      }
    });
  }
}

inline void Cavity::choose(const Pieces& pieces) {
  // Pieces that share a level and are connected below it are one body of liquid.
  const auto count = static_cast<std::uint32_t>(pieces.piece.size());
  const auto depth = [&](std::uint32_t a) {
    return std::min(pieces.piece[a].high, pieces.level[a]) - pieces.piece[a].low;
  };
  // Unreached pieces are material, or a hollow without an opening, which the winding number tells apart.
  const auto holds = [&](std::uint32_t a) {
    return pieces.level[a] == infinity ? pieces.winding[a] == 0 : depth(a) > 4 * resolution_;
  };
  std::vector<std::uint32_t> group(count, count);
  std::vector<double> length;  // per group
  std::vector<std::uint32_t> first;
  std::vector<std::uint32_t> open;
  for (std::uint32_t start = 0; start < count; ++start) {
    if (group[start] != count || !holds(start)) {
      continue;
    }
    const auto number = static_cast<std::uint32_t>(length.size());
    length.push_back(0);
    first.push_back(start);
    group[start] = number;
    open.assign(1, start);
    while (!open.empty()) {
      const std::uint32_t a = open.back();
      open.pop_back();
      length[number] += depth(a);
      for_each_neighbor(pieces, a, [&](std::uint32_t b) {
        if (group[b] == count && pieces.level[b] == pieces.level[a] && holds(b)) {
          const double high = std::min({pieces.piece[a].high, pieces.piece[b].high, pieces.level[a]});
          const double low = std::max(pieces.piece[a].low, pieces.piece[b].low);
          const double middle = (low + high) / 2;
          if (high > low && lowest_link(pieces, a, b, middle) < pieces.level[a]) {
            group[b] = number;
            open.push_back(b);
          }
        }
      });
    }
  }
  std::uint32_t best_open = count;
  std::uint32_t best_closed = count;
  for (std::uint32_t g = 0; g < length.size(); ++g) {
    std::uint32_t& best = pieces.level[first[g]] == infinity ? best_closed : best_open;
    if (best == count || length[g] > length[best]) {
      best = g;
    }
  }
  const double open_length = best_open == count ? 0 : length[best_open];
  const double closed_length = best_closed == count ? 0 : length[best_closed];
  closed_ = open_length < 0.25 * closed_length;
  const std::uint32_t best = closed_ ? best_closed : best_open;

  first_piece_.assign(pieces.first.size(), 0);
  if (best == count) {
    return;
  }
  rim_ = -infinity;
  bottom_ = infinity;
  std::vector<std::pair<double, double>> slopes;  // height, change of the wet area [m^2]
  for (std::size_t at = 0; at + 1 < pieces.first.size(); ++at) {
    for (std::uint32_t a = pieces.first[at]; a < pieces.first[at + 1]; ++a) {
      if (group[a] != best) {
        continue;
      }
      const Piece piece{pieces.piece[a].low, std::min(pieces.piece[a].high, pieces.level[a])};
      pieces_.push_back(piece);
      rim_ = std::max(rim_, closed_ ? piece.high : pieces.level[a]);
      bottom_ = std::min(bottom_, piece.low);
      slopes.emplace_back(piece.low, width_ * width_);
      slopes.emplace_back(piece.high, -width_ * width_);
    }
    first_piece_[at + 1] = static_cast<std::uint32_t>(pieces_.size());
  }
  std::sort(slopes.begin(), slopes.end());
  double area = 0;
  double volume = 0;
  double height = bottom_;
  for (const auto& [at, change] : slopes) {
    volume += area * (at - height);
    height = at;
    area += change;
    if (!levels_.empty() && levels_.back().height == height) {
      levels_.back().volume = volume;
    } else {
      levels_.push_back({height, volume});
    }
  }
}

/// A container's cavity as it holds most: with one of its frame's axes upright, as it is made, or as it stands now, if
/// that holds more. So what a container holds is known of one that is tilted, too. Empty if it holds nothing.
/// @param up_now any length but 0, in the body's frame.
inline Cavity upright_cavity(const std::shared_ptr<const BoundingVolumeHierarchy>& surface,
                             const Vector3<double>& up_now = Vector3<double>::UnitZ()) {
  Cavity most(surface, Vector3<double>(0, 0, 1));
  for (const Vector3<double>& up : {Vector3<double>(0, 1, 0), Vector3<double>(1, 0, 0), Vector3<double>(0, 0, -1),
                                    Vector3<double>(0, -1, 0), Vector3<double>(-1, 0, 0), up_now}) {
    Cavity other(surface, up);
    if (other.volume() > 1.02 * most.volume()) {  // a little more by chance is no reason to take another axis
      most = std::move(other);
    }
  }
  return most;
}

}  // namespace decant::inline DECANT_TARGET
