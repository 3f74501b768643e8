// SPDX-License-Identifier: MIT
#pragma once

/// How much liquid two masks show in coarse cells, and how far they differ: evidence that a wrong pixel here and there
/// does not sway.

#include <algorithm>

#include <Eigen/Core>

#include <decant/core/expects.hpp>
#include <decant/core/image.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// Compares silhouettes cell by cell. Pixels are not independent: where a jet is off, so are hundreds of them. In
/// cells that are as large as such errors, what is left of dependence is little.
class SilhouetteCells {
 public:
  using Shares = Eigen::ArrayXXd;

  /// @param cell_px side of a cell, >= 1; those at the right and lower border may be smaller.
  explicit SilhouetteCells(int cell_px = 20) : cell_px_(cell_px) {
    expects(cell_px >= 1, "SilhouetteCells: cell_px", ">= 1", cell_px);
  }

  /// Share of liquid among the pixels of each cell, 0 .. 1.
  Shares shares(const ConstMaskView& mask) const {
    const auto cells = [&](Index pixels) { return (pixels + cell_px_ - 1) / cell_px_; };
    Shares result(cells(mask.rows()), cells(mask.cols()));
    for (Index row = 0; row < result.rows(); ++row) {
      const Index top = row * cell_px_, height = std::min<Index>(cell_px_, mask.rows() - top);
      for (Index column = 0; column < result.cols(); ++column) {
        const Index left = column * cell_px_, width = std::min<Index>(cell_px_, mask.cols() - left);
        const Index liquid = (mask.block(top, left, height, width) >= 128).count();
        result(row, column) = static_cast<double>(liquid) / static_cast<double>(height * width);
      }
    }
    return result;
  }

  /// Sum over cells of the squared difference of their shares; of masks of one size.
  double squared_difference(const ConstMaskView& predicted, const ConstMaskView& observed) const {
    return (shares(predicted) - shares(observed)).square().sum();
  }

 private:
  int cell_px_;
};

}  // namespace decant::inline DECANT_TARGET
