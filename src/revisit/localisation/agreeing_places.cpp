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

}  // namespace

void AgreeingPlaces::add_against(double log_odds) { against_ += std::exp((1.0 + kFurther * (kMost - 1)) * log_odds); }

double AgreeingPlaces::log_odds() const {
  std::vector<double> log_odds;
  log_odds.reserve(of_place_.size());
  for (const auto& [place, its] : of_place_) log_odds.push_back(its);
  std::sort(log_odds.begin(), log_odds.end(), std::greater<>());
  double sum = 0.0;
  for (std::size_t i = 0; i < log_odds.size() && i < kMost; ++i) sum += (i == 0 ? 1.0 : kFurther) * log_odds[i];
  return sum - std::log1p(against_);
}

}  // namespace revisit
