// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <revisit/core/scan.hpp>
#include <revisit/preprocess/rings.hpp>

namespace revisit::cli {

/// What a scan says of its sensor.
struct SensorGuess {
  std::string name;                            ///< e.g. "HDL-64E or alike"
  double lowest_deg = 0.0, highest_deg = 0.0;  ///< elevation of the lowest and highest point
  double horizontal_deg = 0.0;                 ///< azimuth that is covered
};

SensorGuess guess_sensor(const Scan& scan, const Rings& rings);

}  // namespace revisit::cli
