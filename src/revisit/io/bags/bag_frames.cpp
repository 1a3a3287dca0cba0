// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/internal/bag_frames.hpp>

#include <limits>
#include <string>

namespace revisit::io_internal {
namespace {

// Older programs write "/base_link".
std::string plain(const std::string& frame) { return frame.starts_with('/') ? frame.substr(1) : frame; }

}  // namespace

std::optional<Pose> pose_at(const MessageValues& message, const std::string& position, const std::string& orientation) {
  const auto number = [&](const std::string& path) {
    return message.number(path).value_or(std::numeric_limits<double>::quiet_NaN());
  };
  const Eigen::Quaterniond q(number(orientation + ".w"), number(orientation + ".x"), number(orientation + ".y"),
                             number(orientation + ".z"));
  const Eigen::Vector3d t(number(position + ".x"), number(position + ".y"), number(position + ".z"));
  if (!t.allFinite() || !(std::abs(q.norm() - 1.0) < 1e-2)) return std::nullopt;
  Pose T = Pose::Identity();
  T.linear() = q.normalized().toRotationMatrix();
  T.translation() = t;
  return T;
}

StaticFrames static_frames_of(const Bag& bag) {
  StaticFrames frames;
  for (std::size_t topic = 0; topic < bag.topics().size(); ++topic) {
    const BagTopic& facts = bag.topics()[topic];
    if (!facts.type.ends_with("TFMessage") && !facts.type.ends_with("tfMessage")) continue;
    if (plain(facts.name) != "tf_static" && !facts.name.ends_with("/tf_static")) continue;
    // What cannot be read is as if it were not there.
    (void)bag.visit(
        topic, std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max(),
        [&](const BagMessage& message) {
          const auto values = bag.decode(topic, message);
          for (std::size_t i = 0; values && i < values->count("transforms"); ++i) {
            const std::string path = "transforms[" + std::to_string(i) + "]";
            if (const auto T = pose_at(*values, path + ".transform.translation", path + ".transform.rotation"))
              frames.add(values->text(path + ".header.frame_id"), values->text(path + ".child_frame_id"), *T);
          }
          return true;
        });
  }
  return frames;
}

}  // namespace revisit::io_internal
