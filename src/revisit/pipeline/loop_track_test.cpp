// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/loop_track.hpp>

#include <gtest/gtest.h>

namespace revisit {
namespace {

constexpr double kSure = 9.0;

// A drive along x, a metre a frame, and the same one again from frame 1000 on, 0.4 m to the left.
struct TwoRounds {
  TwoRounds() {
    Station then{.piece = 1}, now{.piece = 1, .T_piece_lidar = planar_pose(500, 70, 1.2), .way_m = 900.0};
    for (int i = 0; i < 60; ++i) {
      places[FrameId{i}] = then;
      again.push_back(now);
      then = then.after(planar_pose(1, 0, 0));
      now = now.after(planar_pose(1, 0, 0));
    }
  }
  LoopTrack::Places places;
  std::vector<Station> again;
  static constexpr FrameId kNewest{59};
};

TEST(LoopTrack, ALoopSaysWhereTheNextOneIs) {
  const TwoRounds drive;
  LoopTrack track;
  EXPECT_FALSE(track.expected(drive.again[10], drive.places, TwoRounds::kNewest)) << "nothing was found yet";
  track.add(drive.again[10], FrameId{10}, *drive.places.at(FrameId{10}), planar_pose(0, 0.4, 0), kSure);
  const auto expected = track.expected(drive.again[17], drive.places, TwoRounds::kNewest);
  ASSERT_TRUE(expected);
  EXPECT_EQ(expected->match, FrameId{17});
  EXPECT_LT((expected->T_match_query.translation() - Eigen::Vector3d(0, 0.4, 0)).norm(), 1e-9);
  EXPECT_EQ(track.expected(drive.again[17], drive.places, FrameId{14})->match, FrameId{14}) << "no newer ones";
}

TEST(LoopTrack, SpeaksForThePoseThatTheMotionLeadsToAndForNoOther) {
  const TwoRounds drive;
  LoopTrack track;
  track.add(drive.again[10], FrameId{10}, *drive.places.at(FrameId{10}), planar_pose(0, 0.4, 0), kSure);
  const auto in_favour = [&](int query, int place, const Pose& T) {
    return track.in_favour(drive.again[static_cast<std::size_t>(query)], drive.places.at(FrameId{place}), T);
  };
  EXPECT_GT(in_favour(12, 12, planar_pose(0, 0.4, 0)), 7.0);
  EXPECT_GT(in_favour(12, 14, planar_pose(-2, 0.4, 0)), 7.0) << "the same from the next place but one";
  EXPECT_EQ(in_favour(12, 12, planar_pose(1, 0.4, 0)), 0.0) << "a metre off";
  EXPECT_EQ(in_favour(12, 12, planar_pose(0, 0.4, 0.1)), 0.0) << "6 degrees off";
  EXPECT_GT(in_favour(12, 12, planar_pose(0, 0.4, 0)), in_favour(25, 25, planar_pose(0, 0.4, 0)) + 0.5)
      << "the farther, the less";
  EXPECT_EQ(in_favour(45, 45, planar_pose(0, 0.4, 0)), 0.0) << "too far to rely on the motion";
  EXPECT_EQ(in_favour(12, 50, planar_pose(-38, 0.4, 0)), 0.0) << "on the other side too";
}

TEST(LoopTrack, KnowsNothingOfOtherPiecesOrWithoutStations) {
  const TwoRounds drive;
  LoopTrack track;
  const Station elsewhere{.piece = 2};
  track.add(drive.again[10], FrameId{10}, *drive.places.at(FrameId{10}), Pose::Identity(), kSure);
  EXPECT_FALSE(track.expected(elsewhere, drive.places, TwoRounds::kNewest));
  EXPECT_FALSE(track.expected(std::nullopt, drive.places, TwoRounds::kNewest));
  EXPECT_EQ(track.in_favour(elsewhere, drive.places.at(FrameId{10}), Pose::Identity()), 0.0);
  EXPECT_EQ(track.in_favour(drive.again[10], std::nullopt, Pose::Identity()), 0.0);
  EXPECT_EQ(track.in_favour(drive.again[10], elsewhere, Pose::Identity()), 0.0);
}

TEST(LoopTrack, TurnsUseUpTheWayThatMotionCanBeReliedOn) {
  Station station{.piece = 1};
  for (int i = 0; i < 10; ++i) station = station.after(planar_pose(0, 0, 0.5));
  EXPECT_GT(station.way_m, 20.0) << "a robot that spins on the spot";
  EXPECT_TRUE(Station{.piece = 1}.way_to_m(station));
  for (int i = 0; i < 10; ++i) station = station.after(planar_pose(0, 0, 0.5));
  EXPECT_FALSE(Station{.piece = 1}.way_to_m(station));
}

}  // namespace
}  // namespace revisit
