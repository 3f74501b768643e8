// SPDX-License-Identifier: MIT
#pragma once

/// What decant asks of whoever knows which points a camera cannot see for bodies in between.

#include <cassert>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

#include <decant/core/parallel.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Knows a camera, its pose, and the bodies before it. hidden(x_in_world [m]) says whether a body stands between the
/// camera and the point, on the point's line of sight: from where sight begins (CameraModel::unproject(pixel, 0)) to
/// the point. False where the camera cannot project the point; whether it lies in the image is the camera's to say. A
/// surface that the point touches does not hide it: how near is touching is the part's own setting. May not throw or
/// allocate, and may be called from any thread while nothing is changed. Laws: decant/testing/camera.hpp.
template <class O>
concept Occlusion = requires(const O& occlusion, const Vector3<double>& x_in_world) {
  { occlusion.hidden(x_in_world) } noexcept -> std::same_as<bool>;
};

namespace detail {

template <class OcclusionType, class Scalar>
void find_hidden(const OcclusionType& occlusion, const ConstPointsView<Scalar>& position, Threads threads,
                 std::span<std::uint8_t> hidden) noexcept {
  static_assert(Occlusion<OcclusionType>,
                "find_hidden: the occlusion must model decant::Occlusion, see <decant/camera/occlusion_concept.hpp>");
  assert(static_cast<Index>(hidden.size()) == position.cols());
  parallel_for(position.cols(), threads, [&](Index i) {
    const Vector3<double> x = position.col(i).template cast<double>();
    hidden[static_cast<std::size_t>(i)] = occlusion.hidden(x) ? 1 : 0;
  });
}

}  // namespace detail

/// hidden[i] = 1 where point i is hidden, else 0, whatever the number of threads. Allocates nothing.
/// @param position 3xN [m], world frame. @param hidden N entries.
template <class OcclusionType>
void find_hidden(const OcclusionType& occlusion, const ConstPointsView<double>& position, Threads threads,
                 std::span<std::uint8_t> hidden) noexcept {
  detail::find_hidden<OcclusionType, double>(occlusion, position, threads, hidden);
}

/// The same for points in float.
template <class OcclusionType>
void find_hidden(const OcclusionType& occlusion, const ConstPointsView<float>& position, Threads threads,
                 std::span<std::uint8_t> hidden) noexcept {
  detail::find_hidden<OcclusionType, float>(occlusion, position, threads, hidden);
}

}  // namespace decant::inline DECANT_TARGET
