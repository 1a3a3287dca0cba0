// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <revisit/core/ids.hpp>
#include <revisit/core/trajectory_point.hpp>

namespace revisit {

/// What several scans in a row say about where odometry's frame lies in a map, added up: one scan may fit at several
/// places, the way from scan to scan fits at one. Belongs to one thread at a time.
class PoseBelief {
 public:
  static constexpr double kAnotherView_m = 3.0;  ///< travelled, after which a scan is evidence of its own
  static constexpr double kAskedOfAlike = 1.0;   ///< log odds beyond which a view speaks for what resembles others

  /// The log odds that a view adds to a pose, whose scan has `own_log_odds` there by itself: all of them where the scan
  /// decides alone, else at most 2; where it resembles others (LoopEvidence), which goes on for longer, what is beyond
  /// kAskedOfAlike, at most 1.
  static double log_odds_of_view(double own_log_odds, bool decides_alone, bool resembles_others);

  /// A pose at which one scan was registered.
  struct Sighting {
    FrameId match;
    int part = 0;  ///< of the map
    Pose T_map_lidar = Pose::Identity();
    double log_odds = 0.0;          ///< by the evidence of this scan alone
    double prior_log_odds = 0.0;    ///< known without it; counts once, however many scans there are
    bool resembles_others = false;  ///< LoopEvidence::resembles_others()
  };
  struct Hypothesis {
    FrameId match;  ///< of the last sighting
    int part = 0;
    Pose T_map_segment = Pose::Identity();  ///< of the odometry's segment
    double log_odds = 0.0;
    bool resembles_others = false;  ///< at the last sighting
  };

  /// The scan at this point of the trajectory was registered at these poses. Scans of one view count once: evidence
  /// grows with the metres travelled. Another segment begins anew.
  void add(const TrajectoryPoint& point, std::span<const Sighting> sightings);
  /// The likeliest, with the log odds that it is right and the others are wrong.
  std::optional<Hypothesis> best() const;
  void clear() { hypotheses_.clear(); }

 private:
  std::vector<Hypothesis> hypotheses_;
  std::optional<TrajectoryPoint> last_;
};

}  // namespace revisit
