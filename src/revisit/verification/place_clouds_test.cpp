// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/place_clouds.hpp>

#include <gtest/gtest.h>

namespace revisit {
namespace {

TEST(PlaceClouds, GiveBackWhatWasPutAndNameWhatWasNot) {
  const auto clouds = clouds_in_memory();
  ThinCloud cloud;
  cloud.points.emplace_back(1.f, 2.f, 3.f);
  ASSERT_TRUE(clouds->put(FrameId{7}, cloud));
  const auto found = clouds->get(FrameId{7});
  ASSERT_TRUE(found);
  EXPECT_EQ((*found)->points, cloud.points);
  const auto absent = clouds->get(FrameId{8});
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().message, "no cloud is kept of frame 8");
}

TEST(PlaceGeometries, KeepTheTwelveThatWereUsedLast) {
  PlaceGeometries kept;
  const auto geometry = std::make_shared<const ScanGeometry>(ThinCloud{});
  EXPECT_FALSE(kept.find(FrameId{0}));
  for (int i = 0; i < 12; ++i) kept.keep(FrameId{i}, geometry);
  EXPECT_EQ(kept.find(FrameId{0}), geometry) << "now the last one that was used";
  kept.keep(FrameId{12}, geometry);
  EXPECT_TRUE(kept.find(FrameId{0}));
  EXPECT_FALSE(kept.find(FrameId{1}));
  for (int i = 2; i <= 12; ++i) EXPECT_TRUE(kept.find(FrameId{i})) << i;
}

}  // namespace
}  // namespace revisit
