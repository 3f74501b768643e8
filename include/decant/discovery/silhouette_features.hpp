// SPDX-License-Identifier: MIT
#pragma once

/// Numbers by which interactions are compared: how much liquid is where in the picture, and when.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/pixel_box.hpp>
#include <decant/core/target.hpp>
#include <decant/discovery/silhouette_series.hpp>
#include <decant/discovery/time_windows.hpp>

namespace decant::inline DECANT_TARGET {

/// Settings of SilhouetteFeatures.
struct SilhouetteFeatureSettings {
  int pooled_cells = 2;       ///< cells of the series along the side of a feature's, >= 1
  double window = 0.133;      ///< for how long a feature's share is averaged [s], > 0
  double least_share = 0.02;  ///< below it in all of the series there is no feature, >= 0
};

/// The mean share of liquid of each square of a picture over each window of time, of all cameras, wherever a recording
/// or one of its simulations shows liquid at all. Frames that the recording's camera did not see are left out of
/// simulations too; a window without any frame is none.
class SilhouetteFeatures {
 public:
  using Series = std::vector<SilhouetteSeries>;  ///< by camera

  /// Where and when a feature is.
  struct Place {
    std::size_t camera;
    int row, column;    ///< of the square, counted in squares
    int window;         ///< counted from the first frame
    PixelBox box;       ///< of the square, which may reach beyond the image's border [px]
    double begin, end;  ///< times of the window's first and last frame that was seen [s]
  };

  /// @param recording by camera. @param simulations of the same cameras and frames.
  /// Throws std::invalid_argument if a setting is out of range, or series do not fit.
  SilhouetteFeatures(const Series& recording, std::span<const Series> simulations,
                     const SilhouetteFeatureSettings& settings = {})
      : settings_(settings) {
    expects(settings.pooled_cells >= 1, "SilhouetteFeatures: pooled_cells", ">= 1", settings.pooled_cells);
    expects(settings.window > 0 && std::isfinite(settings.window), "SilhouetteFeatures: window [s]", "> 0",
            settings.window);
    expects(settings.least_share >= 0, "SilhouetteFeatures: least_share", ">= 0", settings.least_share);
    for (std::size_t camera = 0; camera < recording.size(); ++camera) {
      const SilhouetteSeries& own = recording[camera];
      views_.push_back({rows_of(own), columns_of(own), own.frames(), windows_of(own)});
    }
    std::vector<Eigen::VectorXd> most;  // by camera, of all squares and windows
    for (std::size_t camera = 0; camera < recording.size(); ++camera) {
      most.push_back(pooled(recording[camera], views_[camera]));
    }
    for (const Series& simulation : simulations) {
      check(simulation);
      for (std::size_t camera = 0; camera < recording.size(); ++camera) {
        most[camera] = most[camera].cwiseMax(pooled(simulation[camera], views_[camera]));
      }
    }
    for (std::size_t camera = 0; camera < recording.size(); ++camera) {
      place_features(camera, recording[camera], most[camera]);
    }
  }

  std::size_t size() const noexcept { return places_.size(); }
  const Place& place(std::size_t feature) const { return places_.at(feature); }

  /// Whether a series has the recording's cameras, cells and frames.
  bool fit(const Series& series) const noexcept {
    bool all = series.size() == views_.size();
    for (std::size_t camera = 0; all && camera < views_.size(); ++camera) {
      all = series[camera].frames() == views_[camera].frames && rows_of(series[camera]) == views_[camera].rows &&
            columns_of(series[camera]) == views_[camera].columns;
    }
    return all;
  }

  /// Of the recording or a simulation. Throws std::invalid_argument if its cameras or frames are others.
  Eigen::VectorXd of(const Series& series) const {
    check(series);
    Eigen::VectorXd result(static_cast<Eigen::Index>(size()));
    Eigen::Index filled = 0;
    for (std::size_t camera = 0; camera < views_.size(); ++camera) {
      const Eigen::VectorXd all = pooled(series[camera], views_[camera]);
      for (const Eigen::Index which : views_[camera].chosen) {
        result[filled++] = all[which];
      }
    }
    return result;
  }

  /// By feature, whether a series' cameras saw all frames of it. Throws as of() does.
  std::vector<bool> seen_in(const Series& series) const {
    check(series);
    std::vector<bool> result;
    for (std::size_t camera = 0; camera < views_.size(); ++camera) {
      const View& view = views_[camera];
      for (const Eigen::Index which : view.chosen) {
        const Window& window = view.windows[static_cast<std::size_t>(which / (view.rows * view.columns))];
        result.push_back(std::all_of(window.frames.begin(), window.frames.end(),
                                     [&](std::size_t frame) { return series[camera].seen(frame); }));
      }
    }
    return result;
  }

 private:
  struct Window {
    int number;                       ///< windows that nothing was seen in have none of these
    std::vector<std::size_t> frames;  ///< that the recording's camera saw
  };
  struct View {
    Eigen::Index rows, columns;  ///< squares
    std::size_t frames;
    std::vector<Window> windows;
    std::vector<Eigen::Index> chosen{};  ///< of windows x rows x columns, those that are features
  };

  Eigen::Index rows_of(const SilhouetteSeries& series) const {
    return (series.rows() + settings_.pooled_cells - 1) / settings_.pooled_cells;
  }
  Eigen::Index columns_of(const SilhouetteSeries& series) const {
    return (series.columns() + settings_.pooled_cells - 1) / settings_.pooled_cells;
  }

  std::vector<Window> windows_of(const SilhouetteSeries& recording) const {
    std::vector<Window> windows;
    for (std::size_t frame = 0; frame < recording.frames(); ++frame) {
      const int number = window_number(recording.time(frame) - recording.time(0), settings_.window);
      if (recording.seen(frame)) {
        if (windows.empty() || windows.back().number != number) {
          windows.push_back({number, {}});
        }
        windows.back().frames.push_back(frame);
      }
    }
    return windows;
  }

  /// The mean share of each square in each window; what is beyond the border counts as dry.
  Eigen::VectorXd pooled(const SilhouetteSeries& series, const View& view) const {
    const Eigen::Index squares = view.rows * view.columns;
    Eigen::VectorXd mean(static_cast<Eigen::Index>(view.windows.size()) * squares);
    for (std::size_t w = 0; w < view.windows.size(); ++w) {
      Eigen::VectorXd inside = Eigen::VectorXd::Zero(squares);
      for (const std::size_t frame : view.windows[w].frames) {
        for (Eigen::Index row = 0; row < series.rows(); ++row) {
          for (Eigen::Index column = 0; column < series.columns(); ++column) {
            inside[row / settings_.pooled_cells * view.columns + column / settings_.pooled_cells] +=
                static_cast<double>(series.share(frame, row, column));
          }
        }
      }
      const double of =
          settings_.pooled_cells * settings_.pooled_cells * static_cast<double>(view.windows[w].frames.size());
      mean.segment(static_cast<Eigen::Index>(w) * squares, squares) = inside / of;
    }
    return mean;
  }

  void place_features(std::size_t camera, const SilhouetteSeries& recording, const Eigen::VectorXd& most) {
    View& view = views_[camera];
    const Eigen::Index squares = view.rows * view.columns;
    const int side = settings_.pooled_cells * recording.cell_px();
    for (Eigen::Index which = 0; which < most.size(); ++which) {
      if (most[which] > settings_.least_share) {
        view.chosen.push_back(which);
        const Window& window = view.windows[static_cast<std::size_t>(which / squares)];
        const int row = static_cast<int>(which % squares / view.columns);
        const int column = static_cast<int>(which % view.columns);
        places_.push_back({camera, row, column, window.number,
                           PixelBox{column * side, row * side, (column + 1) * side, (row + 1) * side},
                           recording.time(window.frames.front()), recording.time(window.frames.back())});
      }
    }
  }

  void check(const Series& series) const {
    expects(series.size() == views_.size(), "SilhouetteFeatures: cameras", "those of the recording", series.size());
    expects(fit(series), "SilhouetteFeatures: frames and cells", "those of the recording",
            series.empty() ? 0 : series.front().frames());
  }

  SilhouetteFeatureSettings settings_;
  std::vector<View> views_{};
  std::vector<Place> places_{};
};

}  // namespace decant::inline DECANT_TARGET
