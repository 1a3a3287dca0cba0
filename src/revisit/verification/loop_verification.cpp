// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/loop_verification.hpp>

#include <algorithm>

namespace revisit {
namespace {

// The nearer place: from far away little fits even at the right place; what is much nearer fits better where the pose
// is right, and decides, with what the far one says for it (docs/history.md).
struct NearerPlace {
  static constexpr double kNear_m = 1.5;        ///< nearer, no better place is looked for
  static constexpr double kWorthwhile_m = 0.3;  ///< gain in distance
  static constexpr double kDecides = 0.5;       ///< share of the answer's distance below which the nearer one decides
};

}  // namespace

Result<std::optional<Hypothesis>> LoopVerification::verify(std::span<const LoopCandidate> candidates) {
  auto predicted = test_predicted_place();
  if (!predicted) return predicted;
  if (*predicted && is_sufficient(**predicted)) {
    hypotheses_.push_back(**predicted);
    return predicted;
  }
  auto tested = registration_.test(candidates);
  if (!tested) return tested.error();
  hypotheses_ = *std::move(tested);
  if (const auto& there = *predicted;
      there && std::none_of(hypotheses_.begin(), hypotheses_.end(),
                            [&](const Hypothesis& each) { return each.candidate.match == there->candidate.match; }))
    hypotheses_.push_back(*there);
  if (hypotheses_.empty()) return std::optional<Hypothesis>();

  std::optional<Hypothesis> best =
      *std::max_element(hypotheses_.begin(), hypotheses_.end(),
                        [](const Hypothesis& a, const Hypothesis& b) { return a.score() < b.score(); });
  if (best->is_accepted())
    if (const Status status = test_nearer_place(*best); !status) return status.error();
  return best;
}

// Surer by its own evidence than look-alikes are, and near: no candidate can be better.
bool LoopVerification::is_sufficient(const Hypothesis& predicted) const {
  constexpr double kBeyondDoubt = 6.0;  // log odds
  return predicted.is_accepted() && predicted.own_log_odds() >= kBeyondDoubt &&
         predicted.distance_m() <= NearerPlace::kNear_m;
}

Result<std::optional<Hypothesis>> LoopVerification::test_predicted_place() {
  if (!context_.parameters.geometric.follow) return std::optional<Hypothesis>();
  const auto prediction = context_.following.predict(query_.trajectory_point, context_.places, context_.newest);
  if (!prediction || prediction->T_match_query.translation().norm() > CandidateRegistration::kReach_m)
    return std::optional<Hypothesis>();
  auto tested = registration_.test(*prediction);
  if (!tested) return tested.error();
  return std::optional<Hypothesis>(*std::move(tested));
}

Status LoopVerification::test_nearer_place(Hypothesis& answer) {
  if (!context_.parameters.geometric.overhead_search || answer.distance_m() < NearerPlace::kNear_m) return ok();
  auto nearest =
      nearest_place(context_.places, answer.candidate.match, answer.geometric->T_match_query, context_.newest);
  if (!nearest) return ok();
  const double nearest_m = nearest->T_match_query.translation().norm();
  if (nearest_m + NearerPlace::kWorthwhile_m > answer.distance_m()) return ok();
  nearest->log_odds = answer.geometric->log_odds;
  auto tested = registration_.test(*nearest);
  if (!tested) return tested.error();
  hypotheses_.push_back(*std::move(tested));
  const Hypothesis& nearer = hypotheses_.back();
  const bool decides = nearest_m < NearerPlace::kDecides * answer.distance_m();
  if (decides || (nearer.is_accepted() && nearer.distance_m() < answer.distance_m())) answer = nearer;
  return ok();
}

}  // namespace revisit
