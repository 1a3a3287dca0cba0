// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
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

  struct Points {
    std::vector<Point> points;
    std::vector<std::uint8_t> is_ground;  ///< one a point

    void archive(auto& fields) { fields(points, is_ground); }
  };
  /// Of the scans before the last one, in its frame, metres: those taken at most `time_s` before it and within
  /// `distance_m` of it, on the same segment of odometry.
  Points before_last(double time_s, double distance_m) const;

  /// Without how many are kept.
  void archive(auto& fields) {
    fields(scans_);
    fields.require(std::all_of(scans_.begin(), scans_.end(), [](const Thinned& each) { return each.is_sound(); }));
  }

 private:
  struct Thinned {
    Points all;
    TrajectoryPoint at;
    double stamp_s = 0.0;

    void archive(auto& fields) { fields(all, at, stamp_s); }
    bool is_sound() const;
  };
  void append(const Thinned& scan, Points& to) const;

  std::size_t most_;
  std::deque<Thinned> scans_;
};

}  // namespace revisit
