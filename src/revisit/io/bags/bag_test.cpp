// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/internal/bag.hpp>

#include <fstream>
#include <limits>

#include <gtest/gtest.h>
#include <zlib.h>
#include <zstd.h>

#include <revisit/core/text.hpp>
#include <revisit/io/bag_writer.hpp>
#include <revisit/io/internal/bag_file_writer.hpp>
#include <revisit/io/internal/bytes.hpp>
#include <revisit/io/internal/decompress.hpp>

#include "run_program.hpp"
#include "shared_data.hpp"

namespace revisit::io_internal {
namespace {

namespace fs = std::filesystem;
using testing_support::fresh_folder;
using testing_support::shared_data;

fs::path recordings() { return shared_data() / "recordings"; }

struct Opened {
  std::unique_ptr<Bag> bag;
  std::string warnings, error;
};
Opened open(const fs::path& path) {
  Opened result;
  auto bag = Bag::open(path, [&](LogLevel level, const std::string& message) {
    if (level == LogLevel::kWarning) result.warnings += message + "\n";
  });
  if (bag)
    result.bag = *std::move(bag);
  else
    result.error = bag.error().message;
  return result;
}

std::size_t topic(const Bag& bag, const std::string& name) {
  for (std::size_t i = 0; i < bag.topics().size(); ++i)
    if (bag.topics()[i].name == name) return i;
  ADD_FAILURE() << "no topic " << name;
  return 0;
}

// Checksums of all messages of a topic, each with its time.
std::vector<std::pair<std::int64_t, unsigned long>> messages_of(const Bag& bag, std::size_t topic) {
  std::vector<std::pair<std::int64_t, unsigned long>> result;
  for (std::uint64_t i = 0; i < bag.topics()[topic].messages; ++i) {
    const auto message = bag.read(topic, i);
    EXPECT_TRUE(message) << message.error().message;
    if (!message) break;
    result.emplace_back(message->log_time_ns, crc32_z(0, message->data.bytes.data(), message->data.bytes.size()));
  }
  return result;
}

TEST(Bag, OneRecordingInThreeCompressionsIsTheSame) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto plain = open(recordings() / "ros1/example.bag");
  ASSERT_TRUE(plain.bag) << plain.error;
  ASSERT_EQ(plain.bag->topics().size(), 9u);
  for (const char* name : {"ros1/example-lz4.bag", "ros1/example-bz2.bag"}) {
    const auto other = open(recordings() / name);
    ASSERT_TRUE(other.bag) << other.error;
    std::size_t total = 0;
    for (const BagTopic& facts : plain.bag->topics()) {
      const auto own = messages_of(*plain.bag, topic(*plain.bag, facts.name));
      EXPECT_EQ(own, messages_of(*other.bag, topic(*other.bag, facts.name))) << facts.name;
      total += own.size();
    }
    EXPECT_EQ(total, 8647u);
  }
}

TEST(Bag, OneTopicWithTwoTypesIsTwo) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto opened = open(recordings() / "ros1/two_types_one_topic.bag");
  ASSERT_TRUE(opened.bag) << opened.error;
  ASSERT_EQ(opened.bag->topics().size(), 3u);
  EXPECT_EQ(opened.bag->topics()[0].name, opened.bag->topics()[1].name);
  EXPECT_NE(opened.bag->topics()[0].type, opened.bag->topics()[1].type);
  EXPECT_EQ(opened.bag->topics()[0].messages, 3199u);
}

TEST(Bag, CutOffGivesWhatItHoldsWithAWarning) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto whole = open(recordings() / "generated/ros1_lz4.bag"),
             cut = open(recordings() / "generated/ros1_lz4_cut_off.bag");
  ASSERT_TRUE(whole.bag) << whole.error;
  ASSERT_TRUE(cut.bag) << cut.error;
  EXPECT_TRUE(whole.warnings.empty()) << whole.warnings;
  EXPECT_NE(cut.warnings.find("was not closed"), std::string::npos) << cut.warnings;
  auto expected = messages_of(*whole.bag, topic(*whole.bag, "points"));
  ASSERT_EQ(expected.size(), 30u);
  expected.resize(15);
  EXPECT_EQ(messages_of(*cut.bag, topic(*cut.bag, "points")), expected);
}

TEST(Bag, SameMessagesInDb3AndMcap) {
  REVISIT_NEEDS_SHARED_DATA();
  for (const auto& [db3, mcap] : {std::pair{"ros2/cdr_test_0.db3", "ros2/cdr_test_0.mcap"},
                                  {"generated/ros2_pointcloud2.db3", "generated/ros2_pointcloud2_none.mcap"},
                                  {"generated/ros2_pointcloud2.db3", "generated/ros2_pointcloud2_zstd.mcap"},
                                  {"generated/ros2_pointcloud2.db3", "generated/ros2_pointcloud2_lz4.mcap"}}) {
    const auto a = open(recordings() / db3), b = open(recordings() / mcap);
    ASSERT_TRUE(a.bag) << a.error;
    ASSERT_TRUE(b.bag) << b.error;
    ASSERT_EQ(a.bag->topics().size(), b.bag->topics().size());
    for (const BagTopic& facts : a.bag->topics()) {
      const auto from_a = messages_of(*a.bag, topic(*a.bag, facts.name)),
                 from_b = messages_of(*b.bag, topic(*b.bag, facts.name));
      ASSERT_EQ(from_a.size(), from_b.size());
      for (std::size_t i = 0; i < from_a.size(); ++i)  // recorded one after the other
        EXPECT_EQ(from_a[i].second, from_b[i].second) << mcap << " " << facts.name << " " << i;
    }
  }
}

TEST(Bag, PartsOfOneRecordingAreOne) {
  REVISIT_NEEDS_SHARED_DATA();
  for (const char* folder : {"ros2/split_db3", "ros2/split_mcap"}) {
    const auto opened = open(recordings() / folder);
    ASSERT_TRUE(opened.bag) << opened.error;
    ASSERT_EQ(opened.bag->topics().size(), 1u);
    const auto messages = messages_of(*opened.bag, 0);
    EXPECT_EQ(messages.size(), 3177u) << folder;
    EXPECT_TRUE(std::is_sorted(messages.begin(), messages.end())) << folder;
    std::size_t visited = 0;
    ASSERT_TRUE(opened.bag->visit(0, messages[1000].first, messages[2000].first,
                                  [&](const BagMessage&) { return ++visited > 0; }));
    EXPECT_EQ(visited, 1001u) << folder;
  }
}

TEST(Bag, BagsThatDoNotBelongTogetherAreRefused) {
  const fs::path folder = fresh_folder();
  std::ofstream(folder / "monday.mcap") << "x";
  std::ofstream(folder / "tuesday.mcap") << "x";
  EXPECT_NE(open(folder).error.find("not parts of one recording"), std::string::npos) << open(folder).error;
}

TEST(Bag, MetadataNamesTheFiles) {
  REVISIT_NEEDS_SHARED_DATA();
  const fs::path folder = fresh_folder();
  for (const int part : {0, 1, 2})
    fs::copy(recordings() / ("ros2/split_mcap/multiple_files_" + std::to_string(part) + ".mcap"),
             folder / ("multiple_files_" + std::to_string(part) + ".mcap"));
  std::ofstream(folder / "metadata.yaml") << "rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n"
                                             "    - multiple_files_0.mcap\n    - \"multiple_files_2.mcap\"\n"
                                             "    - multiple_files_3.mcap\n  duration:\n    nanoseconds: 1\n";
  const auto opened = open(folder);
  ASSERT_TRUE(opened.bag) << opened.error;
  EXPECT_LT(opened.bag->topics()[0].messages, 3177u);
  EXPECT_NE(opened.warnings.find("1 of 3 files"), std::string::npos) << opened.warnings;
}

TEST(Bag, EachMessageCompressedByItself) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto opened = open(recordings() / "ros2/message_zstd");
  ASSERT_TRUE(opened.bag) << opened.error;
  const std::size_t chatter = topic(*opened.bag, "/topic");
  ASSERT_TRUE(opened.bag->can_decode(chatter));
  const auto message = opened.bag->read(chatter, 7);
  ASSERT_TRUE(message) << message.error().message;
  const auto values = opened.bag->decode(chatter, *message);
  ASSERT_TRUE(values) << values.error().message;
  EXPECT_EQ(values->text("data"), "Hello, world! 4091");
}

TEST(Bag, WholeFileCompressed) {
  REVISIT_NEEDS_SHARED_DATA();
  const fs::path folder = fresh_folder();
  const fs::path source = recordings() / "generated/ros2_pointcloud2.db3";
  const std::string bytes = *read_bytes(source);
  std::string packed_bytes(ZSTD_compressBound(bytes.size()), '\0');
  packed_bytes.resize(ZSTD_compress(packed_bytes.data(), packed_bytes.size(), bytes.data(), bytes.size(), 1));
  std::ofstream(folder / "drive.db3.zstd", std::ios::binary) << packed_bytes;
  std::ofstream(folder / "cut.db3.zstd", std::ios::binary) << packed_bytes.substr(0, packed_bytes.size() / 2);
  EXPECT_NE(open(folder / "cut.db3.zstd").error.find("within a frame"), std::string::npos);
  const auto packed = open(folder / "drive.db3.zstd"), plain = open(source);
  ASSERT_TRUE(packed.bag) << packed.error;
  EXPECT_EQ(messages_of(*packed.bag, 0), messages_of(*plain.bag, 0));
}

TEST(Bag, AFrameThatEndsWithABlockIsWhole) {
  const fs::path folder = fresh_folder();
  const std::string bytes(3 * 128 * 1024, 'x');  // of zstd's blocks
  std::string packed(ZSTD_compressBound(bytes.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 1));
  std::ofstream(folder / "packed", std::ios::binary) << packed;
  const auto file = RandomAccessFile::open(folder / "packed");
  ASSERT_TRUE(file);
  const Status status = decompress_zstd_file(*file, folder / "plain");
  ASSERT_TRUE(status) << status.error().message;
  EXPECT_EQ(*read_bytes(folder / "plain"), bytes);
}

TEST(Bag, TwoTopicsOfOneNameAndTypeStayApart) {
  const fs::path file = fresh_folder() / "twice.db3";
  auto writer = create_db3(file);
  ASSERT_TRUE(writer);
  for (int i = 0; i < 2; ++i) ASSERT_TRUE((*writer)->add_topic("/text", "std_msgs/String"));
  for (const std::size_t number : {0u, 1u, 1u}) ASSERT_TRUE((*writer)->write(number, 1, "1234"));
  ASSERT_TRUE((*writer)->finish());
  const auto opened = open(file);
  ASSERT_TRUE(opened.bag) << opened.error;
  ASSERT_EQ(opened.bag->topics().size(), 2u);
  EXPECT_EQ(messages_of(*opened.bag, 0).size(), 1u);
  EXPECT_EQ(messages_of(*opened.bag, 1).size(), 2u);
}

struct Conformance {
  const char* file;
  std::size_t topics, messages;
};
TEST(Bag, McapConformance) {
  REVISIT_NEEDS_SHARED_DATA();
  for (const auto& [file, topics, count] : {Conformance{"NoData-pad-st-sum.mcap", 0, 0},
                                            {"OneMessage.mcap", 1, 1},
                                            {"OneAttachment-ax-pad-st-sum.mcap", 0, 0},
                                            {"OneMetadata-mdx-pad-st-sum.mcap", 0, 0},
                                            {"TenMessages.mcap", 1, 10},
                                            {"TenMessages-ch-chx-mx-pad-rch-rsh-st-sum.mcap", 1, 10}}) {
    const auto opened = open(recordings() / "mcap_conformance" / file);
    ASSERT_TRUE(opened.bag) << opened.error;
    EXPECT_TRUE(opened.warnings.empty()) << opened.warnings;
    ASSERT_EQ(opened.bag->topics().size(), topics) << file;
    if (topics == 0) continue;
    EXPECT_EQ(opened.bag->topics()[0].name, "example");
    const auto messages = messages_of(*opened.bag, 0);
    ASSERT_EQ(messages.size(), count) << file;
    EXPECT_TRUE(std::is_sorted(messages.begin(), messages.end(),
                               [](const auto& a, const auto& b) { return a.first < b.first; }));
    if (count == 10) {
      EXPECT_EQ(messages, messages_of(*open(recordings() / "mcap_conformance/TenMessages.mcap").bag, 0));
    }
  }
}

TEST(Bag, ServicesArePassedOver) {
  REVISIT_NEEDS_SHARED_DATA();
  const auto opened = open(recordings() / "ros2/service_events.mcap");
  ASSERT_TRUE(opened.bag) << opened.error;
  const std::size_t events = topic(*opened.bag, "/add_two_ints/_service_event");
  EXPECT_EQ(opened.bag->topics()[events].messages, 6u);
  EXPECT_FALSE(opened.bag->can_decode(events));
  const auto message = opened.bag->read(events, 0);
  ASSERT_TRUE(message);
  EXPECT_NE(opened.bag->decode(events, *message).error().message.find("types that are read: "), std::string::npos);
}

TEST(Bag, BrokenFilesAreRefusedWithTheReason) {
  const fs::path folder = fresh_folder();
  std::ofstream(folder / "empty.bag");
  std::ofstream(folder / "old.bag") << "#ROSBAG V1.2\nnothing more here";
  std::ofstream(folder / "other.mcap") << "no mcap at all, but long enough to look like one, perhaps: 0123456789";
  std::ofstream(folder / "other.db3") << "no database";
  std::ofstream(folder / "cut.bag") << "#ROSBAG V2.0\n\x10";
  EXPECT_NE(open(folder / "empty.bag").error.find("empty file"), std::string::npos);
  EXPECT_NE(open(folder / "old.bag").error.find("rosbag fix"), std::string::npos);
  EXPECT_NE(open(folder / "other.mcap").error.find("does not begin as an .mcap"), std::string::npos);
  EXPECT_NE(open(folder / "other.db3").error.find("no bag of ROS 2"), std::string::npos);
  EXPECT_NE(open(folder / "cut.bag").error.find("no index"), std::string::npos);
  for (const char* name : {"empty.bag", "old.bag", "other.mcap", "other.db3", "cut.bag"})
    EXPECT_TRUE(open(folder / name).error.starts_with((folder / name).string())) << "names the file";
}

TEST(Bag, ABrokenIndexIsMadeAnew) {
  REVISIT_NEEDS_SHARED_DATA();
  const fs::path source = recordings() / "generated/ros1_lz4.bag", file = fresh_folder() / "broken.bag";
  std::string bytes = *read_bytes(source);
  const auto chunk_info = bytes.rfind("chunk_pos=");  // of the last chunk, behind the connections
  ASSERT_NE(chunk_info, std::string::npos);
  bytes[chunk_info] = 'X';
  std::ofstream(file, std::ios::binary) << bytes;
  const auto broken = open(file), whole = open(source);
  ASSERT_TRUE(broken.bag) << broken.error;
  EXPECT_NE(broken.warnings.find("no index"), std::string::npos) << broken.warnings;
  for (const char* name : {"points", "imu"})
    EXPECT_EQ(messages_of(*broken.bag, topic(*broken.bag, name)), messages_of(*whole.bag, topic(*whole.bag, name)));
}

TEST(Bag, DataThatWereChangedAreNoticed) {
  REVISIT_NEEDS_SHARED_DATA();
  const fs::path file = fresh_folder() / "changed.mcap";
  fs::copy(recordings() / "generated/ros2_pointcloud2_none.mcap", file);
  fs::permissions(file, fs::perms::owner_write, fs::perm_options::add);
  std::fstream stream(file, std::ios::binary | std::ios::in | std::ios::out);
  stream.seekp(50'000);  // within the points of the first cloud
  stream.put('!');
  stream.close();
  const auto opened = open(file);
  ASSERT_TRUE(opened.bag) << opened.error;
  const auto message = opened.bag->read(topic(*opened.bag, "/points"), 0);
  ASSERT_FALSE(message);
  EXPECT_NE(message.error().message.find("checksum"), std::string::npos) << message.error().message;
}

// Every message, as the programs in tests/oracles list them.
std::vector<std::string> list(const Bag& bag) {
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < bag.topics().size(); ++i)
    for (const auto& [time_ns, checksum] : messages_of(bag, i))
      lines.push_back(bag.topics()[i].name + " " + bag.topics()[i].type + " " + std::to_string(time_ns) + " " +
                      format("%08lx", checksum));
  std::sort(lines.begin(), lines.end());
  return lines;
}

std::vector<std::string> list_by(const std::string& program, const fs::path& file) {
  const auto outcome = testing_support::run_program(program + " " + file.string());
  EXPECT_EQ(outcome.code, 0) << outcome.output;
  std::vector<std::string> lines;
  for (const std::string_view line : split_lines(outcome.output)) lines.emplace_back(line);
  std::sort(lines.begin(), lines.end());
  return lines;
}

// One message of every kind that is written, ten times: several chunks.
void write_drive(const fs::path& file) {
  auto writer = BagWriter::create(file);
  ASSERT_TRUE(writer) << writer.error().message;
  ASSERT_TRUE(writer->write_static_transform("base_link", "lidar", 1.0, Pose::Identity()));
  Scan scan;
  for (int i = 0; i < 20'000; ++i) {
    scan.points.push_back({static_cast<float>(i), 1.f, 2.f, 3.f});
    scan.rings.push_back(static_cast<std::uint16_t>(i % 16));
    scan.times_s.push_back(1e-6f * static_cast<float>(i));
  }
  for (int i = 0; i < 10; ++i) {
    scan.stamp_s = 0.1 * i;
    ASSERT_TRUE(writer->write_odometry("/odom", "odom", "base_link", scan.stamp_s, Pose::Identity()));
    ASSERT_TRUE(writer->write_imu("/imu", "lidar", scan.stamp_s, {}));
    ASSERT_TRUE(writer->write_scan("/points", "lidar", scan));
  }
  ASSERT_TRUE(writer->finish());
}

TEST(Bag, NothingBeforeTheClockOfRosIsWritten) {
  const fs::path folder = fresh_folder();
  for (const char* name : {"a.bag", "a.mcap", "a.db3"}) {
    auto writer = BagWriter::create(folder / name);
    ASSERT_TRUE(writer);
    const Status written = writer->write_imu("/imu", "lidar", 0.0, ImuSample{-0.1, {}, {}});
    ASSERT_FALSE(written) << name;
    EXPECT_NE(written.error().message.find("-0.100 s"), std::string::npos) << written.error().message;
  }
}

// The format's own library, where `make test` has installed it.
const fs::path kMcapList = testing_support::source_dir() / "tests" / "oracles" / "mcap";

TEST(BagAgainstMcapCore, TheSameMessagesInEveryFile) {
  REVISIT_NEEDS_SHARED_DATA();
  if (!fs::exists(kMcapList / "node_modules")) GTEST_SKIP() << "needs `npm ci` in " << kMcapList;
  for (const char* file :
       {"mcap_conformance/OneMessage.mcap", "mcap_conformance/TenMessages.mcap",
        "mcap_conformance/TenMessages-ch-chx-mx-pad-rch-rsh-st-sum.mcap", "ros2/split_mcap/multiple_files_0.mcap",
        "ros2/service_events.mcap", "ros2/cdr_test_0.mcap", "generated/ros2_pointcloud2_none.mcap",
        "generated/ros2_pointcloud2_zstd.mcap", "generated/ros2_pointcloud2_lz4.mcap"}) {
    const auto opened = open(recordings() / file);
    ASSERT_TRUE(opened.bag) << opened.error;
    EXPECT_EQ(list(*opened.bag), list_by("node " + (kMcapList / "list.js").string(), recordings() / file)) << file;
  }
}

TEST(BagAgainstMcapCore, ReadsWhatIsWrittenHere) {
  if (!fs::exists(kMcapList / "node_modules")) GTEST_SKIP() << "needs `npm ci` in " << kMcapList;
  const fs::path file = fresh_folder() / "drive.mcap";
  write_drive(file);
  const auto opened = open(file);
  ASSERT_TRUE(opened.bag) << opened.error;
  EXPECT_EQ(list(*opened.bag).size(), 31u);
  EXPECT_EQ(list(*opened.bag), list_by("node " + (kMcapList / "list.js").string(), file));
}

#ifdef REVISIT_ROSBAG_LIST
TEST(BagAgainstRosbag, TheSameMessagesInEveryBag) {
  REVISIT_NEEDS_SHARED_DATA();
  for (const char* file :
       {"ros1/example.bag", "ros1/example-lz4.bag", "ros1/example-bz2.bag", "ros1/luminar_lz4.bag",
        "ros1/one_of_each.bag", "ros1/two_types_one_topic.bag", "ros1/velodyne_concat_downsampled.bag",
        "generated/ros1_lz4.bag", "../formats/ouster_packets_ros1.bag"}) {
    const auto opened = open(recordings() / file);
    ASSERT_TRUE(opened.bag) << opened.error;
    EXPECT_EQ(list(*opened.bag), list_by(REVISIT_ROSBAG_LIST, recordings() / file)) << file;
  }
}

TEST(BagAgainstRosbag, ReadsWhatIsWrittenHere) {
  const fs::path file = fresh_folder() / "drive.bag";
  write_drive(file);
  const auto opened = open(file);
  ASSERT_TRUE(opened.bag) << opened.error;
  EXPECT_EQ(list(*opened.bag).size(), 31u);
  EXPECT_EQ(list(*opened.bag), list_by(REVISIT_ROSBAG_LIST, file));
}
#endif

}  // namespace
}  // namespace revisit::io_internal
