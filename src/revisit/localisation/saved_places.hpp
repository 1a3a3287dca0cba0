// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include <revisit/config/parameters.hpp>
#include <revisit/retrieval/place_index.hpp>
#include <revisit/store/map_store.hpp>

namespace revisit {

/// The places of a saved map, and where each of them is: what a scan is looked for in. Opened at once where the map was
/// finished, the rest of the index read in the background; otherwise its key frames are read and settled first.
class SavedPlaces {
 public:
  /// `path`: the map, or the folder that holds it; it is only read. An error names what is wrong with it, or that the
  /// parameters describe places on another grid.
  static Result<SavedPlaces> open(const std::filesystem::path& path, const Parameters& parameters);

  /// Reads the whole index, if the map has one: an error where it is not as it was written.
  static Status check(const std::filesystem::path& path);

  /// In the order of the index, which is that of their frames.
  const std::vector<StoredMapPose>& poses() const { return poses_; }
  /// Of a frame that is a place.
  const StoredMapPose& pose(FrameId place) const;
  const Pose& T_map_lidar(FrameId place) const { return pose(place).T_map_lidar; }
  int part(FrameId place) const { return pose(place).part; }
  const std::vector<StoredSession>& sessions() const { return sessions_; }
  const std::shared_ptr<MapStore>& store() const { return store_; }
  /// To be searched by whoever takes it.
  PlaceIndex take_index() { return std::move(index_); }

 private:
  explicit SavedPlaces(PlaceIndex index) : index_(std::move(index)) {}
  static Result<PlaceIndex> index_of(MapStore held, std::size_t size, const RetrievalOptions& options);
  static Result<SavedPlaces> open_index(MapStore held, std::size_t size, const Parameters& parameters);
  static Result<SavedPlaces> make_index(const std::filesystem::path& path, const Parameters& parameters);

  std::shared_ptr<MapStore> store_;
  PlaceIndex index_;
  std::vector<StoredMapPose> poses_;
  std::vector<StoredSession> sessions_;
};

}  // namespace revisit
