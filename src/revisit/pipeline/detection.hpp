// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <revisit/core/candidate_row.hpp>
#include <revisit/core/loop.hpp>
#include <revisit/core/refusal.hpp>
#include <revisit/pipeline/prepare.hpp>
#include <revisit/verification/geometric.hpp>
#include <revisit/verification/temporal.hpp>

namespace revisit {

/// Everything found out about one scan.
struct Detection {
  FrameId frame;
  std::size_t searchable_places = 0;           ///< that could answer: old enough
  std::vector<LoopCandidate> candidates;       ///< from retrieval, best first (of each session: search_either_view())
  std::optional<LoopCandidate> answer;         ///< the candidate that the rest of the evidence is about
  std::optional<TemporalEvidence> temporal;    ///< of the answer
  std::optional<GeometricEvidence> geometric;  ///< of the answer; absent where it was refused before registration
  struct Registered {
    FrameId match;
    GeometricEvidence evidence;
  };
  std::vector<Registered> registered;             ///< every place that was registered, accepted or not
  bool tried_further = false;                     ///< LoopVerification::has_tried_further()
  std::optional<LoopConstraint> loop;             ///< set where the answer was accepted
  double score = 0.0;                             ///< orders answers by confidence (docs/method.md, section 7)
  std::optional<Refusal> refusal;                 ///< why there is no loop; absent where there is one
  std::optional<Pose> T_match_query_by_odometry;  ///< for comparison, where both scans came with a pose
  /// Scans of the last metres that had no loop when they came, and to which a loop found since has led back: what holds
  /// of them now, each with its loop (LoopDetector::process).
  std::vector<Detection> earlier;

  std::size_t points = 0, ground_points = 0;
  RingSource rings = RingSource::kNone;
  PreparedScan::Milliseconds preparation_ms;
  double odometry_ms = 0.0, search_ms = 0.0, temporal_ms = 0.0, geometric_ms = 0.0;

  /// Of the poses that were registered the one with the highest log odds by its own evidence; null where there is none.
  const Registered* likeliest() const;
  /// The refusal in words, with the evidence behind it; empty where there is a loop.
  std::string reason() const;
  /// All that were found with this scan: its own, and those of earlier scans.
  std::vector<LoopConstraint> loops() const;
  CandidateRow row() const;
};

}  // namespace revisit
