// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/core/log.hpp>
#include <revisit/core/result.hpp>
#include <revisit/pipeline/detection.hpp>

namespace revisit {

/// What became of the sessions of several maps.
struct MergeReport {
  struct Session {
    int id = 0;             ///< in the new map
    std::size_t map = 0;    ///< that it comes from, in the order given
    std::string recording;  ///< as its map named it
    std::size_t keyframes = 0;
    /// Of the map, mostly one: sessions of one part are joined, between parts nothing was found in common.
    std::set<int> parts;
    std::size_t loops = 0;  ///< between it and other sessions
  };
  std::vector<Session> sessions;
};

/// Makes one map of several, whose sessions may have started anywhere: the key frames of each are looked for in those
/// before it, and loops that agree with each other join them into one graph. Sessions without enough of them stay
/// apart, in the same file. `out` is written whole or not at all, and must not exist. The parameters must be those of
/// the maps' descriptors. `progress(done, of)` counts key frames and stops the work by returning false, which is an
/// error. `take` is given what was found of each key frame that was looked for, by the frames of the new map.
Result<MergeReport> merge_maps(std::span<const std::filesystem::path> maps, const std::filesystem::path& out,
                               const Parameters& parameters = {}, const LogSink& log = {},
                               const std::function<bool(std::size_t, std::size_t)>& progress = {},
                               const std::function<Status(const Detection&)>& take = {});

}  // namespace revisit
