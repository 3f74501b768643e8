// SPDX-License-Identifier: MIT
#pragma once

/// What spares most sight lines their way through the bodies' hierarchies: how near bodies come in each part of the
/// image, and which triangle was met there last.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/boundary/detail/segment_triangle.hpp>
#include <decant/camera/concept.hpp>
#include <decant/core/image.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET::detail {

/// Two shortcuts that change no answer, for sight lines that begin at the origin of the camera's frame. One that ends
/// before all that any body has in its part of the image meets nothing. And what is behind a wall is mostly in the
/// shadow of the triangle that hid what was seen at these pixels last, which four planes bound. Both leave room for
/// rounding: what is too close to say is left to the hierarchies. Bodies have numbers from 0 up, in the order of add.
/// Refers to the surfaces, does not own them. Questions may come from many threads while nothing is changed.
class SightMemory {
 public:
  static constexpr std::uint32_t nothing = std::numeric_limits<std::uint32_t>::max();

  template <class Camera>
  explicit SightMemory(const Camera& camera)
      : width_(camera.width()),
        height_(camera.height()),
        hints_((camera.height() + pixels_per_hint - 1) / pixels_per_hint,
               (camera.width() + pixels_per_hint - 1) / pixels_per_hint) {
    for (Index k = 0; k < hints_.size(); ++k) {
      hints_.data()[k].fill(nothing);
    }
    // the directions in which its image lies, by the border
    Eigen::AlignedBox2d directions;
    constexpr int steps = 64;
    for (int k = 0; k <= steps; ++k) {
      const double u = (width_ * k) / static_cast<double>(steps) - 0.5;
      const double v = (height_ * k) / static_cast<double>(steps) - 0.5;
      for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(u, -0.5), Eigen::Vector2d(u, height_ - 0.5),
                                           Eigen::Vector2d(-0.5, v), Eigen::Vector2d(width_ - 0.5, v)}) {
        directions.extend(
            Eigen::Vector2d((camera.unproject(pixel, 1) - camera.unproject(pixel, 0)).template head<2>()));
      }
    }
    const double longest = directions.sizes().maxCoeff();
    if (std::isfinite(longest) && longest > 1e-9 && longest < 1e3) {
      const double cell = longest * pixels_per_cell / std::max(width_, height_);
      origin_ = directions.min();
      per_direction_ = 1 / cell;
      nearest_.resize(static_cast<Index>(directions.sizes().y() / cell) + 1,
                      static_cast<Index>(directions.sizes().x() / cell) + 1);
    }
  }

  /// Takes one more body. Allocates.
  void add(const BoundingVolumeHierarchy& surface) {
    const auto body = static_cast<std::uint32_t>(bodies_.size());
    Body taken;
    const double diagonal = surface.bounds().diagonal().norm();
    surface.for_each_triangle_near(surface.bounds().center(), 2 * diagonal, [&](const TreeTriangle& triangle) {
      taken.number.resize(std::max<std::size_t>(taken.number.size(), triangle.index + std::size_t{1}), nothing);
      taken.number[triangle.index] = static_cast<std::uint32_t>(known_.size());
      known_.push_back({&triangle, body, nothing});
    });
    Eigen::AlignedBox3d together;
    surface.for_each_triangle([&](const Vector3<double>& a, const Vector3<double>& b, const Vector3<double>& c) {
      cut(a, b, c, diagonal / pieces_per_diagonal, together, taken.pieces);
    });
    keep(together, taken.pieces);
    shadows_.reserve(known_.size());
    number_of_shadow_.reserve(known_.size());
    bodies_.push_back(std::move(taken));
  }

  /// Forgets where bodies are: draw all of them again.
  void clear() noexcept {
    nearest_.setConstant(std::numeric_limits<float>::infinity());
    usable_ = nearest_.size() > 0;
  }

  void draw(std::uint32_t body, const Eigen::Isometry3d& camera_from_body) noexcept {
    bodies_[body].camera_from_body = camera_from_body;
    for (std::size_t k = 0; k < shadows_.size(); ++k) {
      const Known& known = known_[number_of_shadow_[k]];
      if (known.body == body) {
        shadows_[k] = shadow_of(known);
      }
    }
    const Matrix3<double> turn = camera_from_body.linear();
    const Matrix3<double> stretch = turn.cwiseAbs();
    for (const Piece& piece : bodies_[body].pieces) {
      if (!usable_) {
        return;
      }
      const Vector3<double> center = turn * piece.center + camera_from_body.translation();
      const Vector3<double> half = stretch * piece.half;
      if (center.z() + half.z() < 0) {
        continue;  // behind the camera
      }
      const double front = (center.z() - half.z()) * (1 - room);
      usable_ = front > least_depth;  // what reaches through the camera's plane is in all directions; also NaN
      const double over_front = 1 / front, over_back = 1 / (center.z() + half.z());
      const auto lowest = [&](double x) { return x * (x < 0 ? over_front : over_back); };
      const auto highest = [&](double x) { return x * (x < 0 ? over_back : over_front); };
      const auto cell = [&](double direction, Index axis, Index count) {
        return static_cast<Index>(
            std::clamp((direction - origin_[axis]) * per_direction_, -1.0, static_cast<double>(count)));
      };
      const Index left = std::max<Index>(0, cell(lowest(center.x() - half.x()) - room, 0, nearest_.cols()));
      const Index top = std::max<Index>(0, cell(lowest(center.y() - half.y()) - room, 1, nearest_.rows()));
      const Index right =
          std::min(nearest_.cols(), cell(highest(center.x() + half.x()) + room, 0, nearest_.cols()) + 1);
      const Index bottom =
          std::min(nearest_.rows(), cell(highest(center.y() + half.y()) + room, 1, nearest_.rows()) + 1);
      for (Index row = top; row < bottom; ++row) {
        for (Index column = left; column < right; ++column) {
          nearest_(row, column) = std::min(nearest_(row, column), static_cast<float>(front));
        }
      }
    }
  }

  /// True only if no body has anything on the straight way from the camera's origin to x, in the camera's frame [m].
  bool clear_to(const Vector3<double>& x) const noexcept {
    const double column = (x.x() / x.z() - origin_.x()) * per_direction_;
    const double row = (x.y() / x.z() - origin_.y()) * per_direction_;
    return usable_ && column >= 0 && row >= 0 && column < static_cast<double>(nearest_.cols()) &&
           row < static_cast<double>(nearest_.rows()) &&
           x.z() < static_cast<double>(nearest_(static_cast<Index>(row), static_cast<Index>(column)));
  }

  /// True only if x, which is seen at that pixel, is in the shadow of a triangle that was remembered there.
  bool in_known_shadow(const Eigen::Vector2d& pixel, const Vector3<double>& x) const noexcept {
    if (!inside_image(pixel, width_, height_)) {
      return false;
    }
    const Float4 x_at = broadcast(static_cast<float>(x[0])), y_at = broadcast(static_cast<float>(x[1])),
                 z_at = broadcast(static_cast<float>(x[2]));
    for (const std::uint32_t k : hints_(row_of(pixel), column_of(pixel))) {
      if (k == nothing) {
        return false;
      }
      const Shadow& shadow = shadows_[k];
      if (lanes(shadow.x * x_at + shadow.y * y_at + shadow.z * z_at > shadow.offset) == 0xFU) {
        return true;
      }
    }
    return false;
  }

  /// To be tried first at this pixel from now on. @param triangle index in the body's mesh. Allocates for triangles
  /// that were never met before.
  void remember(const Eigen::Vector2d& pixel, std::uint32_t body, std::uint32_t triangle) noexcept {
    if (!inside_image(pixel, width_, height_)) {
      return;
    }
    const std::uint32_t number = bodies_[body].number[triangle];
    Known& known = known_[number];
    if (known.shadow == nothing) {
      known.shadow = static_cast<std::uint32_t>(shadows_.size());
      shadows_.push_back(shadow_of(known));
      number_of_shadow_.push_back(number);
    }
    Hints& hints = hints_(row_of(pixel), column_of(pixel));
    if (std::find(hints.begin(), hints.end(), known.shadow) == hints.end()) {
      std::rotate(hints.begin(), hints.end() - 1, hints.end());
      hints.front() = known.shadow;
    }
  }

 private:
  /// A box around a part of a surface, in the body's frame [m].
  struct Piece {
    Vector3<double> center, half;
  };
  struct Body {
    Eigen::Isometry3d camera_from_body = Eigen::Isometry3d::Identity();
    std::vector<Piece> pieces{};
    std::vector<std::uint32_t> number{};  ///< by the triangle's index in the mesh
  };

  /// A triangle of a body.
  struct Known {
    const TreeTriangle* triangle;
    std::uint32_t body;
    std::uint32_t shadow;  ///< index of its shadow, or nothing
  };
  /// What a triangle hides from the origin: places x for which (x, y, z) . place > offset in all four lanes [m]. The
  /// planes go through the origin and an edge each, the last one through the triangle.
  struct Shadow {
    Float4 x, y, z, offset;
  };
  /// Indices of shadows, the latest first: where the edge between two runs through, both are asked for.
  using Hints = std::array<std::uint32_t, 4>;

  static constexpr int pixels_per_cell = 4;
  static constexpr int pixels_per_hint = 2;
  static constexpr double pieces_per_diagonal = 24;
  static constexpr double least_depth = 1e-4;  ///< [m]
  /// Of depths and directions, for rounding; what a test of triangles takes for touching is far below it.
  static constexpr double room = 1e-6;

  /// By so much a place has to be within all planes [m]: rounding in float is far below it.
  static constexpr float shadow_margin = 2e-6F;
  static constexpr double farthest = 10;  ///< corners beyond this [m] are not for float

  Shadow shadow_of(const Known& known) const noexcept {
    const Eigen::Isometry3d& camera_from_body = bodies_[known.body].camera_from_body;
    const std::array<Vector3<double>, 3> corner{camera_from_body * known.triangle->a,
                                                camera_from_body * known.triangle->b,
                                                camera_from_body * known.triangle->c};
    Shadow shadow;
    shadow.x = shadow.y = shadow.z = Float4{};
    shadow.offset = broadcast(std::numeric_limits<float>::infinity());
    const Vector3<double> across = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
    const double side = across.dot(corner[0]);
    double largest = 0;
    for (const Vector3<double>& x : corner) {
      largest = std::max(largest, x.cwiseAbs().maxCoeff());
    }
    // seen from the side, or next to the eye, it hides nothing for certain
    if (!(std::abs(side) > 1e-3 * across.norm() * corner[0].norm()) || !(largest < farthest)) {
      return shadow;
    }
    const double sign = side > 0 ? 1 : -1;
    for (std::size_t k = 0; k < 4; ++k) {
      const Vector3<double> normal =
          (sign * (k < 3 ? Vector3<double>(corner[k].cross(corner[(k + 1) % 3])) : across)).normalized();
      const auto lane = static_cast<int>(k);
      shadow.x[lane] = static_cast<float>(normal[0]);
      shadow.y[lane] = static_cast<float>(normal[1]);
      shadow.z[lane] = static_cast<float>(normal[2]);
      shadow.offset[lane] = static_cast<float>(k < 3 ? 0 : normal.dot(corner[0])) + shadow_margin;
    }
    return shadow;
  }

  static Index row_of(const Eigen::Vector2d& pixel) noexcept {
    return static_cast<Index>(pixel.y() + 0.5) / pixels_per_hint;
  }
  static Index column_of(const Eigen::Vector2d& pixel) noexcept {
    return static_cast<Index>(pixel.x() + 0.5) / pixels_per_hint;
  }
  static void keep(const Eigen::AlignedBox3d& box, std::vector<Piece>& pieces) {
    if (!box.isEmpty()) {
      pieces.push_back({box.center(), box.sizes() / 2});
    }
  }

  /// Large triangles in halves, again and again; small ones, which lie side by side in the tree's order, together.
  static void cut(const Vector3<double>& a, const Vector3<double>& b, const Vector3<double>& c, double longest,
                  Eigen::AlignedBox3d& together, std::vector<Piece>& pieces) {
    const double ab = (b - a).norm(), bc = (c - b).norm(), ca = (a - c).norm();
    if (std::max({ab, bc, ca}) > 2 * longest) {
      const bool first = ab >= bc && ab >= ca, second = !first && bc >= ca;
      const Vector3<double>& p = first ? a : second ? b : c;
      const Vector3<double>& q = first ? b : second ? c : a;
      const Vector3<double>& r = first ? c : second ? a : b;
      const Vector3<double> middle = (p + q) / 2;
      cut(p, middle, r, longest, together, pieces);
      cut(middle, q, r, longest, together, pieces);
      return;
    }
    Eigen::AlignedBox3d extended = together;
    extended.extend(a).extend(b).extend(c);
    if (!together.isEmpty() && extended.diagonal().norm() > longest) {
      keep(together, pieces);
      extended.setEmpty();
      extended.extend(a).extend(b).extend(c);
    }
    together = extended;
  }

  int width_, height_;
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();  ///< x / z and y / z of the first cell's corner [-]
  double per_direction_ = 0;                          ///< cells per unit of x / z
  Image<float> nearest_{};                            ///< depth before which no body has anything in a cell [m]
  bool usable_ = false;
  std::vector<Body> bodies_{};
  std::vector<Known> known_{};
  std::vector<Shadow> shadows_{};
  std::vector<std::uint32_t> number_of_shadow_{};  ///< in known_
  Image<Hints> hints_;
};

}  // namespace decant::inline DECANT_TARGET::detail
