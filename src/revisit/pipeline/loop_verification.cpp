// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/loop_verification.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace revisit {
namespace {

constexpr double kNear_m = 1.5;     // nearer, no better place is looked for
constexpr double kMostAhead = 5.0;  // log odds, of being ahead of the runner-up

}  // namespace

LoopVerification::LoopVerification(const Known& known, const PreparedScan& query)
    : known_(known),
      options_(known.parameters.geometric),
      query_(query),
      overhead_(query.cloud),
      query_geometry_(query.geometry) {}

const ScanGeometry& LoopVerification::query_geometry() {
  if (!query_geometry_) query_geometry_ = std::make_shared<ScanGeometry>(query_.cloud);
  return *query_geometry_;
}

bool LoopVerification::is_sure(double log_odds) const { return probability_of(log_odds) >= options_.min_probability; }

Result<std::optional<Opinion>> LoopVerification::answer(std::span<const LoopCandidate> candidates) {
  const auto followed = expected();
  if (!followed) return followed.error();
  const std::optional<Opinion>& there = *followed;
  if (there && there->reason.empty() && is_sure(there->own_log_odds()) && there->distance_m() <= kNear_m) {
    opinions_.push_back(*there);  // nobody else is asked
    return there;
  }
  if (const Status status = look_at(candidates); !status) return status.error();
  ask_best();
  const auto is_there = [&](const Opinion& each) { return each.candidate.match == there->candidate.match; };
  if (there && std::none_of(opinions_.begin(), opinions_.end(), is_there)) opinions_.push_back(*there);
  if (opinions_.empty()) return std::optional<Opinion>();

  const auto log_odds = [](const Opinion& each) { return each.geometric ? each.geometric->log_odds : -1e9; };
  const auto likeliest = std::max_element(opinions_.begin(), opinions_.end(), [&](const Opinion& a, const Opinion& b) {
    return log_odds(a) < log_odds(b);
  });
  ask_runner_up(static_cast<std::size_t>(likeliest - opinions_.begin()));
  weigh_against_each_other();
  std::optional<Opinion> best = *std::max_element(
      opinions_.begin(), opinions_.end(), [](const Opinion& a, const Opinion& b) { return a.score() < b.score(); });
  if (best->reason.empty())
    if (const Status status = go_nearer(*best); !status) return status.error();
  return best;
}

// Where the loops of the last metres say that the sensor is.
Result<std::optional<Opinion>> LoopVerification::expected() {
  if (!options_.follow) return std::optional<Opinion>();
  const auto where = known_.track.expected(query_.station, known_.stations, known_.newest);
  if (!where || where->T_match_query.translation().norm() > kOverheadReach_m) return std::optional<Opinion>();
  auto registered = register_at(*where);
  if (!registered) return registered.error();
  return std::optional<Opinion>(*std::move(registered));
}

bool LoopVerification::are_elsewhere(const Opinion& a, const Opinion& b) const {
  return std::abs(a.candidate.match.value - b.candidate.match.value) >
         2 * std::int64_t{known_.parameters.retrieval.separation_frames};
}

// Who is not sure is compared with the best candidate elsewhere, however little of that one overlaps.
void LoopVerification::ask_runner_up(std::size_t unsure) {
  const Opinion& it = opinions_[unsure];
  if (!it.geometric || is_sure(it.geometric->log_odds) || !is_sure(it.geometric->log_odds + kMostAhead)) return;
  std::optional<Opinion> rival;
  for (const auto* all : {&opinions_, &candidates_})
    for (const Opinion& each : *all) {
      if (!are_elsewhere(each, it)) continue;
      if (each.geometric) return;  // there is one
      if (!rival) rival = each;
    }
  if (!rival) return;
  register_it(*rival);
  opinions_.push_back(*std::move(rival));
}

// A candidate that fits far better than those elsewhere is the likelier for it: where a scene shows little, even the
// right place fits poorly. Chosen on recordings that no reported figure uses (docs/accuracy.md).
void LoopVerification::weigh_against_each_other() {
  constexpr double kNothingBelow = 8.0, kShare = 0.5;
  for (Opinion& each : opinions_) {
    if (!each.geometric) continue;
    std::optional<double> runner_up;
    for (const Opinion& other : opinions_)
      if (other.geometric && are_elsewhere(other, each))
        runner_up = std::max(runner_up.value_or(-1e9), other.own_log_odds());
    if (!runner_up) continue;
    const double ahead = std::clamp(kShare * (each.own_log_odds() - *runner_up - kNothingBelow), 0.0, kMostAhead);
    if (ahead == each.ahead_log_odds) continue;
    each.ahead_log_odds = ahead;
    judge_with_context(each);
  }
}

// Where another place is nearer to the query than the one that was found, asks that too. From far away little fits even
// at the right place, and much is forgiven; what is much nearer must fit by itself, so that it decides.
Status LoopVerification::go_nearer(Opinion& answer) {
  constexpr double kWorthIt_m = 0.3, kMuchNearer = 0.5;
  if (!options_.overhead_search || answer.distance_m() < kNear_m) return ok();
  const auto nearest =
      nearest_place(known_.stations, answer.candidate.match, answer.geometric->T_match_query, known_.newest);
  if (!nearest) return ok();
  const double nearest_m = nearest->T_match_query.translation().norm();
  if (nearest_m + kWorthIt_m > answer.distance_m()) return ok();
  auto nearer = register_at(*nearest);
  if (!nearer) return nearer.error();
  const std::size_t at = opinions_.size();
  opinions_.push_back(*std::move(nearer));
  ask_runner_up(at);
  weigh_against_each_other();
  const Opinion& found = opinions_[at];
  const bool decides = nearest_m < kMuchNearer * answer.distance_m();
  if (decides || (found.reason.empty() && found.distance_m() < answer.distance_m())) answer = found;
  return ok();
}

}  // namespace revisit
