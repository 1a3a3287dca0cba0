// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <utility>

#include <oneapi/tbb/parallel_for.h>

#include <revisit/descriptors/similarity.hpp>
#include <revisit/pipeline/loop_detector.hpp>

namespace revisit {
namespace {

constexpr int kOverheadReach_m = 6;  // a translation that retrieval may be off
constexpr double kNear_m = 1.5;      // nearer, no better place is looked for
constexpr double kMostAhead = 5.0;   // log odds, of being ahead of the runner-up

}  // namespace

double LoopDetector::Opinion::score() const {
  // Registration knows best, then the view from overhead, then the descriptors. Flattened, so that no two sure ones
  // are equal.
  constexpr double kFlat = 6.0;
  const double registered = geometric ? 1.0 / (1.0 + std::exp(-own_log_odds() / kFlat)) : 0.0;
  const double evidence = candidate.geometry_score / 4.0 + overlap / 4.0 + registered;
  if (!geometric) return evidence;
  // A loop over more than this is a right constraint, but not the same place (docs/evaluation.md).
  // Poses have errors: close to the limit it is open which of the two it is.
  constexpr double kSamePlace_m = 4.0, kOpen_m = 0.5, kRefused = 0.2;
  const double same_place = std::clamp((kSamePlace_m - distance_m()) / kOpen_m, 0.0, 1.0);
  return reason.empty() ? evidence + 1.0 + same_place : evidence + kRefused * same_place;
}

const ScanGeometry& LoopDetector::Query::geometry() {
  if (!geometry_) geometry_ = std::make_shared<ScanGeometry>(scan.cloud);
  return *geometry_;
}

void LoopDetector::register_it(Query& query, Opinion& opinion) const {
  opinion.geometry = std::make_shared<ScanGeometry>(*opinion.place);
  CandidateView view{opinion.T_guess_match_query, opinion.overlap};
  if (const auto usual = ego_motion_.usual_intensity_correlation()) view.usual_intensity_correlation = *usual;
  opinion.geometric = check_geometric(*opinion.geometry, query.geometry(), view, parameters_.geometric);
  opinion.followed_log_odds =
      track_.in_favour(query.scan.station, stations_.at(opinion.candidate.match), opinion.geometric->T_match_query);
  judge_with_context(opinion);
}

Status LoopDetector::verify(Detection& detection, const PreparedScan& prepared) {
  Stopwatch watch;
  Query query(prepared);
  std::optional<Opinion> answer;

  // Where the loops of the last metres say that the robot is. Sure and near: nobody else is asked.
  std::optional<Opinion> expected;
  if (parameters_.geometric.follow)
    if (const auto where = track_.expected(prepared.station, stations_, *detection.newest_searchable);
        where && where->T_match_query.translation().norm() <= kOverheadReach_m) {
      auto registered = register_at(query, *where);
      if (!registered) return registered.error();
      expected = *std::move(registered);
      if (expected->reason.empty() && is_sure(expected->own_log_odds()) && expected->distance_m() <= kNear_m)
        answer = expected;
    }
  detection.geometric_ms += watch.lap_ms();

  std::vector<Opinion> opinions, others;
  if (!answer) {
    auto candidates = look_at_candidates(query, detection);
    if (!candidates) return candidates.error();
    opinions = ask_best(query, *candidates, detection);
    detection.geometric_ms += watch.lap_ms();
    const auto is_expected = [&](const Opinion& each) { return each.candidate.match == expected->candidate.match; };
    if (expected && std::none_of(opinions.begin(), opinions.end(), is_expected)) opinions.push_back(*expected);
    others = *std::move(candidates);
    ask_runner_up(query, likeliest(opinions), opinions, others);
    weigh_against_each_other(opinions);
    const Opinion* best = nullptr;
    for (const Opinion& each : opinions)
      if (best == nullptr || each.score() > best->score()) best = &each;
    if (best == nullptr) return ok();
    answer = *best;
  } else {
    opinions.push_back(*answer);
  }
  for (const Opinion& each : opinions)
    if (each.geometric) detection.registered.push_back({each.candidate.match, *each.geometric});

  if (answer->reason.empty())
    if (const Status status = go_nearer(query, *detection.newest_searchable, opinions, others, *answer); !status)
      return status;
  if (answer->reason.empty()) {
    remember_loop(prepared.station, *answer);
    refine(*answer->geometric, *answer->geometry, query.geometry());
  }
  detection.geometric_ms += watch.lap_ms();

  detection.answer = answer->candidate;
  detection.temporal = std::move(answer->temporal);
  detection.score = answer->score();
  detection.reason = answer->reason;
  detection.geometric = std::move(answer->geometric);
  if (detection.reason.empty()) {
    const GeometricEvidence& found = *detection.geometric;
    detection.loop =
        LoopConstraint{detection.frame,       detection.answer->match, found.T_match_query, found.evidence.inlier_ratio,
                       found.evidence.rmse_m, found.probability,       found.information};
  }
  return ok();
}

Result<LoopDetector::Opinion> LoopDetector::register_at(Query& query, const LoopTrack::Expectation& where) {
  LoopCandidate candidate;
  if (const auto descriptor = index_.find(where.match))
    candidate = match_descriptors(query.scan.descriptor, *descriptor);
  candidate.match = where.match;
  candidate.yaw_rad = yaw_of(where.T_match_query);
  auto place = clouds_->get(where.match);
  if (!place) return place.error();
  Opinion opinion(candidate);
  opinion.place = *std::move(place);
  look_from_overhead(query.overhead, to_radians(3.0), opinion);
  opinion.T_guess_match_query = where.T_match_query;
  opinion.reason.clear();  // however little overlaps: something stands in the way, not elsewhere
  check_temporal_and_scores(query.scan.scan.frame, opinion);
  if (opinion.reason.empty()) register_it(query, opinion);
  return opinion;
}

// The candidates of retrieval, those first that look best from overhead.
Result<std::vector<LoopDetector::Opinion>> LoopDetector::look_at_candidates(Query& query,
                                                                            const Detection& detection) const {
  std::vector<Opinion> opinions;
  for (const LoopCandidate& candidate : detection.candidates) {
    auto place = clouds_->get(candidate.match);
    if (!place) return place.error();
    opinions.emplace_back(candidate).place = *std::move(place);
  }
  if (!parameters_.geometric.overhead_search) return opinions;
  // Half a sector of the descriptor and a little more.
  const double yaw_reach_rad = kPi / parameters_.descriptor.sectors + to_radians(3.0);
  for (Opinion& each : opinions) look_from_overhead(query.overhead, yaw_reach_rad, each);
  std::stable_sort(opinions.begin(), opinions.end(),
                   [](const Opinion& a, const Opinion& b) { return a.overlap > b.overlap; });
  return opinions;
}

// Takes as many as are to be registered from the front of the candidates.
std::vector<LoopDetector::Opinion> LoopDetector::ask_best(Query& query, std::vector<Opinion>& candidates,
                                                          Detection& detection) const {
  const auto count = std::min(candidates.size(), static_cast<std::size_t>(parameters_.geometric.candidates));
  const auto rest = candidates.begin() + static_cast<std::ptrdiff_t>(count);
  std::vector<Opinion> opinions(std::make_move_iterator(candidates.begin()), std::make_move_iterator(rest));
  candidates.erase(candidates.begin(), rest);
  Stopwatch watch;
  for (Opinion& each : opinions) check_temporal_and_scores(detection.frame, each);
  detection.temporal_ms += watch.lap_ms();

  // Each candidate is registered on its own; who finishes first does not matter.
  if (std::any_of(opinions.begin(), opinions.end(), [](const Opinion& each) { return each.reason.empty(); }))
    query.geometry();
  tbb::parallel_for(std::size_t{0}, opinions.size(), [&](std::size_t i) {
    if (opinions[i].reason.empty()) register_it(query, opinions[i]);
  });
  return opinions;
}

// By its own evidence and what speaks for it besides.
void LoopDetector::judge_with_context(Opinion& opinion) const {
  judge(*opinion.geometric, opinion.followed_log_odds + opinion.ahead_log_odds, parameters_.geometric);
  opinion.reason = opinion.geometric->reason;
}

bool LoopDetector::are_elsewhere(const Opinion& a, const Opinion& b) const {
  return std::abs(a.candidate.match.value - b.candidate.match.value) >
         2 * std::int64_t{parameters_.retrieval.separation_frames};
}

const LoopDetector::Opinion* LoopDetector::likeliest(const std::vector<Opinion>& opinions) {
  const Opinion* best = nullptr;
  for (const Opinion& each : opinions)
    if (each.geometric && (best == nullptr || each.geometric->log_odds > best->geometric->log_odds)) best = &each;
  return best;
}

// Who is not sure is compared with the best candidate elsewhere, however little of that one overlaps.
void LoopDetector::ask_runner_up(Query& query, const Opinion* unsure, std::vector<Opinion>& opinions,
                                 const std::vector<Opinion>& others) const {
  if (unsure == nullptr || !unsure->geometric) return;
  const double log_odds = unsure->geometric->log_odds;
  if (is_sure(log_odds) || !is_sure(log_odds + kMostAhead)) return;
  std::optional<Opinion> rival;
  for (const auto* all : {&std::as_const(opinions), &others})
    for (const Opinion& each : *all) {
      if (!are_elsewhere(each, *unsure)) continue;
      if (each.geometric) return;  // there is one
      if (!rival) rival = each;
    }
  if (!rival) return;
  register_it(query, *rival);
  opinions.push_back(*std::move(rival));
}

void LoopDetector::weigh_against_each_other(std::vector<Opinion>& opinions) const {
  // Where a scene shows little, even the right place fits poorly; that all others fit far worse speaks for it then.
  // Chosen on recordings that no reported figure uses (docs/accuracy.md).
  constexpr double kNothingBelow = 8.0, kShare = 0.5;
  for (Opinion& each : opinions) {
    if (!each.geometric) continue;
    const double own = each.own_log_odds();
    std::optional<double> runner_up;
    for (const Opinion& other : opinions)
      if (other.geometric && are_elsewhere(other, each))
        runner_up = std::max(runner_up.value_or(-1e9), other.own_log_odds());
    if (!runner_up) continue;
    const double ahead = std::clamp(kShare * (own - *runner_up - kNothingBelow), 0.0, kMostAhead);
    if (ahead == each.ahead_log_odds) continue;
    each.ahead_log_odds = ahead;
    judge_with_context(each);
  }
}

bool LoopDetector::is_sure(double log_odds) const {
  return probability_of(log_odds) >= parameters_.geometric.min_probability;
}

void LoopDetector::remember_loop(const std::optional<Station>& query, const Opinion& found) {
  const std::optional<Station>& place = stations_.at(found.candidate.match);
  if (parameters_.geometric.follow && query && place && is_sure(found.own_log_odds()))
    track_.add(*query, found.candidate.match, *place, found.geometric->T_match_query, found.own_log_odds());
}

// Where another place is nearer to the query than the one that was found, asks that too. From far away little fits even
// at the right place, and much is forgiven; what is much nearer must fit by itself, so that it decides.
Status LoopDetector::go_nearer(Query& query, FrameId newest, std::vector<Opinion>& opinions,
                               const std::vector<Opinion>& others, Opinion& answer) {
  constexpr double kWorthIt_m = 0.3, kMuchNearer = 0.5;
  if (!parameters_.geometric.overhead_search || answer.distance_m() < kNear_m) return ok();
  const auto nearest = nearest_place(stations_, answer.candidate.match, answer.geometric->T_match_query, newest);
  if (!nearest) return ok();
  const double nearest_m = nearest->T_match_query.translation().norm();
  if (nearest_m + kWorthIt_m > answer.distance_m()) return ok();
  auto nearer = register_at(query, *nearest);
  if (!nearer) return nearer.error();
  const std::size_t at = opinions.size();
  opinions.push_back(*std::move(nearer));
  ask_runner_up(query, &opinions[at], opinions, others);
  weigh_against_each_other(opinions);
  const Opinion& found = opinions[at];
  const bool decides = nearest_m < kMuchNearer * answer.distance_m();
  if (decides || (found.reason.empty() && found.distance_m() < answer.distance_m())) answer = found;
  return ok();
}

void LoopDetector::look_from_overhead(OverheadSearch& overhead, double yaw_reach_rad, Opinion& opinion) const {
  const OverheadMatch found =
      overhead.search(*opinion.place, opinion.candidate.yaw_rad, yaw_reach_rad, kOverheadReach_m);
  opinion.T_guess_match_query = planar_pose(found.x_m, found.y_m, found.yaw_rad);
  opinion.overlap = found.overlap;
  if (found.overlap < parameters_.geometric.min_overlap) {
    char text[96];
    std::snprintf(text, sizeof text, "overlap from overhead %.2f below %.2f", found.overlap,
                  parameters_.geometric.min_overlap);
    opinion.reason = text;
  }
}

void LoopDetector::check_temporal_and_scores(FrameId frame, Opinion& opinion) const {
  const auto query_descriptor = [&](FrameId of) -> std::optional<DescriptorView> {
    const auto found = std::find_if(recent_queries_.begin(), recent_queries_.end(),
                                    [&](const auto& each) { return each.first == of; });
    if (found == recent_queries_.end()) return std::nullopt;
    return found->second;
  };
  const auto match_descriptor = [&](FrameId of) { return index_.find(of); };
  opinion.temporal =
      check_temporal(frame, opinion.candidate.match, query_descriptor, match_descriptor, parameters_.temporal);
  if (!opinion.reason.empty()) return;
  if (opinion.candidate.score() < parameters_.geometric.min_descriptor_score) {
    char text[96];
    std::snprintf(text, sizeof text, "descriptor score %.3f below %.3f", opinion.candidate.score(),
                  parameters_.geometric.min_descriptor_score);
    opinion.reason = text;
  } else if (!opinion.temporal.consistent) {
    opinion.reason = opinion.temporal.reason;
  }
}

}  // namespace revisit
