// SPDX-License-Identifier: MIT
// A camera whose project may throw, given a pose.
// expect: PosedCamera: Camera must model decant::CameraModel, see <decant/camera/concept.hpp>
// expect: camera.project(x_in_camera)
#include <decant/camera/pinhole_camera.hpp>
#include <decant/camera/posed_camera.hpp>

struct Camera : decant::PinholeCamera {
  using decant::PinholeCamera::PinholeCamera;
#ifdef DECANT_TWIN
  decant::Projection project(const decant::Vector3<double>& x) const noexcept { return PinholeCamera::project(x); }
#else
  decant::Projection project(const decant::Vector3<double>& x) const { return PinholeCamera::project(x); }
#endif
};
static_assert(sizeof(decant::PosedCamera<Camera>) > 0);
