// SPDX-License-Identifier: Apache-2.0
#include <revisit/localisation/saved_map.hpp>

namespace revisit {

Result<SavedMap> SavedMap::open(const std::filesystem::path& path) {
  namespace fs = std::filesystem;
  std::error_code failure;
  const fs::path file = MapStore::file_of(path);
  if (!fs::exists(file, failure)) return Error{file.string() + ": no such map; `revisit slam` makes one"};
  auto store = MapStore::open(file, MapStore::Access::kRead);
  if (!store) return store.error();
  auto stored = read_map(*store);
  if (!stored) return Error{file.string() + ": " + stored.error().message};
  if (stored->keyframes.empty()) return Error{file.string() + ": the map holds no key frame yet"};
  SavedMap map(std::make_shared<MapStore>(*std::move(store)), *std::move(stored));
  if (const Status status = restore_graph(map.stored_, map.graph_); !status)
    return Error{file.string() + ": " + status.error().message};
  return map;
}

}  // namespace revisit
