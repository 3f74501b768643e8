// SPDX-License-Identifier: MIT
#pragma once

/// Which containers cannot share liquid, so that what is in one says nothing about what is in another: hypotheses about
/// n amounts in one and m in the other then take n + m simulations and not n x m (the question that Schenck and Fox
/// 2017, section VII, leave open).

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include <decant/boundary/concept.hpp>
#include <decant/camera/concept.hpp>
#include <decant/camera/posed_camera.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/pixel_box.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Bodies that may share liquid, and where that liquid can get.
struct IndependentGroup {
  std::vector<BodyId> bodies{};     ///< in order; those that no liquid can reach are in no group
  Eigen::AlignedBox3d reach{};      ///< box in the frame `axes` [m]
  Matrix3<double> axes_from_world;  ///< rotation to axes of which the last points up
};

struct IndependentGroupsSettings {
  Vector3<double> gravity{0, 0, -9.81};  ///< [m/s^2], other than zero
  double begin = 0, end = 0;             ///< of the time in which bodies move [s]
  double samples_per_second = 50;        ///< at which their motion is looked at, > 0
  /// Bodies closer than this to where liquid may get count as reached [m], >= 0.
  double margin = 0.01;
};

namespace detail {

/// Where a body is during all of its motion, as a box; and its largest speed [m/s].
struct SweptBody {
  Eigen::AlignedBox3d box;
  double speed = 0;
  double extent = 0;  ///< its diagonal [m]: no column of liquid in it is higher
};

template <class Body>
SweptBody swept(const Body& body, const Matrix3<double>& axes, const IndependentGroupsSettings& settings) {
  SweptBody result;
  const Eigen::AlignedBox3d bounds = body.surface->bounds();
  result.extent = bounds.diagonal().norm();
  const int steps =
      std::max(1, static_cast<int>(std::ceil((settings.end - settings.begin) * settings.samples_per_second)));
  std::vector<Vector3<double>> before(8), now(8);
  double time_before = 0;
  for (int k = 0; k <= steps; ++k) {
    const double time = settings.begin + (settings.end - settings.begin) * k / steps;
    const Pose pose = body.motion.at(time);
    for (int corner = 0; corner < 8; ++corner) {
      const auto place = static_cast<std::size_t>(corner);
      now[place] = axes * (pose * Vector3<double>(bounds.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner))));
      result.box.extend(now[place]);
      if (k > 0 && time > time_before) {
        result.speed = std::max(result.speed, (now[place] - before[place]).norm() / (time - time_before));
      }
    }
    before = now;
    time_before = time;
  }
  return result;
}

/// How far liquid flies that leaves at `speed` in whatever direction and falls by `drop`: the range of a projectile,
/// v / g sqrt(v^2 + 2 g drop).
inline double farthest_flight(double speed, double drop, double gravity) {
  return speed / gravity * std::sqrt(speed * speed + 2 * gravity * drop);
}

inline Eigen::AlignedBox3d widened(Eigen::AlignedBox3d box, double by) {
  box.min().head<2>().array() -= by;
  box.max().head<2>().array() += by;
  return box;
}

}  // namespace detail

/// Groups the bodies of a scene by whether liquid of one can get to the other. Liquid leaves a body that holds some at
/// no more than the speed of a jet below the highest column it can hold (Torricelli) and the body's own speed together,
/// and flies as a projectile down to the lowest point of the scene; what it meets there it may be caught by. Bodies are
/// taken for their bounding boxes, so that groups may be found together that are not, but never the other way round
/// (but for liquid that bounces off a body that is not below a source).
/// @param bodies size(), and for each number `surface` (pointer to a BoundingVolumeHierarchy) and `motion` (PoseTrack),
/// as RigidBodies has them. @param sources those that hold liquid at the beginning.
/// @return a group for each source, or several sources in one; in the order of their first source.
/// Throws std::invalid_argument if gravity is zero, the time is none, or a source does not exist.
template <class Bodies>
std::vector<IndependentGroup> independent_groups(const Bodies& bodies, std::span<const BodyId> sources,
                                                 const IndependentGroupsSettings& settings) {
  const double gravity = settings.gravity.norm();
  expects(gravity > 0 && std::isfinite(gravity), "independent_groups: gravity [m/s^2]", "finite, other than zero",
          settings.gravity.transpose());
  expects(std::isfinite(settings.begin) && settings.end >= settings.begin && std::isfinite(settings.end),
          "independent_groups: end [s]", "finite, not before begin", settings.end);
  expects(settings.samples_per_second > 0 && std::isfinite(settings.samples_per_second),
          "independent_groups: samples_per_second", "> 0", settings.samples_per_second);
  expects(settings.margin >= 0 && std::isfinite(settings.margin), "independent_groups: margin [m]", ">= 0",
          settings.margin);
  for (const BodyId source : sources) {
    expects(source < bodies.size(), "independent_groups: source", "a body that exists", source);
  }
  const Matrix3<double> axes =
      Eigen::Quaterniond::FromTwoVectors(-settings.gravity, Vector3<double>::UnitZ()).toRotationMatrix();
  std::vector<detail::SweptBody> swept;
  double lowest = 0;
  for (std::size_t body = 0; body < bodies.size(); ++body) {
    swept.push_back(detail::swept(bodies[static_cast<BodyId>(body)], axes, settings));
    lowest = body == 0 ? swept[0].box.min().z() : std::min(lowest, swept[body].box.min().z());
  }

  std::vector<IndependentGroup> groups;
  for (const BodyId source : sources) {
    const detail::SweptBody& from = swept[source];
    const double speed = std::sqrt(2 * gravity * from.extent) + from.speed;
    IndependentGroup group;
    group.axes_from_world = axes;
    group.reach = detail::widened(
        from.box, settings.margin + detail::farthest_flight(speed, from.box.max().z() - lowest, gravity));
    group.reach.min().z() = lowest;
    group.reach.max().z() += speed * speed / (2 * gravity);  // as high as it can rise
    for (std::size_t body = 0; body < swept.size(); ++body) {
      if (group.reach.intersects(swept[body].box)) {
        group.bodies.push_back(static_cast<BodyId>(body));
      }
    }
    groups.push_back(std::move(group));
  }
  // those that meet, or meet the same body, are one
  const auto meet = [](const IndependentGroup& a, const IndependentGroup& b) {
    return a.reach.intersects(b.reach) ||
           std::find_first_of(a.bodies.begin(), a.bodies.end(), b.bodies.begin(), b.bodies.end()) != a.bodies.end();
  };
  for (bool merged = true; merged;) {
    merged = false;
    for (std::size_t a = 0; a < groups.size() && !merged; ++a) {
      for (std::size_t b = a + 1; b < groups.size() && !merged; ++b) {
        if (!meet(groups[a], groups[b])) {
          continue;
        }
        groups[a].reach.extend(groups[b].reach);
        std::vector<BodyId> both;
        std::set_union(groups[a].bodies.begin(), groups[a].bodies.end(), groups[b].bodies.begin(),
                       groups[b].bodies.end(), std::back_inserter(both));
        groups[a].bodies = std::move(both);
        groups.erase(groups.begin() + static_cast<std::ptrdiff_t>(b));
        merged = true;
      }
    }
  }
  return groups;
}

/// The pixels in which a group's liquid may be seen; empty if it is out of the picture, the whole image if the camera
/// stands within reach.
template <CameraModel Camera>
PixelBox pixels_of(const IndependentGroup& group, const PosedCamera<Camera>& camera) {
  const PixelBox image{0, 0, camera.camera().width(), camera.camera().height()};
  const Matrix3<double> world_from_axes = group.axes_from_world.transpose();
  Eigen::AlignedBox2d pixels;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3<double> x =
        world_from_axes * Vector3<double>(group.reach.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)));
    const auto seen = camera.project(x);
    if (!seen.projected()) {
      return image;
    }
    pixels.extend(seen.pixel);
  }
  const auto clamped = [](double pixel, int size) { return static_cast<int>(std::clamp(pixel, 0.0, double(size))); };
  return PixelBox{
      clamped(std::floor(pixels.min().x()), image.u_end), clamped(std::floor(pixels.min().y()), image.v_end),
      clamped(std::ceil(pixels.max().x()) + 1, image.u_end), clamped(std::ceil(pixels.max().y()) + 1, image.v_end)};
}

}  // namespace decant::inline DECANT_TARGET
