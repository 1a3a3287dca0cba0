// SPDX-License-Identifier: Apache-2.0
#include <revisit/preprocess/imu_track.hpp>

#include <cmath>

#include <gtest/gtest.h>

#include <revisit/core/pose.hpp>

namespace revisit {
namespace {

// A scan at `stamp_s` with readings 200 times a second since 0.2 s before; `reading(t)` gives each.
template <typename Reading>
Scan scan_with(double stamp_s, Reading reading) {
  Scan scan;
  scan.stamp_s = stamp_s;
  scan.points = {{1, 0, 0, 0}, {0, 1, 0, 0}};
  scan.times_s = {-0.05f, 0.05f};
  for (int i = -40; i <= 10; ++i) {
    ImuSample sample = reading(stamp_s + 0.005 * i);
    sample.time_s = 0.005 * i;
    scan.imu.push_back(sample);
  }
  return scan;
}

double angle_deg(const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
  return to_degrees(std::atan2(a.cross(b).norm(), a.dot(b)));
}

TEST(ImuTrack, WithoutReadingsNothingIsSaid) {
  ImuTrack track;
  Scan scan;
  scan.stamp_s = 1.0;
  track.add(scan);
  EXPECT_FALSE(track.up());
  EXPECT_FALSE(track.rate_in_sweep_radps());
  EXPECT_FALSE(track.turn_since_last());
}

TEST(ImuTrack, UpIsWhereAccelerationPointsWhateverItsUnit) {
  for (const float gravity : {9.81f, 1.f}) {
    ImuTrack track;
    const Eigen::Vector3f up = Eigen::Vector3f(0.3f, -0.2f, -1.f).normalized();  // nearly upside down
    track.add(scan_with(5.0, [&](double) { return ImuSample{0.0, Eigen::Vector3f::Zero(), gravity * up}; }));
    ASSERT_TRUE(track.up());
    EXPECT_LT(angle_deg(*track.up(), up), 0.1);
    EXPECT_LT(track.rate_in_sweep_radps()->norm(), 1e-6);
  }
}

TEST(ImuTrack, TurnsAreCarriedOn) {
  // Rolls about x by half a turn a second, for two seconds.
  ImuTrack track;
  const double rate = kPi;
  const auto up_at = [&](double t) {
    return Eigen::Vector3f(0.f, static_cast<float>(std::sin(rate * t)), static_cast<float>(std::cos(rate * t)));
  };
  for (int i = 0; i < 20; ++i)
    track.add(scan_with(0.1 * i, [&](double t) {
      return ImuSample{0.0, {static_cast<float>(rate), 0.f, 0.f}, 9.81f * up_at(t)};
    }));
  ASSERT_TRUE(track.up());
  EXPECT_LT(angle_deg(*track.up(), up_at(1.9)), 2.0);
  EXPECT_NEAR(track.rate_in_sweep_radps()->x(), rate, 1e-5);
  ASSERT_TRUE(track.turn_since_last());
  EXPECT_NEAR(Eigen::AngleAxisd(*track.turn_since_last()).angle(), 0.1 * rate, 1e-3);
}

TEST(ImuTrack, BrakingTiltsLittle) {
  ImuTrack track;
  for (int i = 0; i < 100; ++i)  // brakes with 3 m/s2 from 7 s to 9 s: felt as 17 degrees
    track.add(scan_with(0.1 * i, [&](double t) {
      return ImuSample{0.0, Eigen::Vector3f::Zero(), {t > 7.0 && t < 9.0 ? -3.f : 0.f, 0.f, 9.81f}};
    }));
  EXPECT_LT(angle_deg(*track.up(), Eigen::Vector3f::UnitZ()), 6.0);
}

TEST(ImuTrack, AfterAGapItBeginsAgain) {
  ImuTrack track;
  const auto still = [](double) { return ImuSample{0.0, Eigen::Vector3f::Zero(), {0.f, 0.f, 9.81f}}; };
  const auto lying = [](double) { return ImuSample{0.0, Eigen::Vector3f::Zero(), {9.81f, 0.f, 0.f}}; };
  for (int i = 0; i < 50; ++i) track.add(scan_with(0.1 * i, still));
  track.add(scan_with(60.0, lying));
  EXPECT_LT(angle_deg(*track.up(), Eigen::Vector3f::UnitX()), 1.0);
  EXPECT_FALSE(track.turn_since_last()) << "nobody knows how it turned in between";
}

}  // namespace
}  // namespace revisit
