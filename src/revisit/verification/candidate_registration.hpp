// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/core/trajectory_point.hpp>
#include <revisit/registration/overhead_search.hpp>
#include <revisit/verification/hypothesis.hpp>
#include <revisit/verification/loop_following.hpp>
#include <revisit/verification/place_clouds.hpp>

namespace revisit {

/// A pose of a query relative to a place that was registered, and its log odds with the prior.
struct RegisteredPose {
  FrameId match;
  Pose T_match_query = Pose::Identity();
  double log_odds = 0.0;
};

/// A scan whose place is searched.
struct VerificationQuery {
  FrameId frame;
  DescriptorView descriptor;
  const ThinCloud& cloud;
  std::shared_ptr<const ScanGeometry> geometry;  ///< of the cloud, where it was made already
  std::optional<TrajectoryPoint> trajectory_point;
};

/// What is known of the places that may answer.
struct VerificationContext {
  const Parameters& parameters;
  PlaceClouds& clouds;
  PlaceGeometries& geometries;
  DescriptorLookup query_descriptor, place_descriptor;  ///< of the queries before, and of the places
  const TrajectoryPoints& places;
  const LoopFollowing& following;
  TypicalAgreement typical;
  double look_alikes_log_odds = 0.0;  ///< LookAlikes
  FrameId newest;                     ///< place that may answer
  bool is_thorough = false;  ///< a scan alone is registered with further places unless it is found among the best ones;
                             ///< else only where it speaks against all of these
  bool is_one_drive = false;  ///< odometry lost track in between where it does not know how places lie
};

/// How one hypothesis about a query is tested: seen from overhead, then temporal consistency, then registration
/// (docs/method.md, section 7). Lives as long as the query and the context.
class CandidateRegistration {
 public:
  CandidateRegistration(const VerificationContext& context, const VerificationQuery& query);

  /// The poses that fit best from overhead, two a candidate and at most `options.candidates`, registered where nothing
  /// refuses them before. An error where the cloud of a place cannot be read.
  Result<std::vector<Hypothesis>> test(std::span<const LoopCandidate> candidates);
  /// The next best ones of those candidates, at most so many; for a scan whose place is not among the best.
  std::vector<Hypothesis> test_next(std::size_t count);
  /// A place that the query is predicted to stand near to: only the pose is open, and little overlap is no objection,
  /// since something may stand in the way.
  Result<Hypothesis> test(const PosePrediction& prediction);
  /// A place that the query does not stand near to, registered as if it did: log odds by its own evidence, whatever the
  /// recording. Nothing where the pose is right after all, since the place is in sight from afar.
  Result<std::optional<double>> log_odds_elsewhere(FrameId place, const Pose& T_place_query);

  const ScanGeometry& query_geometry();
  /// The time spent on temporal consistency, which the paper counts apart.
  double temporal_ms() const { return temporal_ms_; }

  static constexpr std::size_t kPosesAPlace = 2;  ///< that may be registered
  static constexpr double kReach_m = 6.0;         ///< how far retrieval may be off; the overhead search covers it

 private:
  Result<Hypothesis> open(const LoopCandidate& candidate) const;
  /// All poses of these candidates that may be registered, the best first.
  Result<std::vector<Hypothesis>> open(std::span<const LoopCandidate> candidates);
  std::vector<Hypothesis> search_overhead(const Hypothesis& of_place, double yaw_reach_rad, std::size_t wanted);
  void share_geometry(std::span<Hypothesis> hypotheses) const;
  void check_temporal_consistency(Hypothesis& hypothesis) const;
  void register_scans(Hypothesis& hypothesis, const PosePrediction* prediction = nullptr) const;
  /// Accepts or refuses a pose that was registered, with what odometry and the loops before say of it.
  void judge(Hypothesis& hypothesis, const PosePrediction* prediction) const;
  /// Tests a refused pose again, with what was seen before the two scans (ThinCloud::before).
  void look_wider(Hypothesis& hypothesis, const PosePrediction* prediction) const;
  Pose from_upright(const Hypothesis& hypothesis, const Pose& T_match_query_upright) const;

  const VerificationContext& context_;
  const GeometricOptions& options_;
  const VerificationQuery& query_;
  OverheadSearch overhead_;
  std::shared_ptr<const ScanGeometry> query_geometry_;
  std::vector<Hypothesis> untested_;  ///< of test(), the best first
  double temporal_ms_ = 0.0;
};

}  // namespace revisit
