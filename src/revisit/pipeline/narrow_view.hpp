// SPDX-License-Identifier: Apache-2.0
#pragma once

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

 private:
  static constexpr std::size_t kMostScans = 32;  ///< of a sensor that gives more in a second, the last ones
  RecentScans recent_{kMostScans};
};

}  // namespace revisit
