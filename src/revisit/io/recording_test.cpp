// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/recording.hpp>

#include <fstream>
#include <limits>

#include "shared_data.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::fresh_folder;
using testing_support::shared_data;

void write_bin(const fs::path& file, float x) {
  std::ofstream stream(file, std::ios::binary);
  for (int i = 0; i < 10; ++i)
    for (const float value : {x, static_cast<float>(i), 0.f, 0.5f})
      stream.write(reinterpret_cast<const char*>(&value), 4);
}

TEST(Recording, BareFolderTakesFrameNumbersFromNames) {
  const fs::path folder = fresh_folder();
  write_bin(folder / "scan_10.bin", 10.f);
  write_bin(folder / "scan_9.bin", 9.f);
  std::ofstream(folder / "notes.txt") << "not a scan";
  const auto recording = open_recording(folder);
  ASSERT_TRUE(recording) << recording.error().message;
  ASSERT_EQ((*recording)->size(), 2u);
  EXPECT_EQ((*recording)->frame(0).value, 9);
  EXPECT_DOUBLE_EQ((*recording)->stamp_s(1), 1.0) << "0.1 s a frame without times";
  const auto scan = (*recording)->read(1);
  ASSERT_TRUE(scan);
  EXPECT_EQ(scan->frame.value, 10);
  EXPECT_FLOAT_EQ(scan->points[0].x, 10.f);
}

TEST(Recording, NamesThatAreTimesGiveStampsAndFramesAreCounted) {
  const fs::path folder = fresh_folder();
  write_bin(folder / "1326030975726043.bin", 1.f);
  write_bin(folder / "1326030975826043.bin", 2.f);
  const auto recording = open_recording(folder);
  ASSERT_TRUE(recording);
  EXPECT_EQ((*recording)->frame(1).value, 1);
  EXPECT_NEAR((*recording)->stamp_s(1) - (*recording)->stamp_s(0), 0.1, 1e-6);
  EXPECT_NEAR((*recording)->stamp_s(0), 1326030975.726043, 1e-6);
  EXPECT_TRUE((*recording)->has_times());
}

TEST(Recording, NamesThatAreNanosecondsSinceBootAreTimes) {
  const fs::path folder = fresh_folder();
  for (const char* name : {"412300000000.bin", "412400021000.bin", "412499873000.bin"}) write_bin(folder / name, 1.f);
  const auto recording = open_recording(folder);
  ASSERT_TRUE(recording);
  EXPECT_TRUE((*recording)->has_times());
  EXPECT_EQ((*recording)->frame(2).value, 2);
  EXPECT_NEAR((*recording)->stamp_s(1), 412.400021, 1e-9);
  const fs::path frames = fresh_folder() / "frames";
  fs::create_directories(frames);
  for (const char* name : {"000100.bin", "000200.bin", "010000.bin"}) write_bin(frames / name, 1.f);
  const auto counted = open_recording(frames);
  ASSERT_TRUE(counted);
  EXPECT_FALSE((*counted)->has_times());
  EXPECT_EQ((*counted)->frame(2).value, 10000);
}

TEST(Recording, TimesAndPosesStandInAFolderOfScansOrBesideIt) {
  const fs::path folder = fresh_folder(), scans = folder / "scans";
  fs::create_directories(scans);
  for (const char* name : {"000007.bin", "000008.bin"}) write_bin(scans / name, 1.f);
  const auto write = [](const fs::path& where, const char* offset) {
    std::ofstream(where / "times.txt") << offset << "0.5\n" << offset << "1.0\n";
    std::ofstream(where / "poses.txt") << "1 0 0 " << offset << " 0 1 0 0 0 0 1 0\n1 0 0 5 0 1 0 0 0 0 1 0\n";
  };
  write(folder, "3");
  auto recording = open_recording(scans);
  ASSERT_TRUE(recording) << recording.error().message;
  EXPECT_TRUE((*recording)->has_times());
  EXPECT_DOUBLE_EQ((*recording)->stamp_s(0), 30.5) << "a row a scan: in their order";
  ASSERT_EQ((*recording)->trajectory().entries.size(), 2u);
  EXPECT_DOUBLE_EQ((*recording)->trajectory().at(FrameId{7})->translation().x(), 3.0);
  write(scans, "4");
  recording = open_recording(scans);
  EXPECT_DOUBLE_EQ((*recording)->stamp_s(0), 40.5) << "those inside come first";
  EXPECT_FALSE((*recording)->read(0)->is_stamp_assumed);
  fs::remove(scans / "times.txt");
  fs::remove(scans / "poses.txt");
  std::ofstream(folder / "times.txt") << "1\n";
  std::string warning;
  recording = open_recording(scans, [&](LogLevel, const std::string& message) { warning = message; });
  ASSERT_TRUE(recording) << "what stands beside may belong to something else";
  EXPECT_FALSE((*recording)->has_times());
  EXPECT_TRUE((*recording)->read(0)->is_stamp_assumed);
  EXPECT_NE(warning.find("needs row 8"), std::string::npos) << warning;
}

TEST(Recording, AMapIsNoRecording) {
  const fs::path folder = fresh_folder();
  write_bin(folder / "map.bin", 1.f);
  fs::create_directories(folder / "tiles");
  std::ofstream(folder / "tiles" / "tileset.json") << "{}";
  EXPECT_NE(open_recording(folder).error().message.find("holds a map"), std::string::npos);
}

TEST(Recording, ARemarkAboutItsFilesIsMadeOnce) {
  const fs::path folder = fresh_folder();
  for (int i = 0; i < 5; ++i) {
    std::ofstream file(folder / (std::to_string(i) + ".pcd"));
    file << "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\n"
            "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA ascii\n1 2 3\n4 5 6\n";
  }
  int remarks = 0;
  const auto recording = open_recording(folder, [&](LogLevel, const std::string& message) {
    remarks += message.find("no intensity field") != std::string::npos;
  });
  ASSERT_TRUE(recording);
  for (std::size_t i = 0; i < 5; ++i) ASSERT_TRUE((*recording)->read(i));
  EXPECT_EQ(remarks, 1);
}

TEST(Recording, PosesMayComeFromAFileOfTheirOwn) {
  const fs::path folder = fresh_folder();
  write_bin(folder / "3.bin", 1.f);
  write_bin(folder / "4.bin", 2.f);
  const fs::path poses = folder / "poses.g2o";
  std::ofstream(poses) << "VERTEX_SE3:QUAT 4 1 2 3 0 0 0 1\nVERTEX_SE3:QUAT 99 0 0 0 0 0 0 1\n";
  const auto recording = open_recording(folder, {}, {.poses_file = poses});
  ASSERT_TRUE(recording) << recording.error().message;
  EXPECT_EQ((*recording)->trajectory().entries.size(), 1u) << "frame 99 is not in the recording";
  EXPECT_DOUBLE_EQ((*recording)->trajectory().at(FrameId{4})->translation().y(), 2.0);
  std::ofstream(poses) << "VERTEX_SE3:QUAT 99 0 0 0 0 0 0 1\n";
  EXPECT_NE(open_recording(folder, {}, {.poses_file = poses}).error().message.find("no pose belongs"),
            std::string::npos);
}

TEST(Recording, KittiRawTimesAndCalibration) {
  const fs::path day = fresh_folder(), folder = day / "drive";
  fs::create_directories(folder / "velodyne_points" / "data");
  fs::create_directories(folder / "oxts" / "data");
  write_bin(folder / "velodyne_points" / "data" / "0000000000.bin", 1.f);
  std::ofstream(folder / "oxts" / "data" / "0000000000.txt") << "49 8 110 0 0 0\n";
  const fs::path times = folder / "velodyne_points" / "timestamps.txt";
  for (const char* bad : {"2011-99-99 99:99:nan\n", "2011-09-26 25:00:00.0\n", "yesterday\n"}) {
    std::ofstream(times, std::ios::trunc) << bad;
    EXPECT_FALSE(open_recording(folder)) << bad;
  }
  std::ofstream(times, std::ios::trunc) << "2011-09-26 13:04:32.5\n";
  std::string warning;
  const auto without = open_recording(folder, [&](LogLevel, const std::string& message) { warning = message; });
  ASSERT_TRUE(without) << without.error().message;
  EXPECT_TRUE((*without)->trajectory().empty()) << "poses of the IMU are not the LiDAR's";
  EXPECT_NE(warning.find("calib_imu_to_velo.txt: missing"), std::string::npos);
  std::ofstream(day / "calib_imu_to_velo.txt") << "R: 1 0 0 0 1 0 0 0 1\nT: 0 0 0\n";
  const auto recording = open_recording(folder);
  EXPECT_EQ((*recording)->trajectory().entries.size(), 1u) << "KITTI keeps it beside the drives";
  // The LiDAR stands 2 m ahead of the IMU, which looks north.
  std::ofstream(day / "calib_imu_to_velo.txt", std::ios::trunc) << "R: 1 0 0 0 1 0 0 0 1\nT: -2 0 0\n";
  std::ofstream(folder / "oxts" / "data" / "0000000000.txt", std::ios::trunc)
      << "49 8 110 0 0 1.5707963267948966 "
      << "0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0.4 0\n";
  const auto fixes = (*open_recording(folder))->gps_fixes({});
  ASSERT_TRUE(fixes);
  ASSERT_EQ(fixes->size(), 1u);
  EXPECT_NEAR((*fixes)[0].latitude_deg, 49.0 + to_degrees(2.0 / 6378137.0), 1e-9);
  EXPECT_NEAR((*fixes)[0].longitude_deg, 8.0, 1e-9);
  EXPECT_DOUBLE_EQ((*fixes)[0].stamp_s, (*recording)->stamp_s(0));
  EXPECT_EQ((*fixes)[0].deviation_m, Eigen::Vector3d(0.4, 0.4, 0.8));
}

TEST(Recording, WhatCannotBeLookedAtIsAnErrorNotAnException) {
  const fs::path folder = fresh_folder();
  fs::create_directories(folder / "velodyne");
  write_bin(folder / "velodyne" / "000000.bin", 1.f);
  fs::create_symlink("times.txt", folder / "times.txt");
  EXPECT_NE(open_recording(folder).error().message.find("times.txt"), std::string::npos);
}

TEST(Recording, NamesWithoutNumbersAreTakenInAlphabeticalOrder) {
  const fs::path folder = fresh_folder();
  write_bin(folder / "kitchen.bin", 1.f);
  write_bin(folder / "hall.bin", 2.f);
  const auto recording = open_recording(folder);
  ASSERT_TRUE(recording);
  EXPECT_FLOAT_EQ((*recording)->read(0)->points[0].x, 2.f);
}

TEST(Recording, FoldersThatCannotServeAreNamed) {
  EXPECT_NE(open_recording("/no/such").error().message.find("/no/such: no such file or folder"), std::string::npos);
  const fs::path folder = fresh_folder();
  EXPECT_NE(open_recording(folder).error().message.find("holds no scan"), std::string::npos);
  write_bin(folder / "0.bin", 1.f);
  EXPECT_NE(open_recording(folder / "0.bin").error().message.find("is no recording"), std::string::npos);
}

TEST(Recording, BrokenSideFilesOfAKittiFolderAreErrors) {
  const fs::path folder = fresh_folder();
  fs::create_directories(folder / "velodyne");
  write_bin(folder / "velodyne" / "000003.bin", 1.f);
  ASSERT_TRUE(open_recording(folder));
  std::ofstream(folder / "times.txt") << "0\n0.1\n0.2\n";
  EXPECT_NE(open_recording(folder).error().message.find("frame 3 needs row 4"), std::string::npos);
  std::ofstream(folder / "times.txt") << "0\n0.1\n0.2\n0.3\n";
  std::ofstream(folder / "calib.txt") << "Tr: 1 0 0\n";
  EXPECT_NE(open_recording(folder).error().message.find("needs 12 numbers"), std::string::npos);
}

template <typename T>
void write_values(const fs::path& file, const std::vector<T>& values) {
  fs::create_directories(file.parent_path());
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(values.data()), static_cast<std::streamsize>(values.size() * sizeof(T)));
}

TEST(Recording, TimesAndRingsAreOfTheReturnsOrOfAllPoints) {
  const fs::path folder = fresh_folder();
  std::vector<Point> points;
  std::vector<float> times_s;
  for (int i = 0; i < 10; ++i) {
    points.push_back({1.f, static_cast<float>(i), 0.f, 0.5f});
    times_s.push_back(-0.01f * static_cast<float>(i));
  }
  points[3].y = std::numeric_limits<float>::quiet_NaN();
  points[6] = {};
  times_s[6] = 90.f;  // of nothing
  write_values(folder / "velodyne" / "000000.bin", points);
  write_values(folder / "velodyne_times" / "000000.bin", times_s);
  write_values(folder / "velodyne_rings" / "000000.bin", std::vector<std::uint16_t>{0, 1, 2, 4, 5, 7, 8, 9});
  const auto scan = (*open_recording(folder))->read(0);
  ASSERT_TRUE(scan) << scan.error().message;
  ASSERT_EQ(scan->points.size(), 8u);
  ASSERT_EQ(scan->times_s.size(), 8u);
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_FLOAT_EQ(scan->points[i].y, scan->rings[i]);
    EXPECT_FLOAT_EQ(scan->times_s[i], -0.01f * scan->points[i].y);
  }
  times_s.resize(9);
  write_values(folder / "velodyne_times" / "000000.bin", times_s);
  const auto refused = (*open_recording(folder))->read(0);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("36 bytes; allowed: 40"), std::string::npos) << refused.error().message;
}

// The layout of KITTI is not its sensor.
TEST(Recording, OnlyTheCarOfKittiHasItsElevations) {
  const fs::path folder = fresh_folder();
  fs::create_directories(folder / "velodyne");
  write_bin(folder / "velodyne" / "000000.bin", 1.f);
  const auto offset_deg = [&](const std::string& focal) {
    const std::string rest = " 0 6 0 0 7 1 0 0 0 1 0\n";
    std::ofstream(folder / "calib.txt") << "P0: " << focal << rest << "Tr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n";
    return (*open_recording(folder))->elevation_offset_deg();
  };
  EXPECT_EQ(offset_deg("7.188560000000e+02"), 0.205);
  EXPECT_EQ(offset_deg("7.100000000000e+02"), 0.0);
}

TEST(Recording, KittiOdometryFolder) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto recording = open_recording(shared_data() / "kitti00_mini");
  ASSERT_TRUE(recording) << recording.error().message;
  const Recording& r = **recording;
  EXPECT_EQ(r.size(), 27u);
  EXPECT_EQ(r.elevation_offset_deg(), 0.205);
  EXPECT_TRUE(r.has_times());
  EXPECT_EQ(r.frame(26).value, 4501);
  EXPECT_NEAR(r.stamp_s(26), 466.5, 0.1);
  ASSERT_EQ(r.trajectory().entries.size(), 27u);
  // The revisit that the data's README states.
  const Pose T = r.trajectory().at(FrameId{52})->inverse() * *r.trajectory().at(FrameId{4501});
  EXPECT_NEAR(T.translation().norm(), 2.96, 0.01);
  EXPECT_NEAR(to_degrees(rotation_angle(T)), 0.7, 0.05);
  // The LiDAR looks forward: the first step goes along its x axis.
  const Pose step = r.trajectory().at(FrameId{0})->inverse() * *r.trajectory().at(FrameId{1});
  EXPECT_GT(step.translation().x(), 0.8);
  EXPECT_LT(std::abs(step.translation().y()), 0.1);
}

TEST(Recording, KittiRawDrive) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto recording = open_recording(shared_data() / "kitti_raw_0005");
  ASSERT_TRUE(recording) << recording.error().message;
  const Recording& r = **recording;
  EXPECT_EQ(r.size(), 60u);
  EXPECT_EQ(r.elevation_offset_deg(), 0.205);
  EXPECT_NEAR((r.stamp_s(59) - r.stamp_s(0)) / 59.0, 0.1034, 0.002);
  ASSERT_EQ(r.trajectory().entries.size(), 60u);
  EXPECT_LT(r.trajectory().at(FrameId{0})->translation().norm(), 1e-9);
  // Forward speed by GPS/IMU: 3.5 m/s at first.
  const Pose second = r.trajectory().at(FrameId{0})->inverse() * *r.trajectory().at(FrameId{10});
  EXPECT_NEAR(second.translation().x(), 3.3, 0.4);
}

}  // namespace
}  // namespace revisit
