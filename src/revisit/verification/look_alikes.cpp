// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/look_alikes.hpp>

#include <algorithm>
#include <cmath>

namespace revisit {
namespace {

struct Tail {
  static constexpr std::size_t kFewest = 30, kMost = 400;  ///< scores that are looked at, the last ones
  static constexpr double kShare = 0.2;                    ///< of the scores that make the tail
  static constexpr std::size_t kFewestRegistered = 10;     ///< for a tail
  static constexpr double kRare = 1e-3;                    ///< share of the places elsewhere that would reach the end
  static constexpr double kUsualEnd = 3.0;                 ///< of the recordings that the model was learnt on
  static constexpr double kMostCaution = 3.0;              ///< log odds
  static constexpr double kMostTrust = 3.0;                ///< in a map
  static constexpr double kDoubt = 30.0;                   ///< scores by which what is usual counts
};

// Where a tail of exceedances that fall off exponentially leaves but a rare share.
double end_of_tail(std::vector<double> scores) {
  // Of those that were not worth registering, little is known.
  const auto registered = static_cast<std::size_t>(
      std::count_if(scores.begin(), scores.end(), [](double each) { return each > LookAlikes::kNotRegistered; }));
  if (registered < Tail::kFewestRegistered) return LookAlikes::kNotRegistered;
  const auto n = static_cast<double>(scores.size());
  const std::size_t tail = std::min(static_cast<std::size_t>(Tail::kShare * n), registered / 2);
  std::nth_element(scores.begin(), scores.begin() + static_cast<std::ptrdiff_t>(tail), scores.end(), std::greater<>());
  const double begin = scores[tail];
  double excess = 0.0;
  for (std::size_t i = 0; i < tail; ++i) excess += scores[i] - begin;
  return begin + excess / static_cast<double>(tail) * std::log(static_cast<double>(tail) / n / Tail::kRare);
}

}  // namespace

void LookAlikes::add(double log_odds) {
  if (scores_.size() < Tail::kMost)
    scores_.push_back(log_odds);
  else
    scores_[next_++ % Tail::kMost] = log_odds;
  known_.reset();
}

double LookAlikes::correction(double most_trust) const {
  if (scores_.size() < Tail::kFewest) return 0.0;
  const auto n = static_cast<double>(scores_.size());
  return n / (n + Tail::kDoubt) * std::clamp(Tail::kUsualEnd - end_of_tail(scores_), -Tail::kMostCaution, most_trust);
}

double LookAlikes::log_odds() const {
  if (!known_) known_ = correction(0.0);
  return *known_;
}

double LookAlikes::log_odds_in_map() const { return correction(Tail::kMostTrust); }

}  // namespace revisit
