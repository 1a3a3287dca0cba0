// SPDX-License-Identifier: Apache-2.0
#include "node.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <mutex>
#include <set>
#include <sstream>
#include <thread>

#include <gtest/gtest.h>

#include <revisit/core/pose.hpp>
#include <revisit/core/stamps.hpp>
#include <revisit/pipeline/loop_detector.hpp>
#include <revisit/store/map_store.hpp>

#include "inbox.hpp"
#include "shared_data.hpp"
#include "synthetic_world.hpp"
#include "translate.hpp"

namespace revisit::node {
namespace {

using testing_support::fresh_folder;
using testing_support::SyntheticWorld;

constexpr int kThere = 45, kAll = 2 * kThere;
constexpr std::int64_t kStart_ns = 1'700'000'000'000'000'000;

// Along a road and, in reverse, back beside it.
Pose pose_of(int i) {
  return i < kThere ? SyntheticWorld::at(-20.0 + 0.8 * i, 0.0, 0.0)
                    : SyntheticWorld::at(15.2 - 0.8 * (i - kThere), 0.3, 0.0);
}
std::int64_t stamp_of(int i) { return kStart_ns + 100'000'000LL * i; }

Scan scan_of(int i) {
  static const SyntheticWorld world(61);
  return world.scan(pose_of(i), {16, 360, -20.0, 6.0}, static_cast<unsigned>(i));
}

Cloud to_message(const Scan& scan, std::int64_t stamp_ns) {
  const auto bytes = std::make_shared<std::vector<std::uint8_t>>(16 * scan.points.size());
  for (std::size_t k = 0; k < scan.points.size(); ++k) {
    const float values[] = {scan.points[k].x, scan.points[k].y, scan.points[k].z, scan.points[k].intensity};
    std::memcpy(bytes->data() + 16 * k, values, sizeof values);
  }
  Cloud cloud;
  cloud.stamp_ns = stamp_ns;
  cloud.frame_id = "lidar";
  cloud.fields = {{"x", 0, 7}, {"y", 4, 7}, {"z", 8, 7}, {"intensity", 12, 7}};
  cloud.width = static_cast<std::uint32_t>(scan.points.size());
  cloud.height = 1;
  cloud.point_step = 16;
  cloud.row_step = 16 * cloud.width;
  cloud.data = bytes->data();
  cloud.size = bytes->size();
  cloud.owner = bytes;
  return cloud;
}

// The same as ROS 1 sends it: numbers little-endian, texts and arrays behind their lengths.
Cloud to_wire(const Cloud& cloud) {
  const auto bytes = std::make_shared<std::string>();
  const auto number = [&](auto value) { bytes->append(reinterpret_cast<const char*>(&value), sizeof value); };
  const auto text = [&](const std::string& value) {
    number(static_cast<std::uint32_t>(value.size()));
    *bytes += value;
  };
  number(std::uint32_t{0});
  number(static_cast<std::uint32_t>(cloud.stamp_ns / 1'000'000'000));
  number(static_cast<std::uint32_t>(cloud.stamp_ns % 1'000'000'000));
  text(cloud.frame_id);
  number(cloud.height);
  number(cloud.width);
  number(static_cast<std::uint32_t>(cloud.fields.size()));
  for (const Cloud::Field& field : cloud.fields) {
    text(field.name);
    number(field.offset);
    number(field.type);
    number(std::uint32_t{1});
  }
  number(std::uint8_t{0});
  number(cloud.point_step);
  number(cloud.row_step);
  text({reinterpret_cast<const char*>(cloud.data), cloud.size});
  number(std::uint8_t{1});
  Cloud wire;
  wire.type = "sensor_msgs/PointCloud2";
  wire.is_ros1 = true;
  wire.data = reinterpret_cast<const std::uint8_t*>(bytes->data());
  wire.size = bytes->size();
  wire.owner = bytes;
  return wire;
}

// Keeps what it is sent. The LiDAR is one metre ahead of the base and 1.5 above it, the IMU upside down beside it.
class Listener final : public Outlet {
 public:
  void send(const Loop& loop) override { keep(loops, loop); }
  void send(const Frame& frame) override { keep(frames, frame); }
  void send(const MapPose& pose) override { keep(poses, pose); }
  void send(const Graph& graph) override { keep(graphs, graph); }
  void send(const MapCloud& cloud) override { keep(clouds, cloud); }
  void send(const Health& state) override { keep(health, state); }
  bool look_up(const std::string& target, const std::string& source, std::int64_t,
               Transform3& T_target_source) override {
    T_target_source = Transform3::Identity();
    if (target == "base_link" && source == "lidar" && knows_base) {
      T_target_source.translation() << 1.0, 0.0, 1.5;
      return true;
    }
    if (target == "lidar" && source == "imu") {
      T_target_source.rotate(Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitX()));
      return true;
    }
    return false;
  }
  void log(bool, const std::string& text) override { keep(lines, text); }
  std::size_t count_of_poses() {
    const std::lock_guard lock(mutex_);
    return poses.size();
  }
  bool knows_base = true;

  std::vector<Loop> loops;
  std::vector<Frame> frames;
  std::vector<MapPose> poses;
  std::vector<Graph> graphs;
  std::vector<MapCloud> clouds;
  std::vector<Health> health;
  std::vector<std::string> lines;

 private:
  template <typename Kind>
  void keep(std::vector<Kind>& all, const Kind& one) {
    const std::lock_guard lock(mutex_);
    all.push_back(one);
  }
  std::mutex mutex_;
};

Settings settings_of(const std::string& mode) {
  Settings settings;
  settings.mode = mode;
  settings.queue = 1000;
  settings.parameters = {{"retrieval.exclude_s", "2"}, {"retrieval.exclude_frames", "20"}};
  return settings;
}

Settings settings_of_new_map() {
  Settings settings = settings_of("slam");
  settings.map = (fresh_folder() / "map").string();
  return settings;
}

// Sends scans first to last - 1 and waits for all of them.
std::string drive(const Settings& settings, Listener& listener, int first, int last, bool with_odometry = false) {
  std::string message;
  const auto node = Node::make(settings, listener, message);
  if (!node) return message;
  for (int i = first; i < last; ++i) {
    if (with_odometry) {
      Pose T_base_lidar;
      listener.look_up("base_link", "lidar", 0, T_base_lidar);
      const Pose T_odom_base = SyntheticWorld::at(7.0, 3.0, 0.4, 0.0) * pose_of(i) * T_base_lidar.inverse();
      node->add(Odometry{stamp_of(i), "wheels", "base_link", T_odom_base});
    }
    node->add(to_message(scan_of(i), stamp_of(i)));
  }
  EXPECT_TRUE(node->finish(message)) << message;
  return {};
}

TEST(Node, DetectGivesTheLoopsOfTheLibrary) {
  Listener listener;
  // So strict that some loops are confirmed by later ones only.
  Settings settings = settings_of("detect");
  settings.parameters["geometric.min_probability"] = "0.9999999999";
  EXPECT_EQ(drive(settings, listener, 0, kAll), "");
  Parameters parameters;
  parameters.retrieval.exclude_s = 2.0;
  parameters.retrieval.exclude_frames = 20;
  parameters.geometric.min_probability = 0.9999999999;
  std::size_t found_later = 0;
  LoopDetector detector(parameters);
  std::vector<LoopConstraint> expected;
  for (int i = 0; i < kAll; ++i) {
    Scan scan = scan_of(i);
    scan.frame = FrameId{i};
    scan.stamp_s = to_seconds(stamp_of(i));
    const auto detection = detector.process(std::move(scan));
    if (!detection) continue;
    for (const LoopConstraint& loop : detection->loops()) expected.push_back(loop);
    found_later += detection->earlier.size();
  }
  EXPECT_GT(found_later, 0u);
  ASSERT_GT(expected.size(), 5u);
  ASSERT_EQ(listener.loops.size(), expected.size());
  for (std::size_t k = 0; k < expected.size(); ++k) {
    const Loop& loop = listener.loops[k];
    EXPECT_EQ(loop.query, expected[k].query.value);
    EXPECT_EQ(loop.match, expected[k].match.value);
    EXPECT_EQ(loop.query_stamp_ns, stamp_of(static_cast<int>(loop.query)));
    EXPECT_EQ(loop.match_stamp_ns, stamp_of(static_cast<int>(loop.match)));
    EXPECT_TRUE(loop.T_match_query.isApprox(expected[k].T_match_query, 1e-9));
    EXPECT_TRUE((loop.covariance * expected[k].information).isIdentity(1e-2));
  }
}

TEST(Node, SlamSaysWhereOdometryIsInTheMap) {
  Listener listener;
  EXPECT_EQ(drive(settings_of("slam"), listener, 0, 30, true), "");
  ASSERT_EQ(listener.frames.size(), 30u);
  ASSERT_EQ(listener.poses.size(), 30u);
  for (int i = 0; i < 30; ++i) {
    const Frame& frame = listener.frames[static_cast<std::size_t>(i)];
    EXPECT_EQ(frame.stamp_ns, stamp_of(i));
    EXPECT_EQ(frame.parent, "map");
    EXPECT_EQ(frame.child, "wheels");
    const Pose T_odom_lidar = SyntheticWorld::at(7.0, 3.0, 0.4, 0.0) * pose_of(i);
    const Pose T_map_lidar = frame.T_parent_child * T_odom_lidar;
    EXPECT_LT((T_map_lidar.translation() - (pose_of(0).inverse() * pose_of(i)).translation()).norm(), 0.1) << i;
    EXPECT_TRUE(T_map_lidar.isApprox(listener.poses[static_cast<std::size_t>(i)].T_map_lidar, 1e-9));
  }
}

TEST(Node, SlamGoesOnWhereItWasAndLosesNothing) {
  Settings settings = settings_of_new_map();
  {
    Listener listener;
    EXPECT_EQ(drive(settings, listener, 0, kThere), "");
    ASSERT_FALSE(listener.graphs.empty());
  }
  Listener refused;
  EXPECT_NE(drive(settings, refused, kThere, kAll).find("resume"), std::string::npos);
  settings.resume = true;
  Listener listener;
  EXPECT_EQ(drive(settings, listener, kThere, kAll), "");
  ASSERT_FALSE(listener.loops.empty());
  for (const Loop& loop : listener.loops)
    EXPECT_NEAR(static_cast<double>(loop.match_stamp_ns - stamp_of(static_cast<int>(loop.match))), 0.0, 1000.0)
        << "of a scan before it was stopped";
  const Graph& graph = listener.graphs.back();
  EXPECT_NEAR(static_cast<double>(graph.path.front().first - stamp_of(0)), 0.0, 1000.0);
  EXPECT_LT((graph.path.back().second.translation() - (pose_of(0).inverse() * pose_of(kAll - 1)).translation()).norm(),
            0.3);
  EXPECT_FALSE(graph.loops.empty());
}

TEST(Node, LocaliseAnswersFromASavedMap) {
  Settings settings = settings_of_new_map();
  Listener ignored;
  EXPECT_EQ(drive(settings, ignored, 0, kThere), "");
  settings.mode = "localise";
  Listener listener;
  EXPECT_EQ(drive(settings, listener, kThere, kAll), "");
  EXPECT_GT(listener.poses.size(), 30u);
  for (const MapPose& pose : listener.poses) {
    const int i = static_cast<int>((pose.stamp_ns - kStart_ns) / 100'000'000);
    EXPECT_LT(((pose_of(0).inverse() * pose_of(i)).inverse() * pose.T_map_lidar).translation().norm(), 0.3) << i;
    EXPECT_GT(pose.covariance(0, 0), 0.0);
  }
  for (const Frame& frame : listener.frames) EXPECT_EQ(frame.child, "base_link") << "nobody told of odometry";
  std::string message;
  const auto node = Node::make(settings, listener, message);
  ASSERT_TRUE(node) << message;
  EXPECT_TRUE(node->publish_map(message)) << message;
  const MapCloud& cloud = listener.clouds.at(0);
  EXPECT_GT(cloud.overview.size(), 4000u);
  // All points are in the tiles, each in one square.
  std::size_t in_tiles = 0;
  std::set<std::pair<int, int>> squares;
  for (const std::vector<float>& tile : cloud.tiles) {
    in_tiles += tile.size();
    const auto square = [&](std::size_t i) {
      return std::pair(static_cast<int>(std::floor(tile[i] / MapCloud::kTileM)),
                       static_cast<int>(std::floor(tile[i + 1] / MapCloud::kTileM)));
    };
    EXPECT_TRUE(squares.insert(square(0)).second);
    for (std::size_t i = 0; i < tile.size(); i += 4) ASSERT_EQ(square(i), square(0));
  }
  EXPECT_EQ(in_tiles, cloud.overview.size());
  EXPECT_GT(squares.size(), 1u);
  EXPECT_FALSE(node->save_map("", message)) << "nothing to save";
}

// What a sensor that looks ahead sees in one scan does not decide where it is, but with somebody's word it does.
TEST(Node, AnInitialPoseIsLookedForThere) {
  Settings settings = settings_of_new_map();
  Listener mapped;
  EXPECT_EQ(drive(settings, mapped, 0, kThere), "");
  settings.mode = "localise";
  constexpr int kHere = 20;
  const Pose T_map_lidar = pose_of(0).inverse() * pose_of(kHere);
  const auto answers = [&](const std::optional<Pose>& T_map_lidar_said, const std::string& frame) {
    Listener listener;
    std::string message;
    const auto node = Node::make(settings, listener, message);
    EXPECT_TRUE(node) << message;
    Pose T_base_lidar;
    listener.look_up("base_link", "lidar", 0, T_base_lidar);
    if (T_map_lidar_said) node->add(InitialPose{frame, *T_map_lidar_said * T_base_lidar.inverse()});
    Scan scan = scan_of(kHere);
    std::erase_if(scan.points, [](const Point& p) { return !(p.x > 0.f && std::abs(p.y) < p.x); });
    node->add(to_message(scan, stamp_of(kHere)));
    EXPECT_TRUE(node->finish(message)) << message;
    return std::pair(listener.poses, listener.lines);
  };
  const Pose near = T_map_lidar * SyntheticWorld::at(1.0, -0.8, 0.2, 0.0),
             far = T_map_lidar * SyntheticWorld::at(-12.0, 0.0, 0.0, 0.0);
  EXPECT_TRUE(answers(std::nullopt, "map").first.empty());
  EXPECT_TRUE(answers(far, "map").first.empty());
  const auto found = answers(near, "map").first;
  ASSERT_EQ(found.size(), 1u);
  EXPECT_LT((T_map_lidar.inverse() * found[0].T_map_lidar).translation().norm(), 0.3);
  const auto [elsewhere, lines] = answers(near, "odom");
  EXPECT_TRUE(elsewhere.empty());
  EXPECT_TRUE(std::any_of(lines.begin(), lines.end(), [](const std::string& line) {
    return line.find("initial pose in the frame odom; it must be in map") != std::string::npos;
  }));
}

TEST(Node, FixesOfAReceiverAreKeptWithTheMap) {
  Settings settings = settings_of_new_map();
  Listener listener;
  std::string message;
  {
    const auto node = Node::make(settings, listener, message);
    ASSERT_TRUE(node) << message;
    for (int i = 0; i < kThere; ++i) {
      const Eigen::Vector3d at_m = pose_of(i).translation();
      node->add(GpsFix{stamp_of(i) - 20'000'000, 48.0 + at_m.y() / 111'000.0, 8.0 + at_m.x() / 74'000.0, 300.0,
                       Eigen::Vector3d::Constant(2.0)});
      node->add(to_message(scan_of(i), stamp_of(i)));
    }
    EXPECT_TRUE(node->finish(message)) << message;
  }
  const auto store = MapStore::open(MapStore::file_of(settings.map), MapStore::Access::kRead);
  ASSERT_TRUE(store) << store.error().message;
  const auto fixes = store->fixes();
  ASSERT_TRUE(fixes);
  ASSERT_GE(fixes->size(), 3u) << "one in 10 m";
  EXPECT_NEAR(fixes->front().fix.latitude_deg, 48.0, 1e-4);
}

TEST(Node, ServicesWorkBesideScans) {
  Settings settings = settings_of_new_map();
  Listener listener;
  std::string message;
  const auto node = Node::make(settings, listener, message);
  ASSERT_TRUE(node) << message;
  for (int i = 0; i < 20; ++i) node->add(to_message(scan_of(i), stamp_of(i)));
  for (int tries = 0; tries < 2000 && listener.count_of_poses() < 10; ++tries)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  ASSERT_GE(listener.count_of_poses(), 10u);
  EXPECT_TRUE(node->publish_map(message)) << message;
  EXPECT_FALSE(listener.clouds.at(0).overview.empty());
  MapGrid grid;
  EXPECT_TRUE(node->get_map(grid, message)) << message;
  ASSERT_EQ(grid.cells.size(), std::size_t{grid.width} * grid.height);
  EXPECT_GT(std::count(grid.cells.begin(), grid.cells.end(), 100), 0);
  EXPECT_GT(std::count(grid.cells.begin(), grid.cells.end(), 0), 0);
  EXPECT_TRUE(node->save_map("", message)) << message;
  EXPECT_TRUE(std::filesystem::exists(std::filesystem::path(settings.map) / "map.ply"));
  EXPECT_FALSE(node->load_map(settings.map, message));
  EXPECT_NE(message.find("localise"), std::string::npos);
  EXPECT_TRUE(node->finish(message));
  EXPECT_EQ(listener.poses.size(), 20u) << "none is lost";
}

// A frame has one parent: without odometry for a while, or without the LiDAR's place on the robot, nothing is said.
TEST(Node, GivesNoFrameASecondParent) {
  std::string message;
  Listener listener, without_base;
  {
    const auto node = Node::make(settings_of("slam"), listener, message);
    for (int i = 0; i < 20; ++i) {
      if (i < 8) node->add(Odometry{stamp_of(i), "wheels", "base_link", SyntheticWorld::at(0.8 * i, 0.0, 0.0, 0.0)});
      node->add(to_message(scan_of(i), stamp_of(i)));
    }
    EXPECT_TRUE(node->finish(message)) << message;
  }
  EXPECT_EQ(listener.poses.size(), 20u);
  EXPECT_GE(listener.frames.size(), 8u);
  EXPECT_LT(listener.frames.size(), 12u);
  for (const Frame& frame : listener.frames) EXPECT_EQ(frame.child, "wheels");
  without_base.knows_base = false;
  EXPECT_EQ(drive(settings_of("slam"), without_base, 0, 5), "");
  EXPECT_EQ(without_base.poses.size(), 5u);
  EXPECT_TRUE(without_base.frames.empty());
}

TEST(Node, OdometryThatIsNoneIsLeftOut) {
  Listener listener;
  std::string message;
  const auto node = Node::make(settings_of("slam"), listener, message);
  const Eigen::Vector3d nowhere = Eigen::Vector3d::Constant(std::nan(""));
  for (int i = 0; i < 6; ++i) {
    node->add(Odometry{stamp_of(i), "wheels", "base_link",
                       i % 2 == 0 ? to_transform(nowhere, Eigen::Quaterniond::Identity())
                                  : to_transform(Eigen::Vector3d::Zero(), Eigen::Quaterniond(0.0, 0.0, 0.0, 0.0))});
    node->add(to_message(scan_of(i), stamp_of(i)));
  }
  EXPECT_TRUE(node->finish(message)) << message;
  EXPECT_EQ(listener.poses.size(), 6u);
}

TEST(Node, AStartThatSawNothingIsNoMap) {
  Settings settings = settings_of_new_map();
  Listener nothing, listener;
  EXPECT_EQ(drive(settings, nothing, 0, 0), "");
  EXPECT_EQ(drive(settings, listener, 0, 5), "");
  EXPECT_EQ(listener.poses.size(), 5u);
}

TEST(Node, SettingsByName) {
  Settings settings;
  std::string error;
  EXPECT_TRUE(set(settings, "mode", "detect", error));
  EXPECT_TRUE(set(settings, "map", "2024", error));
  EXPECT_TRUE(set(settings, "resume", "1", error));
  EXPECT_TRUE(set(settings, "queue", "7", error));
  EXPECT_TRUE(settings.mode == "detect" && settings.map == "2024" && settings.resume && settings.queue == 7);
  EXPECT_FALSE(set(settings, "resume", "perhaps", error));
  EXPECT_NE(error.find("resume is 'perhaps'"), std::string::npos);
  EXPECT_FALSE(set(settings, "queue", "0", error));
  EXPECT_TRUE(set(settings, "retreival.top_k", "5", error));
  Listener listener;
  EXPECT_FALSE(Node::make(settings, listener, error));
  EXPECT_NE(error.find("retrieval.top_k"), std::string::npos) << error;
}

TEST(Node, SaysWhatIsWrongWithItsSettings) {
  Listener listener;
  std::string message;
  Settings settings = settings_of("fly");
  EXPECT_FALSE(Node::make(settings, listener, message));
  EXPECT_NE(message.find("'fly'; allowed: detect, slam, localise"), std::string::npos) << message;
  settings = settings_of("detect");
  settings.parameters["retrieval.top_k"] = "many";
  EXPECT_FALSE(Node::make(settings, listener, message));
  EXPECT_NE(message.find("retrieval.top_k"), std::string::npos) << message;
  settings = settings_of("localise");
  EXPECT_FALSE(Node::make(settings, listener, message));
  EXPECT_NE(message.find("map"), std::string::npos) << message;
}

TEST(Node, ACloudThatIsNoneIsLeftOutAndCounted) {
  Listener listener;
  std::string message;
  const auto node = Node::make(settings_of("detect"), listener, message);
  ASSERT_TRUE(node) << message;
  Cloud lying = to_message(scan_of(0), stamp_of(0));
  lying.size /= 2;
  node->add(std::move(lying));
  node->add(to_message(scan_of(1), stamp_of(1)));
  EXPECT_TRUE(node->finish(message));
  std::map<std::string, std::string> values(listener.health.back().values.begin(), listener.health.back().values.end());
  EXPECT_EQ(values.at("scans"), "2");
  EXPECT_EQ(values.at("scans that could not be used"), "1");
}

TEST(Node, AMessageAsItWentOverTheWireIsTheSameCloud) {
  std::vector<std::string> answers;
  for (const bool is_serialised : {false, true}) {
    Settings settings = settings_of("slam");
    Listener listener;
    std::string message;
    const auto node = Node::make(settings, listener, message);
    ASSERT_TRUE(node) << message;
    for (int i = 0; i < 3; ++i) {
      const Cloud cloud = to_message(scan_of(i), stamp_of(i));
      node->add(is_serialised ? to_wire(cloud) : cloud);
    }
    EXPECT_TRUE(node->finish(message)) << message;
    ASSERT_EQ(listener.poses.size(), 3u);
    std::ostringstream last;
    last << listener.poses.back().stamp_ns << " " << listener.poses.back().T_map_lidar.matrix();
    answers.push_back(last.str());
  }
  EXPECT_EQ(answers[0], answers[1]);
}

TEST(Node, SomeParametersChangeWhileItRuns) {
  Listener listener;
  std::string message;
  Settings settings = settings_of("detect");
  const auto node = Node::make(settings, listener, message);
  ASSERT_TRUE(node) << message;
  EXPECT_TRUE(node->change(settings, message));
  EXPECT_NE(message.find("nothing"), std::string::npos) << message;
  settings.parameters["geometric.min_probability"] = "2";
  EXPECT_FALSE(node->change(settings, message));
  EXPECT_NE(message.find("geometric.min_probability"), std::string::npos) << message;
  settings.parameters["geometric.min_probability"] = "1";
  EXPECT_TRUE(node->change(settings, message)) << message;
  EXPECT_NE(message.find("geometric.min_probability"), std::string::npos) << message;
  settings.parameters["descriptor.rings"] = "10";
  EXPECT_FALSE(node->change(settings, message));
  EXPECT_NE(message.find("descriptor.rings"), std::string::npos) << message;
  for (int i = 0; i < kAll; ++i) node->add(to_message(scan_of(i), stamp_of(i)));
  EXPECT_TRUE(node->finish(message));
  EXPECT_TRUE(listener.loops.empty()) << "none is as sure as that";
}

TEST(NodeInbox, DropsTheOldestAndCounts) {
  Inbox inbox(3);
  for (int i = 0; i < 5; ++i) inbox.add(to_message({}, stamp_of(i)));
  EXPECT_EQ(inbox.dropped(), 2u);
  EXPECT_EQ(inbox.next()->stamp_ns, stamp_of(2));
  inbox.close();
  inbox.add(to_message({}, stamp_of(9)));
  EXPECT_EQ(inbox.waiting(), 2u) << "those that wait are worked on, later ones are not";
  EXPECT_FALSE(inbox.is_done());
}

TEST(NodeInbox, OdometryBetweenTwoMessages) {
  Inbox inbox(1);
  inbox.add(Odometry{stamp_of(0), "odom", "base_link", SyntheticWorld::at(0.0, 0.0, 0.0, 0.0)});
  inbox.add(Odometry{stamp_of(1), "odom", "base_link", SyntheticWorld::at(1.0, 0.0, 0.4, 0.0)});
  const auto between = inbox.odometry_at(stamp_of(0) + 25'000'000);
  ASSERT_TRUE(between);
  EXPECT_TRUE(between->T_odom_child.isApprox(SyntheticWorld::at(0.25, 0.0, 0.1, 0.0), 1e-6));
  EXPECT_FALSE(inbox.odometry_at(stamp_of(20)));
  inbox.add(Odometry{stamp_of(-100), "odom", "base_link", SyntheticWorld::at(5.0, 0.0, 0.0, 0.0)});
  EXPECT_FALSE(inbox.odometry_at(stamp_of(1))) << "a bag begins anew: what was is forgotten";
  EXPECT_TRUE(inbox.odometry_at(stamp_of(-100)));
}

TEST(NodeInbox, ReadingsThatOvertakeOthersLoseNone) {
  Inbox inbox(1);
  for (const int i : {0, 3, 1, 2, 2}) inbox.add(Imu{stamp_of(i), "imu", {}, {}});
  const auto readings = inbox.imu_between(stamp_of(0), stamp_of(3));
  ASSERT_EQ(readings.size(), 4u);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(readings[static_cast<std::size_t>(i)].stamp_ns, stamp_of(i));
}

TEST(NodeMoments, ImuOfTheSweepComesInTheLidarsFrame) {
  Listener listener;
  Inbox inbox(1);
  for (int k = -60; k <= 60; ++k)
    inbox.add(Imu{stamp_of(0) + 10'000'000LL * k, "imu", {0.1, 0.2, 0.3}, {0.0, 0.0, -9.8}});
  Moments moments(settings_of("slam"), inbox, listener);
  ScanMessage message{stamp_of(0), to_message(scan_of(0), stamp_of(0)).frame_id, scan_of(0)};
  Scan& scan = message.scan;
  scan.stamp_s = to_seconds(stamp_of(0));
  const Moment moment = moments.of(message);
  EXPECT_TRUE(moment.T_base_lidar);
  ASSERT_EQ(scan.imu.size(), 36u) << "a quarter of a second before, a tenth after";
  EXPECT_NEAR(scan.imu.front().time_s, -0.25, 1e-9);
  EXPECT_TRUE(scan.imu[0].acceleration_mps2.isApprox(Eigen::Vector3f(0.f, 0.f, 9.8f), 1e-5f));
  EXPECT_TRUE(scan.imu[0].angular_radps.isApprox(Eigen::Vector3f(0.1f, -0.2f, -0.3f), 1e-5f));
}

}  // namespace
}  // namespace revisit::node
