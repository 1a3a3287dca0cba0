// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/odometry/odometry.hpp>
#include <revisit/pipeline/prepare.hpp>
#include <revisit/pipeline/recent_scans.hpp>

namespace revisit {

/// What a sensor that sees a sector saw during the second before each scan, laid together by odometry: one scan shows
/// little of a place. Belongs to one thread at a time.
class NarrowView {
 public:
  /// Sets ThinCloud::before of a scan that sees less than half of what is around, and leaves others as they are. The
  /// scan must have its geometry and its trajectory point; scans come in the order in which they were taken.
  void widen(PreparedScan& scan);
  /// The same where odometry alone tells how the scans lie to each other: it sets the geometry, too, and no trajectory
  /// point.
  void widen(PreparedScan& scan, const OdometryStep& odometry);

  void archive(auto& fields) { fields(recent_, interruptions_); }

 private:
  static constexpr std::size_t kMostScans = 32;  ///< of a sensor that gives more in a second, the last ones
  RecentScans recent_{kMostScans};
  int interruptions_ = 0;  ///< of odometry
};

}  // namespace revisit
