// SPDX-License-Identifier: Apache-2.0
#include <revisit/localisation/saved_places.hpp>

#include <algorithm>
#include <string>
#include <utility>

#include <revisit/localisation/saved_map.hpp>

namespace revisit {

const StoredMapPose& SavedPlaces::pose(FrameId place) const {
  return *std::lower_bound(poses_.begin(), poses_.end(), place,
                           [](const StoredMapPose& each, FrameId frame) { return each.keyframe < frame; });
}

Result<SavedPlaces> SavedPlaces::open(const std::filesystem::path& path, const Parameters& parameters) {
  // The index is read from the map as it is now, whatever others write while that goes on.
  auto index = open_map(path);
  if (!index) return index.error();
  if (const Status held = index->hold(); !held) return held.error();
  const auto size = index->index_size();
  if (!size) return size.error();
  return *size == 0 ? make_index(path, parameters) : open_index(*std::move(index), *size, parameters);
}

Status SavedPlaces::check(const std::filesystem::path& path) {
  auto store = open_map(path);
  if (!store) return store.error();
  if (Status held = store->hold(); !held) return held;
  const auto size = store->index_size();
  if (!size) return size.error();
  if (*size == 0) return ok();
  const auto index = index_of(*std::move(store), *size, {});
  return index ? index->check() : Status(index.error());
}

Result<PlaceIndex> SavedPlaces::index_of(MapStore held, std::size_t size, const RetrievalOptions& options) {
  const auto shared = std::make_shared<MapStore>(std::move(held));  // a function that is copied holds it
  return PlaceIndex::open(
      shared->file(), size,
      [shared](std::size_t offset, std::span<std::byte> to) { return shared->read_index(offset, to); }, options);
}

Result<SavedPlaces> SavedPlaces::open_index(MapStore held, std::size_t size, const Parameters& parameters) {
  const std::string file = held.file();
  auto poses = held.place_poses();
  if (!poses) return poses.error();
  auto sessions = held.sessions();
  if (!sessions) return sessions.error();
  auto index = index_of(std::move(held), size, parameters.retrieval);
  if (!index) return index.error();
  bool is_consistent = poses->size() == index->size() && !poses->empty();
  for (std::size_t i = 0; is_consistent && i < poses->size(); ++i)
    is_consistent = (*poses)[i].keyframe == index->frame(i);
  if (!is_consistent) return Error{file + ": its place index names other places than its poses do"};
  if (const auto first = index->find(index->frame(0)))
    if (const Status same = check_grid(*first, parameters.descriptor); !same)
      return Error{file + ": " + same.error().message};
  auto store = MapStore::open(file, MapStore::Access::kRead);
  if (!store) return store.error();
  SavedPlaces places(*std::move(index));
  places.poses_ = *std::move(poses);
  places.sessions_ = *std::move(sessions);
  places.store_ = std::make_shared<MapStore>(*std::move(store));
  return places;
}

// A map that was not finished: what its runs committed is put together.
Result<SavedPlaces> SavedPlaces::make_index(const std::filesystem::path& path, const Parameters& parameters) {
  const auto map = SavedMap::open(path);
  if (!map) return map.error();
  SavedPlaces places{PlaceIndex(parameters.retrieval)};
  const auto add = [&](const StoredMap::Keyframe& each, const IntensityScanContext& descriptor) {
    const FrameId frame = each.frame.frame;
    places.index_.add(frame, each.frame.stamp_s, descriptor);
    places.poses_.push_back({frame, map->T_map_lidar(frame), map->part(frame)});
  };
  if (const Status restored = restore_places(*map->store(), map->stored(), parameters.descriptor, add); !restored)
    return Error{map->store()->file() + ": " + restored.error().message};
  places.sessions_ = map->stored().sessions;
  places.store_ = map->store();
  return places;
}

}  // namespace revisit
