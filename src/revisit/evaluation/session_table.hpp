// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <map>
#include <vector>

#include <revisit/core/pose.hpp>

namespace revisit {

/// Table 6: sessions made one (docs/evaluation.md).
struct SessionTable {
  struct Session {
    int id = 0, part = 0;
    std::size_t keyframes = 0;
    double ate_alone_m = 0.0;   ///< of its key frames, laid on the truth by themselves
    double ate_joined_m = 0.0;  ///< together with the first session of its part
    bool is_wrong = false;      ///< joined where it does not belong: the join is off by more than the trajectories are
  };
  std::vector<Session> sessions;
  std::map<int, double> ate_m;  ///< of each part, all its sessions in one frame
  std::size_t joined = 0;       ///< sessions in the part of the first one, itself included
  std::size_t wrong_joins = 0;
};

/// A key frame of a map: where the map has it, and in which part.
struct MapKeyframe {
  Pose T_map_lidar = Pose::Identity();
  int part = 0;
};
/// Both by in_map(); key frames without a true pose are left out.
SessionTable evaluate_sessions(const std::map<FrameId, MapKeyframe>& keyframes, const std::map<FrameId, Pose>& truth);

}  // namespace revisit
