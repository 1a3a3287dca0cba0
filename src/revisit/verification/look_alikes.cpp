// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/look_alikes.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

namespace revisit {
namespace {

struct Tail {
  static constexpr std::size_t kFewest = 30, kMost = 400;  ///< scores that are looked at, the last ones
  static constexpr double kShare = 0.2;                    ///< of the scores that make the tail
  static constexpr std::size_t kFewestRegistered = 10;     ///< for a tail
  static constexpr double kRare = 1e-3;                    ///< share of the places elsewhere that would reach the end
  static constexpr double kUsualEnd = 3.0;                 ///< of the recordings that the model was learnt on
  static constexpr double kHarmlessEnd = 2.0;              ///< a tail that ends there needs no caution in a map
  static constexpr double kMostCaution = 3.0;              ///< log odds
  static constexpr double kMostTrust = 3.0;                ///< in a map
  static constexpr double kDoubt = 30.0;                   ///< scores by which what is usual counts
};

struct Excess {
  double begin = 0.0, mean = 0.0, variance = 0.0;  // of the scores beyond `begin`
  double rare = 1.0;                               // the share of them that makes Tail::kRare of all
};

std::optional<Excess> tail_of(std::vector<double> scores) {
  // Of those that were not worth registering, little is known.
  const auto registered = static_cast<std::size_t>(
      std::count_if(scores.begin(), scores.end(), [](double each) { return each > LookAlikes::kNotRegistered; }));
  if (registered < Tail::kFewestRegistered) return std::nullopt;
  const auto n = static_cast<double>(scores.size());
  const std::size_t count = std::min(static_cast<std::size_t>(Tail::kShare * n), registered / 2);
  std::nth_element(scores.begin(), scores.begin() + static_cast<std::ptrdiff_t>(count), scores.end(), std::greater<>());
  Excess tail{.begin = scores[count], .rare = Tail::kRare * n / static_cast<double>(count)};
  for (std::size_t i = 0; i < count; ++i) tail.mean += (scores[i] - tail.begin) / static_cast<double>(count);
  for (std::size_t i = 0; i < count; ++i)
    tail.variance += std::pow(scores[i] - tail.begin - tail.mean, 2) / static_cast<double>(count);
  return tail;
}

// Where a tail that falls off exponentially leaves but a rare share.
double end_of_exponential(const Excess& tail) { return tail.begin - tail.mean * std::log(tail.rare); }

// The same of a generalised Pareto distribution (by its moments; Hosking and Wallis, Technometrics 1987), which has an
// end where what is alike does.
double end_of_pareto(const Excess& tail) {
  constexpr double kStraight = 1e-3;
  const double ratio = tail.mean * tail.mean / std::max(tail.variance, 1e-9);
  const double shape = 0.5 * (1.0 - ratio), scale = 0.5 * tail.mean * (ratio + 1.0);
  if (std::abs(shape) < kStraight) return end_of_exponential(tail);
  return tail.begin + scale / shape * (std::pow(tail.rare, -shape) - 1.0);
}

}  // namespace

void LookAlikes::add(double log_odds) {
  if (scores_.size() < Tail::kMost)
    scores_.push_back(log_odds);
  else
    scores_[next_++ % Tail::kMost] = log_odds;
  known_.reset();
}

double LookAlikes::correction(bool is_map) const {
  if (scores_.size() < Tail::kFewest) return 0.0;
  const auto n = static_cast<double>(scores_.size());
  const double known = n / (n + Tail::kDoubt), most_trust = is_map ? Tail::kMostTrust : 0.0;
  const std::optional<Excess> tail = tail_of(scores_);
  if (!tail) return known * most_trust;
  const double more = Tail::kUsualEnd - end_of_exponential(*tail);
  if (is_map && more < 0.0)
    return known * std::clamp(Tail::kHarmlessEnd - end_of_pareto(*tail), -Tail::kMostCaution, 0.0);
  return known * std::clamp(more, -Tail::kMostCaution, most_trust);
}

double LookAlikes::log_odds() const {
  if (!known_) known_ = correction(false);
  return *known_;
}

double LookAlikes::log_odds_in_map() const { return correction(true); }

}  // namespace revisit
