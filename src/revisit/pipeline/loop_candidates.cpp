// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <oneapi/tbb/parallel_for.h>

#include <revisit/core/text.hpp>
#include <revisit/descriptors/similarity.hpp>
#include <revisit/pipeline/loop_verification.hpp>

namespace revisit {

double Opinion::score() const {
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

// The candidates that look best from overhead.
Status LoopVerification::look_at(std::span<const LoopCandidate> candidates) {
  for (const LoopCandidate& candidate : candidates) {
    auto place = known_.clouds.get(candidate.match);
    if (!place) return place.error();
    Opinion& opinion = opinions_.emplace_back(candidate, *std::move(place));
    opinion.T_guess_match_query = from_upright(opinion, planar_pose(0, 0, candidate.yaw_rad));
  }
  if (options_.overhead_search) {
    // Half a sector of the descriptor and a little more.
    const double yaw_reach_rad = kPi / known_.parameters.descriptor.sectors + to_radians(3.0);
    for (Opinion& each : opinions_) look_from_overhead(yaw_reach_rad, each);
    std::stable_sort(opinions_.begin(), opinions_.end(),
                     [](const Opinion& a, const Opinion& b) { return a.overlap > b.overlap; });
  }
  const auto count = std::min(opinions_.size(), static_cast<std::size_t>(options_.candidates));
  opinions_.erase(opinions_.begin() + static_cast<std::ptrdiff_t>(count), opinions_.end());
  return ok();
}

void LoopVerification::ask_them() {
  Stopwatch watch;
  for (Opinion& each : opinions_) check_temporal_and_scores(each);
  temporal_ms_ += watch.lap_ms();

  // Each candidate is registered on its own; who finishes first does not matter.
  if (std::any_of(opinions_.begin(), opinions_.end(), [](const Opinion& each) { return each.reason.empty(); }))
    query_geometry();
  tbb::parallel_for(std::size_t{0}, opinions_.size(), [&](std::size_t i) {
    if (opinions_[i].reason.empty()) register_it(opinions_[i]);
  });
}

// Registers the query on a place that it is known to stand near to: only the pose is open.
Result<Opinion> LoopVerification::register_at(const LoopTrack::Expectation& where) {
  LoopCandidate candidate;
  if (const auto descriptor = known_.index.find(where.match))
    candidate = match_descriptors(query_.descriptor, *descriptor);
  candidate.match = where.match;
  auto place = known_.clouds.get(where.match);
  if (!place) return place.error();
  candidate.yaw_rad =
      yaw_of(upright_pose((*place)->up) * where.T_match_query * upright_pose(query_.cloud.up).inverse());
  Opinion opinion(candidate, *std::move(place));
  look_from_overhead(to_radians(3.0), opinion);
  opinion.T_guess_match_query = where.T_match_query;
  opinion.reason.clear();  // however little overlaps: something stands in the way, not elsewhere
  check_temporal_and_scores(opinion);
  if (opinion.reason.empty()) register_it(opinion);
  return opinion;
}

void LoopVerification::register_it(Opinion& opinion) {
  opinion.geometry = std::make_shared<ScanGeometry>(*opinion.place);
  const CandidateView view{opinion.T_guess_match_query, opinion.overlap, known_.usual};
  opinion.geometric = check_geometric(*opinion.geometry, query_geometry(), view, options_);
  // By its own evidence, and by the way of the sensor.
  judge(*opinion.geometric,
        known_.track.in_favour(query_.station, known_.stations.at(opinion.candidate.match),
                               opinion.geometric->T_match_query),
        options_);
  opinion.reason = opinion.geometric->reason;
}

// How the two scans lie to each other as they were taken, from how they would if both stood upright.
Pose LoopVerification::from_upright(const Opinion& opinion, const Pose& T_match_query_upright) const {
  return upright_pose(opinion.place->up).inverse() * T_match_query_upright * upright_pose(query_.cloud.up);
}

void LoopVerification::look_from_overhead(double yaw_reach_rad, Opinion& opinion) {
  const OverheadMatch found =
      overhead_.search(*opinion.place, opinion.candidate.yaw_rad, yaw_reach_rad, kOverheadReach_m);
  opinion.T_guess_match_query = from_upright(opinion, planar_pose(found.x_m, found.y_m, found.yaw_rad));
  opinion.overlap = found.overlap;
  if (found.overlap < options_.min_overlap)
    opinion.reason = format("overlap from overhead %.2f below %.2f", found.overlap, options_.min_overlap);
}

void LoopVerification::check_temporal_and_scores(Opinion& opinion) const {
  const auto query_descriptor = [&](FrameId of) -> std::optional<DescriptorView> {
    const auto found = std::find_if(known_.recent_queries.begin(), known_.recent_queries.end(),
                                    [&](const auto& each) { return each.first == of; });
    if (found == known_.recent_queries.end()) return std::nullopt;
    return found->second;
  };
  const auto match_descriptor = [&](FrameId of) { return known_.index.find(of); };
  opinion.temporal = check_temporal(query_.scan.frame, opinion.candidate.match, query_descriptor, match_descriptor,
                                    known_.parameters.temporal);
  if (!opinion.reason.empty()) return;
  if (opinion.candidate.score() < options_.min_descriptor_score)
    opinion.reason =
        format("descriptor score %.3f below %.3f", opinion.candidate.score(), options_.min_descriptor_score);
  else if (!opinion.temporal.consistent)
    opinion.reason = opinion.temporal.reason;
}

}  // namespace revisit
