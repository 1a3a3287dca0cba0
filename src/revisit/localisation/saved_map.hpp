// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include <revisit/pose_graph/keyframe_graph.hpp>
#include <revisit/store/map_store.hpp>
#include <revisit/store/stored_map.hpp>

namespace revisit {

/// The map that a path names, the file itself or the one in the folder, for reading.
Result<MapStore> open_map(const std::filesystem::path& path);

/// The map of earlier runs: its key frames at the poses that its loops give them. Belongs to one thread at a time.
class SavedMap {
 public:
  /// `path`: the map, or the folder that holds it; it is only read. An error names what is wrong with it.
  static Result<SavedMap> open(const std::filesystem::path& path);

  const StoredMap& stored() const { return stored_; }
  /// Pose of a key frame in the map's frame, which is that of its first scan, or of the first of its part.
  const Pose& T_map_lidar(FrameId keyframe) const { return graph_.T_world_lidar(keyframe); }
  /// Parts of the map that no loop joins have coordinates each.
  int part(FrameId keyframe) const { return graph_.part(keyframe); }
  const PoseGraph& graph() const { return graph_.graph(); }
  const std::shared_ptr<MapStore>& store() const { return store_; }

 private:
  SavedMap(std::shared_ptr<MapStore> store, StoredMap stored) : store_(std::move(store)), stored_(std::move(stored)) {}

  std::shared_ptr<MapStore> store_;
  StoredMap stored_;
  KeyframeGraph graph_;
};

}  // namespace revisit
