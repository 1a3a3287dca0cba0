// SPDX-License-Identifier: Apache-2.0
#include "translate.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <span>
#include <string>
#include <thread>
#include <utility>

#include <revisit/core/stamps.hpp>
#include <revisit/io/point_cloud.hpp>

namespace revisit::node {
namespace {

constexpr int kFirstScans = 3;      // in which it is not yet known what comes
constexpr double kBefore_s = 0.25;  // of the sweep: IMU readings that come with a scan, as in bags
constexpr double kSweep_s = 0.1;    // of points without times
constexpr int kTries = 11;          // tf comes a tenth of a second late at most

}  // namespace

Result<ScanMessage> CloudReader::read(const Cloud& cloud, std::int64_t number) {
  const std::string what = "cloud " + std::to_string(number);
  const std::span<const std::uint8_t> data(cloud.data, cloud.size);
  Result<ScanMessage> message = Error{};
  if (!cloud.type.empty()) {
    if (!reader_ || type_ != cloud.type) {
      auto reader = ScanMessageReader::make(cloud.type, cloud.definition, cloud.is_ros1);
      if (!reader) return reader.error();
      reader_ = *std::move(reader);
      type_ = cloud.type;
    }
    message = reader_->read(data, what, log_);
  } else {
    PointCloudView view{{}, cloud.width, cloud.height, cloud.point_step, cloud.row_step, cloud.is_big_endian, data};
    view.fields.reserve(cloud.fields.size());
    for (const Cloud::Field& field : cloud.fields) view.fields.push_back({field.name, field.offset, field.type});
    auto scan = to_scan(view, to_seconds(cloud.stamp_ns), what, log_);
    if (!scan) return scan.error();
    message = ScanMessage{cloud.stamp_ns, cloud.frame_id, *std::move(scan)};
  }
  if (message) message->scan.frame = FrameId{number};
  return message;
}

revisit::GpsFix to_gps_fix(const GpsFix& fix) {
  revisit::GpsFix result{to_seconds(fix.stamp_ns), fix.latitude_deg, fix.longitude_deg, fix.altitude_m,
                         fix.deviation_m};
  if (!std::isfinite(fix.altitude_m)) {
    constexpr double kNone_m = 1e6;
    result.altitude_m = 0.0;
    result.deviation_m.z() = kNone_m;
  }
  return result;
}

LogSink log_to(Outlet& outlet) {
  return [&outlet](LogLevel level, const std::string& text) { outlet.log(level != LogLevel::kInfo, text); };
}

Moments::Moments(const Settings& settings, Inbox& inbox, Outlet& outlet)
    : odom_frame_(settings.odom_frame),
      base_frame_(settings.base_frame),
      publishes_poses_(settings.mode != "detect"),
      inbox_(inbox),
      outlet_(outlet) {}

Moment Moments::of(ScanMessage& message) {
  const Scan& scan = message.scan;
  const auto [first, last] = std::minmax_element(scan.times_s.begin(), scan.times_s.end());
  const Sweep sweep{(scan.times_s.empty() ? 0.0 : static_cast<double>(*first)),
                    (scan.times_s.empty() ? kSweep_s : static_cast<double>(*last))};
  ++scans_;
  inbox_.wait_for_others(message.stamp_ns + to_nanoseconds(sweep.to_s), message.stamp_ns, scans_ <= kFirstScans);
  Moment moment;
  moment.stamp_ns = message.stamp_ns;
  moment.lidar_frame = message.frame_id;
  moment.odom_frame = odom_frame_;
  moment.base_frame = base_frame_;
  Pose T_base_lidar;
  if (look_up(base_frame_, message.frame_id, message.stamp_ns, knew_base_, T_base_lidar))
    moment.T_base_lidar = T_base_lidar;
  knew_base_ = knew_base_ || moment.T_base_lidar;
  if (!moment.T_base_lidar && publishes_poses_ && !std::exchange(has_warned_of_base_, true))
    outlet_.log(true,
                "tf does not say where " + message.frame_id + " is on " + base_frame_ +
                    ": poses are published, but no transform. Publish " + base_frame_ + " -> " + message.frame_id +
                    " (the robot's URDF, or static_transform_publisher), or set base_frame to " + message.frame_id);
  find_odometry(message, moment);
  add_imu(sweep, message);
  had_odometry_ = had_odometry_ || moment.T_odom_lidar;
  moment.has_odometry = had_odometry_;
  return moment;
}

bool Moments::look_up(const std::string& target, const std::string& source, std::int64_t stamp_ns, bool was_known,
                      Pose& T_target_source) {
  if (target == source) {
    T_target_source = Pose::Identity();
    return true;
  }
  for (int tries = was_known || scans_ <= kFirstScans ? kTries : 1; tries > 0; --tries) {
    if (outlet_.look_up(target, source, stamp_ns, T_target_source)) return T_target_source.matrix().allFinite();
    if (tries > 1) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

// By a topic; where there is none, by tf.
void Moments::find_odometry(const ScanMessage& message, Moment& moment) {
  Pose T;
  if (const auto odometry = inbox_.odometry_at(message.stamp_ns)) {
    const std::string& child = odometry->child_frame_id.empty() ? base_frame_ : odometry->child_frame_id;
    if (!look_up(child, message.frame_id, message.stamp_ns, had_odometry_, T)) return;
    moment.T_odom_lidar = normalised(odometry->T_odom_child * T);
    if (!odometry->frame_id.empty()) moment.odom_frame = odometry->frame_id;
  } else if (!inbox_.has_odometry() && moment.T_base_lidar &&
             look_up(odom_frame_, base_frame_, message.stamp_ns, had_odometry_, T)) {
    moment.T_odom_lidar = normalised(T * *moment.T_base_lidar);
  }
}

// The same readings, to the last bit, as come with the scan of a bag.
void Moments::add_imu(const Sweep& sweep, ScanMessage& message) {
  Scan& scan = message.scan;
  constexpr double kMargin_s = 0.01;
  const std::vector<Imu> readings =
      inbox_.imu_between(message.stamp_ns + to_nanoseconds(sweep.from_s - kBefore_s - kMargin_s),
                         message.stamp_ns + to_nanoseconds(sweep.to_s + kMargin_s));
  Pose T_lidar_imu;
  if (readings.empty()) return;
  const std::string& imu_frame = readings.back().frame_id;
  if (!look_up(message.frame_id, imu_frame, message.stamp_ns, false, T_lidar_imu)) {
    if (!std::exchange(has_warned_of_imu_, true))
      outlet_.log(true, "tf does not say where " + imu_frame + " is to " + message.frame_id +
                            ": the IMU is left out. Publish the transform between them (the robot's URDF, or "
                            "static_transform_publisher)");
    return;
  }
  const Eigen::Matrix3f R = T_lidar_imu.linear().cast<float>();
  scan.imu.reserve(readings.size());
  for (const Imu& each : readings) {
    const ImuSample sample{to_seconds(each.stamp_ns) - scan.stamp_s, R * each.angular_radps.cast<float>(),
                           R * each.acceleration_mps2.cast<float>()};
    if (sample.time_s >= sweep.from_s - kBefore_s && sample.time_s <= sweep.to_s && sample.angular_radps.allFinite() &&
        sample.acceleration_mps2.allFinite())
      scan.imu.push_back(sample);
  }
}

}  // namespace revisit::node
