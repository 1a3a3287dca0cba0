// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>

#include <revisit/core/pose.hpp>

namespace revisit {

/// The fixed transforms between the frames of a robot (/tf_static). Belongs to one thread at a time.
class StaticFrames {
 public:
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

}  // namespace revisit
