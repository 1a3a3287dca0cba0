// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/recording.hpp>

#include <fstream>

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

TEST(Recording, NamesWithoutNumbersAreTakenInAlphabeticalOrder) {
  const fs::path folder = fresh_folder();
  write_bin(folder / "kitchen.bin", 1.f);
  write_bin(folder / "hall.bin", 2.f);
  const auto recording = open_recording(folder);
  ASSERT_TRUE(recording);
  EXPECT_FLOAT_EQ((*recording)->read(0)->points[0].x, 2.f);
}

TEST(Recording, FoldersThatCannotServeAreNamed) {
  EXPECT_NE(open_recording("/no/such").error().message.find("/no/such: no such folder"), std::string::npos);
  const fs::path folder = fresh_folder();
  EXPECT_NE(open_recording(folder).error().message.find("holds no scan"), std::string::npos);
  write_bin(folder / "0.bin", 1.f);
  EXPECT_NE(open_recording(folder / "0.bin").error().message.find("not a folder"), std::string::npos);
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

TEST(Recording, KittiOdometryFolder) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto recording = open_recording(shared_data() / "kitti00_mini");
  ASSERT_TRUE(recording) << recording.error().message;
  const Recording& r = **recording;
  EXPECT_EQ(r.size(), 27u);
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
  EXPECT_NEAR((r.stamp_s(59) - r.stamp_s(0)) / 59.0, 0.1034, 0.002);
  ASSERT_EQ(r.trajectory().entries.size(), 60u);
  EXPECT_LT(r.trajectory().at(FrameId{0})->translation().norm(), 1e-9);
  // Forward speed by GPS/IMU: 3.5 m/s at first.
  const Pose second = r.trajectory().at(FrameId{0})->inverse() * *r.trajectory().at(FrameId{10});
  EXPECT_NEAR(second.translation().x(), 3.3, 0.4);
}

}  // namespace
}  // namespace revisit
