// SPDX-License-Identifier: MIT
#pragma once

/// The depth of the first wall at each pixel, drawn from the bodies' meshes or taken from somebody else's renderer, and
/// which points it hides.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/camera/concept.hpp>
#include <decant/camera/detail/line_of_sight.hpp>
#include <decant/camera/occlusion_concept.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/camera/posed_camera.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// An image of depths along the optical axis [m]. Per frame: clear(), then draw() every body that cannot be looked
/// through; or accept() an image. Both allocate nothing.
///
/// A pixel has the depth of what its centre's ray meets first. For cameras with affine rays (pinhole, orthographic,
/// registered ones of these) triangles are drawn row by row, each pixel by its ray: which triangle, by the ray's side
/// of the three edges, and how deep, by the triangle's plane. This is exact under perspective and needs no clipping: a
/// triangle that reaches behind the camera is drawn where rays meet it before the camera. For other cameras (lenses
/// that bend lines, cameras of one's own) each pixel's ray goes through the bodies' hierarchies, ten to
/// thirty times slower.
template <class CameraType>
class DepthBuffer {
 public:
  using Camera = CameraType;

  /// @param margin [m], >= 0: what is less than this behind the drawn surface is not hidden by it; see RayOcclusion.
  /// Throws std::invalid_argument.
  explicit DepthBuffer(PosedCamera<Camera> camera, double margin = 1e-3)
      : camera_(std::move(camera)), margin_(margin), depth_(camera_.height(), camera_.width()) {
    expects(margin >= 0 && std::isfinite(margin), "DepthBuffer: margin [m]", ">= 0 and finite", margin);
    clear();
    prepare_rays();
  }

  /// Moves the camera. What was drawn stays as it was: clear and draw again.
  void set_camera_pose(const Pose& camera_from_world) noexcept { camera_.set_pose(camera_from_world); }

  /// Forgets all surfaces.
  void clear() noexcept { depth_.setConstant(nothing); }

  /// Adds a body: each pixel keeps what is nearer. Any order of bodies and any number of threads give the same image.
  void draw(const BoundingVolumeHierarchy& surface, const Pose& world_from_body, Threads threads) noexcept {
    const Eigen::Isometry3d camera_from_body =
        detail::isometry_of(camera_.camera_from_world()) * detail::isometry_of(world_from_body);
    if constexpr (has_affine_rays<Camera>) {
      // every thread looks at all triangles and draws its own rows
      const Index rows = depth_.rows();
      const Index bands = std::min<Index>(threads.resolved(), rows);
      parallel_ranges(bands, threads, 1, [&](Index begin, Index end) {
        const Band band{rows * begin / bands, rows * end / bands};
        surface.for_each_triangle([&](const Vector3<double>& a, const Vector3<double>& b, const Vector3<double>& c) {
          draw_triangle({camera_from_body * a, camera_from_body * b, camera_from_body * c}, band);
        });
      });
    } else {
      cast_rays(surface, camera_from_body.inverse(), threads);
    }
  }

  /// Clears, and draws all bodies of a simulation, such as RigidBodies, where they are at a time [s].
  template <class Bodies>
  requires requires(const Bodies& bodies) { bodies[std::uint32_t{}].surface; }
  void draw_bodies(const Bodies& bodies, double time, Threads threads) noexcept {
    clear();
    for (std::uint32_t body = 0; body < bodies.size(); ++body) {
      draw(*bodies[body].surface, bodies[body].motion.at(time), threads);
    }
  }

  /// Takes another renderer's or a sensor's depth image instead of what was drawn: depths along the optical axis [m],
  /// not along the rays. Pixels that are 0, negative, NaN or infinite mean that nothing is there. False, and nothing is
  /// changed, if the size is not the camera's.
  [[nodiscard]] bool accept(const ConstImageView<float>& depth) noexcept {
    if (depth.rows() != depth_.rows() || depth.cols() != depth_.cols()) {
      return false;
    }
    for (Index row = 0; row < depth.rows(); ++row) {
      for (Index column = 0; column < depth.cols(); ++column) {
        const float z = depth(row, column);
        depth_(row, column) = z > 0 ? z : nothing;
      }
    }
    return true;
  }

  /// Height x width, [m]; infinity where nothing is.
  const Image<float>& depth() const noexcept { return depth_; }

  /// Whether a point lies behind the surface at all of the (up to four) pixel centres around it. One pixel alone would
  /// hide points that lie on a wall seen at a slant, which is deeper at one side of the pixel than at the other; the
  /// price is that along silhouettes up to a pixel of what is hidden counts as seen. False for points outside the
  /// image, of which the buffer knows nothing.
  bool hidden(const Vector3<double>& x_in_world) const noexcept {
    const Projection seen = camera_.project(x_in_world);
    if (!seen.visible) {
      return false;
    }
    const auto [left, right] = around(seen.pixel.x(), depth_.cols());
    const auto [upper, lower] = around(seen.pixel.y(), depth_.rows());
    const float deepest = std::max(std::max(depth_(upper, left), depth_(upper, right)),
                                   std::max(depth_(lower, left), depth_(lower, right)));
    return seen.depth > static_cast<double>(deepest) + margin_;
  }

  const PosedCamera<Camera>& camera() const noexcept { return camera_; }
  double margin() const noexcept { return margin_; }

 private:
  static constexpr float nothing = std::numeric_limits<float>::infinity();

  using Triangle = std::array<Vector3<double>, 3>;

  struct Band {
    Index begin, end;  // rows
  };

  // begin + depth * way, in the camera's frame
  struct Ray {
    Vector3<double> begin, way;
  };

  // A number that changes evenly over the image.
  struct Slope {
    double at_origin, by_column, by_row;
    double at(double column, double row) const noexcept { return at_origin + column * by_column + row * by_row; }
  };

  static std::pair<Index, Index> around(double place, Index count) noexcept {
    const auto below = static_cast<Index>(std::floor(place));
    return {std::max<Index>(below, 0), std::min<Index>(below + 1, count - 1)};
  }

  void prepare_rays() {
    const auto ray = [this](double column, double row) {
      const Eigen::Vector2d pixel(column, row);
      const Vector3<double> begin = camera_.camera().unproject(pixel, 0);
      return Ray{begin, camera_.camera().unproject(pixel, 1) - begin};
    };
    if constexpr (has_affine_rays<Camera>) {
      // by the image's far corners: differences of neighbouring pixels would lose digits
      const double width = camera_.width();
      const double height = camera_.height();
      const Ray right = ray(width, 0);
      const Ray down = ray(0, height);
      origin_ = ray(0, 0);
      by_column_ = {(right.begin - origin_.begin) / width, (right.way - origin_.way) / width};
      largest_way_ = std::max({1.0, origin_.way.norm(), right.way.norm(), down.way.norm()});
      by_row_ = {(down.begin - origin_.begin) / height, (down.way - origin_.way) / height};
    } else {
      rays_.resize(6, depth_.size());
      for (Index row = 0; row < depth_.rows(); ++row) {
        for (Index column = 0; column < depth_.cols(); ++column) {
          const Eigen::Vector2d pixel(static_cast<double>(column), static_cast<double>(row));
          const Ray of_pixel = ray(pixel.x(), pixel.y());
          auto entry = rays_.col(row * depth_.cols() + column);
          entry << of_pixel.begin, of_pixel.way;
          // a lens that folds has pixels on which nothing falls
          const Projection back = camera_.camera().project(of_pixel.begin + of_pixel.way);
          if (!back.projected() || !((back.pixel - pixel).norm() < 0.01)) {
            entry.setConstant(std::numeric_limits<double>::quiet_NaN());  // questions with NaN hit nothing
          }
        }
      }
    }
  }

  void cast_rays(const BoundingVolumeHierarchy& surface, const Eigen::Isometry3d& body_from_camera,
                 Threads threads) noexcept {
    const double deepest = detail::deepest(surface, body_from_camera);
    if (!(deepest > 0)) {
      return;
    }
    parallel_ranges(depth_.rows(), threads, 1, [&](Index row, Index) {
      for (Index column = 0; column < depth_.cols(); ++column) {
        float& nearest = depth_(row, column);
        const auto entry = rays_.col(row * depth_.cols() + column);
        if (const auto z = detail::first_depth(surface, body_from_camera, entry.template head<3>(),
                                               entry.template tail<3>(), deepest)) {
          nearest = std::min(nearest, static_cast<float>(*z));
        }
      }
    });
  }

  // Side of the edge from a to b on which rays pass: the volume that way spans with a - begin and b - begin. All begin
  // at one point or all have one way, so it changes evenly over the image.
  Slope side_of_edge(const Vector3<double>& a, const Vector3<double>& b) const noexcept {
    const Vector3<double> from_a = a - origin_.begin;
    const Vector3<double> from_b = b - origin_.begin;
    const Vector3<double> normal = from_a.cross(from_b);
    const auto rate = [&](const Ray& by) {
      return by.way.dot(normal) + origin_.way.dot(from_b.cross(by.begin) - from_a.cross(by.begin));
    };
    return {origin_.way.dot(normal), rate(by_column_), rate(by_row_)};
  }

  void draw_triangle(const Triangle& corner, const Band& band) noexcept {
    double low = corner[0].z(), high = corner[0].z();
    for (const Vector3<double>& x : corner) {
      if (!x.allFinite()) {
        return;
      }
      low = std::min(low, x.z());
      high = std::max(high, x.z());
    }
    if (!(high > 0)) {
      return;
    }
    // The corners' box in the image; the whole image if a corner is not before the camera.
    Index first_row = band.begin, last_row = band.end - 1, first_column = 0, last_column = depth_.cols() - 1;
    Eigen::AlignedBox2d box;
    bool bounded = true;
    for (const Vector3<double>& x : corner) {
      const Projection seen = camera_.camera().project(x);
      bounded = bounded && seen.projected();
      box.extend(seen.pixel);
    }
    if (bounded) {
      // in double until clipped: pixels may be far outside
      first_row = std::max(first_row, clipped(std::ceil(box.min().y() - slack_px)));
      last_row = std::min(last_row, clipped(std::floor(box.max().y() + slack_px)));
      first_column = std::max(first_column, clipped(std::ceil(box.min().x() - slack_px)));
      last_column = std::min(last_column, clipped(std::floor(box.max().x() + slack_px)));
    }
    if (first_row > last_row || first_column > last_column) {
      return;
    }
    const std::array<Slope, 3> side{side_of_edge(corner[0], corner[1]), side_of_edge(corner[1], corner[2]),
                                    side_of_edge(corner[2], corner[0])};
    // Depth where the ray meets the plane: normal . (corner - begin) / normal . way, the latter being the sum of sides.
    const Vector3<double> normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
    const Slope above{normal.dot(corner[0] - origin_.begin), -normal.dot(by_column_.begin), -normal.dot(by_row_.begin)};
    const Slope toward{normal.dot(origin_.way), normal.dot(by_column_.way), normal.dot(by_row_.way)};
    // Rounding must not open a gap between triangles that share an edge: what is closer than this to an edge is drawn.
    double largest = 0;
    for (const Vector3<double>& x : corner) {
      largest = std::max(largest, (x - origin_.begin).cwiseAbs().maxCoeff());
    }
    const double tolerance = 1e-14 * largest * largest * largest_way_;
    for (Index row = first_row; row <= last_row; ++row) {
      const auto v = static_cast<double>(row);
      for (Index column = first_column; column <= last_column; ++column) {
        const auto u = static_cast<double>(column);
        const double s0 = side[0].at(u, v), s1 = side[1].at(u, v), s2 = side[2].at(u, v);
        const bool inside = (s0 >= -tolerance && s1 >= -tolerance && s2 >= -tolerance) ||
                            (s0 <= tolerance && s1 <= tolerance && s2 <= tolerance);
        if (!inside) {
          continue;
        }
        const double slant = toward.at(u, v);
        if (slant == 0) {
          continue;
        }
        // within the triangle's own depths: a triangle seen along its plane has any depth but for rounding
        const double z = std::clamp(above.at(u, v) / slant, low, high);
        if (z > 0) {
          float& nearest = depth_(row, column);
          nearest = std::min(nearest, static_cast<float>(z));
        }
      }
    }
  }

  // A rounded pixel of the image's neighbourhood as an index.
  static Index clipped(double pixel) noexcept { return static_cast<Index>(std::clamp(pixel, -1.0, 1e6)); }

  static constexpr double slack_px = 1e-6;  // for the rounding of projected corners

  PosedCamera<Camera> camera_;
  double margin_;
  Image<float> depth_;
  Ray origin_{}, by_column_{}, by_row_{};  // for affine rays
  double largest_way_ = 1;
  Eigen::Matrix<double, 6, Eigen::Dynamic> rays_{};  // for others: begin and way of every pixel's
};
static_assert(Occlusion<DepthBuffer<PinholeCamera>>);

}  // namespace decant::inline DECANT_TARGET
