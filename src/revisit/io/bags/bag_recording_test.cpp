// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <fstream>

#include <gtest/gtest.h>

#include <revisit/io/bag_topics.hpp>
#include <revisit/io/bag_writer.hpp>
#include <revisit/io/internal/bag_file_writer.hpp>
#include <revisit/io/internal/message_writer.hpp>
#include <revisit/io/internal/messages_for_test.hpp>
#include <revisit/io/recording.hpp>

#include "shared_data.hpp"

namespace revisit {
namespace {

namespace fs = std::filesystem;
using testing_support::fresh_folder;
using testing_support::shared_data;

constexpr const char* kEndings[] = {"drive.bag", "drive.mcap", "drive.db3"};

fs::path recordings() { return shared_data() / "recordings"; }

struct Opened {
  std::unique_ptr<Recording> recording;
  std::string log, error;
};
Opened open(const fs::path& path, const RecordingOptions& options = {}) {
  Opened result;
  auto recording = open_recording(
      path, [&](LogLevel, const std::string& message) { result.log += message + "\n"; }, options);
  if (recording)
    result.recording = *std::move(recording);
  else
    result.error = recording.error().message;
  return result;
}

// A scan that no other has.
Scan scan_at(int index) {
  Scan scan;
  scan.frame = FrameId{index};
  scan.stamp_s = 1'600'000'000 + 0.1 * index;
  for (int i = 0; i < 50; ++i) {
    scan.points.push_back({5.f + static_cast<float>(index), static_cast<float>(i), 0.5f, static_cast<float>(i)});
    scan.rings.push_back(static_cast<std::uint16_t>(i % 16));
    scan.times_s.push_back(-0.05f + 0.002f * static_cast<float>(i));
  }
  return scan;
}

void expect_same(const Scan& a, const Scan& b) {
  EXPECT_EQ(a.stamp_s, b.stamp_s);
  ASSERT_EQ(a.points.size(), b.points.size());
  EXPECT_EQ(std::memcmp(a.points.data(), b.points.data(), a.points.size() * sizeof(Point)), 0);
  EXPECT_EQ(a.rings, b.rings);
  ASSERT_EQ(a.times_s.size(), b.times_s.size());
  for (std::size_t i = 0; i < a.times_s.size(); ++i) EXPECT_EQ(a.times_s[i], b.times_s[i]);
}

struct Expected {
  const char* file;
  std::size_t scans, fewest, most;  ///< and points of each
  bool times, rings, intensity;
};

TEST(BagRecording, GivesWhatEachFileHolds) {
  REVISIT_NEEDS_SHARED_DATA();
  for (const Expected& e : {Expected{"ros1/luminar_lz4.bag", 5, 35'700, 36'500, true, true, true},
                            {"ros1/velodyne_concat_downsampled.bag", 4, 3'050, 3'150, false, false, true},
                            {"ros1/one_of_each.bag", 1, 100, 100, false, false, false},
                            {"ros1/two_types_one_topic.bag", 1, 13'966, 13'966, false, false, false},
                            {"generated/ros1_lz4.bag", 30, 19'999, 20'000, false, false, true},
                            {"generated/ros1_lz4_cut_off.bag", 15, 19'999, 20'000, false, false, true},
                            {"generated/ros2_pointcloud2.db3", 5, 3'136, 3'136, true, true, true}}) {
    const auto opened = open(recordings() / e.file);
    ASSERT_TRUE(opened.recording) << opened.error;
    ASSERT_EQ(opened.recording->size(), e.scans) << e.file;
    double before_s = 0.0;
    for (std::size_t i = 0; i < e.scans; ++i) {
      const auto scan = opened.recording->read(i);
      ASSERT_TRUE(scan) << scan.error().message;
      EXPECT_GE(scan->points.size(), e.fewest) << e.file;
      EXPECT_LE(scan->points.size(), e.most) << e.file;
      EXPECT_EQ(!scan->times_s.empty(), e.times) << e.file;
      EXPECT_EQ(!scan->rings.empty(), e.rings) << e.file;
      EXPECT_EQ(std::any_of(scan->points.begin(), scan->points.end(), [](const Point& p) { return p.intensity > 0.f; }),
                e.intensity)
          << e.file;
      EXPECT_GT(scan->stamp_s, before_s) << e.file;
      EXPECT_EQ(scan->stamp_s, opened.recording->stamp_s(i));
      EXPECT_EQ(scan->frame.value, static_cast<std::int64_t>(i));
      before_s = scan->stamp_s;
    }
    EXPECT_EQ(opened.log.find("no intensity field") != std::string::npos, !e.intensity) << opened.log;
    EXPECT_EQ(opened.log.find("was not closed") != std::string::npos,
              std::string(e.file).find("cut") != std::string::npos);
  }
}

TEST(BagRecording, FourFormatsOfOneDriveGiveTheSameScans) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto reference = open(recordings() / "generated/ros2_pointcloud2.db3");
  ASSERT_TRUE(reference.recording) << reference.error;
  for (const char* compression : {"none", "zstd", "lz4"}) {
    const auto other = open(recordings() / ("generated/ros2_pointcloud2_" + std::string(compression) + ".mcap"));
    ASSERT_TRUE(other.recording) << other.error;
    ASSERT_EQ(other.recording->size(), reference.recording->size());
    for (std::size_t i = 0; i < other.recording->size(); ++i)
      expect_same(*other.recording->read(i), *reference.recording->read(i));
  }
}

TEST(BagRecording, WithoutCloudsTheTopicsAreListed) {
  REVISIT_NEEDS_SHARED_DATA();
  for (const char* file : {"ros1/example.bag", "ros1/example-lz4.bag", "ros1/example-bz2.bag"}) {
    const std::string error = open(recordings() / file).error;
    EXPECT_NE(error.find("holds no scans"), std::string::npos) << error;
    EXPECT_NE(error.find("/turtle1/pose (turtlesim/Pose, 1344)"), std::string::npos) << error;
  }
  EXPECT_NE(open(recordings() / "ros1/no-messages.bag").error.find("no topic at all"), std::string::npos);
  EXPECT_NE(open(recordings() / "ros1/empty-file.bag").error.find("empty file"), std::string::npos);
  EXPECT_NE(open(recordings() / "ros2/empty_bag").error.find("holds no scans"), std::string::npos);
}

TEST(BagRecording, ScansComeBackAsTheyWereWritten) {
  for (const char* ending : kEndings) {
    const fs::path file = fresh_folder() / ending;
    auto writer = BagWriter::create(file);
    ASSERT_TRUE(writer) << writer.error().message;
    for (int i = 0; i < 700; ++i) ASSERT_TRUE(writer->write_scan("/points", "lidar", scan_at(i)));  // several chunks
    ASSERT_TRUE(writer->finish());
    const auto opened = open(file);
    ASSERT_TRUE(opened.recording) << opened.error;
    EXPECT_TRUE(opened.log.empty()) << opened.log;
    ASSERT_EQ(opened.recording->size(), 700u) << ending;
    for (const int i : {0, 1, 350, 699}) {
      const auto scan = opened.recording->read(static_cast<std::size_t>(i));
      ASSERT_TRUE(scan) << scan.error().message;
      expect_same(*scan, scan_at(i));
    }
    EXPECT_NE(BagWriter::create(file).error().message.find("exists already"), std::string::npos);
  }
}

TEST(BagRecording, SeveralLidarsAreListedAndOneIsNamed) {
  for (const char* ending : kEndings) {
    const fs::path file = fresh_folder() / ending;
    auto writer = BagWriter::create(file);
    ASSERT_TRUE(writer);
    for (int i = 0; i < 10; ++i) {
      ASSERT_TRUE(writer->write_scan("/front/points", "front", scan_at(i)));
      ASSERT_TRUE(writer->write_scan("/rear/points", "rear", scan_at(100 + i)));
    }
    ASSERT_TRUE(writer->finish());
    const std::string error = open(file).error;
    EXPECT_NE(error.find("name one with --topic"), std::string::npos) << error;
    EXPECT_NE(error.find("/front/points (sensor_msgs/PointCloud2, 10 messages, 10.0 Hz, 50 points, frame 'front')"),
              std::string::npos)
        << error;
    const auto rear = open(file, {.topic = "/rear/points"});
    ASSERT_TRUE(rear.recording) << rear.error;
    expect_same(*rear.recording->read(3), scan_at(103));
    EXPECT_NE(open(file, {.topic = "/side"}).error.find("there are: /front/points, /rear/points"), std::string::npos);
    const auto topics = list_topics(file, {.topic = "/rear/points"});
    ASSERT_TRUE(topics);
    EXPECT_EQ((*topics)[0].use, "other scans (--topic)");
    EXPECT_EQ((*topics)[1].use, "scans");
    EXPECT_NEAR((*topics)[1].rate_hz, 10.0, 0.1);
  }
}

Pose moved(double x_m, double yaw_rad) { return planar_pose(x_m, 0.0, yaw_rad); }

TEST(BagRecording, OdometryComesWithTheTransformToTheLidar) {
  const fs::path file = fresh_folder() / "drive.mcap";
  Pose T_base_lidar = moved(1.0, kPi / 2);
  auto writer = BagWriter::create(file);
  ASSERT_TRUE(writer);
  ASSERT_TRUE(writer->write_static_transform("base_link", "mast", 1.0, Pose::Identity()));
  ASSERT_TRUE(writer->write_static_transform("mast", "lidar", 1.0, T_base_lidar));
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(writer->write_odometry("/odom", "odom", "base_link", 1'600'000'000 + 0.05 * i, moved(0.1 * i, 0.0)));
    if (i % 2 != 0) continue;
    ASSERT_TRUE(writer->write_scan("/points", "lidar", scan_at(i / 2)));
  }
  ASSERT_TRUE(writer->finish());
  const auto opened = open(file);
  ASSERT_TRUE(opened.recording) << opened.error;
  ASSERT_TRUE(opened.recording->has_wheel_odometry()) << opened.log;
  const auto pose = opened.recording->wheel_pose(4);
  ASSERT_TRUE(pose);
  EXPECT_TRUE(pose->isApprox(moved(0.8, 0.0) * T_base_lidar, 1e-6)) << pose->matrix();
  EXPECT_FALSE(open(file, {.odometry_topic = "none"}).recording->has_wheel_odometry());
}

TEST(BagRecording, OdometryOfAnUnknownBodyIsLeftOutAndSaid) {
  const fs::path file = fresh_folder() / "drive.db3";
  auto writer = BagWriter::create(file);
  ASSERT_TRUE(writer);
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(writer->write_scan("/points", "lidar", scan_at(i)));
    ASSERT_TRUE(writer->write_odometry("/odom", "odom", "base_link", scan_at(i).stamp_s, moved(i, 0.0)));
  }
  ASSERT_TRUE(writer->finish());
  const auto opened = open(file);
  ASSERT_TRUE(opened.recording) << opened.error;
  EXPECT_FALSE(opened.recording->has_wheel_odometry());
  EXPECT_NE(opened.log.find("no static transform joins 'base_link'"), std::string::npos) << opened.log;
  const auto asked = open(file, {.odometry_topic = "/odom"});
  ASSERT_TRUE(asked.recording) << asked.error;
  EXPECT_TRUE(asked.recording->wheel_pose(2)->isApprox(moved(2, 0.0), 1e-9)) << "taken as the LiDAR's own";
}

TEST(BagRecording, ImuComesInTheFrameOfTheLidarAndAroundTheSweep) {
  for (const char* ending : kEndings) {
    const fs::path file = fresh_folder() / ending;
    auto writer = BagWriter::create(file);
    ASSERT_TRUE(writer);
    Pose T_lidar_imu = Pose::Identity();  // upside down
    T_lidar_imu.linear() = Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitX()).toRotationMatrix();
    ASSERT_TRUE(writer->write_static_transform("lidar", "imu", 1.0, T_lidar_imu));
    for (int i = 0; i < 100; ++i) {
      ASSERT_TRUE(
          writer->write_imu("/imu", "imu", 1'600'000'000 + 0.01 * i, {0.0, {0.1f, 0.2f, 0.3f}, {0.f, 0.f, -9.8f}}));
      if (i % 10 != 5) continue;
      ASSERT_TRUE(writer->write_scan("/points", "lidar", scan_at(i / 10)));
    }
    ASSERT_TRUE(writer->finish());
    const auto opened = open(file);
    ASSERT_TRUE(opened.recording) << opened.error;
    const auto scan = opened.recording->read(5);
    ASSERT_TRUE(scan);
    ASSERT_GE(scan->imu.size(), 20u) << ending;
    EXPECT_LE(scan->imu.front().time_s, -0.1);
    EXPECT_GE(scan->imu.back().time_s, 0.03);
    EXPECT_TRUE(scan->imu[0].acceleration_mps2.isApprox(Eigen::Vector3f(0.f, 0.f, 9.8f), 1e-5f));
    EXPECT_TRUE(scan->imu[0].angular_radps.isApprox(Eigen::Vector3f(0.1f, -0.2f, -0.3f), 1e-5f));
    EXPECT_TRUE(open(file, {.use_imu = false}).recording->read(5)->imu.empty());
  }
}

TEST(BagRecording, AMountingUpsideDownIsKnownFromTransforms) {
  const fs::path file = fresh_folder() / "drive.bag";
  auto writer = BagWriter::create(file);
  ASSERT_TRUE(writer);
  Pose T_base_lidar = Pose::Identity();
  T_base_lidar.linear() = Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitX()).toRotationMatrix();
  ASSERT_TRUE(writer->write_static_transform("base_link", "lidar", 1.0, T_base_lidar));
  ASSERT_TRUE(writer->write_scan("/points", "lidar", scan_at(0)));
  ASSERT_TRUE(writer->finish());
  const auto opened = open(file);
  ASSERT_TRUE(opened.recording) << opened.error;
  const auto scan = opened.recording->read(0);
  ASSERT_TRUE(scan->up.has_value());
  EXPECT_NEAR(scan->up->z(), -1.f, 1e-6f);
  EXPECT_NE(opened.log.find("tilted by 180 degrees"), std::string::npos) << opened.log;
}

TEST(BagRecording, LivoxMessagesOfBothRosAndBothDrivers) {
  for (const char* ending : kEndings)
    for (const char* type : {"livox_ros_driver/CustomMsg", "livox_ros_driver2/CustomMsg"})
      for (const int points : {1, 2, 100}) {
        const fs::path file = fresh_folder() / ending;
        auto writer = file.extension() == ".bag"    ? io_internal::create_ros1_bag(file)
                      : file.extension() == ".mcap" ? io_internal::create_mcap(file)
                                                    : io_internal::create_db3(file);
        ASSERT_TRUE(writer);
        ASSERT_TRUE((*writer)->add_topic("/livox/lidar", type));
        const std::string message = io_internal::livox_message((*writer)->serialisation(), points);
        ASSERT_TRUE((*writer)->write(0, 1'600'000'000'100'000'000, message));
        ASSERT_TRUE((*writer)->finish());
        const auto opened = open(file);
        ASSERT_TRUE(opened.recording) << opened.error;
        const auto scan = opened.recording->read(0);
        ASSERT_TRUE(scan) << scan.error().message;
        ASSERT_EQ(scan->points.size(), static_cast<std::size_t>(points)) << ending << " " << type;
        EXPECT_EQ(scan->points.back().x, static_cast<float>(points));
        EXPECT_EQ(scan->points.back().z, 3.f);
        EXPECT_EQ(scan->points.back().intensity, static_cast<float>(points - 1));
        EXPECT_EQ(scan->rings.back(), (points - 1) % 6);
        if (points > 2) {
          EXPECT_NEAR(scan->times_s.back(), 0.099f, 1e-6f);
        }
      }
}

TEST(BagRecording, PosesOfAFileAreTakenByStamps) {
  const fs::path folder = fresh_folder();
  auto writer = BagWriter::create(folder / "drive.mcap");
  ASSERT_TRUE(writer);
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(writer->write_scan("/points", "lidar", scan_at(i)));
  ASSERT_TRUE(writer->finish());
  std::ofstream(folder / "poses.tum") << "1600000000.2 1 2 3 0 0 0 1\n1600000000.3 4 2 3 0 0 0 1\n";
  const auto opened = open(folder / "drive.mcap", {.poses_file = folder / "poses.tum"});
  ASSERT_TRUE(opened.recording) << opened.error;
  ASSERT_TRUE(opened.recording->trajectory().at(FrameId{3}));
  EXPECT_NEAR(opened.recording->trajectory().at(FrameId{3})->translation().x(), 4.0, 1e-6);
  EXPECT_FALSE(opened.recording->trajectory().at(FrameId{0}));
}

}  // namespace
}  // namespace revisit
