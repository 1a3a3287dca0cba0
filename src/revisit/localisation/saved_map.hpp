// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include <revisit/pose_graph/keyframe_graph.hpp>
#include <revisit/store/map_store.hpp>
#include <revisit/store/stored_session.hpp>

namespace revisit {

/// The map of an earlier `revisit slam`: its key frames at the poses that its loops give them.
/// Belongs to one thread at a time.
class SavedMap {
 public:
  /// `path`: the map, or the folder that holds it. An error names what is wrong with it.
  static Result<SavedMap> open(const std::filesystem::path& path);

  const StoredSession& session() const { return session_; }
  /// Pose of a key frame in the map's frame, which is that of its first scan.
  const Pose& T_map_lidar(FrameId keyframe) const { return graph_.T_world_lidar(keyframe); }
  const std::shared_ptr<MapStore>& store() const { return store_; }

 private:
  SavedMap(std::shared_ptr<MapStore> store, StoredSession session)
      : store_(std::move(store)), session_(std::move(session)) {}

  std::shared_ptr<MapStore> store_;
  StoredSession session_;
  KeyframeGraph graph_;
};

}  // namespace revisit
