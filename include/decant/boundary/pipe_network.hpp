// SPDX-License-Identifier: MIT
#pragma once

/// Thick-walled pipes that meet in one plane, as a closed mesh: elbows, junctions, manifolds. Pipes are mitred where
/// they meet, so that every wall is exact and nothing has to be cut out of anything.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <tuple>
#include <utility>
#include <vector>

#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Places in the plane y = 0 and pipes between them. A place with one pipe is an open end, cut straight.
struct PipeNetwork {
  enum class Bore { Round, Square };

  /// A straight pipe from one place to another.
  struct Pipe {
    std::size_t from = 0, to = 0;
    /// Bore over that of the network along the way: (share of the way, factor), linear in between. Where pipes meet
    /// they have to have the same, 1 unless said otherwise.
    std::vector<std::pair<double, double>> bore{};
  };

  /// A rectangle cut out of the wall: a leak.
  struct Hole {
    std::size_t pipe = 0;
    double begin = 0, end = 0;    ///< shares of the pipe's way
    double angle = 0;             ///< of its middle about the pipe [rad]; 0 is to the left of the way in the plane
    double opening_angle = 0.25;  ///< [rad]
  };

  std::vector<Eigen::Vector2d> places{};  ///< (x, z) [m]
  std::vector<Pipe> pipes{};
  std::vector<Hole> holes{};
  Bore bore = Bore::Round;
  double radius = 0.016;       ///< inner, of a square half its side [m]
  double wall = 0.004;         ///< [m]
  int sides = 48;              ///< of a round pipe; points around a square one: a multiple of eight
  double ring_length = 0.008;  ///< at most so long are triangles along a pipe [m]

  /// The bore's cross-section [m^2], where its factor is 1.
  double bore_area() const {
    return bore == Bore::Square ? 4 * radius * radius
                                : 0.5 * sides * std::sin(2 * std::numbers::pi / sides) * radius * radius;
  }

  /// Closed, triangles look out of the material. Throws std::invalid_argument where the numbers make no pipes.
  TriangleMesh mesh() const;

 private:
  struct Offset {
    double u, v;  // in the plane, to the left of a pipe's way; and along y
  };

  /// Around a pipe of inner radius 1, or with walls. Exactly symmetric, so that pipes share corners where they meet.
  std::vector<Offset> outline(double half_width) const {
    const auto count = static_cast<std::size_t>(sides);
    std::vector<Offset> points(count);
    for (std::size_t k = 0; k <= count / 4; ++k) {
      const double share = 4.0 * static_cast<double>(k) / static_cast<double>(count);  // of a quarter turn
      Offset p;
      if (bore == Bore::Square) {
        p = {std::min(1.0, 2 - 2 * share), std::min(1.0, 2 * share)};
      } else {
        p = {std::cos(share * std::numbers::pi / 2), std::sin(share * std::numbers::pi / 2)};
      }
      p.u = k == count / 4 ? 0 : half_width * p.u;
      p.v = k == 0 ? 0 : half_width * p.v;
      points[k] = p;
      points[count / 2 - k] = {-p.u, p.v};
      points[(count / 2 + k) % count] = {-p.u, -p.v};
      points[(count - k) % count] = {p.u, -p.v};
    }
    return points;
  }

  /// Where pipes end at one place: their ways out of it, counter-clockwise.
  struct Ends {
    std::vector<std::pair<double, std::size_t>> by_angle{};  // [rad], pipe

    /// Angle from a pipe to the next one to its left, and that pipe [rad]. An open end counts as one that is met
    /// head-on.
    std::pair<double, std::size_t> next(std::size_t pipe) const {
      const std::size_t count = by_angle.size();
      for (std::size_t k = 0; k < count; ++k) {
        if (by_angle[k].second == pipe && count > 1) {
          const auto& after = by_angle[(k + 1) % count];
          const double turn = after.first - by_angle[k].first;
          return {turn > 0 ? turn : turn + 2 * std::numbers::pi, after.second};
        }
      }
      return {std::numbers::pi, pipe};
    }

    /// The same to its right.
    std::pair<double, std::size_t> before(std::size_t pipe) const {
      for (const auto& [angle, other] : by_angle) {
        if (const auto [turn, found] = next(other); found == pipe && by_angle.size() > 1) {
          return {turn, other};
        }
      }
      return {std::numbers::pi, pipe};
    }
  };

  static Eigen::Vector2d left_of(const Eigen::Vector2d& way) { return {-way.y(), way.x()}; }
};

inline TriangleMesh PipeNetwork::mesh() const {
  using Ring = std::vector<Vector3<double>>;
  expects(sides >= 8 && sides % (bore == Bore::Square ? 8 : 4) == 0, "PipeNetwork: sides",
          "a multiple of four, of eight if square, at least 8", sides);
  expects(radius > 0 && wall > 0 && ring_length > 0, "PipeNetwork: lengths [m]", "> 0", radius);
  std::vector<Ends> ends(places.size());
  for (std::size_t p = 0; p < pipes.size(); ++p) {
    expects(pipes[p].from < places.size() && pipes[p].to < places.size() && pipes[p].from != pipes[p].to,
            "PipeNetwork: ends of a pipe", "two of the places", p);
    for (const auto& [here, there] : {std::pair(pipes[p].from, pipes[p].to), std::pair(pipes[p].to, pipes[p].from)}) {
      const Eigen::Vector2d way = places[there] - places[here];
      ends[here].by_angle.emplace_back(std::atan2(way.y(), way.x()), p);
    }
  }
  for (Ends& end : ends) {
    std::sort(end.by_angle.begin(), end.by_angle.end());
  }
  // Corners at the end of a pipe. Those to the right are computed as the neighbour's to the left: bit for bit equal.
  const auto corners = [&](std::size_t place, std::size_t pipe, const std::vector<Offset>& offsets) {
    const auto way_of = [&](std::size_t p) -> Eigen::Vector2d {
      return (places[pipes[p].from == place ? pipes[p].to : pipes[p].from] - places[place]).normalized();
    };
    const bool open = ends[place].by_angle.size() == 1;
    Ring ring;
    for (const Offset& offset : offsets) {
      std::size_t owner = pipe;
      double turn = ends[place].next(pipe).first;
      double u = offset.u;
      if (!open && offset.u < 0) {
        std::tie(turn, owner) = ends[place].before(pipe);
        u = -u;
      }
      const Eigen::Vector2d way = way_of(owner);
      const double along = open || u == 0 ? 0.0 : u / std::tan(turn / 2);
      const Eigen::Vector2d at = places[place] + along * way + u * left_of(way);
      ring.emplace_back(at.x(), offset.v, at.y());
    }
    return ring;
  };
  TriangleMesh result;
  const auto count = static_cast<std::uint32_t>(sides);
  const auto quad = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    result.triangles.push_back({a, b, c});
    result.triangles.push_back({a, c, d});
  };
  for (std::size_t p = 0; p < pipes.size(); ++p) {
    const Pipe& pipe = pipes[p];
    const Eigen::Vector2d begin = places[pipe.from], whole = places[pipe.to] - begin, way = whole.normalized();
    std::vector<double> shares;
    const int rings = std::max(1, static_cast<int>(std::ceil(whole.norm() / ring_length)));
    for (int k = 0; k <= rings; ++k) {
      shares.push_back(static_cast<double>(k) / rings);
    }
    for (const auto& [share, factor] : pipe.bore) {
      shares.push_back(share);
    }
    for (const Hole& hole : holes) {
      if (hole.pipe == p) {
        shares.insert(shares.end(), {hole.begin, hole.end});
      }
    }
    std::sort(shares.begin(), shares.end());
    shares.erase(std::unique(shares.begin(), shares.end()), shares.end());
    expects(shares.front() == 0 && shares.back() == 1, "PipeNetwork: shares of a pipe's way", "in [0, 1]",
            shares.back());
    const auto factor_at = [&](double share) {
      double factor = 1;
      for (std::size_t k = 0; k < pipe.bore.size(); ++k) {
        const auto& [to, value] = pipe.bore[k];
        if (share >= to) {
          factor = value;
        } else {
          const auto& [from, from_value] = k > 0 ? pipe.bore[k - 1] : std::pair(0.0, 1.0);
          return from_value + (value - from_value) * (share - from) / (to - from);
        }
      }
      return factor;
    };
    const auto is_cut_out = [&](std::size_t ring, std::uint32_t side) {
      const double middle = 2 * std::numbers::pi * (side + 0.5) / count;
      return std::any_of(holes.begin(), holes.end(), [&](const Hole& hole) {
        const double away = std::remainder(middle - hole.angle, 2 * std::numbers::pi);
        return hole.pipe == p && shares[ring] >= hole.begin && shares[ring + 1] <= hole.end &&
               std::abs(away) < hole.opening_angle / 2;
      });
    };
    std::array<std::uint32_t, 2> first{};  // vertices of the inner and the outer surface
    for (const bool outer : {false, true}) {
      first[outer] = static_cast<std::uint32_t>(result.vertices.size());
      const std::vector<Offset> offsets = outline(outer ? radius + wall : radius);
      std::vector<Offset> reversed = offsets;  // as seen from the other end
      for (Offset& offset : reversed) {
        offset.u = -offset.u;
      }
      const Ring near = corners(pipe.from, p, offsets), far = corners(pipe.to, p, reversed);
      // Rings are cut straight across, but for those next to a mitred end, which lean as it does. What is narrow
      // would be narrow at another place on each side of the pipe otherwise.
      const double length = whole.norm();
      const auto along_way = [&](const Vector3<double>& x) { return (Eigen::Vector2d(x.x(), x.z()) - begin).dot(way); };
      double leans_until = 0, leans_from = length;
      for (std::uint32_t k = 0; k < count; ++k) {
        leans_until = std::max(leans_until, along_way(near[k]));
        leans_from = std::min(leans_from, along_way(far[k]));
      }
      const auto place_along = [&](double share, std::uint32_t k) {
        const double first_place = factor_at(0) * along_way(near[k]);
        const double last_place = length - factor_at(1) * (length - along_way(far[k]));
        const double straight = share * length;
        if (leans_until >= leans_from) {  // too short for straight rings
          return std::lerp(first_place, last_place, share);
        }
        if (straight < leans_until) {
          return std::lerp(first_place, leans_until, straight / leans_until);
        }
        return straight > leans_from
                   ? std::lerp(leans_from, last_place, (straight - leans_from) / (length - leans_from))
                   : straight;
      };
      for (const double share : shares) {
        const double bore_here = radius * factor_at(share);
        const double factor = outer ? (bore_here + wall) / (radius + wall) : bore_here / radius;
        for (std::uint32_t k = 0; k < count; ++k) {
          if (share == 0 || share == 1) {
            Vector3<double> x = share == 0 ? near[k] : far[k];
            if (factor != 1) {
              const Eigen::Vector2d end = share == 0 ? begin : Eigen::Vector2d(places[pipe.to]);
              const Vector3<double> middle(end.x(), 0, end.y());
              x = middle + factor * (x - middle);
            }
            result.vertices.push_back(x);
            continue;
          }
          const Eigen::Vector2d at = begin + place_along(share, k) * way + factor * offsets[k].u * left_of(way);
          result.vertices.emplace_back(at.x(), factor * offsets[k].v, at.y());
        }
      }
    }
    const auto vertex = [&](bool outer, std::size_t ring, std::uint32_t side) {
      return first[outer] + static_cast<std::uint32_t>(ring) * count + side % count;
    };
    const std::size_t last = shares.size() - 1;
    for (std::uint32_t k = 0; k < count; ++k) {
      for (std::size_t ring = 0; ring < last; ++ring) {
        if (!is_cut_out(ring, k)) {
          quad(vertex(true, ring, k), vertex(true, ring, k + 1), vertex(true, ring + 1, k + 1),
               vertex(true, ring + 1, k));
          quad(vertex(false, ring, k), vertex(false, ring + 1, k), vertex(false, ring + 1, k + 1),
               vertex(false, ring, k + 1));
          continue;
        }
        // walls of the hole, toward the neighbours that stand
        if (ring > 0 && !is_cut_out(ring - 1, k)) {
          quad(vertex(true, ring, k), vertex(true, ring, k + 1), vertex(false, ring, k + 1), vertex(false, ring, k));
        }
        if (ring + 1 < last && !is_cut_out(ring + 1, k)) {
          quad(vertex(true, ring + 1, k + 1), vertex(true, ring + 1, k), vertex(false, ring + 1, k),
               vertex(false, ring + 1, k + 1));
        }
        if (!is_cut_out(ring, (k + count - 1) % count)) {
          quad(vertex(true, ring + 1, k), vertex(true, ring, k), vertex(false, ring, k), vertex(false, ring + 1, k));
        }
        if (!is_cut_out(ring, (k + 1) % count)) {
          quad(vertex(true, ring, k + 1), vertex(true, ring + 1, k + 1), vertex(false, ring + 1, k + 1),
               vertex(false, ring, k + 1));
        }
      }
      if (ends[pipe.from].by_angle.size() == 1) {  // rims
        quad(vertex(true, 0, k), vertex(false, 0, k), vertex(false, 0, k + 1), vertex(true, 0, k + 1));
      }
      if (ends[pipe.to].by_angle.size() == 1) {
        quad(vertex(true, last, k), vertex(true, last, k + 1), vertex(false, last, k + 1), vertex(false, last, k));
      }
    }
  }
  if (signed_volume(result) < 0) {
    for (auto& triangle : result.triangles) {
      std::swap(triangle[1], triangle[2]);
    }
  }
  return welded(result);
}

}  // namespace decant::inline DECANT_TARGET
