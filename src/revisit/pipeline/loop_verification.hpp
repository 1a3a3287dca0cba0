// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <revisit/pipeline/loop_track.hpp>
#include <revisit/pipeline/place_clouds.hpp>
#include <revisit/pipeline/prepare.hpp>
#include <revisit/registration/overhead_search.hpp>
#include <revisit/retrieval/place_index.hpp>
#include <revisit/verification/geometric.hpp>
#include <revisit/verification/temporal.hpp>

namespace revisit {

/// What is found out about a candidate, step by step.
struct Opinion {
  Opinion(const LoopCandidate& of, std::shared_ptr<const ThinCloud> at) : candidate(of), place(std::move(at)) {}
  /// Orders answers: docs/method.md, section 7.
  double score() const;
  /// Of what was registered, without what speaks for it besides.
  double own_log_odds() const { return loop_log_odds(geometric->evidence); }
  double distance_m() const { return geometric->T_match_query.translation().norm(); }

  LoopCandidate candidate;
  std::shared_ptr<const ThinCloud> place;
  Pose T_guess_match_query = Pose::Identity();
  double overlap = 0.0;  ///< seen from overhead
  TemporalEvidence temporal;
  std::shared_ptr<const ScanGeometry> geometry;  ///< of the place, where it was registered
  std::optional<GeometricEvidence> geometric;
  std::string reason;  ///< why it is no loop; empty where it is one
};

/// Which of the candidates of one scan is its place, if any: docs/method.md, section 7. Lives as long as the question.
class LoopVerification {
 public:
  /// The last queries, for temporal consistency.
  using RecentQueries = std::deque<std::pair<FrameId, IntensityScanContext>>;
  /// What is known of all places and of the way; the detector's.
  struct Known {
    const Parameters& parameters;
    const PlaceIndex& index;
    PlaceClouds& clouds;
    const LoopTrack::Places& stations;
    const LoopTrack& track;
    const RecentQueries& recent_queries;
    UsualAgreement usual;
    FrameId newest;  ///< that the scan may be matched with
  };
  LoopVerification(const Known& known, const PreparedScan& query);

  /// The best answer, accepted or not; none where there are no candidates. An error where a place cannot be read.
  Result<std::optional<Opinion>> answer(std::span<const LoopCandidate> candidates);
  /// Everything that was asked.
  const std::vector<Opinion>& opinions() const { return opinions_; }
  bool is_sure(double log_odds) const;
  const ScanGeometry& query_geometry();
  double temporal_ms() const { return temporal_ms_; }

 private:
  // loop_candidates.cpp: how a candidate is asked.
  Status look_at(std::span<const LoopCandidate> candidates);
  void ask_them();
  Result<Opinion> register_at(const LoopTrack::Expectation& where);
  void register_it(Opinion& opinion);
  void look_from_overhead(double yaw_reach_rad, Opinion& opinion);
  Pose from_upright(const Opinion& opinion, const Pose& T_match_query_upright) const;
  void check_temporal_and_scores(Opinion& opinion) const;
  // loop_verification.cpp: who is asked, and what follows.
  Result<std::optional<Opinion>> expected();
  Status go_nearer(Opinion& answer);

  static constexpr int kOverheadReach_m = 6;  ///< a translation that retrieval may be off
  Known known_;
  const GeometricOptions& options_;
  const PreparedScan& query_;
  OverheadSearch overhead_;
  std::shared_ptr<const ScanGeometry> query_geometry_;
  std::vector<Opinion> opinions_;  ///< of those that were asked
  double temporal_ms_ = 0.0;
};

}  // namespace revisit
