// SPDX-License-Identifier: MIT
#pragma once

/// Which containers hypotheses can be simulated and judged for one by one: those that cannot share liquid, and whose
/// liquid the cameras see in different places.

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <span>
#include <utility>
#include <vector>

#include <decant/boundary/concept.hpp>
#include <decant/camera/concept.hpp>
#include <decant/camera/posed_camera.hpp>
#include <decant/core/expects.hpp>
#include <decant/core/pixel_box.hpp>
#include <decant/core/target.hpp>
#include <decant/hypothesis/independent_groups.hpp>

namespace decant::inline DECANT_TARGET {

/// Sources whose hypotheses have to be combined with each other, and with no others.
struct HypothesisGroup {
  std::vector<std::size_t> sources{};  ///< by their places in the list that was given, in order
  IndependentGroup scene{};
  std::vector<PixelBox> pixels{};  ///< by camera, where its liquid may be seen; no other group's may there
};

namespace detail {

/// The box made of whole cells, but for those that the image's border cuts.
inline PixelBox whole_cells(const PixelBox& box, const PixelBox& image, int cell_px) {
  const auto down = [&](int pixel) { return pixel / cell_px * cell_px; };
  const auto up = [&](int pixel) { return down(pixel + cell_px - 1); };
  return box.empty() ? PixelBox{}
                     : PixelBox{down(box.u_begin), down(box.v_begin), up(box.u_end), up(box.v_end)}.intersection(image);
}

}  // namespace detail

/// Groups of sources by independent_groups; groups that some camera sees in the same cells are one as well, since what
/// is seen there could be either's. Where all are one, nothing is gained over every combination of hypotheses, and
/// nothing is lost.
/// @param bodies,sources,settings see independent_groups. @param cameras those of the trackers, in their order, which
/// stand still. @param cell_px that of HypothesisFilter, >= 1: groups have whole cells.
/// @return groups in the order of their first source. Throws std::invalid_argument as independent_groups does, and if a
/// source is named twice.
template <class Bodies, CameraModel Camera>
std::vector<HypothesisGroup> hypothesis_groups(const Bodies& bodies, std::span<const BodyId> sources,
                                               const IndependentGroupsSettings& settings,
                                               std::span<const PosedCamera<Camera>> cameras, int cell_px = 20) {
  expects(cell_px >= 1, "hypothesis_groups: cell_px", ">= 1", cell_px);
  for (std::size_t k = 0; k < sources.size(); ++k) {
    expects(std::find(sources.begin(), sources.begin() + static_cast<std::ptrdiff_t>(k), sources[k]) ==
                sources.begin() + static_cast<std::ptrdiff_t>(k),
            "hypothesis_groups: source", "named once", sources[k]);
  }
  std::vector<HypothesisGroup> groups;
  for (IndependentGroup& scene : independent_groups(bodies, sources, settings)) {
    HypothesisGroup group;
    for (std::size_t k = 0; k < sources.size(); ++k) {
      if (std::find(scene.bodies.begin(), scene.bodies.end(), sources[k]) != scene.bodies.end()) {
        group.sources.push_back(k);
      }
    }
    for (const PosedCamera<Camera>& camera : cameras) {
      group.pixels.push_back(
          detail::whole_cells(pixels_of(scene, camera), {0, 0, camera.width(), camera.height()}, cell_px));
    }
    group.scene = std::move(scene);
    groups.push_back(std::move(group));
  }
  const auto seen_together = [](const HypothesisGroup& a, const HypothesisGroup& b) {
    for (std::size_t camera = 0; camera < a.pixels.size(); ++camera) {
      if (!a.pixels[camera].intersection(b.pixels[camera]).empty()) {
        return true;
      }
    }
    return false;
  };
  const auto join = [](HypothesisGroup& into, const HypothesisGroup& other) {
    const auto unite = [](auto& all, const auto& more) {
      auto both = all;
      both.clear();
      std::set_union(all.begin(), all.end(), more.begin(), more.end(), std::back_inserter(both));
      all = std::move(both);
    };
    unite(into.sources, other.sources);
    unite(into.scene.bodies, other.scene.bodies);
    into.scene.reach.extend(other.scene.reach);
    for (std::size_t camera = 0; camera < into.pixels.size(); ++camera) {
      into.pixels[camera] = into.pixels[camera].hull(other.pixels[camera]);
    }
  };
  for (bool joined = true; joined;) {
    joined = false;
    for (std::size_t a = 0; a < groups.size() && !joined; ++a) {
      for (std::size_t b = a + 1; b < groups.size() && !joined; ++b) {
        if (seen_together(groups[a], groups[b])) {
          join(groups[a], groups[b]);
          groups.erase(groups.begin() + static_cast<std::ptrdiff_t>(b));
          joined = true;
        }
      }
    }
  }
  return groups;
}

}  // namespace decant::inline DECANT_TARGET
