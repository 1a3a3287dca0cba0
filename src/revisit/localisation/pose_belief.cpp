// SPDX-License-Identifier: Apache-2.0
#include <revisit/localisation/pose_belief.hpp>

#include <algorithm>
#include <cmath>

namespace revisit {
namespace {

struct Adding {
  static constexpr double kMetresARadian = 3.0;           ///< a turn shows as much anew as so many metres
  static constexpr double kMost = 6.0;                    ///< log odds that one view adds, either way
  static constexpr double kNotAlone = 2.0, kAlike = 1.0;  ///< and one that does not decide alone
  static constexpr double kNotSeenAgain = -1.0;           ///< for a view that does not confirm it
  static constexpr double kForgotten = -12.0;             ///< log odds
  // Two poses are the same within this, and so much more for what was travelled in between.
  static constexpr double kSame_m = 0.5, kSame_mAMetre = 0.02, kSame_deg = 3.0;
};

}  // namespace

double PoseBelief::log_odds_of_view(double own_log_odds, bool decides_alone, bool resembles_others) {
  if (decides_alone) return own_log_odds;
  return resembles_others ? std::min(own_log_odds - kAskedOfAlike, Adding::kAlike)
                          : std::min(own_log_odds, Adding::kNotAlone);
}

void PoseBelief::add(const TrajectoryPoint& point, std::span<const Sighting> sightings) {
  if (last_ && last_->segment != point.segment) {
    hypotheses_.clear();
    last_.reset();
  }
  const double moved_m =
      last_ ? point.travelled_m - last_->travelled_m + Adding::kMetresARadian * (point.turned_rad - last_->turned_rad)
            : kAnotherView_m;
  const double weight = std::clamp(moved_m / kAnotherView_m, 0.0, 1.0);
  last_ = point;
  std::vector<bool> is_seen(hypotheses_.size(), false);
  for (const Sighting& sighting : sightings) {
    const Pose T_map_segment = sighting.T_map_lidar * point.T_segment_lidar.inverse();
    const double new_log_odds = std::clamp(sighting.log_odds, -Adding::kMost, Adding::kMost);
    const auto known = std::find_if(hypotheses_.begin(), hypotheses_.end(), [&](const Hypothesis& each) {
      const Pose error = (each.T_map_segment * point.T_segment_lidar).inverse() * sighting.T_map_lidar;
      return each.part == sighting.part &&
             error.translation().norm() <= Adding::kSame_m + Adding::kSame_mAMetre * moved_m &&
             rotation_angle(error) <= to_radians(Adding::kSame_deg);
    });
    if (known == hypotheses_.end()) {
      hypotheses_.push_back({sighting.match, sighting.part, T_map_segment, sighting.log_odds + sighting.prior_log_odds,
                             sighting.resembles_others});
      continue;
    }
    const auto i = static_cast<std::size_t>(known - hypotheses_.begin());
    known->match = sighting.match;
    known->T_map_segment = T_map_segment;
    known->resembles_others = sighting.resembles_others;
    if (i >= is_seen.size()) {  // of this scan already: another place says the same
      known->log_odds = std::max(known->log_odds, sighting.log_odds + sighting.prior_log_odds);
    } else if (!is_seen[i]) {
      is_seen[i] = true;
      known->log_odds = std::max(known->log_odds + weight * new_log_odds, sighting.log_odds);
    }
  }
  for (std::size_t i = 0; i < is_seen.size(); ++i)
    if (!is_seen[i]) hypotheses_[i].log_odds += weight * Adding::kNotSeenAgain;
  std::erase_if(hypotheses_, [](const Hypothesis& each) { return each.log_odds < Adding::kForgotten; });
}

std::optional<PoseBelief::Hypothesis> PoseBelief::best() const {
  const auto likeliest = std::max_element(hypotheses_.begin(), hypotheses_.end(),
                                          [](const auto& a, const auto& b) { return a.log_odds < b.log_odds; });
  if (likeliest == hypotheses_.end()) return std::nullopt;
  double others = 1.0;
  for (const Hypothesis& each : hypotheses_)
    if (&each != &*likeliest) others += std::exp(each.log_odds);
  Hypothesis best = *likeliest;
  best.log_odds -= std::log(others);
  return best;
}

}  // namespace revisit
