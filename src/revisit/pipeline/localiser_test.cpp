// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/localiser.hpp>

#include <algorithm>
#include <fstream>
#include <random>

#include <gtest/gtest.h>

#include <revisit/pipeline/slam.hpp>
#include <revisit/store/map_store.hpp>

#include "shared_data.hpp"
#include "synthetic_world.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::fresh_folder;
using testing_support::SyntheticWorld;

const SyntheticWorld::Sensor kSensor{32, 600, -24.8, 5.0};
const SyntheticWorld& town() {
  static const SyntheticWorld world(61);
  return world;
}
Pose pose_at(int i) { return SyntheticWorld::at(-20.0 + 0.8 * i, 0.0, 0.0); }

// Of a sensor that sees all round, what one that looks ahead sees.
Scan ahead_of(Scan scan) {
  std::erase_if(scan.points, [](const Point& p) { return !(p.x > 0.f && std::abs(p.y) < p.x); });
  scan.rings.clear();
  scan.times_s.clear();
  return scan;
}

// A map of 40 m, left on the disk.
fs::path small_map(bool looks_ahead = false) {
  const fs::path folder = fresh_folder() / "map";
  auto slam = Slam::open(folder);
  EXPECT_TRUE(slam);
  for (int i = 0; i < 50; ++i) {
    Scan scan = town().scan(pose_at(i), kSensor, static_cast<unsigned>(i));
    if (looks_ahead) scan = ahead_of(std::move(scan));
    scan.frame = FrameId{i};
    scan.stamp_s = 0.1 * i;
    EXPECT_TRUE(slam->process(std::move(scan)));
  }
  EXPECT_TRUE(slam->finish());
  return folder;
}

// A sensor that looks ahead, in the map of one that sees all round, and in its own.
TEST(Localiser, ANarrowViewIsFoundByADriveNotByOneScan) {
  for (const bool own_map : {false, true}) {
    SCOPED_TRACE(own_map);
    auto localiser = Localiser::open(small_map(own_map));
    ASSERT_TRUE(localiser) << localiser.error().message;
    std::size_t in_sight = 0, found = 0;
    for (int i = 0; i < 40; ++i) {
      Scan scan = ahead_of(town().scan(pose_at(i), kSensor, static_cast<unsigned>(700 + i)));
      scan.frame = FrameId{i};
      scan.stamp_s = 0.1 * i;
      const auto alone = localiser->locate(scan);
      ASSERT_TRUE(alone) << alone.error().message;
      const bool is_in_a_room = own_map && i >= 12;  // its own map ends nearby
      if (!is_in_a_room) EXPECT_FALSE(alone->T_map_lidar) << i;
      if (alone->reason.find("a drive is needed") != std::string::npos) ++in_sight;
      const auto step = localiser->follow(std::move(scan));
      ASSERT_TRUE(step) << step.error().message;
      if (!step->T_map_lidar) continue;
      ++found;
      const Pose error = (pose_at(0).inverse() * pose_at(i)).inverse() * *step->T_map_lidar;
      EXPECT_LT(error.translation().norm(), 0.3) << i;
    }
    EXPECT_GT(in_sight, 5u);
    EXPECT_GT(found, own_map ? 5u : 15u) << "of two sectors more of the way must be seen";
  }
}

// What one scan of a sensor that looks ahead does not decide is decided where somebody says where it is: two metres
// and twenty degrees off, without height. Said wrongly, it is no answer.
TEST(Localiser, APoseThatIsExpectedIsLookedForThere) {
  const fs::path map = small_map();
  const auto follow = [&](const std::optional<Pose>& T_expected) {
    auto localiser = Localiser::open(map);
    if (T_expected) localiser->expect(*T_expected);
    return localiser->follow(ahead_of(town().scan(pose_at(20), kSensor, 720)));
  };
  const Pose truth = pose_at(0).inverse() * pose_at(20);
  Pose near = truth * SyntheticWorld::at(1.5, -1.2, to_radians(20.0)), far = truth * SyntheticWorld::at(-12.0, 0, 0);
  near.translation().z() = far.translation().z() = 0.0;
  EXPECT_FALSE(follow(std::nullopt)->T_map_lidar);
  EXPECT_FALSE(follow(far)->T_map_lidar);
  const auto found = follow(near);
  ASSERT_TRUE(found && found->T_map_lidar) << found->reason;
  EXPECT_LT((truth.inverse() * *found->T_map_lidar).translation().norm(), 0.3);
}

TEST(Localiser, OneScanAnswersFromTheMapOfAnEarlierRun) {
  const fs::path map = small_map();
  auto localiser = Localiser::open(map);
  ASSERT_TRUE(localiser) << localiser.error().message;
  EXPECT_GE(localiser->places(), 20u);
  for (const double yaw_deg : {0.0, 178.0}) {
    const Pose T_world_query = SyntheticWorld::at(3.3, 0.7, to_radians(yaw_deg));
    const auto found = localiser->locate(town().scan(T_world_query, kSensor, 900));
    ASSERT_TRUE(found) << found.error().message;
    ASSERT_TRUE(found->T_map_lidar) << found->detection.reason();
    const Pose error = (pose_at(0).inverse() * T_world_query).inverse() * *found->T_map_lidar;
    EXPECT_LT(error.translation().norm(), 0.2);
    EXPECT_LT(to_degrees(rotation_angle(error)), 0.5);
    EXPECT_GT(found->probability, 0.95);
  }
  const auto elsewhere = localiser->locate(SyntheticWorld(77).scan(SyntheticWorld::at(0, 0, 0), kSensor));
  ASSERT_TRUE(elsewhere);
  EXPECT_FALSE(elsewhere->T_map_lidar);
  EXPECT_FALSE(elsewhere->detection.reason().empty());
}

// Asked to be surer than any one place makes it, of scans whose points are some 0.2 m off.
TEST(Localiser, PlacesSideBySideAnswerTogether) {
  Parameters parameters;
  parameters.geometric.min_probability = 1.0 - 1e-10;
  auto localiser = Localiser::open(small_map(), parameters);
  ASSERT_TRUE(localiser) << localiser.error().message;
  std::mt19937 random(3);
  std::normal_distribution<float> off(0.0f, 0.12f);
  for (int i = 8; i < 42; i += 8) {
    const Pose T_here_query = planar_pose(0.3, 0.5, 0.4);
    Scan scan = town().scan(pose_at(i) * T_here_query, kSensor, static_cast<unsigned>(900 + i));
    for (Point& p : scan.points) p.x += off(random), p.y += off(random), p.z += off(random);
    const auto located = localiser->locate(std::move(scan));
    ASSERT_TRUE(located && located->T_map_lidar) << i;
    const Pose truth = pose_at(0).inverse() * pose_at(i) * T_here_query;
    EXPECT_LT((truth.inverse() * *located->T_map_lidar).translation().norm(), 0.2) << i;
    for (const auto& each : located->detection.registered)
      EXPECT_LT(each.evidence.probability, parameters.geometric.min_probability) << i << ": enough by itself";
  }
}

// The index lies in a finished map; one that a killed run left is put together.
TEST(Localiser, AnswersTheSameWhetherTheIndexIsReadOrMade) {
  const fs::path map = small_map();
  std::vector<Pose> found;
  for (const bool is_finished : {true, false}) {
    if (!is_finished) {
      auto store = MapStore::open(map / MapStore::kFileName);
      ASSERT_TRUE(store);
      EXPECT_GT(*store->index_size(), 0u);
      ASSERT_TRUE(store->set_map_poses(*store->map_poses()));  // poses that change make the index old
      ASSERT_TRUE(store->commit());
      EXPECT_EQ(*store->index_size(), 0u);
      ASSERT_TRUE(store->close());
    }
    auto localiser = Localiser::open(map);
    ASSERT_TRUE(localiser) << localiser.error().message;
    const auto located = localiser->locate(town().scan(SyntheticWorld::at(3.3, 0.7, 1.0), kSensor, 900));
    ASSERT_TRUE(located && located->T_map_lidar);
    found.push_back(*located->T_map_lidar);
  }
  EXPECT_TRUE(found[0].isApprox(found[1], 1e-9));
}

// Another program takes places out of the map while this one looks for scans in it.
TEST(Localiser, PlacesThatAreTakenOutMeanwhileAreNoError) {
  const fs::path map = small_map();
  auto localiser = Localiser::open(map);
  ASSERT_TRUE(localiser) << localiser.error().message;
  {
    auto store = MapStore::open(map / MapStore::kFileName);
    ASSERT_TRUE(store);
    std::vector<FrameId> most = *store->places();
    most.erase(most.begin());
    ASSERT_TRUE(store->remove(most, {}));
    ASSERT_TRUE(store->commit());
  }
  const auto found = localiser->locate(town().scan(SyntheticWorld::at(3.3, 0.7, 1.0), kSensor, 900));
  ASSERT_TRUE(found) << found.error().message;
  Scan scan = town().scan(SyntheticWorld::at(3.3, 0.7, 1.0), kSensor, 901);
  EXPECT_TRUE(localiser->follow(std::move(scan)));
}

// Found, followed, carried elsewhere, found again.
TEST(Localiser, FollowsADriveAndFindsAKidnappedRobotAgain) {
  auto localiser = Localiser::open(small_map());
  ASSERT_TRUE(localiser) << localiser.error().message;
  int found = 0, followed = 0, lost = 0;
  double worst_m = 0.0;
  for (int i = 0; i < 40; ++i) {
    const int at = i < 20 ? i : i + 15;  // 12 m farther on, at once
    const Pose T_world_query = SyntheticWorld::at(-20.0 + 0.6 * at, 0.4, 0.05);
    Scan scan = town().scan(T_world_query, kSensor, static_cast<unsigned>(500 + i));
    scan.frame = FrameId{i};
    scan.stamp_s = 0.1 * i;
    const auto step = localiser->follow(std::move(scan));
    ASSERT_TRUE(step) << step.error().message;
    EXPECT_EQ(step->frame, FrameId{i});
    found += step->status == Localisation::Status::kFound;
    followed += step->status == Localisation::Status::kFollowed;
    lost += step->status == Localisation::Status::kLost;
    ASSERT_EQ(step->T_map_lidar.has_value(), step->status != Localisation::Status::kLost);
    if (step->status != Localisation::Status::kFollowed) continue;
    EXPECT_FALSE(step->information.isZero());
    worst_m =
        std::max(worst_m, ((pose_at(0).inverse() * T_world_query).inverse() * *step->T_map_lidar).translation().norm());
  }
  EXPECT_GE(found, 1);
  EXPECT_LE(lost, 8) << "found again in time";
  EXPECT_GE(followed, 24);
  EXPECT_LT(worst_m, 0.2);
}

// As where odometry jumped: half of the map lies 1.5 m to the side.
TEST(Localiser, FollowsWhereScansSayThatThePredictionIsWrong) {
  const fs::path map = small_map();
  const auto is_moved = [](double x_m) { return x_m > 0.5 * 0.8 * 50; };
  {
    auto store = MapStore::open(map / MapStore::kFileName);
    ASSERT_TRUE(store);
    std::vector<StoredMapPose> poses = *store->place_poses();
    for (StoredMapPose& each : poses)
      if (is_moved(each.T_map_lidar.translation().x())) each.T_map_lidar.translation().y() += 1.5;
    ASSERT_TRUE(store->set_place_poses(poses));
    ASSERT_TRUE(store->commit());
  }
  auto localiser = Localiser::open(map);
  ASSERT_TRUE(localiser) << localiser.error().message;
  int followed = 0, predicted = 0;
  for (int i = 10; i < 40; ++i) {
    Scan scan = town().scan(pose_at(i), kSensor, static_cast<unsigned>(500 + i));
    scan.frame = FrameId{i};
    scan.stamp_s = 0.1 * i;
    const auto step = localiser->follow(std::move(scan));
    ASSERT_TRUE(step) << step.error().message;
    predicted += step->status == Localisation::Status::kPredicted;
    if (step->status != Localisation::Status::kFollowed) continue;
    ++followed;
    const Pose T = pose_at(0).inverse() * pose_at(i);
    EXPECT_NEAR(step->T_map_lidar->translation().y(), is_moved(T.translation().x()) ? 1.5 : 0.0, 0.2) << i;
  }
  EXPECT_GE(followed, 24);
  EXPECT_LE(predicted, 4);
}

TEST(Localiser, SaysThatItHasLeftTheMap) {
  auto localiser = Localiser::open(small_map());
  ASSERT_TRUE(localiser);
  Localisation last;
  for (int i = 0; i < 60; ++i) {  // away from the mapped road, to the side
    Scan scan = town().scan(SyntheticWorld::at(0.0, 1.0 * i, kPi / 2), kSensor, static_cast<unsigned>(700 + i));
    scan.frame = FrameId{i};
    scan.stamp_s = 0.1 * i;
    auto step = localiser->follow(std::move(scan));
    if (step) last = *std::move(step);
  }
  EXPECT_EQ(last.status, Localisation::Status::kLost);
  EXPECT_FALSE(last.reason.empty());
}

TEST(Localiser, SaysWhatIsWrongWithAMap) {
  const auto nowhere = Localiser::open("/no/such/folder");
  ASSERT_FALSE(nowhere);
  EXPECT_NE(nowhere.error().message.find("/no/such/folder"), std::string::npos) << nowhere.error().message;
  const fs::path folder = fresh_folder();
  std::ofstream(folder / "map.revisit") << "this is no map";
  EXPECT_FALSE(Localiser::open(folder));
  Parameters other_grid;
  other_grid.descriptor.sectors = 60;
  const auto refused = Localiser::open(small_map(), other_grid);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("on a grid of 20 x 30 x 4"), std::string::npos) << refused.error().message;
}

}  // namespace
}  // namespace revisit
