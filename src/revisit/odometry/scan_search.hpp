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
  /// Begins at `T_previous_start`, a motion since the scan before: the predicted one, or one that was found already.
  ScanSearch(const LocalMap& map, const TrackState& track, const MatcherScan& scan, double stamp_s,
             const ScanMatch& predicted, const Pose& T_previous_start);

  struct Found {
    IcpResult icp;  ///< the best of what was tried
    bool is_tracked = false;
  };
  /// `width_m`: of registration's kernel at first, hence how far from the start it looks.
  Found find(double width_m, SearchExtent extent);

 private:
  // Each registers the scan from other starts and keeps in `best_` what fits better.
  void from_start(double width_m);
  void without_prior();
  void beside_a_start_in_motion(double width_m);
  void after_a_gap();
  void turned_a_little();
  void turned_since_tracked();

  IcpResult align(std::span<const Eigen::Vector3f> points, double width_m, const Pose& T_previous_lidar,
                  const std::optional<PosePrior>& prior = {}) const;
  IcpResult align_few(double width_m, const Pose& T_previous_lidar);
  void take_if_more_upright(const IcpResult& other, double share);
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
