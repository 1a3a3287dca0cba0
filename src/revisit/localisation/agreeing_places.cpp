// SPDX-License-Identifier: Apache-2.0
#include <revisit/localisation/agreeing_places.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

namespace revisit {
namespace {

// Each further place counts half (docs/maps.md, "Several places together").
constexpr double kFurther = 0.5;
constexpr int kMost = 4;

// Where a pose is surer than each of several others, the more the farther (docs/maps.md, "Standing out").
struct StandingOut {
  static constexpr std::size_t kFewestOthers = 6;
  static constexpr double kBegins_log_odds = 8.0, kFar_log_odds = 16.0;  ///< ahead of the likeliest other
  static constexpr double kMost_log_odds = 5.0;
};

}  // namespace

void AgreeingPlaces::add_against(double log_odds) {
  against_ += std::exp((1.0 + kFurther * (kMost - 1)) * log_odds);
  likeliest_other_ = std::max(likeliest_other_, log_odds);
  ++others_;
}

double AgreeingPlaces::log_odds() const {
  if (of_place_.empty()) return 0.0;
  std::vector<double> log_odds;
  log_odds.reserve(of_place_.size());
  for (const auto& [place, its] : of_place_) log_odds.push_back(its);
  std::sort(log_odds.begin(), log_odds.end(), std::greater<>());
  double sum = 0.0;
  for (std::size_t i = 0; i < log_odds.size() && i < kMost; ++i) sum += (i == 0 ? 1.0 : kFurther) * log_odds[i];
  sum -= std::log1p(against_);
  if (others_ < StandingOut::kFewestOthers) return sum;
  const double ahead = log_odds.front() - likeliest_other_;
  const double share = std::clamp(
      (ahead - StandingOut::kBegins_log_odds) / (StandingOut::kFar_log_odds - StandingOut::kBegins_log_odds), 0.0, 1.0);
  return sum + share * StandingOut::kMost_log_odds;
}

}  // namespace revisit
