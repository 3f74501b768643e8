// SPDX-License-Identifier: MIT
#pragma once

/// Pictures of a liquid among rigid bodies for reports, drawn in software: particles as a smooth surface, bodies as
/// glass with their edges.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/io/png.hpp>

namespace decant::inline DECANT_TARGET {

/// From where a picture is taken: a perspective view without distortion.
struct PictureView {
  Vector3<double> eye{0, -1, 0};                     ///< [m]
  Vector3<double> target = Vector3<double>::Zero();  ///< what stands in the middle [m]
  Vector3<double> up = Vector3<double>::UnitZ();     ///< not along the line of sight
  double field_of_view = 0.5;                        ///< of the picture's height [rad]
  int width = 640;                                   ///< [px]
  int height = 480;                                  ///< [px]

  /// Looks along `direction` at the middle of a box, from where all of the box just fits into the picture.
  static PictureView around(const Eigen::AlignedBox3d& box, const Vector3<double>& direction, const Vector3<double>& up,
                            int width, int height) {
    PictureView view;
    view.width = width;
    view.height = height;
    view.up = up;
    view.target = box.center();
    const Vector3<double> forward = direction.normalized();
    const Vector3<double> right = forward.cross(up).normalized(), down = forward.cross(right);
    // what is at distance 1 at the picture's edges, less a margin
    const double half_height = 0.95 * std::tan(view.field_of_view / 2);
    const double half_width = half_height * width / height;
    double distance = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const Vector3<double> x = box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)) - view.target;
      const double aside = std::max(std::abs(right.dot(x)) / half_width, std::abs(down.dot(x)) / half_height);
      distance = std::max(distance, aside - forward.dot(x));
    }
    view.eye = view.target - distance * forward;
    return view;
  }
};

/// A body's surface, ready to be drawn many times: its edges are found once.
class PictureBody {
 public:
  struct Edge {
    std::array<std::uint32_t, 2> vertex{};
    std::array<std::int64_t, 2> triangle{-1, -1};  ///< the two at the edge; -1 where the surface ends
    bool sharp = false;
  };

  explicit PictureBody(const TriangleMesh& mesh) : mesh_(welded(mesh)) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> seen;
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        const auto [a, b] = std::minmax(mesh_.triangles[t][k], mesh_.triangles[t][(k + 1) % 3]);
        const auto [entry, fresh] = seen.try_emplace({a, b}, edges_.size());
        if (fresh) {
          edges_.push_back({{a, b}, {static_cast<std::int64_t>(t), -1}, true});
        } else if (edges_[entry->second].triangle[1] < 0) {
          edges_[entry->second].triangle[1] = static_cast<std::int64_t>(t);
        }
      }
    }
    for (Edge& edge : edges_) {
      if (edge.triangle[1] >= 0) {
        const Vector3<double> a = mesh_.area_normal(static_cast<std::size_t>(edge.triangle[0]));
        const Vector3<double> b = mesh_.area_normal(static_cast<std::size_t>(edge.triangle[1]));
        edge.sharp = a.dot(b) < 0.7 * a.norm() * b.norm();  // 45 degrees: rims and corners, not the bend of a cup
      }
    }
  }

  const TriangleMesh& mesh() const { return mesh_; }
  const std::vector<Edge>& edges() const { return edges_; }

 private:
  TriangleMesh mesh_;
  std::vector<Edge> edges_;
};

/// Draws pictures of one size; keeps its buffers between them.
class LiquidPainter {
 public:
  struct PlacedBody {
    const PictureBody* body;  ///< not owned
    Pose pose;
  };

  explicit LiquidPainter(const PictureView& view)
      : view_(view), columns_(samples * view.width), rows_(samples * view.height), picture_(view.width, view.height) {
    forward_ = (view.target - view.eye).normalized();
    right_ = forward_.cross(view.up).normalized();
    expects(right_.allFinite() && right_.norm() > 0.5, "PictureView: up", "away from the line of sight",
            view.up.transpose());
    down_ = forward_.cross(right_);
    focal_ = 0.5 * rows_ / std::tan(view.field_of_view / 2);
  }

  /// @param position 3xN [m], world frame; points with non-finite coordinates are left out.
  /// @param radius of a particle's sphere [m]; three quarters of the spacing close the surface.
  /// @param shade N numbers from 0 (dark) to 1 (light), e.g. speed over a largest speed; or empty.
  /// @return valid until the next call.
  template <class Positions, class Shades>
  const Picture& draw(const Positions& position, double radius, const Shades& shade,
                      const std::vector<PlacedBody>& bodies) {
    const auto count = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
    depth_.assign(count, far);
    shade_.assign(count, 0.0F);
    behind_.assign(count, 1.0F);
    before_.assign(count, 1.0F);
    edge_.assign(count, 0.0F);
    double nearest = std::numeric_limits<double>::infinity();
    for (Index i = 0; i < position.cols(); ++i) {
      const Vector3<double> x = position.col(i).template cast<double>();
      const double light = shade.size() > 0 ? static_cast<double>(shade[i]) : 0.35;
      nearest = std::min(nearest, splat(in_camera(x), radius, std::clamp(light, 0.0, 1.0)));
    }
    if (nearest < std::numeric_limits<double>::infinity()) {
      // wide enough to melt neighbouring spheres into one surface at the distance where they look largest
      const int reach = std::clamp(static_cast<int>(1.3 * focal_ * radius / nearest), 1, 24);
      for (int pass = 0; pass < 3; ++pass) {
        smooth(true, reach, radius);
        smooth(false, reach, radius);
      }
    }
    for (const PlacedBody& placed : bodies) {
      draw_body(placed);
    }
    compose();
    return picture_;
  }

 private:
  static constexpr int samples = 2;  // per pixel and axis, against jagged edges
  static constexpr float far = 1e30F;

  Vector3<double> in_camera(const Vector3<double>& x) const {
    const Vector3<double> from_eye = x - view_.eye;
    return {right_.dot(from_eye), down_.dot(from_eye), forward_.dot(from_eye)};
  }

  Eigen::Vector2d on_picture(const Vector3<double>& x_in_camera) const {
    return {focal_ * x_in_camera.x() / x_in_camera.z() + 0.5 * columns_,
            focal_ * x_in_camera.y() / x_in_camera.z() + 0.5 * rows_};
  }

  // Draws one sphere into the depth buffer; returns its distance, infinity where it is out of view.
  double splat(const Vector3<double>& center, double radius, double light) {
    if (!(center.z() > 2 * radius) || !center.allFinite()) {
      return std::numeric_limits<double>::infinity();
    }
    const Eigen::Vector2d middle = on_picture(center);
    const double reach = focal_ * radius / center.z();
    if (!(middle.x() + reach >= 0 && middle.x() - reach <= columns_ && middle.y() + reach >= 0 &&
          middle.y() - reach <= rows_)) {
      return std::numeric_limits<double>::infinity();
    }
    const auto clamped = [](double value, int limit) { return static_cast<int>(std::clamp(value, 0.0, limit - 1.0)); };
    const int first_row = clamped(middle.y() - reach, rows_), last_row = clamped(middle.y() + reach, rows_);
    const int first_column = clamped(middle.x() - reach, columns_), last_column = clamped(middle.x() + reach, columns_);
    for (int row = first_row; row <= last_row; ++row) {
      for (int column = first_column; column <= last_column; ++column) {
        const double dx = (column + 0.5 - middle.x()) / reach, dy = (row + 0.5 - middle.y()) / reach;
        const double inside = 1 - dx * dx - dy * dy;
        if (inside <= 0) {
          continue;
        }
        const auto z = static_cast<float>(center.z() - radius * std::sqrt(inside));
        const std::size_t pixel = index(row, column);
        if (z < depth_[pixel]) {
          depth_[pixel] = z;
          shade_[pixel] = static_cast<float>(light);
        }
      }
    }
    return center.z();
  }

  // One pass of a bilateral filter along rows or columns: depths far apart (another sheet of liquid) do not mix.
  void smooth(bool along_rows, int reach, double radius) {
    const std::ptrdiff_t lines = along_rows ? rows_ : columns_, length = along_rows ? columns_ : rows_;
    const std::ptrdiff_t along = along_rows ? 1 : columns_, across = along_rows ? columns_ : 1;
    line_depth_.resize(static_cast<std::size_t>(length));
    line_shade_.resize(static_cast<std::size_t>(length));
    const auto jump = static_cast<float>(3 * radius);
    for (std::ptrdiff_t line = 0; line < lines; ++line) {
      const std::ptrdiff_t start = line * across;
      for (std::ptrdiff_t k = 0; k < length; ++k) {
        line_depth_[static_cast<std::size_t>(k)] = depth_[static_cast<std::size_t>(start + k * along)];
        line_shade_[static_cast<std::size_t>(k)] = shade_[static_cast<std::size_t>(start + k * along)];
      }
      for (std::ptrdiff_t k = 0; k < length; ++k) {
        const float z = line_depth_[static_cast<std::size_t>(k)];
        if (z >= far) {
          continue;
        }
        float weights = 0, depth = 0, light = 0;
        for (std::ptrdiff_t j = std::max<std::ptrdiff_t>(0, k - reach); j <= std::min(length - 1, k + reach); ++j) {
          const float other = line_depth_[static_cast<std::size_t>(j)];
          const float apart = static_cast<float>(j - k) / static_cast<float>(reach + 1);
          const float weight = std::abs(other - z) < jump ? (1 - apart * apart) : 0.0F;
          weights += weight;
          depth += weight * (weight > 0 ? other : 0.0F);
          light += weight * line_shade_[static_cast<std::size_t>(j)];
        }
        depth_[static_cast<std::size_t>(start + k * along)] = depth / weights;
        shade_[static_cast<std::size_t>(start + k * along)] = light / weights;
      }
    }
  }

  void draw_body(const PlacedBody& placed) {
    const TriangleMesh& mesh = placed.body->mesh();
    vertices_.resize(mesh.vertices.size());
    for (std::size_t v = 0; v < vertices_.size(); ++v) {
      vertices_[v] = in_camera(placed.pose * mesh.vertices[v]);
    }
    faces_us_.resize(mesh.triangles.size());
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const Vector3<double>& a = vertices_[mesh.triangles[t][0]];
      const Vector3<double>& b = vertices_[mesh.triangles[t][1]];
      const Vector3<double>& c = vertices_[mesh.triangles[t][2]];
      const Vector3<double> normal = (b - a).cross(c - a);
      faces_us_[t] = normal.dot(a) < 0;
      const double size = normal.norm() * a.norm();
      // walls seen edge-on reflect more, which is what makes glass visible
      const double grazing = size > 0 ? 1 - std::min(1.0, std::abs(normal.dot(a)) / size) : 0.0;
      fill_triangle(a, b, c, static_cast<float>(0.045 + 0.25 * grazing * grazing * grazing));
    }
    for (const PictureBody::Edge& edge : placed.body->edges()) {
      const bool outline = edge.triangle[1] >= 0 && faces_us_[static_cast<std::size_t>(edge.triangle[0])] !=
                                                        faces_us_[static_cast<std::size_t>(edge.triangle[1])];
      if (edge.sharp || outline) {
        draw_line(vertices_[edge.vertex[0]], vertices_[edge.vertex[1]]);
      }
    }
  }

  void fill_triangle(const Vector3<double>& a, const Vector3<double>& b, const Vector3<double>& c, float alpha) {
    if (!(std::min({a.z(), b.z(), c.z()}) > 1e-3 * (view_.target - view_.eye).norm())) {
      return;  // reaches behind the eye, or is not finite: not worth clipping in a report
    }
    const Eigen::Vector2d p = on_picture(a), q = on_picture(b), r = on_picture(c);
    const double area = (q - p).x() * (r - p).y() - (q - p).y() * (r - p).x();
    if (!(std::abs(area) > 1e-9)) {
      return;
    }
    const int first_row = static_cast<int>(std::max(0.0, std::ceil(std::min({p.y(), q.y(), r.y()}) - 0.5)));
    const double low = std::min(rows_ - 1.0, std::floor(std::max({p.y(), q.y(), r.y()}) - 0.5));
    for (int row = first_row; row <= low; ++row) {
      const double y = row + 0.5;
      // where this row crosses the triangle
      double left = std::numeric_limits<double>::infinity(), right = -left;
      const auto cross = [&](const Eigen::Vector2d& u, const Eigen::Vector2d& v) {
        if ((u.y() <= y) != (v.y() <= y)) {
          const double x = u.x() + (y - u.y()) * (v.x() - u.x()) / (v.y() - u.y());
          left = std::min(left, x);
          right = std::max(right, x);
        }
      };
      cross(p, q);
      cross(q, r);
      cross(r, p);
      if (!(left <= right)) {
        continue;
      }
      const int first = static_cast<int>(std::max(0.0, std::ceil(left - 0.5)));
      const double last = std::min(columns_ - 1.0, std::ceil(right - 0.5) - 1);
      for (int column = first; column <= last; ++column) {
        const double x = column + 0.5;
        const double wb = ((x - p.x()) * (r - p).y() - (y - p.y()) * (r - p).x()) / area;
        const double wc = ((q - p).x() * (y - p.y()) - (q - p).y() * (x - p.x())) / area;
        const double z = 1 / ((1 - wb - wc) / a.z() + wb / b.z() + wc / c.z());
        const std::size_t pixel = index(row, column);
        (z < static_cast<double>(depth_[pixel]) ? before_ : behind_)[pixel] *= 1 - alpha;
      }
    }
  }

  void draw_line(const Vector3<double>& a, const Vector3<double>& b) {
    if (!(std::min(a.z(), b.z()) > 1e-3 * (view_.target - view_.eye).norm())) {
      return;
    }
    const Eigen::Vector2d p = on_picture(a), q = on_picture(b);
    const double length = (q - p).cwiseAbs().maxCoeff();
    if (!(length < 1e5)) {
      return;
    }
    const int steps = std::max(1, static_cast<int>(std::ceil(length)));
    for (int k = 0; k <= steps; ++k) {
      const double fraction = static_cast<double>(k) / steps;
      const Eigen::Vector2d at = p + fraction * (q - p);
      const double z = 1 / ((1 - fraction) / a.z() + fraction / b.z());
      if (!(at.x() >= 0 && at.y() >= 0 && at.x() < columns_ - 1 && at.y() < rows_ - 1)) {
        continue;
      }
      for (int corner = 0; corner < 4; ++corner) {  // two samples wide: one pixel
        const std::size_t pixel = index(static_cast<int>(at.y()) + corner / 2, static_cast<int>(at.x()) + corner % 2);
        const float strength = z < static_cast<double>(depth_[pixel]) * 1.002 ? 0.75F : 0.12F;
        edge_[pixel] = std::max(edge_[pixel], strength);
      }
    }
  }

  // The point of the liquid's surface that a sample sees.
  Vector3<double> surface_point(int row, int column) const {
    const double z = static_cast<double>(depth_[index(row, column)]);
    return {(column + 0.5 - 0.5 * columns_) * z / focal_, (row + 0.5 - 0.5 * rows_) * z / focal_, z};
  }

  // Difference of surface points toward the neighbour whose depth is nearer: keeps outlines crisp.
  Vector3<double> slope(int row, int column, int down, int across) const {
    const bool has_next = row + down < rows_ && column + across < columns_;
    const bool has_last = row >= down && column >= across;
    const Vector3<double> here = surface_point(row, column);
    const float z = depth_[index(row, column)];
    const float next = has_next ? std::abs(depth_[index(row + down, column + across)] - z) : far;
    const float last = has_last ? std::abs(depth_[index(row - down, column - across)] - z) : far;
    if (next <= last) {
      return has_next ? Vector3<double>(surface_point(row + down, column + across) - here) : Vector3<double>::Zero();
    }
    return here - surface_point(row - down, column - across);
  }

  void compose() {
    const Vector3<double> light = Vector3<double>(-0.4, -0.75, -0.55).normalized();  // from above, left, behind the eye
    const std::array<double, 3> paper{255, 255, 255}, glass{120, 140, 160}, ink{40, 48, 60};
    const std::array<std::array<double, 3>, 3> water{{{18, 74, 148}, {40, 150, 214}, {214, 240, 250}}};
    for (int row = 0; row < view_.height; ++row) {
      for (int column = 0; column < view_.width; ++column) {
        std::array<double, 3> sum{};
        for (int s = 0; s < samples * samples; ++s) {
          const int y = samples * row + s / samples, x = samples * column + s % samples;
          const std::size_t pixel = index(y, x);
          std::array<double, 3> color = paper;
          mix(color, glass, 1 - static_cast<double>(behind_[pixel]));
          if (depth_[pixel] < far) {
            Vector3<double> normal = slope(y, x, 1, 0).cross(slope(y, x, 0, 1));
            const double size = normal.norm();
            normal = size > 0 ? Vector3<double>(normal / size) : Vector3<double>(0, 0, -1);
            if (normal.z() > 0) {
              normal = -normal;
            }
            const double diffuse = std::max(0.0, normal.dot(light));
            const Vector3<double> half = (light + Vector3<double>(0, 0, -1)).normalized();
            const double shine = std::pow(std::max(0.0, normal.dot(half)), 60.0);
            const double tone = 2 * static_cast<double>(shade_[pixel]);
            std::array<double, 3> liquid = tone < 1 ? water[0] : water[1];
            mix(liquid, tone < 1 ? water[1] : water[2], tone < 1 ? tone : tone - 1);
            for (double& channel : liquid) {
              channel = std::min(255.0, channel * (0.62 + 0.5 * diffuse) + 90 * shine);
            }
            mix(color, liquid, 0.94);
          }
          mix(color, glass, 1 - static_cast<double>(before_[pixel]));
          mix(color, ink, static_cast<double>(edge_[pixel]));
          for (std::size_t k = 0; k < 3; ++k) {
            sum[k] += color[k];
          }
        }
        std::uint8_t* out = picture_.at(row, column);
        for (std::size_t k = 0; k < 3; ++k) {
          out[k] = static_cast<std::uint8_t>(std::clamp(sum[k] / (samples * samples) + 0.5, 0.0, 255.0));
        }
      }
    }
  }

  static void mix(std::array<double, 3>& color, const std::array<double, 3>& other, double amount) {
    for (std::size_t k = 0; k < 3; ++k) {
      color[k] += amount * (other[k] - color[k]);
    }
  }

  std::size_t index(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
  }

  PictureView view_;
  int columns_, rows_;  // samples
  Vector3<double> forward_, right_, down_;
  double focal_ = 0;  // samples
  std::vector<float> depth_, shade_, behind_, before_, edge_, line_depth_, line_shade_;
  std::vector<Vector3<double>> vertices_;
  std::vector<char> faces_us_;
  Picture picture_;
};

}  // namespace decant::inline DECANT_TARGET
