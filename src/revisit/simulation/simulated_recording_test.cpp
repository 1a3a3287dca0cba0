// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "simulated_drive.hpp"

namespace revisit {
namespace {

using testing_support::make;
using testing_support::refusal;
using testing_support::same_bytes;
using testing_support::small_drive;

TEST(Simulation, TheSameBytesForAnyNumberOfThreadsAndInAnyOrder) {
  const auto one = make(small_drive("town"), 1), many = make(small_drive("town"), 3);
  ASSERT_EQ(one->size(), many->size());
  const Scan last = *one->read(20);
  for (const std::size_t index : {0u, 10u, 20u}) EXPECT_TRUE(same_bytes(*one->read(index), *many->read(index)));
  EXPECT_TRUE(same_bytes(last, *one->read(20)));
}

TEST(Simulation, AnotherSeedIsAnotherWorld) {
  SimulationOptions other = small_drive("town");
  other.seed = 2;
  EXPECT_FALSE(same_bytes(*make(small_drive("town"))->read(5), *make(other)->read(5)));
}

TEST(Simulation, DifficultyIsReproducibleAndChangesTheWorld) {
  SimulationOptions hard = small_drive("town", "hdl64e");
  hard.difficulty = 1.0;
  const Scan scan = *make(hard, 1)->read(30), tame = *make(small_drive("town", "hdl64e"))->read(30);
  EXPECT_TRUE(same_bytes(scan, *make(hard, 3)->read(30)));
  EXPECT_FALSE(same_bytes(scan, tame));
  EXPECT_LT(scan.points.size(), tame.points.size()) << "drop-outs, weather";
  EXPECT_GT(scan.points.size(), tame.points.size() / 2);
}

TEST(Simulation, ABuildingIsWalkedThrough) {
  SimulationOptions options = small_drive("building", "os0-128");
  options.difficulty = 1.0;
  const auto walk = make(options);
  const Scan scan = *walk->read(100);
  EXPECT_GT(scan.points.size(), 50'000u);
  // Walls on both sides of the corridor, a ceiling above.
  int near = 0, above = 0;
  for (const Point& p : scan.points) {
    near += std::hypot(p.x, p.y) < 3.f;
    above += p.z > 0.6f && p.z < 1.f;
  }
  EXPECT_GT(near, 20'000);
  EXPECT_GT(above, 5'000);
  options.trajectory = "poses.txt";
  EXPECT_NE(refusal(options).find("a building has its own walk"), std::string::npos);
}

TEST(Simulation, WhoWalksTurnsAsPeopleDo) {
  const auto walk = make(small_drive("building", "os0-128"));
  ASSERT_GT(walk->size(), 300u);
  double most_radps = 0.0;
  for (std::size_t i = 1; i < walk->size(); ++i) {
    const Pose T_before = *walk->trajectory().at(walk->frame(i - 1)), T_here = *walk->trajectory().at(walk->frame(i));
    const double turned_rad = rotation_angle(T_before.inverse() * T_here);
    most_radps = std::max(most_radps, turned_rad / (walk->stamp_s(i) - walk->stamp_s(i - 1)));
  }
  EXPECT_GT(most_radps, 0.5) << "there are corners";
  EXPECT_LT(most_radps, 2.5);
}

struct Revisits {
  int same_way = 0, other_way = 0;
};
Revisits count_revisits(const Trajectory& trajectory) {
  std::vector<Pose> poses;
  for (const auto& [frame, entry] : trajectory.entries) poses.push_back(entry.T_world_lidar);
  Revisits revisits;
  for (std::size_t i = 300; i < poses.size(); ++i) {
    bool same = false, other = false;
    for (std::size_t j = 0; j + 300 < i; ++j) {
      if ((poses[i].translation() - poses[j].translation()).norm() > 4.0) continue;
      const double turn_deg = std::abs(to_degrees(wrap_angle(yaw_of(poses[i]) - yaw_of(poses[j]))));
      same |= turn_deg < 30.0;
      other |= turn_deg > 150.0;
    }
    revisits.same_way += same;
    revisits.other_way += other;
  }
  return revisits;
}

TEST(Simulation, ATownIsDrivenThroughAgainTheSameWayAndTheOtherWay) {
  for (const int seed : {1, 2, 3}) {
    SimulationOptions options;
    options.seed = seed;
    const auto recording = make(options);
    const Revisits revisits = count_revisits(recording->trajectory());
    EXPECT_GT(revisits.same_way, 80) << "seed " << seed;
    EXPECT_GT(revisits.other_way, 70) << "seed " << seed;
    const auto& entries = recording->trajectory().entries;
    double driven_m = 0.0;
    for (auto next = std::next(entries.begin()); next != entries.end(); ++next)
      driven_m +=
          (next->second.T_world_lidar.translation() - std::prev(next)->second.T_world_lidar.translation()).norm();
    EXPECT_NEAR(driven_m, 1000.0, 30.0);
  }
}

TEST(Simulation, TheWarehouseRobotComesBackTheSameWay) {
  SimulationOptions options = small_drive("warehouse");
  options.length_m = 150.0;
  const auto recording = make(options);
  EXPECT_GT(count_revisits(recording->trajectory()).other_way, 400);
  const auto& entries = recording->trajectory().entries;
  const Eigen::Vector3d home = entries.begin()->second.T_world_lidar.translation(),
                        end = entries.rbegin()->second.T_world_lidar.translation();
  EXPECT_LT((home - end).norm(), 1.0);
}

TEST(Simulation, OdometriesDriftButNotAtOnce) {
  SimulationOptions options = small_drive("town");
  options.length_m = 400.0;
  const auto recording = make(options);
  for (const Trajectory* odometry : {&recording->wheel_odometry(), &recording->drifting_odometry()}) {
    ASSERT_EQ(odometry->entries.size(), recording->size());
    const auto error_m = [&](std::int64_t frame) {
      return (odometry->at(FrameId{frame})->translation() - recording->trajectory().at(FrameId{frame})->translation())
          .head<2>()
          .norm();
    };
    EXPECT_LT(error_m(1), 0.2);
    EXPECT_GT(error_m(static_cast<std::int64_t>(recording->size()) - 1), 0.5);
    EXPECT_LT(error_m(static_cast<std::int64_t>(recording->size()) - 1), 60.0);
  }
}

}  // namespace
}  // namespace revisit
