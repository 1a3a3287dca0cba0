// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/odometry/local_map.hpp>
#include <revisit/odometry/motion_limits.hpp>
#include <revisit/odometry/track_state.hpp>
#include <revisit/registration/icp.hpp>

namespace revisit {

/// Whether a scan was taken where registration found it. Refers to what it is made of, which must outlive it; reading
/// is safe from several threads.
class MatchJudgement {
 public:
  /// `T_previous_start`: the motion since the scan before that the search began from.
  MatchJudgement(const LocalMap& map, const TrackState& track, const MatcherScan& scan, double stamp_s,
                 const ScanMatch& predicted, const Pose& T_previous_start);

  /// Whether a sensor can have moved there.
  bool is_possible(const IcpResult& found) const;
  /// Whether it is there: possible, and enough of the scan lies on the map.
  bool fits(const IcpResult& found) const;
  /// Whether it is there, although it sees mostly what is new: a narrow sensor that turns, or one that comes round a
  /// corner. Of the rest, most must fit.
  bool fits_beside_new(const IcpResult& found) const;

  double gap_s() const { return gap_s_; }                                               ///< since the scan before
  bool follows() const { return gap_s_ > 0.0 && gap_s_ <= TrackState::kLongestGap_s; }  ///< closely on that one
  double untracked_s() const { return untracked_s_; }    ///< since the last one that was tracked
  bool is_turn_known() const { return is_turn_known_; }  ///< by an IMU that was right so far

 private:
  bool is_credible(const IcpResult& found) const;

  const LocalMap& map_;
  const TrackState& track_;
  const MatcherScan& scan_;
  std::optional<double> measured_m_;
  double gap_s_, untracked_s_;
  bool is_turn_known_, is_predicted_;
  MotionLimits limits_;
};

/// Width of the narrowest kernel that scans are registered with.
double fine_width_m(const LocalMap& map);

}  // namespace revisit
