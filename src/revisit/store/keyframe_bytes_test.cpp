// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/keyframe_bytes.hpp>

#include <algorithm>
#include <limits>

#include <gtest/gtest.h>

#include "random_points.hpp"
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

TEST(KeyframeBytes, ADescriptorComesBackAsItWas) {
  IntensityScanContext descriptor = describe(testing_support::random_points(500, 3), {});
  Bytes bytes = to_bytes(descriptor);
  const auto back = to_descriptor(bytes);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->rings, descriptor.rings);
  EXPECT_EQ(back->sectors, descriptor.sectors);
  EXPECT_EQ(back->levels, descriptor.levels);
  EXPECT_EQ(back->intensity, descriptor.intensity);
  EXPECT_EQ(back->occupancy, descriptor.occupancy);
  EXPECT_FALSE(to_descriptor({}));
  EXPECT_FALSE(to_descriptor(std::span(bytes).first(bytes.size() - 1)));
  bytes.push_back(std::byte{0});
  EXPECT_FALSE(to_descriptor(bytes));
  descriptor.intensity.pop_back();
  EXPECT_FALSE(to_descriptor(to_bytes(descriptor))) << "not as many cells as the grid has";
}

// A grid of numbers that cannot be, as many cells as it has.
TEST(KeyframeBytes, OfADescriptorTheGridIsBounded) {
  const auto is_read = [](int rings, int sectors, int levels) {
    IntensityScanContext descriptor;
    descriptor.rings = rings;
    descriptor.sectors = sectors;
    descriptor.levels = levels;
    const auto cells = static_cast<std::size_t>(std::max(0, rings) * std::max(0, sectors));
    descriptor.intensity.resize(cells);
    descriptor.occupancy.resize((cells * static_cast<std::size_t>(std::max(1, levels)) + 63) / 64);
    return to_descriptor(to_bytes(descriptor)).has_value();
  };
  EXPECT_TRUE(is_read(1, 1, 0));
  EXPECT_TRUE(is_read(720, 2, 0));
  EXPECT_TRUE(is_read(2, 720, 1));
  EXPECT_FALSE(is_read(721, 2, 0));
  EXPECT_FALSE(is_read(2, 721, 0));
  EXPECT_FALSE(is_read(0, 5, 0));
  EXPECT_FALSE(is_read(5, 0, 0));
  EXPECT_FALSE(is_read(2, 2, -1));
}

TEST(KeyframeBytes, PointsOfTheMapAreKeptToACentimetre) {
  ThinCloud cloud;
  cloud.points = {{1.004f, -2.006f, 300.f}, {0.f, 400.f, 0.f}, {-327.66f, 0.f, 0.f}};
  cloud.intensity = {0.5f, 0.1f, 3.f};
  const Bytes bytes = to_map_bytes(cloud);
  EXPECT_EQ(bytes.size(), 14u) << "the second point is too far out";
  const auto points = to_map_points(bytes);
  ASSERT_TRUE(points);
  ASSERT_EQ(points->size(), 2u);
  EXPECT_NEAR((*points)[0].x, 1.0f, 1e-5f);
  EXPECT_NEAR((*points)[0].y, -2.01f, 1e-5f);
  EXPECT_NEAR((*points)[0].z, 300.f, 1e-4f);
  EXPECT_NEAR((*points)[0].intensity, 128.f / 255.f, 1e-6f);
  EXPECT_NEAR((*points)[1].x, -327.66f, 1e-4f);
  EXPECT_EQ((*points)[1].intensity, 1.f);
  EXPECT_EQ(to_map_bytes(*points), bytes);
  EXPECT_FALSE(to_map_points(std::span(bytes).first(13)));
}

TEST(KeyframeBytes, HistoriesOfPointsComeBack) {
  auto store = MapStore::create_temporary();
  ASSERT_TRUE(store);
  StoredPlacePoints place{{{1.f, 2.f, 3.f, 1.f}, {900.f, 0.f, 0.f, 0.f}, {4.f, 5.f, 6.f, 0.f}}, {}, 5};
  StoredKeyframe keyframe;
  keyframe.frame = in_map(2, {7});
  keyframe.cloud = to_map_bytes(place.points);
  ASSERT_TRUE(store->add(keyframe));
  const auto fresh = read_place_points(*store, keyframe.frame);
  ASSERT_TRUE(fresh) << fresh.error().message;
  ASSERT_EQ(fresh->history.size(), 2u) << "one point was too far out";
  EXPECT_EQ(fresh->history[0].since, 2) << "the session of the key frame";
  EXPECT_EQ(fresh->history[1].gone, PointHistory::kNever);
  EXPECT_EQ(fresh->compared_with, 2);

  place.history = {{2, PointHistory::kNever, 1}, {3, 3, 3}, {3, 4, 2}};
  ASSERT_TRUE(write_place_points(*store, keyframe.frame, place));
  const auto back = read_place_points(*store, keyframe.frame);
  ASSERT_TRUE(back);
  ASSERT_EQ(back->history.size(), 2u);
  EXPECT_EQ(back->history[0].missed, 1);
  EXPECT_EQ(back->history[1].since, 3);
  EXPECT_EQ(back->history[1].gone, 4);
  EXPECT_EQ(back->history[1].missed, 2);
  EXPECT_EQ(back->compared_with, 5);
  EXPECT_EQ(read_map_points(*store, keyframe.frame)->size(), 1u) << "the other one is gone";
  EXPECT_EQ(read_map_points(*store, keyframe.frame, 3)->size(), 2u);
  EXPECT_EQ(read_map_points(*store, keyframe.frame, 2)->size(), 1u) << "it came later";

  ASSERT_TRUE(store->set_cloud(keyframe.frame, to_map_bytes(place.points), Bytes(9)));
  const auto damaged = read_place_points(*store, keyframe.frame);
  ASSERT_FALSE(damaged);
  EXPECT_NE(damaged.error().message.find("the changes of key frame"), std::string::npos) << damaged.error().message;
  ASSERT_TRUE(store->set_cloud(keyframe.frame, Bytes(8), {}));
  EXPECT_FALSE(read_place_points(*store, keyframe.frame));
  EXPECT_FALSE(read_place_points(*store, {99}));
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
  const auto refuses = [](auto change) {
    ThinCloud wrong = some_cloud();
    change(wrong);
    EXPECT_FALSE(to_thin_cloud(to_bytes(wrong)));
  };
  refuses([](ThinCloud& each) { each.up *= 0.99f; });
  refuses([](ThinCloud& each) { each.voxel_m = 0.f; });
  refuses([](ThinCloud& each) { each.intensity.pop_back(); });
  refuses([](ThinCloud& each) { each.is_ground.pop_back(); });
  refuses([](ThinCloud& each) { each.points.back().x() = std::numeric_limits<float>::infinity(); });
}

}  // namespace
}  // namespace revisit
