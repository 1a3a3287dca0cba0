// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/prepare.hpp>

#include <gtest/gtest.h>

#include "synthetic_world.hpp"

namespace revisit {
namespace {

using testing_support::SyntheticWorld;

Scan some_scan() { return SyntheticWorld(41).scan(SyntheticWorld::at(0, 0, 0), {32, 900, -24.8, 5.0}); }

TEST(PrepareScan, GroundIsDescribedOnlyIfAsked) {
  Parameters keep, remove;
  keep.descriptor.levels = remove.descriptor.levels = 0;  // layers begin above the ground anyway
  remove.preprocess.remove_ground = true;
  const auto with = prepare_scan(some_scan(), keep, {});
  const auto without = prepare_scan(some_scan(), remove, {});
  ASSERT_TRUE(with && without);
  EXPECT_LT(without->descriptor.occupied_cells(), with->descriptor.occupied_cells() - 100);
  EXPECT_EQ(with->cloud.points.size(), without->cloud.points.size()) << "registration keeps the ground";
}

TEST(PrepareScan, AScanTakenUpsideDownDescribesTheSamePlace) {
  const Scan scan = some_scan();
  Scan turned = scan;  // about x
  turned.up = -Eigen::Vector3f::UnitZ();
  for (Point& p : turned.points) p = {p.x, -p.y, -p.z, p.intensity};
  const auto upright = prepare_scan(scan, {}, {}), hanging = prepare_scan(turned, {}, {});
  ASSERT_TRUE(upright && hanging);
  EXPECT_EQ(upright->descriptor.intensity, hanging->descriptor.intensity);
  EXPECT_EQ(upright->ground.is_ground, hanging->ground.is_ground);
  EXPECT_EQ(upright->ground_z_m, hanging->ground_z_m);
  EXPECT_LT(hanging->cloud.up.z(), -0.99f);
}

TEST(PrepareScan, ScansThatDescribeNoPlaceSayWhy) {
  Scan one_cell;
  for (int i = 0; i < 500; ++i) one_cell.points.push_back({20.f + 1e-4f * static_cast<float>(i), 3.f, 0.f, 0.5f});
  Scan one_point;
  one_point.points.push_back({20.f, 3.f, 0.f, 0.5f});
  const Scan empty;
  for (const Scan& scan : {one_cell, one_point, empty}) {
    const auto prepared = prepare_scan(scan, {}, {});
    ASSERT_FALSE(prepared);
    EXPECT_NE(prepared.error().message.find("are needed to describe a place"), std::string::npos)
        << prepared.error().message;
  }
}

TEST(PrepareScan, RingGainsOfAnotherSensorAreLeftOut) {
  const IntensityCalibration other_sensor{{}, {}, {0.5, 0.5, 0.5}};
  const auto plain = prepare_scan(some_scan(), {}, {});
  const auto calibrated = prepare_scan(some_scan(), {}, {}, other_sensor);
  ASSERT_TRUE(plain && calibrated);
  EXPECT_EQ(plain->descriptor.intensity, calibrated->descriptor.intensity);
}

}  // namespace
}  // namespace revisit
