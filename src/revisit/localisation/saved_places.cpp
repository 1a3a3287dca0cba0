// SPDX-License-Identifier: Apache-2.0
#include <revisit/localisation/saved_places.hpp>

#include <algorithm>
#include <utility>

#include <revisit/localisation/saved_map.hpp>

namespace revisit {

const StoredMapPose& SavedPlaces::pose(FrameId place) const {
  return *std::lower_bound(poses_.begin(), poses_.end(), place,
                           [](const StoredMapPose& each, FrameId frame) { return each.keyframe < frame; });
}

Result<SavedPlaces> SavedPlaces::open(const std::filesystem::path& path, const Parameters& parameters) {
  auto store = open_map(path);
  if (!store) return store.error();
  if (const Status held = store->hold(); !held) return held.error();
  const auto size = store->index_size();
  if (!size) return size.error();
  if (*size == 0) return make_index(path, parameters);
  auto places = open_index(*std::move(store), *size, parameters);
  if (!places) return places.error();
  if (const Status released = places->store_->release(); !released) return released.error();
  return places;
}

Result<SavedPlaces> SavedPlaces::open_index(MapStore store, std::size_t size, const Parameters& parameters) {
  auto index = PlaceIndex::from_bytes(
      store.file(), size, [&](std::span<std::byte> to) { return store.read_index(to); }, parameters.retrieval);
  if (!index) return index.error();
  auto poses = store.index_poses();
  if (!poses) return poses.error();
  auto sessions = store.sessions();
  if (!sessions) return sessions.error();
  bool is_consistent = poses->size() == index->size() && !poses->empty();
  for (std::size_t i = 0; is_consistent && i < poses->size(); ++i)
    is_consistent = (*poses)[i].keyframe == index->frame(i);
  if (!is_consistent) return Error{store.file() + ": its place index names other places than its poses do"};
  if (const auto first = index->find(index->frame(0)))
    if (const Status same = check_grid(*first, parameters.descriptor); !same)
      return Error{store.file() + ": " + same.error().message};
  SavedPlaces places(*std::move(index));
  places.poses_ = *std::move(poses);
  places.sessions_ = *std::move(sessions);
  places.store_ = std::make_shared<MapStore>(std::move(store));
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
