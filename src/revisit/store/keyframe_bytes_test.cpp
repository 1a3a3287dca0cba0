// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/keyframe_bytes.hpp>

#include <limits>

#include <gtest/gtest.h>

#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

ThinCloud some_cloud() {
  const Scan scan = SyntheticWorld(51).scan(SyntheticWorld::at(0, 0, 0), {16, 180, -15.0, 15.0});
  ThinCloud cloud = thin(scan.points, {}, 1.0);
  cloud.up = Eigen::Vector3f(0.3f, 0.f, 1.f).normalized();
  return cloud;
}

TEST(KeyframeBytes, AThinCloudComesBackAsItWas) {
  const ThinCloud cloud = some_cloud();
  const auto back = to_thin_cloud(to_bytes(cloud));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->points, cloud.points);
  EXPECT_EQ(back->is_ground, cloud.is_ground);
  EXPECT_EQ(back->intensity, cloud.intensity);
  EXPECT_EQ(back->up, cloud.up);
  EXPECT_EQ(back->voxel_m, cloud.voxel_m);
  EXPECT_EQ(back->seen.ranges_cm(), cloud.seen.ranges_cm());
}

TEST(KeyframeBytes, BytesThatAreNoThinCloudAreRefused) {
  ThinCloud cloud = some_cloud();
  Bytes bytes = to_bytes(cloud);
  EXPECT_FALSE(to_thin_cloud({}));
  EXPECT_FALSE(to_thin_cloud(std::span(bytes).first(bytes.size() - 1)));
  bytes.push_back(std::byte{0});
  EXPECT_FALSE(to_thin_cloud(bytes)) << "a byte too many";
  cloud.up = {0.f, 0.f, 2.f};
  EXPECT_FALSE(to_thin_cloud(to_bytes(cloud))) << "up has a length";
  cloud.up = {0.f, 0.f, std::numeric_limits<float>::quiet_NaN()};
  EXPECT_FALSE(to_thin_cloud(to_bytes(cloud)));
}

}  // namespace
}  // namespace revisit
