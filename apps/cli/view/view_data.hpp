// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <revisit/core/candidate_row.hpp>
#include <revisit/core/loop.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/core/result.hpp>

namespace revisit::cli {

/// A scan of the trajectory.
struct ViewScan {
  FrameId frame;
  double stamp_s = 0.0;
  bool is_keyframe = false;
  Pose T_map_lidar = Pose::Identity();
  std::optional<Pose> T_odom_lidar;
};

/// What view.json is made of.
struct ViewData {
  std::string title, command, input;
  std::vector<std::string> sessions;  ///< the recordings
  std::vector<ViewScan> scans;        ///< in the order of their frames
  std::vector<CandidateRow> answers;
  std::vector<LoopConstraint> loops;
  std::map<FrameId, Pose> truth;
  bool has_tiles = false;
  std::optional<double> north_deg;  ///< of a map made with GPS: from its y axis, counterclockwise
};

/// Of a map (its folder may hold more; one without key frames has no scans), or of what `detect` wrote.
Result<ViewData> read_map_view(const std::filesystem::path& map_file);
Result<ViewData> read_detect_view(const std::filesystem::path& folder);
/// view.json (docs/formats.md); `folder` gives run.json and `evidence` is an evidence.csv, where they are.
Result<std::string> to_view_json(const ViewData& data, const std::filesystem::path& folder,
                                 const std::filesystem::path& evidence);

}  // namespace revisit::cli
