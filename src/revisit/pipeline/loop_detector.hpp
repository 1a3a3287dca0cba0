// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <revisit/core/results.hpp>
#include <revisit/pipeline/ego_motion.hpp>
#include <revisit/pipeline/loop_track.hpp>
#include <revisit/pipeline/loop_verification.hpp>
#include <revisit/pipeline/place_clouds.hpp>
#include <revisit/pipeline/prepare.hpp>
#include <revisit/retrieval/place_index.hpp>

namespace revisit {

/// Everything found out about one scan.
struct Detection {
  FrameId frame;
  std::optional<FrameId> newest_searchable;    ///< the newest place that the scan could be matched with
  std::vector<LoopCandidate> candidates;       ///< what retrieval proposed, best first
  std::optional<LoopCandidate> answer;         ///< the candidate that the rest of the evidence is about
  std::optional<TemporalEvidence> temporal;    ///< of the answer; absent where no candidate was found
  std::optional<GeometricEvidence> geometric;  ///< of the answer; absent where it was refused before registration
  struct Registered {
    FrameId match;
    GeometricEvidence evidence;
  };
  std::vector<Registered> registered;             ///< every place that was registered, accepted or not
  std::optional<LoopConstraint> loop;             ///< set where the answer was accepted
  double score = 0.0;                             ///< confidence that orders answers (docs/method.md, section 7)
  std::string reason;                             ///< why there is no loop; empty where there is one
  std::optional<Pose> T_match_query_by_odometry;  ///< for comparison, where both scans came with a pose

  std::size_t points = 0, ground_points = 0;
  RingSource rings = RingSource::kNone;
  PreparedScan::Milliseconds preparation_ms;
  double search_ms = 0.0, temporal_ms = 0.0, geometric_ms = 0.0;

  CandidateRow row() const;
};

/// The whole method, online: scans in, loop closures out. Feed frames in increasing order.
/// One detector belongs to one thread at a time.
class LoopDetector {
 public:
  /// Without a `scale`, the first scan decides it. Throws std::invalid_argument for parameters out of range.
  /// `clouds` keeps what places are registered by; without, memory does.
  explicit LoopDetector(const Parameters& parameters, std::optional<IntensityScale> scale = std::nullopt,
                        IntensityCalibration calibration = {}, LogSink log = {},
                        std::unique_ptr<PlaceClouds> clouds = nullptr);

  /// Looks for the scan's place among those old enough (exclusion of the recent past), then adds it.
  /// `T_world_lidar`, if there is one, is odometry: recorded as evidence, never used to decide.
  /// An error says why this scan describes no place; the detector goes on with the next.
  Result<Detection> process(Scan scan, const std::optional<Pose>& T_world_lidar = std::nullopt);

  /// Adds a place without looking for it: building a map.
  Status add(Scan scan, const std::optional<Pose>& T_world_lidar = std::nullopt);

  /// Looks for the scan's place among all that were added, and adds nothing: where am I in this map?
  Result<Detection> localise(Scan scan);

  /// The same in steps, for a caller that knows the sensor's motion and chooses its places: each scan made ready, the
  /// first ones learnt from, some looked for, some remembered.
  Result<PreparedScan> prepare(Scan scan, const std::optional<Twist>& motion = std::nullopt);
  /// Learns how well intensities agree usually, from a scan that follows the one before.
  void learn_intensities(PreparedScan& prepared);
  bool knows_intensities() const { return ego_motion_.knows_intensities(); }
  /// Which places may answer: those old enough, all, or those up to a frame and time (of a lost robot: before it was).
  struct Past {
    bool is_all = false;
    std::optional<std::pair<FrameId, double>> newest_frame_stamp_s = std::nullopt;
  };
  Result<Detection> detect(const PreparedScan& prepared, const std::optional<Pose>& T_world_lidar, const Past& past);
  Status remember(PreparedScan prepared, const std::optional<Pose>& T_world_lidar);
  /// A place that `clouds` holds already, of an earlier run.
  void recall(FrameId frame, double stamp_s, const IntensityScanContext& descriptor,
              const std::optional<Station>& station);

  const PlaceIndex& index() const { return index_; }

 private:
  // The next scan of the recording: its distortion is undone, and the motion learnt from it.
  Result<PreparedScan> prepare_next(Scan scan);
  EgoMotion::Step find_motion(PreparedScan& prepared) const;
  Status verify(Detection& detection, const PreparedScan& prepared);

  Parameters parameters_;
  std::optional<IntensityScale> scale_;
  IntensityCalibration calibration_;
  LogSink log_;
  bool rings_were_reported_ = false;
  PlaceIndex index_;
  std::map<FrameId, std::optional<Pose>> T_world_places_;  ///< odometry, where there was some
  LoopTrack::Places stations_;                             ///< of all places
  std::unique_ptr<PlaceClouds> clouds_;
  EgoMotion ego_motion_;
  LoopTrack track_;
  LoopVerification::RecentQueries recent_queries_;  ///< the last N
};

}  // namespace revisit
