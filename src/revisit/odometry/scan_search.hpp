// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <revisit/odometry/match_judgement.hpp>

namespace revisit {

/// Looks for one scan in the map of what was seen lately: from where it is predicted and, where it does not fit there,
/// from elsewhere. Refers to what it is made of, which must outlive it. Belongs to one thread; deterministic, whatever
/// the number of threads that registration uses.
class ScanSearch {
 public:
  /// Of `expected` it reads the prediction, what of it was measured, and where registration begins: as predicted, or
  /// where the scan was found already.
  ScanSearch(const LocalMap& map, const TrackState& track, const MatcherScan& scan, double stamp_s,
             const ScanMatch& expected);

  struct Found {
    IcpResult icp;  ///< the best of what was tried
    bool is_tracked = false;
  };
  /// Near the start, or where a drive that began in motion or a gap between scans may have led. `width_m`: of
  /// registration's kernel at first, hence how far from each start it looks.
  Found near_start(double width_m);
  /// Elsewhere, after near_start() gave `found` and that does not fit: the sensor turned as nobody foresaw.
  Found around(const IcpResult& found);

 private:
  // Each registers the scan from other starts and keeps in `best_` what fits better.
  void from_start(double width_m);
  void without_prior();
  void beside_a_start_in_motion(double width_m);
  void after_a_gap();
  void turned_a_little();
  void turned_since_tracked();

  IcpResult align(double width_m, const Pose& T_previous_lidar, const std::optional<PosePrior>& prior = {}) const;
  IcpResult align_few(double width_m, const Pose& T_previous_lidar);
  IcpResult align_points(std::span<const Eigen::Vector3f> points, double width_m, const Pose& T_previous_lidar,
                         const std::optional<PosePrior>& prior) const;
  // Take another pose where so large a share of what lies on upright surfaces there is more than at the best one.
  void try_upright(double share, double width_m, const Pose& T_previous_lidar);
  void take_if_more_upright(double share, const IcpResult& other);
  bool is_more_upright(double share, const IcpResult& other) const;
  void try_turned(const Pose& T_previous_lidar, double turn_deg);
  Pose from_previous(const IcpResult& found) const { return track_.T_odom_lidar.inverse() * found.T_target_source; }

  const LocalMap& map_;
  const TrackState& track_;
  const MatcherScan& scan_;
  Pose T_previous_start_;
  bool is_moved_by_wheels_;
  std::optional<PosePrior> prior_;
  MatchJudgement judgement_;
  IcpResult best_;
  std::vector<Eigen::Vector3f> few_;  ///< of the points, once they are needed
  double most_of_few_ = 0.0;          ///< of them that matched where a turned one was tried
};

}  // namespace revisit
