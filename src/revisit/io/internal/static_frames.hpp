// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>

#include <revisit/core/pose.hpp>
#include <revisit/io/internal/bag.hpp>

namespace revisit::io_internal {

/// The fixed transforms between the frames of a robot (/tf_static).
class StaticFrames {
 public:
  static StaticFrames of_bag(const Bag& bag);

  void add(const std::string& parent, const std::string& child, const Pose& T_parent_child);
  /// Maps coordinates of `source` into `target`; nothing where no chain of transforms joins them.
  std::optional<Pose> between(const std::string& target, const std::string& source) const;

 private:
  struct Link {
    std::string parent;
    Pose T_parent_child;
  };
  std::map<std::string, Link> of_child_;
};

/// The pose in a message at a path; nothing where it is none.
std::optional<Pose> pose_at(const MessageValues& message, const std::string& position, const std::string& orientation);

}  // namespace revisit::io_internal
