// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "simulated_drive.hpp"

namespace revisit {
namespace {

using testing_support::make;
using testing_support::small_drive;

TEST(Simulation, EverySensorKeepsToItsTable) {
  for (const SensorModel& sensor : sensor_models()) {
    SCOPED_TRACE(sensor.name);
    const auto recording = make(small_drive("town", sensor.name));
    const Scan scan = *recording->read(30);
    EXPECT_GT(scan.points.size(), sensor.beams() / (sensor.is_dome() ? 6 : 3)) << "a dome sees much sky";
    EXPECT_LE(scan.points.size(), sensor.beams());
    EXPECT_EQ(scan.rings.size(), sensor.rotates() ? scan.points.size() : 0u);
    ASSERT_EQ(scan.times_s.size(), scan.points.size());
    std::set<int> rings(scan.rings.begin(), scan.rings.end());
    EXPECT_GE(rings.size(), sensor.elevations_deg.size() / 3);
    double off_step = 0.0;
    for (std::size_t i = 0; i < scan.points.size(); ++i) {
      const Point& p = scan.points[i];
      const double range_m = std::sqrt(double{p.x} * p.x + double{p.y} * p.y + double{p.z} * p.z);
      ASSERT_GE(range_m, sensor.min_range_m - 1e-3);
      ASSERT_LE(range_m, sensor.max_range_m + 1e-3);
      ASSERT_LE(std::abs(scan.times_s[i]), 0.5 * sensor.sweep_s);
      ASSERT_GE(p.intensity, 0.f);
      ASSERT_LE(double{p.intensity}, sensor.intensity_max + 1e-6);
      const double steps = p.intensity / sensor.intensity_step;
      off_step = std::max(off_step, std::abs(steps - std::round(steps)));
      if (sensor.rotates()) {
        const double elevation = to_degrees(std::asin(p.z / range_m));
        ASSERT_NEAR(elevation, sensor.elevations_deg[scan.rings[i]], 0.01);
      } else if (sensor.is_dome()) {
        const double elevation = to_degrees(std::asin(p.z / range_m));
        ASSERT_GE(elevation, sensor.lowest_deg - 1e-3);
        ASSERT_LE(elevation, sensor.highest_deg + 1e-3);
      } else {
        ASSERT_LT(to_degrees(std::acos(p.x / range_m)), sensor.rosette_half_angle_deg + 4.0);
      }
    }
    EXPECT_LT(off_step, 1e-3);
  }
}

TEST(Simulation, RosetteAndDomeDoNotRepeat) {
  for (const char* sensor : {"rosette", "mid360"}) {
    SCOPED_TRACE(sensor);
    const auto recording = make(small_drive("warehouse", sensor));
    const Scan a = *recording->read(1), b = *recording->read(2);
    // Directions of one scan, in cells of a tenth of a degree: the next one looks mostly elsewhere.
    const auto cells = [](const Scan& scan) {
      std::set<std::pair<int, int>> result;
      for (const Point& p : scan.points)
        result.emplace(static_cast<int>(to_degrees(std::atan2(p.y, p.x)) * 10 + 5000),
                       static_cast<int>(to_degrees(std::atan2(p.z, std::hypot(p.x, p.y))) * 10 + 5000));
      return result;
    };
    const auto first = cells(a), second = cells(b);
    std::size_t common = 0;
    for (const auto& cell : second) common += first.contains(cell);
    EXPECT_LT(static_cast<double>(common), 0.35 * static_cast<double>(second.size()));
  }
}

TEST(Simulation, WhatCarriesTheSensorHidesTheViewBehindIt) {
  const auto azimuth_deg = [](const Point& p) { return std::abs(to_degrees(std::atan2(p.y, p.x))); };
  SimulationOptions options = small_drive("town", "os1-64");
  const Scan whole = *make(options)->read(30);
  options.blind_deg = 90.0;
  const Scan ahead = *make(options)->read(30);
  std::size_t seen = 0;
  for (const Point& p : whole.points) seen += azimuth_deg(p) < 134.9;
  EXPECT_LT(seen, whole.points.size()) << "without, it sees what is behind";
  EXPECT_NEAR(static_cast<double>(ahead.points.size()), static_cast<double>(seen), 0.01 * static_cast<double>(seen));
  for (const Point& p : ahead.points) ASSERT_LT(azimuth_deg(p), 135.1);
}

// The floor of the warehouse is flat at z = 0 and its western wall stands at x = 0: of the points, brought into the
// world by the poses of their own times, many must lie on them, and none below or behind.
void expect_on_floor_and_wall(const SimulationOptions& options) {
  constexpr double kNear_m = 0.05;  // three times the sensor's noise
  const auto recording = make(options);
  std::size_t on_floor = 0, below = 0, on_wall = 0, behind = 0;
  for (std::size_t index = 20; index + 1 < recording->size(); index += 40) {
    const Scan scan = *recording->read(index);
    const Pose T = *recording->trajectory().at(scan.frame);
    for (std::size_t i = 0; i < scan.points.size(); ++i) {
      const Point& p = scan.points[i];
      // Poses change alike from one stamp to the next.
      const double share = scan.times_s.empty() ? 0.0 : double{scan.times_s[i]} / 0.1;
      const Pose T_other = *recording->trajectory().at(FrameId{scan.frame.value + (share < 0.0 ? -1 : 1)});
      const Eigen::AngleAxisd turn(T.linear().transpose() * T_other.linear());
      Pose T_point = T;
      T_point.linear() = T.linear() * Eigen::AngleAxisd(std::abs(share) * turn.angle(), turn.axis()).toRotationMatrix();
      T_point.translation() += std::abs(share) * (T_other.translation() - T.translation());
      const Eigen::Vector3d world = T_point * Eigen::Vector3d(p.x, p.y, p.z);
      on_floor += std::abs(world.z()) <= kNear_m;
      below += world.z() < -kNear_m;
      on_wall += std::abs(world.x()) <= kNear_m && world.z() > 0.5;
      behind += world.x() < -kNear_m;
    }
  }
  EXPECT_GT(on_floor, 10000u);
  EXPECT_LT(below, on_floor / 500);
  EXPECT_GT(on_wall, 3000u);
  EXPECT_LT(behind, on_wall / 200);
}

TEST(Simulation, PosesAndTimesArePreciseWithMotionDistortion) {
  SimulationOptions options = small_drive("warehouse");
  options.traffic = 0.0;
  expect_on_floor_and_wall(options);
}

TEST(Simulation, PosesArePreciseWithoutMotionDistortion) {
  SimulationOptions options = small_drive("warehouse");
  options.traffic = 0.0;
  options.motion_distortion = false;
  EXPECT_TRUE(make(options)->read(3)->times_s.empty());
  expect_on_floor_and_wall(options);
}

TEST(Simulation, ATiltedSensorLeansAsFarAsItMay) {
  SimulationOptions options = small_drive("town");
  options.length_m = 300.0;
  options.tilt_deg = 40.0;
  double most_deg = 0.0;
  const auto recording = make(options);
  for (const auto& [frame, entry] : recording->trajectory().entries)
    most_deg = std::max(most_deg, to_degrees(std::acos(entry.T_world_lidar.linear()(2, 2))));
  EXPECT_GT(most_deg, 30.0);
  EXPECT_LE(most_deg, 40.0 + 1e-6);
}

}  // namespace
}  // namespace revisit
