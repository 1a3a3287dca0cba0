// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>
#include <string>

#include <revisit/io/static_frames.hpp>

#include "dds_topic.hpp"
#include "node.hpp"

namespace revisit::dds {

builtin_interfaces_msg_dds__Time_ to_time(std::int64_t ns);
inline std::int64_t to_ns(const builtin_interfaces_msg_dds__Time_& time) {
  return std::int64_t{time.sec} * 1'000'000'000 + time.nanosec;
}
node::Transform3 to_transform(const double* xyz, const geometry_msgs_msg_dds__Quaternion_& q);

/// The node's answers as topics of ROS 2. Transforms that stand still are known from /tf_static.
class DdsOutlet final : public node::Outlet {
 public:
  DdsOutlet(dds_entity_t participant, const std::string& name);

  void send(const node::Loop& loop) override;
  void send(const node::Frame& frame) override;
  void send(const node::MapPose& pose) override;
  void send(const node::Graph& graph) override;
  void send(const node::MapCloud& cloud) override;
  void send(const node::Health& health) override;
  bool look_up(const std::string& target, const std::string& source, std::int64_t stamp_ns,
               node::Transform3& T_target_source) override;
  void log(bool is_warning, const std::string& text) override;

 private:
  void add_frames(const TfMessage& message);

  const std::string name_;
  std::mutex frames_mutex_;
  StaticFrames frames_;
  Writer<LoopMessage> loops_;
  Writer<PoseWithCovarianceStamped> loop_poses_, pose_;
  Writer<PathMessage> path_;
  const dds_entity_t participant_;
  Writer<PointCloud2> map_;
  std::unique_ptr<Writer<PointCloud2>> tiles_;
  Writer<TfMessage> tf_;
  Writer<DiagnosticArray> diagnostics_;
  Reader<TfMessage> tf_static_;
};

}  // namespace revisit::dds
