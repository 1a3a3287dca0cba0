// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/static_frames.hpp>

#include <vector>

namespace revisit {
namespace {

// Older programs write "/base_link".
std::string plain(const std::string& frame) { return frame.starts_with('/') ? frame.substr(1) : frame; }

// From a frame up to its root, with the transform of each step.
struct Ancestor {
  std::string frame;
  Pose T_frame_start;
};

}  // namespace

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

}  // namespace revisit
