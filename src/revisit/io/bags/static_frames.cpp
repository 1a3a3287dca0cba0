// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/internal/static_frames.hpp>

#include <limits>
#include <vector>

namespace revisit::io_internal {
namespace {

// Older programs write "/base_link".
std::string plain(const std::string& frame) { return frame.starts_with('/') ? frame.substr(1) : frame; }

// From a frame up to its root, with the transform of each step.
struct Ancestor {
  std::string frame;
  Pose T_frame_start;
};

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

StaticFrames StaticFrames::of_bag(const Bag& bag) {
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

void StaticFrames::add(const std::string& parent, const std::string& child, const Pose& T_parent_child) {
  of_child_.insert_or_assign(plain(child), Link{plain(parent), T_parent_child});
}

std::optional<Pose> StaticFrames::between(const std::string& target, const std::string& source) const {
  const auto ancestors = [&](const std::string& start) {
    std::vector<Ancestor> chain{{plain(start), Pose::Identity()}};
    // No longer than all links: a circle ends.
    for (auto link = of_child_.find(chain.back().frame);
         link != of_child_.end() && chain.size() <= of_child_.size() + 1; link = of_child_.find(chain.back().frame))
      chain.push_back({link->second.parent, link->second.T_parent_child * chain.back().T_frame_start});
    return chain;
  };
  const std::vector<Ancestor> of_source = ancestors(source);
  for (const Ancestor& a : ancestors(target))
    for (const Ancestor& b : of_source)
      if (a.frame == b.frame) return a.T_frame_start.inverse() * b.T_frame_start;
  return std::nullopt;
}

}  // namespace revisit::io_internal
