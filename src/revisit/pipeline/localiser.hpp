// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <revisit/localisation/following_trust.hpp>
#include <revisit/localisation/pose_belief.hpp>
#include <revisit/localisation/saved_places.hpp>
#include <revisit/odometry/odometry.hpp>
#include <revisit/pipeline/detection.hpp>
#include <revisit/pipeline/place_recognition.hpp>

namespace revisit {

/// Where a scan is in a saved map.
struct Localisation {
  enum class Status : std::uint8_t {
    kLost,       ///< not found, or not surely enough; `reason` says why
    kFound,      ///< found without a prior, by this scan alone or with those before it
    kFollowed,   ///< found where odometry predicted it
    kPredicted,  ///< where odometry predicts it: the scan does not fit the map there (something moved, or is new)
  };
  FrameId frame;
  Status status = Status::kLost;
  std::optional<Pose> T_map_lidar;  ///< absent where it is lost
  double probability = 0.0;         ///< that the pose is right (docs/accuracy.md)
  /// Of the pose relative to the key frame, as in LoopConstraint; of a predicted one, less for each metre.
  Matrix6 information = Matrix6::Zero();
  FrameId match;        ///< the key frame of the map (in_map()) that it was registered with last
  std::string reason;   ///< why it is lost or predicted only
  Detection detection;  ///< what locate() found out; of follow() only while it is lost
};
/// "lost", "found", "followed", "predicted".
const char* to_string(Localisation::Status status);

/// A saved map answers: where am I? Takes scans as a driver delivers them. Belongs to one thread at a time.
class Localiser {
 public:
  /// `map`: what `revisit slam --out` or Slam::open() wrote. Its scans are not read again. The parameters must be those
  /// of its descriptors.
  static Result<Localiser> open(const std::filesystem::path& map, const Parameters& parameters = {}, LogSink log = {},
                                const std::optional<IntensityScale>& scale = std::nullopt);

  /// One scan, without a prior, whatever came before. An error where the scan describes no place, or a place of the map
  /// cannot be read.
  Result<Localisation> locate(Scan scan);
  /// The next scan of a drive: found without a prior, by as many scans as it takes, then followed with odometry, and
  /// found again where it gets lost. Frames and stamps increase. `T_external_lidar`: as in Slam::process().
  Result<Localisation> follow(Scan scan, const std::optional<Pose>& T_external_lidar = std::nullopt);

  /// Somebody says where the next scan is, to a few metres and 40 degrees: follow() lets go of what it holds, and looks
  /// there as well as everywhere. Height and tilt are the map's. Of a map in several parts, the first.
  void expect(const Pose& T_map_lidar);

  /// Takes over `temporal` and `geometric`, from the next scan on. Throws std::invalid_argument for parameters out of
  /// range.
  void set_verification(const Parameters& parameters);

  std::size_t places() const { return recognition_.index().size(); }
  const SavedPlaces& map() const { return map_; }

 private:
  Localiser(SavedPlaces map, const Parameters& parameters, LogSink log, const std::optional<IntensityScale>& scale);
  Result<Localisation> wake_up(const PreparedScan& scan, const TrajectoryPoint& point);
  Result<Localisation> stay(const PreparedScan& scan, const TrajectoryPoint& point);
  Result<std::optional<Twist>> motion_of(const PreparedScan& scan, const Detection& detection) const;
  /// The places nearest to a pose in a part of the map, the nearest first, with the pose relative to each.
  std::vector<PosePrediction> nearest_places(const Pose& T_map_lidar, int part, std::size_t count) const;
  /// Whether scans in a row showed enough. Of what resembles others as much as one scan that decides alone: look-alikes
  /// go on for metres.
  bool is_sure(const PoseBelief::Hypothesis& best) const;
  /// Registers the scan with the places beside the likeliest pose, where that is not accepted: one of them may be
  /// enough, or several together.
  Status look_nearby(const PreparedScan& scan, Detection& detection);
  void accept_together(Detection& detection) const;
  static void accept(Detection& detection, FrameId match, const GeometricEvidence& found, double score);
  Status look_where_expected(const PreparedScan& scan, const TrajectoryPoint& point, Detection& detection);
  /// What it is worth to be where somebody expects it: as much as there is elsewhere.
  double expectation_log_odds(const Pose& T_map_lidar, int part, const TrajectoryPoint& point) const;
  /// How many places of the map are not near to the pose for each one that is, as log odds.
  double log_odds_of_elsewhere(const Pose& T_map_lidar, int part) const;
  PoseBelief::Sighting sighting(FrameId match, const GeometricEvidence& found) const;
  /// A scan was registered beside where odometry predicts it, but near: adds it to the belief, and says whether that is
  /// sure.
  bool believe_beside(const PosePrediction& prediction, const GeometricEvidence& found, const TrajectoryPoint& point);
  Localisation found(FrameId frame, const LoopConstraint& loop) const;

  /// Takes the loop away from one scan of a sector or a room that does not decide alone: the refusal says so.
  static void ask_for_more_views(Detection& detection);

  static constexpr double kFarFromPlaces_m = 20.0;  ///< from the nearest place: it has left the map

  struct Following {
    Pose T_map_segment = Pose::Identity();  ///< of the odometry's segment
    TrajectoryPoint at;                     ///< where the map was seen last
    double stamp_s = 0.0;
    int part = 0;
    FrameId match;
    Matrix6 information = Matrix6::Zero();
    double probability = 0.0;
    FollowingTrust trust = {};  ///< that it is there
  };

  struct Expected {
    Pose T_map_lidar = Pose::Identity();  ///< at the point of the trajectory, once there is one
    std::optional<TrajectoryPoint> at;
    Pose at_point(const TrajectoryPoint& point) const {
      return T_map_lidar * at->T_segment_lidar.inverse() * point.T_segment_lidar;
    }
  };

  Parameters parameters_;
  SavedPlaces map_;
  Odometry odometry_;
  ScanPreparation preparation_;
  PlaceRecognition recognition_;
  TypicalAgreement typical_;
  PoseBelief belief_;
  std::optional<TrajectoryPoint> point_;
  std::optional<Following> following_;
  std::optional<Expected> expected_;
};

}  // namespace revisit
