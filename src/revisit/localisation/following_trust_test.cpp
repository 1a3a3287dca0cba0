// SPDX-License-Identifier: Apache-2.0
#include <revisit/localisation/following_trust.hpp>

#include <gtest/gtest.h>

namespace revisit {
namespace {

// How far a robot goes until it is no longer believed to be there; 1,000 m if it always is.
double believed_m(FollowingTrust trust, double own_log_odds, double step_m) {
  double travelled_m = 0.0;
  while (!trust.is_gone() && travelled_m < 1000.0) {
    trust = trust.after(own_log_odds, step_m);
    travelled_m += step_m;
  }
  return travelled_m;
}

TEST(FollowingTrust, IsGoneAfterSomeMetresOfWhatTheMapDoesNotShow) {
  EXPECT_NEAR(believed_m({}, -1.0, 0.1), 3.1, 0.11);
  EXPECT_NEAR(believed_m({}, 0.0, 0.1), 6.1, 0.11) << "where it is, scans show more than that";
  EXPECT_NEAR(believed_m({}, 0.5, 0.1), 12.1, 0.11);
  EXPECT_NEAR(believed_m({}, -50.0, 0.1), 3.1, 0.11) << "one scan may show whatever it likes";
  EXPECT_EQ(believed_m({}, -50.0, 3.0), believed_m({}, -50.0, 9.0) / 3.0) << "farther on is one more view, too";
}

TEST(FollowingTrust, StaysWhereScansFitAndWhereTheRobotStands) {
  EXPECT_EQ(believed_m({}, 1.1, 0.5), 1000.0);
  FollowingTrust trust;
  for (int i = 0; i < 1000; ++i) trust = trust.after(-2.0, 0.0);
  EXPECT_FALSE(trust.is_gone()) << "somebody stands before it";
}

TEST(FollowingTrust, ComesBackButIsNotSavedUp) {
  FollowingTrust trust;
  for (int i = 0; i < 100; ++i) trust = trust.after(5.0, 3.0);
  EXPECT_NEAR(believed_m(trust, -2.0, 0.1), 9.1, 0.11);
  trust = trust.after(-2.0, 3.0).after(-2.0, 3.0);
  EXPECT_NEAR(believed_m(trust, -2.0, 0.1), 3.1, 0.11);
  EXPECT_NEAR(believed_m(trust.after(1.5, 3.0), -2.0, 0.1), 3.85, 0.11);
}

}  // namespace
}  // namespace revisit
