// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <revisit/store/internal/database.hpp>
#include <revisit/store/internal/map_schema.hpp>
#include <revisit/store/internal/writer_lock.hpp>
#include <revisit/store/map_store.hpp>

namespace revisit {

struct MapStore::Database {
  struct Close {
    void operator()(sqlite3* handle) const { sqlite3_close_v2(handle); }
  };
  std::string file;
  std::optional<store_internal::WriterLock> lock;  // outlives the handle
  std::unique_ptr<sqlite3, Close> handle;

  store_internal::Statement prepare(const char* sql) const { return {handle.get(), file, sql}; }
  Status run(const char* sql) const { return prepare(sql).run(); }
  Error damaged(const char* what, std::int64_t row) const {
    return {file + ": row " + std::to_string(row) + " of its " + what + " is damaged"};
  }
  Status begin() {
    // SQLite may end a transaction by itself (a full disk): its own state counts.
    return is_in_transaction() ? ok() : run("BEGIN");
  }
  // What it was made of changes.
  Status drop_index() const {
    const Status dropped = run("DELETE FROM place_index");
    return dropped ? run("DELETE FROM place_poses") : dropped;
  }
  bool is_in_transaction() const { return sqlite3_get_autocommit(handle.get()) == 0; }
  static Result<std::unique_ptr<Database>> connect(const std::filesystem::path& path, int flags) {
    auto database = std::make_unique<Database>();
    database->file = path.string();
    std::error_code failure;
    const bool is_there = std::filesystem::exists(path, failure);
    if ((flags & SQLITE_OPEN_READWRITE) != 0 && !path.empty() && (is_there || (flags & SQLITE_OPEN_CREATE) != 0)) {
      auto taken = store_internal::WriterLock::take(path);
      if (!taken) return taken.error();
      database->lock.emplace(*std::move(taken));
      if ((flags & SQLITE_OPEN_CREATE) != 0 && std::filesystem::exists(path, failure))
        return Error{path.string() + ": exists already"};
    }
    sqlite3* handle = nullptr;
    const int code = sqlite3_open_v2(path.c_str(), &handle, flags, nullptr);
    database->handle.reset(handle);
    if (code != SQLITE_OK) return Error{path.string() + ": cannot be opened as a map: " + sqlite3_errstr(code)};
    constexpr int kPatience_ms = 2000;  // with another program that writes at the moment
    sqlite3_busy_timeout(handle, kPatience_ms);
    if (const Status status = store_internal::add_checksum_function(handle, database->file); !status)
      return status.error();
    return database;
  }
  // A commit is on the disk when it returns: it survives the end of the program, and of the power.
  Status journal() {
    writes = true;
    for (const char* sql : {"PRAGMA journal_mode=WAL", "PRAGMA synchronous=FULL", "PRAGMA cache_size=-8000"})
      if (const Status status = run(sql); !status) return status;
    return ok();
  }
  // A map that nobody writes is one file, which may be copied, and read where nothing can be written.
  ~Database() { (void)end_writing(); }
  Status end_writing() {
    if (!handle || !std::exchange(writes, false)) return ok();
    if (is_in_transaction()) (void)run("ROLLBACK");
    // Each step gives a page back.
    for (store_internal::Statement vacuum = prepare("PRAGMA incremental_vacuum"); vacuum.step();) continue;
    Status ended = run("PRAGMA wal_checkpoint(TRUNCATE)");
    if (ended) ended = run("PRAGMA journal_mode=DELETE");
    lock.reset();
    return ended;
  }
  bool writes = false;
  int version = store_internal::kVersion;

  Database() = default;
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;
};

}  // namespace revisit
