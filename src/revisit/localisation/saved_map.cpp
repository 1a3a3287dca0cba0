// SPDX-License-Identifier: Apache-2.0
#include <revisit/localisation/saved_map.hpp>

namespace revisit {

Result<SavedMap> SavedMap::open(const std::filesystem::path& path) {
  namespace fs = std::filesystem;
  std::error_code failure;
  const fs::path file = fs::is_directory(path, failure) ? path / MapStore::kFileName : path;
  if (!fs::exists(file, failure)) return Error{file.string() + ": no such map; `revisit slam` makes one"};
  auto store = MapStore::open(file);
  if (!store) return store.error();
  auto session = read_session(*store);
  if (!session) return Error{file.string() + ": " + session.error().message};
  if (session->keyframes.empty()) return Error{file.string() + ": the map holds no key frame yet"};
  SavedMap map(std::make_shared<MapStore>(*std::move(store)), *std::move(session));
  if (const Status status = restore_graph(map.session_, map.graph_); !status)
    return Error{file.string() + ": " + status.error().message};
  return map;
}

}  // namespace revisit
