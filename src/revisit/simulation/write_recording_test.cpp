// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iomanip>

#include <revisit/io/pose_file.hpp>
#include <revisit/simulation/write_recording.hpp>

#include "shared_data.hpp"
#include "simulated_drive.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::fresh_folder;
using testing_support::make;
using testing_support::refusal;
using testing_support::same_bytes;
using testing_support::small_drive;

TEST(Simulation, WhatIsWrittenIsReadBackTheSame) {
  SimulationOptions options = small_drive("town");
  options.frames = 3;
  const auto recording = make(options);
  const fs::path folder = fresh_folder() / "drive";
  std::size_t reported = 0;
  ASSERT_TRUE(write_recording(*recording, folder, 2, [&](std::size_t done) { return reported = done, true; }));
  EXPECT_EQ(reported, 3u);
  const auto read = open_recording(folder);
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ((*read)->size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_TRUE(same_bytes(*recording->read(i), *(*read)->read(i)));
    EXPECT_NEAR((*read)->stamp_s(i), recording->stamp_s(i), 1e-6);
    EXPECT_TRUE((*read)
                    ->trajectory()
                    .at(read.operator*()->frame(i))
                    ->isApprox(*recording->trajectory().at(recording->frame(i)), 1e-6));
  }
  for (const char* file : {"wheel_odometry.tum", "odometry.tum"}) {
    const auto odometry = read_poses(folder / file);
    ASSERT_TRUE(odometry) << odometry.error().message;
    EXPECT_EQ(odometry->rows.size(), 3u);
  }
}

TEST(Simulation, AFolderThatHoldsSomethingIsLeftAlone) {
  const fs::path folder = fresh_folder();
  std::ofstream(folder / "mine.txt") << "precious";
  SimulationOptions options = small_drive("town");
  options.frames = 1;
  const Status status = write_recording(*make(options), folder);
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("holds something already"), std::string::npos);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 1);
}

TEST(Simulation, StopsWhenAskedAndLeavesARecordingWithoutHoles) {
  SimulationOptions options = small_drive("town");
  options.frames = 20;
  const fs::path folder = fresh_folder() / "drive";
  ASSERT_TRUE(write_recording(*make(options), folder, 2, [](std::size_t done) { return done < 4; }));
  const auto read = open_recording(folder);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_GE((*read)->size(), 4u);
  EXPECT_LE((*read)->size(), 6u);
  for (std::size_t i = 0; i < (*read)->size(); ++i) EXPECT_EQ((*read)->frame(i).value, static_cast<std::int64_t>(i));
}

TEST(Simulation, UnknownNamesAreToldWithTheKnownOnes) {
  EXPECT_EQ(refusal(small_drive("town", "hdl32")),
            "simulation.sensor = 'hdl32' is not known; allowed: hdl64e, vlp16, os0-128, rosette, os1-64, mid360");
  EXPECT_EQ(refusal(small_drive("moon")), "simulation.world = 'moon' is not known; allowed: town, warehouse, building");
}

std::string drive_along(const std::string& rows) {
  const fs::path file = fresh_folder() / "poses.txt";
  std::ofstream(file) << rows;
  SimulationOptions options = small_drive("town");
  options.trajectory = file.string();
  return refusal(options);
}

std::string kitti_row(double x, double z) {
  std::ostringstream row;
  row << "1 0 0 " << x << " 0 1 0 0 0 0 1 " << z << "\n";
  return row.str();
}

TEST(Simulation, TrajectoriesThatCannotBeDrivenAreRefused) {
  EXPECT_EQ(drive_along(kitti_row(0, 0) + kitti_row(0, 1) + kitti_row(0, 2)), "");
  EXPECT_NE(drive_along(kitti_row(0, 0)).find("holds 1 pose; a drive needs at least 2"), std::string::npos);
  EXPECT_NE(drive_along(kitti_row(0, 0) + kitti_row(0, 1) + kitti_row(40, 1)).find("pose 3: a jump of 40.0 m"),
            std::string::npos);
  EXPECT_NE(drive_along(kitti_row(0, 0) + "1 0 0 nan 0 1 0 0 0 0 1 0\n").find(":2: not a rigid transform"),
            std::string::npos);
  std::string gap = kitti_row(0, 0) + kitti_row(0, 1);
  for (int i = 0; i < 12; ++i) gap += i < 11 ? "nan " : "nan\n";
  EXPECT_NE(drive_along(gap).find("1 rows of NaN"), std::string::npos) << "NaN is counted as a row";
  EXPECT_NE(drive_along(kitti_row(0, 0) + kitti_row(0, 0)).find("the drive is 0.000000 m long"), std::string::npos);
  EXPECT_NE(drive_along("0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n1 2 0 0 0 0 0 1\n").find("does not increase"),
            std::string::npos);
  EXPECT_NE(drive_along("0 0 0 0 0 0 0 1\n9 1 0 0 0 0 0 1\n").find("9.0 s after"), std::string::npos);
  EXPECT_NE(drive_along("").find("holds no poses"), std::string::npos);
  SimulationOptions indoors = small_drive("warehouse");
  indoors.trajectory = "poses.txt";
  EXPECT_NE(refusal(indoors).find("a warehouse has its own drive"), std::string::npos);
}

// The same drive in coordinates of a map grid: the same scans to the bit, and poses that differ by the offset alone.
TEST(Simulation, DrivesFarFromTheOriginAreAsPrecise) {
  const auto along = [](double east_m, double north_m) {
    const fs::path file = fresh_folder() / "poses.tum";
    std::ofstream rows(file);
    rows << std::setprecision(12);
    for (int i = 0; i < 30; ++i)
      rows << 0.1 * i << " " << east_m + 0.75 * i << " " << north_m + 0.25 * i << " 0 0 0 0 1\n";
    rows.close();
    SimulationOptions options = small_drive("town");
    options.trajectory = file.string();
    return make(options);
  };
  const auto near = along(0, 0), far = along(330000, 4150000);
  EXPECT_TRUE(same_bytes(*near->read(10), *far->read(10)));
  const Eigen::Vector3d offset =
      far->trajectory().at(FrameId{10})->translation() - near->trajectory().at(FrameId{10})->translation();
  EXPECT_LT((offset - Eigen::Vector3d(330000, 4150000, 0)).norm(), 1e-6);
}

TEST(Simulation, ATrajectoryIsFollowed) {
  REVISIT_NEEDS_SHARED_DATA();
  SimulationOptions options = small_drive("town");
  options.trajectory = (testing_support::shared_data() / "poses/kitti_06.txt").string();
  const auto recording = make(options);
  const auto poses = read_poses(options.trajectory);
  ASSERT_EQ(recording->size(), poses->rows.size());
  for (const std::int64_t frame : {0, 300, 1100}) {
    const Eigen::Vector3d camera = poses->rows[static_cast<std::size_t>(frame)].T_world_body.translation();
    const Eigen::Vector3d lidar = recording->trajectory().at(FrameId{frame})->translation();
    EXPECT_NEAR(lidar.x(), camera.z(), 0.1);   // z forward, x right -> x forward, y left
    EXPECT_NEAR(lidar.y(), -camera.x(), 0.1);  // the mast leans with the road
  }
}

}  // namespace
}  // namespace revisit
