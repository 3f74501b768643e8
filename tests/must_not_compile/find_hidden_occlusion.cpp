// SPDX-License-Identifier: MIT
// An occlusion that answers with a number instead of yes or no.
// expect: find_hidden: the occlusion must model decant::Occlusion, see <decant/camera/occlusion_concept.hpp>
// expect: occlusion.hidden(x_in_world)
#include <vector>

#include <decant/camera/occlusion_concept.hpp>

struct Occlusion {
#ifdef DECANT_TWIN
  bool hidden(const decant::Vector3<double>&) const noexcept { return false; }
#else
  double hidden(const decant::Vector3<double>&) const noexcept { return 0.5; }
#endif
};

inline void ask(const decant::PointArray<double>& points, std::vector<std::uint8_t>& hidden) {
  decant::find_hidden(Occlusion{}, points, decant::Threads{1}, hidden);
}
