// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/internal/message_values.hpp>

#include <cstring>
#include <fstream>

#include <gtest/gtest.h>

#include <revisit/io/internal/bag.hpp>
#include <revisit/io/internal/bytes.hpp>

#include "shared_data.hpp"

namespace revisit::io_internal {
namespace {

using testing_support::shared_data;

MessageDefinition parse(const std::string& type, const std::string& text) {
  auto definition = MessageDefinition::parse(type, text);
  EXPECT_TRUE(definition) << definition.error().message;
  return *std::move(definition);
}

std::string read_cdr(const std::string& name) {
  const auto bytes = read_bytes(shared_data() / "recordings" / "generated" / name);
  EXPECT_TRUE(bytes);
  return *bytes;
}
ByteSpan span_of(const std::string& bytes) {
  return {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()};
}

TEST(MessageDefinition, ConstantsCommentsBoundsAndDefaultsAreUnderstood) {
  const auto definition = parse("a_msgs/msg/All",
                                "uint8 CONSTANT=3\nint32 OTHER = 4 # not a field\n# nothing\n"
                                "string<=10 name \"someone\"\nfloat64[<=3] bounded\nint16[4] fixed [1,2,3,4]\n"
                                "Inner inner\nbuiltin_interfaces/Time stamp\n"
                                "====\nMSG: a_msgs/Inner\nbyte one\n");
  ASSERT_EQ(definition.types()[0].fields.size(), 5u);
  EXPECT_EQ(definition.types()[0].fields[0].name, "name");
  EXPECT_EQ(definition.types()[0].fields[1].repeat, MessageDefinition::Field::Repeat::kSequence);
  EXPECT_EQ(definition.types()[0].fields[2].count, 4u);
  EXPECT_EQ(definition.types()[1].name, "a_msgs/Inner");
}

TEST(MessageDefinition, WhatIsMissingIsNamed) {
  const auto definition = MessageDefinition::parse("a/A", "b/Unknown field\n");
  ASSERT_FALSE(definition);
  EXPECT_NE(definition.error().message.find("b/Unknown"), std::string::npos);
}

TEST(MessageValues, CdrAlignsAndRos1Packs) {
  const auto definition = parse("a/A", "uint8 first\nfloat64 second\nuint16 third\nstring text\nuint32[] last\n");
  const std::uint8_t ros1[] = {7, 0, 0, 0, 0, 0, 0, 0xF0, 0x3F, 5, 0, 2, 0, 0, 0, 'h', 'i', 1, 0, 0, 0, 9, 0, 0, 0};
  const std::uint8_t cdr[] = {0, 1, 0, 0, 7, 0, 0, 0, 0,   0,   0, 0, 0, 0, 0, 0, 0, 0, 0xF0, 0x3F,
                              5, 0, 0, 0, 3, 0, 0, 0, 'h', 'i', 0, 0, 1, 0, 0, 0, 9, 0, 0,    0};
  for (const auto& [bytes, how] :
       {std::pair{ByteSpan(ros1), Serialisation::kRos1}, {ByteSpan(cdr), Serialisation::kCdr}}) {
    const auto values = MessageValues::decode(definition, how, bytes);
    ASSERT_TRUE(values) << values.error().message;
    EXPECT_EQ(values->number("first"), 7.0);
    EXPECT_EQ(values->number("second"), 1.0);
    EXPECT_EQ(values->number("third"), 5.0);
    EXPECT_EQ(values->text("text"), "hi");
    EXPECT_EQ(values->number("last"), 9.0);
    for (std::size_t size = 0; size < bytes.size(); ++size)
      EXPECT_FALSE(MessageValues::decode(definition, how, bytes.first(size))) << size;
  }
}

TEST(MessageValues, EveryAlignmentAsRos2WritesIt) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto bag = Bag::open(shared_data() / "recordings/ros2/cdr_test_0.db3", {});
  ASSERT_TRUE(bag) << bag.error().message;
  for (std::size_t topic = 0; topic < 2; ++topic) {
    const BagTopic& facts = (*bag)->topics()[topic];
    const auto definition = MessageDefinition::parse(facts.type, facts.definition);
    ASSERT_TRUE(definition) << definition.error().message;
    for (std::uint64_t i = 0; i < facts.messages; ++i) {
      const auto message = (*bag)->read(topic, i);
      ASSERT_TRUE(message);
      const auto values = MessageValues::decode(*definition, Serialisation::kCdr, message->data.bytes);
      ASSERT_TRUE(values) << facts.name << " " << i << ": " << values.error().message;
      if (facts.name != "/test_topic") continue;
      const double float32 = *values->number("float32_value"), float64 = *values->number("float64_value");
      EXPECT_EQ(float32, float64) << "both hold the same in these messages";
      EXPECT_EQ(*values->number("int64_value"), *values->number("int8_value"));
    }
  }
}

TEST(MessageValues, ImuAndOdometryOfRos2) {
  REVISIT_NEEDS_SHARED_DATA();
  const std::string imu = read_cdr("imu.cdr"), odometry = read_cdr("odometry.cdr");
  const auto a = MessageValues::decode(parse("sensor_msgs/Imu", known_definition("sensor_msgs/Imu", false)),
                                       Serialisation::kCdr, span_of(imu));
  ASSERT_TRUE(a) << a.error().message;
  EXPECT_EQ(a->text("header.frame_id"), "imu");
  const double gravity = std::hypot(*a->number("linear_acceleration.x"), *a->number("linear_acceleration.y"),
                                    *a->number("linear_acceleration.z"));
  EXPECT_NEAR(gravity, 9.8, 0.5);
  const auto b = MessageValues::decode(parse("nav_msgs/Odometry", known_definition("nav_msgs/Odometry", false)),
                                       Serialisation::kCdr, span_of(odometry));
  ASSERT_TRUE(b) << b.error().message;
  EXPECT_EQ(b->text("child_frame_id"), "base_link");
  EXPECT_TRUE(b->number("twist.covariance", 35).has_value());
}

TEST(MessageValues, ACloudAsRclcppSerialisesIt) {
  REVISIT_NEEDS_SHARED_DATA();
  const std::string bytes = read_cdr("cloud0.cdr");
  const auto cloud =
      MessageValues::decode(parse("sensor_msgs/PointCloud2", known_definition("sensor_msgs/PointCloud2", false)),
                            Serialisation::kCdr, span_of(bytes));
  ASSERT_TRUE(cloud) << cloud.error().message;
  EXPECT_EQ(cloud->integer("width"), 200);
  EXPECT_EQ(cloud->integer("height"), 16);
  EXPECT_EQ(cloud->text("fields[0].name"), "x");
  EXPECT_EQ(cloud->block("data").size(), static_cast<std::size_t>(*cloud->integer("row_step") * 16));
  const auto bag = Bag::open(shared_data() / "recordings/generated/ros2_pointcloud2.db3", {});
  ASSERT_TRUE(bag) << bag.error().message;
  const auto message = (*bag)->read(0, 0);
  ASSERT_TRUE(message);
  EXPECT_TRUE(
      std::equal(message->data.bytes.begin(), message->data.bytes.end(), span_of(bytes).begin(), span_of(bytes).end()));
}

TEST(MessageValues, MessagesInAnArrayLieEvenlyApart) {
  const auto definition = parse("l/CustomMsg",
                                "uint32 point_num\nCustomPoint[] points\nuint8 end\n"
                                "MSG: l/CustomPoint\nuint32 offset_time\nfloat32 x\nuint8 line\n");
  std::string bytes{"\3\0\0\0\3\0\0\0", 8};
  for (std::uint32_t i = 0; i < 3; ++i) {
    const float x = static_cast<float>(i);
    bytes.append(reinterpret_cast<const char*>(&i), 4).append(reinterpret_cast<const char*>(&x), 4).append(1, '\7');
  }
  bytes += '\5';
  const auto values = MessageValues::decode(definition, Serialisation::kRos1, span_of(bytes));
  ASSERT_TRUE(values) << values.error().message;
  const auto* x = values->find("points.x");
  ASSERT_NE(x, nullptr);
  EXPECT_EQ(x->messages, 3u);
  EXPECT_EQ(x->stride, 9u);
  EXPECT_EQ(number_at(x->primitive, values->bytes().data() + x->offset + 2 * x->stride, false), 2.0);
  EXPECT_EQ(values->number("end"), 5.0) << "behind the array";
}

TEST(MessageValues, LengthsThatLieAreErrors) {
  const auto definition = parse("a/A", "string[] texts\nInner[] inner\nMSG: a/Inner\nstring name\n");
  const std::uint8_t many[] = {0xFF, 0xFF, 0xFF, 0xFF, 1, 0, 0, 0, 'x'};
  EXPECT_FALSE(MessageValues::decode(definition, Serialisation::kRos1, many));
  const std::uint8_t inner[] = {0, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0x7F, 0, 0, 0, 0};
  EXPECT_FALSE(MessageValues::decode(definition, Serialisation::kRos1, inner));
  // Ten of the next type in each of twenty: looked at one by one, they would never end.
  std::string nested = "T1[] array\n";
  for (int type = 1; type < 20; ++type) {
    nested += "MSG: a/T" + std::to_string(type) + "\n";
    for (int i = 0; i < 10; ++i) nested += "T" + std::to_string(type + 1) + " f" + std::to_string(i) + "\n";
  }
  EXPECT_FALSE(MessageValues::decode(parse("a/A", nested + "MSG: a/T20\nuint8 x\n"), Serialisation::kRos1, many));
  const auto circle = parse("a/A", "B b\nMSG: a/B\nA a\n");
  EXPECT_FALSE(MessageValues::decode(circle, Serialisation::kRos1, many)) << "holds itself";
}

}  // namespace
}  // namespace revisit::io_internal
