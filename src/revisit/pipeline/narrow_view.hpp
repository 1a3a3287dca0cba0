// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/pipeline/prepare.hpp>
#include <revisit/pipeline/recent_scans.hpp>

namespace revisit {

/// What a sensor that sees a sector saw during the second before each scan, laid together by odometry: one scan shows
/// little of a place. Belongs to one thread at a time.
class NarrowView {
 public:
  /// Gives the scan, which has its trajectory point, ThinCloud::before, where it sees less than half of what is around.
  /// Others are left as they are.
  void widen(PreparedScan& scan);

 private:
  static constexpr std::size_t kMostScans = 32;  ///< of a sensor that gives more in a second, the last ones
  RecentScans recent_{kMostScans};
};

}  // namespace revisit
