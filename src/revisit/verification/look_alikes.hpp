// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

namespace revisit {

/// How much alike different places of this recording are. Of places that odometry knows to be elsewhere, the one that
/// looks most like the scan is registered as if it were its place; the tail of these log odds (extreme value theory, as
/// in Scheirer et al., "Meta-recognition", TPAMI 2011) tells what a wrong place reaches here. Belongs to one thread at
/// a time.
class LookAlikes {
 public:
  /// The log odds that a place elsewhere reached by itself; little where it was not even worth registering.
  void add(double log_odds);
  /// What this recording adds to the log odds of every pose: less than nothing where places are more alike than in the
  /// recordings that the model was learnt on, else, and until enough is known, nothing.
  double log_odds() const;

  /// The same for scores of places that a finished map knows to be elsewhere: where these stay below what other
  /// recordings have, more than nothing is added. Where they do not, the tail is taken to have an end (generalised
  /// Pareto), since all places of the map are known; log_odds() must expect places that nobody has seen yet.
  double log_odds_in_map() const;

  static constexpr double kNotRegistered = -20.0;
  void archive(auto& fields) {
    fields(scores_, next_);
    known_.reset();
  }

 private:
  double correction(bool is_map) const;

  std::vector<double> scores_;  ///< the last ones, in order
  std::size_t next_ = 0;
  mutable std::optional<double> known_;
};

}  // namespace revisit
