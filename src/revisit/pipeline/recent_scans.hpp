// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <deque>
#include <vector>

#include <revisit/pipeline/prepare.hpp>

namespace revisit {

/// The last scans of a drive as one cloud, laid together by odometry: for methods that describe more than one. Belongs
/// to one thread at a time.
class RecentScans {
 public:
  /// Keeps up to `most` scans, each thinned to a point in 0.25 m.
  explicit RecentScans(std::size_t most) : most_(most) {}

  /// Scans that came before odometry began anew are forgotten.
  void add(const PreparedScan& scan);

  /// Of the last `count` scans, metres, in the frame of the last one.
  std::vector<Point> together(std::size_t count) const;

 private:
  struct Thinned {
    std::vector<Point> points;
    TrajectoryPoint at;
  };
  std::size_t most_;
  std::deque<Thinned> scans_;
};

}  // namespace revisit
