// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <revisit/pipeline/detection.hpp>
#include <revisit/retrieval/place_index.hpp>
#include <revisit/verification/backward_following.hpp>
#include <revisit/verification/candidate_registration.hpp>
#include <revisit/verification/hypothesis.hpp>
#include <revisit/verification/look_alikes.hpp>
#include <revisit/verification/loop_following.hpp>
#include <revisit/verification/place_clouds.hpp>

namespace revisit {

class LoopVerification;

/// Retrieval and verification over the places seen so far: what LoopDetector, Slam and Localiser share. Frames
/// increase. Belongs to one thread at a time.
class PlaceRecognition {
 public:
  PlaceRecognition(const Parameters& parameters, std::unique_ptr<PlaceClouds> clouds)
      : PlaceRecognition(parameters, std::move(clouds), PlaceIndex(parameters.retrieval)) {}
  /// `index`: of an earlier run, whose clouds are kept already; its places get their points by set_point().
  PlaceRecognition(const Parameters& parameters, std::unique_ptr<PlaceClouds> clouds, PlaceIndex index)
      : parameters_(parameters), index_(std::move(index)), clouds_(std::move(clouds)) {}

  /// Looks for the scan among the first `places` of the index, thoroughly if so asked (VerificationContext). An error
  /// where a place cannot be read.
  Result<Detection> find(const PreparedScan& query, std::size_t places, const TypicalAgreement& typical,
                         bool is_thorough = false);
  /// The scan of `before`, prepared anew, looked for where it fitted best or nearly so, and nowhere else.
  Result<Detection> find_there(const PreparedScan& query, Detection before, const TypicalAgreement& typical);
  /// Follows loops backwards, two scans a call: those of the last metres that had none when they came, and have one now
  /// (BackwardFollowing). `detection`: what find() said of the newest scan, at this point of the trajectory.
  Result<std::vector<Detection>> follow_back(const Detection& detection, const std::optional<TrajectoryPoint>& point,
                                             const TypicalAgreement& typical);
  /// The scan registered near to where it is predicted to stand, and nowhere else.
  Result<Hypothesis> test(const PreparedScan& query, const PosePrediction& prediction, const TypicalAgreement& typical);
  /// How much alike the places of a finished map are: some of them are looked for among those that are elsewhere.
  /// `point_of` gives their poses in the map (point_in_map()). For set_look_alikes().
  Result<double> learn_look_alikes_of_map(const std::function<TrajectoryPoint(FrameId)>& point_of,
                                          const TypicalAgreement& typical);
  /// What the scan of a place is registered onto.
  Result<std::shared_ptr<const ScanGeometry>> geometry(FrameId place) const;
  /// Adds a place.
  Status add(PreparedScan place);
  /// A place whose cloud is kept already, of an earlier run.
  void restore(const FrameTime& frame, const IntensityScanContext& descriptor,
               const std::optional<TrajectoryPoint>& point);

  /// Where a place is, known better by now.
  void set_point(FrameId place, const TrajectoryPoint& point) { points_.insert_or_assign(points_.end(), place, point); }

  /// Takes over `temporal` and `geometric`, from the next scan on.
  void set_verification(const Parameters& parameters) {
    parameters_.temporal = parameters.temporal;
    parameters_.geometric = parameters.geometric;
  }

  /// Another's retrieval instead of the index's: of the first `places` places of the index, those that may show what
  /// the query shows, best first.
  using Retrieval = std::function<std::vector<FrameId>(const PreparedScan& query, std::size_t places)>;
  void set_retrieval(Retrieval retrieval) { retrieval_ = std::move(retrieval); }

  /// All but the index, whose places were restored, and the clouds.
  void archive(auto& fields) {
    fields(points_, following_, look_alikes_, look_alikes_of_map_, queries_, recent_queries_);
    for (std::size_t i = 0; i < index_.size(); ++i) fields.require(points_.contains(index_.frame(i)));
    for (const RecentQuery& each : recent_queries_)
      fields.require(each.descriptor.rings == parameters_.descriptor.rings &&
                     each.descriptor.sectors == parameters_.descriptor.sectors &&
                     each.descriptor.levels == parameters_.descriptor.levels);
  }

  /// Queries and the places of their session come from one drive: where odometry lost track in between, nothing tells
  /// look-alikes apart, and a loop in the open must show more by itself.
  void expect_one_drive() { is_one_drive_ = true; }

  const PlaceIndex& index() const { return index_; }
  /// How much alike the places are (LookAlikes): as this run learnt, or as the map says.
  double look_alikes_log_odds() const { return look_alikes_of_map_ ? *look_alikes_of_map_ : look_alikes_.log_odds(); }
  void set_look_alikes(double log_odds) { look_alikes_of_map_ = log_odds; }

 private:
  VerificationContext context(const TypicalAgreement& typical, const LoopFollowing& following,
                              FrameId newest = {}) const;
  Result<std::vector<LoopCandidate>> candidates(const PreparedScan& query, std::size_t places) const;
  Status verify(const PreparedScan& query, const TypicalAgreement& typical, bool is_thorough, Detection& detection);
  Status learn_look_alikes(const PreparedScan& query, CandidateRegistration& registration);
  Result<std::optional<Detection>> find_again(const BackwardFollowing::Query& query, const TypicalAgreement& typical);
  bool is_to_be_followed(const Detection& detection, const std::optional<TrajectoryPoint>& point) const;
  void conclude(LoopVerification& verification, std::optional<Hypothesis> answer, Detection& detection) const;
  static void answer(Hypothesis hypothesis, const ScanGeometry& query_geometry, Detection& detection);

  Parameters parameters_;
  PlaceIndex index_;
  Retrieval retrieval_;  ///< absent: the index's
  std::unique_ptr<PlaceClouds> clouds_;
  mutable PlaceGeometries geometries_;
  TrajectoryPoints points_;  ///< of all places
  LoopFollowing following_;
  BackwardFollowing backward_;  ///< of LoopDetector alone; Slam and its --resume do without
  LookAlikes look_alikes_;
  std::optional<double> look_alikes_of_map_;
  bool is_one_drive_ = false;
  std::size_t queries_ = 0;
  struct RecentQuery {
    FrameId frame;
    IntensityScanContext descriptor;

    void archive(auto& fields) { fields(frame, descriptor); }
  };
  std::deque<RecentQuery> recent_queries_;  ///< the last N, for temporal consistency
};

}  // namespace revisit
