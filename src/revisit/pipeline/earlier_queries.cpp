// SPDX-License-Identifier: Apache-2.0
#include <utility>

#include <revisit/pipeline/place_recognition.hpp>
#include <revisit/verification/loop_verification.hpp>

namespace revisit {
namespace {

constexpr int kTestsAScan = 2;  // so that no scan takes much longer than the others

}  // namespace

Result<std::vector<Detection>> PlaceRecognition::follow_back(const Detection& detection,
                                                             const std::optional<TrajectoryPoint>& point,
                                                             const TypicalAgreement& typical) {
  std::vector<Detection> found;
  if (!parameters_.geometric.follow || !point || detection.searchable_places == 0) return found;
  if (is_to_be_followed(detection, point)) {
    const LoopConstraint& loop = *detection.loop;
    backward_.open_refused();
    backward_.add_loop(*point, loop.match, *points_.at(loop.match), loop.T_match_query, detection.geometric->log_odds);
  } else if (!detection.loop) {
    std::vector<RegisteredPose> registered;
    for (const Detection::Registered& each : detection.registered)
      registered.push_back({each.match, each.evidence.T_match_query, each.evidence.log_odds});
    backward_.add_refused({detection.frame, index_.frame(detection.searchable_places - 1), detection.searchable_places,
                           *point, std::move(registered)});
  }
  for (int i = 0; i < kTestsAScan; ++i) {
    const auto query = backward_.next();
    if (!query) break;
    auto again = find_again(*query, typical);
    if (!again) return again.error();
    if (!*again) {
      backward_.stop();
      break;
    }
    if ((*again)->loop) found.push_back(*std::move(*again));
  }
  return found;
}

// Nothing where no loop reaches the query.
Result<std::optional<Detection>> PlaceRecognition::find_again(const BackwardFollowing::Query& query,
                                                              const TypicalAgreement& typical) {
  const auto descriptor = index_.find(query.frame);
  const auto cloud = clouds_->get(query.frame);
  if (!cloud) return cloud.error();
  if (!descriptor) return std::optional<Detection>();
  const VerificationQuery question{query.frame, *descriptor, **cloud, nullptr, query.point};
  const VerificationContext known = context(typical, backward_.loops(), query.newest);
  LoopVerification verification(known, question);
  auto answer = verification.verify_again(query.registered);
  if (!answer) return answer.error();
  if (!*answer) return std::optional<Detection>();
  Detection detection;
  detection.frame = query.frame;
  detection.searchable_places = query.searchable_places;
  if ((*answer)->geometric) detection.registered.push_back({(*answer)->candidate.match, *(*answer)->geometric});
  this->answer(*std::move(*answer), verification.registration().query_geometry(), detection);
  if (is_to_be_followed(detection, query.point))
    backward_.add_loop(query.point, detection.loop->match, *points_.at(detection.loop->match),
                       detection.loop->T_match_query, detection.geometric->log_odds);
  return std::optional(std::move(detection));
}

}  // namespace revisit
