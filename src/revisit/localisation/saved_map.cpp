// SPDX-License-Identifier: Apache-2.0
#include <revisit/localisation/saved_map.hpp>

namespace revisit {

Result<MapStore> open_map(const std::filesystem::path& path) {
  std::error_code failure;
  const std::filesystem::path file = MapStore::file_of(path);
  if (!std::filesystem::exists(file, failure)) return Error{file.string() + ": no such map; `revisit slam` makes one"};
  return MapStore::open(file, MapStore::Access::kRead);
}

Result<SavedMap> SavedMap::open(const std::filesystem::path& path) {
  auto store = open_map(path);
  if (!store) return store.error();
  const std::string file = store->file();
  auto stored = read_map(*store);
  if (!stored) return Error{file + ": " + stored.error().message};
  if (stored->keyframes.empty()) return Error{file + ": the map holds no key frame yet"};
  SavedMap map(std::make_shared<MapStore>(*std::move(store)), *std::move(stored));
  if (const Status status = restore_graph(map.stored_, map.graph_); !status)
    return Error{file + ": " + status.error().message};
  return map;
}

}  // namespace revisit
