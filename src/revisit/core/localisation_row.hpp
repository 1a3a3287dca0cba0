// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <revisit/core/ids.hpp>
#include <revisit/core/pose.hpp>

namespace revisit {

/// A row of localisation.csv: where one scan is in a saved map (docs/formats.md).
struct LocalisationRow {
  FrameId frame;
  std::string status;                     ///< "lost", "found", "followed" or "predicted"
  FrameId match;                          ///< of the map (in_map()); none where it is lost
  Pose T_map_lidar = Pose::Identity();    ///< likewise
  Pose T_match_lidar = Pose::Identity();  ///< the same from the key frame
  double probability = 0.0;
  double deviation_m = 0.0, deviation_deg = 0.0;  ///< standard deviations, of position and angle
  double ms = 0.0;
  std::string reason;

  bool is_answered() const { return status != "lost"; }
};

}  // namespace revisit
