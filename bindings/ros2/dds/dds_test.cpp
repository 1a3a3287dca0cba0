// SPDX-License-Identifier: Apache-2.0
// Clouds go to the node over the wire as ROS 2's drivers send them, and its answers come back.
#include <condition_variable>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <mutex>
#include <thread>

#include <dds/ddsi/ddsi_serdata.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <revisit/core/pose.hpp>

#include "dds_topic.hpp"
#include "shared_data.hpp"
#include "synthetic_world.hpp"

namespace revisit::dds {
namespace {

using testing_support::fresh_folder;
using testing_support::SyntheticWorld;
using namespace std::chrono_literals;

constexpr std::int64_t kStart_ns = 1'700'000'000'000'000'000;

// On this machine alone, in a domain that nobody else uses.
std::uint32_t domain() { return 20 + static_cast<std::uint32_t>(getpid()) % 180; }
dds_entity_t participant() {
  static const dds_entity_t made = [] {
    setenv("CYCLONEDDS_URI",
           "<General><Interfaces><NetworkInterface name='lo' multicast='false'/></Interfaces>"
           "<AllowMulticast>false</AllowMulticast></General>"
           "<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address='127.0.0.1'/></Peers></Discovery>",
           1);
    return require(dds_create_participant(domain(), nullptr, nullptr), "DDS");
  }();
  return made;
}

template <typename Message>
class Heard {
 public:
  Heard(const std::string& topic, Quality quality, std::function<void(const Message&)> use)
      : reader_(participant(), topic, quality, [this, use = std::move(use)](const auto& message) {
          const std::lock_guard lock(mutex_);
          use(*message);
          ++count_;
          news_.notify_all();
        }) {}
  bool wait_for(std::size_t count, std::chrono::milliseconds most = 20s) {
    std::unique_lock lock(mutex_);
    return news_.wait_for(lock, most, [&] { return count_ >= count; });
  }
  std::size_t count() {
    const std::lock_guard lock(mutex_);
    return count_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable news_;
  std::size_t count_ = 0;
  Reader<Message> reader_;
};

std::vector<std::uint8_t> read_bytes(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

// Sends bytes that rclcpp made, as they are; hears them as the type; sends that, and takes its bytes.
template <typename Message>
void expect_same_bytes(const std::string& name, const std::function<void(const Message&)>& check) {
  const std::vector<std::uint8_t> bytes =
      read_bytes(testing_support::shared_data() / "recordings" / "generated" / (name + ".cdr"));
  ASSERT_GT(bytes.size(), 100u) << name;
  const auto qos = qos_of(Quality::kReliable, true);
  const dds_entity_t first = make_topic<Message>(participant(), "/" + name + "_rclcpp"),
                     second = make_topic<Message>(participant(), "/" + name + "_again");
  const dds_entity_t raw = require(dds_create_writer(participant(), first, qos.get(), nullptr), name);
  const dds_entity_t taken = require(dds_create_reader(participant(), second, qos.get(), nullptr), name);
  const Writer<Message> again(participant(), "/" + name + "_again", Quality::kReliable);
  Heard<Message> heard("/" + name + "_rclcpp", Quality::kReliable, [&](const Message& message) {
    check(message);
    again.write(message);
  });
  std::this_thread::sleep_for(300ms);  // until they know each other
  const auto take = [&] {
    ddsi_serdata* data = nullptr;
    dds_sample_info_t info;
    for (int tries = 0; tries < 100 && dds_takecdr(taken, &data, 1, &info, DDS_ANY_STATE) < 1; ++tries)
      std::this_thread::sleep_for(20ms);
    return data;
  };
  again.write({});
  ddsi_serdata* const of_type = take();
  ASSERT_NE(of_type, nullptr) << name;
  ddsrt_iovec_t part{const_cast<std::uint8_t*>(bytes.data()), bytes.size()};
  ddsi_serdata* const data = ddsi_serdata_from_ser_iov(of_type->type, SDK_DATA, 1, &part, bytes.size());
  ASSERT_NE(data, nullptr) << name << " is no message of this type";
  ASSERT_EQ(dds_writecdr(raw, data), DDS_RETCODE_OK);
  ASSERT_TRUE(heard.wait_for(1)) << name;
  ddsi_serdata* const back = take();
  ASSERT_NE(back, nullptr) << name;
  std::vector<std::uint8_t> bytes_back(ddsi_serdata_size(back));
  ddsi_serdata_to_ser(back, 0, bytes_back.size(), bytes_back.data());
  ddsi_serdata_unref(back);
  ddsi_serdata_unref(of_type);
  // The header's last two bytes say how many were filled up at the end, which not everybody sets.
  bytes_back.resize(bytes.size());
  EXPECT_TRUE(std::equal(bytes.begin() + 4, bytes.end(), bytes_back.begin() + 4)) << name;
  dds_delete(raw);
  dds_delete(taken);
}

TEST(Dds, MessagesOfRclcppAreUnderstoodToTheByte) {
  REVISIT_NEEDS_SHARED_DATA();
  expect_same_bytes<PointCloud2>("cloud0", [](const PointCloud2& cloud) {
    EXPECT_STREQ(cloud.header.frame_id, "os_sensor");
    EXPECT_EQ(cloud.width, 200u);
    EXPECT_EQ(cloud.height, 16u);
    ASSERT_EQ(cloud.fields._length, 6u);
    EXPECT_STREQ(cloud.fields._buffer[0].name, "x");
    EXPECT_EQ(cloud.fields._buffer[1].offset, 4u);
    EXPECT_EQ(cloud.data._length, cloud.row_step * cloud.height);
  });
  expect_same_bytes<ImuMessage>("imu", [](const ImuMessage& imu) {
    EXPECT_STREQ(imu.header.frame_id, "imu");
    EXPECT_NEAR(std::abs(imu.linear_acceleration.z), 9.8, 0.1);
  });
  expect_same_bytes<OdometryMessage>("odometry", [](const OdometryMessage& odometry) {
    EXPECT_STREQ(odometry.header.frame_id, "odom");
    EXPECT_STREQ(odometry.child_frame_id, "base_link");
  });
}

// The program at work, until it goes out of scope.
class Program {
 public:
  explicit Program(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), REVISIT_DDS_NODE);
    arguments.push_back("--domain");
    arguments.push_back(std::to_string(domain()));
    process_ = fork();
    if (process_ != 0) return;
    std::vector<char*> values;
    for (std::string& each : arguments) values.push_back(each.data());
    values.push_back(nullptr);
    execv(values[0], values.data());
    _exit(127);
  }
  int end() {
    int status = 0;
    kill(process_, SIGINT);
    waitpid(std::exchange(process_, 0), &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  ~Program() {
    if (process_ != 0) (void)end();
  }

 private:
  pid_t process_ = 0;
};

builtin_interfaces_msg_dds__Time_ time_of(std::int64_t ns) {
  return {static_cast<std::int32_t>(ns / 1'000'000'000), static_cast<std::uint32_t>(ns % 1'000'000'000)};
}
char* text(const char* s) { return const_cast<char*>(s); }

// 1.3 MB, as sensors of 64 lines send ten times a second.
struct BigCloud {
  explicit BigCloud(const Scan& scan, std::int64_t stamp_ns) : bytes(16 * scan.points.size()) {
    for (std::size_t k = 0; k < scan.points.size(); ++k) {
      const float values[] = {scan.points[k].x, scan.points[k].y, scan.points[k].z, scan.points[k].intensity};
      std::memcpy(bytes.data() + 16 * k, values, sizeof values);
    }
    message.header = {time_of(stamp_ns), text("lidar")};
    message.height = 1;
    message.width = static_cast<std::uint32_t>(scan.points.size());
    message.fields._length = message.fields._maximum = 4;
    message.fields._buffer = fields;
    message.point_step = 16;
    message.row_step = 16 * message.width;
    message.data._length = message.data._maximum = message.row_step;
    message.data._buffer = bytes.data();
  }
  std::vector<std::uint8_t> bytes;
  sensor_msgs_msg_dds__PointField_ fields[4] = {
      {text("x"), 0, 7, 1}, {text("y"), 4, 7, 1}, {text("z"), 8, 7, 1}, {text("intensity"), 12, 7, 1}};
  PointCloud2 message{};
};

// The tiles of a map: whoever comes late gets all that were written, not only the last.
TEST(Dds, WhoComesLateHearsAllThatIsLatched) {
  constexpr int kTiles = 10;
  const Writer<PathMessage> writer(participant(), "/latched", Quality::kLatched, kTiles);
  for (int i = 0; i < kTiles; ++i) {
    PathMessage message{};
    message.header = {time_of(i), text("map")};
    writer.write(message);
  }
  Heard<PathMessage> late("/latched", Quality::kLatched, [](const PathMessage&) {});
  EXPECT_TRUE(late.wait_for(kTiles, 10s)) << late.count() << " of " << kTiles;
}

TEST(Dds, BigCloudsComeInAndPosesComeOut) {
  constexpr int kScans = 20;
  const SyntheticWorld world(61);
  const auto pose_at = [](int i) { return SyntheticWorld::at(-20.0 + 0.6 * i, 0.0, 0.0); };
  std::vector<Scan> scans;
  for (int i = 0; i < kScans; ++i)
    scans.push_back(world.scan(pose_at(i), {64, 1800, -24.8, 12.0}, static_cast<unsigned>(i)));
  const std::string map = (fresh_folder() / "map").string();

  std::map<std::int64_t, Eigen::Vector3d> poses;
  std::map<std::string, std::string> health;
  std::string parent, child;
  Heard<PoseWithCovarianceStamped> heard("/revisit/pose", Quality::kReliable, [&](const auto& message) {
    const auto& p = message.pose.pose.position;
    poses[std::int64_t{message.header.stamp.sec} * 1'000'000'000 + message.header.stamp.nanosec] = {p.x, p.y, p.z};
  });
  Heard<TfMessage> tf("/tf", Quality::kReliable, [&](const auto& message) {
    parent = message.transforms._buffer[0].header.frame_id;
    child = message.transforms._buffer[0].child_frame_id;
  });
  Heard<DiagnosticArray> diagnostics("/diagnostics", Quality::kReliable, [&](const auto& message) {
    const auto& values = message.status._buffer[0].values;
    for (std::uint32_t i = 0; i < values._length; ++i) health[values._buffer[i].key] = values._buffer[i].value;
  });
  Program program({"--mode", "slam", "--map", map, "--queue", "100"});
  const Writer<PointCloud2> clouds(participant(), "/points", Quality::kReliable);  // as most drivers
  const Writer<OdometryMessage> odometry(participant(), "/odom", Quality::kReliable);
  const Writer<TfMessage> tf_static(participant(), "/tf_static", Quality::kLatched);
  geometry_msgs_msg_dds__TransformStamped_ mounted{
      {time_of(kStart_ns), text("base_link")}, text("lidar"), {{1.0, 0.0, 1.5}, {0.0, 0.0, 0.0, 1.0}}};
  TfMessage frames{};
  frames.transforms._length = frames.transforms._maximum = 1;
  frames.transforms._buffer = &mounted;
  tf_static.write(frames);
  ASSERT_TRUE(diagnostics.wait_for(1)) << "the node is there";
  std::this_thread::sleep_for(500ms);

  for (int i = 0; i < kScans; ++i) {
    const auto next = std::chrono::steady_clock::now() + 100ms;
    const std::int64_t stamp_ns = kStart_ns + 100'000'000LL * i;
    OdometryMessage wheels{};
    wheels.header = {time_of(stamp_ns), text("odom")};
    wheels.child_frame_id = text("base_link");
    wheels.pose.pose = {{0.6 * i, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}};
    odometry.write(wheels);
    const BigCloud cloud(scans[static_cast<std::size_t>(i)], stamp_ns);
    EXPECT_GT(cloud.bytes.size(), 800'000u);
    clouds.write(cloud.message);
    std::this_thread::sleep_until(next);
  }
  EXPECT_TRUE(heard.wait_for(kScans, 90s)) << heard.count() << " poses of " << kScans << " scans";
  EXPECT_EQ(program.end(), 0);
  EXPECT_TRUE(std::filesystem::exists(std::filesystem::path(map) / "map.revisit"));
  EXPECT_EQ(health["scans left out, since too many waited"], "0");
  EXPECT_EQ(parent, "map");
  EXPECT_EQ(child, "odom");
  for (const auto& [stamp_ns, position] : poses) {
    const int i = static_cast<int>((stamp_ns - kStart_ns) / 100'000'000);
    EXPECT_LT((position - Eigen::Vector3d(0.6 * i, 0.0, 0.0)).norm(), 0.1) << i;
  }
}

}  // namespace
}  // namespace revisit::dds
