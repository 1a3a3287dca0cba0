// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace revisit {

/// phi(eta, d) of eq. 1 as a table of gains: eta_cal = eta * distance_gain(d) * ring_gain(ring).
/// The default is the identity. Gains between distance knots are interpolated, beyond them held.
struct IntensityCalibration {
  std::vector<double> distance_knots_m;  ///< increasing
  std::vector<double> distance_gains;    ///< one a knot
  std::vector<double> ring_gains;        ///< one a ring; empty where rings are unknown

  bool is_identity() const { return distance_gains.empty() && ring_gains.empty(); }

  double distance_gain(double distance_m) const {
    if (distance_gains.empty()) return 1.0;
    const auto upper = std::upper_bound(distance_knots_m.begin(), distance_knots_m.end(), distance_m);
    if (upper == distance_knots_m.begin()) return distance_gains.front();
    if (upper == distance_knots_m.end()) return distance_gains.back();
    const auto i = static_cast<std::size_t>(upper - distance_knots_m.begin());
    const double t = (distance_m - distance_knots_m[i - 1]) / (distance_knots_m[i] - distance_knots_m[i - 1]);
    return (1.0 - t) * distance_gains[i - 1] + t * distance_gains[i];
  }

  /// A ring that the table does not know keeps its reading.
  double ring_gain(std::uint16_t ring) const { return ring < ring_gains.size() ? ring_gains[ring] : 1.0; }
};

}  // namespace revisit
