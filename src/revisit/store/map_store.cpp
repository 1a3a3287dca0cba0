// SPDX-License-Identifier: Apache-2.0
#include <array>

#include <revisit/store/internal/map_database.hpp>

namespace revisit {
namespace {

constexpr std::array kEndings = {"", "-wal", "-shm", "-journal"};  // a map's file, and those that SQLite has beside it

// Takes away what a failed beginning leaves.
class Beginning {
 public:
  explicit Beginning(const std::filesystem::path& file) : file_(file) {
    std::error_code failure;
    is_kept_ = file.empty() || std::filesystem::exists(file, failure);
  }
  ~Beginning() {
    std::error_code ignored;
    if (!is_kept_)
      for (const char* ending : kEndings) std::filesystem::remove(file_.string() + ending, ignored);
  }
  Beginning(const Beginning&) = delete;
  Beginning& operator=(const Beginning&) = delete;
  void keep() { is_kept_ = true; }

 private:
  std::filesystem::path file_;
  bool is_kept_ = true;
};

}  // namespace

MapStore::MapStore(std::unique_ptr<Database> database) : database_(std::move(database)) {}
MapStore::MapStore(MapStore&&) noexcept = default;
MapStore& MapStore::operator=(MapStore&&) noexcept = default;
MapStore::~MapStore() = default;

std::filesystem::path MapStore::file_of(const std::filesystem::path& path) {
  std::error_code failure;
  if (!std::filesystem::is_directory(path, failure)) return path;
  constexpr const char* kNameOfVersion2 = "map.sqlite";
  const bool is_old =
      !std::filesystem::exists(path / kFileName, failure) && std::filesystem::exists(path / kNameOfVersion2, failure);
  return path / (is_old ? kNameOfVersion2 : kFileName);
}

const std::string& MapStore::file() const { return database_->file; }

// SQLite takes an empty name for a temporary file that goes with its handle.
Result<MapStore> MapStore::create_temporary() { return create({}); }

Result<MapStore> MapStore::create(const std::filesystem::path& file) {
  Beginning beginning(file);
  auto database = Database::connect(file, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
  if (!database) return database.error();
  // What is taken out makes room for what comes, and goes back to the system at the end.
  if (const Status status = (*database)->run("PRAGMA auto_vacuum=INCREMENTAL"); !status) return status.error();
  if (const Status status = (*database)->journal(); !status) return status.error();
  if (const Status status = store_internal::create_schema((*database)->handle.get(), file.string()); !status)
    return status.error();
  beginning.keep();
  return MapStore(*std::move(database));
}

Status MapStore::remove_file(const std::filesystem::path& file) {
  std::error_code failure;
  if (!std::filesystem::exists(file, failure)) return ok();
  const auto lock = store_internal::WriterLock::take(file);
  if (!lock) return lock.error();
  for (const char* ending : kEndings)
    if (std::filesystem::remove(file.string() + ending, failure); failure)
      return Error{file.string() + ending + ": cannot be removed: " + failure.message()};
  return ok();
}

Result<MapStore> MapStore::open(const std::filesystem::path& file, Access access) {
  auto database = Database::connect(file, access == Access::kRead ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE);
  if (!database) return database.error();
  sqlite3* const handle = (*database)->handle.get();
  if (const Status status = store_internal::check_length(file.string()); !status) return status.error();
  const auto version = store_internal::version_of(handle, file.string());
  if (!version && access == Access::kRead && sqlite3_extended_errcode(handle) == SQLITE_READONLY_ROLLBACK) {
    // Whoever wrote was killed before the write-ahead log began: only a writer takes back what is half done.
    database->reset();
    if (const auto taken_back = open(file, Access::kWrite); !taken_back)
      return Error{file.string() +
                   ": a write was interrupted, and cannot be taken back: " + taken_back.error().message};
    return open(file, access);
  }
  if (!version) return version.error();
  (*database)->version = *version;
  const bool is_readable = access == Access::kRead && *version >= store_internal::kOldestReadable;
  if (*version == store_internal::kVersion || is_readable) {
    if (access == Access::kWrite)
      if (const Status status = (*database)->journal(); !status) return status.error();
    return MapStore(*std::move(database));
  }
  if (access == Access::kRead) {
    database->reset();  // it would keep the upgraded file from becoming one
    if (const auto upgraded = open(file, Access::kWrite); !upgraded)
      return Error{file.string() + ": is a map of version " + std::to_string(*version) +
                   ", which cannot be upgraded: " + upgraded.error().message};
    return open(file, access);
  }
  if (const Status status = store_internal::upgrade(handle, file.string(), *version); !status) return status.error();
  (*database)->version = store_internal::kVersion;
  if (const Status status = (*database)->journal(); !status) return status.error();
  return MapStore(*std::move(database));
}

Status MapStore::commit() { return database_->is_in_transaction() ? database_->run("COMMIT") : ok(); }

Status MapStore::hold() const { return database_->is_in_transaction() ? ok() : database_->run("BEGIN"); }

Status MapStore::release() const { return is_held() ? database_->run("COMMIT") : ok(); }
bool MapStore::is_held() const { return database_->is_in_transaction(); }

Status MapStore::close() {
  Status status = database_->end_writing();
  std::error_code failure;
  if (!status || !std::filesystem::exists(database_->file + "-wal", failure)) return status;
  return Error{database_->file + ": cannot be written whole (a full disk, or another program reads it)"};
}

Status MapStore::roll_back() { return database_->is_in_transaction() ? database_->run("ROLLBACK") : ok(); }

}  // namespace revisit
