// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/track_state.hpp>

#include <gtest/gtest.h>

namespace revisit {
namespace {

// Where a scan was matched that moved so far ahead of the one before.
ScanMatch moved(const TrackState& track, double step_m, bool is_tracked = true) {
  ScanMatch match;
  match.T_previous_lidar = planar_pose(step_m, 0.0, 0.0);
  match.T_odom_lidar = track.T_odom_lidar * match.T_previous_lidar;
  match.icp.position_information = 1e6 * Eigen::Matrix3d::Identity();
  match.icp.matched = 0.8;
  match.is_tracked = is_tracked;
  return match;
}

// At 1 m a scan, ten a second.
TrackState after(int scans) {
  TrackState track;
  for (int i = 0; i < scans; ++i) track.advance(0.1 * i, {}, moved(track, i > 0 ? 1.0 : 0.0));
  return track;
}

TEST(TrackState, LearnsItsMotionFromTheSecondScan) {
  EXPECT_FALSE(after(1).motion);
  const TrackState track = after(5);
  ASSERT_TRUE(track.motion);
  EXPECT_NEAR(track.motion->linear_mps.x(), 10.0, 0.1);
  EXPECT_NEAR(track.T_odom_lidar.translation().x(), 4.0, 1e-12);
  EXPECT_NEAR(track.typical_match, 0.8, 1e-12);
}

TEST(TrackState, ForgetsItsMotionInAGap) {
  TrackState track = after(5);
  track.advance(2.3, {}, moved(track, 1.0));
  ASSERT_TRUE(track.motion) << "1.9 s";
  track.advance(4.4, {}, moved(track, 1.0));
  EXPECT_FALSE(track.motion) << "2.1 s";
  track.advance(4.4, {}, moved(track, 1.0));
  EXPECT_FALSE(track.motion) << "no time at all";
}

// Three scans were predicted to go on at 1 m each, and the fourth shows that the sensor stood still meanwhile.
TEST(TrackState, AStepAfterLostScansIsTakenSinceTheLastTrackedOne) {
  TrackState track = after(5);
  for (int i = 5; i < 8; ++i) track.advance(0.1 * i, {}, moved(track, 1.0, false));
  EXPECT_NEAR(track.motion_found(planar_pose(-3.0, 0.0, 0.0), 0.8).linear_mps.norm(), 0.0, 1e-9);
  EXPECT_NEAR(track.motion_found(planar_pose(1.0, 0.0, 0.0), 0.8).linear_mps.x(), 10.0, 1e-9);
  EXPECT_NEAR(track.motion_found(planar_pose(1.0, 0.0, 0.0), 2.7).linear_mps.x(), 0.5, 1e-9)
      << "the last tracked one is too long ago: 1 m since the scan before, 2 s";
}

TEST(TrackState, AddsUpWhatWheelsMeasureUntilItIsTracked) {
  TrackState track = after(5);
  for (int i = 5; i < 8; ++i) {
    ScanMatch lost = moved(track, 1.0, false);
    lost.measured_m = 1.0;
    track.advance(0.1 * i, {}, lost);
  }
  EXPECT_NEAR(track.untracked_m, 3.0, 1e-12);
  EXPECT_NEAR(track.T_odom_tracked.translation().x(), 4.0, 1e-12);
  track.advance(0.8, {}, moved(track, 1.0));
  EXPECT_EQ(track.untracked_m, 0.0);
  EXPECT_NEAR(track.T_odom_tracked.translation().x(), 8.0, 1e-12);
}

TEST(TrackState, RemembersAStartThatWasNotTracked) {
  for (const int lost : {4, 5}) {
    TrackState track = after(lost);
    track.advance(0.1 * lost, {}, moved(track, 1.0, false));
    EXPECT_EQ(track.start_was_untracked, lost < 5) << "of the first five scans, after " << lost;
    track.restart();
    EXPECT_FALSE(track.start_was_untracked);
    EXPECT_EQ(track.scans, 0);
    EXPECT_NEAR(track.T_odom_lidar.translation().x(), lost, 1e-12) << "where it is, it stays";
  }
}

}  // namespace
}  // namespace revisit
