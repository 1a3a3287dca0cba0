// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/place_recognition.hpp>
#include <revisit/verification/loop_probability.hpp>

namespace revisit {
namespace {

struct Sampling {
  static constexpr std::size_t kPlaces = 120;    ///< that are looked for
  static constexpr std::size_t kCandidates = 6;  ///< for each
  static constexpr double kElsewhere_m = 8.0;    ///< what is nearer shows much of the same
  // A pose farther than this from the true one is wrong.
  static constexpr double kRight_m = 1.0, kRight_deg = 10.0;
};

IntensityScanContext copy_of(const DescriptorView& view) {
  IntensityScanContext copy;
  copy.rings = view.rings;
  copy.sectors = view.sectors;
  copy.levels = view.levels;
  copy.intensity.assign(view.intensity, view.intensity + view.cells());
  copy.occupancy.assign(view.occupancy, view.occupancy + (copy.image_cells() + 63) / 64);
  return copy;
}

}  // namespace

Result<double> PlaceRecognition::learn_look_alikes_of_map(const std::function<TrajectoryPoint(FrameId)>& point_of,
                                                          const TypicalAgreement& typical) {
  LookAlikes learnt;
  const std::size_t step = std::max<std::size_t>(1, index_.size() / Sampling::kPlaces);
  for (std::size_t place = 0; place < index_.size(); place += step) {
    const FrameId frame = index_.frame(place);
    const auto view = index_.find(frame);
    const auto cloud = clouds_->get(frame);
    if (!cloud) return cloud.error();
    if (!view) return Error{"the index cannot be read"};
    const IntensityScanContext descriptor = copy_of(*view);
    auto found = index_.search(descriptor, index_.size());
    if (!found) return found.error();
    const TrajectoryPoint here = point_of(frame);
    const auto is_near = [&](const LoopCandidate& each) {
      const TrajectoryPoint there = point_of(each.match);
      return there.origin != here.origin || T_between(there, here).translation().norm() < Sampling::kElsewhere_m;
    };
    found->erase(std::remove_if(found->begin(), found->end(), is_near), found->end());
    found->resize(std::min(found->size(), Sampling::kCandidates));
    if (found->empty()) continue;

    const VerificationQuery question{frame, descriptor, **cloud, nullptr, std::nullopt};
    const VerificationContext context = this->context(typical, following_);
    CandidateRegistration registration(context, question);
    const auto tested = registration.test(*found);
    if (!tested) return tested.error();
    double highest = LookAlikes::kNotRegistered;
    for (const Hypothesis& each : *tested) {
      if (!each.geometric) continue;
      const Pose error = T_between(point_of(each.candidate.match), here).inverse() * each.geometric->T_match_query;
      if (error.translation().norm() > Sampling::kRight_m || to_degrees(rotation_angle(error)) > Sampling::kRight_deg)
        highest = std::max(highest, loop_log_odds(each.geometric->evidence));
    }
    learnt.add(highest);
  }
  return learnt.log_odds_in_map();
}

}  // namespace revisit
