// SPDX-License-Identifier: MIT
#pragma once

/// Which points bodies hide from a camera: one ray for each point, against the bodies' surfaces.

#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <decant/boundary/body_shape.hpp>
#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/camera/concept.hpp>
#include <decant/camera/detail/line_of_sight.hpp>
#include <decant/camera/detail/sight_memory.hpp>
#include <decant/camera/occlusion_concept.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/camera/posed_camera.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/parallel.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Sight lines against bounding-volume hierarchies (Schenck and Fox 2017, section IV). Rays go into each body's frame,
/// so a body that moves costs a pose and nothing is built anew. Exact for every camera; surfaces hide from both sides.
/// Set-up allocates; poses and questions do not, but for find_hidden while the number of points grows. Shares the
/// surfaces. Leave out bodies that can be looked through.
template <class CameraType>
class RayOcclusion {
 public:
  using Camera = CameraType;

  /// @param margin [m], >= 0: a surface that a sight line meets within this distance of its point does not hide it, as
  /// poses and meshes are never so exact that a drop on the camera's side of a wall is not sometimes a little inside of
  /// it. Keep it below the thickness of walls: liquid behind a wall is then hidden by the wall's front, however closely
  /// it lies against the back. Along the sight line, thus less across a wall that is seen at a slant.
  /// Throws std::invalid_argument.
  explicit RayOcclusion(PosedCamera<Camera> camera, double margin = 1e-3)
      : camera_(std::move(camera)), margin_(margin), memory_(camera_.camera()) {
    expects(margin >= 0 && std::isfinite(margin), "RayOcclusion: margin [m]", ">= 0 and finite", margin);
  }

  /// Takes one more body, built before or shared with a simulation. The number that is returned counts up from 0.
  /// Throws std::invalid_argument if there is no surface.
  std::uint32_t add(std::shared_ptr<const BoundingVolumeHierarchy> surface, const Pose& world_from_body = {}) {
    expects(surface != nullptr, "RayOcclusion: surface of a body", "given", "none");
    memory_.add(*surface);
    bodies_.push_back({std::move(surface), world_from_body, {}});
    drawn_ = false;
    const auto body = static_cast<std::uint32_t>(bodies_.size() - 1);
    set_pose(body, world_from_body);
    return body;
  }

  /// Takes one more body of any shape; shapes of formulas hide by their meshes.
  std::uint32_t add(const BodyShape& shape, const Pose& world_from_body = {}) {
    return add(std::make_shared<const BoundingVolumeHierarchy>(shape.mesh), world_from_body);
  }

  /// Takes all bodies of a simulation, such as RigidBodies, where they are at a time [s]. On an occlusion that had no
  /// bodies yet, they keep their numbers.
  template <class Bodies>
  requires requires(const Bodies& bodies) { bodies[std::uint32_t{}].surface; }
  void add_bodies(const Bodies& bodies, double time) {
    for (std::uint32_t body = 0; body < bodies.size(); ++body) {
      add(bodies[body].surface, bodies[body].motion.at(time));
    }
  }

  /// Moves all bodies that add_bodies took from the same simulation to where they are at a time [s]. Needs an occlusion
  /// that has no others before them.
  template <class Bodies>
  void follow(const Bodies& bodies, double time) noexcept {
    for (std::uint32_t body = 0; body < bodies.size() && body < bodies_.size(); ++body) {
      set_pose(body, bodies[body].motion.at(time));
    }
  }

  void set_pose(std::uint32_t body, const Pose& world_from_body) noexcept {
    assert(body < bodies_.size());
    const Eigen::Isometry3d body_from_camera =
        detail::isometry_of(world_from_body).inverse() * detail::isometry_of(camera_.camera_from_world()).inverse();
    drawn_ = drawn_ && body_from_camera.matrix() == bodies_[body].body_from_camera.matrix();
    bodies_[body].world_from_body = world_from_body;
    bodies_[body].body_from_camera = body_from_camera;
  }

  void set_camera_pose(const Pose& camera_from_world) noexcept {
    camera_.set_pose(camera_from_world);
    for (std::uint32_t body = 0; body < bodies_.size(); ++body) {
      set_pose(body, bodies_[body].world_from_body);
    }
  }

  bool hidden(const Vector3<double>& x_in_world) const noexcept {
    SightLine line;
    return line_to(x_in_world, line) && first_to_hide(line) != nullptr;
  }

  /// As the function of this name, for many points frame after frame: remembers what earlier sight lines met, which
  /// makes most questions cheap and changes no answer. hidden[i] = 1 where point i is hidden, else 0, whatever the
  /// number of threads. Allocates only while the number of points grows.
  /// @param position 3xN [m], world frame. @param hidden N entries.
  void find_hidden(const ConstPointsView<float>& position, Threads threads, std::span<std::uint8_t> hidden) noexcept {
    find_hidden_from_memory<float>(position, threads, hidden);
  }
  void find_hidden(const ConstPointsView<double>& position, Threads threads, std::span<std::uint8_t> hidden) noexcept {
    find_hidden_from_memory<double>(position, threads, hidden);
  }

  /// Whether a body's surface stands between two points of the world.
  bool blocked(const Vector3<double>& from, const Vector3<double>& to) const noexcept {
    const Vector3<double> a = camera_.to_camera(from), b = camera_.to_camera(to);
    for (const Body& body : bodies_) {
      if (body.surface->any_hit(body.body_from_camera * a, body.body_from_camera * b)) {
        return true;
      }
    }
    return false;
  }

  /// Depth of the first surface that a pixel's sight line meets [m], nothing if it meets none.
  std::optional<double> first_wall(const Eigen::Vector2d& pixel) const noexcept {
    const Vector3<double> begin = camera_.camera().unproject(pixel, 0);
    const Vector3<double> way = camera_.camera().unproject(pixel, 1) - begin;
    std::optional<double> first;
    for (const Body& body : bodies_) {
      const double limit = first ? *first : detail::deepest(*body.surface, body.body_from_camera);
      if (limit > 0) {
        if (const auto depth = detail::first_depth(*body.surface, body.body_from_camera, begin, way, limit)) {
          first = depth;
        }
      }
    }
    return first;
  }

  const PosedCamera<Camera>& camera() const noexcept { return camera_; }
  double margin() const noexcept { return margin_; }
  std::size_t size() const noexcept { return bodies_.size(); }

 private:
  struct Body {
    std::shared_ptr<const BoundingVolumeHierarchy> surface;
    Pose world_from_body;
    Eigen::Isometry3d body_from_camera;
  };

  /// The part of a point's sight line on which a surface hides it, in the camera's frame.
  struct SightLine {
    Eigen::Vector2d pixel;
    Vector3<double> begin, end;  ///< from where sight begins to near the point [m]
  };

  /// What a sight line met that memory did not know of.
  struct Fresh {
    Eigen::Vector2d pixel;
    std::uint32_t body, triangle;  ///< the triangle by its index in the body's mesh
  };

  /// False if nothing can hide the point.
  bool line_to(const Vector3<double>& x_in_world, SightLine& line) const noexcept {
    const Vector3<double> x = camera_.to_camera(x_in_world);
    const Projection seen = camera_.camera().project(x);
    if (!seen.projected()) {
      return false;
    }
    line.pixel = seen.pixel;
    line.begin = camera_.camera().unproject(seen.pixel, 0);
    const Vector3<double> back = line.begin - x;
    const double length = back.norm();
    if (!(length > margin_)) {
      return false;
    }
    line.end = x + (margin_ / length) * back;
    return true;
  }

  const Body* first_to_hide(const SightLine& line) const noexcept {
    for (const Body& body : bodies_) {
      if (body.surface->any_hit(body.body_from_camera * line.end, body.body_from_camera * line.begin)) {
        return &body;
      }
    }
    return nullptr;
  }

  /// @param met what is to be remembered of the line, if anything.
  bool hidden_by_memory(const SightLine& line, Fresh& met) const noexcept {
    const bool from_origin = line.begin.isZero(0);
    if (from_origin && memory_.clear_to(line.end)) {
      return false;
    }
    if (from_origin && memory_.in_known_shadow(line.pixel, line.end)) {
      return true;
    }
    const Body* const body = first_to_hide(line);
    if (body == nullptr) {
      return false;
    }
    if (from_origin) {
      // the first from the camera hides all that is behind it
      if (const auto hit =
              body->surface->first_hit(body->body_from_camera * line.begin, body->body_from_camera * line.end)) {
        met = {line.pixel, static_cast<std::uint32_t>(body - bodies_.data()), hit->triangle};
      }
    }
    return true;
  }

  template <class Scalar>
  void find_hidden_from_memory(const ConstPointsView<Scalar>& position, Threads threads,
                               std::span<std::uint8_t> hidden) noexcept {
    assert(static_cast<Index>(hidden.size()) == position.cols());
    if (!drawn_) {
      memory_.clear();
      for (std::uint32_t body = 0; body < bodies_.size(); ++body) {
        memory_.draw(body, bodies_[body].body_from_camera.inverse());
      }
      drawn_ = true;
    }
    fresh_.resize(hidden.size());
    parallel_for(position.cols(), threads, [&](Index i) {
      const auto own = static_cast<std::size_t>(i);
      Fresh& fresh = fresh_[own];
      fresh.body = detail::SightMemory::nothing;
      SightLine line;
      hidden[own] = line_to(position.col(i).template cast<double>(), line) && hidden_by_memory(line, fresh) ? 1 : 0;
    });
    for (const Fresh& fresh : fresh_) {
      if (fresh.body != detail::SightMemory::nothing) {
        memory_.remember(fresh.pixel, fresh.body, fresh.triangle);
      }
    }
  }

  PosedCamera<Camera> camera_;
  double margin_;
  std::vector<Body> bodies_{};
  detail::SightMemory memory_;
  bool drawn_ = false;  ///< whether memory_ has the bodies where they are
  std::vector<Fresh> fresh_{};
};
static_assert(Occlusion<RayOcclusion<PinholeCamera>>);

}  // namespace decant::inline DECANT_TARGET
