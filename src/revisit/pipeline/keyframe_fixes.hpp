// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <revisit/core/gps_fix.hpp>
#include <revisit/core/scan.hpp>

namespace revisit {

/// Where a GPS receiver has key frames: between the fixes before and after each. A receiver's error hardly changes from
/// one key frame to the next: of those that lie together, one is kept. Belongs to one thread at a time.
class KeyframeFixes {
 public:
  /// All that a recording has, in the order of their times, by its clock.
  void set(std::vector<GpsFix> fixes) { fixes_.assign(fixes.begin(), fixes.end()); }

  using Waiting = std::vector<std::pair<FrameId, double>>;  ///< key frames with their stamps, seconds
  /// The next one of a receiver at work. Returns the key frames that waited for it: ask for their fixes again. Ignored
  /// where it is not newer; one that is older by far begins anew: the clock was set back, or lied.
  Waiting add(const GpsFix& fix);

  /// The fix of a key frame that lies there in the graph, metres. None where no fix lies close enough before and after,
  /// where they make no sense, or where another key frame nearby has one. Where the fix after it is still to come, the
  /// key frame waits for it.
  std::optional<GpsFix> fix_of(FrameId keyframe, double stamp_s, const Eigen::Vector3d& at_m);

  void archive(auto& fields) { fields(fixes_, waiting_, last_at_m_); }

 private:
  std::deque<GpsFix> fixes_;
  Waiting waiting_;
  std::optional<Eigen::Vector3d> last_at_m_;  ///< where the last key frame was that has one
};

}  // namespace revisit
