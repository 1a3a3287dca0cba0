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

// Along a corridor registration says nothing: the graph must not be pulled that way.
TEST(EdgeInformation, ADirectionThatRegistrationDoesNotFixStaysOpen) {
  Matrix6 corridor = Matrix6::Identity() * 1e6;
  corridor(0, 0) = 0.0;
  EXPECT_GT(metres_along_x(loop_information(corridor)), 2.0);
  EXPECT_LT(1.0 / std::sqrt(loop_information(corridor)(1, 1)), 0.1);
}

}  // namespace
}  // namespace revisit
