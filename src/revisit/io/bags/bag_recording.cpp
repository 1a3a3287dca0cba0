// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/internal/bag_recording.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <revisit/core/stamps.hpp>
#include <revisit/io/internal/bytes.hpp>
#include <revisit/io/internal/remarks.hpp>
#include <revisit/io/internal/scan_source.hpp>
#include <revisit/io/internal/topic_choice.hpp>
#include <revisit/io/pose_file.hpp>

namespace revisit::io_internal {
namespace {

class BagRecording final : public Recording {
 public:
  BagRecording(std::shared_ptr<const Bag> bag, TopicChoice choice, std::unique_ptr<ScanSource> scans)
      : bag_(std::move(bag)), choice_(std::move(choice)), scans_(std::move(scans)) {}

  std::size_t size() const override { return scans_->size(); }
  FrameId frame(std::size_t index) const override { return FrameId{static_cast<std::int64_t>(index)}; }
  double stamp_s(std::size_t index) const override {
    const auto stamp = scans_->stamp_s(index);
    return stamp ? *stamp : 0.0;  // the scan cannot be read either, and says so
  }
  bool has_times() const override { return true; }
  std::string kind() const override { return bag_->kind() + ", " + bag_->topics()[*choice_.lidar].name; }
  const Trajectory& trajectory() const override { return trajectory_; }
  std::optional<Pose> T_camera_lidar() const override { return std::nullopt; }
  void set_trajectory(Trajectory trajectory) { trajectory_ = std::move(trajectory); }

  Result<Scan> read(std::size_t index) const override {
    auto scan = scans_->read(index);
    if (!scan) return scan;
    scan->frame = frame(index);
    scan->up = choice_.up;
    if (choice_.imu) add_imu(index, *scan);
    return scan;
  }

  bool has_wheel_odometry() const override { return choice_.odometry.has_value(); }
  std::optional<Pose> wheel_pose(std::size_t index) const override {
    if (!choice_.odometry) return std::nullopt;
    const auto stamp = scans_->stamp_s(index), log_time = scans_->log_time_s(index);
    if (!stamp || !log_time) return std::nullopt;
    constexpr double kAround_s = 0.5;
    PoseFile poses{PoseFormat::kTum, 0, {}};
    const auto [from_s, to_s] = recorded_between(*log_time, *stamp);
    visit(*choice_.odometry, from_s - kAround_s, to_s + kAround_s, [&](const MessageValues& values) {
      if (const auto T = pose_at(values, "pose.pose.position", "pose.pose.orientation"))
        poses.rows.push_back({std::nullopt, to_seconds(values.stamp_ns()), *T * choice_.T_base_lidar});
    });
    std::stable_sort(poses.rows.begin(), poses.rows.end(),
                     [](const PoseRow& a, const PoseRow& b) { return *a.stamp_s < *b.stamp_s; });
    return to_trajectory(poses, std::nullopt, {{frame(index), *stamp}}).at(frame(index));
  }

  Result<std::vector<GpsFix>> gps_fixes(const std::string& name) const override {
    std::vector<std::size_t> topics;
    for (std::size_t i = 0; i < bag_->topics().size(); ++i) {
      const BagTopic& topic = bag_->topics()[i];
      if (topic.type == "sensor_msgs/NavSatFix" && (name.empty() || topic.name == name)) topics.push_back(i);
    }
    if (topics.empty() && !name.empty())
      return Error{bag_->path().string() + ": has no topic " + name + " of GPS (sensor_msgs/NavSatFix)"};
    if (topics.size() > 1) return Error{bag_->path().string() + ": has several topics of GPS; name one"};
    std::vector<GpsFix> fixes;
    if (topics.empty()) return fixes;
    const Status read = bag_->visit(topics[0], INT64_MIN, INT64_MAX, [&](const BagMessage& message) {
      if (const auto values = bag_->decode(topics[0], message))
        if (const auto fix = to_fix(*values)) fixes.push_back(*fix);
      return true;
    });
    if (!read && fixes.empty()) return read.error();
    std::stable_sort(fixes.begin(), fixes.end(),
                     [](const GpsFix& a, const GpsFix& b) { return a.stamp_s < b.stamp_s; });
    return fixes;
  }

  std::vector<std::string> findings() const override {
    std::vector<std::string> lines = scans_->findings();
    if (choice_.odometry) lines.push_back("odometry: " + bag_->topics()[*choice_.odometry].name);
    if (choice_.imu) lines.push_back("IMU: " + bag_->topics()[*choice_.imu].name);
    return lines;
  }

 private:
  // Nothing where the receiver had no fix.
  static std::optional<GpsFix> to_fix(const MessageValues& values) {
    constexpr double kUnknown_m = 3.0, kLeast_m = 1e-3, kNone_m = 1e4;
    const auto at = [&](const char* path) { return values.number(path).value_or(std::nan("")); };
    GpsFix fix{to_seconds(values.stamp_ns()), at("latitude"), at("longitude"), at("altitude"), {}};
    const bool is_fix = values.integer("status.status").value_or(-1) >= 0;
    if (!is_fix || !(std::abs(fix.latitude_deg) <= 90.0) || !(std::abs(fix.longitude_deg) <= 180.0))
      return std::nullopt;
    const bool has_altitude = std::isfinite(fix.altitude_m);
    if (!has_altitude) fix.altitude_m = 0.0;
    const bool is_known = values.integer("position_covariance_type").value_or(0) > 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double variance = values.number("position_covariance", 4 * axis).value_or(0.0);
      const double unknown = axis == 2 ? 1.7 * kUnknown_m : kUnknown_m;
      fix.deviation_m[static_cast<Eigen::Index>(axis)] =
          is_known && variance > 0.0 ? std::max(kLeast_m, std::sqrt(variance)) : unknown;
    }
    if (!has_altitude) fix.deviation_m.z() = kNone_m;
    return fix;
  }

  // Other messages of that moment were recorded when they came, the scan perhaps only after it was filtered.
  static std::pair<double, double> recorded_between(double log_time_s, double stamp_s) {
    constexpr double kSameClock_s = 10.0;
    if (std::abs(log_time_s - stamp_s) > kSameClock_s) return {log_time_s, log_time_s};
    return {std::min(log_time_s, stamp_s), std::max(log_time_s, stamp_s)};
  }

  // Messages that cannot be read are left out: they only help.
  void visit(std::size_t topic, double from_s, double to_s,
             const std::function<void(const MessageValues&)>& use) const {
    (void)bag_->visit(topic, to_nanoseconds(from_s), to_nanoseconds(to_s), [&](const BagMessage& message) {
      if (const auto values = bag_->decode(topic, message)) use(*values);
      return true;
    });
  }

  // From before the sweep, where the sweep before ended, to its own end.
  void add_imu(std::size_t index, Scan& scan) const {
    constexpr double kBefore_s = 0.25, kLateness_s = 0.1;
    const auto log_time = scans_->log_time_s(index);
    if (!log_time) return;
    const auto [first, last] = std::minmax_element(scan.times_s.begin(), scan.times_s.end());
    const double from_s = (scan.times_s.empty() ? 0.0 : static_cast<double>(*first)) - kBefore_s;
    const double to_s = scan.times_s.empty() ? 0.1 : static_cast<double>(*last);
    const Eigen::Matrix3f R = choice_.R_lidar_imu.cast<float>();
    const auto [earliest_s, latest_s] = recorded_between(*log_time, scan.stamp_s);
    visit(*choice_.imu, earliest_s + from_s - kLateness_s, latest_s + to_s + kLateness_s,
          [&](const MessageValues& values) {
            const auto vector = [&](const std::string& path) {
              return Eigen::Vector3f(static_cast<float>(values.number(path + ".x").value_or(0.0)),
                                     static_cast<float>(values.number(path + ".y").value_or(0.0)),
                                     static_cast<float>(values.number(path + ".z").value_or(0.0)));
            };
            const ImuSample sample{to_seconds(values.stamp_ns()) - scan.stamp_s, R * vector("angular_velocity"),
                                   R * vector("linear_acceleration")};
            if (sample.time_s >= from_s && sample.time_s <= to_s && sample.angular_radps.allFinite() &&
                sample.acceleration_mps2.allFinite())
              scan.imu.push_back(sample);
          });
    std::stable_sort(scan.imu.begin(), scan.imu.end(),
                     [](const ImuSample& a, const ImuSample& b) { return a.time_s < b.time_s; });
  }

  std::shared_ptr<const Bag> bag_;
  TopicChoice choice_;
  std::unique_ptr<ScanSource> scans_;
  Trajectory trajectory_;
};

std::string list_of_topics(const Bag& bag) {
  std::string text;
  for (const BagTopic& topic : bag.topics())
    text += (text.empty() ? "" : ", ") + topic.name + " (" + topic.type + ", " + std::to_string(topic.messages) + ")";
  return text.empty() ? "no topic at all" : text;
}

Error no_lidar(const Bag& bag) {
  return {bag.path().string() + ": holds no scans (sensor_msgs/PointCloud2, Livox CustomMsg, VelodyneScan, Ouster " +
          "PacketMsg); it holds " + list_of_topics(bag)};
}

Error several_lidars(const Bag& bag, const TopicChoice& choice) {
  std::string text = bag.path().string() + ": has several topics of scans; name one with --topic:";
  for (const std::size_t topic : choice.lidars) text += "\n  " + describe_topic(bag, topic);
  return {text};
}

// The sensor's description: where the user says, in the bag, or beside it.
Result<std::string> ouster_metadata(const Bag& bag, const RecordingOptions& options) {
  if (!options.sensor_file.empty()) return read_bytes(options.sensor_file);
  for (std::size_t i = 0; i < bag.topics().size(); ++i)
    if (bag.topics()[i].type == "std_msgs/String" && bag.topics()[i].name.ends_with("metadata"))
      if (const auto first = first_message(bag, i)) return first->values.text("data");
  const std::filesystem::path beside = std::filesystem::path(bag.path()).replace_extension(".json");
  std::error_code failure;
  if (std::filesystem::is_regular_file(beside, failure)) return read_bytes(beside);
  return Error{bag.path().string() + ": packets of an Ouster sensor need its JSON: no topic of metadata, and no " +
               beside.string() + "; name the file with --sensor"};
}

Result<std::unique_ptr<ScanSource>> open_scans(std::shared_ptr<const Bag> bag, std::size_t topic,
                                               const RecordingOptions& options, const LogSink& log) {
  const BagTopic& facts = bag->topics()[topic];
  const Echo echo = options.last_return ? Echo::kLast : Echo::kStrongest;
  if (!holds_packets(facts.type)) {
    const auto first = first_message(*bag, topic);
    if (!first) {
      const auto message = bag->read(topic, 0);
      if (!message) return message.error();
      return bag->decode(topic, *message).error();
    }
    return scans_of_messages(std::move(bag), topic, echo, log);
  }
  const std::string name = bag->path().string() + ": " + facts.name;
  if (facts.type == "pandar_msgs/PandarScan") return Error{name + ": " + advice_for_hesai()};
  const auto json = ouster_metadata(*bag, options);
  if (!json) return json.error();
  auto decoder = ouster_decoder(*json, name + ": its metadata", echo);
  if (!decoder) return decoder.error();
  return scans_of_packets(packets_of_topic(std::move(bag), topic), *std::move(decoder), name);
}

}  // namespace

Result<Trajectory> read_trajectory(const std::filesystem::path& poses_file, const Recording& recording) {
  const auto poses = read_poses(poses_file);
  if (!poses) return poses.error();
  std::vector<FrameTime> stamps;
  for (std::size_t i = 0; i < recording.size(); ++i) stamps.push_back({recording.frame(i), recording.stamp_s(i)});
  const Trajectory all = to_trajectory(*poses, recording.T_camera_lidar(), stamps);
  Trajectory present;
  for (const FrameTime& stamp : stamps)
    if (const auto found = all.entries.find(stamp.frame); found != all.entries.end()) present.entries.insert(*found);
  if (present.empty()) return Error{poses_file.string() + ": no pose belongs to a frame of the recording"};
  return present;
}

Result<std::unique_ptr<Recording>> open_bag_recording(const std::filesystem::path& path,
                                                      const RecordingOptions& options, const LogSink& log) {
  auto opened = Bag::open(path, log);
  if (!opened) return opened.error();
  const std::shared_ptr<const Bag> bag = *std::move(opened);
  auto choice = choose_topics(*bag, options);
  if (!choice) return choice.error();
  if (choice->lidars.empty()) return no_lidar(*bag);
  if (!choice->lidar) return several_lidars(*bag, *choice);
  for (const std::string& note : choice->notes) log_to(log, LogLevel::kInfo, note);
  const auto remarks = std::make_shared<Remarks>(log);
  auto scans = open_scans(bag, *choice->lidar, options, remarks->about(path));
  if (!scans) return scans.error();
  auto recording = std::make_unique<BagRecording>(bag, *std::move(choice), *std::move(scans));
  return with_poses(std::move(recording), options.poses_file);
}

}  // namespace revisit::io_internal
