// SPDX-License-Identifier: MIT
#pragma once

/// Observed against predicted silhouettes among the bodies, as pictures and films of a report.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <decant/boundary/bounding_volume_hierarchy.hpp>
#include <decant/camera/depth_buffer.hpp>
#include <decant/camera/pinhole_camera.hpp>
#include <decant/camera/posed_camera.hpp>
#include <decant/core/image.hpp>
#include <decant/core/parallel.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/png.hpp>
#include <decant/io/report.hpp>

#include "tracking_run.hpp"

namespace example::detail {

/// Colours of overlays, by their index in the pictures. Liquid that both have is dark; what they differ in is told
/// apart by brightness, too, for those who see few colours and for printers.
enum OverlayColour : std::uint8_t { background, body, body_edge, both, observed_only, predicted_only };
inline const std::vector<std::array<std::uint8_t, 3>>& overlay_colours() {
  static const std::vector<std::array<std::uint8_t, 3>> colours{{255, 255, 255}, {233, 237, 241}, {178, 187, 197},
                                                                {58, 69, 82},    {245, 158, 11},  {38, 132, 222}};
  return colours;
}

/// A part of an image [px].
struct Region {
  decant::Index top = 0, left = 0, height = 0, width = 0;
};

/// What a film is made of.
struct FilmSource {
  std::string name;
  const std::vector<Overlay>* overlays = nullptr;  ///< by frame
  std::function<std::string(std::size_t)> note{};  ///< of a frame
};

/// What of the image has liquid in any frame of any film, with some of what is around it; all of it if nothing has.
inline Region region_of_liquid(const std::vector<FilmSource>& sources, decant::Index height, decant::Index width) {
  decant::Index top = height, bottom = 0, left = width, right = 0;
  for (const FilmSource& source : sources) {
    for (const Overlay& overlay : *source.overlays) {
      if (overlay.label.size() > 0) {
        top = std::min(top, overlay.top);
        bottom = std::max(bottom, overlay.top + overlay.label.rows());
        left = std::min(left, overlay.left);
        right = std::max(right, overlay.left + overlay.label.cols());
      }
    }
  }
  if (bottom <= top) {
    return {0, 0, height, width};
  }
  const decant::Index margin = 8 + std::max(bottom - top, right - left) / 12;
  top = std::max<decant::Index>(0, top - margin);
  left = std::max<decant::Index>(0, left - margin);
  bottom = std::min(height, bottom + margin);
  right = std::min(width, right + margin);
  return {top, left, bottom - top, right - left};
}

/// Where the bodies are in the picture: flat, with an edge where something far lies beside something near.
inline decant::Image<std::uint8_t> bodies_from_depth(const decant::Image<float>& depth, const Region& region) {
  constexpr float edge = 0.012F;  // [m]: more than a wall seen at a slant changes from pixel to pixel
  decant::Image<std::uint8_t> picture(region.height, region.width);
  for (decant::Index row = 0; row < region.height; ++row) {
    for (decant::Index column = 0; column < region.width; ++column) {
      const decant::Index v = row + region.top, u = column + region.left;
      const float here = depth(v, u);
      bool beside_far = false;
      for (const auto& [dv, du] : {std::pair(-1, 0), std::pair(1, 0), std::pair(0, -1), std::pair(0, 1)}) {
        const decant::Index y = v + dv, x = u + du;
        beside_far =
            beside_far || (y >= 0 && y < depth.rows() && x >= 0 && x < depth.cols() && depth(y, x) > here + edge);
      }
      picture(row, column) = !std::isfinite(here) ? background : beside_far ? body_edge : body;
    }
  }
  return picture;
}

/// The bodies as one of the recording's cameras sees them, frame after frame. @param which its number.
template <class Camera>
std::vector<decant::Image<std::uint8_t>> draw_bodies(const decant::Recording& recording, const Camera& camera,
                                                     const std::vector<std::size_t>& frames, const Region& region,
                                                     decant::Threads threads, std::size_t which) {
  std::vector<decant::BoundingVolumeHierarchy> surfaces;
  for (const auto& each : recording.bodies) {
    surfaces.emplace_back(each.mesh);
  }
  decant::DepthBuffer<Camera> buffer{decant::PosedCamera<Camera>(camera)};
  std::vector<decant::Image<std::uint8_t>> pictures;
  for (const std::size_t frame : frames) {
    buffer.set_camera_pose(recording.cameras[which].view(frame).camera_from_world);
    buffer.clear();
    for (std::size_t k = 0; k < surfaces.size(); ++k) {
      buffer.draw(surfaces[k], recording.bodies[k].motion.at(recording.timestamps[frame]), threads);
    }
    pictures.push_back(bodies_from_depth(buffer.depth(), region));
  }
  return pictures;
}

inline std::vector<decant::Image<std::uint8_t>> draw_bodies(const decant::Recording& recording,
                                                            const std::vector<std::size_t>& frames,
                                                            const Region& region, decant::Threads threads,
                                                            std::size_t which = 0) {
  const auto& view = recording.cameras.at(which).view(0);
  const auto camera = camera_of(view, recording.width, recording.height);
  return view.distorted() ? draw_bodies(recording, camera, frames, region, threads, which)
                          : draw_bodies(recording, camera.pinhole(), frames, region, threads, which);
}

/// The bodies' picture with the liquid on top.
inline decant::PalettePicture overlay_picture(decant::Image<std::uint8_t> bodies, const Overlay& overlay,
                                              const Region& region) {
  constexpr std::array<std::uint8_t, 4> colour{background, observed_only, predicted_only, both};
  for (decant::Index row = 0; row < overlay.label.rows(); ++row) {
    for (decant::Index column = 0; column < overlay.label.cols(); ++column) {
      if (const std::uint8_t label = overlay.label(row, column); label != 0) {
        bodies(row + overlay.top - region.top, column + overlay.left - region.left) = colour[label];
      }
    }
  }
  return {std::move(bodies), overlay_colours()};
}

/// At most `count` of the frames, spread evenly over those in which the camera saw liquid. Where it saw none, over all.
inline std::vector<std::size_t> telling_frames(const std::vector<Overlay>& overlays, std::size_t count) {
  std::vector<std::size_t> candidates, all;
  for (std::size_t frame = 0; frame < overlays.size(); ++frame) {
    const auto& label = overlays[frame].label;
    const auto observed = (label.unaryExpr([](std::uint8_t l) { return std::uint8_t(l & Overlay::observed); }) != 0);
    all.push_back(frame);
    if (observed.count() >= decant::OverlapScoreSettings{}.least_union_px) {
      candidates.push_back(frame);
    }
  }
  candidates = candidates.empty() ? all : candidates;
  std::vector<std::size_t> chosen;
  for (std::size_t k = 0; k < count && !candidates.empty(); ++k) {
    const std::size_t frame = candidates[count < 2 ? 0 : k * (candidates.size() - 1) / (count - 1)];
    if (chosen.empty() || chosen.back() != frame) {
      chosen.push_back(frame);
    }
  }
  return chosen;
}

/// A dash for what is not known; long numbers in groups of three digits.
inline std::string figure(double value, int digits) {
  if (!std::isfinite(value)) {
    return "\u2013";
  }
  std::string text = decant::detail::fixed_text(std::abs(value), digits);
  const bool zero = text.find_first_of("123456789") == std::string::npos;  // after rounding
  const std::size_t whole = std::min(text.find('.'), text.size());
  for (std::size_t k = whole; whole > 4 && k > 3; k -= 3) {
    text.insert(k - 3, "\u202f");
  }
  return (value < 0 && !zero ? "\u2212" : "") + text;
}

inline std::vector<double> times_from_start(const decant::Recording& recording, std::size_t count) {
  std::vector<double> times;
  for (std::size_t frame = 0; frame < count; ++frame) {
    times.push_back(recording.timestamps[frame] - recording.timestamps.front());
  }
  return times;
}

/// Overlays of each film, drawn and packed.
struct Overlays {
  std::vector<std::size_t> frames{};  ///< those that are drawn, by their place among the sources' overlays
  std::vector<decant::HtmlReport::Film> films{};
};

/// @param byte_limit of all pictures as text; where every frame would take more, only every second, third ... is kept.
/// @param recorded the recording's frame of each overlay; empty where it is every frame from the first one on.
inline Overlays draw_overlays(const decant::Recording& recording, decant::Threads threads,
                              const std::vector<FilmSource>& sources, std::size_t byte_limit,
                              std::vector<std::size_t> recorded = {}) {
  Overlays out;
  std::size_t count = 0;
  for (const FilmSource& source : sources) {
    count = std::max(count, source.overlays->size());
  }
  for (std::size_t frame = 0; frame < count; ++frame) {
    out.frames.push_back(frame);
  }
  if (count == 0) {
    return out;
  }
  recorded = recorded.empty() ? out.frames : std::move(recorded);
  const Region region = region_of_liquid(sources, recording.height, recording.width);
  const auto bodies = draw_bodies(recording, recorded, region, threads);
  std::size_t bytes = 0;
  for (const FilmSource& source : sources) {
    decant::HtmlReport::Film film{source.name, {}};
    for (std::size_t frame = 0; frame < count; ++frame) {
      // what stopped early leaves the bodies alone
      const Overlay overlay = frame < source.overlays->size() ? (*source.overlays)[frame] : Overlay();
      const double time = recording.timestamps[recorded[frame]] - recording.timestamps.front();
      film.frames.push_back({time, decant::png_bytes(overlay_picture(bodies[frame], overlay, region)),
                             "frame " + std::to_string(recorded[frame]) + " \u00b7 " + source.note(frame)});
      bytes += (film.frames.back().png.size() + 2) / 3 * 4;
    }
    out.films.push_back(std::move(film));
  }
  if (const std::size_t step = (bytes + byte_limit - 1) / byte_limit; step > 1) {
    const auto thin = [step](auto& list) {
      std::size_t kept = 0;
      for (std::size_t k = 0; k < list.size(); k += step) {
        std::swap(list[kept++], list[k]);
      }
      list.resize(kept);
    };
    thin(out.frames);
    for (auto& film : out.films) {
      thin(film.frames);
    }
  }
  return out;
}

/// The pictures of the films that tell most, by their places in them.
inline std::vector<std::size_t> telling_pictures(const Overlays& overlays, const std::vector<FilmSource>& sources) {
  const std::vector<Overlay>* longest = sources.front().overlays;
  for (const FilmSource& source : sources) {
    longest = source.overlays->size() > longest->size() ? source.overlays : longest;
  }
  std::vector<Overlay> shown;
  for (const std::size_t frame : overlays.frames) {
    shown.push_back((*longest)[frame]);
  }
  return telling_frames(shown, 6);
}

/// @param what the pictures show.
inline void add_overlays(decant::HtmlReport& report, const decant::Recording& recording, const std::string& what,
                         const Overlays& overlays, const std::vector<std::size_t>& chosen) {
  const auto& colours = overlay_colours();
  report.legend({{"liquid in both", colours[both]},
                 {"observed, not predicted", colours[observed_only]},
                 {"predicted, not observed", colours[predicted_only]},
                 {"bodies", colours[body]}});
  const std::size_t step = overlays.frames.size() > 1 ? overlays.frames[1] : 1;
  report.films(overlays.films,
               what + (recording.cameras.size() > 1 ? ", first camera" : "") +
                   (step > 1 ? ", one frame in " + std::to_string(step) : "") +
                   ". The arrow keys go from frame to frame; the dotted line in the charts marks the time, and a click "
                   "on a chart goes there.",
               chosen[chosen.size() / 2]);
}

inline void add_chosen_frames(decant::HtmlReport& report, const Overlays& overlays,
                              const std::vector<FilmSource>& sources, const std::vector<std::size_t>& chosen) {
  std::vector<std::string> columns;
  for (const std::size_t k : chosen) {
    columns.push_back(figure(overlays.films.front().frames[k].time, 2) + " s");
  }
  std::vector<decant::HtmlReport::GridRow> rows;
  for (std::size_t film = 0; film < sources.size(); ++film) {
    decant::HtmlReport::GridRow row{sources[film].name, {}};
    for (const std::size_t k : chosen) {
      row.cells.push_back({overlays.films[film].frames[k].png, sources[film].note(overlays.frames[k]),
                           decant::HtmlReport::film_link(film, k)});
    }
    rows.push_back(std::move(row));
  }
  report.grid(columns, rows, "Frames spread over those in which liquid was seen; a click takes the film there.");
}

}  // namespace example::detail
