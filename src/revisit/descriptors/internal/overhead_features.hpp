// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include <Eigen/Core>

#include <revisit/core/scan.hpp>

namespace revisit::descriptors_internal {

/// A square seen from above, centred on the sensor.
struct OverheadGrid {
  int cells;  ///< along a side
  float reach_m;
};

/// The cells that hold points, in metres, and what is known of each (channels x cells).
struct OverheadCells {
  Eigen::Matrix2Xf centres;
  Eigen::MatrixXf features;
};

/// One channel, 1 where there are points; those below `lowest_m` do not count.
OverheadCells occupied_cells(std::span<const Point> points, const OverheadGrid& grid, float lowest_m);

/// Six channels, from the eigenvalues l1 >= l2 >= l3 of the points in a cell and the eight beside it: linearity,
/// planarity, scattering, omnivariance, eigenentropy and change of curvature (Weinmann et al., ISPRS 2015). Cells with
/// fewer than five points around have none.
OverheadCells eigenvalue_features(std::span<const Point> points, const OverheadGrid& grid, float lowest_m);

}  // namespace revisit::descriptors_internal
