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
#include <revisit/store/map_store.hpp>

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

std::int64_t to_ns(const builtin_interfaces_msg_dds__Time_& time) {
  return std::int64_t{time.sec} * 1'000'000'000 + time.nanosec;
}
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

// On the robot: one metre ahead of its base and 1.5 above it.
const Pose kTBaseLidar = Pose(Eigen::Translation3d(1.0, 0.0, 1.5));
void say_where_the_lidar_is(const Writer<TfMessage>& tf_static) {
  geometry_msgs_msg_dds__TransformStamped_ mounted{
      {time_of(kStart_ns), text("base_link")}, text("lidar"), {{1.0, 0.0, 1.5}, {0.0, 0.0, 0.0, 1.0}}};
  TfMessage frames{};
  frames.transforms._length = frames.transforms._maximum = 1;
  frames.transforms._buffer = &mounted;
  tf_static.write(frames);
}

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
    poses[to_ns(message.header.stamp)] = {p.x, p.y, p.z};
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
  say_where_the_lidar_is(tf_static);
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

// Along a road and, in reverse, back beside it, with a small sensor.
constexpr int kThere = 45, kAll = 2 * kThere;
Pose pose_of(int i) {
  return i < kThere ? SyntheticWorld::at(-20.0 + 0.8 * i, 0.0, 0.0)
                    : SyntheticWorld::at(15.2 - 0.8 * (i - kThere), 0.3, 0.0);
}
Scan scan_of(int i) {
  static const SyntheticWorld world(61);
  return world.scan(pose_of(i), {16, 360, -20.0, 6.0}, static_cast<unsigned>(i));
}
std::int64_t stamp_of(int i) { return kStart_ns + 100'000'000LL * i; }
int scan_at(const builtin_interfaces_msg_dds__Time_& time) {
  return static_cast<int>((to_ns(time) - kStart_ns) / 100'000'000);
}
Pose to_pose(const geometry_msgs_msg_dds__Pose_& pose) {
  const auto& [x, y, z, w] = pose.orientation;
  return Eigen::Translation3d(pose.position.x, pose.position.y, pose.position.z) * Eigen::Quaterniond(w, x, y, z);
}
// Sensors send with best effort: so do these clouds. What comes through is answered.
TEST(Dds, LoopsComeOutAsMessagesOfTwoKinds) {
  struct Found {
    int query, match;
    Pose T_match_query;
    double probability;
  };
  std::vector<Found> loops;
  std::map<std::int64_t, Pose> poses;  // by stamp
  Heard<LoopMessage> heard("/revisit/loops", Quality::kReliable, [&](const LoopMessage& message) {
    EXPECT_STREQ(message.header.frame_id, "lidar");
    EXPECT_GT(message.t_match_query.covariance[0], 0.0);
    loops.push_back({scan_at(message.header.stamp), scan_at(message.match_stamp), to_pose(message.t_match_query.pose),
                     message.probability});
  });
  Heard<PoseWithCovarianceStamped> heard_poses("/revisit/loop_poses", Quality::kReliable, [&](const auto& message) {
    EXPECT_GT(message.pose.covariance[35], 0.0);
    poses[to_ns(message.header.stamp)] = to_pose(message.pose.pose);
  });
  Heard<DiagnosticArray> diagnostics("/diagnostics", Quality::kReliable, [](const auto&) {});
  Program program(
      {"--mode", "detect", "--queue", "100", "--set", "retrieval.exclude_s=2", "--set", "retrieval.exclude_frames=20"});
  const Writer<PointCloud2> clouds(participant(), "/points", Quality::kSensorData);
  ASSERT_TRUE(diagnostics.wait_for(1)) << "the node is there";
  std::this_thread::sleep_for(300ms);
  for (int i = 0; i < kAll; ++i) {
    const BigCloud cloud(scan_of(i), stamp_of(i));
    clouds.write(cloud.message);
    std::this_thread::sleep_for(20ms);
  }
  EXPECT_EQ(program.end(), 0);  // which works on what waits
  ASSERT_TRUE(heard.wait_for(15)) << heard.count();
  ASSERT_TRUE(heard_poses.wait_for(heard.count()));
  for (const Found& loop : loops) {
    const Pose T_match_query = pose_of(loop.match).inverse() * pose_of(loop.query);
    EXPECT_LT((T_match_query.inverse() * loop.T_match_query).translation().norm(), 0.3) << loop.query;
    EXPECT_GT(loop.probability, 0.5);
    ASSERT_EQ(poses.count(stamp_of(loop.query)), 1u);
    EXPECT_TRUE(poses[stamp_of(loop.query)].isApprox(loop.T_match_query, 1e-12));
  }
}

// A map is made, shown to those who ask, and kept with what a receiver said; in it, a pose that somebody gives by hand
// decides what one scan of a sensor that looks ahead does not.
TEST(Dds, AMapIsShownAndAnInitialPoseIsTaken) {
  const std::string map = (fresh_folder() / "map").string();
  std::vector<std::uint32_t> points, tiles;
  Heard<PointCloud2> cloud_heard("/revisit/map_cloud", Quality::kLatched, [&](const PointCloud2& cloud) {
    EXPECT_STREQ(cloud.header.frame_id, "map");
    EXPECT_EQ(cloud.data._length, 16 * cloud.width);
    points.push_back(cloud.width);
  });
  Heard<PointCloud2> tiles_heard("/revisit/map_tiles", Quality::kLatched,
                                 [&](const PointCloud2& cloud) { tiles.push_back(cloud.width); });
  Heard<PathMessage> path("/revisit/path", Quality::kLatched, [](const auto&) {});
  std::vector<Pose> placed;
  Heard<PoseWithCovarianceStamped> poses("/revisit/pose", Quality::kReliable,
                                         [&](const auto& message) { placed.push_back(to_pose(message.pose.pose)); });
  std::string scans;  // worked on
  Heard<DiagnosticArray> diagnostics("/diagnostics", Quality::kReliable, [&](const DiagnosticArray& message) {
    scans = message.status._buffer[0].values._buffer[0].value;
  });
  const Writer<PointCloud2> clouds(participant(), "/points", Quality::kReliable);
  const Writer<NavSatFix> fixes(participant(), "/fix", Quality::kSensorData);
  const Writer<TfMessage> tf_static(participant(), "/tf_static", Quality::kLatched);
  const Writer<EmptyMessage> publish(participant(), "/revisit/publish_map", Quality::kReliable);
  const Writer<EmptyMessage> save(participant(), "/revisit/save_map", Quality::kReliable);
  const Writer<PoseWithCovarianceStamped> initial(participant(), "/initialpose", Quality::kReliable);
  say_where_the_lidar_is(tf_static);
  const auto wait_for_the_node = [&] {
    ASSERT_TRUE(diagnostics.wait_for(diagnostics.count() + 1)) << "the node is there";
    std::this_thread::sleep_for(300ms);
  };
  {
    Program program({"--mode", "slam", "--map", map, "--queue", "100"});
    wait_for_the_node();
    for (int i = 0; i < kThere; ++i) {
      NavSatFix fix{};
      fix.header = {time_of(stamp_of(i) - 20'000'000), text("gps")};
      fix.latitude = 48.0 + pose_of(i).translation().y() / 111'000.0;
      fix.longitude = 8.0 + pose_of(i).translation().x() / 74'000.0;
      fix.position_covariance[0] = fix.position_covariance[4] = fix.position_covariance[8] = 4.0;
      fix.position_covariance_type = 2;
      fixes.write(fix);
      const BigCloud cloud(scan_of(i), stamp_of(i));
      clouds.write(cloud.message);
    }
    ASSERT_TRUE(poses.wait_for(kThere));
    publish.write({});
    ASSERT_TRUE(cloud_heard.wait_for(1));
    ASSERT_TRUE(tiles_heard.wait_for(1));
    EXPECT_GT(points[0], 1000u);
    save.write({});
    const std::filesystem::path written = std::filesystem::path(map) / "map.ply";
    for (int tries = 0; tries < 1000 && !std::filesystem::exists(written); ++tries) std::this_thread::sleep_for(20ms);
    EXPECT_TRUE(std::filesystem::exists(written));
    EXPECT_EQ(program.end(), 0);
    EXPECT_GE(path.count(), 1u);
  }
  const auto store = MapStore::open(MapStore::file_of(map), MapStore::Access::kRead);
  ASSERT_TRUE(store) << store.error().message;
  const auto kept = store->fixes();
  ASSERT_TRUE(kept);
  ASSERT_GE(kept->size(), 3u) << "one in 10 m";
  EXPECT_NEAR(kept->front().fix.latitude_deg, 48.0, 1e-4);

  constexpr int kHere = 20;
  const Pose T_map_lidar = pose_of(0).inverse() * pose_of(kHere);
  Scan scan = scan_of(kHere);
  std::erase_if(scan.points, [](const Point& p) { return !(p.x > 0.f && std::abs(p.y) < p.x); });
  const BigCloud ahead(scan, stamp_of(kHere));
  for (const bool is_told : {false, true}) {
    placed.clear(), scans.clear();
    Program program({"--mode", "localise", "--map", map});
    wait_for_the_node();
    if (is_told) {
      const Pose T_map_base = T_map_lidar * SyntheticWorld::at(1.0, -0.8, 0.2, 0.0) * kTBaseLidar.inverse();
      const Eigen::Quaterniond q(T_map_base.linear());
      PoseWithCovarianceStamped message{};
      message.header = {time_of(stamp_of(kHere)), text("map")};
      message.pose.pose = {{T_map_base.translation().x(), T_map_base.translation().y(), T_map_base.translation().z()},
                           {q.x(), q.y(), q.z(), q.w()}};
      initial.write(message);
      std::this_thread::sleep_for(300ms);
    }
    clouds.write(ahead.message);
    for (int tries = 0; tries < 20 && scans != "1"; ++tries) (void)diagnostics.wait_for(diagnostics.count() + 1, 1s);
    EXPECT_EQ(program.end(), 0);
    ASSERT_EQ(placed.size(), is_told ? 1u : 0u);
    if (is_told) {
      EXPECT_LT((T_map_lidar.inverse() * placed[0]).translation().norm(), 0.3);
    }
  }
}

}  // namespace
}  // namespace revisit::dds
