// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/loop_verification.hpp>

#include <algorithm>
#include <cmath>

namespace revisit {
namespace {

constexpr double kNear_m = 1.5;  // nearer, no better place is looked for

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
  ask_them();
  const auto is_there = [&](const Opinion& each) { return each.candidate.match == there->candidate.match; };
  if (there && std::none_of(opinions_.begin(), opinions_.end(), is_there)) opinions_.push_back(*there);
  if (opinions_.empty()) return std::optional<Opinion>();

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
  opinions_.push_back(*std::move(nearer));
  const Opinion& found = opinions_.back();
  const bool decides = nearest_m < kMuchNearer * answer.distance_m();
  if (decides || (found.reason.empty() && found.distance_m() < answer.distance_m())) answer = found;
  return ok();
}

}  // namespace revisit
