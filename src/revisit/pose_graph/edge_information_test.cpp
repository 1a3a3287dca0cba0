// SPDX-License-Identifier: Apache-2.0
#include <revisit/pose_graph/edge_information.hpp>

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

namespace revisit {
namespace {

double metres_along_x(const Matrix6& information) { return 1.0 / std::sqrt(information(0, 0)); }

TEST(EdgeInformation, IsSymmetricAndPositiveDefinite) {
  Matrix6 registration = Matrix6::Identity() * 1e6;
  registration(0, 1) = registration(1, 0) = 4e5;
  for (const Matrix6& each :
       {odometry_information(planar_pose(2, 0, 0), registration), external_odometry_information(planar_pose(2, 0, 0)),
        loop_information(registration), loop_information(Matrix6::Zero()), no_information()}) {
    EXPECT_TRUE(each.isApprox(each.transpose(), 1e-12));
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6>(each).eigenvalues().minCoeff(), 0.0);
  }
}

TEST(EdgeInformation, NeverClaimsMoreThanTheLeastError) {
  const Matrix6 perfect = Matrix6::Identity() * 1e12;
  EXPECT_NEAR(metres_along_x(loop_information(perfect)), 0.08, 1e-4);
  EXPECT_NEAR(metres_along_x(odometry_information(planar_pose(10, 0, 0), perfect)), 0.003 + 0.002 * 10.0, 1e-4);
}

TEST(EdgeInformation, TrustsLongMotionsLessAndExternalOdometryLeast) {
  const Matrix6 registration = Matrix6::Identity() * 1e6;
  const Pose near = planar_pose(1, 0, 0), far = planar_pose(20, 0, 0);
  EXPECT_GT(odometry_information(near, registration)(0, 0), odometry_information(far, registration)(0, 0));
  EXPECT_GT(odometry_information(near, registration)(0, 0), external_odometry_information(near)(0, 0));
  EXPECT_GT(external_odometry_information(far)(0, 0), no_information()(0, 0));
}

TEST(EdgeInformation, IsTheInverseOfWhatMotionsAreOff) {
  const auto expect_deviations = [](const Matrix6& information, double metres, double degrees) {
    for (Eigen::Index i = 0; i < 3; ++i) EXPECT_NEAR(1.0 / std::sqrt(information(i, i)), metres, 1e-9);
    for (Eigen::Index i = 3; i < 6; ++i) EXPECT_NEAR(to_degrees(1.0 / std::sqrt(information(i, i))), degrees, 1e-9);
  };
  const Pose two_metres = planar_pose(0, 2, 0.3);
  expect_deviations(odometry_information(two_metres, Matrix6::Zero()), 0.007, 0.02);
  expect_deviations(external_odometry_information(two_metres), 0.07, 0.25);
  expect_deviations(loop_information(Matrix6::Zero()), 0.08, 0.25);
  expect_deviations(no_information(), 100.0, to_degrees(10.0));
  // Registration that claims 0.1 m is believed to 0.3 m, beside 0.08 m and the 1 m that it says at least.
  EXPECT_NEAR(metres_along_x(loop_information(100.0 * Matrix6::Identity())), std::hypot(0.08, 3.0 / std::sqrt(101.0)),
              1e-9);
}

TEST(EdgeInformation, OfTwoMotionsInARowTheErrorsAddUpAndAreSeenFromTheEnd) {
  const Matrix6 sure = 1e12 * Matrix6::Identity();
  Matrix6 heading_only = sure;
  heading_only(5, 5) = 100.0;  // a heading that is off by 0.1 rad
  const Matrix6 ahead = chained_information(heading_only, sure, planar_pose(10, 0, 0)).inverse();
  EXPECT_NEAR(std::sqrt(ahead(1, 1)), 1.0, 1e-3) << "10 m ahead that is a metre to the side";
  EXPECT_NEAR(std::sqrt(ahead(0, 0)), 0.0, 1e-3);
  EXPECT_NEAR(ahead(1, 5), 0.1, 1e-3) << "to the left where it turns left";
  const Matrix6 turned = chained_information(heading_only, sure, planar_pose(10, 0, kPi / 2)).inverse();
  EXPECT_NEAR(std::sqrt(turned(0, 0)), 1.0, 1e-3) << "the side is ahead of a sensor that has turned";
  Matrix6 pitch_only = sure, roll_only = sure;
  pitch_only(4, 4) = roll_only(3, 3) = 100.0;
  EXPECT_NEAR(chained_information(pitch_only, sure, planar_pose(10, 0, 0)).inverse()(2, 4), -0.1, 1e-3) << "nose down";
  EXPECT_NEAR(chained_information(roll_only, sure, planar_pose(0, 10, 0)).inverse()(2, 3), 0.1, 1e-3);
  const Matrix6 sum = chained_information(25.0 * Matrix6::Identity(), 100.0 * Matrix6::Identity(), Pose::Identity());
  EXPECT_NEAR(metres_along_x(sum), std::sqrt(0.2 * 0.2 + 0.1 * 0.1), 1e-9);
}

// Along a corridor registration says nothing: the graph must not be pulled that way.
TEST(EdgeInformation, ADirectionThatRegistrationDoesNotFixStaysOpen) {
  Matrix6 corridor = Matrix6::Identity() * 1e6;
  corridor(0, 0) = 0.0;
  EXPECT_GT(metres_along_x(loop_information(corridor)), 2.0);
  EXPECT_LT(1.0 / std::sqrt(loop_information(corridor)(1, 1)), 0.1);
}

}  // namespace
}  // namespace revisit
