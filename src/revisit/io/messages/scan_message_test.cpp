// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/scan_message.hpp>

#include <fstream>
#include <iterator>
#include <vector>

#include <gtest/gtest.h>

#include <revisit/io/internal/messages_for_test.hpp>

#include "shared_data.hpp"

namespace revisit {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes livox(bool is_ros1, int points) {
  const std::string text = io_internal::livox_message(
      is_ros1 ? io_internal::Serialisation::kRos1 : io_internal::Serialisation::kCdr, points);
  return {text.begin(), text.end()};
}

TEST(ScanMessage, LivoxOfBothRosAndBothDrivers) {
  for (const bool is_ros1 : {true, false})
    for (const char* type : {"livox_ros_driver/CustomMsg", "livox_ros_driver2/msg/CustomMsg"}) {
      const auto reader = ScanMessageReader::make(type, "", is_ros1);
      ASSERT_TRUE(reader) << reader.error().message;
      const auto message = reader->read(livox(is_ros1, 100), "a message");
      ASSERT_TRUE(message) << message.error().message;
      EXPECT_EQ(message->stamp_ns, 1'600'000'000'000'000'000);
      EXPECT_EQ(message->frame_id, "livox_frame");
      ASSERT_EQ(message->scan.points.size(), 100u);
      EXPECT_EQ(message->scan.points.back().x, 100.f);
      EXPECT_EQ(message->scan.rings.back(), 99 % 6);
    }
}

TEST(ScanMessage, ADefinitionThatComesWithItCounts) {
  const std::string definition =
      "uint8 version\nstd_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\n"
      "bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n"
      "=====\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
      "=====\nMSG: sensor_msgs/PointField\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n";
  const std::vector<float> xyz{1.f, 2.f, 3.f};
  const std::string text =
      "\7" + io_internal::cloud_message(2'000'000'000, "lidar", {"x", "y", "z"},
                                        std::string(reinterpret_cast<const char*>(xyz.data()), 12));
  const Bytes bytes(text.begin(), text.end());
  const auto reader = ScanMessageReader::make("sensor_msgs/PointCloud2", definition, true);
  ASSERT_TRUE(reader) << reader.error().message;
  const auto message = reader->read(bytes, "a message");
  ASSERT_TRUE(message) << message.error().message;
  EXPECT_EQ(message->stamp_ns, 2'000'000'000);
  ASSERT_EQ(message->scan.points.size(), 1u);
  EXPECT_EQ(message->scan.points[0].z, 3.f);
  EXPECT_FALSE(ScanMessageReader::make("sensor_msgs/PointCloud2", "", true)->read(bytes, "a message"));
}

TEST(ScanMessage, OtherTypesAndCutOffMessagesAreErrors) {
  const auto image = ScanMessageReader::make("sensor_msgs/Image", "", true);
  ASSERT_FALSE(image);
  EXPECT_NE(image.error().message.find("PointCloud2"), std::string::npos) << image.error().message;
  const auto reader = ScanMessageReader::make("livox_ros_driver/CustomMsg", "", true);
  const Bytes whole = livox(true, 3);
  ASSERT_TRUE(reader->read(whole, "whole"));
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const auto message = reader->read({whole.data(), size}, "cut off");
    ASSERT_FALSE(message) << size;
    EXPECT_NE(message.error().message.find("cut off"), std::string::npos);
  }
}

TEST(ScanMessage, AsRclcppSerialisesIt) {
  REVISIT_NEEDS_SHARED_DATA();
  std::ifstream file(testing_support::shared_data() / "recordings/generated/cloud0.cdr", std::ios::binary);
  const Bytes bytes{std::istreambuf_iterator<char>(file), {}};
  const auto message = ScanMessageReader::make("sensor_msgs/msg/PointCloud2", "", false)->read(bytes, "cloud0");
  ASSERT_TRUE(message) << message.error().message;
  EXPECT_GT(message->scan.points.size(), 1000u);
  EXPECT_FALSE(message->frame_id.empty());
}

}  // namespace
}  // namespace revisit
