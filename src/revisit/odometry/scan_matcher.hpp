// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>

#include <revisit/core/pose.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/core/twist.hpp>
#include <revisit/odometry/local_map.hpp>
#include <revisit/odometry/scan_match.hpp>
#include <revisit/odometry/track_state.hpp>

namespace revisit {

/// Finds scans in the map of what was seen lately: the registration inside `Odometry`. Nothing to tune: the map's
/// voxels follow from how far the first scan sees, the search radius from how well the motion is predicted. Scans come
/// in the order of their stamps. Belongs to one thread at a time; deterministic, whatever the number of threads.
class ScanMatcher {
 public:
  ScanMatcher();
  ~ScanMatcher();
  ScanMatcher(ScanMatcher&&) noexcept;
  ScanMatcher& operator=(ScanMatcher&&) noexcept;

  /// In how many rings the beams turn; none, until told. Such lines stand still in the sensor's frame, and the patches
  /// that one scan's lines make of leaves would hold back its tilt: what is uncertain then counts for less. A sparse
  /// pattern that does not repeat needs all that it meets.
  void set_rings(std::size_t rings) { track_.rings = static_cast<std::uint32_t>(rings); }

  /// The predicted motion during the coming scan, where it follows closely on the last.
  std::optional<Twist> predicted_motion(double stamp_s) const;

  /// The motion to a scan that was found so far from the one before (TrackState).
  Twist motion_found(const Pose& T_previous_lidar, double stamp_s) const {
    return track_.motion_found(T_previous_lidar, stamp_s);
  }

  /// Thins a scan (filtered by range, its sweep compensated).
  MatcherScan thinned(std::span<const Point> points) const;
  /// Matches the scan with the map, which begins with the first one: near where it is predicted.
  ScanMatch match(double stamp_s, const MatcherScan& scan, const std::optional<MotionGuess>& guess = {}) const;
  /// Matches a scan that was found at `match` once more, after its sweep was compensated with the motion found there.
  ScanMatch match_again(double stamp_s, const MatcherScan& scan, const ScanMatch& match) const;
  /// Looks elsewhere, too, for a scan of which one of these gave `match`, not tracked.
  ScanMatch look_around(double stamp_s, const MatcherScan& scan, const ScanMatch& match) const;
  /// Goes on from there: the scan enters the map, in the background.
  void accept(double stamp_s, const MatcherScan& scan, const ScanMatch& match);

  /// Forgets what was seen: the next scan begins a map where it is predicted to be.
  void restart();
  void archive(auto& fields) {
    wait();
    bool has_map = map_ != nullptr;
    fields(has_map);
    if (!has_map) map_.reset();
    if (has_map && !map_) map_ = std::make_unique<LocalMap>(1.0, 1.0);  // of whatever size the archive says
    if (has_map) fields(*map_);
    fields(forgotten_from_, track_);
  }

  bool has_map() const { return map_ != nullptr; }

 private:
  class Insertion;
  void wait() const;
  // `expected` tells the prediction, what of it was measured, and where to begin.
  ScanMatch match_from(double width_m, double stamp_s, const MatcherScan& scan, const ScanMatch& expected) const;
  ScanMatch match_at(const IcpResult& icp, bool is_tracked, const ScanMatch& expected) const;
  // How far from the prediction a scan is looked for: the better motion is predicted, the less.
  double search_width_m() const;

  std::unique_ptr<LocalMap> map_;
  std::unique_ptr<Insertion> insertion_;  ///< of the last scan into the map; waited for before the map is read
  Eigen::Vector3f forgotten_from_ = Eigen::Vector3f::Zero();  ///< where the map was last cut to its reach
  TrackState track_;
};

}  // namespace revisit
