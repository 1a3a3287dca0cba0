// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/loop_verification.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include <revisit/verification/acceptance.hpp>
#include <revisit/verification/elsewhere.hpp>

namespace revisit {
namespace {

// The nearer place: from far away little fits even at the right place; what is much nearer fits better where the pose
// is right, and decides, with what the far one says for it (docs/history.md).
struct NearerPlace {
  static constexpr double kNear_m = 1.5;        ///< nearer, no better place is looked for
  static constexpr double kWorthwhile_m = 0.3;  ///< gain in distance
  static constexpr double kDecides = 0.5;       ///< share of the answer's distance below which the nearer one decides
};

// Poses that are registered besides, where a scan alone fits none of the best: where places look alike, the right one
// may come later (docs/maps.md, "Further places").
constexpr std::size_t kFurther = 11;

// Of a scan that is prepared anew: poses that are so far behind the likeliest are not registered again.
constexpr double kNearly_log_odds = 10.0;

struct StandingOut {
  static constexpr double kFar_log_odds = 8.0;  ///< above the next one: nothing is like it
  static constexpr double kMostTrust = 0.8;     ///< share of the caution that it then takes away
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
  const auto is_enough = [&](const Hypothesis& each) {
    return context_.is_thorough ? each.is_accepted() : each.geometric && each.own_log_odds() >= 0.0;
  };
  tried_further_ = !query_.trajectory_point && std::none_of(hypotheses_.begin(), hypotheses_.end(), is_enough);
  if (tried_further_)
    for (Hypothesis& each : registration_.test_next(kFurther)) hypotheses_.push_back(std::move(each));
  if (const auto& there = *predicted;
      there && std::none_of(hypotheses_.begin(), hypotheses_.end(),
                            [&](const Hypothesis& each) { return each.candidate.match == there->candidate.match; }))
    hypotheses_.push_back(*there);
  return best_of_tested();
}

Result<std::optional<Hypothesis>> LoopVerification::verify_there(std::span<const Hypothesis> before) {
  double best = -std::numeric_limits<double>::infinity();
  for (const Hypothesis& each : before) {
    if (!each.geometric) continue;
    hypotheses_.push_back(each);
    hypotheses_.back().geometry.reset();
    best = std::max(best, each.own_log_odds());
  }
  for (Hypothesis& each : hypotheses_) {
    if (each.own_log_odds() < best - kNearly_log_odds) {
      each.refusal = Refusal{Refusal::Reason::kImprobable};  // it was accepted for what the scan is no longer
      continue;
    }
    auto again = registration_.test({each.candidate.match, each.geometric->T_match_query, 0.0});
    if (!again) return again.error();
    each = *std::move(again);
  }
  return best_of_tested();
}

Result<std::optional<Hypothesis>> LoopVerification::best_of_tested() {
  if (hypotheses_.empty()) return std::optional<Hypothesis>();
  if (!query_.trajectory_point) trust_what_stands_out();
  weigh_against_each_other();
  std::optional<Hypothesis> best =
      *std::max_element(hypotheses_.begin(), hypotheses_.end(),
                        [](const Hypothesis& a, const Hypothesis& b) { return a.score() < b.score(); });
  if (best->is_accepted())
    if (const Status status = test_nearer_place(*best); !status) return status.error();
  return best;
}

Result<std::optional<Hypothesis>> LoopVerification::verify_again(std::span<const RegisteredPose> registered) {
  auto predicted = test_predicted_place();
  if (!predicted || !*predicted) return predicted;
  hypotheses_.push_back(*std::move(*predicted));
  for (const RegisteredPose& each : registered) {
    Hypothesis& other = hypotheses_.emplace_back();
    other.candidate.match = each.match;
    other.geometric.emplace();
    other.geometric->T_match_query = each.T_match_query;
    other.geometric->log_odds = each.log_odds;
    other.refusal = Refusal{Refusal::Reason::kImprobable};  // as it was then
  }
  weigh_against_each_other();
  hypotheses_.resize(1);
  return std::optional<Hypothesis>(hypotheses_.front());
}

// Places that are alike call for caution (LookAlikes). Of a scan alone in a finished map, those that look most like it
// have been registered, too: the caution is for them, and a pose that fits far better than any other needs less of it.
void LoopVerification::trust_what_stands_out() {
  const double caution = -context_.look_alikes_log_odds;
  if (caution <= 0.0) return;
  for (Hypothesis& each : hypotheses_) {
    if (!each.geometric) continue;
    double next = StandingOut::kFar_log_odds;
    for (const Hypothesis& other : hypotheses_)
      if (&other != &each && other.geometric && exclude_each_other(each, other))
        next = std::min(next, each.own_log_odds() - other.own_log_odds());
    const double share = std::clamp(next / StandingOut::kFar_log_odds, 0.0, 1.0) * StandingOut::kMostTrust;
    GeometricEvidence& found = *each.geometric;
    decide(found, -caution * (1.0 - share), found.log_odds - found.own_log_odds, context_.parameters.geometric);
    if (each.geometry) each.refusal = found.refusal;  // else as it was before: no answer (verify_there)
  }
}

// The query stands at one pose: what another explains better speaks against this one.
void LoopVerification::weigh_against_each_other() {
  std::vector<double> log_odds;
  log_odds.reserve(hypotheses_.size());
  for (const Hypothesis& each : hypotheses_) log_odds.push_back(each.geometric ? each.geometric->log_odds : 0.0);
  for (std::size_t i = 0; i < hypotheses_.size(); ++i) {
    if (!hypotheses_[i].is_accepted()) continue;
    double others = 0.0;
    for (std::size_t j = 0; j < hypotheses_.size(); ++j)
      if (j != i && hypotheses_[j].geometric && exclude_each_other(hypotheses_[i], hypotheses_[j]))
        others = std::max(others, std::exp(log_odds[j]));
    if (others == 0.0) continue;
    GeometricEvidence& found = *hypotheses_[i].geometric;
    // The caution for look-alikes, less what trust_what_stands_out() took away.
    const double of_recording = found.own_log_odds - loop_log_odds(found.evidence);
    decide(found, of_recording, log_odds[i] - found.own_log_odds - std::log1p(others), context_.parameters.geometric);
    hypotheses_[i].refusal = found.refusal;
  }
}

bool LoopVerification::exclude_each_other(const Hypothesis& a, const Hypothesis& b) const {
  const auto &place_a = context_.places.at(a.candidate.match), &place_b = context_.places.at(b.candidate.match);
  return place_a && place_b &&
         are_other_poses(*place_a, a.geometric->T_match_query, *place_b, b.geometric->T_match_query);
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
