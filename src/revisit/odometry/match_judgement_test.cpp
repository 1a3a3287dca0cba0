// SPDX-License-Identifier: Apache-2.0
#include <revisit/odometry/match_judgement.hpp>

#include <gtest/gtest.h>

namespace revisit {
namespace {

// A sensor that moves by 1 m a scan, ten a second, and whose scans match in eight of ten points.
TrackState driving(int scans = 20) {
  TrackState track;
  for (int i = 0; i < scans; ++i) {
    ScanMatch match;
    match.T_previous_lidar = planar_pose(i > 0 ? 1.0 : 0.0, 0.0, 0.0);
    match.T_odom_lidar = track.T_odom_lidar * match.T_previous_lidar;
    match.icp.position_information = 1e6 * Eigen::Matrix3d::Identity();
    match.icp.matched = 0.8;
    match.icp.matched_sideways = 0.4;
    match.is_tracked = true;
    track.advance(0.1 * i, {}, match);
  }
  return track;
}

// Registration found it so far from the scan before, well fixed but along the way where `is_free`.
IcpResult found_at(const TrackState& track, double x_m, double matched = 0.8, bool is_free = false) {
  IcpResult found;
  found.T_target_source = track.T_odom_lidar * planar_pose(x_m, 0.0, 0.0);
  found.converged = true;
  found.matched = matched;
  found.matched_sideways = 0.4;
  found.met = 1.0;
  found.information = 1e6 * Matrix6::Identity();
  if (is_free) found.information(0, 0) = 1.0;
  return found;
}

struct Judged {
  LocalMap map{1.0, 100.0};
  TrackState track = driving();
  MatcherScan scan;
  ScanMatch predicted;

  MatchJudgement judgement(double stamp_s = 2.0) {
    predicted.T_previous_predicted = planar_pose(1.0, 0.0, 0.0);
    return {map, track, scan, stamp_s, predicted, predicted.T_previous_predicted};
  }
};

TEST(MatchJudgement, AWayThatWheelsContradictIsImpossible) {
  Judged judged;
  judged.predicted.measured_m = 1.0;
  EXPECT_TRUE(judged.judgement().is_possible(found_at(judged.track, 0.31))) << "1 m less 0.1 m and six tenths";
  EXPECT_FALSE(judged.judgement().is_possible(found_at(judged.track, 0.29)));
  judged.predicted.measured_m.reset();
  EXPECT_TRUE(judged.judgement().is_possible(found_at(judged.track, 0.0))) << "without wheels it may have stopped";
}

TEST(MatchJudgement, AlongWhatScansDoNotFixNothingBrakesAtOnce) {
  Judged judged;
  EXPECT_FALSE(judged.judgement().is_possible(found_at(judged.track, 0.5, 0.8, true)));
  EXPECT_TRUE(judged.judgement().is_possible(found_at(judged.track, 0.95, 0.8, true)));
  EXPECT_TRUE(judged.judgement().is_possible(found_at(judged.track, 0.5)));
}

TEST(MatchJudgement, AScanThatFitsFarWorseThanUsualDoesNotFit) {
  Judged judged;
  EXPECT_TRUE(judged.judgement().fits(found_at(judged.track, 1.0, 0.61)));
  EXPECT_FALSE(judged.judgement().fits(found_at(judged.track, 1.0, 0.59))) << "0.8 less 0.2";
  EXPECT_TRUE(judged.judgement(7.0).fits(found_at(judged.track, 1.0, 0.71)));
  EXPECT_FALSE(judged.judgement(7.0).fits(found_at(judged.track, 1.0, 0.69))) << "5.1 s later nothing is predicted";
  IcpResult ground = found_at(judged.track, 1.0);
  ground.matched_sideways = 0.11;
  EXPECT_FALSE(judged.judgement().fits(ground)) << "less than three tenths of what stood upright before";
  IcpResult unsettled = found_at(judged.track, 1.0);
  unsettled.converged = false;
  EXPECT_FALSE(judged.judgement().fits(unsettled));
}

TEST(MatchJudgement, TheFirstScansNeedToFitWhereTheyMeetAnything) {
  Judged judged;
  judged.track = driving(3);
  IcpResult found = found_at(judged.track, 1.0, 0.2);
  found.met = 0.32;
  EXPECT_TRUE(judged.judgement(0.3).fits(found));
  found.met = 0.34;
  EXPECT_FALSE(judged.judgement(0.3).fits(found)) << "0.2 is less than six tenths of it";
}

TEST(MatchJudgement, BesideNewSurfacesMostOfTheRestMustFit) {
  Judged judged;
  IcpResult turned = found_at(judged.track, 1.0, 0.3);
  turned.met = 0.42;
  EXPECT_FALSE(judged.judgement().fits(turned));
  EXPECT_TRUE(judged.judgement().fits_beside_new(turned));
  turned.met = 0.44;
  EXPECT_FALSE(judged.judgement().fits_beside_new(turned)) << "0.3 is less than seven tenths of it";
  // An IMU that was right so far: half of it is enough.
  judged.predicted.is_turn_measured = true;
  EXPECT_FALSE(judged.judgement().fits_beside_new(turned)) << "it is not known yet whether it is right";
  const Pose T_turned = planar_pose(0.0, 0.0, 0.1);
  for (int i = 0; i < 40; ++i) judged.track.imu_trust.compare(T_turned, T_turned);
  EXPECT_TRUE(judged.judgement().fits_beside_new(turned));
  turned.T_target_source = judged.track.T_odom_lidar * planar_pose(1.5, 0.0, 0.0);
  EXPECT_FALSE(judged.judgement().fits_beside_new(turned)) << "half a metre from the prediction";
}

}  // namespace
}  // namespace revisit
