// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <vector>

#include <revisit/core/exclusion.hpp>
#include <revisit/core/pose.hpp>

namespace revisit {

/// Who may be matched, and what is the same place (docs/evaluation.md).
struct EvaluationRules : ExclusionRule {
  double same_place_m = 4.0;          ///< 3-D distance of two poses
  double reverse_heading_deg = 90.0;  ///< a revisit whose heading differs by more is a reverse one
  double right_translation_m = 0.5;   ///< of a loop's pose from the reference
  double right_rotation_deg = 3.0;
};

/// A query that has an allowed frame within the same place.
struct Revisit {
  FrameId nearest;  ///< the allowed frame that is nearest
  double distance_m = 0.0;
  bool reverse = false;  ///< it heads more than reverse_heading_deg another way
};

/// The truth that results are scored against: where each frame was.
class Reference {
 public:
  /// `trajectory` holds the frames of the recording that have a reference pose, and their stamps.
  Reference(Trajectory trajectory, const EvaluationRules& rules);

  const EvaluationRules& rules() const { return rules_; }
  const Trajectory& trajectory() const { return trajectory_; }
  const std::map<FrameId, Revisit>& revisits() const { return revisits_; }
  std::size_t reverse_revisits() const;

  /// Distance between two frames, metres; nothing where one has no pose.
  std::optional<double> distance_m(FrameId a, FrameId b) const;
  std::optional<Pose> T_match_query(FrameId match, FrameId query) const;

 private:
  Trajectory trajectory_;
  EvaluationRules rules_;
  std::map<FrameId, Revisit> revisits_;
};

}  // namespace revisit
