// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <revisit/descriptors/similarity.hpp>
#include <revisit/verification/candidate_registration.hpp>

#include "synthetic_world.hpp"

namespace revisit::testing_support {

struct Described {
  IntensityScanContext descriptor;
  ThinCloud cloud;
};

inline Described described(const SyntheticWorld& world, const Pose& T_world_lidar, double view_deg = 360.0) {
  Scan scan = world.scan(T_world_lidar, {32, 900, -24.8, 5.0});
  std::erase_if(scan.points,
                [&](const Point& p) { return std::abs(std::atan2(p.y, p.x)) > to_radians(view_deg) / 2.0; });
  std::vector<std::uint8_t> ground;
  for (const Point& p : scan.points) ground.push_back(p.z < -1.6f);
  return {describe(scan.points, {}), thin_for_registration(scan.points, ground)};
}

/// Places along x, a metre apart, frame by frame, and one of another world as frame 90, as verification meets them.
class RememberedPlaces : public testing::Test {
 protected:
  RememberedPlaces() {
    TrajectoryPoint point;
    for (int i = 0; i < 6; ++i) {
      add(i, described(home_, SyntheticWorld::at(i, 0, 0)), point);
      point = point.after(planar_pose(1, 0, 0));
    }
    add(90, described(SyntheticWorld(52), SyntheticWorld::at(0, 0, 0)), std::nullopt);
  }
  void add(int frame, Described place, const std::optional<TrajectoryPoint>& point) {
    descriptors_[FrameId{frame}] = place.descriptor;
    ASSERT_TRUE(clouds_->put(FrameId{frame}, std::move(place.cloud)));
    points_[FrameId{frame}] = point;
  }
  VerificationContext context() {
    return {.parameters = parameters_,
            .clouds = *clouds_,
            .geometries = geometries_,
            .query_descriptor = [](FrameId) { return std::nullopt; },
            .place_descriptor = [this](FrameId frame) -> std::optional<DescriptorView> {
              const auto found = descriptors_.find(frame);
              if (found == descriptors_.end()) return std::nullopt;
              return found->second;
            },
            .places = points_,
            .following = following_,
            .typical = {},
            .newest = FrameId{90}};
  }
  std::vector<LoopCandidate> candidates(const Described& query, const std::vector<int>& frames) const {
    std::vector<LoopCandidate> all;
    for (const int frame : frames) {
      all.push_back(match_descriptors(query.descriptor, descriptors_.at(FrameId{frame})));
      all.back().match = FrameId{frame};
    }
    return all;
  }

  const SyntheticWorld home_{51};
  Parameters parameters_;
  std::unique_ptr<PlaceClouds> clouds_ = clouds_in_memory();
  PlaceGeometries geometries_;
  std::map<FrameId, IntensityScanContext> descriptors_;
  TrajectoryPoints points_;
  LoopFollowing following_;
};

}  // namespace revisit::testing_support
