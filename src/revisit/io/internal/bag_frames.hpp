// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include <revisit/core/pose.hpp>
#include <revisit/io/internal/bag.hpp>
#include <revisit/io/static_frames.hpp>

namespace revisit::io_internal {

/// What a bag's /tf_static says.
StaticFrames static_frames_of(const Bag& bag);

/// The pose in a message at a path; nothing where it is none.
std::optional<Pose> pose_at(const MessageValues& message, const std::string& position, const std::string& orientation);

}  // namespace revisit::io_internal
