// SPDX-License-Identifier: Apache-2.0
#include <revisit/core/state_archive.hpp>

#include <limits>

#include <gtest/gtest.h>

#include <revisit/core/loop.hpp>
#include <revisit/core/scan.hpp>
#include <revisit/core/trajectory_point.hpp>
#include <revisit/core/twist.hpp>

namespace revisit {
namespace {

struct Everything {
  int number = 0;
  double real = 0.0;
  bool flag = false;
  std::string text;
  std::optional<Twist> none, some;
  std::vector<float> plain;
  std::vector<Eigen::Vector3f> points;
  std::deque<TrajectoryPoint> track;
  std::map<FrameId, std::optional<Pose>> poses;
  std::array<std::uint32_t, 3> counts{};
  std::pair<FrameId, double> pair;
  Scan scan;
  LoopConstraint loop;

  void archive(auto& fields) {
    fields(number, real, flag, text, none, some, plain, points, track, poses, counts, pair, scan, loop);
  }
};

Everything something() {
  Everything all;
  all.number = -7;
  all.real = std::numeric_limits<double>::denorm_min();
  all.flag = true;
  all.text = std::string("a\0b", 3);
  all.some = Twist{{1, 2, 3}, {4, 5, 6}};
  all.plain = {1.5f, -0.f};
  all.points = {{1, 2, 3}, {4, 5, 6}};
  all.track.push_back({2, planar_pose(1, 2, 3), 4, 5, 6, 7});
  all.poses = {{{3}, planar_pose(0.1, 0.2, 0.3)}, {{9}, std::nullopt}};
  all.counts = {1, 2, 3};
  all.pair = {{4}, 0.5};
  all.scan.frame = {8};
  all.scan.points = {{1, 2, 3, 4}};
  all.scan.rings = {5};
  all.scan.imu = {ImuSample{0.01}};
  all.loop = {{9}, {2}, planar_pose(3, 2, 1), 0.5, 0.1, 0.9, 4.0, 2.0 * Matrix6::Identity()};
  return all;
}

std::vector<std::byte> written(Everything all) {
  StateWriter writer;
  writer(all);
  return writer.take();
}

TEST(StateArchive, WhatIsReadIsWhatWasWritten) {
  const std::vector<std::byte> bytes = written(something());
  Everything all;
  all.none = Twist{};  // what was there before goes
  all.track.resize(5);
  all.poses[{77}] = std::nullopt;
  StateReader reader(bytes);
  reader(all);
  EXPECT_TRUE(reader.is_complete());
  EXPECT_EQ(written(all), bytes);
  EXPECT_FALSE(all.none);
  EXPECT_EQ(all.text.size(), 3u);
  EXPECT_EQ(all.poses.size(), 2u);
  EXPECT_EQ(all.track.at(0).T_segment_lidar.matrix(), planar_pose(1, 2, 3).matrix());
  EXPECT_EQ(all.loop.match, FrameId{2});
}

TEST(StateArchive, CutOffOrTooLongItIsNotComplete) {
  std::vector<std::byte> bytes = written(something());
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    Everything all;
    StateReader reader{std::span(bytes).first(length)};
    reader(all);
    EXPECT_FALSE(reader.is_complete()) << length;
  }
  bytes.push_back(std::byte{});
  Everything all;
  StateReader reader(bytes);
  reader(all);
  EXPECT_FALSE(reader.is_complete());
}

TEST(StateArchive, ACountThatLiesAllocatesNothing) {
  std::vector<std::uint64_t> counts = {std::numeric_limits<std::uint64_t>::max(), 1ull << 40};
  StateWriter writer;
  writer(counts);
  const auto bytes = writer.take();
  for (const std::size_t skipped : {8u, 16u}) {  // the vector's own count
    StateReader reader{std::span(bytes).subspan(skipped)};
    std::vector<Pose> poses;
    reader(poses);
    EXPECT_FALSE(reader.is_fine());
    EXPECT_TRUE(poses.empty());
    StateReader again{std::span(bytes).subspan(skipped)};
    std::string text;
    again(text);
    EXPECT_FALSE(again.is_fine());
    EXPECT_TRUE(text.empty());
  }
}

TEST(StateArchive, ValuesThatCannotBeAreRefused) {
  Everything all = something();
  all.scan.rings.push_back(1);  // two rings for one point
  const auto bytes = written(all);
  StateReader reader(bytes);
  reader(all);
  EXPECT_FALSE(reader.is_complete());
}

}  // namespace
}  // namespace revisit
