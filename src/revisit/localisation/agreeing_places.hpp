// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <limits>
#include <map>

#include <revisit/core/ids.hpp>

namespace revisit {

/// Several places of a map that were each registered with one scan, and show it at the same pose: more speaks for the
/// pose than the likeliest of them says, but less than all, since places side by side see much of the same. A value:
/// safe to copy and to read from several threads.
class AgreeingPlaces {
 public:
  /// A place that shows the scan at this pose, and the log odds of it by itself. Of two registrations of a place the
  /// likelier counts.
  void add(FrameId place, double log_odds) {
    const auto [known, is_new] = of_place_.try_emplace(place, log_odds);
    if (!is_new && log_odds > known->second) known->second = log_odds;
  }
  /// A place that shows the scan at another pose, and the log odds of that. It counts as if those beside it, which were
  /// not registered, said the same.
  void add_against(double log_odds);

  /// That the pose is right and the others are wrong; 0 without a place. More where others were tried and none comes
  /// near: then nothing in the map looks like it.
  double log_odds() const;

 private:
  std::map<FrameId, double> of_place_;
  double against_ = 0.0;  ///< odds
  std::size_t others_ = 0;
  double likeliest_other_ = -std::numeric_limits<double>::infinity();  ///< log odds
};

}  // namespace revisit
